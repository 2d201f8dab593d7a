//! `krait mark TEXT`: a word about this instant in the recording of a chain that runs.

use crate::cli::{Common, MarkArgs};
use crate::{commands, print};
use anyhow::bail;
use core::time::Duration;
use krait_ipc::message::Marker;
use krait_ipc::{Bus, Process, ReadOptions, Reader, Writer, clock};
use krait_record::utc_text;
use std::process::ExitCode;

/// Its name among the members of an instance; it is no part of a chain, and a chain may start beside it.
pub const NAME: &str = "mark";
/// A recorder looks every 5 ms; one that has not answered by then cannot.
const PATIENCE_NS: i64 = 3_000_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Sets a mark now and says so.
pub fn run(common: &Common, args: &MarkArgs) -> anyhow::Result<ExitCode> {
    let now_ns = clock::monotonic_ns();
    let bus = Bus::open(&common.instance, NAME)?;
    print::out(&format!("{} in instance {:?}\n", set(&bus, &args.text.join(" "), now_ns)?, common.instance))?;
    Ok(ExitCode::SUCCESS)
}

/// Marks an instant in the recording, waits until the recorder has taken it, and says what was marked when.
pub fn set(bus: &Bus, text: &str, at_ns: i64) -> anyhow::Result<String> {
    let mark = Marker::new(1, at_ns, text)?;
    refuse_without_recorder(bus)?;
    let now_ns = clock::monotonic_ns();
    let deadline_ns = now_ns + PATIENCE_NS;
    let mut recorded = bus.reader_on::<Marker>(Marker::RECORDED_CHANNEL, ReadOptions::waking())?;
    Sender(commands::writer_by(bus, deadline_ns)?).send_and_wait(&mark, &mut recorded, deadline_ns)?;
    let wall_ns = clock::wall_ns() - (clock::monotonic_ns() - at_ns);
    Ok(format!("marked {:?} at {}", mark.text().unwrap_or_default(), utc_text(wall_ns)))
}

fn refuse_without_recorder(bus: &Bus) -> anyhow::Result<()> {
    let instance = bus.instance().as_str();
    let members = bus.members();
    if members.iter().any(|(name, _)| name == Process::Record.name()) {
        return Ok(());
    }
    if members.iter().any(|(_, pid)| *pid != std::process::id()) {
        bail!(
            "the chain in instance {instance:?} has no recorder, so there is nothing to set a mark in; start it without --no-recording, or wait until it runs"
        );
    }
    bail!(
        "no chain runs in instance {instance:?}, so there is nothing to set a mark in; start one with `krait run`, or name another with --instance"
    )
}

struct Sender(Writer<Marker>);

impl Sender {
    /// Stays until the recorder has it: what a writer says goes with the writer.
    fn send_and_wait(mut self, mark: &Marker, recorded: &mut Reader<Marker>, deadline_ns: i64) -> anyhow::Result<()> {
        self.0.send(mark)?;
        while clock::monotonic_ns() < deadline_ns {
            recorded.wait(LOOK_EVERY)?;
            while let Some(seen) = recorded.take()? {
                if (seen.sender_pid, seen.sample_ns) == (mark.sender_pid, mark.sample_ns) {
                    return Ok(());
                }
            }
        }
        bail!("the recorder did not take the mark within 3 s; its recording has stopped, or the machine is too busy")
    }
}
