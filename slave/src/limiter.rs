//! The slave's own limits, independent of every process before it: what is wrong is refused, what is too much is shortened.
//!
//! Refused: not finite, unknown phase or reasons, out of order, too old or from the future, a jump away from the setpoint.
//! Shortened, all three actuators by one common factor so that the direction stays: stroke, rate, load.

use crate::Findings;
use krait_ipc::message::{Command, Phase};
use krait_ipc::{Reason, Reasons};
use serde::{Deserialize, Serialize};

/// Largest clock difference between two processes of one machine: none in truth, so this only bounds rounding, ns.
const FUTURE_NS: i64 = 1_000_000;
/// Longest time between two commands that is credited to the second one's motion: a gap earns no right to a leap, ns.
const MAX_CREDIT_NS: i64 = 10_000_000;
/// The time credited to the first command after a hold: one period of 1 kHz, ns.
const FIRST_CREDIT_NS: i64 = 1_000_000;

/// The limits of the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Stroke of each actuator from zero, m; 1e-4 to 0.02. Default 5.5 mm: the default snake needs 5.0 mm to reach the
    /// paper's 80 deg (2.3 mm of joint travel, the rest is stretch, friction and play).
    pub stroke_m: f64,
    /// Speed of each actuator, m/s; 1e-4 to 0.5. Default 30 mm/s: about 8 rad/s of bend with the stretch taken off, above
    /// any hand's wish and below what shakes the lines.
    pub rate_m_per_s: f64,
    /// Measured load of each line at its actuator beyond which it is not increased further, N; 1 to 500. Default 60 N: the
    /// default snake needs 48 N at the paper's 80 deg, and 60 N are 412 MPa in a tube, where NiTi begins to soften.
    pub load_n: f64,
    /// Largest distance of a command from the setpoint while following, m; 1e-5 to 5e-3. Default 0.5 mm: 17 periods at the
    /// largest speed, so that a late burst passes and a leap does not.
    pub step_m: f64,
    /// Largest distance of the first command after a hold, m; 1e-6 to `step_m`. Default 0.1 mm: it shall equal the setpoint,
    /// and this is less than the play of the lines.
    pub engage_m: f64,
    /// Oldest operator input that a command may rest on, ms; 1 to 1000. Default 50 ms, as the watchdog.
    pub command_age_ms: f64,
    /// Distance of the encoders from the setpoint that is a fault, m; 1e-5 to 5e-3. Default 0.3 mm: ten periods at the
    /// largest speed.
    pub following_error_m: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            stroke_m: 5.5e-3,
            rate_m_per_s: 30e-3,
            load_n: 60.0,
            step_m: 0.5e-3,
            engage_m: 0.1e-3,
            command_age_ms: 50.0,
            following_error_m: 0.3e-3,
        }
    }
}

/// What the limiter needs to know of the slave.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    /// Now, CLOCK_MONOTONIC, nanoseconds.
    pub now_ns: i64,
    /// Where the drives were last told to be, m.
    pub setpoint_q_m: [f64; 3],
    /// Measured line loads, N, push positive; NaN where not measured.
    pub tau_n: [f64; 3],
    /// Whether commands may be executed at all.
    pub ready: bool,
    /// Whether the command before was executed; otherwise this one must begin at the setpoint.
    pub following: bool,
}

/// What becomes of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is wrong and changes nothing.
    Refuse,
    /// It is right and asks to stand still, or the slave is not ready to move.
    Hold,
    /// It is executed, perhaps in part.
    Move {
        /// Where to go, m.
        q_m: [f64; 3],
        /// The part of the way that the limits allow, 0 to 1.
        scale: f64,
        /// The time credited to this motion, s; > 0.
        credit_s: f64,
    },
}

/// Judges commands one after the other.
#[derive(Clone, Debug)]
pub struct Limiter {
    limits: Limits,
    last_sequence: u64,
    last_sample_ns: i64,
}

impl Limiter {
    /// A limiter that has seen no command yet.
    pub fn new(limits: Limits) -> Self {
        Self { limits, last_sequence: 0, last_sample_ns: i64::MIN }
    }

    /// The limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Judges the next command; says into `findings` why it is refused or shortened.
    ///
    /// # Real-time
    /// No allocation, no loop longer than three actuators.
    pub fn judge(&mut self, command: &Command, situation: &Situation, findings: &mut Findings) -> Verdict {
        if !self.is_sound(command, situation.now_ns, findings) {
            return Verdict::Refuse;
        }
        let since_ns = command.sample_ns.saturating_sub(self.last_sample_ns);
        (self.last_sequence, self.last_sample_ns) = (command.sequence, command.sample_ns);
        if !situation.ready || command.phase != Phase::Following as u32 {
            return Verdict::Hold;
        }
        let change_m: [f64; 3] = core::array::from_fn(|i| command.q_tilde_m[i] - situation.setpoint_q_m[i]);
        let nearness_m = if situation.following { self.limits.step_m } else { self.limits.engage_m };
        let farthest_m = largest(change_m);
        if farthest_m > nearness_m {
            findings.note(Reason::StepLimit, farthest_m, nearness_m);
            return Verdict::Refuse;
        }
        let credit_ns = if situation.following { since_ns.clamp(1, MAX_CREDIT_NS) } else { FIRST_CREDIT_NS };
        let credit_s = credit_ns as f64 * 1e-9;
        let scale = self
            .rate_scale(farthest_m, credit_s, findings)
            .min(self.stroke_scale(&situation.setpoint_q_m, &change_m, findings))
            .min(self.load_scale(&situation.tau_n, &change_m, findings));
        // A whole step lands on the command itself, not beside it by a rounding error.
        let q_m = if scale < 1.0 {
            core::array::from_fn(|i| situation.setpoint_q_m[i] + scale * change_m[i])
        } else {
            command.q_tilde_m
        };
        Verdict::Move { q_m, scale, credit_s }
    }

    /// Whether a command may be believed at all.
    fn is_sound(&self, command: &Command, now_ns: i64, findings: &mut Findings) -> bool {
        let numbers = command.q_tilde_m.into_iter().chain(command.bend_rad);
        if numbers.into_iter().any(|x| !x.is_finite()) {
            findings.insert(Reason::NotFinite);
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
        findings.reasons().is_empty()
    }

    fn rate_scale(&self, farthest_m: f64, credit_s: f64, findings: &mut Findings) -> f64 {
        let allowed_m = self.limits.rate_m_per_s * credit_s;
        if farthest_m <= allowed_m {
            return 1.0;
        }
        findings.note(Reason::ActuatorRateLimit, farthest_m / credit_s, self.limits.rate_m_per_s);
        allowed_m / farthest_m
    }

    fn stroke_scale(&self, from_m: &[f64; 3], change_m: &[f64; 3], findings: &mut Findings) -> f64 {
        let limit_m = self.limits.stroke_m;
        let mut scale: f64 = 1.0;
        for (from, change) in from_m.iter().zip(change_m) {
            let target = from + change;
            // Only outward motion is limited: the way back in is always free.
            if target.abs() > limit_m && target.abs() > from.abs() {
                findings.note(Reason::StrokeLimit, target.abs(), limit_m);
                let room = limit_m.copysign(target) - from;
                scale = scale.min((room / change).clamp(0.0, 1.0));
            }
        }
        scale
    }

    fn load_scale(&self, tau_n: &[f64; 3], change_m: &[f64; 3], findings: &mut Findings) -> f64 {
        let mut scale = 1.0;
        for (tau, change) in tau_n.iter().zip(change_m) {
            if tau.abs() > self.limits.load_n && tau * change > 0.0 {
                findings.note(Reason::ForceLimit, tau.abs(), self.limits.load_n);
                scale = 0.0;
            }
        }
        scale
    }
}

/// Largest magnitude.
pub(crate) fn largest(v: [f64; 3]) -> f64 {
    v.into_iter().fold(0.0, |m, x| m.max(x.abs()))
}
