//! Eqs. (19) to (22): the recursion as printed, on the ten photographs of our Table III run.

use super::{Finding, number};
use crate::table3::Table3;
use krait_model::Snake;
use krait_model::oracle::F_S_N;
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// The paper's sigma on epsilon for 1 deg, m.
const SIGMA_M: f64 = 0.0294e-3;

/// P_k of Eq. (19) is of the last measurement only.
pub fn covariance_of_eq_19(snake: &Snake, table: &Table3) -> Finding {
    let information: Vec<Matrix2<f64>> = table.rows.iter().map(|row| information(snake, row.photograph.0)).collect();
    let last = information.last().copied().unwrap_or_default();
    let [of_last, of_all] = [last, information.iter().sum()].map(|m| sd(&m));
    Finding {
        place: "Eq. (19)",
        printed: "P_k = (H_k^T H_k)^-1, and S with H_(k+1)",
        correct: "P is of all measurements so far, S and the innovation use the new rows only, P_(k+1) = (I - S H) P_k",
        numbers: vec![
            number("sd of eta with the rows and noise of the paper, P of the tenth pose only", of_last.x, ""),
            number("P of all ten", of_all.x, ""),
            number("sd of lambda, P of the tenth pose only", of_last.y * 1e3, "mm"),
            number("P of all ten", of_all.y * 1e3, "mm"),
        ],
    }
}

/// Eq. (20) subtracts newtons from millimetres.
pub fn units_of_eq_20(snake: &Snake, table: &Table3) -> Finding {
    // In the paper's units, N and mm.
    let (k_d, k_c) = (snake.k_d_n_per_m() * 1e-3, snake.k_c_n_per_m() * 1e-3);
    let (g, f_s) = (snake.capstan(), F_S_N);
    let as_printed = solve(snake, table, false, |tau, s| (Vector2::new((k_d + g * k_c) * tau, 1.0), g * f_s * s.abs()));
    let corrected =
        solve(snake, table, true, |tau, s| (Vector2::new((1.0 / k_d + g / k_c) * tau, s), g * f_s / k_c * s));
    Finding {
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
            number("eta of the recursion, last row", table.eta, ""),
            number("lambda of the recursion, last row", table.lambda_mm, "mm"),
        ],
    }
}

/// The +- of Eq. (22) are variances, of row 9.
pub fn plus_minus_of_eq_22(table: &Table3) -> Finding {
    let (eta_sd, lambda_sd_mm) = table.rows.last().map_or((f64::NAN, f64::NAN), |row| (row.eta_sd, row.lambda_sd_mm));
    Finding {
        place: "Eq. (22), Table III",
        printed: "eta 1.220 +- 0.0019, lambda 0.1778 +- 0.0005 mm",
        correct: "the values of row 9 of ten, and the +- are variances: their roots are the standard deviations",
        numbers: vec![
            number("root of 0.0019", table.printed.eta_plus_minus.sqrt(), ""),
            number("root of 0.0005 mm2", table.printed.lambda_plus_minus_mm.sqrt(), "mm"),
            number("sd of eta after our ten poses at 1 deg", eta_sd, ""),
            number("sd of lambda", lambda_sd_mm, "mm"),
        ],
    }
}

/// H^T H / sigma^2 of the three rows of one pose on the way out.
fn information(snake: &Snake, bend_rad: Vector2<f64>) -> Matrix2<f64> {
    let tau_n = snake.tau_n(bend_rad);
    let compliance = snake.loading_compliance_m_per_n();
    let rows = (0..3).map(|i| Vector2::new(compliance * tau_n[i], tau_n[i].signum()) / SIGMA_M);
    rows.map(|h| h * h.transpose()).sum()
}

fn sd(information: &Matrix2<f64>) -> Vector2<f64> {
    information.try_inverse().map_or(Vector2::repeat(f64::NAN), |p| p.diagonal().map(f64::sqrt))
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
