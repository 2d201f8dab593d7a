//! The functions of the bend that a force on the tip needs, for numbers with tangents; smooth through the straight pose.
//!
//! Each takes u = b^2. The closed forms cancel at small b, so a series is used below one radian.

use super::real::Real;

/// (1 - cos b) / b^2.
pub(super) fn cosc<S: Real>(u: S) -> S {
    if u.value() < 1.0 {
        // sum (-u)^k / (2k+2)!
        return series(u, |k| 1.0 / ((2.0 * k + 1.0) * (2.0 * k + 2.0)));
    }
    (S::constant(1.0) - u.sqrt().cos()) / u
}

/// (d/db (sin b / b)) / b.
pub(super) fn sinc_slope<S: Real>(u: S) -> S {
    if u.value() < 1.0 {
        // d/du of sum (-u)^k / (2k+1)!, twice: -2 sum (k+1) (-u)^k / (2k+3)!
        return -series(u, |k| 2.0 * (k + 1.0) / ((2.0 * k + 1.0) * (2.0 * k + 2.0) * (2.0 * k + 3.0)));
    }
    let b = u.sqrt();
    (b.cos() - b.sin() / b) / u
}

/// (d/db ((1 - cos b) / b^2)) / b.
pub(super) fn cosc_slope<S: Real>(u: S) -> S {
    if u.value() < 1.0 {
        return -series(u, |k| {
            2.0 * (k + 1.0) / ((2.0 * k + 1.0) * (2.0 * k + 2.0) * (2.0 * k + 3.0) * (2.0 * k + 4.0))
        });
    }
    let b = u.sqrt();
    (b.sin() / b - cosc(u) - cosc(u)) / u
}

/// sum over k of (-u)^k / (2k)! times a factor of k; twelve terms reach rounding below one radian.
fn series<S: Real>(u: S, factor: impl Fn(f64) -> f64) -> S {
    let (mut sum, mut power, mut k) = (S::constant(0.0), S::constant(1.0), 0.0);
    for _ in 0..12 {
        sum += power * S::constant(factor(k));
        power = power * (-u) * S::constant(1.0 / ((2.0 * k + 1.0) * (2.0 * k + 2.0)));
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::real::Dual;
    use super::*;
    use crate::series::Arc;

    #[test]
    fn values_are_those_of_the_kinematics() {
        for b in [0.0, 1e-6, 0.3, 0.99, 1.01, 2.0, 3.0_f64] {
            let arc = Arc::of_square(b * b);
            let pairs =
                [(cosc(b * b), arc.cosc), (sinc_slope(b * b), arc.sinc_slope), (cosc_slope(b * b), arc.cosc_slope)];
            for (found, expected) in pairs {
                assert!((found - expected).abs() < 1e-14, "{b}: {found} {expected}");
            }
        }
    }

    #[test]
    fn tangents_do_not_jump_where_the_series_ends() {
        for f in [cosc::<Dual<1>>, sinc_slope, cosc_slope] {
            let [below, above] = [1.0 - 1e-12, 1.0 + 1e-12].map(|u| f(Dual::seed(u, 0)).tangent[0]);
            assert!(below != 0.0 && (below - above).abs() < 1e-10);
        }
    }
}
