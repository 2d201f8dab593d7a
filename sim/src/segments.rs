//! Segments in series on their lines: static equilibrium, stepped along the path of the actuators so that its memory is right.
//!
//! Problem: for positions p_k behind the plays, find the bends b_j, rad, and stretches u_j, mm, of all segments that minimise
//!
//! ```text
//! Φ = Σ_j [ η |b_j|²/2 (E I_j / L_j + Σ_(k runs in j) E I_k / (L_j + h_k · b_j)) + (E A_j / 2 L_j) u_j² ]  +  Σ_k ∫ -τ_k(y) dy
//! y_k = Σ_(j up to k's segment) (h_k · b_j + u_j),   h_k = r_k (-cos γ_k, sin γ_k)
//! ```
//!
//! where: h_k · b_j is how much longer line k is than segment j's backbone, an arc beside an arc; every line that runs in a segment is
//! bent with it; τ_k(y) is the load of a line whose end is at y (see `line`), which falls with y.
//!
//! Intuition: as in `plant`, each term is convex, and Newton's method on the gradient finds the one equilibrium. Nothing here knows
//! what loads the lines shall have: a line's load is what its stretch makes it.
//!
//! Failure cases: lines that all lie in one plane leave a bend to the backbones alone, which still is one equilibrium. If
//! [`MAX_ITERATIONS`] do not suffice the last iterate is kept and counted.

use crate::line::{Compliance, Inside, Line, Load, Memory};
use crate::segments_truth::{MAX_SEGMENTS, SegmentsTruth, SegmentsTruthError};
use crate::solve::solve_symmetric;
use core::f64::consts::PI;

/// Longest step along a path.
const MAX_STEP_M: f64 = 25e-6;
/// Newton's iterations in one step; 3 to 5 are usual.
const MAX_ITERATIONS: usize = 60;
/// Halvings of one Newton step.
const MAX_HALVINGS: usize = 14;
/// Largest unbalanced moment, N m, and force times a millimetre.
const TOLERANCE_NM: f64 = 1e-12;
/// Unit of the stretches, m: a millimetre weighs as a radian.
const UNIT_M: f64 = 1e-3;
/// Unknowns of a segment: two components of its bend and its stretch.
const PER_SEGMENT: usize = 3;
const N: usize = PER_SEGMENT * MAX_SEGMENTS;

type Unknowns = [f64; N];
type Square = [[f64; N]; N];

/// Simulated segments: what their lines and backbones make of the actuators' positions.
#[derive(Clone, Debug)]
pub struct SimulatedSegments {
    backbones: Vec<Backbone>,
    lines: Vec<Strung>,
    q_tilde_m: Vec<f64>,
    /// Where the motion under way began, m.
    start_m: Vec<f64>,
    z: Unknowns,
    n_unsolved: u64,
}

/// A segment's primary backbone.
#[derive(Clone, Copy, Debug)]
struct Backbone {
    length_m: f64,
    /// η of all that is bent in this segment.
    load_scale: f64,
    /// E I, N m².
    bending_n_m2: f64,
    /// E A / L, N/m.
    axial_n_per_m: f64,
}

/// A line on its way through the segments.
#[derive(Clone, Debug)]
struct Strung {
    line: Line,
    memory: Memory,
    /// The segment at whose disk it ends, from 0.
    ends_at: usize,
    /// h, m.
    hole_m: [f64; 2],
    /// E I, N m².
    bending_n_m2: f64,
}

impl SimulatedSegments {
    /// The straight, unloaded segments.
    ///
    /// # Errors
    /// [`SegmentsTruthError`] for a truth that cannot be.
    pub fn new(truth: &SegmentsTruth) -> Result<Self, SegmentsTruthError> {
        truth.check()?;
        let (mut backbones, mut lines) = (Vec::new(), Vec::new());
        let mut path_m = 0.0;
        for (ends_at, segment) in truth.segment.iter().enumerate() {
            let effects = segment.effects.as_ref().unwrap_or(&truth.effects);
            let m = &segment.machine;
            let axial_n = m.e_pa * PI / 4.0 * (m.d_outer_m.powi(2) - m.d_inner_m.powi(2));
            let bending_n_m2 = m.e_pa * PI / 64.0 * (m.d_outer_m.powi(4) - m.d_inner_m.powi(4));
            backbones.push(Backbone {
                length_m: m.l_m,
                load_scale: effects.load_scale,
                bending_n_m2,
                axial_n_per_m: axial_n / m.l_m,
            });
            path_m += m.l_m;
            let gives = |length_m: f64| {
                let m_per_n = length_m / axial_n;
                Compliance { pushed_m_per_n: m_per_n, pulled_m_per_n: m_per_n }
            };
            let line = Line {
                half_play_m: effects.play_m / 2.0,
                holder: gives(m.l_d_m),
                inside: Inside { per_metre: gives(effects.inside), length_m: path_m },
                cone: gives(m.l_c_m),
                capstan: (2.0 * effects.mu * truth.phi_rad).exp(),
                static_friction_n: effects.f_s_n,
                spread: None,
            };
            lines.extend(segment.azimuths_rad.iter().enumerate().map(|(k, azimuth_rad)| {
                let radius_m = segment.radius_m(k);
                let hole_m = [-radius_m * azimuth_rad.cos(), radius_m * azimuth_rad.sin()];
                Strung { line, memory: Memory::default(), ends_at, hole_m, bending_n_m2 }
            }));
        }
        let q_tilde_m = vec![0.0; lines.len()];
        let start_m = q_tilde_m.clone();
        let mut own = Self { backbones, lines, q_tilde_m, start_m, z: [0.0; N], n_unsolved: 0 };
        own.settle();
        Ok(own)
    }

    /// Moves the actuators in a straight line to a place, m, segment 1's first; a place that is not finite, or of another number of
    /// lines, moves nothing.
    ///
    /// # Real-time
    /// No allocation. At most |change| / 25 um equilibria of at most 60 iterations each.
    pub fn move_to(&mut self, target_m: &[f64]) {
        if target_m.len() != self.lines.len() || !target_m.iter().all(|q| q.is_finite()) {
            return;
        }
        self.start_m.copy_from_slice(&self.q_tilde_m);
        let farthest_m =
            self.start_m.iter().zip(target_m).fold(0.0_f64, |most, (from, to)| most.max((to - from).abs()));
        let n_steps = (farthest_m / MAX_STEP_M).ceil().max(1.0);
        for k in 1..=n_steps as u32 {
            // The last step lands on the target itself, not beside it by a rounding error.
            let part = f64::from(k) / n_steps;
            for ((q, from), to) in self.q_tilde_m.iter_mut().zip(&self.start_m).zip(target_m) {
                *q = from * (1.0 - part) + to * part;
            }
            self.settle();
        }
    }

    /// How many segments there are.
    pub fn n_segments(&self) -> usize {
        self.backbones.len()
    }

    /// Where the actuators stand, m, segment 1's first.
    pub fn q_tilde_m(&self) -> &[f64] {
        &self.q_tilde_m
    }

    /// How many lines there are.
    pub fn n_lines(&self) -> usize {
        self.lines.len()
    }

    /// The true bend vector of a segment (from 0), rad; zero behind the last.
    pub fn bend_rad(&self, segment: usize) -> [f64; 2] {
        let at = PER_SEGMENT * segment;
        if segment < self.backbones.len() { [self.z[at], self.z[at + 1]] } else { [0.0; 2] }
    }

    /// τ: what each line pushes its disk with, N.
    pub fn loads_n(&self) -> impl Iterator<Item = f64> + '_ {
        self.lines.iter().map(|own| own.load(&self.z).disk_n)
    }

    /// τ~: what each line pushes its actuator back with, N.
    pub fn actuator_loads_n(&self) -> impl Iterator<Item = f64> + '_ {
        self.lines.iter().map(|own| own.load(&self.z).actuator_n)
    }

    /// Equilibria that did not converge within the iterations allowed.
    pub fn n_unsolved(&self) -> u64 {
        self.n_unsolved
    }

    /// Finds the equilibrium for the present actuator positions and brings the memory up to date.
    fn settle(&mut self) {
        for (own, q) in self.lines.iter_mut().zip(&self.q_tilde_m) {
            own.memory.play_m = own.line.play(own.memory.play_m, *q, 0.0);
        }
        if !self.solve() {
            self.n_unsolved += 1;
        }
        for own in &mut self.lines {
            own.memory = own.line.settled(own.memory, own.end_m(&self.z));
        }
    }

    /// Newton's method on ∇Φ = 0; says whether it converged.
    fn solve(&mut self) -> bool {
        for _ in 0..MAX_ITERATIONS {
            let (gradient, hessian) = self.slopes(&self.z);
            if gradient.iter().all(|g| g.abs() < TOLERANCE_NM) {
                return true;
            }
            let Some(step) = solve_symmetric(&hessian, &gradient) else { return false };
            let slope = dot(&gradient, &step);
            // Φ is convex: it has fallen as long as its slope along the step has not turned steeply upwards.
            let at = |part: f64| core::array::from_fn(|k| self.z[k] - part * step[k]);
            let mut part = 1.0;
            for _ in 0..MAX_HALVINGS {
                if -dot(&self.slopes(&at(part)).0, &step) <= 0.5 * slope.abs() {
                    break;
                }
                part *= 0.5;
            }
            self.z = at(part);
        }
        false
    }

    /// ∇Φ and ∇²Φ; unknowns of segments that are not there are held at zero.
    fn slopes(&self, z: &Unknowns) -> (Unknowns, Square) {
        let n = PER_SEGMENT * self.backbones.len();
        let mut gradient = [0.0; N];
        let mut hessian: Square =
            core::array::from_fn(|k| core::array::from_fn(|l| if k == l && k >= n { 1.0 } else { 0.0 }));
        for (j, backbone) in self.backbones.iter().enumerate() {
            let at = PER_SEGMENT * j;
            let bend = [z[at], z[at + 1]];
            let square = bend[0] * bend[0] + bend[1] * bend[1];
            let mut add = |modulus: f64, length_m: f64, hole_m: [f64; 2]| {
                // |b|²/2 · modulus / (L + h·b)
                let inverse = 1.0 / (length_m + hole_m[0] * bend[0] + hole_m[1] * bend[1]);
                let stiffness = backbone.load_scale * modulus * inverse;
                for k in 0..2 {
                    gradient[at + k] += stiffness * (bend[k] - 0.5 * square * hole_m[k] * inverse);
                    for l in 0..2 {
                        let identity = if k == l { 1.0 } else { 0.0 };
                        let mixed = (bend[k] * hole_m[l] + bend[l] * hole_m[k]) * inverse;
                        let curved = square * hole_m[k] * hole_m[l] * inverse * inverse;
                        hessian[at + k][at + l] += stiffness * (identity - mixed + curved);
                    }
                }
            };
            add(backbone.bending_n_m2, backbone.length_m, [0.0; 2]);
            for own in self.lines.iter().filter(|own| own.ends_at >= j) {
                add(own.bending_n_m2, backbone.length_m, own.hole_m);
            }
            let axial = backbone.axial_n_per_m * UNIT_M * UNIT_M;
            gradient[at + 2] += axial * z[at + 2];
            hessian[at + 2][at + 2] += axial;
        }
        for own in &self.lines {
            let Load { disk_n, stiffness_n_per_m, .. } = own.load(z);
            let slope = own.slope();
            for k in 0..N {
                gradient[k] -= disk_n * slope[k];
                for l in 0..N {
                    hessian[k][l] += stiffness_n_per_m * slope[k] * slope[l];
                }
            }
        }
        (gradient, hessian)
    }
}

impl Strung {
    /// y, m.
    fn end_m(&self, z: &Unknowns) -> f64 {
        dot(&self.slope(), z)
    }

    /// d y / d z.
    fn slope(&self) -> Unknowns {
        let mut slope = [0.0; N];
        for j in 0..=self.ends_at {
            let at = PER_SEGMENT * j;
            (slope[at], slope[at + 1], slope[at + 2]) = (self.hole_m[0], self.hole_m[1], UNIT_M);
        }
        slope
    }

    fn load(&self, z: &Unknowns) -> Load {
        self.line.load(self.memory, self.end_m(z))
    }
}

fn dot(a: &Unknowns, b: &Unknowns) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
