//! The bent snake without its lines: forces that hold it, as gradient and tangent in z = (r b_x, r b_y).
//!
//! ```text
//! backbones   η (E I |b|² / 2) (1/L + Σ_i 1/(L + q_i)),   q_i = m_i · z
//! tip force   -F · x_tip(b), the tip of a circular arc at x_tip = L (f b_x, -f b_y, sin b / b), f(b) = (1 - cos b) / b²
//! softening   moment -a K b D(b_t / b), K = 4 E I η / L, D the share that a thin tube's fibres beyond their yield lack
//! detents     (A |b|² / 2) cos(n δ)
//! friction    a spring of 20 K in the bend plane between b and a point b_s that is dragged along at |moment| = M_c
//! ```
//!
//! where: for a thin-walled tube bent to b, fibres at azimuth φ strain as sin φ; those beyond sin φ0 = b_t / b carry less,
//! and the integral over them is D = 1 - 2 φ0 / π - sin(2 φ0) / π.
//!
//! Failure cases: the lateral force and the detents are left out of the tangent, which costs iterations, not accuracy.

use crate::truth::Truth;
use core::f64::consts::PI;

/// Stiffness of the spring of bend friction in units of the snake's own: stiff enough to stick visibly.
const STICK: f64 = 20.0;

type Vec2 = [f64; 2];

/// The bent snake and what its friction remembers.
#[derive(Clone, Debug)]
pub(crate) struct Bending {
    length_m: f64,
    radius_m: f64,
    /// η E I, N m².
    modulus_n_m2: f64,
    /// m_i.
    directions: [Vec2; 3],
    lateral_n: Vec2,
    axial_n: f64,
    softening: f64,
    /// b_t, rad.
    soft_bend_rad: f64,
    detent_n_m: f64,
    detent_planes: f64,
    friction_n_m: f64,
    friction_m: f64,
    /// M_c, N m.
    moment_n_m: f64,
    /// b_s, rad.
    dragged_rad: Vec2,
}

impl Bending {
    pub(crate) fn new(truth: &Truth, directions: [Vec2; 3]) -> Self {
        let (m, b) = (&truth.machine, &truth.bending);
        let inertia_m4 = PI / 64.0 * (m.d_outer_m.powi(4) - m.d_inner_m.powi(4));
        let [x, y] = truth.effects.tip_force_in_base_n;
        Self {
            length_m: m.l_m,
            radius_m: m.r_m,
            modulus_n_m2: truth.effects.load_scale * m.e_pa * inertia_m4,
            directions,
            lateral_n: [x, -y],
            axial_n: b.axial_tip_force_n,
            softening: b.softening,
            soft_bend_rad: b.soft_strain * 2.0 * m.l_m / m.d_outer_m,
            detent_n_m: b.detent_n_m_per_rad,
            detent_planes: b.detent_planes.round(),
            friction_n_m: b.friction_n_m,
            friction_m: b.friction_m,
            moment_n_m: b.friction_n_m,
            dragged_rad: [0.0; 2],
        }
    }

    /// Gradient, N.
    pub(crate) fn gradient(&self, z: Vec2, stiffness: f64) -> Vec2 {
        let lengths = self.lengths(z);
        let modulus = self.modulus(stiffness);
        let square = z[0] * z[0] + z[1] * z[1];
        let tip = self.lateral_gradient(z);
        let extra = self.extra(z).0;
        core::array::from_fn(|k| {
            modulus * (z[k] * lengths.sum + 0.5 * square * lengths.gradient[k]) + tip[k] + extra[k]
        })
    }

    /// Tangent, N/m.
    pub(crate) fn hessian(&self, z: Vec2, stiffness: f64) -> [Vec2; 2] {
        let lengths = self.lengths(z);
        let modulus = self.modulus(stiffness);
        let square = z[0] * z[0] + z[1] * z[1];
        let extra = self.extra(z).1;
        core::array::from_fn(|k| {
            core::array::from_fn(|l| {
                let identity = if k == l { lengths.sum } else { 0.0 };
                let energy = identity
                    + z[k] * lengths.gradient[l]
                    + z[l] * lengths.gradient[k]
                    + 0.5 * square * lengths.hessian[k][l];
                modulus * energy + extra[k][l]
            })
        })
    }

    /// Ends a step: friction's point is dragged along, and its moment follows the lines' loads.
    pub(crate) fn end(&mut self, z: Vec2, sum_of_loads_n: f64) {
        if self.friction_n_m == 0.0 && self.friction_m == 0.0 {
            return;
        }
        let reach = self.moment_n_m / (STICK * self.snake_n_m());
        let away: Vec2 = core::array::from_fn(|k| z[k] / self.radius_m - self.dragged_rad[k]);
        let distance = away[0].hypot(away[1]);
        if distance > reach {
            for (k, dragged) in self.dragged_rad.iter_mut().enumerate() {
                *dragged += away[k] * (1.0 - reach / distance);
            }
        }
        self.moment_n_m = self.friction_n_m + self.friction_m * sum_of_loads_n;
    }

    fn modulus(&self, stiffness: f64) -> f64 {
        self.modulus_n_m2 * stiffness / self.radius_m.powi(2)
    }

    /// K, N m/rad.
    fn snake_n_m(&self) -> f64 {
        4.0 * self.modulus_n_m2 / self.length_m
    }

    /// Softening, axial force, detents and friction: gradient and tangent.
    fn extra(&self, z: Vec2) -> (Vec2, [Vec2; 2]) {
        let bend = z.map(|z| z / self.radius_m);
        let size = bend[0].hypot(bend[1]);
        let (mut gradient, mut hessian) = self.friction(bend);
        if size > 1e-12 && (self.axial_n != 0.0 || self.softening > 0.0 || self.detent_n_m > 0.0) {
            let unit = bend.map(|b| b / size);
            let (moment, slope) = self.radial(size);
            let angle = self.detent_planes * bend[1].atan2(bend[0]);
            let along = moment + self.detent_n_m * size * angle.cos();
            let across = -0.5 * self.detent_planes * self.detent_n_m * size * angle.sin();
            let normal = [-unit[1], unit[0]];
            for k in 0..2 {
                gradient[k] += along * unit[k] + across * normal[k];
                for l in 0..2 {
                    hessian[k][l] += slope * unit[k] * unit[l] + moment / size * normal[k] * normal[l];
                }
            }
        }
        (gradient.map(|g| g / self.radius_m), hessian.map(|row| row.map(|h| h / self.radius_m.powi(2))))
    }

    /// Moment and its slope that depend on the size of the bend alone, N m and N m/rad.
    fn radial(&self, b: f64) -> (f64, f64) {
        let (sin, cos) = b.sin_cos();
        // (b cos b - sin b) / b² and its derivative lose their digits near the straight pose.
        let (pull, pull_slope) = if b < 0.05 {
            (-b / 3.0 + b.powi(3) / 30.0, -1.0 / 3.0 + b * b / 10.0)
        } else {
            let first = (b * cos - sin) / (b * b);
            (first, -sin / b - 2.0 * first / b)
        };
        let force = self.axial_n * self.length_m;
        let (mut moment, mut slope) = (-force * pull, -force * pull_slope);
        if b > self.soft_bend_rad && self.softening > 0.0 {
            let s = self.soft_bend_rad / b;
            let phi = s.asin();
            let lacks = 1.0 - 2.0 * phi / PI - (2.0 * phi).sin() / PI;
            let lost = self.softening * self.snake_n_m();
            moment -= lost * b * lacks;
            slope -= lost * (lacks + 4.0 / PI * s * phi.cos());
        }
        (moment, slope)
    }

    /// Bend friction: moment, N m, and tangent, N m/rad.
    fn friction(&self, bend: Vec2) -> (Vec2, [Vec2; 2]) {
        if self.moment_n_m == 0.0 {
            return ([0.0; 2], [[0.0; 2]; 2]);
        }
        let stiffness = STICK * self.snake_n_m();
        let away: Vec2 = core::array::from_fn(|k| bend[k] - self.dragged_rad[k]);
        let distance = away[0].hypot(away[1]);
        let reach = self.moment_n_m / stiffness;
        if distance <= reach {
            return (away.map(|a| stiffness * a), [[stiffness, 0.0], [0.0, stiffness]]);
        }
        let unit = away.map(|a| a / distance);
        let round = self.moment_n_m / distance;
        let tangent = [
            [round * unit[1] * unit[1], -round * unit[0] * unit[1]],
            [-round * unit[0] * unit[1], round * unit[0] * unit[0]],
        ];
        (unit.map(|u| self.moment_n_m * u), tangent)
    }

    /// S = 1/L + Σ 1/(L + q_i) and its derivatives with respect to z.
    fn lengths(&self, z: Vec2) -> LengthSum {
        let mut s = LengthSum { sum: 1.0 / self.length_m, gradient: [0.0; 2], hessian: [[0.0; 2]; 2] };
        for direction in &self.directions {
            let inverse = 1.0 / (self.length_m + direction[0] * z[0] + direction[1] * z[1]);
            s.sum += inverse;
            for k in 0..2 {
                s.gradient[k] -= direction[k] * inverse * inverse;
                for l in 0..2 {
                    s.hessian[k][l] += 2.0 * direction[k] * direction[l] * inverse.powi(3);
                }
            }
        }
        s
    }

    /// -∂(F · x_tip)/∂z of the lateral force, N.
    fn lateral_gradient(&self, z: Vec2) -> Vec2 {
        let force = self.lateral_n;
        let bend = [z[0] / self.radius_m, z[1] / self.radius_m];
        let square = bend[0] * bend[0] + bend[1] * bend[1];
        // f and f'(b)/b; both quotients lose their digits near the straight pose, where their series are exact.
        let (f, slope) = if square < 1e-2 {
            (0.5 - square / 24.0 + square * square / 720.0, -1.0 / 12.0 + square / 180.0 - square * square / 6720.0)
        } else {
            let b = square.sqrt();
            ((1.0 - b.cos()) / square, (b * b.sin() - 2.0 * (1.0 - b.cos())) / (square * square))
        };
        let along = bend[0] * force[0] + bend[1] * force[1];
        core::array::from_fn(|k| -self.length_m / self.radius_m * (f * force[k] + along * slope * bend[k]))
    }
}

struct LengthSum {
    sum: f64,
    gradient: Vec2,
    hessian: [Vec2; 2],
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hidden::BendingTruth;

    fn bending(bending: BendingTruth) -> Bending {
        let directions = core::array::from_fn(|i| {
            let (sin, cos) = (2.0 * PI / 3.0 * i as f64).sin_cos();
            [-cos, sin]
        });
        Bending::new(&Truth { bending, ..Truth::default() }, directions)
    }

    #[test]
    fn tangents_of_softening_axial_force_and_friction_are_the_slopes_of_their_gradients() {
        let truth =
            BendingTruth { softening: 0.6, axial_tip_force_n: 0.4, friction_n_m: 2e-3, ..BendingTruth::default() };
        let bending = bending(truth);
        for bend in [[0.01, 0.02], [0.3, -0.4], [1.1, 0.2], [-0.2, 1.3]] {
            let z = bend.map(|b: f64| b * 1.684e-3);
            let tangent = bending.hessian(z, 1.0);
            for l in 0..2 {
                let (mut up, mut down, h) = (z, z, 1e-9);
                up[l] += h;
                down[l] -= h;
                let (up, down) = (bending.gradient(up, 1.0), bending.gradient(down, 1.0));
                for k in 0..2 {
                    let secant = (up[k] - down[k]) / (2.0 * h);
                    // The truth's lateral force is zero, so that nothing is left out.
                    assert!((secant - tangent[k][l]).abs() < 1e-4 * tangent[k][k], "{bend:?} {k} {l}: {secant}");
                }
            }
        }
    }

    #[test]
    fn softening_takes_off_what_the_fibres_of_a_thin_tube_lack() {
        let bending = bending(BendingTruth { softening: 1.0, ..BendingTruth::default() });
        let b = 1.5;
        let share = bending.radial(b).0 / (-bending.snake_n_m() * b);
        let n = 100_000;
        let limit = bending.soft_bend_rad / b;
        let lacking = |k: u32| {
            let s = (PI * (f64::from(k) + 0.5) / f64::from(n)).sin();
            (s - limit).max(0.0) * s
        };
        let sum = (0..n).map(lacking).sum::<f64>() * PI / f64::from(n) / (PI / 2.0);
        assert!((share - sum).abs() < 1e-6, "{share} and {sum}");
    }

    #[test]
    fn friction_drags_its_point_along_and_holds_at_a_reversal() {
        let mut bending = bending(BendingTruth { friction_n_m: 1e-3, ..BendingTruth::default() });
        for k in 0..=100 {
            bending.end([f64::from(k) * 1e-5, 0.0], 0.0);
        }
        let (up, _) = bending.friction([1e-3 / 1.684e-3, 0.0]);
        assert!((up[0] - 1e-3).abs() < 1e-12);
        let reach = 1e-3 / (STICK * bending.snake_n_m());
        let (turned, _) = bending.friction([1e-3 / 1.684e-3 - 2.0 * reach, 0.0]);
        assert!((turned[0] + 1e-3).abs() < 1e-9, "twice the reach turns it round");
    }
}
