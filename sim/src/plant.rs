//! The snake on its three lines: static equilibrium, stepped along the path of the actuators so that its memory is right.
//!
//! Problem: for positions p_i behind the play, find z = (r b_x, r b_y, u), m, that minimises
//!
//! ```text
//! Φ(z) = U(b) + (EA / 2L) u²  +  Σ_i ∫ -τ_i(y) dy
//! y_i  = n_i · z + u,   n_i = m_i = (-cos γ_i, sin γ_i),   γ_i = (i - 1) 120°, unless holes are displaced or lines coupled
//! ```
//!
//! where: U is the bending energy of the backbones and the work of forces on the tip (see `bending`); u is how far the primary
//! backbone is stretched by the sum of the lines' loads (the internal preload, which never bends the snake); τ_i(y) is the
//! load of a line whose end is at y, with everything that the line and its end remember (see `line` and `ends`).
//!
//! Intuition: each term is convex (|b|² over a positive affine function is; each τ_i falls with y), so there is exactly
//! one equilibrium and Newton's method with a broken-line tangent finds it in a few steps. The path from one command to
//! the next is walked in steps of at most [`MAX_STEP_M`]; after each the lines' memory is brought up to date.
//!
//! Failure cases: a tip force makes Φ slightly less convex and its curvature is left out of the tangent, which costs
//! iterations, not accuracy; so do strong detents. If [`MAX_ITERATIONS`] do not suffice the last iterate is kept and counted.

use crate::bending::Bending;
use crate::cone::SpreadCone;
use crate::ends::Ends;
use crate::line::{Compliance, Inside, Line, Load, Memory};
use crate::solve::solve_symmetric;
use crate::truth::Truth;
use core::f64::consts::{FRAC_PI_3, PI};

/// Longest step along a path: a quarter of the smallest play worth simulating; finer steps change nothing measurable.
const MAX_STEP_M: f64 = 25e-6;
/// Longest step in time where something depends on it.
const MAX_STEP_S: f64 = 5e-3;
/// Steps in time at most for one motion: a wait of hours need not be walked in milliseconds.
const MAX_TIME_STEPS: f64 = 400.0;
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
    lines: [Line; 3],
    ends: Ends,
    bending: Bending,
    /// r, m.
    radius_m: f64,
    /// EA / L, N/m.
    axial_n_per_m: f64,
    /// n_i.
    directions: [[f64; 2]; 3],
    /// g without disks.
    capstan: f64,
    /// Friction at the disks, 1/rad of bend.
    disk_mu: f64,
    q_tilde_m: Vec3,
    memory: [Memory; 3],
    z_m: Vec3,
    n_unsolved: u64,
}

impl Plant {
    /// The straight, unloaded snake.
    pub(crate) fn new(truth: &Truth) -> Self {
        let m = &truth.machine;
        let axial_n = m.e_pa * PI / 4.0 * (m.d_outer_m.powi(2) - m.d_inner_m.powi(2));
        let holes = core::array::from_fn(|i| {
            let (sin, cos) = (2.0 * FRAC_PI_3 * i as f64 + truth.lines.angle_rad[i]).sin_cos();
            [-cos, sin].map(|x: f64| x * (1.0 + truth.lines.radius[i]))
        });
        let mut plant = Self {
            lines: core::array::from_fn(|i| line(truth, axial_n, i)),
            ends: Ends::new(&truth.lines, &truth.slow, (m.l_d_m + m.l_c_m) / axial_n),
            bending: Bending::new(truth, holes),
            radius_m: m.r_m,
            axial_n_per_m: axial_n / m.l_m,
            directions: coupled(holes, &truth.lines.coupling),
            capstan: (2.0 * truth.effects.mu * m.phi_rad).exp(),
            disk_mu: truth.lines.disk_mu,
            q_tilde_m: [0.0; 3],
            memory: [Memory::default(); 3],
            z_m: [0.0; 3],
            n_unsolved: 0,
        };
        plant.settle(0.0);
        plant
    }

    /// Moves the actuators in a straight line to a finite place, within a time.
    ///
    /// # Real-time
    /// No allocation. At most |change| / [`MAX_STEP_M`] equilibria of at most [`MAX_ITERATIONS`] iterations each, or
    /// [`MAX_TIME_STEPS`] where something depends on time.
    pub(crate) fn move_to(&mut self, target_m: Vec3, elapsed_s: f64) {
        let start = self.q_tilde_m;
        let farthest = (0..3).map(|i| (target_m[i] - start[i]).abs()).fold(0.0, f64::max);
        let mut n_steps = (farthest / MAX_STEP_M).ceil().max(1.0);
        if self.depends_on_time() {
            n_steps = n_steps.max((elapsed_s / MAX_STEP_S).ceil().min(MAX_TIME_STEPS));
        }
        for k in 1..=n_steps as u32 {
            // The last step lands on the target itself, not beside it by a rounding error.
            let part = f64::from(k) / n_steps;
            self.q_tilde_m = core::array::from_fn(|i| start[i] * (1.0 - part) + target_m[i] * part);
            self.settle(elapsed_s / n_steps);
        }
    }

    /// Whether anything changes while the actuators stand still.
    pub(crate) fn depends_on_time(&self) -> bool {
        self.ends.depend_on_time()
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
        core::array::from_fn(|i| self.line_load(&self.z_m, i).actuator_n)
    }

    /// Equilibria that did not converge within the iterations allowed.
    pub(crate) fn n_unsolved(&self) -> u64 {
        self.n_unsolved
    }

    /// Finds the equilibrium for the present actuator positions and brings the memory up to date.
    fn settle(&mut self, step_s: f64) {
        self.ends.begin(step_s);
        if self.disk_mu > 0.0 {
            let [x, y] = self.bend_rad();
            let disks = (self.disk_mu * x.hypot(y)).exp();
            self.lines.iter_mut().for_each(|line| line.rub_at_disks(disks, self.capstan));
        }
        let more_m = self.ends.more_half_play_m();
        for i in 0..3 {
            self.memory[i].play_m = self.lines[i].play(self.memory[i].play_m, self.q_tilde_m[i], more_m);
        }
        if !self.solve() {
            self.n_unsolved += 1;
        }
        let mut sum_of_loads = 0.0;
        for i in 0..3 {
            let load = self.line_load(&self.z_m, i);
            let end_m = self.end_m(&self.z_m, i);
            self.memory[i] = self.lines[i].settled(self.memory[i], end_m + self.ends.stretch_m(i));
            self.ends.end(i, end_m, load.disk_n);
            sum_of_loads += load.disk_n.abs();
        }
        self.bending.end([self.z_m[0], self.z_m[1]], sum_of_loads);
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

    /// What pushes each end of a line at the disk: force, N, and its fall with the position, N/m.
    fn loads(&self, z: &Vec3) -> [(f64, f64); 3] {
        core::array::from_fn(|i| {
            let load = self.line_load(z, i);
            let (resistance_n, slope) = self.ends.resistance(i, self.end_m(z, i));
            (load.disk_n - resistance_n, load.stiffness_n_per_m + slope)
        })
    }

    fn line_load(&self, z: &Vec3, i: usize) -> Load {
        self.lines[i].load(self.memory[i], self.end_m(z, i) + self.ends.stretch_m(i))
    }

    /// y_i, m.
    fn end_m(&self, z: &Vec3, i: usize) -> f64 {
        self.directions[i][0] * z[0] + self.directions[i][1] * z[1] + z[2]
    }

    /// ∇Φ, N.
    fn gradient(&self, z: &Vec3, loads: &[(f64, f64); 3]) -> Vec3 {
        let [x, y] = self.bending.gradient([z[0], z[1]], self.ends.stiffness());
        let mut gradient = [x, y, self.axial_n_per_m * z[2]];
        for ((force, _), direction) in loads.iter().zip(self.directions) {
            gradient[0] -= force * direction[0];
            gradient[1] -= force * direction[1];
            gradient[2] -= force;
        }
        gradient
    }

    /// ∇²Φ, N/m, without what `bending` leaves out.
    fn hessian(&self, z: &Vec3, loads: &[(f64, f64); 3]) -> [Vec3; 3] {
        let bending = self.bending.hessian([z[0], z[1]], self.ends.stiffness());
        let mut hessian = [[bending[0][0], bending[0][1], 0.0], [bending[1][0], bending[1][1], 0.0], [0.0; 3]];
        hessian[2][2] = self.axial_n_per_m;
        for ((_, stiffness), direction) in loads.iter().zip(self.directions) {
            let n = [direction[0], direction[1], 1.0];
            for k in 0..3 {
                for l in 0..3 {
                    hessian[k][l] += stiffness * n[k] * n[l];
                }
            }
        }
        hessian
    }
}

/// The constants of line i. Where disks rub, all friction acts there, at the end of the line's last piece.
fn line(truth: &Truth, axial_n: f64, i: usize) -> Line {
    let (m, lines) = (&truth.machine, &truth.lines);
    let asymmetry = truth.effects.asymmetry;
    let soft = 1.0 + lines.softness[i];
    let (mut holder_m, mut cone_m) = (m.l_d_m, m.l_c_m);
    if lines.disk_mu > 0.0 {
        let behind_m = m.l_m.min(0.5 * holder_m);
        (holder_m, cone_m) = (behind_m, cone_m + holder_m - behind_m);
    }
    let compliance = |length_m: f64, actuator_m_per_n: f64| Compliance {
        pushed_m_per_n: length_m / axial_n * (1.0 - asymmetry) * soft * (1.0 + lines.push_softness) + actuator_m_per_n,
        pulled_m_per_n: length_m / axial_n * (1.0 + asymmetry) * soft + actuator_m_per_n,
    };
    let capstan = (2.0 * truth.effects.mu * m.phi_rad).exp();
    let spread = (lines.cone_radius_m > 0.0).then(|| {
        let arc_m = (lines.cone_radius_m * m.phi_rad).min(0.5 * m.l_c_m);
        let lengths_m = (arc_m, m.l_c_m - 2.0 * arc_m, cone_m - m.l_c_m);
        SpreadCone::new(lengths_m, capstan, truth.effects.f_s_n, lines.actuator_m_per_n, compliance)
    });
    Line {
        half_play_m: truth.effects.play_m / 2.0,
        holder: compliance(holder_m, 0.0),
        inside: Inside { per_metre: compliance(lines.inside, 0.0), length_m: m.l_m },
        cone: compliance(cone_m, lines.actuator_m_per_n),
        capstan,
        static_friction_n: truth.effects.f_s_n,
        spread,
    }
}

/// Line i's end moves with a part of what line j moves.
fn coupled(holes: [[f64; 2]; 3], coupling: &[f64; 6]) -> [[f64; 2]; 3] {
    let [k12, k13, k21, k23, k31, k32] = *coupling;
    let by_line = [[0.0, k12, k13], [k21, 0.0, k23], [k31, k32, 0.0]];
    core::array::from_fn(|i| {
        core::array::from_fn(|k| holes[i][k] + (0..3).map(|j| by_line[i][j] * holes[j][k]).sum::<f64>())
    })
}

fn dot(a: &Vec3, b: &Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
