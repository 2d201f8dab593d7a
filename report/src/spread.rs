//! Root mean square, 95th percentile and largest value of errors.

use serde::Serialize;

/// Root mean square, 95th percentile and largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile of the absolute values.
    pub p95: f64,
    /// Largest absolute value.
    pub max: f64,
}

impl Spread {
    /// The spread of some values; zero for none.
    pub fn of(values: &[f64]) -> Self {
        let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let Some(max) = sizes.last().copied() else { return Self::default() };
        let rms = (sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len() as f64).sqrt();
        Self { rms, p95: sizes[(sizes.len() - 1) * 95 / 100], max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_knows_its_rms_its_95_percent_and_its_maximum() {
        let values: Vec<f64> = (1..=100).map(|n| -f64::from(n)).collect();
        let spread = Spread::of(&values);
        assert_eq!((spread.p95, spread.max), (95.0, 100.0));
        assert!((spread.rms - 58.17).abs() < 0.01, "{}", spread.rms);
    }
}
