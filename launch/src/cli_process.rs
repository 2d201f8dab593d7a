//! The command line of the chain's processes: `krait master | resolve | compensate | estimate | slave | record`.

use crate::cli::{EngageKind, MasterKind};
use clap::{Args, Subcommand};
use krait_ipc::Process;
use krait_ipc::message::MotionWish;
use std::path::PathBuf;

/// The processes of the chain.
#[derive(Clone, Debug, Subcommand)]
pub enum ProcessVerb {
    /// Reads the operator's device and publishes operator input.
    #[command(after_help = "Example:\n  krait master --source hid --record-reports hand.krr")]
    Master(MasterArgs),
    /// Turns operator input into a setpoint.
    Resolve(StageArgs),
    /// Turns the setpoint into actuator positions.
    Compensate(StageArgs),
    /// Learns the model's parameters from measured shape.
    Estimate(StageArgs),
    /// Writes the drives, reads the encoders.
    Slave(SlaveArgs),
    /// Writes every channel to an MCAP file.
    Record,
}

impl ProcessVerb {
    /// Which process it runs.
    pub fn process(&self) -> Process {
        match self {
            Self::Master(_) => Process::Master,
            Self::Resolve(_) => Process::Resolve,
            Self::Compensate(_) => Process::Compensate,
            Self::Estimate(_) => Process::Estimate,
            Self::Slave(_) => Process::Slave,
            Self::Record => Process::Record,
        }
    }
}

/// Options of a stage of the bridge.
#[derive(Clone, Copy, Debug, Args)]
pub struct StageArgs {
    /// Take time, states and model updates from the cues of a replay, never from the clock; only for the simulated snake.
    #[arg(long, hide = true)]
    pub cued: bool,
}

/// Options of `krait slave`.
#[derive(Clone, Copy, Debug, Args)]
pub struct SlaveArgs {
    /// Simulate in a replay's own time, which begins here, ns.
    #[arg(long, hide = true)]
    pub recorded_time_ns: Option<i64>,
}

/// Options of `krait master`.
#[derive(Clone, Debug, Args)]
pub struct MasterArgs {
    /// Where the operator's motion comes from.
    #[arg(long = "source", value_enum, default_value_t = MasterKind::Replay)]
    pub kind: MasterKind,
    /// The report recording (replay) or the script to play.
    #[arg(long, value_name = "FILE")]
    pub input: Option<PathBuf>,
    /// Begin the recording or script anew when it ends.
    #[arg(long = "loop")]
    pub looped: bool,
    /// Let the recording or script engage.
    #[arg(long, value_enum, value_name = "once|again", num_args = 0..=1, require_equals = true, default_missing_value = "once")]
    pub engage: Option<EngageKind>,
    /// Live scale to begin with, thousandths; given by a supervisor that starts a lost master again.
    #[arg(long, hide = true, default_value_t = *MotionWish::SCALE_PERMILLE.end(), value_parser = clap::value_parser!(u32).range(10..=1000))]
    pub scale_permille: u32,
    /// Locks to begin with, bits of an input's flags; likewise.
    #[arg(long, hide = true, default_value_t = 0)]
    pub locks: u32,
    /// A master of this chain was lost before: what that has recorded of the hand stays as it is; likewise.
    #[arg(long, hide = true)]
    pub started_again: bool,
    /// The user of the live device has given it back: take none; likewise.
    #[arg(long, hide = true)]
    pub given_back: bool,
    /// Also write every raw report to this file, to be replayed later.
    #[arg(long, value_name = "FILE")]
    pub record_reports: Option<PathBuf>,
}
