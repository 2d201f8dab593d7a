//! The end of a chain: every process is asked in order, waited for, and killed where it does not go.

use super::{END_PATIENCE, LOOK_EVERY, Loss, Supervisor, effective};
use krait_ipc::{Process, clock};
use rustix::process::{Pid, Signal, kill_process};
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};

impl Supervisor {
    /// Ends the chain, the recorder excepted; what does not end in time is killed. Returns whether all ended by themselves.
    pub fn end_chain(&mut self) -> bool {
        self.comes_back = None;
        let mut all_clean = true;
        for process in Process::END_ORDER.into_iter().filter(|process| *process != Process::Record) {
            all_clean &= self.end_one(process);
        }
        all_clean
    }

    /// Ends everything. Returns whether all ended by themselves.
    pub fn end(&mut self) -> bool {
        let (chain, console) = (self.end_chain(), self.end_console());
        effective::remove(&self.bus);
        self.end_one(Process::Record) && chain && console
    }

    pub(super) fn end_one(&mut self, process: Process) -> bool {
        let Some(position) = self.children.iter().position(|running| running.process == process && !running.ended)
        else {
            return true;
        };
        let running = &mut self.children[position];
        running.ended = true;
        // Whoever looked last may have been held up since.
        if let Ok(Some(status)) = running.child.try_wait() {
            let (pid, loss) = (running.child.id(), process.loss());
            tracing::error!("process `{process}` (pid {pid}) had ended before it was asked to: {status}; {loss}");
            self.losses.push(Loss { process, at_ns: clock::monotonic_ns() });
            return false;
        }
        ask(process.name(), &running.child);
        let ended = wait(|| {
            if let Err(error) = self.take_messages() {
                tracing::warn!(%error, "the last messages of a process were not taken");
            }
            self.children[position].child.try_wait()
        });
        let child = &mut self.children[position].child;
        let Some(status) = ended else {
            self.n_forced += 1;
            return kill(process.name(), child);
        };
        // Killed before it was asked, and so deep in the disk that it has died only now.
        if status.signal().is_some() {
            let (pid, loss) = (child.id(), process.loss());
            tracing::error!("process `{process}` (pid {pid}) did not end by itself: {status}; {loss}");
        }
        status.success()
    }
}

/// Asks a process to end.
pub(super) fn ask(name: &str, child: &Child) {
    let asked = Pid::from_raw(child.id().cast_signed()).map(|pid| kill_process(pid, Signal::TERM));
    if let Some(Err(error)) = asked {
        tracing::warn!(process = name, %error, "could not be asked to end");
    }
}

/// Looks again and again whether a process that was asked has ended; nothing where it has not in time.
pub(super) fn wait(mut look: impl FnMut() -> io::Result<Option<ExitStatus>>) -> Option<ExitStatus> {
    let deadline_ns = clock::monotonic_ns() + END_PATIENCE.as_nanos() as i64;
    loop {
        match look() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if clock::monotonic_ns() < deadline_ns => std::thread::sleep(LOOK_EVERY),
            Ok(None) | Err(_) => return None,
        }
    }
}

/// Ends a process by force, which is no clean end.
pub(super) fn kill(name: &str, child: &mut Child) -> bool {
    tracing::error!(process = name, "did not end in time and was killed");
    if let Err(error) = child.kill().and_then(|()| child.wait()) {
        tracing::error!(process = name, %error, "could not be killed");
    }
    false
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        self.end();
    }
}
