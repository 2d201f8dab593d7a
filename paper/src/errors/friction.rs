//! Eqs. (11) to (18): loads, friction, and terms that are the same on every line.

use super::{PaperError, number};
use crate::bench::{follow, one_way_ramp, there_and_back};
use crate::table2::Table2;
use krait_model::Snake;
use krait_sim::Truth;
use nalgebra::{Vector2, Vector3, Vector6};

/// The wrench of Eq. (9) is one that the snake exerts.
pub fn sign_of_the_wrench(snake: &Snake, truth: &Truth) -> anyhow::Result<PaperError> {
    let (bend, force_n) = (Vector2::new(45_f64.to_radians(), 0.0), 0.5);
    let helping = Vector6::new(force_n, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut pushed_truth = truth.clone();
    pushed_truth.effects = krait_sim::EffectsTruth::none();
    let free_truth = pushed_truth.clone();
    pushed_truth.effects.tip_force_in_base_n = [force_n, 0.0];
    // Each bench reaches 45 deg by itself: its command is that of the frictionless snake under the same force.
    let load_of = |truth: &Truth, tau_n: Vector3<f64>| -> anyhow::Result<f64> {
        let q_tilde_m = snake.q(bend) + tau_n * snake.frictionless_compliance_m_per_n();
        let poses = follow(truth, &[bend], |_| q_tilde_m)?;
        Ok(poses.first().map_or(f64::NAN, |p| p.tau_tilde_n.x))
    };
    let with_force = snake.tau_with_wrench_n(bend, &helping);
    Ok(PaperError {
        place: "Eq. (9)",
        printed: "grad E + J_x^T w; Eq. (11) then leaves the wrench out",
        correct: "grad E - J_x^T w for a wrench w on the snake; the printed sign is that of the wrench the snake exerts",
        numbers: vec![
            number("line 1 at 45 deg without force, model", snake.tau_n(bend).x, "N"),
            number("the same, bench", load_of(&free_truth, snake.tau_n(bend))?, "N"),
            number("0.5 N on the tip that helps to bend, model", with_force.x, "N"),
            number("the same, bench", load_of(&pushed_truth, with_force)?, "N"),
            number("the same, sign as printed", snake.tau_with_wrench_n(bend, &-helping).x, "N"),
        ],
    })
}

/// f_s was computed with g = 10 m/s2.
pub fn gravity(table: &Table2) -> PaperError {
    PaperError {
        place: "Table II, f_s",
        printed: "1.959 N",
        correct: "1.921 N: the printed value comes out with g = 10 m/s2",
        numbers: vec![
            number("with g = 9.80665 m/s2", table.f_s_n, "N"),
            number("with g = 10 m/s2", table.f_s_n_with_g_10, "N"),
        ],
    }
}

/// Eq. (14) is ten times larger than printed.
pub fn error_of_f_s(table: &Table2) -> PaperError {
    let eq_14 = &table.eq_14;
    PaperError {
        place: "Table II, Eq. (14), df_s",
        printed: "weights +-25 g and +-1 g, df_s = 0.020 N",
        correct: "0.205 N with the paper's g = 10 m/s2, ten times as much; errors add, they do not subtract",
        numbers: vec![
            number("residual rms", table.residual_g.rms, "g"),
            number("residual max", table.residual_g.max, "g"),
            number("df_s, errors added, g = 10 m/s2", eq_14.df_s_n_with_g_10, "N"),
            number("df_s, subtracted as printed, g = 10 m/s2", eq_14.df_s_n_subtracted_with_g_10, "N"),
            number("df_s, errors added, g = 9.80665 m/s2", eq_14.df_s_n, "N"),
            number("standard error of the fit, from its residuals", table.se.f_s_n, "N"),
            number("standard error of the fit, from 25 g and 1 g", table.se_of_25_g.f_s_n, "N"),
        ],
    }
}

/// The printed dmu belongs to no row of Table II.
pub fn error_of_mu(table: &Table2) -> PaperError {
    let rows = &table.eq_14.dmu_of_rows;
    PaperError {
        place: "Table II, Eq. (14), dmu",
        printed: "dmu = 0.0135",
        correct: "Eq. (14) depends on the row and gives the printed value for none, added or subtracted; the fit's standard error is smaller",
        numbers: vec![
            number("dmu of the first row, 0 g", rows[0], ""),
            number("dmu at 1150 g", rows[6], ""),
            number("dmu at 1500 g", rows[7], ""),
            number("dmu of the last row, 1800 g", rows[9], ""),
            number("dmu at 1150 g, errors subtracted as printed", table.eq_14.dmu_of_rows_subtracted[6], ""),
            number("dmu at 1500 g, errors subtracted as printed", table.eq_14.dmu_of_rows_subtracted[7], ""),
            number("dmu at the mean weights", table.eq_14.dmu_of_mean_weights, ""),
            number("load at which 25 g alone give 0.0135", table.eq_14.tau_tilde_for_printed_dmu_g, "g"),
            number("standard error of the fit, from its residuals", table.se.mu, ""),
        ],
    }
}

/// The loading branch is used on the way back, too.
pub fn loading_branch(snake: &Snake, truth: &Truth) -> anyhow::Result<PaperError> {
    let mut without_play = truth.clone();
    without_play.effects.play_m = 0.0;
    let eta = truth.effects.load_scale;
    let poses =
        follow(&without_play, &there_and_back(), |b| snake.q(b) + snake.extension_as_printed(b, eta, 0.0).eps_m)?;
    let n_there = one_way_ramp().len();
    let largest = |poses: &[_]| poses.iter().map(crate::bench::bend_error_deg).fold(0.0_f64, |m, e| m.max(e.abs()));
    let (there, back) = poses.split_at(n_there.min(poses.len()));
    Ok(PaperError {
        place: "Eq. (13)",
        printed: "tau~ = e^(2 mu phi) (tau + f_s) whatever the line does",
        correct: "f_s and the exponent take the sign of the line's motion",
        numbers: vec![
            number("largest error of the bend while bending, bench without play, eta known", largest(there), "deg"),
            number("largest error on the way back", largest(back), "deg"),
        ],
    })
}

/// A uniform lambda cannot bend the snake.
pub fn uniform_lambda(snake: &Snake, truth: &Truth) -> anyhow::Result<PaperError> {
    let (eta, lambda_m) = (truth.effects.load_scale, truth.effects.play_m);
    let reached = |lambda_m| -> anyhow::Result<f64> {
        let path = one_way_ramp();
        let poses = follow(truth, &path, |b| snake.q(b) + snake.extension_as_printed(b, eta, lambda_m).eps_m)?;
        Ok(poses.last().map_or(f64::NAN, |p| p.reached_rad.x.to_degrees()))
    };
    let rest = |lambda_m| {
        let bend = Vector2::new(80_f64.to_radians(), 0.0);
        let q_tilde_m = snake.q(bend) + snake.extension_as_printed(bend, eta, lambda_m).eps_m;
        snake.equilibrium(q_tilde_m, snake.loading_compliance_m_per_n(), eta)
    };
    let (without, with) = (rest(0.0), rest(lambda_m));
    Ok(PaperError {
        place: "Eq. (18), lambda",
        printed: "the same lambda on all three lines",
        correct: "it preloads the lines and cannot bend the snake: sum cos delta_i = sum sin delta_i = 0; play acts with the sign of each line's motion",
        numbers: vec![
            number(
                "bend gained by lambda = 0.178 mm at 80 deg, model",
                (with.bend_rad - without.bend_rad).norm().to_degrees(),
                "deg",
            ),
            number("bend gained on the bench", reached(lambda_m)? - reached(0.0)?, "deg"),
            number("preload gained, model", with.tau_common_n - without.tau_common_n, "N"),
        ],
    })
}

/// A uniform f_s does not act on psi either.
pub fn uniform_f_s(snake: &Snake) -> PaperError {
    let bend = Vector2::new(45_f64.to_radians(), 0.0);
    let eps_m = snake.extension_naive(bend).eps_m;
    let elastic_m = snake.tau_n(bend) * snake.loading_compliance_m_per_n();
    let by_f_s_m = eps_m - elastic_m;
    PaperError {
        place: "Eqs. (13), (16), f_s",
        printed: "+f_s on pulled and pushed lines alike",
        correct: "common to all lines, no effect on psi; with the sign of motion it has one",
        numbers: vec![
            number("extension by f_s, every line", by_f_s_m.mean() * 1e3, "mm"),
            number("bend that it makes", snake.bend_from_q(by_f_s_m).norm().to_degrees(), "deg"),
        ],
    }
}
