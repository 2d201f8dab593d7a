//! The snake on its three lines: static equilibrium, stepped along the path of the actuators so that its memory is right.
//!
//! Problem: for positions p_i behind the play, find z = (r b_x, r b_y, u), m, that minimises
//!
//! ```text
//! Φ(z) = U(b) + (EA / 2L) u²  +  Σ_i ∫ -τ_i(y) dy  -  F · x_tip(b)
//! U(b) = η (E I |b|² / 2) (1/L + Σ_i 1/(L + q_i)),   q_i = m_i · z,   m_i = (-cos γ_i, sin γ_i),   γ_i = (i - 1) 120°
//! y_i  = q_i + u
//! ```
//!
//! where: U is the bending energy of the primary backbone and of the three secondary ones, each bent by b over its own
//! length; u is how far the primary backbone is stretched by the sum of the lines' loads (the internal preload, which never
//! bends the snake); τ_i(y) is the load of a line whose end is at y, with everything that the line remembers (see `line`);
//! F is a force on the tip. η scales the elastic load beyond that of Table I.
//!
//! Intuition: each term is convex (|b|² over a positive affine function is; each τ_i falls with y), so there is exactly
//! one equilibrium and Newton's method with a broken-line tangent finds it in a few steps. The path from one command to
//! the next is walked in steps of at most [`MAX_STEP_M`]; after each the lines' memory is brought up to date.
//!
//! Failure cases: a tip force makes Φ slightly less convex and its curvature is left out of the tangent, which costs
//! iterations, not accuracy. If [`MAX_ITERATIONS`] do not suffice the last iterate is kept and counted.

use super::line::{Compliance, Line, Load, Memory};
use super::truth::Truth;
use core::f64::consts::{FRAC_PI_3, PI};

/// Longest step along a path: a quarter of the smallest play worth simulating; finer steps change nothing measurable.
const MAX_STEP_M: f64 = 25e-6;
/// Newton's iterations in one step; 3 to 5 are usual.
const MAX_ITERATIONS: usize = 40;
/// Halvings of one Newton step.
const MAX_HALVINGS: usize = 12;
/// Largest unbalanced force: a millionth of a millionth of what moves the snake by its own length.
const TOLERANCE_N: f64 = 1e-9;

type Vec3 = [f64; 3];

/// The mechanical state and its constants.
#[derive(Clone, Debug)]
pub(crate) struct Plant {
    line: Line,
    /// L, m.
    length_m: f64,
    /// r, m.
    radius_m: f64,
    /// η E I / r², N m: energy of bending in terms of z.
    bend_modulus_n_m: f64,
    /// EA / L, N/m.
    axial_n_per_m: f64,
    /// F in the base frame, N.
    tip_force_in_base_n: [f64; 2],
    /// m_i.
    directions: [[f64; 2]; 3],
    q_tilde_m: Vec3,
    memory: [Memory; 3],
    z_m: Vec3,
    n_unsolved: u64,
}

impl Plant {
    /// The straight, unloaded snake.
    pub(crate) fn new(truth: &Truth) -> Self {
        let m = &truth.machine;
        let area_m2 = PI / 4.0 * (m.d_outer_m.powi(2) - m.d_inner_m.powi(2));
        let inertia_m4 = PI / 64.0 * (m.d_outer_m.powi(4) - m.d_inner_m.powi(4));
        let axial_n = m.e_pa * area_m2;
        let asymmetry = truth.effects.asymmetry;
        let compliance = |length_m: f64| Compliance {
            pushed_m_per_n: length_m / axial_n * (1.0 - asymmetry),
            pulled_m_per_n: length_m / axial_n * (1.0 + asymmetry),
        };
        let mut plant = Self {
            line: Line {
                half_play_m: truth.effects.play_m / 2.0,
                holder: compliance(m.l_d_m),
                cone: compliance(m.l_c_m),
                capstan: (2.0 * truth.effects.mu * m.phi_rad).exp(),
                static_friction_n: truth.effects.f_s_n,
            },
            length_m: m.l_m,
            radius_m: m.r_m,
            bend_modulus_n_m: truth.effects.load_scale * m.e_pa * inertia_m4 / m.r_m.powi(2),
            axial_n_per_m: axial_n / m.l_m,
            tip_force_in_base_n: truth.effects.tip_force_in_base_n,
            directions: core::array::from_fn(|i| {
                let (sin, cos) = (2.0 * FRAC_PI_3 * i as f64).sin_cos();
                [-cos, sin]
            }),
            q_tilde_m: [0.0; 3],
            memory: [Memory::default(); 3],
            z_m: [0.0; 3],
            n_unsolved: 0,
        };
        plant.settle();
        plant
    }

    /// Moves the actuators in a straight line to a finite place.
    ///
    /// # Real-time
    /// No allocation. At most |change| / [`MAX_STEP_M`] equilibria of at most [`MAX_ITERATIONS`] iterations each.
    pub(crate) fn move_to(&mut self, target_m: Vec3) {
        let start = self.q_tilde_m;
        let farthest = (0..3).map(|i| (target_m[i] - start[i]).abs()).fold(0.0, f64::max);
        let n_steps = (farthest / MAX_STEP_M).ceil().max(1.0);
        for k in 1..=n_steps as u32 {
            // The last step lands on the target itself, not beside it by a rounding error.
            let part = f64::from(k) / n_steps;
            self.q_tilde_m = core::array::from_fn(|i| start[i] * (1.0 - part) + target_m[i] * part);
            self.settle();
        }
    }

    /// The true bend vector, rad.
    pub(crate) fn bend_rad(&self) -> [f64; 2] {
        [self.z_m[0] / self.radius_m, self.z_m[1] / self.radius_m]
    }

    /// Where the actuators are, m.
    pub(crate) fn q_tilde_m(&self) -> Vec3 {
        self.q_tilde_m
    }

    /// τ~: what the lines push the actuators back with, N.
    pub(crate) fn actuator_loads_n(&self) -> Vec3 {
        self.loads(&self.z_m).map(|load| load.actuator_n)
    }

    /// Equilibria that did not converge within the iterations allowed.
    pub(crate) fn n_unsolved(&self) -> u64 {
        self.n_unsolved
    }

    /// Finds the equilibrium for the present actuator positions and brings the memory up to date.
    fn settle(&mut self) {
        for (memory, q_tilde_m) in self.memory.iter_mut().zip(self.q_tilde_m) {
            memory.play_m = self.line.play(memory.play_m, q_tilde_m);
        }
        if !self.solve() {
            self.n_unsolved += 1;
        }
        let loads = self.loads(&self.z_m);
        for (memory, load) in self.memory.iter_mut().zip(loads) {
            memory.slip_m = load.slip_m;
        }
    }

    /// Newton's method on ∇Φ = 0; says whether it converged.
    fn solve(&mut self) -> bool {
        for _ in 0..MAX_ITERATIONS {
            let loads = self.loads(&self.z_m);
            let gradient = self.gradient(&self.z_m, &loads);
            if gradient.iter().all(|g| g.abs() < TOLERANCE_N) {
                return true;
            }
            let Some(step) = solve_symmetric(&self.hessian(&self.z_m, &loads), &gradient.map(|g| -g)) else {
                return false;
            };
            self.z_m = self.line_search(&gradient, &step);
        }
        false
    }

    /// Halves a step until the slope of Φ along it has not turned steeply upwards: Φ is convex, so it has then fallen.
    fn line_search(&self, gradient: &Vec3, step: &Vec3) -> Vec3 {
        let slope = dot(gradient, step);
        let mut part = 1.0;
        for _ in 0..MAX_HALVINGS {
            let trial = core::array::from_fn(|k| self.z_m[k] + part * step[k]);
            if dot(&self.gradient(&trial, &self.loads(&trial)), step) <= 0.5 * slope.abs() {
                return trial;
            }
            part *= 0.5;
        }
        core::array::from_fn(|k| self.z_m[k] + part * step[k])
    }

    fn loads(&self, z: &Vec3) -> [Load; 3] {
        core::array::from_fn(|i| self.line.load(self.memory[i], self.joint_m(z, i) + z[2]))
    }

    /// q_i, m.
    fn joint_m(&self, z: &Vec3, i: usize) -> f64 {
        self.directions[i][0] * z[0] + self.directions[i][1] * z[1]
    }

    /// ∇Φ, N.
    fn gradient(&self, z: &Vec3, loads: &[Load; 3]) -> Vec3 {
        let bending = self.bending(z);
        let tip = self.tip_force_gradient(z);
        let square = z[0] * z[0] + z[1] * z[1];
        let mut gradient = [0.0, 0.0, self.axial_n_per_m * z[2]];
        for k in 0..2 {
            gradient[k] =
                self.bend_modulus_n_m * (z[k] * bending.sum + 0.5 * square * bending.sum_gradient[k]) + tip[k];
        }
        for (load, direction) in loads.iter().zip(self.directions) {
            gradient[0] -= load.disk_n * direction[0];
            gradient[1] -= load.disk_n * direction[1];
            gradient[2] -= load.disk_n;
        }
        gradient
    }

    /// ∇²Φ without the tip force, N/m.
    fn hessian(&self, z: &Vec3, loads: &[Load; 3]) -> [Vec3; 3] {
        let bending = self.bending(z);
        let square = z[0] * z[0] + z[1] * z[1];
        let mut hessian = [[0.0; 3]; 3];
        hessian[2][2] = self.axial_n_per_m;
        for k in 0..2 {
            for l in 0..2 {
                let identity = if k == l { bending.sum } else { 0.0 };
                hessian[k][l] = self.bend_modulus_n_m
                    * (identity
                        + z[k] * bending.sum_gradient[l]
                        + z[l] * bending.sum_gradient[k]
                        + 0.5 * square * bending.sum_hessian[k][l]);
            }
        }
        for (load, direction) in loads.iter().zip(self.directions) {
            let n = [direction[0], direction[1], 1.0];
            for k in 0..3 {
                for l in 0..3 {
                    hessian[k][l] += load.stiffness_n_per_m * n[k] * n[l];
                }
            }
        }
        hessian
    }

    /// S = 1/L + Σ 1/(L + q_i) and its derivatives with respect to (r b_x, r b_y).
    fn bending(&self, z: &Vec3) -> LengthSum {
        let mut s = LengthSum { sum: 1.0 / self.length_m, sum_gradient: [0.0; 2], sum_hessian: [[0.0; 2]; 2] };
        for (i, direction) in self.directions.iter().enumerate() {
            let inverse = 1.0 / (self.length_m + self.joint_m(z, i));
            s.sum += inverse;
            for k in 0..2 {
                s.sum_gradient[k] -= direction[k] * inverse * inverse;
                for l in 0..2 {
                    s.sum_hessian[k][l] += 2.0 * direction[k] * direction[l] * inverse.powi(3);
                }
            }
        }
        s
    }

    /// -∂(F · x_tip)/∂z, N, with the tip of a circular arc at x_tip = L f(|b|) (b_x, -b_y), f(b) = (1 - cos b) / b².
    fn tip_force_gradient(&self, z: &Vec3) -> [f64; 2] {
        let force = [self.tip_force_in_base_n[0], -self.tip_force_in_base_n[1]];
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
    sum_gradient: [f64; 2],
    sum_hessian: [[f64; 2]; 2],
}

fn dot(a: &Vec3, b: &Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Solves A x = b for a symmetric positive definite A by Cholesky's factors; `None` if A is not.
fn solve_symmetric(a: &[Vec3; 3], b: &Vec3) -> Option<Vec3> {
    let mut l = [[0.0_f64; 3]; 3];
    for row in 0..3 {
        for column in 0..=row {
            let rest = a[row][column] - (0..column).map(|k| l[row][k] * l[column][k]).sum::<f64>();
            if row != column {
                l[row][column] = rest / l[column][column];
            } else if rest > 0.0 {
                l[row][row] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    let mut x = [0.0; 3];
    for row in 0..3 {
        x[row] = (b[row] - (0..row).map(|k| l[row][k] * x[k]).sum::<f64>()) / l[row][row];
    }
    for row in (0..3).rev() {
        x[row] = (x[row] - (row + 1..3).map(|k| l[k][row] * x[k]).sum::<f64>()) / l[row][row];
    }
    Some(x)
}
