//! Whether the measured shape still is what the model predicts of it: a warning, and beyond the second limit an end of the
//! motion, both relative to the error that is the measurement's own.
//!
//! What is judged comes with the model updates: what the values in force did not explain of the newest shapes in motion. Those
//! are named in every command, so that a repetition judges alike.

use crate::config::CompensateConfig;
use crate::step::seconds_between;
use crate::{JointMachine, SegmentModel};
use krait_ipc::message::Health;
use krait_ipc::{Reason, Reasons};
use krait_model::Chain;

/// The two limits, rad or, where joints slide, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mismatch {
    warn: f64,
    trip: f64,
    trip_after_s: f64,
    /// For people: degrees, or millimetres where joints slide.
    shown_per_si: f64,
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
        Self::new(floor_rad, chain.learnt().is_empty() && chain.floor_rad().is_none(), config, 1f64.to_degrees())
    }

    /// The limits of a model of joints, whose files state no floor. Sliding joints count a radian as the capstan's radius.
    pub(crate) fn of_joints(machine: &JointMachine, config: &CompensateConfig) -> Self {
        let floor_si = config.mismatch_floor_rad * machine.si_per_rad();
        let shown_per_si = if machine.model.slides() { 1e3 } else { 1f64.to_degrees() };
        Self::new(floor_si, machine.model.chain.learnt().is_empty(), config, shown_per_si)
    }

    /// The limits of a model of segments, whose files state no floor.
    pub(crate) fn of_segments(model: &SegmentModel, config: &CompensateConfig) -> Self {
        let shows_its_error = model.chain().learnt().is_empty();
        Self::new(config.mismatch_floor_rad, shows_its_error, config, 1f64.to_degrees())
    }

    fn new(floor: f64, shows_its_error: bool, config: &CompensateConfig, shown_per_si: f64) -> Self {
        let [warn, trip] = match shows_its_error {
            true => [config.mismatch_wide_floors; 2],
            false => [config.mismatch_warn_floors, config.mismatch_trip_floors],
        };
        Self { warn: warn * floor, trip: trip * floor, trip_after_s: config.mismatch_trip_after_s, shown_per_si }
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

    /// Notes what was not explained beside the limits that it broke.
    pub(crate) fn tell(&self, found: f64, reasons: Reasons, health: &mut Health) {
        for (reason, limit) in [(Reason::ModelMismatch, self.warn), (Reason::MismatchTrip, self.trip)] {
            if reasons.contains(reason) {
                health.note(reason, found * self.shown_per_si, limit * self.shown_per_si);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_model::KnownColumns;
    use krait_model::model_file::ModelFile;

    const NAIVE: &str = "format = 1\n[machine]\nkind = \"snake\"\n";

    /// After how many seconds a constant rest ends the motion, within five; and whether it was warned of.
    fn found(floor_deg: Option<f64>, rest_deg: f64) -> (Option<f64>, bool) {
        let file = ModelFile::parse(NAIVE).expect("a model");
        let chain = file.chain(KnownColumns::default()).expect("a chain").expect("a snake");
        let chain = chain.with_floor(floor_deg.map(f64::to_radians));
        let mismatch = Mismatch::of_snake(&chain, &CompensateConfig::default());
        let (mut seen, mut reasons) = (Seen::default(), Reasons::NONE);
        let mut judged = |ms: i64| mismatch.trips(&mut seen, rest_deg.to_radians(), ms * 1_000_000, &mut reasons);
        let ended_s = (0..5000).find(|ms| judged(*ms)).map(|ms| ms as f64 * 1e-3);
        (ended_s, reasons.contains(Reason::ModelMismatch))
    }

    #[test]
    fn limits_are_relative_to_the_floor_that_the_model_states() {
        let (ended_s, _) = found(Some(0.1), 4.1);
        assert!(ended_s.is_some_and(|s| (0.4..0.6).contains(&s)), "40 floors of 0.1 deg: {ended_s:?}");
        assert_eq!(found(Some(0.5), 4.1).0, None, "the same rest is within 40 floors of 0.5 deg");
    }

    #[test]
    fn a_model_that_is_there_to_show_its_error_has_a_limit_too_and_a_machine_can_reach_it() {
        assert_eq!(found(None, 40.0), (None, false), "what a snake without compensation shows");
        let (ended_s, is_warned) = found(None, 62.0);
        assert!(ended_s.is_some() && is_warned);
    }
}
