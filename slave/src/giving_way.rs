//! Giving way: actuators under power go where their own lines pull them, so far, so fast and so long, and no further.
//!
//! Problem: lines that hold each other stay loaded, and what lets go of loaded lines lets the snake spring.
//! Intuition: each actuator goes the way that its own line pulls it, slowly, until its load is small; that takes stretch out of lines
//! and puts none in. It is a motion without a command, so way, time and speed are bounded and the step is a gate's.
//! Failure: an actuator whose load is not known stays where it is; a load that turns round is left where it is.

use crate::{Findings, Gate, GateLimits, SlaveConfig};
use krait_ipc::message::{Actuators, MAX_ACTUATORS, largest};

/// Largest speed, m/s.
const RATE_M_PER_S: f64 = 2e-3;
/// Most time that the gate credits a write, ns.
const STEP_NS: i64 = 1_000_000;

/// How far actuators may give way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxLimits {
    /// A smaller load is let be, N.
    pub load_n: f64,
    /// Largest way of each actuator, m.
    pub way_m: f64,
    /// Nothing gives way any more after so long, ns.
    pub time_ns: i64,
    gate: GateLimits,
}

impl RelaxLimits {
    /// Where one antagonist has let go, as a checked configuration says.
    pub fn of_fault(config: &SlaveConfig) -> Self {
        Self::new(config, config.drive.relax_m, config.drive.relax_ms)
    }

    /// Where power is asked off, as a checked configuration says.
    pub fn of_disable(config: &SlaveConfig) -> Self {
        Self::new(config, config.drive.disable_relax_m, config.drive.disable_relax_ms)
    }

    fn new(config: &SlaveConfig, way_m: f64, time_ms: f64) -> Self {
        Self {
            load_n: config.drive.relax_n,
            way_m,
            time_ns: (time_ms * 1e6) as i64,
            gate: GateLimits {
                rate_m_per_s: config.rates_m_per_s().map(|rate| RATE_M_PER_S.min(rate)),
                acceleration_m_per_s2: [config.deceleration_m_per_s2; MAX_ACTUATORS],
                jerk_m_per_s3: config.limits.jerk_m_per_s3,
                deceleration_m_per_s2: config.deceleration_m_per_s2,
            },
        }
    }

    /// How long braking from the largest speed takes, ns.
    pub fn braking_ns(&self) -> i64 {
        (largest(self.gate.rate_m_per_s) / self.gate.deceleration_m_per_s2 * 1e9) as i64
    }
}

/// Actuators that give way.
#[derive(Clone, Copy, Debug)]
pub struct GivingWay {
    limits: RelaxLimits,
    until_ns: i64,
    /// Where they stood, and the way that each may go: 1, -1 or 0; known once it has begun.
    begun: Option<(Actuators, Actuators)>,
    gate: Gate,
}

impl GivingWay {
    /// None has begun; the time runs from now on.
    pub fn new(limits: RelaxLimits, now_ns: i64) -> Self {
        let until_ns = now_ns.saturating_add(limits.time_ns);
        Self { limits, until_ns, begun: None, gate: Gate::new(limits.gate) }
    }

    /// Whether the ways are known and the first step was made.
    pub fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// An actuator was not allowed its step and stands here: its giving way goes on from there, so that it never catches up with what
    /// it was not allowed, and keeps no other back by that.
    pub fn go_on_from(&mut self, k: usize, q_m: f64) {
        self.gate.stand_at(k, q_m);
    }

    /// When nothing gives way any more, ns.
    pub fn until_ns(&self) -> i64 {
        self.until_ns
    }

    /// Where the actuators go in a period that ends now, m, from where all stand; `loads_n` is NaN or zero for those that stay. None: the
    /// time is over, or no actuator has anywhere to go.
    ///
    /// # Real-time
    /// No allocation, no blocking, no clock.
    pub fn step(
        &mut self,
        goal_m: Actuators,
        loads_n: Actuators,
        (now_ns, period_ns): (i64, i64),
    ) -> Option<Actuators> {
        if now_ns >= self.until_ns {
            return None;
        }
        // A line that pulls its actuator has a negative load, and gives way where it is pushed.
        let pull = |k: usize| if loads_n[k].abs() > self.limits.load_n { -loads_n[k].signum() } else { 0.0 };
        let first = self.begun.is_none();
        let (from_m, ways) = *self.begun.get_or_insert_with(|| (goal_m, core::array::from_fn(pull)));
        if first {
            self.gate.rest_at(goal_m);
        }
        let target_m: Actuators = core::array::from_fn(|k| {
            let goes = ways[k] != 0.0 && pull(k) == ways[k];
            if goes { from_m[k] + ways[k] * self.limits.way_m } else { goal_m[k] }
        });
        if target_m == goal_m {
            return None;
        }
        for k in 1..=(period_ns / STEP_NS).max(1) {
            let at_ns = now_ns - period_ns + k * STEP_NS.min(period_ns);
            let write = self.gate.toward(target_m, [0.0; MAX_ACTUATORS], at_ns, &mut Findings::default());
            self.gate.commit(&write, at_ns);
        }
        let q_m = self.gate.q_m();
        Some(core::array::from_fn(|k| q_m[k].clamp(from_m[k] - self.limits.way_m, from_m[k] + self.limits.way_m)))
    }
}
