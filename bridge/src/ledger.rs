//! What an estimator counts and pairs, whatever it learns: states and shapes in, the outline of an update out.

use crate::learning::learnt_values;
use crate::pairing::{Pairing, Sighted};
use crate::step::seconds_between;
use krait_ipc::message::{ModelUpdate, Shape, SlaveState};
use krait_model::{Circumstances, Learning, Learnt, LearntParameter, ModelHash};

/// A camera that gave nothing for this long is named as silent: fifteen frames at 60 Hz, ms.
const SHAPE_STALE_MS: f64 = 250.0;

/// States and shapes so far.
#[derive(Clone, Debug)]
pub(crate) struct Ledger<S> {
    sighted: Pairing<S>,
    max_state_gap_ms: f64,
    start_ns: Option<i64>,
    paired_ns: Option<i64>,
    newest_shape_ns: Option<i64>,
    sequence: u64,
    state_sequence: u64,
    n_states: u64,
    n_used: u64,
    n_left_out: u64,
}

impl<S: Copy + Default> Ledger<S> {
    /// `max_state_gap_ms`: a shape without a state so near to its exposure is left out.
    pub fn new(max_state_gap_ms: f64) -> Self {
        Self {
            sighted: Pairing::new(),
            max_state_gap_ms,
            start_ns: None,
            paired_ns: None,
            newest_shape_ns: None,
            sequence: 0,
            state_sequence: 0,
            n_states: 0,
            n_used: 0,
            n_left_out: 0,
        }
    }

    /// Counts a state; where its `readings` are finite the model follows it.
    pub fn note_state(&mut self, state: &SlaveState, readings: &[f64], follow: impl FnOnce(&Circumstances) -> S) {
        (self.state_sequence, self.n_states) = (state.sequence, self.n_states + 1);
        if readings.iter().all(|reading| reading.is_finite()) {
            let start_ns = *self.start_ns.get_or_insert(state.sample_ns);
            let at = Circumstances::at(seconds_between(start_ns, state.sample_ns));
            self.sighted.note(state.sample_ns, follow(&at));
        }
    }

    /// What the model saw at a shape's exposure, and the time since the shape before, s; `None` for a shape that does not
    /// follow that one or has no state near it.
    pub fn pair(&mut self, shape: &Shape) -> Option<(Sighted<S>, f64)> {
        if self.paired_ns.is_some_and(|before_ns| shape.sample_ns <= before_ns) {
            return None;
        }
        let sighted = self.sighted.at(shape.sample_ns, self.max_state_gap_ms)?;
        let dt_s = self.paired_ns.map_or(0.0, |before_ns| seconds_between(before_ns, shape.sample_ns));
        self.paired_ns = Some(shape.sample_ns);
        Some((sighted, dt_s))
    }

    /// Counts a shape and what became of it; the update says nothing of changes of the machine.
    pub fn update(
        &mut self,
        shape: &Shape,
        taken: Option<Learning>,
        model: ModelHash,
        innovation_rms_rad: f64,
        parameters: &[LearntParameter],
        learnt: impl Fn(usize) -> Option<Learnt>,
    ) -> ModelUpdate {
        self.newest_shape_ns = Some(shape.sample_ns);
        let is_used = taken == Some(Learning::Used);
        self.n_used += u64::from(is_used);
        self.n_left_out += u64::from(!is_used);
        self.sequence += 1;
        ModelUpdate {
            sequence: self.sequence,
            sample_ns: shape.sample_ns,
            shape_sequence: shape.sequence,
            state_sequence: self.state_sequence,
            n_states: self.n_states,
            model_hash: model.0,
            innovation_rms_rad,
            n_used: self.n_used,
            n_left_out: self.n_left_out,
            n_changes: 0,
            changed_ns: 0,
            change_kind: 0,
            is_watching: 0,
            n_learnt: parameters.len() as u32,
            changed_segment: 0,
            learnt: learnt_values(parameters, learnt),
        }
    }

    /// Whether the camera has fallen silent.
    pub fn is_silent(&self, now_ns: i64) -> bool {
        self.newest_shape_ns.is_some_and(|newest_ns| seconds_between(newest_ns, now_ns) * 1e3 > SHAPE_STALE_MS)
    }
}
