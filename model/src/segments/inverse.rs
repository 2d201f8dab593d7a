//! The inverse of a chain of segments: the actuator positions at which all segments, with their effects, take the wanted bends.
//!
//! eps_k = sum_(j <= m) u_j + share tau_k l_k/(E A) + c_d tau_k + c_c tau~_k(s_k) + half_width p_k, where l_k is what the line has inside
//! the snake, and the signs of motion s_k (friction) and p_k (play) turn over a travel of `transition_m`, each by the travel of
//! the place where its friction begins, as a single snake's.
//!
//! Failure: bends beyond the strain limit are held at it; loads that no sharing keeps within its bounds, and setpoints that are not
//! finite, repeat the command before. All are in the status.

use super::friction::Span;
use super::sharing::{ActiveSet, SharedLoads};
use super::statics::Stiffnesses;
use super::{Bends, BendsByBends, BendsByLines, LineValues, LinesByBends, MAX_LINES, SegmentChain, Sharing};
use crate::MAX_LEARNT;
use nalgebra::SMatrix;

/// What there is to say about a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SegmentStatus {
    /// As asked for; the sharing tells whether lines are at their bounds.
    Good(Sharing),
    /// A segment, from 0, is held at the bend that its strain limit allows.
    BeyondStrain {
        /// Which, from 0.
        segment: usize,
        /// The largest bend, rad.
        limit_rad: f64,
    },
    /// No loads within the bounds hold these bends: the command before is repeated.
    Held(Sharing),
    /// A number that was given is not finite: the command before is repeated.
    NotFinite,
}

/// One step's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentCommand {
    /// Displacements of the lines at the snake without their extensions, m, push positive.
    pub q_m: LineValues,
    /// What the actuators shall be told, m, push positive.
    pub q_tilde_m: LineValues,
    /// Planned loads of the lines at the snake, N, push positive.
    pub tau_n: LineValues,
    /// Planned loads of the actuators, N, push positive.
    pub tau_tilde_n: LineValues,
    /// Signs of motion of the lines where friction begins, each -1 to 1.
    pub signs: LineValues,
    /// What there is to say.
    pub status: SegmentStatus,
}

/// Everything that a [`SegmentCompensator`] remembers from one step to the next.
#[derive(Clone, Copy, Debug)]
pub struct SegmentMemory {
    bends_rad: Bends,
    /// At these bends.
    stiffnesses: Stiffnesses,
    active: ActiveSet,
    friction: LineValues,
    play: LineValues,
    track: Track,
    last: SegmentCommand,
    /// Values in force of what is learnt; NaN behind the last.
    learnt: [f64; MAX_LEARNT],
}

/// Where the lines are.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Track {
    seat_m: LineValues,
    /// Ends of the lines between the limits of friction, without play.
    end_m: [Span; MAX_LINES],
}

/// Inverts a chain of segments step by step.
#[derive(Clone, Debug)]
pub struct SegmentCompensator {
    chain: SegmentChain,
    /// How much a sign turns per metre of the seats' travel (friction) and of the ends' (play), 1/m.
    friction_turn_per_m: LineValues,
    play_turn_per_m: LineValues,
    memory: SegmentMemory,
}

/// What is planned at some bends.
struct Plan {
    stiffnesses: Stiffnesses,
    q_m: LineValues,
    loads: SharedLoads,
    track: Track,
    /// Loads at the actuators.
    tau_tilde_n: [Span; MAX_LINES],
}

impl SegmentCompensator {
    pub(super) fn new(chain: &SegmentChain) -> Self {
        let plan = chain.plan(&Bends::zeros(), &[0; MAX_LINES]);
        let zeros = LineValues::zeros();
        let last = SegmentCommand {
            q_m: zeros,
            q_tilde_m: zeros,
            tau_n: zeros,
            tau_tilde_n: zeros,
            signs: zeros,
            status: SegmentStatus::Good(Sharing::Preferred),
        };
        let bends_rad = Bends::zeros();
        let memory = SegmentMemory {
            bends_rad,
            stiffnesses: plan.stiffnesses,
            active: plan.loads.active,
            friction: zeros,
            play: zeros,
            track: plan.track,
            last,
            learnt: chain.start_values(),
        };
        let mut own = Self { friction_turn_per_m: zeros, play_turn_per_m: zeros, chain: chain.clone(), memory };
        // The transition is measured in travel of q; seats and ends travel further by the slope of the extension.
        let (seat, end) = (own.seat_slopes(), own.chain.machine.j() + own.alpha_m_per_rad());
        for k in 0..own.chain.machine.n_lines() {
            let slope = |of: &LinesByBends| (of.row(k).norm() / own.chain.machine.j().row(k).norm()).max(0.1);
            own.friction_turn_per_m[k] = 2.0 / (own.chain.transition_m * slope(&seat));
            own.play_turn_per_m[k] = 2.0 / (own.chain.transition_m * slope(&end));
        }
        own.step(&bends_rad);
        own
    }

    /// What the actuators shall be told for the next bends, rad.
    ///
    /// # Real-time
    /// No allocation; loops over lines and segments, and at most as many pivots as [`super::Segments::share_loads`].
    pub fn step(&mut self, bends_rad: &Bends) -> &SegmentCommand {
        if !bends_rad.iter().all(|bend| bend.is_finite()) {
            return self.held(SegmentStatus::NotFinite);
        }
        let (wanted_rad, beyond) = self.chain.within_strain(bends_rad);
        let plan = self.chain.plan(&wanted_rad, &self.memory.active);
        if !plan.loads.sharing.holds() {
            return self.held(SegmentStatus::Held(plan.loads.sharing));
        }
        let before = core::mem::replace(&mut self.memory.track, plan.track);
        self.turn(&before);
        let (friction, play) = (&self.memory.friction, &self.memory.play);
        let at = |k: usize| self.memory.track.end_m[k].at(friction[k]) + self.chain.half_width_m(k) * play[k];
        let n_lines = self.chain.machine.n_lines();
        let q_tilde_m = LineValues::from_fn(|k, _| if k < n_lines { at(k) } else { 0.0 });
        self.memory.last = SegmentCommand {
            q_m: plan.q_m,
            q_tilde_m,
            tau_n: plan.loads.tau_n,
            tau_tilde_n: LineValues::from_fn(|k, _| plan.tau_tilde_n[k].at(friction[k])),
            signs: *friction,
            status: beyond.unwrap_or(SegmentStatus::Good(plan.loads.sharing)),
        };
        (self.memory.bends_rad, self.memory.stiffnesses) = (wanted_rad, plan.stiffnesses);
        self.memory.active = plan.loads.active;
        &self.memory.last
    }

    /// The values in force of the parameters that the chain learns, in their order; NaN behind the last.
    pub fn learnt(&self) -> &[f64; MAX_LEARNT] {
        &self.memory.learnt
    }

    /// Sets the values of the learnt parameters, in their order; what is not finite stays as it is.
    ///
    /// The next command changes by what the new values ask for: whoever calls this makes the steps small.
    ///
    /// # Real-time
    /// No allocation.
    pub fn set_learnt(&mut self, values: &[f64; MAX_LEARNT]) {
        for (own, value) in self.memory.learnt.iter_mut().zip(values) {
            // A lane without a parameter is NaN, and stays so.
            if own.is_finite() && value.is_finite() {
                *own = *value;
            }
        }
        self.chain.set(&self.memory.learnt);
    }

    /// Displacements of the lines for bends without any effect, m.
    pub fn without_effects(&self, bends_rad: &Bends) -> LineValues {
        self.chain.machine.q_m(bends_rad)
    }

    /// d eps / d bends at the newest bends, at constant memory, signs of motion and set of lines at their bounds, m/rad.
    pub fn alpha_m_per_rad(&self) -> LinesByBends {
        self.slopes().1
    }

    /// q~_dot = (J + alpha) b_dot at the newest bends: how fast the actuators go while the bends do, m/s.
    pub fn rates_m_per_s(&self, bends_vel_rad_per_s: &Bends) -> LineValues {
        let (chain, machine) = (&self.chain, &self.chain.machine);
        let SegmentMemory { bends_rad, stiffnesses, active, friction, last, .. } = &self.memory;
        let moments_vel = chain.moments_vel_nm_per_s(bends_rad, bends_vel_rad_per_s, stiffnesses);
        let tau_vel = if active.iter().all(|side| *side == 0) {
            machine.least_loads_n(&moments_vel)
        } else {
            machine.load_slopes(active) * moments_vel
        };
        let q_vel = machine.q_m(bends_vel_rad_per_s);
        let inside_m = machine.inside_m(&last.q_m);
        let mut rates = q_vel + machine.axial_give_m(&tau_vel);
        for k in 0..machine.n_lines() {
            let inside = chain.inside * machine.give_per_n[k] * (tau_vel[k] * inside_m[k] + q_vel[k] * last.tau_n[k]);
            let (_, slope) = chain.friction(k).loads(last.tau_n[k]);
            let cone = machine.c_c_m_per_n[k] * slope.at(friction[k]);
            rates[k] += inside + tau_vel[k] * (machine.c_d_m_per_n[k] + cone);
        }
        rates
    }

    /// J~ = (I + J+ alpha)^-1 J+ at the newest bends, rad/m; zero where it does not exist, which no machine within bounds reaches.
    pub fn j_tilde_rad_per_m(&self) -> BendsByLines {
        let pinv = self.chain.machine.pinv();
        let gain = BendsByBends::identity() + pinv * self.alpha_m_per_rad();
        gain.try_inverse().map_or_else(SMatrix::zeros, |inverse| inverse * pinv)
    }

    /// What it remembers, for [`SegmentCompensator::restore`].
    pub fn memory(&self) -> SegmentMemory {
        self.memory
    }

    /// Forgets every step since this was its memory, and every value that was set since.
    pub fn restore(&mut self, memory: &SegmentMemory) {
        self.memory = *memory;
        self.chain.set(&self.memory.learnt);
    }

    fn held(&mut self, status: SegmentStatus) -> &SegmentCommand {
        self.memory.last.status = status;
        &self.memory.last
    }

    /// Advances the signs: friction's first, and then the play's in the direction in which the line's end really moves. Its passage
    /// from one limit of friction to the other is fast and crosses no gap: only what the limits travel counts.
    fn turn(&mut self, before: &Track) {
        let SegmentMemory { friction, play, track, .. } = &mut self.memory;
        for k in 0..self.chain.machine.n_lines() {
            let was = friction[k];
            let turned = |sign: f64, travelled_m: f64, per_m: f64| (sign + travelled_m * per_m).clamp(-1.0, 1.0);
            friction[k] = turned(was, track.seat_m[k] - before.seat_m[k], self.friction_turn_per_m[k]);
            let here = track.end_m[k].at(friction[k]);
            let limits = here - before.end_m[k].at(friction[k]);
            let travelled = limits.abs().copysign(here - before.end_m[k].at(was));
            play[k] = turned(play[k], travelled, self.play_turn_per_m[k]);
        }
    }

    fn seat_slopes(&self) -> LinesByBends {
        self.slopes().0
    }

    /// d seat / d bends and d eps / d bends, m/rad.
    fn slopes(&self) -> (LinesByBends, LinesByBends) {
        let (chain, machine) = (&self.chain, &self.chain.machine);
        let SegmentMemory { bends_rad, active, friction, last, .. } = &self.memory;
        let j_tau = machine.load_slopes(active) * chain.moment_slopes_nm(bends_rad);
        let shift = machine.axial_give_by_bends(&j_tau);
        let inside_m = machine.inside_m(&machine.q_m(bends_rad));
        let (mut seat, mut alpha) = (machine.j() + shift, shift);
        for k in 0..machine.n_lines() {
            let per_n = chain.inside * machine.give_per_n[k];
            let inside = j_tau.row(k) * (per_n * inside_m[k]) + machine.j().row(k) * (per_n * last.tau_n[k]);
            let holder = inside + j_tau.row(k) * machine.c_d_m_per_n[k];
            let (_, slope) = chain.friction(k).loads(last.tau_n[k]);
            let cone = j_tau.row(k) * (machine.c_c_m_per_n[k] * slope.at(friction[k]));
            seat.set_row(k, &(seat.row(k) + holder));
            alpha.set_row(k, &(alpha.row(k) + holder + cone));
        }
        (seat, alpha)
    }
}

impl SegmentChain {
    /// The lines at some bends, rad.
    fn plan(&self, bends_rad: &Bends, begin: &ActiveSet) -> Plan {
        let machine = &self.machine;
        let stiffnesses = machine.stiffnesses(bends_rad);
        let moments_nm = self.moments_with_nm(bends_rad, &stiffnesses);
        let loads = machine.share_loads(&moments_nm, &self.sharing, begin);
        let q_m = machine.q_m(bends_rad);
        let inside_m = machine.inside_m(&q_m);
        let mut seat_m = q_m + machine.axial_give_m(&loads.tau_n);
        let (mut end_m, mut tau_tilde_n) = ([Span::default(); MAX_LINES], [Span::default(); MAX_LINES]);
        for k in 0..machine.n_lines() {
            let tau_n = loads.tau_n[k];
            seat_m[k] += tau_n * (self.inside * machine.give_per_n[k] * inside_m[k] + machine.c_d_m_per_n[k]);
            let (load, _) = self.friction(k).loads(tau_n);
            let c_c = machine.c_c_m_per_n[k];
            tau_tilde_n[k] = load;
            end_m[k] = Span { middle: seat_m[k] + c_c * load.middle, half: c_c * load.half };
        }
        Plan { stiffnesses, q_m, loads, track: Track { seat_m, end_m }, tau_tilde_n }
    }

    /// The bends, each segment's held at its strain limit.
    pub(super) fn within_strain(&self, bends_rad: &Bends) -> (Bends, Option<SegmentStatus>) {
        let (mut held_rad, mut status) = (*bends_rad, None);
        for segment in 0..self.machine.n {
            let limit_rad = self.machine.max_bend_rad[segment];
            let bend_rad = self.machine.bend(bends_rad, segment);
            if bend_rad.norm_squared() > limit_rad * limit_rad {
                let norm = bend_rad.x.hypot(bend_rad.y).min(f64::MAX);
                let unit = bend_rad / norm;
                held_rad.fixed_rows_mut::<2>(2 * segment).copy_from(&(unit * (limit_rad / unit.norm())));
                status = status.or(Some(SegmentStatus::BeyondStrain { segment, limit_rad }));
            }
        }
        (held_rad, status)
    }
}
