//! The faults that can be injected: where each strikes, what must become of the chain, and what must name it.

use super::relay::BURST_NS;
use clap::ValueEnum;
use krait_ipc::{Process, Reason, Reasons};
use serde::{Deserialize, Serialize};

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// Every command comes 80 ms late.
    Late,
    /// No command comes for 200 ms.
    Lost,
    /// Every command comes twice.
    Duplicated,
    /// Two commands in turn change places.
    Reordered,
    /// The same command comes again and again, under new numbers.
    Frozen,
    /// A line's position is not a number.
    Nan,
    /// A line's position is a metre.
    OutOfRange,
    /// Nothing comes for 20 ms, then all of it at once, over and over.
    Burst,
    /// One line goes the other way.
    ReversedAxis,
    /// The clock of the operator's input goes at a twentieth of its speed.
    SlippingClock,
    /// The operator's input says that the hand controller is gone.
    UnpluggedDevice,
    /// An encoder stays where it is while its line moves on.
    StuckEncoder,
    /// A program has made the channel of commands with another payload.
    WrongVersion,
    /// A second process wants to write commands.
    ForeignWriter,
    /// `master` is stopped for 300 ms (SIGSTOP).
    StalledMaster,
    /// `resolve` is stopped for 300 ms.
    StalledResolve,
    /// `compensate` is stopped for 300 ms.
    StalledCompensate,
    /// `slave` is stopped for 300 ms.
    StalledSlave,
    /// `estimate` is stopped for 300 ms.
    StalledEstimate,
    /// `record` is stopped for 300 ms.
    StalledRecord,
    /// `resolve` is stopped for good.
    HungResolve,
    /// `master` is killed (SIGKILL).
    KilledMaster,
    /// `resolve` is killed.
    KilledResolve,
    /// `compensate` is killed.
    KilledCompensate,
    /// `slave` is killed.
    KilledSlave,
    /// `estimate` is killed.
    KilledEstimate,
    /// `record` is killed.
    KilledRecord,
    /// The supervisor is stopped for 300 ms.
    StalledLaunch,
    /// The supervisor is killed.
    KilledLaunch,
    /// The console beside the chain is stopped for 300 ms.
    StalledConsole,
    /// The console is killed.
    KilledConsole,
    /// The disk of the recording is full.
    FullDisk,
    /// The memory of the channels is full.
    FullMemory,
    /// The recording is deleted while it is written.
    DeletedRecording,
}

/// Where a fault strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultPlace {
    /// Between `compensate` and `slave`.
    Command,
    /// Between `master` and `resolve`.
    Input,
    /// In the simulated snake.
    Snake,
    /// A process.
    Process(Process, Blow),
    /// The supervisor of a chain that a command line has started.
    Launch(Blow),
    /// The console beside such a chain.
    Console(Blow),
    /// The machine around the chain.
    Machine,
}

/// What is done to a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blow {
    /// SIGKILL.
    Kill,
    /// SIGSTOP, and SIGCONT a while later.
    Stall,
    /// SIGSTOP.
    Hang,
}

/// What becomes of a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// The snake goes on moving, engaged.
    Moves,
    /// The snake holds still and nobody is engaged; every process runs.
    Holds,
    /// The drives are without power, in FAULT.
    Fault,
    /// The chain has ended in order, without power.
    Ended,
    /// The chain does not start.
    Refused,
}

/// What must name a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Named {
    /// One of these reasons, in the slave's states.
    Reasons(&'static [Reason]),
    /// The slave's count of refused commands.
    Count,
    /// One of these reasons, or these words, where the slave may not live to give a reason.
    ReasonsOr(&'static [Reason], &'static str),
    /// These words, on standard error.
    Words(&'static str),
    /// Nothing: neither motion nor recording suffer.
    NotNeeded,
}

/// The watchdog bites after 50 ms, and a signal takes its time, s.
const PASSES_S: f64 = 0.07;

impl Fault {
    /// Where it strikes, what must become of the chain, what must name it.
    pub fn row(self) -> (FaultPlace, End, Named) {
        use Blow::{Hang, Kill, Stall};
        use Process::{Compensate, Estimate, Master, Record, Resolve, Slave};
        use Reason::{
            ChainStalled, CommandLate, CommandStale, DeviceLost, FollowingError, InputStale, NotFinite, StageRestarted,
            StepLimit,
        };
        // A process that is back before the watchdog bites is a restart, a later one a stall.
        const LOST: Named = Named::Reasons(&[StageRestarted, ChainStalled]);
        const STALLED: Named = Named::Reasons(&[ChainStalled]);
        let command = |end, named| (FaultPlace::Command, end, named);
        let input = |reason| (FaultPlace::Input, End::Holds, Named::Reasons(reason));
        let process = |process, blow, end, named| (FaultPlace::Process(process, blow), end, named);
        let machine = |end, words| (FaultPlace::Machine, end, Named::Words(words));
        match self {
            Self::Late | Self::Lost | Self::Frozen => command(End::Holds, STALLED),
            Self::Duplicated | Self::Reordered => command(End::Moves, Named::Count),
            Self::Nan => command(End::Holds, Named::Reasons(&[NotFinite])),
            Self::OutOfRange | Self::ReversedAxis => command(End::Holds, Named::Reasons(&[StepLimit])),
            Self::Burst => command(End::Moves, Named::Reasons(&[CommandLate])),
            Self::SlippingClock => input(&[InputStale, CommandStale]),
            Self::UnpluggedDevice => input(&[DeviceLost]),
            Self::StuckEncoder => (FaultPlace::Snake, End::Fault, Named::Reasons(&[FollowingError])),
            Self::WrongVersion => machine(End::Refused, "carries payload version"),
            Self::ForeignWriter => machine(End::Moves, "already has its one writer"),
            Self::StalledMaster => process(Master, Stall, End::Holds, STALLED),
            Self::StalledResolve => process(Resolve, Stall, End::Holds, STALLED),
            Self::StalledCompensate => process(Compensate, Stall, End::Holds, STALLED),
            // From 2 s on the supervisor takes it for hung, and the one that comes back knows nothing of the stall.
            Self::StalledSlave => {
                process(Slave, Stall, End::Holds, Named::ReasonsOr(&[ChainStalled], "said nothing for"))
            }
            Self::StalledEstimate => process(Estimate, Stall, End::Moves, Named::NotNeeded),
            Self::StalledRecord => process(Record, Stall, End::Moves, Named::NotNeeded),
            Self::HungResolve => process(Resolve, Hang, End::Holds, STALLED),
            Self::KilledMaster => process(Master, Kill, End::Holds, LOST),
            Self::KilledResolve => process(Resolve, Kill, End::Holds, LOST),
            Self::KilledCompensate => process(Compensate, Kill, End::Holds, LOST),
            // The one that comes back knows nothing of the one before.
            Self::KilledSlave => process(Slave, Kill, End::Holds, Named::Words("nobody commands the drives")),
            Self::KilledEstimate => process(Estimate, Kill, End::Moves, Named::Words("the motion goes on")),
            Self::KilledRecord => process(Record, Kill, End::Moves, Named::Words("nothing more is recorded")),
            Self::StalledLaunch => (FaultPlace::Launch(Stall), End::Moves, Named::NotNeeded),
            // The kernel tells every process, and nobody is left to say a word.
            Self::KilledLaunch => (FaultPlace::Launch(Kill), End::Ended, Named::NotNeeded),
            Self::StalledConsole => (FaultPlace::Console(Stall), End::Moves, Named::NotNeeded),
            Self::KilledConsole => (FaultPlace::Console(Kill), End::Moves, Named::Words("the motion goes on")),
            Self::FullDisk => machine(End::Moves, "No space left"),
            Self::FullMemory => machine(End::Moves, "kB free, expected at least"),
            Self::DeletedRecording => machine(End::Moves, "it was deleted or moved"),
        }
    }

    /// Whether the recording holds what came behind the fault.
    pub fn is_recorded(self) -> bool {
        !matches!(
            self,
            Self::WrongVersion | Self::KilledRecord | Self::StalledRecord | Self::FullDisk | Self::DeletedRecording
        )
    }

    /// Whether there is a recording afterwards, whole or cut.
    pub fn leaves_recording(self) -> bool {
        !matches!(self, Self::WrongVersion | Self::DeletedRecording)
    }

    /// Whether a stall of so many seconds may be over before the watchdog ends the motion.
    pub fn may_pass(self, stall_s: f64) -> bool {
        matches!(self.row().0, FaultPlace::Process(_, Blow::Stall)) && stall_s < PASSES_S
    }

    /// The silence that it makes by itself, ns.
    pub fn silence_ns(self) -> i64 {
        if self == Self::Burst { BURST_NS } else { 0 }
    }

    /// Its word on the command line.
    pub fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }
}

impl End {
    /// In a word, for the table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Moves => "moves",
            Self::Holds => "holds",
            Self::Fault => "fault",
            Self::Ended => "ended",
            Self::Refused => "refused",
        }
    }
}

impl Named {
    /// What names the fault, of what a scene has shown; nothing where nothing does.
    pub fn found(self, reasons: Reasons, n_refused: u64, said: &str) -> Option<String> {
        let reason = |any: &[Reason]| any.iter().find(|one| reasons.contains(**one)).map(|one| format!("{one:?}"));
        let quoted = |words: &str| said.contains(words).then(|| format!("\"{words}\""));
        match self {
            Self::Reasons(any) => reason(any),
            Self::ReasonsOr(any, words) => reason(any).or_else(|| quoted(words)),
            Self::Count => (n_refused > 0).then(|| format!("{n_refused} refused")),
            Self::Words(words) => quoted(words),
            Self::NotNeeded => Some("(need not be)".to_owned()),
        }
    }
}
