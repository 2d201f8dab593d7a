//! The slave's own limits, independent of every process before it: what is wrong is refused, what is too far is shortened.
//!
//! Refused: not finite, for another number of actuators, unknown phase or reasons, out of order, too old or from the future, a jump away from the setpoint, a
//! load that is limited and not measured. Held: late. Shortened, all actuators by one common factor so that the
//! direction stays, but for one that stands alone: stroke, load. Rate, acceleration and jerk are the gate's.

use crate::Findings;
use crate::gates::Parts;
use krait_ipc::message::{Actuators, Command, JAW, MAX_ACTUATORS, MAX_JOINTS, Phase, largest, n_actuators};
use krait_ipc::setting::{SettingError, check};
use krait_ipc::{Reason, Reasons, settings};

/// Largest clock difference between two processes of one machine: none in truth, so this only bounds rounding, ns.
const FUTURE_NS: i64 = 1_000_000;

settings! {
    /// The limits of the machine.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Limits in "slave.limits" {
        /// Stroke of each actuator from zero, m. 5.5 mm: the default snake needs 5.0 mm to reach the paper's 80 deg (2.3 mm of
        /// joint travel, the rest is stretch, friction and play).
        stroke_m: f64 = 5.5e-3, 1e-4..=0.02;
        /// Speed of each actuator, m/s. 30 mm/s: about 8 rad/s of bend with the stretch taken off, above any hand's wish and
        /// below what shakes the lines.
        rate_m_per_s: f64 = 30e-3, 1e-4..=0.5;
        /// Acceleration of each actuator, m/s2; at least the deceleration of a stop. 20 m/s2: the largest speed after 1.5 ms.
        /// Smaller values soften how the play of the lines is crossed.
        acceleration_m_per_s2: f64 = 20.0, 0.05..=1000.0;
        /// Jerk of each actuator, m/s3. 4e4 m/s3: the largest acceleration turns round within a period.
        jerk_m_per_s3: f64 = 4e4, 100.0..=1e7;
        /// Measured pull of each line at its actuator beyond which it is not increased further, N; 1 to 500, or inf where loads
        /// are not measured. 60 N: the default snake needs 48 N at the paper's 80 deg, and 60 N are 412 MPa in a tube (a strain
        /// of 0.8 %), where NiTi begins to soften.
        pull_n: f64 = 60.0;
        /// The same for push, which ends in buckling where a line is not guided.
        push_n: f64 = 60.0;
        /// Measured load of a gripper's wire, pull or push, beyond which it is not increased further, N; 0.1 to 500, or inf. It bounds
        /// what the jaw holds with: 15 N of the wire at a jaw of 2 mm/rad are 0.03 Nm.
        jaw_n: f64 = 15.0;
        /// Largest strain of a line under pull: load over E A of the model's lines. `krait run` refuses a `pull_n` beyond it.
        /// 0.01: where the plateau of superelastic NiTi begins.
        strain: f64 = 0.01, 1e-4..=0.1;
        /// Largest distance of a command from the setpoint while following, m. 0.5 mm: 17 periods at the largest speed, so that
        /// a late burst passes and a leap does not.
        step_m: f64 = 0.5e-3, 1e-5..=5e-3;
        /// Largest distance of the first command after a hold, m; at most `step_m`. 0.1 mm: it shall equal the setpoint, and
        /// this is less than the play of the lines.
        engage_m: f64 = 0.1e-3, 1e-6..=5e-3;
        /// Oldest operator input that a command may rest on, ms. 50 ms, as the watchdog.
        command_age_ms: f64 = 50.0, 1.0..=1000.0;
        /// Age of the operator input beyond which a command is not executed and the slave holds until commands are in time
        /// again, ms; at most `command_age_ms`. 10 ms: what a stage sends at once after a hiccup is the past.
        late_ms: f64 = 10.0, 1.0..=1000.0;
        /// Distance of the encoders from the setpoint that is a fault, m. 0.3 mm: ten periods at the largest speed.
        following_error_m: f64 = 0.3e-3, 1e-5..=5e-3;
    }
}

impl Limits {
    /// Checks every range, and those that another value bounds.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()?;
        // `inf` says that loads are not measured, and passes.
        for (key, load_n) in [("pull_n", self.pull_n), ("push_n", self.push_n)] {
            if load_n != f64::INFINITY {
                check((Self::TABLE, key), load_n, (1.0, 500.0), 60)?;
            }
        }
        if self.jaw_n != f64::INFINITY {
            check((Self::TABLE, "jaw_n"), self.jaw_n, (0.1, 500.0), 15)?;
        }
        check((Self::TABLE, "engage_m"), self.engage_m, (1e-6, self.step_m), 0.1e-3)?;
        check((Self::TABLE, "late_ms"), self.late_ms, (1.0, self.command_age_ms), 10)
    }
}

/// What the limiter needs to know of the slave.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    /// Now, CLOCK_MONOTONIC, nanoseconds.
    pub now_ns: i64,
    /// Where the drives were last told to be, m.
    pub setpoint_q_m: Actuators,
    /// Measured loads, N, push positive; NaN where not measured.
    pub tau_n: Actuators,
    /// Whether commands may be executed at all: enabled, homed, not busy, engaged.
    pub ready: bool,
    /// Whether the command before was executed; otherwise this one must begin at the setpoint.
    pub following: bool,
}

/// What becomes of a command that was admitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimiterVerdict {
    /// It would be a jump, or a load is not known; it changes nothing.
    Refuse,
    /// It asks to stand still, is late, or the slave is not ready to move.
    Hold,
    /// It is executed.
    Move,
}

/// Judges commands one after the other.
#[derive(Clone, Debug)]
pub struct Limiter {
    limits: Limits,
    n_actuators: usize,
    /// The actuators before this one hold each other; one behind them stands alone.
    n_together: usize,
    /// Of each actuator the number of its group of antagonists.
    groups: [u32; MAX_ACTUATORS],
    /// Load of each actuator by a limit of its own, N.
    own_loads_n: Actuators,
    last_sequence: u64,
    last_sample_ns: i64,
}

impl Limiter {
    /// A limiter before so many actuators, of which the first ones hold each other, that has seen no command yet.
    pub fn new(limits: Limits, n_actuators: usize, n_together: usize) -> Self {
        let (groups, own_loads_n) = ([0; MAX_ACTUATORS], [f64::INFINITY; MAX_ACTUATORS]);
        Self { limits, n_actuators, n_together, groups, own_loads_n, last_sequence: 0, last_sample_ns: i64::MIN }
    }

    /// The same where only actuators of one number hold each other.
    pub(crate) fn with_groups(self, groups: [u32; MAX_ACTUATORS]) -> Self {
        Self { groups, ..self }
    }

    /// The same where the load of an actuator has a limit of its own besides, N; infinite: none.
    pub(crate) fn with_own_loads(self, own_loads_n: Actuators) -> Self {
        Self { own_loads_n, ..self }
    }

    /// The limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Another process writes the commands from now on, with numbers of its own. Time still goes on only.
    pub fn new_writer(&mut self) {
        self.last_sequence = 0;
    }

    /// Whether a command may be believed at all; says into `findings` why not.
    ///
    /// # Real-time
    /// No allocation, no loop longer than the actuators.
    pub fn admits(&mut self, command: &Command, now_ns: i64, findings: &mut Findings) -> bool {
        let numbers = command.q_tilde_m.iter().chain(wanted(command));
        // A forecast may be missing; NaN says so.
        let forecast = command.q_tilde_vel_m_per_s.into_iter().any(f64::is_infinite);
        if numbers.copied().any(|x| !x.is_finite()) || forecast {
            findings.insert(Reason::NotFinite);
        }
        if n_actuators(command.n_actuators) != self.n_actuators || command.n_joints as usize > MAX_JOINTS {
            findings.insert(Reason::OutOfRange);
        }
        let known_phase = [Phase::Holding, Phase::Following].into_iter().any(|p| p as u32 == command.phase);
        if !known_phase || Reasons::from_bits(command.reasons).bits() != command.reasons {
            findings.insert(Reason::OutOfRange);
        }
        let age_ms = now_ns.saturating_sub(command.sample_ns) as f64 * 1e-6;
        if age_ms > self.limits.command_age_ms {
            findings.note(Reason::CommandStale, age_ms, self.limits.command_age_ms);
        }
        if command.sample_ns > now_ns.saturating_add(FUTURE_NS) {
            findings.insert(Reason::OutOfRange);
        }
        // 1 is a writer that started anew; even its samples may not go back in time.
        let repeated = command.sequence <= self.last_sequence && command.sequence != 1;
        if repeated || command.sample_ns < self.last_sample_ns {
            findings.note(Reason::OutOfOrder, command.sequence as f64, self.last_sequence as f64);
        }
        if findings.reasons().is_empty() {
            (self.last_sequence, self.last_sample_ns) = (command.sequence, command.sample_ns);
        }
        findings.reasons().is_empty()
    }

    /// Judges an admitted command.
    ///
    /// # Real-time
    /// As [`Limiter::admits`].
    pub fn judge(&self, command: &Command, situation: &Situation, findings: &mut Findings) -> LimiterVerdict {
        let late = !self.is_in_time(command, situation.now_ns, findings);
        if late || !situation.ready || command.phase != Phase::Following as u32 {
            return LimiterVerdict::Hold;
        }
        let nearness_m = if situation.following { self.limits.step_m } else { self.limits.engage_m };
        let near = is_near(command, situation, nearness_m, findings);
        let known = self.knows_loads(&situation.tau_n, findings);
        if near && known { LimiterVerdict::Move } else { LimiterVerdict::Refuse }
    }

    /// Whether an operator may engage at this command; says into `findings` what is missing.
    pub fn may_engage(&self, command: &Command, situation: &Situation, findings: &mut Findings) -> bool {
        let in_time = self.is_in_time(command, situation.now_ns, findings);
        let near = is_near(command, situation, self.limits.engage_m, findings);
        let known = self.knows_loads(&situation.tau_n, findings);
        in_time && near && known
    }

    /// The parts of a way that stroke and loads allow, 0 to 1.
    pub(crate) fn confine(&self, situation: &Situation, to_m: &Actuators, findings: &mut Findings) -> Parts {
        let parts = self.allowed_parts(situation, to_m, findings);
        core::array::from_fn(|side| smallest(&parts, |k| self.side(k) == side))
    }

    /// The same of each actuator: the smallest of its group. A group that a limit stops keeps no other from going on.
    pub(crate) fn confine_groups(&self, situation: &Situation, to_m: &Actuators, findings: &mut Findings) -> Actuators {
        let parts = self.allowed_parts(situation, to_m, findings);
        core::array::from_fn(|k| smallest(&parts, |j| self.side(j) == self.side(k) && self.groups[j] == self.groups[k]))
    }

    /// The part of its own way that stroke and load allow each actuator.
    fn allowed_parts(&self, situation: &Situation, to_m: &Actuators, findings: &mut Findings) -> Actuators {
        let change_m: Actuators = core::array::from_fn(|i| to_m[i] - situation.setpoint_q_m[i]);
        let of_stroke = self.stroke_parts(&situation.setpoint_q_m, &change_m, findings);
        let of_load = self.load_parts(&situation.tau_n, &change_m, findings);
        core::array::from_fn(|k| of_stroke[k].min(of_load[k]))
    }

    fn is_in_time(&self, command: &Command, now_ns: i64, findings: &mut Findings) -> bool {
        let age_ms = now_ns.saturating_sub(command.sample_ns) as f64 * 1e-6;
        if age_ms > self.limits.late_ms {
            findings.note(Reason::CommandLate, age_ms, self.limits.late_ms);
        }
        age_ms <= self.limits.late_ms
    }

    fn knows_loads(&self, tau_n: &Actuators, findings: &mut Findings) -> bool {
        let has_jaw = self.n_together < self.n_actuators;
        let limited = self.limits.pull_n.is_finite()
            || self.limits.push_n.is_finite()
            || (has_jaw && self.limits.jaw_n.is_finite())
            || self.own_loads_n.iter().any(|load_n| load_n.is_finite());
        let n_known = tau_n.iter().take(self.n_actuators).filter(|tau| tau.is_finite()).count();
        let known = !limited || n_known == self.n_actuators;
        if !known {
            findings.note(Reason::LoadUnknown, n_known as f64, self.n_actuators as f64);
        }
        known
    }

    /// 1 for the actuator that stands alone, 0 for those that hold each other.
    fn side(&self, actuator: usize) -> usize {
        usize::from(actuator >= self.n_together)
    }

    fn stroke_parts(&self, from_m: &Actuators, change_m: &Actuators, findings: &mut Findings) -> Actuators {
        let limit_m = self.limits.stroke_m;
        core::array::from_fn(|k| {
            let (from, change) = (from_m[k], change_m[k]);
            let target = from + change;
            // Only outward motion is limited: the way back in is always free.
            let is_beyond = target.abs() > limit_m && target.abs() > from.abs();
            if !is_beyond {
                return 1.0;
            }
            findings.note(Reason::StrokeLimit, target.abs(), limit_m);
            ((limit_m.copysign(target) - from) / change).clamp(0.0, 1.0)
        })
    }

    fn load_parts(&self, tau_n: &Actuators, change_m: &Actuators, findings: &mut Findings) -> Actuators {
        core::array::from_fn(|k| {
            let tau = tau_n[k];
            let limit_n = match (self.side(k), tau > 0.0) {
                (0, true) => self.limits.push_n,
                (0, false) => self.limits.pull_n,
                _ => self.limits.jaw_n,
            };
            let limit_n = limit_n.min(self.own_loads_n[k]);
            let is_too_much = tau.abs() > limit_n && tau * change_m[k] > 0.0;
            if is_too_much {
                findings.note(Reason::ForceLimit, tau.abs(), limit_n);
            }
            f64::from(u8::from(!is_too_much))
        })
    }
}

/// The smallest part of those actuators.
fn smallest(parts: &Actuators, is_one: impl Fn(usize) -> bool) -> f64 {
    parts.iter().enumerate().filter(|(k, _)| is_one(*k)).fold(1.0, |least, (_, part)| least.min(*part))
}

/// What a command is for: a bend, and the jaw of a gripper, or positions of joints.
fn wanted(command: &Command) -> impl Iterator<Item = &f64> {
    let (bend, n_joints): (&[f64], _) = match command.n_joints {
        0 => (&command.bend_rad, JAW + 1),
        n_joints => (&[], (n_joints as usize).min(MAX_JOINTS)),
    };
    bend.iter().chain(&command.joints_rad[..n_joints])
}

fn is_near(command: &Command, situation: &Situation, nearness_m: f64, findings: &mut Findings) -> bool {
    let away_m = largest(core::array::from_fn(|i| command.q_tilde_m[i] - situation.setpoint_q_m[i]));
    if away_m > nearness_m {
        findings.note(Reason::StepLimit, away_m, nearness_m);
    }
    away_m <= nearness_m
}
