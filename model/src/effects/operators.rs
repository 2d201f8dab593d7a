//! The operators with memory that effects are made of: play, stop, their planar form, and exact relaxation.
//!
//! Each takes its memory and the present input and gives the new memory as a function of the present input, so that the same
//! function serves the inverse (the input is planned) and the forward model (the input is being solved for). None depends on
//! how finely a monotone input is sampled.

use super::real::{Real, Scalar};

/// Play of half-width r: p follows u at a distance of at most r.
#[inline]
pub(crate) fn play<P: Real, S: Scalar<P>>(p: P, u: S, r: P, fresh: bool) -> S {
    let (low, high) = (u - r, u + r);
    if fresh {
        u
    } else if p.value() < low.value() {
        low
    } else if p.value() > high.value() {
        high
    } else {
        S::lift(p)
    }
}

/// Play in the plane: b_p follows b at a distance of at most `radius`.
pub(super) fn planar_play<P: Real, S: Scalar<P>>(p: [P; 2], b: [S; 2], radius: S, fresh: bool) -> [S; 2] {
    if fresh {
        return b;
    }
    let d = [b[0] - p[0], b[1] - p[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    if square.value() <= radius.value() * radius.value() {
        return p.map(S::lift);
    }
    let keep = radius / square.sqrt();
    [b[0] - d[0] * keep, b[1] - d[1] * keep]
}

/// Relaxation towards `target` over a time, with the target held during the step: x <- x + (1 - e^(-dt/T)) (target - x).
pub(crate) fn relax<P: Real, S: Scalar<P>>(x: P, target: S, time: P, dt_s: f64, fresh: bool) -> S {
    if fresh {
        return target;
    }
    let decay = (P::constant(-dt_s) / time).exp();
    (target - x) * (P::constant(1.0) - decay) + S::lift(x)
}

/// Bouc-Wen's z with exponent one over a travel du, solved exactly: dz = (1 - beta |z| sgn(z du) - gamma |z|) du / w with
/// beta + gamma = 1, so that |z| never exceeds one.
pub(crate) fn bouc_wen<P: Real, S: Scalar<P>>(z: P, du: S, w: P, gamma: P) -> S {
    let one = P::constant(1.0);
    let beta = one - gamma;
    let sign = if du.value() < 0.0 { -1.0 } else { 1.0 };
    // In units of w and in the direction of motion; y is z in that direction.
    let mut travel = du * (P::constant(sign) / w);
    let mut y = S::lift(z * P::constant(sign));
    if y.value() < 0.0 {
        // Unloading: dy/dt = 1 + k |y| = 1 - k y, k = beta - gamma >= 0, until y reaches zero.
        let k = beta - gamma;
        let needed = travel_to_zero(y, k);
        if travel.value() <= needed.value() {
            return approach(y, k, travel) * P::constant(sign);
        }
        travel = travel - needed;
        y = S::constant(0.0);
    }
    // Loading: dy/dt = 1 - y.
    approach(y, one, travel) * P::constant(sign)
}

/// Solution of y' = 1 - k y after t.
fn approach<P: Real, S: Scalar<P>>(y: S, k: P, t: S) -> S {
    if k.value() < 1e-9 {
        return y + t;
    }
    let end = S::lift(P::constant(1.0) / k);
    end + (y - end) * (-(t * k)).exp()
}

/// Travel over which y' = 1 - k y, y < 0, reaches zero: ln(1 - k y) / k.
fn travel_to_zero<P: Real, S: Scalar<P>>(y: S, k: P) -> S {
    if k.value() < 1e-9 {
        return -y;
    }
    let argument = S::constant(1.0) - y * k;
    argument.chain(argument.value().ln(), 1.0 / argument.value()) * (P::constant(1.0) / k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn play_moves_only_at_the_ends_of_its_gap() {
        assert_eq!(play(0.0, 0.5, 1.0, false), 0.0);
        assert_eq!(play(0.0, 3.0, 1.0, false), 2.0);
        assert_eq!(play(2.0, 1.5, 1.0, false), 2.0);
        assert_eq!(play(2.0, 0.5, 1.0, false), 1.5);
        assert_eq!(play(2.0, 7.0, 1.0, true), 7.0);
    }

    #[test]
    fn planar_play_keeps_its_distance_and_follows_radially() {
        assert_eq!(planar_play([0.0, 0.0], [0.3, 0.4], 0.6, false), [0.0, 0.0]);
        let p = planar_play([0.0, 0.0], [0.6, 0.8], 0.5, false);
        assert!((p[0] - 0.3).abs() < 1e-15 && (p[1] - 0.4).abs() < 1e-15);
    }

    #[test]
    fn bouc_wen_agrees_with_fine_euler_steps_and_does_not_depend_on_sampling() {
        let (w, gamma) = (0.1, 0.3);
        let mut z = 0.0;
        let mut euler = 0.0_f64;
        for target in [0.3, -0.02, 0.05, -0.4] {
            let start = [0.0, 0.3, -0.02, 0.05]
                [usize::from(target < 0.0) + 2 * usize::from(target.abs() == 0.05 || target == -0.4)];
            let du: f64 = target - start;
            z = bouc_wen(z, du, w, gamma);
            for _ in 0..200_000 {
                let d: f64 = du / 200_000.0;
                euler += (d - (1.0 - gamma) * d.abs() * euler - gamma * d * euler.abs()) / w;
            }
            assert!((z - euler).abs() < 1e-4, "{z} {euler}");
        }
        let (whole, mut parts) = (bouc_wen(-0.8, 0.25, w, gamma), -0.8);
        for _ in 0..1000 {
            parts = bouc_wen(parts, 0.25 / 1000.0, w, gamma);
        }
        assert!((whole - parts).abs() < 1e-12);
    }

    #[test]
    fn relaxation_over_two_halves_is_relaxation_over_the_whole() {
        let whole = relax(0.2, 1.0, 3.0, 2.0, false);
        let half = relax(0.2, 1.0, 3.0, 1.0, false);
        assert!((relax(half, 1.0, 3.0, 1.0, false) - whole).abs() < 1e-15);
    }
}
