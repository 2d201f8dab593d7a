//! The moment that bends the backbones, with its slope: E = (E I b^2/2) (1/L + sum 1/L_i), L_i = L + q_i, m = dE/db.
//!
//! Its slope by the bend is the Hessian of E in closed form (`docs/physics/alpha.md`), which costs half of what numbers with
//! tangents would; only where J_q itself has tangents do they have to be carried through every operation.

use crate::effects::{Real, Scalar, three};

/// The backbones as the moment sees them.
#[derive(Clone, Debug)]
pub(crate) struct Backbones<P> {
    /// Rows of J_q, m.
    pub j: [[P; 2]; 3],
    /// Length of the primary one, m.
    l_m: f64,
    /// E I times a load scale, N m2.
    stiffness_nm2: f64,
    /// One, with the tangents of its logarithm.
    relative: P,
    /// Whether J_q is without tangents.
    fixed: bool,
}

impl<P: Real> Backbones<P> {
    pub(crate) fn new(j: [[P; 2]; 3], l_m: f64, stiffness_nm2: P) -> Self {
        let fixed = j.iter().flatten().all(|&entry| entry == P::constant(entry.value()));
        let value = stiffness_nm2.value();
        Self { j, l_m, stiffness_nm2: value, relative: stiffness_nm2.chain(1.0, 1.0 / value), fixed }
    }

    /// d E / d bend at a bend b with displacements q = J_q b, N m.
    #[inline(always)]
    pub(crate) fn moment<S: Scalar<P>>(&self, b: [S; 2], q: &[S; 3]) -> [S; 2] {
        if P::HAS_TANGENTS && !self.fixed {
            return self.moment_with_tangents(b, q);
        }
        let (gradient, hessian) = self.gradient_and_hessian(b.map(S::value), three(|i| q[i].value()));
        let m = [0, 1].map(|k| S::chain_of_two(b[0], b[1], gradient[k], hessian[k]));
        if P::HAS_TANGENTS { m.map(|m| m * self.relative) } else { m }
    }

    /// Of E, by the bend.
    #[inline(always)]
    fn gradient_and_hessian(&self, b: [f64; 2], q: [f64; 3]) -> ([f64; 2], [[f64; 2]; 2]) {
        let j = three(|i| self.j[i].map(P::value));
        let x = three(|i| 1.0 / (self.l_m + q[i]));
        let squares = three(|i| x[i] * x[i]);
        let cubes = three(|i| squares[i] * x[i]);
        let sum = 1.0 / self.l_m + x[0] + x[1] + x[2];
        let slope = [0, 1].map(|k| -(squares[0] * j[0][k] + squares[1] * j[1][k] + squares[2] * j[2][k]));
        let curvature = |k: usize, l: usize| {
            cubes[0] * j[0][k] * j[0][l] + cubes[1] * j[1][k] * j[1][l] + cubes[2] * j[2][k] * j[2][l]
        };
        let square = b[0] * b[0] + b[1] * b[1];
        let ei = self.stiffness_nm2;
        let gradient = [0, 1].map(|k| ei * (b[k] * sum + 0.5 * square * slope[k]));
        let xx = ei * (sum + 2.0 * b[0] * slope[0] + square * curvature(0, 0));
        let xy = ei * (b[0] * slope[1] + b[1] * slope[0] + square * curvature(0, 1));
        let yy = ei * (sum + 2.0 * b[1] * slope[1] + square * curvature(1, 1));
        (gradient, [[xx, xy], [xy, yy]])
    }

    fn moment_with_tangents<S: Scalar<P>>(&self, b: [S; 2], q: &[S; 3]) -> [S; 2] {
        let inverse = three(|i| (q[i] + P::constant(self.l_m)).recip());
        let sum = inverse[0] + inverse[1] + inverse[2] + P::constant(1.0 / self.l_m);
        let half_square = (b[0].square() + b[1].square()) * P::constant(-0.5);
        let squares = inverse.map(S::square);
        [0, 1].map(|k| {
            let slope = squares[0] * self.j[0][k] + squares[1] * self.j[1][k] + squares[2] * self.j[2][k];
            (b[k] * sum + slope * half_square) * (self.relative * P::constant(self.stiffness_nm2))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Dual;

    #[test]
    fn the_closed_slope_is_what_tangents_give() {
        let j = [[-1.7e-3, 0.1e-3], [0.9e-3, 1.4e-3], [0.8e-3, -1.5e-3]];
        let (closed, carried) = (Backbones::new(j, 0.026, 3.4e-4), Backbones { fixed: false, ..lifted(j) });
        for b in [[0.0, 0.0], [1e-9, 0.0], [0.7, -1.1], [-1.3, 0.2]] {
            let b = [Dual::<2>::seed(b[0], 0), Dual::seed(b[1], 1)];
            let q = j.map(|row| b[0] * row[0] + b[1] * row[1]);
            let (plain, parameters) = (closed.moment(b, &q), lifted(j).moment(b, &q));
            let carried = carried.moment(b, &q);
            assert_eq!(plain, parameters, "parameters without tangents are plain ones");
            for (closed, carried) in plain.into_iter().zip(carried) {
                assert!((closed.value - carried.value).abs() <= 1e-15 * carried.value.abs().max(1e-3));
                for k in 0..2 {
                    assert!((closed.tangent[k] - carried.tangent[k]).abs() < 1e-15, "{closed:?} {carried:?}");
                }
            }
            assert!(plain[0].tangent[0] > 1e-3 && plain[1].tangent[1] > 1e-3);
        }
    }

    fn lifted(j: [[f64; 2]; 3]) -> Backbones<Dual<2>> {
        Backbones::new(j.map(|row| row.map(Dual::constant)), 0.026, Dual::constant(3.4e-4))
    }
}
