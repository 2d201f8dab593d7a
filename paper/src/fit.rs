//! eta and the half-width of the play from photographs, with the measured or with the predicted bend in Eq. (20).
//!
//! Each photograph gives two equations, J+ (q(b) + eps(b; eta, h) - q~) = 0 at the true bend b, with eps of Eq. (18) and the
//! signs of motion. As the paper puts it, the measured bend w stands for b on both sides: its noise is then in the load that
//! eta multiplies, and pulls eta down. The remedy takes b^(q~; eta, h), which the encoders and the current estimate predict,
//! and compares it with w: residual w - b^, row d b^ / d (eta, h) = -K^-1 J+ [C tau(b^), s], K = J+ (J + alpha).

use krait_model::{Psi, Snake};
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// One photograph with what the encoders told.
#[derive(Clone, Copy, Debug)]
pub struct Photograph {
    /// Measured bend vector, rad.
    pub bend_rad: Vector2<f64>,
    /// Actuator positions, m.
    pub q_tilde_m: Vector3<f64>,
    /// Direction in which each line moved last, +1 pushed, -1 drawn.
    pub signs: Vector3<f64>,
}

/// Which bend the loads are computed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loads {
    /// The measured one.
    AtMeasuredBend,
    /// The one that encoders and estimate predict.
    AtPredictedBend,
}

/// What is believed before the first photograph.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// eta, 1, and half-width, m.
    pub value: Vector2<f64>,
    /// Their standard deviations.
    pub sd: Vector2<f64>,
}

/// krait's own: eta 1 with 0.3, no play with 0.1 mm.
pub const KRAITS_PRIOR: Prior = Prior { value: Vector2::new(1.0, 0.0), sd: Vector2::new(0.3, 0.1e-3) };

/// eta and half-width with their covariance.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorFit {
    /// eta, 1, and half-width, m.
    pub value: Vector2<f64>,
    /// Covariance of the two.
    pub covariance: Matrix2<f64>,
}

impl EstimatorFit {
    /// Standard deviations of eta and half-width, m.
    pub fn sd(&self) -> Vector2<f64> {
        self.covariance.diagonal().map(f64::sqrt)
    }
}

const MAX_ITERATIONS: u32 = 60;
/// Steps of eta, and of the half-width in 0.1 mm, that count as none.
const SETTLED: f64 = 1e-9;

/// Fits eta and half-width; `None` where the photographs (and the prior) do not determine both.
pub fn fit(
    snake: &Snake,
    photographs: &[Photograph],
    sigma_rad: f64,
    loads: Loads,
    prior: Option<Prior>,
) -> Option<EstimatorFit> {
    let mut value = prior.map_or(Vector2::new(1.0, 0.0), |p| p.value);
    for _ in 0..MAX_ITERATIONS {
        let (mut information, mut right) = (Matrix2::zeros(), Vector2::zeros());
        if let Some(prior) = prior {
            let weights = Matrix2::from_diagonal(&prior.sd.map(|sd| sd.powi(-2)));
            information += weights;
            right += weights * (prior.value - value);
        }
        for photograph in photographs {
            let (residual, slope) = compared(snake, photograph, value, loads)?;
            information += slope.transpose() * slope / sigma_rad.powi(2);
            right += slope.transpose() * residual / sigma_rad.powi(2);
        }
        let covariance = scaled_inverse(&information)?;
        let step = covariance * right;
        value += step;
        if step.x.abs() < SETTLED && step.y.abs() < SETTLED * 1e-4 {
            return Some(EstimatorFit { value, covariance });
        }
    }
    None
}

/// The inverse of an information matrix whose second parameter is in metres; `None` where it is singular to rounding.
fn scaled_inverse(information: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let scale = Matrix2::from_diagonal(&information.diagonal().map(|d| 1.0 / d.sqrt()));
    let unit = scale * information * scale;
    (unit.determinant() > 1e-12).then(|| unit.try_inverse()).flatten().map(|inverse| scale * inverse * scale)
}

/// Measured minus predicted bend, rad, and the slope of the prediction.
fn compared(
    snake: &Snake,
    photograph: &Photograph,
    value: Vector2<f64>,
    loads: Loads,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let w = photograph.bend_rad;
    match loads {
        Loads::AtMeasuredBend => {
            let (excess, k_inverse) = equation(snake, photograph, w, value)?;
            Some((k_inverse * excess, slope(snake, photograph, w, value, &k_inverse)))
        }
        Loads::AtPredictedBend => {
            let mut b = w;
            for _ in 0..30 {
                let (excess, k_inverse) = equation(snake, photograph, b, value)?;
                let step = k_inverse * excess;
                b -= step;
                if step.norm() < 1e-13 {
                    break;
                }
            }
            let (_, k_inverse) = equation(snake, photograph, b, value)?;
            Some((w - b, slope(snake, photograph, b, value, &k_inverse)))
        }
    }
}

/// J+ (q + eps - q~) at a bend, rad, and K^-1; `None` for a bend beyond pi or an estimate that folds the equations.
fn equation(
    snake: &Snake,
    photograph: &Photograph,
    b: Vector2<f64>,
    value: Vector2<f64>,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    if Psi::from_bend(b).bend_angle_rad() >= core::f64::consts::PI {
        return None;
    }
    let extension = snake.extension_with_signs(b, value.x, value.y, &photograph.signs);
    let j_plus = snake.j_bend_q();
    let excess = j_plus * (snake.q(b) + extension.eps_m - photograph.q_tilde_m);
    let k: Matrix2<f64> = j_plus * (snake.j_q_bend() + extension.alpha_m_per_rad);
    Some((excess, k.try_inverse()?))
}

fn slope(
    snake: &Snake,
    photograph: &Photograph,
    b: Vector2<f64>,
    value: Vector2<f64>,
    k_inverse: &Matrix2<f64>,
) -> Matrix2<f64> {
    let tau_n = snake.tau_n(b);
    let columns = Matrix3x2::from_fn(|i, column| {
        let s = photograph.signs[i];
        let friction = snake.cone_load_with_sign(value.x * tau_n[i], s).slope;
        if column == 0 { (1.0 / snake.k_d_n_per_m() + friction / snake.k_c_n_per_m()) * tau_n[i] } else { s }
    });
    -k_inverse * snake.j_bend_q() * columns
}
