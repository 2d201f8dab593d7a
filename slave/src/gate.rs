//! The one gate to the drives: every write is limited in rate, acceleration and jerk by the time since the write before.
//!
//! Problem: commands may come in bursts, late, or with a leap; what the drives are told must be a motion that they can do.
//!
//! Intuition: the time since the last write is credited, at most one period, so that neither a gap nor a burst earns a
//! leap. A command that the limits allow is written as it came. One that they do not allow is approached: as fast as its
//! forecast, and faster by what is left over a time constant, so that the approach ends without swinging past it.
//!
//! where: the actuators change by one common factor, so that the direction of the change stays: that of the actuator furthest beyond
//! its own limit; velocity is the step over the credited time. Rate wins over acceleration, acceleration over jerk.
//!
//! Failure: drives that were not written for [`REST_NS`] have come to rest by themselves; the motion begins anew.

use crate::{Findings, SlaveConfig};
use krait_ipc::Reason;
use krait_ipc::message::{Actuators, MAX_ACTUATORS, largest};

/// Every actuator at zero, or at rest.
const STILL: Actuators = [0.0; MAX_ACTUATORS];
/// Most time that one write is credited: a period of 1 kHz, ns.
const PERIOD_NS: i64 = 1_000_000;
/// Drives that were not written for so long stand still, ns.
const REST_NS: i64 = 5_000_000;
/// Time constant with which a distance that is left is made up for, s: three periods.
const CATCH_UP_S: f64 = 3e-3;
/// Part of a limit by which a step may pass it: rounding.
const ROUNDING: f64 = 1e-9;
/// A slower motion is rest, m/s.
const REST_M_PER_S: f64 = 1e-9;

/// What the gate lets through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateLimits {
    /// Speed of each actuator, m/s.
    pub rate_m_per_s: Actuators,
    /// Acceleration of each actuator, m/s^2.
    pub acceleration_m_per_s2: Actuators,
    /// Jerk of each actuator, m/s^3.
    pub jerk_m_per_s3: f64,
    /// Deceleration of a motion that nobody commands any more, m/s^2; at most each acceleration.
    pub deceleration_m_per_s2: f64,
}

impl GateLimits {
    /// Those of a checked configuration.
    pub(crate) fn of(config: &SlaveConfig) -> Self {
        Self {
            rate_m_per_s: config.rates_m_per_s(),
            acceleration_m_per_s2: config.accelerations_m_per_s2(),
            jerk_m_per_s3: config.limits.jerk_m_per_s3,
            deceleration_m_per_s2: config.deceleration_m_per_s2,
        }
    }
}

/// The motion of the drives' setpoint.
#[derive(Clone, Copy, Debug)]
pub struct Gate {
    limits: GateLimits,
    q_m: Actuators,
    velocity_m_per_s: Actuators,
    acceleration_m_per_s2: Actuators,
    written_ns: i64,
}

/// A write that the gate allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Write {
    /// Where the drives shall be, m.
    pub q_m: Actuators,
    /// The speed that leads there, m/s.
    velocity_m_per_s: Actuators,
    /// Time that is credited to it, s.
    credit_s: f64,
    /// What the gate takes for the motion before it.
    from: Motion,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Motion {
    velocity_m_per_s: Actuators,
    acceleration_m_per_s2: Actuators,
}

impl Gate {
    /// A gate before drives that stand at zero.
    pub fn new(limits: GateLimits) -> Self {
        Self { limits, q_m: STILL, velocity_m_per_s: STILL, acceleration_m_per_s2: STILL, written_ns: 0 }
    }

    /// Where the drives were last told to be, m.
    pub fn q_m(&self) -> Actuators {
        self.q_m
    }

    /// The fastest that each actuator may go, m/s.
    pub fn rates_m_per_s(&self) -> Actuators {
        self.limits.rate_m_per_s
    }

    /// When the drives were last written, ns; 0: never.
    pub fn written_ns(&self) -> i64 {
        self.written_ns
    }

    /// Whether the drives stand still as far as the gate knows.
    pub fn is_still(&self) -> bool {
        self.velocity_m_per_s == STILL
    }

    /// The drives stand here: where the encoders say, after power came or homing ended.
    pub fn rest_at(&mut self, q_m: Actuators) {
        self.q_m = q_m;
        self.rest();
    }

    /// The drives have stopped at once, because they lost their power.
    pub fn rest(&mut self) {
        (self.velocity_m_per_s, self.acceleration_m_per_s2) = (STILL, STILL);
    }

    /// The write that brings the drives to a target or as near to it as the limits allow. `forecast_m_per_s` is the speed at
    /// which the target moves, zero where that is not known.
    ///
    /// # Real-time
    /// No allocation, no loop longer than the actuators.
    pub fn toward(
        &self,
        target_m: Actuators,
        forecast_m_per_s: Actuators,
        now_ns: i64,
        findings: &mut Findings,
    ) -> Write {
        let (credit_s, from) = (self.credit_s(now_ns), self.motion(now_ns));
        if credit_s <= 0.0 {
            return Write { q_m: self.q_m, velocity_m_per_s: from.velocity_m_per_s, credit_s, from };
        }
        let way_m = minus(target_m, self.q_m);
        let exact_m_per_s = way_m.map(|way| way / credit_s);
        if self.allows(exact_m_per_s, &from, credit_s, findings) {
            return Write { q_m: target_m, velocity_m_per_s: exact_m_per_s, credit_s, from };
        }
        let left_m: Actuators = core::array::from_fn(|i| way_m[i] - forecast_m_per_s[i] * credit_s);
        let braking = self.limits.acceleration_m_per_s2.iter().zip(left_m);
        let braking = braking.map(|(limit, left)| limit.sqrt() / left.abs().sqrt().max(f64::MIN_POSITIVE));
        let per_s = braking.fold(1.0 / CATCH_UP_S, f64::min);
        let wanted = core::array::from_fn(|i| forecast_m_per_s[i] + left_m[i] * per_s);
        self.step(shortened(wanted, &self.limits.rate_m_per_s), from, credit_s)
    }

    /// The write that brakes a motion which nobody commands any more; `None` when there is none.
    ///
    /// # Real-time
    /// As [`Gate::toward`].
    pub fn brake(&mut self, now_ns: i64) -> Option<Write> {
        let (credit_s, from) = (self.credit_s(now_ns), self.motion(now_ns));
        let speed = largest(from.velocity_m_per_s);
        if speed <= REST_M_PER_S {
            self.rest();
            return None;
        }
        if credit_s <= 0.0 {
            return None;
        }
        let part = (1.0 - self.limits.deceleration_m_per_s2 * credit_s / speed).max(0.0);
        Some(self.step(from.velocity_m_per_s.map(|v| v * part), from, credit_s))
    }

    /// A write again, but only a part of its way: what stands in the way is harder than acceleration.
    pub fn part_of(&self, write: &Write, part: f64) -> Write {
        self.parts_of(write, &[part; MAX_ACTUATORS])
    }

    /// The same with a part of its own for each actuator.
    pub fn parts_of(&self, write: &Write, parts: &Actuators) -> Write {
        let q_m = core::array::from_fn(|i| self.q_m[i] + (write.q_m[i] - self.q_m[i]) * parts[i]);
        Write { q_m, velocity_m_per_s: core::array::from_fn(|i| write.velocity_m_per_s[i] * parts[i]), ..*write }
    }

    /// One actuator stands here; the others' motion goes on.
    pub(crate) fn stand_at(&mut self, k: usize, q_m: f64) {
        (self.q_m[k], self.velocity_m_per_s[k], self.acceleration_m_per_s2[k]) = (q_m, 0.0, 0.0);
    }

    /// The drives have been written.
    pub fn commit(&mut self, write: &Write, now_ns: i64) {
        if write.credit_s > 0.0 {
            let velocity = write.velocity_m_per_s;
            let change = minus(velocity, write.from.velocity_m_per_s);
            self.acceleration_m_per_s2 = change.map(|change| change / write.credit_s);
            self.velocity_m_per_s = if largest(velocity) <= REST_M_PER_S { STILL } else { velocity };
        }
        self.q_m = write.q_m;
        self.written_ns = self.written_ns.max(now_ns);
    }

    /// The newest write was over only now; time is credited from here on.
    pub fn written_at(&mut self, now_ns: i64) {
        self.written_ns = self.written_ns.max(now_ns);
    }

    fn credit_s(&self, now_ns: i64) -> f64 {
        now_ns.saturating_sub(self.written_ns).clamp(0, PERIOD_NS) as f64 * 1e-9
    }

    fn motion(&self, now_ns: i64) -> Motion {
        if now_ns.saturating_sub(self.written_ns) > REST_NS {
            return Motion { velocity_m_per_s: STILL, acceleration_m_per_s2: STILL };
        }
        let Self { velocity_m_per_s, acceleration_m_per_s2, .. } = *self;
        Motion { velocity_m_per_s, acceleration_m_per_s2 }
    }

    /// Whether a velocity may be had at once; says into `findings` which limits forbid it.
    fn allows(&self, velocity: Actuators, from: &Motion, credit_s: f64, findings: &mut Findings) -> bool {
        let acceleration = minus(velocity, from.velocity_m_per_s).map(|change| change / credit_s);
        let jerk = minus(acceleration, from.acceleration_m_per_s2).map(|change| change / credit_s);
        let checks = [
            (Reason::ActuatorRateLimit, furthest(&velocity, &self.limits.rate_m_per_s)),
            (Reason::ActuatorAccelerationLimit, furthest(&acceleration, &self.limits.acceleration_m_per_s2)),
            (Reason::ActuatorJerkLimit, (largest(jerk), self.limits.jerk_m_per_s3)),
        ];
        let mut all = true;
        for (reason, (found, limit)) in checks {
            if found > limit * (1.0 + ROUNDING) {
                findings.note(reason, found, limit);
                all = false;
            }
        }
        all
    }

    /// The part of a change of velocity that stays within the rate, 0 to 1.
    fn part_within_rate(&self, velocity: &Actuators, change: &Actuators) -> f64 {
        velocity.iter().zip(change).zip(self.limits.rate_m_per_s).fold(1.0, |part: f64, ((v, dv), rate)| {
            if (v + dv).abs() <= rate { part } else { part.min(((rate.copysign(*dv) - v) / dv).clamp(0.0, 1.0)) }
        })
    }

    /// A step towards a velocity that is within the rate, as far as acceleration and jerk allow.
    fn step(&self, wanted: Actuators, from: Motion, credit_s: f64) -> Write {
        let change = minus(wanted, from.velocity_m_per_s);
        let change = shortened(change, &self.limits.acceleration_m_per_s2.map(|limit| limit * credit_s));
        let jerk = minus(change.map(|change| change / credit_s), from.acceleration_m_per_s2);
        let jerk = shortened(jerk, &[self.limits.jerk_m_per_s3 * credit_s; MAX_ACTUATORS]);
        let change: Actuators = core::array::from_fn(|i| (from.acceleration_m_per_s2[i] + jerk[i]) * credit_s);
        let part = self.part_within_rate(&from.velocity_m_per_s, &change);
        let velocity_m_per_s: Actuators = core::array::from_fn(|i| from.velocity_m_per_s[i] + change[i] * part);
        let q_m = core::array::from_fn(|i| self.q_m[i] + velocity_m_per_s[i] * credit_s);
        Write { q_m, velocity_m_per_s, credit_s, from }
    }
}

/// The value that is furthest beyond its limit, or nearest to it, by its size, and that limit.
pub(crate) fn furthest(v: &Actuators, limits: &Actuators) -> (f64, f64) {
    let of_each = v.iter().map(|x| x.abs()).zip(*limits);
    of_each.fold((0.0, limits[0]), |most, one| if one.0 * most.1 > most.0 * one.1 { one } else { most })
}

/// A vector of which each component is within its limit; its direction stays.
fn shortened(v: Actuators, limits: &Actuators) -> Actuators {
    let (found, limit) = furthest(&v, limits);
    if found <= limit { v } else { v.map(|x| x * (limit / found)) }
}

fn minus(a: Actuators, b: Actuators) -> Actuators {
    core::array::from_fn(|i| a[i] - b[i])
}

#[cfg(test)]
mod tests;
