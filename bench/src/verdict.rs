//! Whether figures keep their budget: limits on p50, p99 and worst as multiples of the floor that was measured beside them.

use crate::figures::Quantiles;
use serde::Serialize;

/// Limits of a latency as multiples of the floor's own quantile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioLimits {
    /// Of the median.
    pub p50: f64,
    /// Of the 99th percentile.
    pub p99: f64,
    /// Of the largest.
    pub worst: f64,
}

/// A limit that was broken.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Broken {
    /// What was measured: "krait end to end", say.
    pub what: String,
    /// p50, p99 or worst.
    pub quantile: &'static str,
    /// The multiple of the floor that was found.
    pub found: f64,
    /// The multiple that is allowed.
    pub limit: f64,
}

/// The limits that figures break. `p50_ratio` is the ratio of the medians taken round by round, where that is known.
pub fn broken(
    what: &str,
    limits: &RatioLimits,
    found: &Quantiles,
    floor: &Quantiles,
    p50_ratio: Option<f64>,
) -> Vec<Broken> {
    let over = |value: f64, floor: f64| if floor > 0.0 { value / floor } else { f64::INFINITY };
    let checks = [
        ("p50", limits.p50, p50_ratio.unwrap_or_else(|| over(found.p50, floor.p50))),
        ("p99", limits.p99, over(found.p99, floor.p99)),
        ("worst", limits.worst, over(found.max, floor.max)),
    ];
    let broken = checks.into_iter().filter_map(|(quantile, limit, found)| {
        // A ratio that is no number keeps no limit.
        let is_kept = found <= limit;
        (!is_kept).then(|| Broken { what: what.to_owned(), quantile, found, limit })
    });
    broken.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_limits_that_are_broken_are_named() {
        let quantiles = |p50, p99, max| Quantiles { p50, p90: p50, p99, p999: p99, max };
        let limits = RatioLimits { p50: 2.0, p99: 3.0, worst: 1e7 };
        let floor = quantiles(10.0, 40.0, 1000.0);
        assert!(broken("a", &limits, &quantiles(20.0, 120.0, 1e9), &floor, None).is_empty());
        let found = broken("a", &limits, &quantiles(21.0, 121.0, 1.0), &floor, None);
        assert_eq!(found.iter().map(|b| b.quantile).collect::<Vec<_>>(), ["p50", "p99"]);
        assert_eq!(broken("a", &limits, &quantiles(21.0, 1.0, 1.0), &floor, Some(1.9)), []);
        assert_eq!(broken("a", &limits, &quantiles(1.0, 1.0, 1.0), &Quantiles::default(), None).len(), 3);
    }
}
