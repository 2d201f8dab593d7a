//! The inverse of a chain: the actuator positions at which the machine, with all its effects, takes the wanted shape.

use super::circumstances::{ChainStatus, Circumstances, Clock};
use super::model::{ChainModel, Lines, Memory};
use super::stages::Stage;
use super::{Chain, outer_strain};
use crate::effects::prepared::Now;
use crate::effects::{Dual, Real, Scalar, three};
use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, Vector2, Vector3};

/// One step's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
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

/// Inverts a chain step by step; owns the memory of every effect and of each line's direction.
#[derive(Clone, Debug)]
pub struct ChainCompensator {
    core: InverseCore<f64>,
    /// Pseudo-inverse of the chain's J_q.
    j: Matrix2x3<f64>,
    strain_limit: f64,
    max_bend_rad: f64,
    clock: Clock,
    last: Command,
}

impl ChainCompensator {
    pub(super) fn new(chain: &Chain) -> Self {
        let core = InverseCore::new(&chain.model, chain.settings.transition_m);
        let d = &core.model.divide;
        let j = Matrix2x3::from_fn(|k, i| d[i][k]);
        let last = Command {
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
        let mut compensator = Self { core, j, strain_limit, max_bend_rad, clock: Clock::default(), last };
        compensator.last = compensator.clone().step(Vector2::zeros(), &Circumstances::at(0.0));
        compensator
    }

    /// Starts again at a bend (rad) at rest, with known signs of motion, each in -1..=1; 0 is the middle of the play.
    ///
    /// A bend that is not finite changes nothing. The command at the start is what the next step at this bend gives.
    pub fn restart(&mut self, bend_rad: Vector2<f64>, signs: Vector3<f64>, at: &Circumstances) {
        let Some((b, _)) = self.limited(bend_rad) else { return };
        self.clock = Clock::default();
        let now = Now { fresh: true, ..self.clock.now(at) };
        self.core.restart(b, signs.map(|s| if s.is_finite() { s.clamp(-1.0, 1.0) } else { 0.0 }), &now);
        self.step(bend_rad, at);
    }

    /// What the actuators shall be told for the next bend setpoint, rad.
    ///
    /// A setpoint that is not finite repeats the command before; one beyond the strain limit is limited. Both are in the status.
    ///
    /// # Real-time
    /// No allocation, no lock; loops over the effects and the three lines.
    pub fn step(&mut self, bend_rad: Vector2<f64>, at: &Circumstances) -> Command {
        let Some((b, status)) = self.limited(bend_rad) else {
            self.last.status = ChainStatus::NotFinite;
            return self.last;
        };
        let now = Now { commit: true, ..self.clock.now(at) };
        self.clock.tick(&now);
        let (lines, told) = self.core.step(b, &now);
        let command = self.command(b, &lines, &told, status);
        self.last = command;
        command
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

    /// The setpoint as the shape that the arc shall take, with tangents by the setpoint; `None` where it is not finite.
    #[inline(always)]
    fn limited(&self, bend_rad: Vector2<f64>) -> Option<([Dual<2>; 2], ChainStatus)> {
        if !(bend_rad.x.is_finite() && bend_rad.y.is_finite()) {
            return None;
        }
        let mut b = [Dual { value: bend_rad.x, tangent: [1.0, 0.0] }, Dual { value: bend_rad.y, tangent: [0.0, 1.0] }];
        if self.core.model.stages.has_any(Stage::Shape) {
            b = self.core.model.unobserve(b);
        }
        if b[0].value * b[0].value + b[1].value * b[1].value <= self.max_bend_rad * self.max_bend_rad {
            return Some((b, ChainStatus::Good));
        }
        Some(self.held(bend_rad, Vector2::new(b[0].value, b[1].value)))
    }

    /// The largest bend in the direction that was asked for.
    #[cold]
    fn held(&self, bend_rad: Vector2<f64>, b: Vector2<f64>) -> ([Dual<2>; 2], ChainStatus) {
        // A shape that has left the range of its equations says less than the setpoint does.
        let asked = if b.x.is_finite() && b.y.is_finite() { b } else { bend_rad };
        let norm = asked.x.hypot(asked.y).min(f64::MAX);
        let held = asked / norm;
        let held = held * (self.max_bend_rad / held.norm());
        let strain = outer_strain(&self.core.model.constants, norm);
        let status = ChainStatus::BeyondStrain { strain, limit: self.strain_limit };
        ([Dual::seed(held.x, 0), Dual::seed(held.y, 1)], status)
    }

    #[inline(always)]
    fn command(&self, b: [Dual<2>; 2], lines: &Lines<Dual<2>>, told: &[Dual<2>; 3], status: ChainStatus) -> Command {
        let j_q = &self.core.model.j;
        let alpha = Matrix3x2::from_fn(|i, k| told[i].tangent[k] - j_q[i][k]);
        let q_m = Vector3::from_fn(|i, _| b[0].value * j_q[i][0] + b[1].value * j_q[i][1]);
        let q_tilde_m = Vector3::from_fn(|i, _| told[i].value);
        let gain = Matrix2::identity() + self.j * alpha;
        let j_tilde = gain.try_inverse().map_or_else(Matrix2x3::zeros, |inverse| inverse * self.j);
        Command {
            q_m,
            eps_m: q_tilde_m - q_m,
            q_tilde_m,
            tau_n: Vector3::from_fn(|i, _| lines.tau[i].value),
            tau_tilde_n: Vector3::from_fn(|i, _| {
                let (low, high) = (lines.load[i].low.value, lines.load[i].high.value);
                0.5 * ((high + low) + self.core.friction.signs[i] * (high - low))
            }),
            alpha_m_per_rad: alpha,
            j_tilde_rad_per_m: j_tilde,
            signs: Vector3::from(self.core.friction.signs),
            status,
        }
    }
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
        self.before = Track::of(&self.model.lines(&mut self.memory, b, self.model.preload, &now));
        (self.friction.signs, self.play.signs) = (signs.into(), signs.into());
    }

    /// The lines at a shape and what the actuators shall be told, m.
    #[inline(always)]
    pub(super) fn step<S: Scalar<P>>(&mut self, b: [S; 2], now: &Now) -> (Lines<S>, [S; 3]) {
        let lines = self.model.lines(&mut self.memory, b, self.model.preload, now);
        self.turn(Track::of(&lines));
        let preload_m = self.model.preload_m();
        let told = three(|i| {
            let sign = self.friction.signs[i];
            let (pushed, drawn) = (P::constant(0.5 * (1.0 + sign)), P::constant(0.5 * (1.0 - sign)));
            let position = lines.position[i].high * pushed + lines.position[i].low * drawn;
            position + self.model.half_width * P::constant(self.play.signs[i]) - preload_m
        });
        (lines, self.model.reading(&mut self.memory, told, now))
    }

    /// Advances the signs: friction's first, and then the play's in the direction in which the line's end really moves. Its passage
    /// from one limit of friction to the other is fast and crosses no gap: only what the limits travel counts.
    #[inline(always)]
    fn turn(&mut self, now: Track) {
        let before = core::mem::replace(&mut self.before, now);
        let signs_before = self.friction.signs;
        self.friction.advance(three(|i| now.seat_m[i] - before.seat_m[i]));
        self.play.advance(three(|i| {
            let s = self.friction.signs[i];
            let limits = now.at(i, s) - before.at(i, s);
            limits.abs().copysign(now.at(i, s) - before.at(i, signs_before[i]))
        }));
    }
}

/// Where the lines are.
#[derive(Clone, Copy, Debug)]
struct Track {
    seat_m: [f64; 3],
    low_m: [f64; 3],
    high_m: [f64; 3],
}

impl Track {
    fn of<S: Real>(lines: &Lines<S>) -> Self {
        Self {
            seat_m: three(|i| lines.seat[i].value()),
            low_m: three(|i| lines.position[i].low.value()),
            high_m: three(|i| lines.position[i].high.value()),
        }
    }

    /// The line's end at a sign of friction, m.
    #[inline(always)]
    fn at(&self, i: usize, sign: f64) -> f64 {
        0.5 * ((self.high_m[i] + self.low_m[i]) + sign * (self.high_m[i] - self.low_m[i]))
    }
}

impl InverseCore<f64> {
    fn new(model: &ChainModel<f64>, transition_m: f64) -> Self {
        let now = Clock::default().now(&Circumstances::at(0.0));
        let b = [Dual::<2>::seed(0.0, 0), Dual::seed(0.0, 1)];
        let memory = Memory::straight();
        let lines = model.lines(&mut { memory }, b, Dual::constant(model.preload), &now);
        let row_norms = model.j.map(|row| row[0].hypot(row[1]));
        let friction = Direction::new(lines.seat, row_norms, transition_m);
        let middle = lines.position.map(|p| (p.low + p.high) * 0.5);
        let play = Direction::new(middle, row_norms, transition_m);
        Self { model: model.clone(), memory, friction, play, before: Track::of(&lines) }
    }
}
