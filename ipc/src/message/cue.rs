//! What a replay tells the stages besides their input: which clock readings and which other messages a step shall rest on.

use super::message;
use iceoryx2::prelude::ZeroCopySend;

/// Everything that one sample's steps depend on besides their input. Published by a replay just before the sample itself;
/// read by stages that were started for a replay, and by nobody else.
///
/// A stage that reads cues never looks at the clock for a step: "now" is what stands here. It waits until it has the slave
/// state and the model update that are named here, and looks at no newer ones. That makes every step a function of what
/// was published, however fast the replay is and whoever is scheduled first.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.Cue")]
pub struct Cue {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of the sample, in the replay's own time, nanoseconds.
    pub sample_ns: i64,
    /// Sequence number of the operator input that this cue is for; a setpoint carries it as `input_sequence`.
    pub input_sequence: u64,
    /// What `resolve` takes for now, nanoseconds; 0: it leaves the sample out.
    pub resolve_begun_ns: i64,
    /// When `resolve` shall say that it has published, nanoseconds.
    pub setpoint_sent_ns: i64,
    /// What `compensate` takes for now, nanoseconds; 0: it leaves the sample out.
    pub compensate_begun_ns: i64,
    /// When `compensate` shall say that it has published, nanoseconds.
    pub command_sent_ns: i64,
    /// Sequence number of the newest slave state that `resolve` shall know (0: none).
    pub resolve_state_sequence: u64,
    /// Sequence number of the newest slave state that `compensate` shall know (0: none).
    pub compensate_state_sequence: u64,
    /// Sequence number of the newest model update that `compensate` shall know (0: none).
    pub model_update_sequence: u64,
}

message!(Cue, "cue", 1);
