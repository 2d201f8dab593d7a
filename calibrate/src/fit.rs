//! Weighted nonlinear least squares for a few parameters, with what the data do not determine said by name.

use crate::CalibrateError;
use nalgebra::{DMatrix, DVector};

/// Values with their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct LeastSquares {
    /// The parameters.
    pub value: Vec<f64>,
    /// Their covariance from the stated errors of the readings.
    pub covariance: DMatrix<f64>,
    /// Sum of squares of the residuals in stated errors.
    pub chi2: f64,
    /// Readings minus parameters.
    pub dof: usize,
}

/// One parameter of a fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parameter {
    pub name: &'static str,
    pub start: f64,
    /// A step of this size matters.
    pub scale: f64,
}

/// chi2 per degree of freedom beyond which the law is refused.
const MAX_CHI2_PER_DOF: f64 = 3.0;
/// Part of a standard deviation by which the sum of a few squares may exceed that limit.
const ALLOWANCE: f64 = 4.0;
/// Smallest eigenvalue of the correlation of the columns that counts as determined.
const SINGULAR: f64 = 1e-9;
/// Steps that count as none, in scales of the parameters.
const SETTLED: f64 = 1e-7;
const MAX_ITERATIONS: u32 = 100;

impl LeastSquares {
    /// Standard error of a parameter: of the stated reading errors, widened where the readings scatter more.
    pub fn se(&self, k: usize) -> f64 {
        self.covariance[(k, k)].max(0.0).sqrt() * self.widening()
    }

    /// Correlation of two parameters, 1.
    pub fn correlation(&self, k: usize, l: usize) -> f64 {
        self.covariance[(k, l)] / (self.covariance[(k, k)] * self.covariance[(l, l)]).sqrt()
    }

    fn widening(&self) -> f64 {
        if self.dof == 0 { 1.0 } else { (self.chi2 / self.dof as f64).sqrt().max(1.0) }
    }

    /// Refuses readings that the law does not describe.
    ///
    /// # Errors
    /// [`CalibrateError::Misfit`].
    pub fn check(&self, advice: &'static str) -> Result<(), CalibrateError> {
        let dof = self.dof as f64;
        // For few readings chi2 itself scatters by sqrt(2 dof).
        let limit = (MAX_CHI2_PER_DOF * dof).max(dof + ALLOWANCE * (2.0 * dof).sqrt());
        if self.chi2 <= limit {
            return Ok(());
        }
        Err(CalibrateError::Misfit { chi2: self.chi2, dof: self.dof, limit, advice })
    }
}

/// Fits parameters to residuals in stated errors. `missing` says what determines a parameter, by its place.
pub(crate) fn fit(
    parameters: &[Parameter],
    residuals: impl Fn(&[f64]) -> Option<Vec<f64>>,
    missing: impl Fn(usize) -> String,
) -> Result<LeastSquares, CalibrateError> {
    let mut value: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let not_determined = |k: usize, found: &str| CalibrateError::NotDetermined {
        parameter: parameters[k].name,
        found: found.to_owned(),
        missing: missing(k),
    };
    let unsettled = || not_determined(0, "the fit does not settle");
    for _ in 0..MAX_ITERATIONS {
        let at = DVector::from_vec(residuals(&value).ok_or_else(unsettled)?);
        if at.len() < parameters.len() {
            return Err(not_determined(0, &format!("{} reading(s) for {} values", at.len(), parameters.len())));
        }
        let slope = slope(parameters, &value, &residuals).ok_or_else(unsettled)?;
        let normal = slope.transpose() * &slope;
        if let Some(k) = undetermined(&normal) {
            return Err(not_determined(k, "no reading depends on it, or only together with another value"));
        }
        let inverse = normal.try_inverse().ok_or_else(unsettled)?;
        let step = -(&inverse * slope.transpose() * &at);
        for (k, p) in parameters.iter().enumerate() {
            value[k] += step[k] * p.scale;
        }
        if step.amax() < SETTLED {
            let scale =
                DMatrix::from_diagonal(&DVector::from_iterator(parameters.len(), parameters.iter().map(|p| p.scale)));
            let covariance = &scale * inverse * &scale;
            let last = residuals(&value).ok_or_else(unsettled)?;
            let chi2 = last.iter().map(|r| r * r).sum();
            return Ok(LeastSquares { value, covariance, chi2, dof: last.len() - parameters.len() });
        }
    }
    Err(unsettled())
}

/// d residuals / d (value / scale) by central differences.
fn slope(
    parameters: &[Parameter],
    value: &[f64],
    residuals: &impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> Option<DMatrix<f64>> {
    let part = 1e-5;
    let mut columns = Vec::new();
    for (k, p) in parameters.iter().enumerate() {
        let moved = |sign: f64| {
            let mut trial = value.to_vec();
            trial[k] += sign * part * p.scale;
            residuals(&trial).map(DVector::from_vec)
        };
        columns.push((moved(1.0)? - moved(-1.0)?) / (2.0 * part));
    }
    Some(DMatrix::from_columns(&columns))
}

/// The parameter that a normal matrix leaves open.
pub(crate) fn undetermined(normal: &DMatrix<f64>) -> Option<usize> {
    let n = normal.nrows();
    let blind = |k: &usize| normal[(*k, *k)].is_nan() || normal[(*k, *k)] <= 1e-12;
    if let Some(k) = (0..n).find(blind) {
        return Some(k);
    }
    let unit = DMatrix::from_fn(n, n, |i, k| normal[(i, k)] / (normal[(i, i)] * normal[(k, k)]).sqrt());
    let eigen = unit.symmetric_eigen();
    let (at, smallest) = eigen.eigenvalues.argmin();
    if smallest > SINGULAR {
        return None;
    }
    Some(eigen.eigenvectors.column(at).map(f64::abs).argmax().0)
}
