//! The console beside a chain: whatever becomes of it, the chain goes on; and it ends with the chain.

use super::{Supervisor, ending};
use crate::cli_console::FoxgloveArgs;
use crate::commands::console::NAME;
use crate::config::Config;
use anyhow::Context;
use std::path::Path;
use std::process::Stdio;

impl Supervisor {
    /// Starts the console of this instance. Where standard output is for JSON, its address goes to standard error.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start_console(&mut self, config: &Config, viewers: &FoxgloveArgs, is_json: bool) -> anyhow::Result<()> {
        let mut command = self.command_of(NAME, config)?;
        command.args(viewers.words());
        if is_json {
            command.stdout(Stdio::from(std::io::stderr()));
        }
        if let Some(folder) = config.record.path.as_deref().and_then(Path::parent) {
            command.arg("--recordings").arg(folder);
        }
        self.console = Some(command.spawn().context("the console could not be started")?);
        Ok(())
    }

    /// Says once that the console has ended; nothing else depends on it.
    pub(super) fn look_at_console(&mut self) {
        let Some(child) = &mut self.console else { return };
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
        let Some(mut child) = self.console.take() else { return true };
        ending::ask(NAME, &child);
        if let Some(status) = ending::wait(|| child.try_wait()) {
            return status.success();
        }
        self.n_forced += 1;
        ending::kill(NAME, &mut child)
    }
}
