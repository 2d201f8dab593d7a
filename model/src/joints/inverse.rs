//! The inverse of a model of joints: the commands for which the joints, with all their effects, take the wanted positions.
//!
//! Problem: y = G x(u) + c and what comes behind it, where x has memory (play, friction, creep); find u for the next wanted y.
//!
//! Intuition: each joint's x rises with its own command, except where play or a dead zone holds it still. Of the commands that
//! give the wanted position, the one nearest to the command before is taken: a joint stays where it is until it must move,
//! and crosses its play when it turns back. What joints feel of one another, and what comes behind G, is taken from the round
//! before; a few rounds settle it.
//!
//! where: a round solves x_j(u) = [G^-1 (y - c - behind)]_j for each joint in turn, on a copy of the memory.
//!
//! A play cannot be crossed at once, so a command moves at most `reversal_gain` times as far as the fastest joint shall
//! move, or else takes the rest of its way in the time `settle_s` or goes on as fast as it went: nothing jumps, and a hand that trembles is not made much worse.
//!
//! Failure: a transmission that falls somewhere (a periodic error steeper than the gain) has several such commands or none; the
//! nearest place is taken, and the step says how far it is from what was wanted.

use super::{JointChain, JointPredictor, MAX_JOINTS};
use crate::effects::Inverse;
use crate::{ChainError, Circumstances, MAX_LEARNT};
use nalgebra::DMatrix;

/// Rounds over the joints at most.
const MAX_ROUNDS: usize = 6;
/// Trials of a bracket, and of the search in it, at most.
const MAX_TRIALS: usize = 60;
/// So many trials of a bracket suffice where nothing has an edge.
const SOON: usize = 6;
/// A fitted gain within so many standard errors of zero is chance: to divide by it asks for any command at all.
const ERRORS_OF_NO_GAIN: f64 = 5.0;
/// A position nearer than this to the wanted one is reached: part of 1 + its size, in units of u.
const REACHED: f64 = 1e-10;

/// How the inverse turns back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointInverseSettings {
    /// A command moves at most so many times as far as the joint that moves most, 1; at least 1.
    pub reversal_gain: f64,
    /// Time in which the rest of a way is taken, s; above 0.
    pub settle_s: f64,
}

impl Default for JointInverseSettings {
    fn default() -> Self {
        Self { reversal_gain: 20.0, settle_s: 0.05 }
    }
}

/// One step's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCommand {
    /// What the drives shall be told, in units of u; 0 behind the last joint.
    pub u: [f64; MAX_JOINTS],
    /// Where the joints are then by the model, in units of y.
    pub y: [f64; MAX_JOINTS],
    /// The largest way that a command still has to go to give what was wanted, in units of u: a play that is being crossed.
    pub to_go: f64,
    /// Whether a command was found that gives what was wanted, now or when the way is gone.
    pub is_reachable: bool,
    /// Whether the wanted positions were finite; if not, the command before is repeated and nothing is remembered.
    pub is_finite: bool,
}

/// Inverts a model of joints step by step; owns the memory of every effect.
#[derive(Clone, Debug)]
pub struct JointCompensator {
    /// As after the command before.
    memory: JointPredictor,
    trial: JointPredictor,
    /// G^-1, row by row.
    divide: [[f64; MAX_JOINTS]; MAX_JOINTS],
    settings: JointInverseSettings,
    /// How far each command went in the step before, in units of u.
    went: [f64; MAX_JOINTS],
    /// What x was wanted to be in the step before, in units of u.
    x_wanted: [f64; MAX_JOINTS],
    last: JointCommand,
    last_s: Option<f64>,
    /// Values in force of what is learnt; NaN behind the last.
    values: [f64; MAX_LEARNT],
}

impl JointChain {
    /// The inverse: turns wanted positions into commands. Its first step begins at rest at whatever is wanted.
    ///
    /// # Errors
    /// [`ChainError::NoInverse`] for the first effect that no command undoes, [`ChainError::NoGain`] for a gain that was
    /// fitted and may be zero, [`ChainError::Gain`] for a matrix G that has no inverse, [`ChainError::OutOfBounds`] for settings out of range.
    pub fn compensator(&self, settings: JointInverseSettings) -> Result<JointCompensator, ChainError> {
        for definition in self.definitions() {
            if let Inverse::None(reason) = definition.inverse {
                return Err(ChainError::NoInverse { name: definition.name, reason });
            }
        }
        if let Some((joint, gain, se)) = self.gain_of_chance(ERRORS_OF_NO_GAIN) {
            return Err(ChainError::NoGain { joint: joint + 1, gain, se });
        }
        let out_of_bounds = |key, found, low, high, unit| ChainError::OutOfBounds {
            effect: "the inverse of joints",
            key,
            found,
            low,
            high,
            unit,
        };
        let JointInverseSettings { reversal_gain, settle_s } = settings;
        if !(1.0..=1e6).contains(&reversal_gain) {
            return Err(out_of_bounds("reversal_gain", reversal_gain, 1.0, 1e6, "1"));
        }
        if !(1e-6..=60.0).contains(&settle_s) {
            return Err(out_of_bounds("settle_s", settle_s, 1e-6, 60.0, "s"));
        }
        Ok(JointCompensator {
            memory: self.predictor(),
            trial: self.predictor(),
            divide: self.inverse_gain()?,
            settings,
            went: [0.0; MAX_JOINTS],
            x_wanted: [0.0; MAX_JOINTS],
            last: JointCommand {
                u: [0.0; MAX_JOINTS],
                y: [0.0; MAX_JOINTS],
                to_go: 0.0,
                is_reachable: true,
                is_finite: true,
            },
            last_s: None,
            values: core::array::from_fn(|lane| self.learnt().get(lane).map_or(f64::NAN, |own| own.start)),
        })
    }

    fn inverse_gain(&self) -> Result<[[f64; MAX_JOINTS]; MAX_JOINTS], ChainError> {
        let n = self.n();
        let g = DMatrix::from_fn(n, n, |i, k| self.gain(i, k));
        let inverse = g.clone().try_inverse().filter(|inverse| {
            // A matrix that is nearly singular would ask for commands that are all rounding.
            inverse.iter().all(|d| d.is_finite()) && g.norm() * inverse.norm() < 1e6
        });
        let inverse = inverse.ok_or(ChainError::Gain)?;
        let mut divide = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        for (i, row) in divide.iter_mut().enumerate().take(n) {
            row.iter_mut().enumerate().take(n).for_each(|(k, d)| *d = inverse[(i, k)]);
        }
        Ok(divide)
    }
}

impl JointCompensator {
    /// The commands that joints without any effect would need, G^-1 (y - c), in units of u; 0 behind the last joint.
    pub fn without_effects(&self, wanted: &[f64]) -> [f64; MAX_JOINTS] {
        let mut left = [0.0; MAX_JOINTS];
        for (i, (left, wanted)) in left.iter_mut().zip(wanted).enumerate().take(self.memory.n()) {
            *left = wanted - self.memory.offset(i);
        }
        self.divided(&left)
    }

    /// Rates of those commands for rates of the positions, in units of u and y per second.
    pub fn rates_without_effects(&self, rates: &[f64]) -> [f64; MAX_JOINTS] {
        let mut all = [0.0; MAX_JOINTS];
        all.iter_mut().zip(rates).for_each(|(own, rate)| *own = *rate);
        self.divided(&all)
    }

    /// How often a formula was not finite in a step since the start, and counted as zero.
    pub fn n_formula_faults(&self) -> u64 {
        self.memory.n_formula_faults()
    }

    /// What the transmission shall make of the last commands, in units of u; 0 behind the last joint.
    pub(super) fn x_wanted(&self) -> [f64; MAX_JOINTS] {
        self.x_wanted
    }

    /// The values in force of the parameters that are learnt, in their order; NaN behind the last.
    pub fn learnt(&self) -> &[f64; MAX_LEARNT] {
        &self.values
    }

    /// Sets the parameters that are learnt; a value that is not finite stays as it is, and what the effects remember too.
    ///
    /// # Real-time
    /// No allocation.
    pub fn set_learnt(&mut self, values: &[f64; MAX_LEARNT]) {
        let n_learnt = self.memory.learnt().len();
        for (lane, value) in values.iter().copied().enumerate().take(n_learnt) {
            if value.is_finite() && value != self.values[lane] {
                self.values[lane] = value;
                let own = &self.memory.learnt()[lane];
                let (effect, parameter) = (own.effect, own.parameter);
                self.memory.set(effect, parameter, value);
                self.trial.set(effect, parameter, value);
            }
        }
    }

    /// Takes over what another compensator of the same chain remembers, and its learnt values. Allocates nothing.
    pub fn remember_as(&mut self, other: &Self) {
        self.set_learnt(&other.values);
        self.memory.remember_as(&other.memory);
        (self.went, self.x_wanted, self.last, self.last_s) = (other.went, other.x_wanted, other.last, other.last_s);
    }

    fn divided(&self, y: &[f64; MAX_JOINTS]) -> [f64; MAX_JOINTS] {
        let mut x = [0.0; MAX_JOINTS];
        for (x, row) in x.iter_mut().zip(&self.divide) {
            *x = row.iter().zip(y).map(|(d, y)| d * y).sum();
        }
        x
    }

    /// What the drives shall be told for the next wanted positions, in the machine's units of y.
    ///
    /// # Real-time
    /// No allocation, no lock; at most 6 rounds of 120 trials for each joint, mostly two rounds of four.
    pub fn step(&mut self, wanted: &[f64], at: &Circumstances) -> JointCommand {
        let n = self.memory.n();
        if wanted.len() != n || !wanted.iter().all(|y| y.is_finite()) {
            self.last.is_finite = false;
            return self.last;
        }
        let dt_s = self.last_s.map(|last_s| (at.time_s - last_s).max(0.0));
        self.last_s = Some(at.time_s);
        let before = self.last.u;
        let (mut u, mut x_wanted, mut is_reachable) = (before, self.x_wanted, true);
        for _ in 0..MAX_ROUNDS {
            let mut change = 0.0_f64;
            is_reachable = true;
            x_wanted = self.find_x_wanted(wanted, &u, at);
            for joint in 0..n {
                let found = self.solve(joint, &u, before[joint], x_wanted[joint], at);
                is_reachable &= found.is_reached;
                change = change.max((found.u - u[joint]).abs() / (1.0 + found.u.abs()));
                u[joint] = found.u;
            }
            if change <= REACHED {
                break;
            }
        }
        let mut to_go = 0.0_f64;
        if let Some(dt_s) = dt_s {
            let settled = 1.0 - (-dt_s / self.settings.settle_s).exp();
            let faster = (dt_s / self.settings.settle_s).min(1.0).exp();
            // Of the joint that moves most: one that rests may have to give way to what it feels of another.
            let moves =
                x_wanted.iter().zip(&self.x_wanted).fold(0.0_f64, |most, (x, before)| most.max((x - before).abs()));
            let with_joints = self.settings.reversal_gain * moves;
            for joint in 0..n {
                let way = u[joint] - before[joint];
                let allowed = with_joints.max(settled * way.abs()).max(faster * self.went[joint].abs());
                u[joint] = before[joint] + way.clamp(-allowed, allowed);
                to_go = to_go.max(way.abs() - allowed);
            }
        }
        self.went = core::array::from_fn(|joint| u[joint] - before[joint]);
        self.x_wanted = x_wanted;
        let mut y = [0.0; MAX_JOINTS];
        y.iter_mut().zip(self.memory.step(&u[..n], at)).for_each(|(own, y)| *own = *y);
        self.last = JointCommand { u, y, to_go, is_reachable, is_finite: true };
        self.last
    }

    /// What x must be for the wanted positions, if what comes behind G is as it is for these commands.
    fn find_x_wanted(&mut self, wanted: &[f64], u: &[f64; MAX_JOINTS], at: &Circumstances) -> [f64; MAX_JOINTS] {
        self.try_out(u, at);
        let mut before_c = [0.0; MAX_JOINTS];
        for (i, (left, wanted)) in before_c.iter_mut().zip(wanted).enumerate() {
            *left = wanted - self.trial.beside(i);
        }
        self.divided(&before_c)
    }

    fn try_out(&mut self, u: &[f64; MAX_JOINTS], at: &Circumstances) {
        self.trial.remember_as(&self.memory);
        self.trial.step(&u[..self.memory.n()], at);
    }

    /// The command nearest to `start` at which a joint's x is what it shall be, the others' commands being as they are.
    fn solve(&mut self, joint: usize, u: &[f64; MAX_JOINTS], start: f64, x_wanted: f64, at: &Circumstances) -> Found {
        let mut trial = *u;
        let mut miss = |command: f64| {
            trial[joint] = command;
            self.try_out(&trial, at);
            self.trial.x(joint) - x_wanted
        };
        let near = REACHED * (1.0 + x_wanted.abs());
        let (mut a, mut f_a) = (start, miss(start));
        if f_a.abs() <= near {
            return Found { u: a, is_reached: true };
        }
        // Outwards from the command before, in the direction in which x has to go, until it has gone too far.
        let direction = -f_a.signum();
        let (mut b, mut f_b, mut stride) = (a, f_a, f_a.abs());
        let (mut best, mut f_best) = (a, f_a.abs());
        for _ in 0..MAX_TRIALS {
            b = a + direction * stride;
            f_b = miss(b);
            if f_b.abs() < f_best {
                (best, f_best) = (b, f_b.abs());
            }
            if f_b.signum() != f_a.signum() || f_b.abs() <= near {
                break;
            }
            (a, f_a) = (b, f_b);
            stride *= 2.0;
        }
        if f_b.signum() == f_a.signum() && f_b.abs() > near {
            return Found { u: best, is_reached: false };
        }
        // Illinois' false position: a secant that cannot get stuck at one end; halved in turn where that does not help, as just behind
        // the edge of a play, before which nothing changes.
        for k in 0..MAX_TRIALS {
            if f_b.abs() <= near {
                return Found { u: b, is_reached: true };
            }
            let secant = b - f_b * (b - a) / (f_b - f_a);
            let is_slow = k >= SOON && k % 2 == 1;
            let c = if is_slow || !secant.is_finite() { 0.5 * (a + b) } else { secant };
            let f_c = miss(c);
            if f_c.signum() == f_b.signum() {
                f_a *= 0.5;
            } else {
                (a, f_a) = (b, f_b);
            }
            (b, f_b) = (c, f_c);
            if (b - a).abs() <= f64::EPSILON * (1.0 + b.abs()) {
                break;
            }
        }
        Found { u: b, is_reached: f_b.abs() <= 1e3 * near }
    }
}

/// What a search for one joint's command gave.
struct Found {
    u: f64,
    is_reached: bool,
}
