//! How errors spread: root mean square, 95th percentile, largest.

use serde::Serialize;

/// Root mean square, 95th percentile and largest of some sizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// The spread of sizes, none of them negative; zero for none.
    pub fn of(mut sizes: Vec<f64>) -> Self {
        let place = sizes.len().saturating_sub(1) * 95 / 100;
        let Some(max) = sizes.iter().copied().max_by(f64::total_cmp) else { return Self::default() };
        let rms = (sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len() as f64).sqrt();
        let (_, p95, _) = sizes.select_nth_unstable_by(place, f64::total_cmp);
        Self { rms, p95: *p95, max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_of_one_to_hundred_is_known() {
        let spread = Spread::of((1..=101).rev().map(f64::from).collect());
        assert_eq!((spread.p95, spread.max), (96.0, 101.0));
        assert!((spread.rms.powi(2) - 102.0 * 203.0 / 6.0).abs() < 1e-9);
        assert_eq!(Spread::of(Vec::new()), Spread::default());
    }
}
