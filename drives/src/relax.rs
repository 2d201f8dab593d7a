//! Relaxing: where one antagonist has let go of its line, the others give way to their own loads, so far and so long and no further.
//!
//! Problem: lines that hold each other bend the snake to where one that is limp leaves it, and stay loaded against its structure.
//! Intuition: each of the others goes the way that its own line pulls it, slowly, until its load is small; that takes stretch out of
//! lines and puts none in. It is the only motion without a command, so way, time and speed are bounded and the step is the gate's.
//! Failure: whatever is not known (an answer, a load) keeps all where they are; what has ended does not begin again.

use crate::bus::Seen;
use krait_ipc::message::{Actuators, MAX_ACTUATORS};
use krait_slave::{DriveError, Findings, Gate, GateLimits, SlaveConfig};

/// Largest speed, m/s.
const RATE_M_PER_S: f64 = 2e-3;
/// Most time that the gate credits a write, ns.
const STEP_NS: i64 = 1_000_000;

/// How far the others may give way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RelaxLimits {
    /// A smaller load is let be, N.
    load_n: f64,
    /// Largest way of each actuator, m.
    way_m: f64,
    /// Nothing moves any more so long after the failure, ns.
    time_ns: i64,
    gate: GateLimits,
}

impl RelaxLimits {
    pub(crate) fn new(config: &SlaveConfig) -> Self {
        Self {
            load_n: config.drive.relax_n,
            way_m: config.drive.relax_m,
            time_ns: (config.drive.relax_ms * 1e6) as i64,
            gate: GateLimits {
                rate_m_per_s: RATE_M_PER_S.min(config.limits.rate_m_per_s),
                acceleration_m_per_s2: config.deceleration_m_per_s2,
                jerk_m_per_s3: config.limits.jerk_m_per_s3,
                deceleration_m_per_s2: config.deceleration_m_per_s2,
            },
        }
    }
}

/// The actuator that may have let go of its line, from 0. One that is silent or whose encoder leapt says nothing of the kind.
pub(crate) fn suspect(failure: &DriveError) -> Option<usize> {
    match failure {
        DriveError::Limp { actuator }
        | DriveError::Reset { actuator }
        | DriveError::Tripped { actuator, .. }
        | DriveError::HardwareStop { actuator, .. } => Some(actuator - 1),
        _ => None,
    }
}

/// The others while one is limp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relaxing {
    limits: RelaxLimits,
    limp: usize,
    until_ns: i64,
    /// Where they stood, and the way that each may go: 1, -1 or 0; known once it has begun.
    begun: Option<(Actuators, Actuators)>,
    gate: Gate,
}

impl Relaxing {
    pub(crate) fn new(limits: RelaxLimits, limp: usize, now_ns: i64) -> Self {
        let until_ns = now_ns.saturating_add(limits.time_ns);
        Self { limits, limp, until_ns, begun: None, gate: Gate::new(limits.gate) }
    }

    pub(crate) fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// Where the others go in this period, m, from where all stand; none: it has ended for good.
    pub(crate) fn step(
        &mut self,
        goal_m: Actuators,
        tau_n: Actuators,
        seen: &Seen,
        (n, now_ns, period_ns): (usize, i64, i64),
    ) -> Option<Actuators> {
        if now_ns >= self.until_ns {
            return None;
        }
        let has_all = seen.has_answered.iter().take(n).all(|answered| *answered);
        if !has_all || !seen.has_let_go[self.limp] {
            // It says that it holds again: that is the end. Silence or a word that is still to come is waited for.
            let holds = seen.has_answered[self.limp] && self.has_begun() && !seen.has_let_go[self.limp];
            return (!holds).then_some(goal_m);
        }
        let limp = self.limp;
        // A line that pulls its actuator has a negative load, and gives way where it is pushed.
        let pull = |k: usize| {
            let is_loaded = k < n && k != limp && tau_n[k].abs() > self.limits.load_n;
            if is_loaded { -tau_n[k].signum() } else { 0.0 }
        };
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
