//! Eqs. (19) to (22): the recursion as printed, on the photographs of Table III and on those of our own run.

use super::{PaperError, number};
use crate::reconstruction::PhotographRow;
use crate::table3::Table3;
use krait_model::Snake;
use krait_model::oracle::F_S_N;
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// Eq. (20) stacks every row, so that S must use the new one only.
pub fn stacked_rows_of_eq_20(table: &Table3) -> PaperError {
    let printed = &table.as_printed;
    let last = printed.rows.last().copied().unwrap_or((f64::NAN, f64::NAN));
    let stacked = every_row_again(&printed.photographs);
    PaperError {
        place: "Eqs. (19), (20)",
        printed: "H_k stacks the rows 1..k, and S = P_k H_(k+1)^T (1 + H_(k+1) P_k H_(k+1)^T)^-1 takes H_(k+1)",
        correct: "P_k = (H_k^T H_k)^-1 is of all rows so far, as printed; S and the innovation take the new row only, or the old ones count again",
        numbers: vec![
            number("largest difference from the ten printed rows, new row only", printed.worst, ""),
            number("eta of row 10, new row only", last.0, ""),
            number("eta of row 10, every row again at each step", stacked.x, ""),
            number("lambda of row 10, every row again at each step", stacked.y, "mm"),
        ],
    }
}

/// The last estimate where each step takes all rows so far once more.
fn every_row_again(rows: &[PhotographRow]) -> Vector2<f64> {
    let (mut information, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for n in 2..=rows.len() {
        for row in &rows[..n] {
            let h = Vector2::new(row.x_mm, 1.0);
            information += h * h.transpose();
            right += h * row.z_mm;
        }
    }
    information.try_inverse().map_or(Vector2::repeat(f64::NAN), |p| p * right)
}

/// Eq. (20) subtracts newtons from millimetres.
pub fn units_of_eq_20(snake: &Snake, table: &Table3) -> PaperError {
    // In the paper's units, N and mm.
    let (k_d, k_c) = (snake.k_d_n_per_m() * 1e-3, snake.k_c_n_per_m() * 1e-3);
    let (g, f_s) = (snake.capstan(), F_S_N);
    let as_printed = solve(snake, table, false, |tau, s| (Vector2::new((k_d + g * k_c) * tau, 1.0), g * f_s * s.abs()));
    let corrected =
        solve(snake, table, true, |tau, s| (Vector2::new((1.0 / k_d + g / k_c) * tau, s), g * f_s / k_c * s));
    PaperError {
        place: "Eq. (20)",
        printed: "z_k = eps - e^(2 mu phi) f_s; H_k with K_d, K_c",
        correct: "z_k = eps - e^(2 mu phi) f_s / K_c; H_k = [(1/K_d + e^(2 mu phi)/K_c) tau_k, s], three rows a pose",
        numbers: vec![
            number("what is subtracted as printed, a force", g * f_s, "N"),
            number("what should be, a length", g * f_s / k_c, "mm"),
            number("eta by batch least squares of the ten poses, as printed", as_printed.x, ""),
            number("corrected", corrected.x, ""),
            number("lambda as printed", as_printed.y, "mm"),
            number("corrected", corrected.y, "mm"),
            number("eta of contrasts at the predicted bend, last row", table.eta, ""),
            number("half-width of contrasts at the predicted bend, last row", table.lambda_mm, "mm"),
        ],
    }
}

/// The +- of Eq. (22) are variances, of row 9.
pub fn plus_minus_of_eq_22(table: &Table3) -> PaperError {
    let printed = &table.as_printed;
    PaperError {
        place: "Eq. (22), Table III",
        printed: "eta 1.220 +- 0.0019, lambda 0.1778 +- 0.0005 mm",
        correct: "the values of row 9 of ten, and the +- are variances: their roots are the standard deviations",
        numbers: vec![
            number("root of 0.0019", table.printed.eta_plus_minus.sqrt(), ""),
            number("root of 0.0005 mm2", table.printed.lambda_plus_minus_mm.sqrt(), "mm"),
            number("variance of eta by Eq. (21) from the table's own photographs", printed.variances.0, ""),
            number("variance of lambda by Eq. (21)", printed.variances.1, "mm2"),
            number("residual of the table's own photographs, rms", printed.residual_rms_mm, "mm"),
            number("sd of eta from these residuals", printed.sd_from_residuals.0, ""),
            number("sd of lambda from these residuals", printed.sd_from_residuals.1, "mm"),
        ],
    }
}

/// Batch least squares over the three lines of every pose, mm; `row` gives H and what is subtracted from eps.
///
/// With `contrasts` only what differs between the lines counts: their common part is preload.
fn solve(
    snake: &Snake,
    table: &Table3,
    contrasts: bool,
    row: impl Fn(f64, f64) -> (Vector2<f64>, f64),
) -> Vector2<f64> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (bend_rad, q_tilde_m) in table.rows.iter().map(|r| r.photograph) {
        let tau_n = snake.tau_n(bend_rad);
        let eps_mm: Vector3<f64> = (q_tilde_m - snake.q(bend_rad)) * 1e3;
        let rows: [(Vector2<f64>, f64); 3] = core::array::from_fn(|i| row(tau_n[i], tau_n[i].signum()));
        let mut h = Matrix3x2::from_fn(|i, k| rows[i].0[k]);
        let mut z = Vector3::from_fn(|i, _| eps_mm[i] - rows[i].1);
        if contrasts {
            let mean = h.row_mean();
            h.row_iter_mut().for_each(|mut line| line -= mean);
            z.add_scalar_mut(-z.mean());
        }
        normal += h.transpose() * h;
        right += h.transpose() * z;
    }
    normal.try_inverse().map_or(Vector2::repeat(f64::NAN), |inverse| inverse * right)
}

/// lambda of one line is not the play.
pub fn lambda_of_one_line(table: &Table3) -> PaperError {
    let line_1 = &table.line_1;
    let last = line_1.rows.last().copied().unwrap_or((f64::NAN, f64::NAN));
    PaperError {
        place: "Eq. (22), lambda",
        printed: "lambda, estimated from line 1, is the backlash",
        correct: "line 1 alone takes (4/3) (h + e^(2 mu phi) f_s / K_c) for lambda, h half of the play; contrasts of three lines give h",
        numbers: vec![
            number("half of the bench's play", table.true_lambda_mm, "mm"),
            number("(4/3) (h + e^(2 mu phi) f_s / K_c)", line_1.lambda_closed_form_mm, "mm"),
            number("line 1 alone, 11 poses without noise", last.1, "mm"),
            number("contrasts, the last 10 of them", line_1.contrasts.1, "mm"),
        ],
    }
}
