//! What happened, as lines of a log: a reason that begins or ends to hold, a process that was started again, a new operating
//! state, a wish for one.

use krait_ipc::message::{Health, Marker, OperatingState, StateCommand};
use krait_ipc::{Process, Reason, Reasons};
use krait_schema::Sample;
use krait_schema::generated::foxglove::Log as Line;
use krait_schema::generated::foxglove::log::Level;

/// What was last known, so that only changes are told.
#[derive(Debug, Default)]
pub(super) struct Log {
    reasons: [Reasons; Process::ALL.len()],
    pids: [Option<u32>; Process::ALL.len()],
    operating_state: Option<u32>,
}

impl Log {
    /// The lines that a sample gives rise to, without their stamp; mostly none.
    pub(super) fn lines(&mut self, sample: &Sample) -> Vec<Line> {
        match sample {
            Sample::Health(process, health) => self.health(*process, health),
            Sample::State(state) => self.state(state.operating_state),
            Sample::StateCommand(command) => vec![asked(command)],
            Sample::Marker(marker) => vec![marked("mark", marker)],
            Sample::DeviceMarker(marker) => vec![marked("master", marker)],
            _ => Vec::new(),
        }
    }

    fn health(&mut self, process: Process, health: &Health) -> Vec<Line> {
        let now = Reasons::from_bits(health.reasons_now);
        let before = core::mem::replace(&mut self.reasons[process as usize], now);
        let begun = now.iter().filter(|reason| !before.contains(*reason));
        let over = before.iter().filter(|reason| !now.contains(*reason));
        let begun = begun.map(|reason| line(process.name(), level(reason), reason.sentence().to_owned()));
        let was = self.pids[process as usize].replace(health.pid);
        let started = was.filter(|was| *was != health.pid).map(|was| started_again(process, was, health.pid));
        let over = over.map(|r| line(process.name(), Level::Debug, format!("no longer: {}", r.sentence())));
        started.into_iter().chain(begun).chain(over).collect()
    }

    fn state(&mut self, found: u32) -> Vec<Line> {
        if self.operating_state.replace(found) == Some(found) {
            return Vec::new();
        }
        let (level, word) = match OperatingState::from_u32(found) {
            Some(OperatingState::Fault) => (Level::Error, OperatingState::Fault.name().to_owned()),
            Some(state) => (Level::Info, state.name().to_owned()),
            None => (Level::Warning, format!("an operating state {found} that this version does not know")),
        };
        vec![line(Process::Slave.name(), level, format!("operating state: {word}"))]
    }
}

fn started_again(process: Process, was: u32, pid: u32) -> Line {
    let what = format!("started again, pid {pid} after {was}: its numbers begin at 1 and its memory anew");
    line(process.name(), Level::Warning, what)
}

fn asked(command: &StateCommand) -> Line {
    let word =
        command.transition().map_or_else(|| format!("transition {}", command.transition), |t| t.name().to_owned());
    line("launch", Level::Info, format!("asked for: {word}"))
}

fn marked(name: &str, marker: &Marker) -> Line {
    line(name, Level::Info, format!("MARK {}", marker.text().unwrap_or("(no text)")))
}

/// What a surgeon does on purpose is worth a note; what limits or refuses, a warning; what ends something, an error.
fn level(reason: Reason) -> Level {
    match reason {
        Reason::OperatorAbsent
        | Reason::Clutched
        | Reason::EasingIn
        | Reason::ModelBlending
        | Reason::InputEnded
        | Reason::SlaveNotEnabled
        | Reason::SlaveNotHomed
        | Reason::NotEngaged
        | Reason::StopAsked => Level::Info,
        Reason::RecordingStopped
        | Reason::DriveFault
        | Reason::DeviceLost
        | Reason::HandJumped
        | Reason::FormulaFault => Level::Error,
        _ => Level::Warning,
    }
}

fn line(name: &str, level: Level, message: String) -> Line {
    Line { level: level as i32, message, name: name.to_owned(), ..Line::default() }
}
