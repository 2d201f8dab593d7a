//! One round of a relay: four processes are started from the end of the chain to its beginning, and what they leave is read.

use crate::samples::read_samples;
use crate::stage::{Role, read_counted, ready_path, samples_path, words_path, write_plan};
use crate::transport::{Pipework, standard_streams};
use crate::{BenchError, ChainKind, N_HOPS, Plan, Round, Scratch, Usage};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use std::path::Path;
use std::process::{Child, Command};

/// A process that is not ready by then will not be.
const READY_PATIENCE: Duration = Duration::from_secs(60);
/// Time beyond the round's own after which its processes are killed.
const END_PATIENCE: Duration = Duration::from_secs(10);
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// Of a process's last line on standard error, what a sentence can hold, characters.
const MOST_WORDS: usize = 300;

/// The processes of a round; they do not outlive it.
struct Relays<'a> {
    chain: &'static str,
    scratch: &'a Scratch,
    children: Vec<(Role, Child)>,
}

/// Measures a relay once. `command` gives the command that becomes a process of the relay: it is to call
/// [`crate::run_stage`] with the role, in the folder and under the prefix of the scratch.
///
/// # Errors
/// [`BenchError`] when a process could not be started or died, or `stop` was set.
pub fn run_relay_round(
    kind: ChainKind,
    plan: &Plan,
    stop: &AtomicBool,
    command: &mut dyn FnMut(ChainKind, Role, &Scratch) -> Result<Command, BenchError>,
) -> Result<Round, BenchError> {
    let scratch = Scratch::new()?;
    write_plan(scratch.folder(), plan)?;
    let mut pipework =
        Pipework::new(kind, N_HOPS).map_err(BenchError::transport(kind.name(), "making its file descriptors"))?;
    let mut relays = Relays { chain: kind.name(), scratch: &scratch, children: Vec::new() };
    for role in Role::ALL.into_iter().rev() {
        let (input, output) = standard_streams(&mut pipework, role as usize);
        let mut command = command(kind, role, &scratch)?;
        let child = command.stdin(input).stdout(output).spawn();
        relays
            .children
            .push((role, child.map_err(|error| relays.failed(role, format!("could not be started: {error}")))?));
        relays.wait_until_ready(role)?;
    }
    relays.wait_for_the_end(plan, stop)?;
    collect(&scratch)
}

fn collect(scratch: &Scratch) -> Result<Round, BenchError> {
    let mut usage = Usage::default();
    for role in Role::ALL {
        usage = usage.beside(read_counted(scratch.folder(), role)?.usage);
    }
    let samples = read_samples(&samples_path(scratch.folder()))?;
    let n_sent = read_counted(scratch.folder(), Role::Source)?.n_messages;
    let n_arrived = read_counted(scratch.folder(), Role::Sink)?.n_messages;
    Ok(Round { samples, n_sent, n_lost: n_sent.saturating_sub(n_arrived), usage, own_work_ns: Vec::new() })
}

impl Relays<'_> {
    fn failed(&self, role: Role, mut what: String) -> BenchError {
        if let Some(words) = last_words(&words_path(self.scratch.folder(), role)) {
            what += &format!(" and said: {words}");
        }
        BenchError::Process { chain: self.chain, role: role.name(), what }
    }

    fn wait_until_ready(&mut self, role: Role) -> Result<(), BenchError> {
        let deadline_ns = monotonic_ns() + READY_PATIENCE.as_nanos() as i64;
        while !ready_path(self.scratch.folder(), role).exists() {
            self.look(role)?;
            if monotonic_ns() > deadline_ns {
                return Err(self.failed(role, format!("was not ready within {} s", READY_PATIENCE.as_secs())));
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Ok(())
    }

    /// Whether a process has ended well; one that has not is an error.
    fn look(&mut self, role: Role) -> Result<bool, BenchError> {
        let Some((_, child)) = self.children.iter_mut().find(|(known, _)| *known == role) else { return Ok(true) };
        match child.try_wait() {
            Ok(None) => Ok(false),
            Ok(Some(status)) if status.success() => Ok(true),
            Ok(Some(status)) => Err(self.failed(role, format!("ended with {status}"))),
            Err(error) => Err(self.failed(role, format!("could not be watched: {error}"))),
        }
    }

    fn wait_for_the_end(&mut self, plan: &Plan, stop: &AtomicBool) -> Result<(), BenchError> {
        let patience = Duration::from_secs_f64(plan.warm_up_s() + plan.round_s()) + END_PATIENCE;
        let deadline_ns = monotonic_ns() + patience.as_nanos() as i64;
        for role in Role::ALL {
            while !self.look(role)? {
                if stop.load(Ordering::Relaxed) {
                    return Err(self.failed(role, "was stopped".to_owned()));
                }
                if monotonic_ns() > deadline_ns {
                    return Err(self.failed(role, "did not end in time and was killed".to_owned()));
                }
                std::thread::sleep(LOOK_EVERY);
            }
        }
        Ok(())
    }
}

impl Drop for Relays<'_> {
    fn drop(&mut self) {
        for (_, child) in &mut self.children {
            let _ended_is_fine = child.kill();
            let _ended_is_fine = child.wait();
        }
    }
}

/// The last line that a program of its own has written, if it has written any.
fn last_words(path: &Path) -> Option<String> {
    let text = std::fs::read(path).ok()?;
    let text = String::from_utf8_lossy(&text);
    let line = text.lines().map(str::trim).rfind(|line| !line.is_empty())?;
    Some(line.chars().take(MOST_WORDS).collect())
}
