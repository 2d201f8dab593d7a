//! The rows of the likelihood of encoders, load cells and camera at one pose, and what many poses know of the parameters.
//!
//! ```text
//! q~_i   = q_i + T_i/K_d + (m_i/K_c)(T_i + s_i f_s) + k (L + q_i) T_i/EA + (3 L/EA) t + s_i h        T = eta tau_0(b) + t
//! tau~_i = g_i (T_i + s_i f_s)        w = b        g_i = e^(2 u_i), u_i = +-mu phi, + where s_i (T_i + s_i f_s) > 0
//! ```
//!
//! where: q = J b; m is g where the cone's friction is lumped at its end, and the mean of e^(..) along the cone where it is spread along its
//! arcs, whose share of the cone's length is held while phi is found; k is the share of its load that a line carries inside the snake; s is the sign of motion; the bend b and the common load t of the lines are unknown at each pose and eliminated by the
//! Schur complement of the normal equations. h stands in the first row only and f_s in two: that separates play from static
//! friction. eta scales the loads of both directions alike and phi oppositely: that separates stiffness from stem friction.

use crate::lines::ConeFriction;
use crate::stem::StemReading;
use krait_model::{MachineParameters, Snake};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, SMatrix, SVector, Vector2, Vector3, Vector4};

/// The machine, without the angle of its stem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    snake: Snake,
    mu: f64,
    cone: ConeFriction,
    inside_share: f64,
}

/// Encoders (m) and loads (N) at a pose, with their slopes by eta (1), h (m), f_s (N), phi (rad), b (rad) and t (N).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose {
    pub q_tilde_m: Vector3<f64>,
    pub tau_n: Vector3<f64>,
    pub slope: SMatrix<f64, 6, 7>,
    /// How many lines work against their load, minus how many are pushed back by it.
    pub against: f64,
}

/// What readings know of the four parameters once the unknowns of each pose are eliminated.
#[derive(Clone, Debug)]
pub(crate) struct Reduced {
    pub normal: Matrix4<f64>,
    pub gradient: Vector4<f64>,
    pub chi2: f64,
    /// Of each reading: its unknowns' own step, and their share of a step of the parameters.
    own: Vec<(Vector3<f64>, Matrix3x4<f64>)>,
}

impl Rows {
    /// `None` for a machine that the model refuses.
    pub fn new(machine: &MachineParameters, mu: f64, cone: ConeFriction, inside_share: f64) -> Option<Self> {
        Some(Self { snake: Snake::new(machine).ok()?, mu, cone, inside_share })
    }

    /// Bend vector, rad, of lines without load: where an unknown bend begins.
    pub fn bend_rad(&self, q_tilde_m: Vector3<f64>) -> Vector2<f64> {
        self.snake.j_bend_q() * q_tilde_m
    }

    /// The rows of encoders and loads at values of eta, h (m), f_s (N) and phi (rad), bend, rad, and common load, N.
    pub fn at(&self, value: &Vector4<f64>, bend_rad: Vector2<f64>, common_n: f64, signs: &Vector3<f64>) -> Pose {
        let [eta, half_width_m, f_s_n, phi_rad] = (*value).into();
        let (c_d, k_c) = (1.0 / self.snake.k_d_n_per_m(), self.snake.k_c_n_per_m());
        let (l_m, ea_n) = (self.snake.l_m(), self.snake.axial_stiffness_n());
        let axial_m_per_n = 3.0 * l_m / ea_n;
        let tau_0_n = self.snake.tau_n(bend_rad);
        let (j, j_tau_n) = (self.snake.j_q_bend(), self.snake.j_tau_bend_n(bend_rad) * eta);
        let q_m = self.snake.q(bend_rad);
        let mut pose =
            Pose { q_tilde_m: Vector3::zeros(), tau_n: Vector3::zeros(), slope: SMatrix::zeros(), against: 0.0 };
        for i in 0..3 {
            let s = signs[i];
            let load_n = eta * tau_0_n[i] + common_n;
            let through_n = load_n + s * f_s_n;
            let way = if s * through_n > 0.0 { 1.0 } else { -1.0 };
            let u = way * self.mu * phi_rad;
            let (g, (m, m_by_u)) = ((2.0 * u).exp(), self.cone.mean_and_slope(u));
            // What a load at the snake moves the actuator by, and how that changes with q.
            let (inside, inside_by_q) = (self.inside_share * (l_m + q_m[i]) / ea_n, self.inside_share * load_n / ea_n);
            let (c, u_by_phi) = (c_d + m / k_c + inside, way * self.mu);
            pose.against += way;
            pose.q_tilde_m[i] =
                q_m[i] + load_n * (c_d + inside) + m / k_c * through_n + axial_m_per_n * common_n + s * half_width_m;
            pose.tau_n[i] = g * through_n;
            let by_bend = |k: usize| j[(i, k)] * (1.0 + inside_by_q) + j_tau_n[(i, k)] * c;
            let of_q = [
                tau_0_n[i] * c,
                s,
                s * m / k_c,
                u_by_phi * m_by_u * through_n / k_c,
                by_bend(0),
                by_bend(1),
                c + axial_m_per_n,
            ];
            let by_phi_n = 2.0 * u_by_phi * g * through_n;
            let of_tau = [g * tau_0_n[i], 0.0, s * g, by_phi_n, g * j_tau_n[(i, 0)], g * j_tau_n[(i, 1)], g];
            for k in 0..7 {
                pose.slope[(i, k)] = of_q[k];
                pose.slope[(3 + i, k)] = of_tau[k];
            }
        }
        pose
    }

    /// Residuals (predicted minus measured) of one reading in their standard deviations, with slopes; zero where nothing was measured.
    fn whitened(
        &self,
        reading: &StemReading,
        value: &Vector4<f64>,
        own: &Vector3<f64>,
    ) -> (SVector<f64, 8>, SMatrix<f64, 8, 7>) {
        let pose = self.at(value, own.xy(), own.z, &reading.signs);
        let mut off: SVector<f64, 8> = SVector::zeros();
        let mut slope: SMatrix<f64, 8, 7> = SMatrix::zeros();
        for i in 0..3 {
            off[i] = (pose.q_tilde_m[i] - reading.q_tilde_m[i]) / reading.q_sd_m;
            slope.row_mut(i).copy_from(&(pose.slope.row(i) / reading.q_sd_m));
            if let Some((tau_n, sd_n)) = reading.loads_n {
                off[3 + i] = (pose.tau_n[i] - tau_n[i]) / sd_n;
                slope.row_mut(3 + i).copy_from(&(pose.slope.row(3 + i) / sd_n));
            }
        }
        if let Some((bend_rad, sd_rad)) = reading.bend_rad {
            for k in 0..2 {
                off[6 + k] = (own[k] - bend_rad[k]) / sd_rad;
                slope[(6 + k, 4 + k)] = 1.0 / sd_rad;
            }
        }
        (off, slope)
    }

    /// Sum of squares of all residuals.
    pub fn chi2(&self, readings: &[StemReading], value: &Vector4<f64>, own: &[Vector3<f64>]) -> f64 {
        readings.iter().zip(own).map(|(reading, own)| self.whitened(reading, value, own).0.norm_squared()).sum()
    }

    /// The normal equations of all readings without the unknowns of the poses; `None` where a pose does not determine its own.
    pub fn reduced(&self, readings: &[StemReading], value: &Vector4<f64>, own: &[Vector3<f64>]) -> Option<Reduced> {
        let mut sum = Reduced {
            normal: Matrix4::zeros(),
            gradient: Vector4::zeros(),
            chi2: 0.0,
            own: Vec::with_capacity(own.len()),
        };
        for (reading, own) in readings.iter().zip(own) {
            let (off, slope) = self.whitened(reading, value, own);
            let (normal, gradient) = (slope.transpose() * slope, slope.transpose() * off);
            let of_own: Matrix3<f64> = normal.fixed_view::<3, 3>(4, 4).into();
            let mixed: Matrix3x4<f64> = normal.fixed_view::<3, 4>(4, 0).into();
            let gradient_of_own: Vector3<f64> = gradient.fixed_rows::<3>(4).into();
            let solved = of_own.cholesky()?;
            let (step, share) = (-solved.solve(&gradient_of_own), -solved.solve(&mixed));
            sum.normal += normal.fixed_view::<4, 4>(0, 0) + mixed.transpose() * share;
            sum.gradient += gradient.fixed_rows::<4>(0) + mixed.transpose() * step;
            sum.chi2 += off.norm_squared();
            sum.own.push((step, share));
        }
        Some(sum)
    }
}

impl Reduced {
    /// The unknowns of the poses after a part of the step in which the parameters take `step`.
    pub fn moved(&self, own: &[Vector3<f64>], step: &Vector4<f64>, part: f64) -> Vec<Vector3<f64>> {
        own.iter().zip(&self.own).map(|(own, (alone, share))| own + (alone + share * step) * part).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;

    const MU: f64 = 0.1727;

    fn truth() -> Vector4<f64> {
        Vector4::new(1.22, 0.089e-3, 1.959, 41_f64.to_radians())
    }

    fn rows() -> Rows {
        Rows::new(&MachineParameters::default(), MU, ConeFriction::Lumped, 0.0).unwrap()
    }

    /// Every slope against differences of the values themselves, also with friction along the arcs and lines that extend inside the snake.
    #[test]
    fn slopes_are_those_of_the_rows() {
        let machine = MachineParameters::default();
        for (cone, inside) in [
            (ConeFriction::Lumped, 0.0),
            (ConeFriction::Lumped, 0.9),
            (ConeFriction::Distributed { arc_share: 0.49 }, 0.0),
            (ConeFriction::Distributed { arc_share: 0.49 }, 1.0),
        ] {
            let rows = Rows::new(&machine, MU, cone, inside).unwrap();
            for way in [1.0, -1.0] {
                let signs = Vector3::new(-way, way, way);
                let at = SVector::<f64, 7>::from([1.22, 0.089e-3, 1.959, 0.7156, 0.6, 0.25, 1.5]);
                let of =
                    |x: &SVector<f64, 7>| rows.at(&x.fixed_rows::<4>(0).into(), Vector2::new(x[4], x[5]), x[6], &signs);
                let steps = [1e-5, 1e-9, 1e-5, 1e-6, 1e-6, 1e-6, 1e-5];
                let slope = of(&at).slope;
                for k in 0..7 {
                    let moved = |side: f64| {
                        let mut x = at;
                        x[k] += side * steps[k];
                        of(&x)
                    };
                    let (up, down) = (moved(1.0), moved(-1.0));
                    for i in 0..3 {
                        let by_q = (up.q_tilde_m[i] - down.q_tilde_m[i]) / (2.0 * steps[k]);
                        let by_tau = (up.tau_n[i] - down.tau_n[i]) / (2.0 * steps[k]);
                        let (q, tau) = (slope[(i, k)], slope[(3 + i, k)]);
                        assert!((by_q - q).abs() < 1e-6 * q.abs() + 1e-9, "{cone:?} {inside} q {i} {k}: {by_q} {q}");
                        assert!((by_tau - tau).abs() < 1e-6 * tau.abs() + 1e-6, "{cone:?} tau {i} {k}: {by_tau} {tau}");
                    }
                }
            }
        }
    }

    fn close(found: f64, golden: f64) {
        assert!((found - golden).abs() <= 1e-5 * golden.abs() + 1e-9, "{found} instead of {golden}");
    }

    /// beyond.json, `g_rows`: q~1..3 (mm), tau~1..3 (N) by eta, h mm, f_s N, phi deg, b_x, b_y rad, common load N.
    #[rustfmt::skip]
    const GOLDEN: [(f64, [[f64; 7]; 6]); 2] = [
        (1.0, [
            [-1.13836, -1.0, -0.00943426, -0.00123316, -3.4595, 0.0, 0.0803222],
            [0.569182, 1.0, 0.00943426, 0.000672288, 1.72975, 2.98959, 0.0803222],
            [0.569182, 1.0, 0.00943426, 0.000672288, 1.72975, -2.98959, 0.0803222],
            [-20.6999, 0.0, -1.28039, -0.167361, -32.2855, 0.0, 1.28039],
            [10.35, 0.0, 1.28039, 0.0912407, 16.1428, 27.8433, 1.28039],
            [10.35, 0.0, 1.28039, 0.0912407, 16.1428, -27.8433, 1.28039],
        ]),
        (-1.0, [
            [-1.07888, 1.0, 0.00575473, 0.000616284, -3.36672, 0.0, 0.0766427],
            [0.539438, -1.0, -0.00575473, -0.000274161, 1.68336, 2.90958, 0.0766427],
            [0.539438, -1.0, -0.00575473, -0.000274161, 1.68336, -2.90958, 0.0766427],
            [-12.6266, 0.0, 0.781013, 0.0836401, -19.6936, 0.0, 0.781013],
            [6.31329, 0.0, -0.781013, -0.0372083, 9.84679, 16.9839, 0.781013],
            [6.31329, 0.0, -0.781013, -0.0372083, 9.84679, -16.9839, 0.781013],
        ]),
    ];

    #[test]
    fn rows_are_the_golden_ones_in_both_directions() {
        let columns = [1.0, 1e-3, 1.0, 1_f64.to_radians(), 1.0, 1.0, 1.0];
        for (way, golden) in GOLDEN {
            let pose = rows().at(&truth(), Vector2::new(45_f64.to_radians(), 0.0), 0.0, &Vector3::new(-way, way, way));
            for (i, golden) in golden.iter().enumerate() {
                for (k, golden) in golden.iter().enumerate() {
                    close(pose.slope[(i, k)] * columns[k] * if i < 3 { 1e3 } else { 1.0 }, *golden);
                }
            }
        }
    }

    /// beyond.json, `f_phi`: the loads of one line in both directions at one bend, and the closed form for them.
    #[test]
    fn the_closed_form_of_one_line_gives_the_stem_angle_back() {
        let bend_rad = Vector2::new(45_f64.to_radians(), 0.0);
        let of = |way: f64| rows().at(&truth(), bend_rad, 0.0, &Vector3::new(-way, way, way));
        let (up, down) = (of(1.0), of(-1.0));
        let (up_n, down_n) = (up.tau_n[0].abs(), down.tau_n[0].abs());
        close(up_n, 27.7622);
        close(down_n, 13.8744);
        let phi_and_eta = |up_n: f64, down_n: f64| {
            let f_s_n = truth()[2];
            let g = ((f_s_n * f_s_n + up_n * down_n).sqrt() - f_s_n) / down_n;
            (g.ln() / (2.0 * MU), (up_n / g - f_s_n) / rows().snake.tau_n(bend_rad)[0].abs())
        };
        let (phi_rad, eta) = phi_and_eta(up_n, down_n);
        close(phi_rad.to_degrees(), 41.0);
        close(eta, 1.22);
        let by = |d_up: f64, d_down: f64| {
            let moved = |part: f64| phi_and_eta(up_n + part * d_up, down_n + part * d_down).0;
            (moved(1e-4) - moved(-1e-4)) / 2e-4
        };
        close((0.1 * by(1.0, 0.0).hypot(by(0.0, 1.0))).to_degrees(), 0.630688);
        close(up.slope[(0, 3)] * 1e3, -0.0706549);
        close(up.slope[(3, 3)], -9.58906);
    }

    /// beyond.json, `fg_observability`: what is measured, the parameters that are known, and the standard deviations of the others
    /// (1, mm, N, deg), NaN where they are not determined; and the smallest eigenvalue of what the readings know in units of its diagonal. Camera 1 deg, encoders 5 um, ten bends of 10 to 60 deg each way.
    #[test]
    fn standard_deviations_are_the_predicted_ones_and_what_is_not_determined_is_singular() {
        const NAN: f64 = f64::NAN;
        type Entry = (&'static [f64], f64, [([f64; 4], f64); 4]);
        #[rustfmt::skip]
        let table: [Entry; 5] = [
            (&[1.0], NAN, [([NAN; 4], 0.0), ([NAN, NAN, NAN, 0.0], 0.0), ([0.0472845, 0.034473, 0.0, 0.0], 0.0906389), ([0.34845, 0.0, 0.0, 309.412], 0.00159469)]),
            (&[1.0, -1.0], NAN, [([0.0348675, 0.0994179, 13.2328, 41.8484], 0.00485764), ([0.0338773, 0.0991521, 13.0742, 0.0], 0.00486463), ([0.014093, 0.0100027, 0.0, 0.0], 0.999799), ([0.0150424, 0.0, 0.0, 16.8575], 0.650365)]),
            (&[1.0], 0.1, [([0.026614, 0.0111494, 0.108516, 1.81362], 0.00619532), ([0.00776093, 0.00974585, 0.105887, 0.0], 0.0159883), ([0.00505724, 0.00314338, 0.0, 0.0], 0.233286), ([0.0194003, 0.0, 0.0, 1.22724], 0.0141029)]),
            (&[1.0, -1.0], 0.1, [([0.0031839, 0.00675337, 0.0739349, 0.457671], 0.0228292), ([0.00286357, 0.006229, 0.0541357, 0.0], 0.0359638), ([0.00282342, 0.00174473, 0.0, 0.0], 0.698627), ([0.00308502, 0.0, 0.0, 0.21044], 0.511656)]),
            (&[1.0, -1.0], 0.5, [([0.0104826, 0.00918935, 0.163284, 1.84708], 0.0956783), ([0.0098397, 0.00908351, 0.100444, 0.0], 0.248212), ([0.00962397, 0.00616851, 0.0, 0.0], 0.799828), ([0.0103403, 0.0, 0.0, 0.924912], 0.589564)]),
        ];
        let units = [1.0, 1e3, 1.0, 1_f64.to_degrees()];
        for (ways, cell_sd_n, golden) in table {
            let (mut readings, mut own) = (Vec::new(), Vec::new());
            for way in ways {
                for k in 0..10 {
                    let bend_rad = Vector2::new((10.0 + 50.0 * f64::from(k) / 9.0).to_radians(), 0.0);
                    let signs = Vector3::new(-way, *way, *way);
                    let pose = rows().at(&truth(), bend_rad, 0.0, &signs);
                    readings.push(StemReading {
                        q_tilde_m: pose.q_tilde_m,
                        q_sd_m: 5e-6,
                        signs,
                        loads_n: cell_sd_n.is_finite().then_some((pose.tau_n, cell_sd_n)),
                        bend_rad: Some((bend_rad, 1_f64.to_radians())),
                    });
                    own.push(Vector3::new(bend_rad.x, 0.0, 0.0));
                }
            }
            let known = rows().reduced(&readings, &truth(), &own).unwrap();
            assert!(known.chi2 < 1e-18);
            for (golden, golden_weakest) in golden {
                let free: Vec<usize> = (0..4).filter(|k| golden[*k] != 0.0).collect();
                let n = free.len();
                let normal = nalgebra::DMatrix::from_fn(n, n, |i, k| known.normal[(free[i], free[k])]);
                let unit =
                    nalgebra::DMatrix::from_fn(n, n, |i, k| normal[(i, k)] / (normal[(i, i)] * normal[(k, k)]).sqrt());
                let weakest = unit.symmetric_eigenvalues().min();
                if golden[0].is_nan() {
                    assert!(weakest < 1e-9, "{weakest}");
                    continue;
                }
                assert!((weakest / golden_weakest - 1.0).abs() < 1e-3, "{weakest} instead of {golden_weakest}");
                let covariance = normal.try_inverse().unwrap();
                for (i, k) in free.into_iter().enumerate() {
                    let sd = covariance[(i, i)].sqrt() * units[k];
                    assert!((sd / golden[k] - 1.0).abs() < 1e-4, "{sd} instead of {}", golden[k]);
                }
            }
        }
    }
}
