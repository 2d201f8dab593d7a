//! The process `krait shape`: reads lines, lets the gate decide, publishes.

use crate::clock_map::Arrival;
use crate::counts::{Counts, ShapeRefusal};
use crate::gate::{GateConfig, Passed, ShapeGate};
use crate::line::{LineError, ShapeLine};
use crate::lines::{Cut, LineReader};
use core::sync::atomic::{AtomicBool, Ordering};
use krait_ipc::message::Shape;
use krait_ipc::{Bus, HealthReporter, IpcError, Process, Reason, Reasons, Writer, clock};
use rustix::fd::AsFd;
use rustix::io::Errno;

/// How long the process sleeps at most before it looks whether it shall stop, ms.
const PATIENCE_MS: i64 = 20;
/// Refusals may come a thousand a second; the log gets one a second, ns.
const LOG_NS: i64 = 1_000_000_000;
/// Health comes ten times a second, with every reason since the one before, ns.
const HEALTH_NS: i64 = 100_000_000;

/// Shapes cannot be taken.
#[derive(Debug, thiserror::Error)]
pub enum ShapeError {
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The configuration is out of range.
    #[error(transparent)]
    Config(#[from] krait_ipc::setting::SettingError),
    /// Somebody else measures.
    #[error(
        "channel \"shape\" of instance {instance:?} has its one writer already, {writer}; if that is the slave's own camera, start the chain with `krait run --shape external`, else end the other program"
    )]
    SecondWriter {
        /// The instance.
        instance: String,
        /// Who it is, as far as that is known.
        writer: String,
    },
    /// The first line is no header.
    #[error("line 1: {0}; the first line must be a header, {{\"krait_shapes\": 1, \"clock\": \"monotonic\"}}")]
    Header(LineError),
    /// The first line is a shape.
    #[error("line 1 is a shape, expected a header before it, {{\"krait_shapes\": 1, \"clock\": \"monotonic\"}}")]
    NoHeader,
    /// The source cannot be read.
    #[error("the shapes could not be read: {0}")]
    Read(Errno),
}

/// Publishes the shapes of one source until it ends or `stop` is set, and says what became of its lines.
///
/// # Errors
/// [`ShapeError`]: another writer, no header, a channel or the source failed.
pub fn run(bus: &Bus, config: GateConfig, source: impl AsFd, stop: &AtomicBool) -> Result<Counts, ShapeError> {
    config.check()?;
    let mut process = Publisher::open(bus, config)?;
    let mut lines = LineReader::new(source);
    process.health.publish(clock::monotonic_ns())?;
    while !stop.load(Ordering::Relaxed) {
        lines.fill(PATIENCE_MS).map_err(ShapeError::Read)?;
        let arrival = Arrival { monotonic_ns: clock::monotonic_ns(), realtime_ns: clock::wall_ns() };
        let has_ended = loop {
            match lines.cut() {
                Cut::Line(line) => process.line(line, &arrival)?,
                Cut::TooLong => process.refuse_line(ShapeRefusal::TooLong, String::new(), &arrival),
                Cut::Nothing => break false,
                Cut::End => break true,
            }
        };
        process.tell(arrival.monotonic_ns)?;
        if has_ended {
            break;
        }
    }
    process.end()
}

struct Publisher {
    gate: ShapeGate,
    shapes: Writer<Shape>,
    health: HealthReporter,
    /// What was found since the last health message.
    reasons: Reasons,
    health_due_ns: i64,
    log_due_ns: i64,
}

impl Publisher {
    fn open(bus: &Bus, config: GateConfig) -> Result<Self, ShapeError> {
        let shapes = bus.writer().map_err(|error| match error {
            IpcError::SecondWriter { instance, .. } => ShapeError::SecondWriter { instance, writer: other_writer(bus) },
            other => ShapeError::Ipc(other),
        })?;
        let health = HealthReporter::open(bus, Process::Shape)?;
        Ok(Self {
            gate: ShapeGate::new(config),
            shapes,
            health,
            reasons: Reasons::NONE,
            health_due_ns: 0,
            log_due_ns: i64::MIN,
        })
    }

    fn line(&mut self, line: &[u8], arrival: &Arrival) -> Result<(), ShapeError> {
        let is_first = self.gate.counts().lines == 0;
        match ShapeLine::parse(line) {
            Ok(ShapeLine::Header(header)) => {
                tracing::info!(source = header.source, clock = ?header.clock, "a stream of shapes begins");
                self.gate.begin(&header);
            }
            Ok(ShapeLine::Shape(_)) if is_first => return Err(ShapeError::NoHeader),
            Err(error) if is_first => return Err(ShapeError::Header(error)),
            Ok(ShapeLine::Shape(measured)) => match self.gate.pass(&measured, arrival) {
                Ok(passed) => self.publish(&passed)?,
                Err((refusal, value, limit)) => self.refused(refusal, value, limit, String::new(), arrival),
            },
            Err(LineError::NotFinite) => self.refuse_line(ShapeRefusal::NotFinite, String::new(), arrival),
            Err(error) => self.refuse_line(ShapeRefusal::Malformed, format!(": {error}"), arrival),
        }
        Ok(())
    }

    fn publish(&mut self, passed: &Passed) -> Result<(), ShapeError> {
        self.shapes.send(&Shape { available_ns: clock::monotonic_ns(), ..passed.shape })?;
        for (finding, value, limit) in passed.findings.into_iter().flatten() {
            self.note(finding.reason(), value, limit);
        }
        Ok(())
    }

    fn refuse_line(&mut self, refusal: ShapeRefusal, detail: String, arrival: &Arrival) {
        self.gate.refuse_line(refusal);
        self.refused(refusal, f64::NAN, f64::NAN, detail, arrival);
    }

    fn refused(&mut self, refusal: ShapeRefusal, value: f64, limit: f64, detail: String, arrival: &Arrival) {
        self.note(refusal.reason(), value, limit);
        if arrival.monotonic_ns < self.log_due_ns {
            return;
        }
        self.log_due_ns = arrival.monotonic_ns.saturating_add(LOG_NS);
        let (line, sentence) = (self.gate.counts().lines, refusal.sentence());
        let figures = if value.is_finite() { format!(" ({value:.3}, limit {limit:.3})") } else { String::new() };
        tracing::warn!("line {line} was refused: {sentence}{figures}{detail}; motion is not affected");
    }

    fn note(&mut self, reason: Reason, value: f64, limit: f64) {
        self.reasons.insert(reason);
        if value.is_finite() && limit.is_finite() {
            self.health.health_mut().note(reason, value, limit);
        }
    }

    /// Health ten times a second, with everything that was found since.
    fn tell(&mut self, now_ns: i64) -> Result<(), IpcError> {
        let counts = *self.gate.counts();
        let health = self.health.health_mut();
        (health.n_received, health.n_sent) = (counts.lines, counts.published);
        (health.n_lost, health.n_refused) = (counts.dropped, counts.refused());
        if now_ns < self.health_due_ns {
            return Ok(());
        }
        self.health_due_ns = now_ns.saturating_add(HEALTH_NS);
        self.health.set_now(core::mem::take(&mut self.reasons));
        self.health.publish(now_ns)
    }

    fn end(mut self) -> Result<Counts, ShapeError> {
        self.health_due_ns = i64::MIN;
        self.tell(clock::monotonic_ns())?;
        Ok(*self.gate.counts())
    }
}

/// Who else may publish shapes: another `krait shape`, or the slave.
fn other_writer(bus: &Bus) -> String {
    let members = bus.members();
    let own = std::process::id();
    let find = |process: Process| members.iter().find(|(name, pid)| name == process.name() && *pid != own);
    match (find(Process::Shape), find(Process::Slave)) {
        (Some((_, pid)), _) => format!("another `krait shape` (pid {pid})"),
        (None, Some((_, pid))) => format!("its slave (pid {pid})"),
        (None, None) => "a program that cannot be named".to_owned(),
    }
}
