//! The gate of actuators that move together, and, where one behind them stands alone, a gate of its own: neither slows the other.
//!
//! Actuators that hold each other through one machine (a snake's lines) are shortened by one common factor, so that its direction
//! stays; a gripper's wire has no part in that direction.

use crate::{Findings, Gate, GateLimits, Write};
use krait_ipc::message::{Actuators, MAX_ACTUATORS, largest};

/// Parts of two ways, 0 to 1: of the actuators that move together, and of the one that stands alone.
pub(crate) type Parts = [f64; 2];

/// The gates before all actuators.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gates {
    together: Gate,
    alone: Option<Alone>,
}

/// The last actuator, which stands alone.
#[derive(Clone, Copy, Debug)]
struct Alone {
    place: usize,
    gate: Gate,
}

/// Writes that the gates allow, and where the drives shall be then, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Writes {
    pub q_m: Actuators,
    together: Option<Write>,
    alone: Option<Write>,
}

impl Alone {
    fn only(&self, all: Actuators) -> Actuators {
        core::array::from_fn(|k| if k == self.place { all[k] } else { 0.0 })
    }

    fn without(&self, all: Actuators) -> Actuators {
        core::array::from_fn(|k| if k == self.place { 0.0 } else { all[k] })
    }

    fn joined(&self, together: Actuators, alone: Actuators) -> Actuators {
        core::array::from_fn(|k| if k == self.place { alone[k] } else { together[k] })
    }
}

impl Gates {
    /// Gates before drives that stand at zero; `alone` is the place of the actuator that stands alone.
    pub(crate) fn new(limits: GateLimits, alone: Option<usize>) -> Self {
        let gate = Gate::new(limits);
        Self { together: gate, alone: alone.filter(|place| *place < MAX_ACTUATORS).map(|place| Alone { place, gate }) }
    }

    /// Whether an actuator stands alone.
    pub(crate) fn has_one_alone(&self) -> bool {
        self.alone.is_some()
    }

    /// Where the drives were last told to be, m.
    pub(crate) fn q_m(&self) -> Actuators {
        let together = self.together.q_m();
        self.alone.map_or(together, |alone| alone.joined(together, alone.gate.q_m()))
    }

    /// As [`Gate::rates_m_per_s`].
    pub(crate) fn rates_m_per_s(&self) -> Actuators {
        self.together.rates_m_per_s()
    }

    /// When the drives were last written, ns; 0: never.
    pub(crate) fn written_ns(&self) -> i64 {
        self.alone.map_or(0, |alone| alone.gate.written_ns()).max(self.together.written_ns())
    }

    /// Whether the drives stand still as far as the gates know.
    pub(crate) fn is_still(&self) -> bool {
        self.together.is_still() && self.alone.is_none_or(|alone| alone.gate.is_still())
    }

    /// As [`Gate::rest_at`].
    pub(crate) fn rest_at(&mut self, q_m: Actuators) {
        let Some(alone) = &mut self.alone else { return self.together.rest_at(q_m) };
        alone.gate.rest_at(alone.only(q_m));
        self.together.rest_at(alone.without(q_m));
    }

    /// As [`Gate::rest`].
    pub(crate) fn rest(&mut self) {
        self.together.rest();
        if let Some(alone) = &mut self.alone {
            alone.gate.rest();
        }
    }

    /// As [`Gate::toward`].
    pub(crate) fn toward(
        &self,
        target_m: Actuators,
        forecast_m_per_s: Actuators,
        now_ns: i64,
        findings: &mut Findings,
    ) -> Writes {
        let Some(alone) = &self.alone else {
            let together = self.together.toward(target_m, forecast_m_per_s, now_ns, findings);
            return Writes { q_m: together.q_m, together: Some(together), alone: None };
        };
        let (of_lines, of_alone) = (alone.without(forecast_m_per_s), alone.only(forecast_m_per_s));
        let together = self.together.toward(alone.without(target_m), of_lines, now_ns, findings);
        let own = alone.gate.toward(alone.only(target_m), of_alone, now_ns, findings);
        Writes { q_m: alone.joined(together.q_m, own.q_m), together: Some(together), alone: Some(own) }
    }

    /// As [`Gate::brake`].
    pub(crate) fn brake(&mut self, now_ns: i64) -> Option<Writes> {
        let together = self.together.brake(now_ns);
        let own = self.alone.as_mut().and_then(|alone| alone.gate.brake(now_ns));
        (together.is_some() || own.is_some()).then(|| self.writes(together, own))
    }

    /// As [`Gate::part_of`], of each its own part.
    pub(crate) fn part_of(&self, writes: &Writes, [part, alone_part]: Parts) -> Writes {
        if part >= 1.0 && alone_part >= 1.0 {
            return *writes;
        }
        let of = |gate: &Gate, write: &Write, part: f64| if part < 1.0 { gate.part_of(write, part) } else { *write };
        let together = writes.together.map(|write| of(&self.together, &write, part));
        let own = self.alone.zip(writes.alone).map(|(alone, write)| of(&alone.gate, &write, alone_part));
        self.writes(together, own)
    }

    /// As [`Gate::parts_of`].
    pub(crate) fn parts_of(&self, writes: &Writes, parts: &Actuators) -> Writes {
        let together = writes.together.map(|write| self.together.parts_of(&write, parts));
        let own = self.alone.zip(writes.alone).map(|(alone, write)| alone.gate.parts_of(&write, parts));
        self.writes(together, own)
    }

    /// How far the drives' setpoint is from a target that it was brought towards by these parts of the way, m; infinite where a limit
    /// stood in the way.
    pub(crate) fn lags_m(&self, target_m: Actuators, [part, alone_part]: Parts) -> Parts {
        let q_m = self.q_m();
        let left_m: Actuators = core::array::from_fn(|k| target_m[k] - q_m[k]);
        let lag_m = |left_m: Actuators, part: f64| if part < 1.0 { f64::INFINITY } else { largest(left_m) };
        match &self.alone {
            None => [lag_m(left_m, part), 0.0],
            Some(alone) => [lag_m(alone.without(left_m), part), lag_m(alone.only(left_m), alone_part)],
        }
    }

    /// As [`Gate::commit`].
    pub(crate) fn commit(&mut self, writes: &Writes, now_ns: i64) {
        if let Some(write) = &writes.together {
            self.together.commit(write, now_ns);
        }
        if let (Some(alone), Some(write)) = (&mut self.alone, &writes.alone) {
            alone.gate.commit(write, now_ns);
        }
    }

    /// As [`Gate::written_at`].
    pub(crate) fn written_at(&mut self, now_ns: i64) {
        self.together.written_at(now_ns);
        if let Some(alone) = &mut self.alone {
            alone.gate.written_at(now_ns);
        }
    }

    /// Writes of some of the actuators; the others stay.
    fn writes(&self, together: Option<Write>, own: Option<Write>) -> Writes {
        let q_m = together.map_or_else(|| self.together.q_m(), |write| write.q_m);
        let joined = |alone: Alone| alone.joined(q_m, own.map_or_else(|| alone.gate.q_m(), |write| write.q_m));
        Writes { q_m: self.alone.map_or(q_m, joined), together, alone: own }
    }
}
