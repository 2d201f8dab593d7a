//! Root mean square, 95th percentile and largest value of errors.

use core::borrow::Borrow;
use serde::Serialize;

/// Root mean square, 95th percentile and largest of a set of magnitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// How many.
    pub n: usize,
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile of the absolute values.
    pub p95: f64,
    /// Largest absolute value.
    pub max: f64,
}

impl Spread {
    /// The spread of some values' magnitudes; all zero, `n` included, for none.
    pub fn of(values: impl IntoIterator<Item: Borrow<f64>>) -> Self {
        let mut sizes: Vec<f64> = values.into_iter().map(|value| value.borrow().abs()).collect();
        let n = sizes.len();
        let Some(max) = sizes.iter().copied().max_by(f64::total_cmp) else { return Self::default() };
        let rms = (sizes.iter().map(|size| size * size).sum::<f64>() / n as f64).sqrt();
        let (_, p95, _) = sizes.select_nth_unstable_by((n - 1) * 95 / 100, f64::total_cmp);
        Self { n, rms, p95: *p95, max }
    }

    /// The same, or nothing for no values.
    pub fn of_any(values: impl IntoIterator<Item: Borrow<f64>>) -> Option<Self> {
        Some(Self::of(values)).filter(|spread| spread.n > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_knows_its_rms_its_95_percent_and_its_maximum() {
        let spread = Spread::of((1..=100).map(|n| -f64::from(n)));
        assert_eq!((spread.n, spread.p95, spread.max), (100, 95.0, 100.0));
        assert!((spread.rms - 58.17).abs() < 0.01, "{}", spread.rms);
        assert_eq!(Spread::of_any([0.0; 0]), None);
    }
}
