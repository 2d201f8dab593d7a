//! What the paper claims, each with one verdict for the method as printed and one for the corrected one.

use crate::fig_10::RampRow;
use crate::fig_11::TurnRow;
use crate::neglected::Neglected;
use crate::table2::Table2;
use crate::table3::Table3;
use crate::{GOAL_DEG, Seeds};
use serde::Serialize;

/// A verdict and the numbers that it rests on.
#[derive(Clone, Debug, Serialize)]
pub struct ClaimVerdict {
    /// Whether the claim comes out.
    pub holds: bool,
    /// What comes out.
    pub found: String,
}

/// One claim.
#[derive(Clone, Debug, Serialize)]
pub struct Claim {
    /// Where in the paper.
    pub place: &'static str,
    /// What it says.
    pub claim: &'static str,
    /// With the paper's own method.
    pub printed: ClaimVerdict,
    /// With the corrected one.
    pub corrected: ClaimVerdict,
}

/// Everything that the verdicts rest on.
pub struct ClaimEvidence<'a> {
    pub table_2: &'a Table2,
    pub table_3: &'a Table3,
    pub fig_10: &'a [RampRow],
    pub fig_11: &'a [TurnRow],
    pub neglected: &'a Neglected,
    pub seeds: &'a Seeds,
}

/// Every claim, in the order of the paper.
pub fn all(e: &ClaimEvidence) -> Vec<Claim> {
    let mut claims = friction(e);
    claims.extend(neglected(e.neglected));
    claims.extend(accuracy(e));
    claims.extend(estimates(e.table_3));
    claims
}

fn claim(place: &'static str, claim: &'static str, printed: (bool, String), corrected: (bool, String)) -> Claim {
    let verdict = |(holds, found)| ClaimVerdict { holds, found };
    Claim { place, claim, printed: verdict(printed), corrected: verdict(corrected) }
}

fn friction(e: &ClaimEvidence) -> Vec<Claim> {
    let (t, p) = (e.table_2, &e.table_2.printed);
    let close = |found: f64, printed: f64, digit: f64| (found - printed).abs() <= digit;
    let (mu_holds, f_s_holds) = (close(t.mu, p.mu, 1e-4), close(t.f_s_n_with_g_10, p.f_s_n, 1e-3));
    let rows = &t.eq_14.dmu_of_rows;
    let some_row = rows
        .iter()
        .chain(&t.eq_14.dmu_of_rows_subtracted)
        .chain([&t.eq_14.dmu_of_mean_weights])
        .any(|dmu| close(*dmu, p.dmu, 5e-5));
    vec![
        claim(
            "Table II",
            "mu 0.1727, f_s 1.959 N",
            (mu_holds && f_s_holds, format!("{:.4}, {:.3} N with g = 10 m/s2", t.mu, t.f_s_n_with_g_10)),
            (
                mu_holds && close(t.f_s_n, p.f_s_n, 1e-3),
                format!(
                    "mu {:.4} +- {:.4}, f_s {:.3} +- {:.3} N with g = 9.80665 m/s2",
                    t.mu, t.se.mu, t.f_s_n, t.se.f_s_n
                ),
            ),
        ),
        claim(
            "Eq. (14)",
            "df_s 0.020 N",
            (
                close(t.eq_14.df_s_n_with_g_10, p.df_s_n, 5e-4),
                format!(
                    "{:.3} N added, {:.3} N subtracted, g = 10 m/s2",
                    t.eq_14.df_s_n_with_g_10, t.eq_14.df_s_n_subtracted_with_g_10
                ),
            ),
            (close(t.se.f_s_n, p.df_s_n, 5e-3), format!("standard error {:.3} N", t.se.f_s_n)),
        ),
        claim(
            "Eq. (14)",
            "dmu 0.0135",
            (some_row, format!("{:.4} (0 g) to {:.4} (1800 g), in no row the printed value", rows[0], rows[9])),
            (close(t.se.mu, p.dmu, 2e-3), format!("standard error {:.4}", t.se.mu)),
        ),
    ]
}

fn neglected(n: &Neglected) -> Vec<Claim> {
    let [a, b, c] = n.inside_bend_error_deg;
    let worst = n.inside_bend_error_deg.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    vec![
        claim(
            "text",
            "extension within the snake is negligible",
            (
                worst <= GOAL_DEG,
                format!("{:.2} % of C; {a:.2}, {b:.2}, {c:.2} deg at 30, 60, 80 deg", 100.0 * n.inside_part_of_c),
            ),
            (true, "negligible once it is in the model: eps gains tau L_i / (E A)".to_owned()),
        ),
        claim(
            "Eq. (16)",
            "tau~ / K_c is the cone's extension",
            (
                (n.capstan / n.m_loading - 1.0).abs() < 0.05,
                format!(
                    "loading {:.0} % too much, the loop {:.2} times too wide",
                    100.0 * (n.capstan / n.m_loading - 1.0),
                    n.loop_too_wide
                ),
            ),
            (
                true,
                format!(
                    "friction spread along the arcs gives m (tau +- f_s) / K_c, m = {:.4}, {:.4}",
                    n.m_loading, n.m_unloading
                ),
            ),
        ),
    ]
}

fn accuracy(e: &ClaimEvidence) -> Vec<Claim> {
    let ramp = |key: &str| e.fig_10.iter().find(|row| row.key == key).map_or(f64::NAN, |row| row.there_deg.rms);
    let naive = ramp("naive");
    let printed = ramp("printed_1.22_0.178");
    let turn = |key: &str| {
        let row = e.fig_11.iter().find(|row| row.key == key);
        row.map_or([f64::NAN; 4], |r| {
            [
                r.turning.bend_deg.rms,
                r.turning.plane_deg.rms,
                r.from_straight.bend_deg.rms,
                r.from_straight.plane_deg.rms,
            ]
        })
    };
    let words = |[tb, tp, sb, sp]: [f64; 4]| {
        format!("bend / plane {tb:.2} / {tp:.2} deg rms turning, {sb:.2} / {sp:.2} from straight")
    };
    let (as_printed, corrected) = (turn("printed_1.22_0.178"), turn("motion_sign_own"));
    let within = |errors: [f64; 4]| errors.iter().all(|error| *error <= GOAL_DEG);
    let s = e.seeds;
    vec![
        claim(
            "Fig. 10",
            "naive compensation misses 1 deg",
            (naive > GOAL_DEG, format!("{naive:.2} deg rms")),
            (naive > GOAL_DEG, format!("{naive:.2} deg rms")),
        ),
        claim(
            "Fig. 10",
            "estimation reaches 1 deg",
            (
                printed <= GOAL_DEG,
                format!(
                    "{printed:.2} deg rms with Eq. (22), {:.2} with an own estimate of line 1",
                    ramp("printed_own_line1")
                ),
            ),
            (
                s.median_rms_deg <= GOAL_DEG,
                format!(
                    "{:.2} deg rms in the median of {} noisy estimates, {:.2} on the worst; within it on {:.0} %",
                    s.median_rms_deg,
                    s.n,
                    s.worst_rms_deg,
                    100.0 * s.part_within_goal
                ),
            ),
        ),
        claim(
            "Fig. 11",
            "equally good for other delta, theta",
            (within(as_printed), words(as_printed)),
            (within(corrected), words(corrected)),
        ),
    ]
}

fn estimates(t: &Table3) -> Vec<Claim> {
    let p = &t.as_printed;
    let row = |n: usize| p.printed[n - 1];
    let near = |v: (f64, f64)| (v.0 - t.printed.eta).abs() < 5e-4 && (v.1 - t.printed.lambda_mm).abs() < 5e-5;
    let (sd, last) = (p.sd_from_residuals, t.line_1.last);
    let is_sd = (p.variances.0.sqrt() - t.printed.eta_plus_minus).abs() < 1e-4;
    vec![
        claim(
            "Table III",
            "the recursion converges",
            (p.worst < 1e-4, format!("its ten rows come out of eleven photographs to {:.0e}", p.worst)),
            (
                true,
                format!(
                    "contrasts without noise: eta {:.4}, half-width {:.4} mm",
                    t.line_1.contrasts.0, t.line_1.contrasts.1
                ),
            ),
        ),
        claim(
            "Eq. (22)",
            "eta 1.220 +- 0.0019, lambda 0.1778 +- 0.0005 mm",
            (
                near(row(10)) && is_sd,
                format!(
                    "row 9 of ten; variances {:.4}, {:.4} mm2; residuals {:.3} mm rms",
                    p.variances.0, p.variances.1, p.residual_rms_mm
                ),
            ),
            (
                false,
                format!(
                    "+- {:.3}, {:.3} mm by its own residuals, {:.3}, {:.3} mm on the bench at 1 deg",
                    sd.0, sd.1, last.sd.0, last.sd.1
                ),
            ),
        ),
        claim(
            "Eq. (22)",
            "lambda is the backlash",
            (
                (t.line_1.lambda_closed_form_mm / t.true_lambda_mm - 1.0).abs() < 0.05,
                format!(
                    "line 1 alone gives {:.4} mm for a half-width of {:.4} mm",
                    t.line_1.lambda_closed_form_mm, t.true_lambda_mm
                ),
            ),
            (
                (t.line_1.contrasts.1 - t.true_lambda_mm).abs() < 1e-3,
                format!("contrasts give {:.4} mm, half of the play", t.line_1.contrasts.1),
            ),
        ),
    ]
}
