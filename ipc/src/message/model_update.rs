//! What the estimator has learnt: published by `estimate`, taken by `compensate` smoothly and within bounds.

use super::message;
use iceoryx2::prelude::ZeroCopySend;

/// The most parameters that are learnt at once.
pub const MAX_LEARNT: usize = 8;

/// Proposed parameters with their uncertainty. Every update is complete: it replaces the one before.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.ModelUpdate")]
pub struct ModelUpdate {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Exposure of the newest shape that it rests on, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// Sequence number of that shape.
    pub shape_sequence: u64,
    /// Sequence number of the newest slave state that it rests on (0: none).
    pub state_sequence: u64,
    /// Slave states that it rests on, counted since start: the newest, and those before it.
    pub n_states: u64,
    /// Which model is learnt: its hash.
    pub model_hash: u64,
    /// Root mean square of what was not explained of the newest shapes, along each axis of the bend vector, rad.
    pub innovation_rms_rad: f64,
    /// Measurements used since start.
    pub n_used: u64,
    /// Measurements left out since start (rest, unpaired, outlier).
    pub n_left_out: u64,
    /// Changes of the machine seen since start: the model no longer explained the camera.
    pub n_changes: u64,
    /// Exposure of the shape that showed the newest of them, CLOCK_MONOTONIC, nanoseconds; 0 before the first.
    pub changed_ns: i64,
    /// What it looks like: 1 along x, 2 along y, 3 in the bending plane, 4 out of it, 5 with the motion, 6 scatter; 0 before the first.
    pub change_kind: u32,
    /// 1 while the watch for changes has learnt what is normal, else 0.
    pub is_watching: u32,
    /// Parameters that are learnt, at most [`MAX_LEARNT`].
    pub n_learnt: u32,
    /// The segment that showed the newest change, from 1; 0 before the first, and of a snake.
    pub changed_segment: u32,
    /// The parameters, in the order of the model file; zeros behind the last.
    pub learnt: [LearntValue; MAX_LEARNT],
}

message!(ModelUpdate, "model_update", 3);

impl ModelUpdate {
    /// The parameters that are learnt.
    pub fn learnt(&self) -> &[LearntValue] {
        &self.learnt[..(self.n_learnt as usize).min(MAX_LEARNT)]
    }
}

/// One learnt parameter.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.LearntValue")]
pub struct LearntValue {
    /// Its value, in its own unit.
    pub value: f64,
    /// Standard deviation of the value, in the same unit.
    pub sd: f64,
    /// Place of the effect in the model file, from 0.
    pub effect: u16,
    /// Place of the parameter in the effect, from 0.
    pub parameter: u16,
    /// See [`LearningState`].
    pub state: u16,
    /// Place (from 1) among the learnt parameters of the one that the motion cannot tell it from; 0: none.
    pub tied_to: u16,
}

impl LearntValue {
    /// The typed state, or `None` for a value that no version of krait sends.
    pub fn state(&self) -> Option<LearningState> {
        LearningState::ALL.into_iter().find(|state| *state as u16 == self.state)
    }
}

/// How learning one parameter goes.
#[repr(u16)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearningState {
    /// The motion says nothing about it: it is held at its start value.
    NotObservable = 0,
    /// It follows the measurements.
    Learning = 1,
    /// The measurements ask for more than its bounds allow.
    AtBound = 2,
}

impl LearningState {
    /// Every state.
    pub const ALL: [Self; 3] = [Self::NotObservable, Self::Learning, Self::AtBound];
}
