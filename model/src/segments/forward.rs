//! The bends that segments take for positions of their actuators: equilibrium of all backbones on their lines, with memory.
//!
//! Problem: for q~ find bends b and stretches u with
//!
//! ```text
//! J^T tau = eta grad E(b),   u_j E A_j/L_j = sum_(k passes j) tau_k
//! p_k  = clamp(p_k, q~_k - half_width, q~_k + half_width),   y_k = J_k b + sum_(j <= m) u_j
//! tau_k = clamp((s_k - y_k)/c_k, pushed, drawn),             c_k = c_d + share l_k(b)/(E A)
//! ```
//!
//! where: s_k is where line k stands in the cone; pushed and drawn are the loads at which it slides there, the solutions of
//! p - y = c_k tau + c_c hi(tau) and of the same with lo. tau falls with y, so that the energy is convex and Newton's method with a
//! halved step finds the one equilibrium; afterwards s_k follows the lines that have slid.
//!
//! Failure: where [`MAX_ROUNDS`] do not suffice the last iterate is kept and counted. Rigid lines have no loads: the bends then fit
//! q~ best. Preload and bounds of the model ask for loads and do not matter here: elastic lines share as their lengths say.

use super::{Bends, LineValues, LinesByBends, MAX_BENDS, MAX_SEGMENTS, SegmentChain};
use crate::chain::DelayLine;
use nalgebra::{SMatrix, SVector};

/// Newton's rounds in one step; 3 to 6 are usual.
const MAX_ROUNDS: usize = 40;
/// Halvings of one step.
const MAX_HALVINGS: usize = 14;
/// Largest rest of the equations, N m and N times [`UNIT_M`].
const REST_NM: f64 = 1e-12;
/// Unit of the stretches in the unknowns, m: a millimetre weighs as a radian.
const UNIT_M: f64 = 1e-3;

pub(super) const N: usize = MAX_BENDS + MAX_SEGMENTS;
pub(super) type Unknowns = SVector<f64, N>;

/// Predicts bends step by step; owns the memory of every line.
#[derive(Clone, Debug)]
pub struct SegmentPredictor {
    pub(super) chain: SegmentChain,
    pub(super) unknowns: Unknowns,
    /// Where the play ends, m.
    pub(super) play_m: LineValues,
    /// Where each line stands in the cone, m.
    pub(super) seat_m: LineValues,
    tau_n: LineValues,
    actuator_load_n: LineValues,
    n_unsolved: u64,
    /// What the camera has yet to show, where it is late.
    delay: Option<Box<DelayLine<f64, MAX_BENDS>>>,
}

/// One line at some unknowns.
pub(super) struct Loaded {
    pub tau_n: f64,
    /// Compliance of all that moves with the load, m/N.
    pub slope: f64,
    pub seat_m: f64,
    /// 1 while it slides pushed, -1 drawn back, 0 while it sticks in the cone.
    pub side: f64,
    /// Compliance between snake and cone, m/N.
    pub c_d_m_per_n: f64,
}

impl SegmentPredictor {
    pub(super) fn new(chain: &SegmentChain) -> Self {
        let zeros = LineValues::zeros();
        Self {
            chain: chain.clone(),
            unknowns: Unknowns::zeros(),
            play_m: zeros,
            seat_m: zeros,
            tau_n: zeros,
            actuator_load_n: zeros,
            n_unsolved: 0,
            delay: chain.delay_s.map(|_| Box::new(DelayLine::new())),
        }
    }

    /// The bends, rad, for the next positions of the actuators, m; positions that are not finite repeat the last bends.
    ///
    /// # Real-time
    /// No allocation; at most 40 solutions of 9 equations.
    pub fn step(&mut self, q_tilde_m: &LineValues) -> Bends {
        if q_tilde_m.iter().all(|q| q.is_finite()) {
            self.balance(q_tilde_m);
            self.settle();
        }
        self.bends_rad()
    }

    /// Whether the lines are taken for rigid.
    pub(super) fn is_rigid(&self) -> bool {
        self.chain.machine.c_d_m_per_n.iter().all(|give| *give == 0.0)
    }

    /// The equilibrium for finite positions of the actuators, m; where the lines stand in the cone is still that of before.
    pub(super) fn balance(&mut self, q_tilde_m: &LineValues) {
        for (k, (play_m, q_m)) in self.play_m.iter_mut().zip(q_tilde_m.iter()).enumerate() {
            let half_m = self.chain.half_width_m(k);
            *play_m = play_m.clamp(q_m - half_m, q_m + half_m);
        }
        if self.is_rigid() {
            let bends_rad = self.chain.machine.bends_from_q(&self.play_m);
            self.unknowns.fixed_rows_mut::<MAX_BENDS>(0).copy_from(&bends_rad);
        } else {
            self.n_unsolved += u64::from(!self.solve());
        }
    }

    /// The lines that have slid stand where the equilibrium has them.
    pub(super) fn settle(&mut self) {
        if self.is_rigid() {
            return;
        }
        for k in 0..self.chain.machine.n_lines() {
            let Loaded { tau_n, seat_m, .. } = self.loaded(&self.unknowns, k);
            (self.tau_n[k], self.seat_m[k]) = (tau_n, seat_m);
            // What gives in the cone carries the actuator's load, whether the line slides there or sticks.
            self.actuator_load_n[k] = (self.play_m[k] - seat_m) / self.chain.machine.c_c_m_per_n[k];
        }
    }

    /// The bends of the newest step, rad.
    pub fn bends_rad(&self) -> Bends {
        self.unknowns.fixed_rows::<MAX_BENDS>(0).into()
    }

    /// The bends as the camera shows them, rad, once after each step, whose time this is.
    pub fn observed_rad(&mut self, time_s: f64) -> Bends {
        let shown_rad = self.shown_rad(time_s);
        match (&mut self.delay, self.chain.delay_s) {
            (Some(delay), Some(delay_s)) => delay.pass(time_s, shown_rad.into(), delay_s).into(),
            _ => shown_rad,
        }
    }

    /// The bends of the newest step as a camera that is not late would show them, rad.
    pub(super) fn shown_rad(&self, time_s: f64) -> Bends {
        let n = self.chain.machine.n();
        self.chain.of_segments.seen(&self.chain.seen.add(self.bends_rad().into(), n, time_s).into())
    }

    /// Loads of the lines at the snake in the newest step, N, push positive.
    pub fn tau_n(&self) -> &LineValues {
        &self.tau_n
    }

    /// Loads of the lines at their actuators, where load cells are, N, push positive: those at the snake and all friction between;
    /// `None` where the lines are taken for rigid, which have no loads.
    pub fn actuator_load_n(&self) -> Option<&LineValues> {
        (!self.is_rigid()).then_some(&self.actuator_load_n)
    }

    /// Steps whose equilibrium was not found.
    pub fn n_unsolved(&self) -> u64 {
        self.n_unsolved
    }

    fn solve(&mut self) -> bool {
        for _ in 0..MAX_ROUNDS {
            let (rest, tangent) = self.equations(&self.unknowns);
            if rest.amax() < REST_NM {
                return true;
            }
            let Some(step) = tangent.lu().solve(&(-rest)) else { return false };
            let slope = rest.dot(&step).abs();
            let mut part = 1.0;
            for _ in 0..MAX_HALVINGS {
                if self.equations(&(self.unknowns + step * part)).0.dot(&step) <= 0.5 * slope {
                    break;
                }
                part *= 0.5;
            }
            self.unknowns += step * part;
        }
        self.equations(&self.unknowns).0.amax() < 1e3 * REST_NM
    }

    /// What is left of the equations, and how it changes with the unknowns.
    pub(super) fn equations(&self, at: &Unknowns) -> (Unknowns, SMatrix<f64, N, N>) {
        let (chain, machine) = (&self.chain, &self.chain.machine);
        let bends_rad: Bends = at.fixed_rows::<MAX_BENDS>(0).into();
        let (mut rest, mut tangent) = (Unknowns::zeros(), SMatrix::<f64, N, N>::identity());
        rest.fixed_rows_mut::<MAX_BENDS>(0).copy_from(&chain.moments_nm(&bends_rad));
        let hess = machine.padded(chain.moment_slopes_nm(&bends_rad));
        tangent.fixed_view_mut::<MAX_BENDS, MAX_BENDS>(0, 0).copy_from(&hess);
        for j in 0..machine.n() {
            let stiffness = UNIT_M * UNIT_M / machine.axial_m_per_n[j];
            rest[MAX_BENDS + j] = stiffness * at[MAX_BENDS + j];
            tangent[(MAX_BENDS + j, MAX_BENDS + j)] = stiffness;
        }
        for k in 0..machine.n_lines() {
            let loaded = self.loaded(at, k);
            let row = Self::row(machine.j(), machine.segment_of(k), k);
            rest -= row * loaded.tau_n;
            tangent += row * self.falls(&loaded, &row, k).transpose();
        }
        (rest, tangent)
    }

    /// -d tau_k / d unknowns.
    pub(super) fn falls(&self, loaded: &Loaded, row: &Unknowns, k: usize) -> Unknowns {
        // The piece inside the snake becomes longer with q, and gives more.
        let longer = loaded.tau_n * self.chain.inside * self.chain.machine.give_per_n[k];
        let mut falls = row / loaded.slope;
        let mut bends = falls.fixed_rows_mut::<MAX_BENDS>(0);
        bends *= 1.0 + longer;
        falls
    }

    /// d y_k / d unknowns.
    pub(super) fn row(j: &LinesByBends, segment: usize, k: usize) -> Unknowns {
        let mut row = Unknowns::zeros();
        row.fixed_rows_mut::<MAX_BENDS>(0).copy_from(&j.row(k).transpose());
        (0..=segment).for_each(|j| row[MAX_BENDS + j] = UNIT_M);
        row
    }

    /// What line k has inside the snake, m, and where it ends, m.
    pub(super) fn inside_and_end_m(&self, at: &Unknowns, k: usize) -> (f64, f64) {
        let machine = &self.chain.machine;
        let segment = machine.segment_of(k);
        let q_m = (0..MAX_BENDS).map(|i| machine.j()[(k, i)] * at[i]).sum::<f64>();
        let end_m = q_m + UNIT_M * (0..=segment).map(|j| at[MAX_BENDS + j]).sum::<f64>();
        (q_m + machine.l_m[..=segment].iter().sum::<f64>(), end_m)
    }

    pub(super) fn loaded(&self, at: &Unknowns, k: usize) -> Loaded {
        let (chain, machine) = (&self.chain, &self.chain.machine);
        let (inside_m, end_m) = self.inside_and_end_m(at, k);
        let c_d = machine.c_d_m_per_n[k] + chain.inside * machine.give_per_n[k] * inside_m;
        let c_c = machine.c_c_m_per_n[k];
        let slid = |tau_n: f64, slope: f64, side: f64| Loaded {
            tau_n,
            slope,
            seat_m: end_m + c_d * tau_n,
            side,
            c_d_m_per_n: c_d,
        };
        let sticks_n = (self.seat_m[k] - end_m) / c_d;
        let squeeze_m = self.play_m[k] - end_m;
        let friction = chain.friction(k);
        match friction.load_while_pushed(squeeze_m, c_d, c_c) {
            Some((pushed_n, slope)) if sticks_n < pushed_n => return slid(pushed_n, slope, 1.0),
            _ => {}
        }
        match friction.load_while_pushed(-squeeze_m, c_d, c_c) {
            Some((mirrored_n, slope)) if sticks_n > -mirrored_n => slid(-mirrored_n, slope, -1.0),
            _ => Loaded { tau_n: sticks_n, slope: c_d, seat_m: self.seat_m[k], side: 0.0, c_d_m_per_n: c_d },
        }
    }
}
