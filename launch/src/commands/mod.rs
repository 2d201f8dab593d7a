//! One file per subcommand.

pub mod bench;
mod bench_growth;
pub mod calibrate;
mod calibrate_chain;
mod calibrate_lines;
mod calibrate_stem;
pub mod compare;
mod compare_table;
mod compare_verdict;
pub mod config;
pub mod console;
pub mod demo;
pub mod devices;
pub mod doctor;
pub mod drives;
pub mod experiment;
pub mod export;
pub mod fault;
pub mod lab;
pub mod mark;
pub mod model;
mod model_compensate;
mod model_compensate_segments;
pub mod model_exchange;
mod model_learnt;
mod model_loads;
mod model_segments;
pub mod motion_wish;
pub mod overwrite;
pub mod paper;
pub mod process;
pub mod recover;
pub mod replay;
mod replay_slave;
pub mod run;
pub mod shape;
pub mod state;
pub mod stop;
mod unused_axes;
pub mod verify;
pub mod watch;
pub mod yardstick;

use anyhow::bail;
use core::time::Duration;
use krait_ipc::message::Message;
use krait_ipc::{Bus, IpcError, Writer, clock};

/// How often a command looks whether its turn has come.
const TURN: Duration = Duration::from_millis(5);

/// Members of an instance that are no part of a chain: a chain may start beside them.
pub const TOOLS: [&str; 7] =
    [console::NAME, mark::NAME, model_exchange::NAME, state::NAME, stop::NAME, shape::NAME, watch::NAME];

/// Refuses a command that needs a process of a chain where that does not run.
///
/// # Errors
/// One sentence that says what to do.
pub fn refuse_without(bus: &Bus, process: &str, command: &str) -> anyhow::Result<()> {
    let members = bus.members();
    if members.iter().any(|(name, _)| name == process) {
        return Ok(());
    }
    let instance = bus.instance().as_str();
    if members.iter().any(|(name, _)| !TOOLS.contains(&name.as_str())) {
        bail!(
            "instance {instance:?} has no process `{process}`, which `krait {command}` asks; start a whole chain with `krait run`"
        )
    }
    bail!(
        "no chain runs in instance {instance:?}, so `krait {command}` has nobody to ask; start one with `krait run`, or name another with --instance"
    )
}

/// Today, YYYY-MM-DD.
fn today() -> String {
    krait_record::utc_text(clock::wall_ns()).chars().take(10).collect()
}

/// Becomes the writer of a channel on which commands take turns; whoever else is asking is soon done.
///
/// # Errors
/// As [`Bus::writer`]; [`IpcError::SecondWriter`] only where the other is not done by the deadline.
pub fn writer_by<M: Message>(bus: &Bus, deadline_ns: i64) -> Result<Writer<M>, IpcError> {
    loop {
        match bus.writer() {
            Err(IpcError::SecondWriter { .. }) if clock::monotonic_ns() < deadline_ns => std::thread::sleep(TURN),
            result => return result,
        }
    }
}
