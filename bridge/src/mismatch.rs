//! Whether the measured shape still is what the model predicts of it: a warning, and beyond the second limit an end of the
//! motion, both relative to the error that is the measurement's own.
//!
//! What is judged comes with the model updates: what the values in force did not explain of the newest shapes in motion. Those
//! are named in every command, so that a repetition judges alike.

use crate::JointMachine;
use crate::config::CompensateConfig;
use crate::step::seconds_between;
use krait_ipc::{Reason, Reasons};
use krait_model::Chain;

/// The two limits, rad or, where joints slide, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mismatch {
    warn: f64,
    trip: f64,
    trip_after_s: f64,
}

/// What was found so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// Since when the shape is beyond the second limit, ns.
    beyond_since_ns: Option<i64>,
    /// It was so for long enough once; stays until the process is started anew.
    has_tripped: bool,
}

impl Mismatch {
    /// The limits of a snake's model.
    pub(crate) fn of_snake(chain: &Chain, config: &CompensateConfig) -> Self {
        let floor_rad = chain.floor_rad().unwrap_or(config.mismatch_floor_rad);
        Self::new(floor_rad, chain.learnt().is_empty() && chain.floor_rad().is_none(), config)
    }

    /// The limits of a model of joints, whose files state no floor. Sliding joints count a radian as the capstan's radius.
    pub(crate) fn of_joints(machine: &JointMachine, config: &CompensateConfig) -> Self {
        let floor_si = config.mismatch_floor_rad * machine.si_per_rad();
        Self::new(floor_si, machine.model.chain.learnt().is_empty(), config)
    }

    fn new(floor: f64, shows_its_error: bool, config: &CompensateConfig) -> Self {
        let [warn, trip] = match shows_its_error {
            true => [config.mismatch_wide_floors; 2],
            false => [config.mismatch_warn_floors, config.mismatch_trip_floors],
        };
        Self { warn: warn * floor, trip: trip * floor, trip_after_s: config.mismatch_trip_after_s }
    }

    /// Judges what the newest update says was not explained, in the limits' unit, at a sample's instant; says into `reasons`
    /// what it found. Returns whether the motion has to end.
    pub(crate) fn trips(&self, seen: &mut Seen, found: f64, sample_ns: i64, reasons: &mut Reasons) -> bool {
        seen.beyond_since_ns = match found > self.trip {
            true => seen.beyond_since_ns.or(Some(sample_ns)),
            false => None,
        };
        seen.has_tripped |= seen.beyond_since_ns.is_some_and(|ns| seconds_between(ns, sample_ns) >= self.trip_after_s);
        reasons.insert_if(Reason::ModelMismatch, found > self.warn);
        reasons.insert_if(Reason::MismatchTrip, seen.has_tripped);
        seen.has_tripped
    }
}
