//! Eqs. (2), (7) and (26), and the radius that Table I leaves out.

use super::{Number, PaperError, number};
use anyhow::Context;
use core::f64::consts::FRAC_PI_2;
use krait_model::{Psi, Snake};
use nalgebra::{Vector2, Vector3};

/// Eq. (2) divides by cos delta_i.
pub fn division_by_one_cosine(snake: &Snake) -> PaperError {
    let error_m = 1e-6;
    let bend_rad = 45_f64.to_radians();
    let delta_rad = 89_f64.to_radians();
    let bend = Vector2::new(delta_rad.cos(), delta_rad.sin()) * bend_rad;
    let q_m = snake.q(bend) + Vector3::new(error_m, 0.0, 0.0);
    let from_line_1 = -q_m.x / (snake.r_m() * delta_rad.cos());
    let from_all = snake.bend_from_q(q_m).norm();
    PaperError {
        place: "Eqs. (2), (5)",
        printed: "the bend from one line, divided by cos delta_i",
        correct: "least squares over the three lines: no false singularity",
        numbers: vec![
            number(
                "error of the bend by 1 um on line 1 at delta = 89 deg, Eq. (2)",
                (from_line_1 - bend_rad).to_degrees(),
                "deg",
            ),
            number("the same, all three lines", (from_all - bend_rad).to_degrees(), "deg"),
        ],
    }
}

/// Eq. (7)'s second row has theta_L where theta_L - theta_0 belongs.
pub fn second_row_of_eq_7(snake: &Snake) -> anyhow::Result<PaperError> {
    let entry = |theta_deg: f64| -> anyhow::Result<f64> {
        let psi = Psi { theta_l_rad: theta_deg.to_radians(), delta_rad: 0.4 };
        let mut j = snake.j_psi_q12(psi).context("a bent pose has a plane")?;
        // As printed: theta_L squared under the row instead of (theta_L - theta_0) squared.
        let as_printed = ((psi.theta_l_rad - FRAC_PI_2) / psi.theta_l_rad).powi(2);
        j.row_mut(1).scale_mut(as_printed);
        Ok((j * snake.j_q_psi(psi).fixed_rows::<2>(0))[(1, 1)])
    };
    Ok(PaperError {
        place: "Eq. (7)",
        printed: "theta_L^2 in the second row of J_psi_q",
        correct: "(theta_L - theta_0)^2: J_psi_q J_q_psi is then the identity",
        numbers: vec![
            number("d delta / d delta as printed, 1 if right, at theta_L = 30 deg", entry(30.0)?, ""),
            number("at 60 deg", entry(60.0)?, ""),
            number("at 80 deg", entry(80.0)?, ""),
        ],
    })
}

/// r follows from the paper's own sigma.
pub fn radius(snake: &Snake) -> PaperError {
    let printed_sigma_mm = 0.0294;
    PaperError {
        place: "Table I",
        printed: "no pitch radius; \"1 deg equals 0.0294 mm\" on epsilon",
        correct: "r follows from it",
        numbers: vec![
            number("0.0294 mm / 1 deg", printed_sigma_mm / 1_f64.to_radians(), "mm"),
            number("r in use", snake.r_m() * 1e3, "mm"),
        ],
    }
}

/// Eq. (26) from lines 1 and 2 takes common displacement for bend.
pub fn two_lines_of_eq_26(snake: &Snake) -> anyhow::Result<PaperError> {
    let common = Vector3::repeat(0.178e-3);
    let (mut by_j, mut by_j_tilde): (Vec<Number>, Vec<Number>) = (Vec::new(), Vec::new());
    let mut by_all = 0.0_f64;
    let planes = [
        (0_f64, "delta = 0, J", "delta = 0, J~"),
        (30.0, "delta = 30 deg, J", "delta = 30 deg, J~"),
        (-60.0, "delta = -60 deg, J", "delta = -60 deg, J~"),
    ];
    for (delta_deg, j_name, j_tilde_name) in planes {
        let psi = Psi { theta_l_rad: 45_f64.to_radians(), delta_rad: delta_deg.to_radians() };
        let alpha = snake.alpha_psi(&snake.extension_naive(psi.bend()), psi);
        let two = snake.j_psi_q12(psi).context("a bent pose has a plane")? * common.xy();
        let two_tilde = snake.j_tilde_psi_q12(psi, &alpha).context("a bent pose has a plane")? * common.xy();
        let three = snake.j_tilde_psi(psi, &alpha).context("a bent pose has a plane")? * common;
        by_all = by_all.max(three.x.abs());
        by_j.push(number(j_name, two.x.to_degrees(), "deg"));
        by_j_tilde.push(number(j_tilde_name, two_tilde.x.to_degrees(), "deg"));
    }
    by_j.extend(by_j_tilde);
    by_j.push(number("all three lines, any plane, J~", by_all.to_degrees(), "deg"));
    Ok(PaperError {
        place: "Eq. (26)",
        printed: "J~ from lines 1 and 2",
        correct: "from all three: a common displacement, here 0.178 mm at a bend of 45 deg, is preload and bends nothing",
        numbers: by_j,
    })
}
