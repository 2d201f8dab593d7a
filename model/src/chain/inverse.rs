//! The inverse of a chain: the actuator positions at which the machine, with all its effects, takes the wanted shape.

use super::circumstances::{ChainStatus, Circumstances, Clock};
use super::lines::Lines;
use super::model::{ChainModel, Memory};
use super::stages::Stage;
use super::{Chain, MAX_LEARNT, outer_strain};
use crate::effects::cone::Span;
use crate::effects::prepared::Now;
use crate::effects::{Dual, Real, Scalar, three};
use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, Vector2, Vector3};

/// One step's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainCommand {
    /// Displacements of the lines at the snake without their extensions, m, push positive.
    pub q_m: Vector3<f64>,
    /// What the actuators shall be told minus that, m.
    pub eps_m: Vector3<f64>,
    /// What the actuators shall be told, in the encoders' terms, m, push positive.
    pub q_tilde_m: Vector3<f64>,
    /// Planned loads of the lines at the snake, N, push positive.
    pub tau_n: Vector3<f64>,
    /// Planned loads of the actuators, N, push positive: within the limits of friction, by the signs of motion.
    pub tau_tilde_n: Vector3<f64>,
    /// d eps / d bend at constant memory and signs of motion, 3x2, m/rad.
    pub alpha_m_per_rad: Matrix3x2<f64>,
    /// J~ = (I + J alpha)^-1 J, 2x3, rad/m; zero where it does not exist, which no chain within bounds reaches.
    pub j_tilde_rad_per_m: Matrix2x3<f64>,
    /// Signs of motion of the lines where friction begins, each -1 to 1.
    pub signs: Vector3<f64>,
    /// What there is to say.
    pub status: ChainStatus,
}

/// Everything that a [`ChainCompensator`] remembers from one step to the next.
#[derive(Clone, Copy, Debug)]
pub struct ChainMemory {
    effects: Memory<f64>,
    friction: Direction,
    play: Direction,
    before: Track,
    clock: Clock,
    last: ChainCommand,
    learnt: [f64; MAX_LEARNT],
}

/// Inverts a chain step by step; owns the memory of every effect and of each line's direction.
#[derive(Clone, Debug)]
pub struct ChainCompensator {
    core: InverseCore<f64>,
    /// Pseudo-inverse of the chain's J_q.
    j: Matrix2x3<f64>,
    strain_limit: f64,
    max_bend_rad: f64,
    clock: Clock,
    last: ChainCommand,
    /// Values in force of the parameters that are learnt; NaN where there are no more.
    learnt: [f64; MAX_LEARNT],
    places: [(usize, usize); MAX_LEARNT],
}

impl ChainCompensator {
    pub(super) fn new(chain: &Chain) -> Self {
        let core = InverseCore::new(&chain.model, chain.settings.transition_m);
        let j = pseudo_inverse(&core.model);
        let last = ChainCommand {
            q_m: Vector3::zeros(),
            eps_m: Vector3::zeros(),
            q_tilde_m: Vector3::zeros(),
            tau_n: Vector3::zeros(),
            tau_tilde_n: Vector3::zeros(),
            alpha_m_per_rad: Matrix3x2::zeros(),
            j_tilde_rad_per_m: Matrix2x3::zeros(),
            signs: Vector3::zeros(),
            status: ChainStatus::Good,
        };
        let (strain_limit, max_bend_rad) = (chain.settings.strain_limit, chain.max_bend_rad);
        let (mut learnt, mut places) = ([f64::NAN; MAX_LEARNT], [(usize::MAX, 0); MAX_LEARNT]);
        for (lane, own) in chain.learnt.iter().enumerate().take(MAX_LEARNT) {
            (learnt[lane], places[lane]) = (own.start, (own.effect, own.parameter));
        }
        let clock = Clock::default();
        let mut compensator = Self { core, j, strain_limit, max_bend_rad, clock, last, learnt, places };
        compensator.last = compensator.clone().step(Vector2::zeros(), &Circumstances::at(0.0));
        compensator
    }

    /// Starts again at a bend (rad) at rest, with known signs of motion, each in -1..=1; 0 is the middle of the play.
    ///
    /// A bend that is not finite changes nothing. The command at the start is what the next step at this bend gives.
    pub fn restart(&mut self, bend_rad: Vector2<f64>, signs: Vector3<f64>, at: &Circumstances) {
        let Some(wanted) = self.wanted::<true>(bend_rad) else { return };
        self.clock = Clock::default();
        let now = Now { fresh: true, ..self.clock.now(at) };
        self.core.restart(seeded(wanted.b), signs.map(|s| if s.is_finite() { s.clamp(-1.0, 1.0) } else { 0.0 }), &now);
        self.step(bend_rad, at);
    }

    /// What the actuators shall be told for the next bend setpoint, rad.
    ///
    /// A setpoint that is not finite repeats the command before; one beyond the strain limit is limited. Both are in the status.
    ///
    /// # Real-time
    /// No allocation, no lock; loops over the effects and the three lines.
    pub fn step(&mut self, bend_rad: Vector2<f64>, at: &Circumstances) -> ChainCommand {
        if self.core.model.short { self.advance::<false>(bend_rad, at) } else { self.advance::<true>(bend_rad, at) }
    }

    #[inline(always)]
    fn advance<const FULL: bool>(&mut self, bend_rad: Vector2<f64>, at: &Circumstances) -> ChainCommand {
        let Some(wanted) = self.wanted::<FULL>(bend_rad) else {
            self.last.status = ChainStatus::NotFinite;
            return self.last;
        };
        let now = Now { commit: true, ..self.clock.now(at) };
        self.clock.tick(&now);
        let plan = self.core.step::<FULL, _>(seeded(wanted.b), &now);
        let command = self.command::<FULL>(&wanted, &plan);
        self.last = command;
        command
    }

    /// What the newest step gave.
    pub(super) fn last_command(&self) -> &ChainCommand {
        &self.last
    }

    /// The values in force of the parameters that the chain learns, in their order; NaN behind the last.
    pub fn learnt(&self) -> &[f64; MAX_LEARNT] {
        &self.learnt
    }

    /// Sets the values of the learnt parameters, in their order; what is not finite stays as it is.
    ///
    /// The next command changes by what the new values ask for: whoever calls this makes the steps small.
    ///
    /// # Real-time
    /// No allocation; only what has changed is computed anew.
    pub fn set_learnt(&mut self, values: &[f64; MAX_LEARNT]) {
        for (lane, &value) in values.iter().enumerate() {
            // A lane without a parameter is NaN, and stays so.
            if value.is_finite() && self.learnt[lane].is_finite() && value != self.learnt[lane] {
                self.core.model.set(self.places[lane], value);
                self.learnt[lane] = value;
                self.j = pseudo_inverse(&self.core.model);
            }
        }
    }

    /// What it remembers, for [`ChainCompensator::restore`]. Allocates nothing.
    pub fn memory(&self) -> ChainMemory {
        let InverseCore { memory: effects, friction, play, before, .. } = self.core;
        ChainMemory { effects, friction, play, before, clock: self.clock, last: self.last, learnt: self.learnt }
    }

    /// Forgets every step since this was its memory, and every value that was set since.
    pub fn restore(&mut self, memory: &ChainMemory) {
        let ChainMemory { effects, friction, play, before, clock, last, learnt } = *memory;
        self.set_learnt(&learnt);
        (self.core.memory, self.core.friction, self.core.play, self.core.before) = (effects, friction, play, before);
        (self.clock, self.last) = (clock, last);
    }

    /// How often a formula was not finite since the start, and counted as zero.
    pub fn n_formula_faults(&self) -> u64 {
        self.core.memory.n_formula_faults
    }

    /// The same start for a model with tangents.
    pub(super) fn core_with<P: Real>(&self, model: ChainModel<P>) -> InverseCore<P> {
        InverseCore {
            model,
            memory: Memory::straight(),
            friction: self.core.friction,
            play: self.core.play,
            before: self.core.before,
        }
    }

    /// The setpoint as the shape that the arc shall take; `None` where it is not finite.
    #[inline(always)]
    fn wanted<const FULL: bool>(&self, bend_rad: Vector2<f64>) -> Option<Wanted> {
        if !(bend_rad.x.is_finite() && bend_rad.y.is_finite()) {
            return None;
        }
        let mut wanted = Wanted { b: bend_rad.into(), by_setpoint: Matrix2::identity(), status: ChainStatus::Good };
        if FULL && self.core.model.stages.has_any(Stage::Shape) {
            wanted = self.unobserved(bend_rad);
        }
        let [x, y] = wanted.b;
        if x * x + y * y <= self.max_bend_rad * self.max_bend_rad {
            return Some(wanted);
        }
        Some(self.held(bend_rad, Vector2::new(x, y)))
    }

    #[inline(never)]
    fn unobserved(&self, bend_rad: Vector2<f64>) -> Wanted {
        let b = self.core.model.unobserve([Dual::<2>::seed(bend_rad.x, 0), Dual::seed(bend_rad.y, 1)]);
        let by_setpoint = Matrix2::from_fn(|i, k| b[i].tangent[k]);
        Wanted { b: b.map(Dual::value), by_setpoint, status: ChainStatus::Good }
    }

    /// The largest bend in the direction that was asked for.
    #[cold]
    fn held(&self, bend_rad: Vector2<f64>, b: Vector2<f64>) -> Wanted {
        // A shape that has left the range of its equations says less than the setpoint does.
        let asked = if b.x.is_finite() && b.y.is_finite() { b } else { bend_rad };
        let norm = asked.x.hypot(asked.y).min(f64::MAX);
        let held = asked / norm;
        let held = held * (self.max_bend_rad / held.norm());
        let strain = outer_strain(&self.core.model.constants, norm);
        let status = ChainStatus::BeyondStrain { strain, limit: self.strain_limit };
        Wanted { b: held.into(), by_setpoint: Matrix2::identity(), status }
    }

    #[inline(always)]
    fn command<const FULL: bool>(&self, wanted: &Wanted, plan: &Plan<Dual<2>>) -> ChainCommand {
        let model = &self.core.model;
        let mut alpha = Matrix3x2::from_fn(|i, k| plan.eps[i].tangent[k]);
        if FULL && model.stages.has_any(Stage::Shape) {
            let j = Matrix3x2::from_fn(|i, k| model.backbones.j[i][k]);
            alpha = (j + alpha) * wanted.by_setpoint - j;
        }
        let gain = Matrix2::identity() + self.j * alpha;
        let j_tilde = gain.try_inverse().map_or_else(Matrix2x3::zeros, |inverse| inverse * self.j);
        let (q, eps) = (plan.q.map(Dual::value), plan.eps.map(Dual::value));
        ChainCommand {
            q_m: q.into(),
            eps_m: eps.into(),
            q_tilde_m: three(|i| q[i] + eps[i]).into(),
            tau_n: plan.tau_n.into(),
            tau_tilde_n: plan.tau_tilde_n.into(),
            alpha_m_per_rad: alpha,
            j_tilde_rad_per_m: j_tilde,
            signs: self.core.friction.signs.into(),
            status: wanted.status,
        }
    }
}

/// Of the chain's J_q.
fn pseudo_inverse(model: &ChainModel<f64>) -> Matrix2x3<f64> {
    Matrix2x3::from_fn(|k, i| model.divide[i][k])
}

/// The shape that the arc shall take.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    b: [f64; 2],
    /// d b / d setpoint.
    by_setpoint: Matrix2<f64>,
    status: ChainStatus,
}

/// A shape with tangents by itself.
#[inline(always)]
fn seeded([x, y]: [f64; 2]) -> [Dual<2>; 2] {
    [Dual { value: x, tangent: [1.0, 0.0] }, Dual { value: y, tangent: [0.0, 1.0] }]
}

/// The direction of three lines by a stop operator.
#[derive(Clone, Copy, Debug)]
struct Direction {
    /// Travel that turns each sign around, m.
    travel_m: [f64; 3],
    signs: [f64; 3],
}

impl Direction {
    /// At rest; `position` has tangents by the bend, `row_norms` are the lengths of the rows of J_q.
    fn new(position: [Dual<2>; 3], row_norms: [f64; 3], transition_m: f64) -> Self {
        // The transition is measured in travel of q; this position travels further by the slope of the extension.
        let slope = |i: usize| position[i].tangent[0].hypot(position[i].tangent[1]) / row_norms[i];
        Self { travel_m: [0, 1, 2].map(|i| transition_m * slope(i).max(0.1)), signs: [0.0; 3] }
    }

    #[inline(always)]
    fn advance(&mut self, travelled_m: [f64; 3]) {
        for ((sign, travelled_m), travel_m) in self.signs.iter_mut().zip(travelled_m).zip(self.travel_m) {
            *sign = (*sign + 2.0 * travelled_m / travel_m).clamp(-1.0, 1.0);
        }
    }
}

/// The inverse for any pair of parameters and variables.
#[derive(Clone, Debug)]
pub(super) struct InverseCore<P> {
    pub model: ChainModel<P>,
    pub memory: Memory<P>,
    /// Of the place where friction begins: which limit of friction the line is at.
    friction: Direction,
    /// Of the actuator's side: on which side of its play the line lies.
    play: Direction,
    /// The lines at the step before.
    before: Track,
}

impl<P: Real> InverseCore<P> {
    /// Starts again at a shape.
    fn restart<S: Scalar<P>>(&mut self, b: [S; 2], signs: Vector3<f64>, now: &Now) {
        let now = Now { commit: true, ..*now };
        let lines = self.model.lines::<true, _, _>(&mut self.memory, b, self.model.preload, &now);
        let extensions = three(|i| self.model.extension::<true, S>(&lines, i));
        self.before = Track::of::<true, _, _>(&self.model, &lines, &extensions);
        (self.friction.signs, self.play.signs) = (signs.into(), signs.into());
    }

    /// What is planned for the lines at a shape.
    #[inline(always)]
    pub(super) fn step<const FULL: bool, S: Scalar<P>>(&mut self, b: [S; 2], now: &Now) -> Plan<S> {
        let model = &self.model;
        let lines = model.lines::<FULL, _, _>(&mut self.memory, b, model.preload, now);
        let extensions = three(|i| model.extension::<FULL, S>(&lines, i));
        let track = Track::of::<FULL, _, _>(model, &lines, &extensions);
        let before = core::mem::replace(&mut self.before, track);
        turn(&mut self.friction, &mut self.play, &before, &track);
        let signs = self.friction.signs;
        let mut eps = three(|i| {
            let at_sign = if FULL { extensions[i].at(signs[i]) } else { model.short_extension_at(&lines, i, signs[i]) };
            at_sign + (model.half_width * P::constant(self.play.signs[i]) - model.preload_m)
        });
        if FULL && model.stages.has_any(Stage::Encoder) {
            let told = model.reading(&mut self.memory, three(|i| lines.q[i] + eps[i]), now);
            eps = three(|i| told[i] - lines.q[i]);
        }
        let tau_tilde_n = three(|i| model.load::<FULL, S>(&lines, i).at(signs[i]).value());
        Plan { q: lines.q, tau_n: lines.tau.map(S::value), tau_tilde_n, eps }
    }
}

/// What is planned for the lines.
pub(super) struct Plan<S> {
    /// Displacements at the snake, m.
    pub q: [S; 3],
    tau_n: [f64; 3],
    tau_tilde_n: [f64; 3],
    /// What the actuators shall be told minus q, m.
    pub eps: [S; 3],
}

/// Advances the signs: friction's first, and then the play's in the direction in which the line's end really moves. Its passage
/// from one limit of friction to the other is fast and crosses no gap: only what the limits travel counts.
#[inline(always)]
fn turn(friction: &mut Direction, play: &mut Direction, before: &Track, now: &Track) {
    let signs_before = friction.signs;
    friction.advance(three(|i| now.seat_m[i] - before.seat_m[i]));
    play.advance(three(|i| {
        let s = friction.signs[i];
        let here = now.end_m[i].at(s);
        let limits = here - before.end_m[i].at(s);
        limits.abs().copysign(here - before.end_m[i].at(signs_before[i]))
    }));
}

/// Where the lines are.
#[derive(Clone, Copy, Debug)]
struct Track {
    seat_m: [f64; 3],
    /// Ends of the lines between the limits of friction.
    end_m: [Span<f64>; 3],
}

impl Track {
    #[inline(always)]
    fn of<const FULL: bool, P: Real, S: Scalar<P>>(
        model: &ChainModel<P>,
        lines: &Lines<P, S>,
        extensions: &[Span<S>; 3],
    ) -> Self {
        let end = |i: usize| Span {
            middle: lines.q[i].value() + extensions[i].middle.value(),
            half: extensions[i].half.value(),
        };
        Self { seat_m: three(|i| model.seat::<FULL, S>(lines, i).value()), end_m: three(end) }
    }
}

impl InverseCore<f64> {
    fn new(model: &ChainModel<f64>, transition_m: f64) -> Self {
        let now = Clock::default().now(&Circumstances::at(0.0));
        let memory = Memory::straight();
        let lines = model.lines::<true, _, _>(&mut { memory }, seeded([0.0; 2]), Dual::constant(model.preload), &now);
        let row_norms = model.backbones.j.map(|row| row[0].hypot(row[1]));
        let seats = three(|i| model.seat::<true, _>(&lines, i));
        let extensions = three(|i| model.extension::<true, _>(&lines, i));
        let ends = three(|i| lines.q[i] + extensions[i].middle);
        let friction = Direction::new(seats, row_norms, transition_m);
        let play = Direction::new(ends, row_norms, transition_m);
        Self {
            model: model.clone(),
            memory,
            friction,
            play,
            before: Track::of::<true, _, _>(model, &lines, &extensions),
        }
    }
}
