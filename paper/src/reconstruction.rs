//! Table III as printed: the photographs that its own rows contain, and the recursion that prints them again.
//!
//! For one line and one row a photograph, z = eta x + lambda with x = C tau_1 at eta 1, each step of recursive least squares
//! moves the estimate along P h. The ratio of the steps of lambda and eta gives x of the new photograph, their size gives z.
//! Two unknowns remain, the first two x; the variances printed with Eq. (22) fix them.

use anyhow::Context;
use krait_model::Snake;
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

/// Table III as printed: eta, and lambda in mm, after each estimate.
pub const PRINTED_ROWS: [(f64, f64); 10] = [
    (1.5240, 0.1194),
    (1.6564, 0.1085),
    (1.5666, 0.1191),
    (1.4359, 0.1394),
    (1.2689, 0.1723),
    (1.2453, 0.1777),
    (1.2480, 0.1770),
    (1.2209, 0.1853),
    (1.2198, 0.1778),
    (1.2210, 0.1765),
];
/// What stands behind the +- of Eq. (22): variances, 1 and mm2.
const PRINTED_VARIANCES: (f64, f64) = (0.0019, 0.0005);
/// The paper's sigma on eps, mm.
pub const SIGMA_MM: f64 = 0.0294;
/// x of the first two photographs from which the search starts, mm.
const START_MM: (f64, f64) = (0.02, 0.22);

/// One photograph of line 1, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PhotographRow {
    /// C tau_1 at eta 1.
    pub x_mm: f64,
    /// eps - e^(2 mu phi) f_s / K_c.
    pub z_mm: f64,
}

/// The photographs of Table III and what follows from them.
#[derive(Clone, Debug, Serialize)]
pub struct Reconstruction {
    /// The eleven photographs.
    pub photographs: Vec<PhotographRow>,
    /// The bend that each shows, deg.
    pub bend_deg: Vec<f64>,
    /// The ten estimates of the recursion.
    pub rows: Vec<(f64, f64)>,
    /// The ten estimates as printed.
    pub printed: [(f64, f64); 10],
    /// Largest difference between the two.
    pub worst: f64,
    /// Variances of eta and lambda (mm2) by Eq. (21) with the paper's sigma.
    pub variances: (f64, f64),
    /// What the last row leaves over of each photograph, mm.
    pub residuals_mm: Vec<f64>,
    /// Root mean square of it, mm.
    pub residual_rms_mm: f64,
    /// Standard deviations of eta and lambda (mm) from these residuals.
    pub sd_from_residuals: (f64, f64),
    /// Standard deviations of the first row, which rests on two photographs.
    pub sd_of_first: (f64, f64),
}

/// Recursive least squares of z = eta x + lambda: the estimates after 2, 3 ... photographs, and P.
pub fn recursion(rows: &[PhotographRow]) -> Option<(Vec<Vector2<f64>>, Matrix2<f64>)> {
    let (first, later) = rows.split_at_checked(2)?;
    let mut p = normal(first).try_inverse()?;
    let right: Vector2<f64> = first.iter().map(|r| h(r) * r.z_mm).sum();
    let mut estimates = vec![p * right];
    let mut x = p * right;
    for row in later {
        let p_h = p * h(row);
        let gain = p_h / (1.0 + h(row).dot(&p_h));
        x += gain * (row.z_mm - h(row).dot(&x));
        p -= gain * p_h.transpose();
        estimates.push(x);
    }
    Some((estimates, p))
}

/// Variances of eta and lambda by Eq. (21).
pub fn variances(rows: &[PhotographRow]) -> Option<Vector2<f64>> {
    Some(normal(rows).try_inverse()?.diagonal() * SIGMA_MM.powi(2))
}

fn h(row: &PhotographRow) -> Vector2<f64> {
    Vector2::new(row.x_mm, 1.0)
}

fn normal(rows: &[PhotographRow]) -> Matrix2<f64> {
    rows.iter().map(|row| h(row) * h(row).transpose()).sum()
}

/// Reconstructs the photographs from the printed rows.
pub fn reconstruct(snake: &Snake) -> anyhow::Result<Reconstruction> {
    let photographs = photographs().context("the photographs behind Table III could not be found")?;
    let (estimates, p) = recursion(&photographs).context("the reconstructed photographs determine nothing")?;
    let last = vector(PRINTED_ROWS[PRINTED_ROWS.len() - 1]);
    let residuals_mm: Vec<f64> = photographs.iter().map(|r| r.z_mm - h(r).dot(&last)).collect();
    let square_mm2: f64 = residuals_mm.iter().map(|e| e * e).sum();
    let n = photographs.len() as f64;
    let differences = estimates.iter().zip(PRINTED_ROWS).map(|(e, printed)| (e - vector(printed)).amax());
    let worst = differences.fold(0.0, f64::max);
    let sd = |v: Vector2<f64>| (v.x.sqrt(), v.y.sqrt());
    let two = photographs.get(..2).and_then(variances).context("two photographs determine a line")?;
    let all = variances(&photographs).context("the photographs determine a line")?;
    Ok(Reconstruction {
        bend_deg: photographs.iter().map(|r| bend_of_load_deg(snake, r.x_mm)).collect(),
        rows: estimates.iter().map(|e| (e.x, e.y)).collect(),
        printed: PRINTED_ROWS,
        worst,
        variances: (all.x, all.y),
        residual_rms_mm: (square_mm2 / n).sqrt(),
        sd_from_residuals: sd(p.diagonal() * (square_mm2 / (n - 2.0))),
        sd_of_first: sd(two),
        residuals_mm,
        photographs,
    })
}

/// Newton's method on the first two x, until Eq. (21) gives the printed variances.
fn photographs() -> Option<Vec<PhotographRow>> {
    let misfit = |x: Vector2<f64>| {
        let found = variances(&inverted(x)?)?;
        Some(Vector2::new((found.x / PRINTED_VARIANCES.0).ln(), (found.y / PRINTED_VARIANCES.1).ln()))
    };
    let mut x = vector(START_MM);
    let step = 1e-7;
    for _ in 0..50 {
        let at = misfit(x)?;
        let mut slope = Matrix2::zeros();
        for k in 0..2 {
            let mut e = Vector2::zeros();
            e[k] = step;
            slope.set_column(k, &((misfit(x + e)? - misfit(x - e)?) / (2.0 * step)));
        }
        x -= slope.try_inverse()? * at;
        if at.norm() < 1e-10 {
            return inverted(x);
        }
    }
    None
}

/// The photographs that make plain recursive least squares print Table III, for the first two x, mm.
fn inverted(first: Vector2<f64>) -> Option<Vec<PhotographRow>> {
    let start = vector(PRINTED_ROWS[0]);
    let mut rows: Vec<PhotographRow> =
        first.iter().map(|x| PhotographRow { x_mm: *x, z_mm: start.dot(&Vector2::new(*x, 1.0)) }).collect();
    for pair in PRINTED_ROWS.windows(2) {
        let (before, after) = (vector(pair[0]), vector(pair[1]));
        let moved = after - before;
        let ratio = moved.y / moved.x;
        let (n, sum, squares) = (rows.len() as f64, sum(&rows, 1), sum(&rows, 2));
        let x_mm = (squares + ratio * sum) / (ratio * n + sum);
        // The step is P h times the innovation, with P after the new photograph.
        let new = PhotographRow { x_mm, z_mm: 0.0 };
        rows.push(new);
        let gain = normal(&rows).try_inverse()? * h(&new);
        let z_mm = before.dot(&h(&new)) + moved.dot(&gain) / gain.norm_squared();
        rows.last_mut()?.z_mm = z_mm;
    }
    Some(rows)
}

fn sum(rows: &[PhotographRow], power: i32) -> f64 {
    rows.iter().map(|row| row.x_mm.powi(power)).sum()
}

/// Bend in the plane delta = 0, deg, at which C |tau_1| is x, mm, for eta 1.
fn bend_of_load_deg(snake: &Snake, x_mm: f64) -> f64 {
    let load_mm = |b: f64| 1e3 * snake.loading_compliance_m_per_n() * snake.tau_n(Vector2::new(b, 0.0)).x.abs();
    let (mut low, mut high) = (0.0, core::f64::consts::FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if load_mm(middle) < x_mm { low = middle } else { high = middle }
    }
    low.to_degrees()
}

fn vector((eta, lambda_mm): (f64, f64)) -> Vector2<f64> {
    Vector2::new(eta, lambda_mm)
}
