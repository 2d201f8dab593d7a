//! Why a recording or trajectory cannot be played, each in one sentence.

use krait_ipc::IpcError;
use krait_record::{RecordError, RecordingReadError};

/// A replay could not begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] RecordingReadError),
    /// The new recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A message that a step depended on is missing.
    #[error(
        "message {sequence} of channel {channel:?} is not in the recording, so what depended on it cannot be repeated; \
         verify a recording that ended in order"
    )]
    Missing {
        /// Its sequence number.
        sequence: u64,
        /// Its channel.
        channel: &'static str,
        /// Whether it would come after all that the recording holds of its channel: the recording may have been cut.
        is_behind_end: bool,
    },
    /// A channel's messages do not follow one another.
    #[error(
        "the recording holds message {found} of channel {channel:?} where {expected} was expected, so the steps from there \
         on cannot be repeated; verify a recording that lost nothing"
    )]
    Gap {
        /// The channel.
        channel: &'static str,
        /// The sequence number expected.
        expected: u64,
        /// The sequence number found.
        found: u64,
    },
    /// There is nothing to play.
    #[error("the recording holds no {what}, so there is nothing to play; record a chain with `krait run`")]
    Empty {
        /// What it lacks.
        what: &'static str,
    },
    /// The chain does not answer.
    #[error(
        "sample {sample} was sent {patience_s} s ago and {n_waiting} samples wait for an answer of the chain; \
         KRAIT_LOG=info shows what its processes do"
    )]
    Stalled {
        /// The newest sample sent.
        sample: u64,
        /// Samples without an answer.
        n_waiting: u64,
        /// How long the replay has waited, s.
        patience_s: u64,
    },
    /// A thread cannot go on.
    #[error("the thread that {doing} cannot go on: {what}; is the disk full, or the machine's memory?")]
    Thread {
        /// What it does.
        doing: &'static str,
        /// Why.
        what: String,
    },
    /// There is no such pass.
    #[error("{}", no_pass(*pass, *n_passes))]
    NoPass {
        /// The pass asked for, from 1.
        pass: u64,
        /// How many there are.
        n_passes: u64,
    },
    /// Nothing was recorded in the time asked for.
    #[error("no operator input lies between --from {from_s} s and {}", end_of_range(*to_s))]
    EmptyRange {
        /// Where it begins, s after the first input.
        from_s: f64,
        /// Where it ends.
        to_s: f64,
    },
    /// The slave cannot move.
    #[error(
        "the slave is not enabled and homed, expected that before a replay moves it: {reasons}; the replay has ended"
    )]
    NotReady {
        /// The slave's reasons.
        reasons: String,
    },
    /// The machine does not stand where the recording begins.
    #[error(
        "the slave stands at {found}, expected {expected} within {limit} before the recorded samples begin; nothing recorded \
         was sent"
    )]
    StartPose {
        /// Where it stands, with the unit.
        found: String,
        /// Where the recording begins.
        expected: String,
        /// How far it may be away.
        limit: String,
    },
    /// A recorded setpoint from which nothing can begin.
    #[error(
        "its setpoint at the beginning is {found:?} rad, expected a bend of at most {limit:.4} rad; choose another beginning \
         with --from, or a recording that is not damaged"
    )]
    StartBend {
        /// The bend vector, rad.
        found: [f64; 2],
        /// Largest bend, rad.
        limit: f64,
    },
    /// A recorded setpoint of joints from which nothing can begin.
    #[error(
        "its setpoint at the beginning has joint {joint} at {found}, expected {low:.4} to {high:.4}, rad (m of a sliding \
         joint); choose another beginning with --from, or a recording that is not damaged"
    )]
    StartJoint {
        /// Which joint, from 1.
        joint: usize,
        /// Where it is.
        found: f64,
        /// Its lower limit.
        low: f64,
        /// Its upper limit.
        high: f64,
    },
    /// A recording of another machine than the model's.
    #[error(
        "its setpoints are of {found}, expected those of {expected} as the model has; replay it with its own model"
    )]
    OtherMachine {
        /// What the recording holds.
        found: String,
        /// What the model is of.
        expected: String,
    },
    /// No bus was recorded.
    #[error(
        "it holds no cycles of a bus (channel \"drive_cycle\"): its drives were simulated, or it was made before krait recorded \
         them; replay it without --slave recorded"
    )]
    NoCycles,
    /// The recording begins in the middle of a bus's life.
    #[error(
        "its cycles of the bus begin with number {found}, expected 0, what was seen when the bus was opened; choose a recording that \
         was begun before the slave, or its first part"
    )]
    NoOpening {
        /// The first cycle's number.
        found: u64,
    },
    /// Other drives than were recorded.
    #[error(
        "its cycles are of {found} actuators, and [slave.drive] describes {expected}; describe those that were recorded"
    )]
    OtherActuators {
        /// Actuators in the cycles.
        found: u32,
        /// Actuators in the configuration.
        expected: usize,
    },
    /// A trajectory was refused.
    #[error(transparent)]
    Trajectory(#[from] crate::TrajectoryError),
}

/// A recording that holds no pass at all may be cut before the first.
fn no_pass(pass: u64, n_passes: u64) -> String {
    match n_passes {
        0 => "it holds no pass: nothing ran while it was made, or it is cut before the first; `krait verify` says what it lacks".to_owned(),
        n => format!("--pass {pass}: it holds {n} {}", if n == 1 { "pass" } else { "passes" }),
    }
}

/// The end of a part of a recording, for sentences: nobody types an infinite one.
#[must_use]
pub fn end_of_range(to_s: f64) -> String {
    if to_s.is_finite() { format!("--to {to_s} s") } else { "the end".to_owned() }
}
