//! The console beside a chain: whatever becomes of it, the chain goes on; and it ends with the chain.

use super::{LOOK_EVERY, SUPERVISOR_PID, Supervisor, ending, in_memory};
use crate::cli_console::FoxgloveArgs;
use crate::commands::console::NAME;
use crate::config::{Config, STANDARD_INPUT};
use anyhow::Context;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// The console's process, until it has ended.
pub(super) struct Companion(Child);

impl Supervisor {
    /// Starts the console of this instance. Where standard output is for JSON, its address goes to standard error.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start_console(&mut self, config: &Config, viewers: &FoxgloveArgs, is_json: bool) -> anyhow::Result<()> {
        let program = std::env::current_exe().context("the krait program could not find itself")?;
        let mut command = Command::new(program);
        command.args([NAME, "--instance", &self.instance, "--config", STANDARD_INPUT]).args(viewers.words());
        command.stdin(in_memory(config)?).process_group(0);
        if is_json {
            command.stdout(Stdio::from(std::io::stderr()));
        }
        if let Some(folder) = config.record.path.as_deref().and_then(Path::parent) {
            command.arg("--recordings").arg(folder);
        }
        command.env(SUPERVISOR_PID, std::process::id().to_string());
        self.console = Some(Companion(command.spawn().context("the console could not be started")?));
        Ok(())
    }

    /// Says once that the console has ended; nothing else depends on it.
    pub(super) fn look_at_console(&mut self) {
        let Some(Companion(child)) = &mut self.console else { return };
        let pid = child.id();
        if let Ok(Some(status)) = child.try_wait() {
            tracing::error!(
                "process `{NAME}` (pid {pid}) ended: {status}; the motion goes on, and `krait console` opens another page"
            );
            self.console = None;
            self.n_consoles_lost += 1;
        }
    }

    /// Ends the console; one that does not go is killed. Returns whether it ended by itself.
    pub(super) fn end_console(&mut self) -> bool {
        self.look_at_console();
        let Some(Companion(mut child)) = self.console.take() else { return true };
        ending::ask(NAME, &child);
        let deadline_ns = ending::deadline_ns();
        loop {
            match child.try_wait() {
                Ok(Some(status)) => return status.success(),
                Ok(None) if krait_ipc::clock::monotonic_ns() < deadline_ns => std::thread::sleep(LOOK_EVERY),
                Ok(None) | Err(_) => {
                    self.n_forced += 1;
                    return ending::kill(NAME, &mut child);
                }
            }
        }
    }
}
