//! A chain that a command line has started, with a console beside it, for faults of its supervisor and of that console.

use crate::commands::{TOOLS, console};
use crate::config::Config;
use crate::supervisor::{Cast, own_program};
use anyhow::{Context, bail};
use core::time::Duration;
use krait_ipc::{Bus, clock};
use rustix::process::{Pid, Signal, kill_process};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// A chain that is not whole by then will not be, ns: a busy machine.
const STARTS_WITHIN_NS: i64 = 60_000_000_000;
/// A chain that was asked to end has done so by then, ns; what hangs in it is killed by its supervisor long before.
const ENDS_WITHIN_NS: i64 = 60_000_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// `krait run --console` on a bus that its observer keeps; it ends with this.
pub struct CommandLine {
    child: Child,
    n_processes: usize,
}

impl CommandLine {
    /// Starts it with a configuration and a script that engages once, and waits until all of it is there.
    ///
    /// # Errors
    /// One sentence: it could not be started, or it is not whole in time.
    pub fn start(bus: &Bus, config: &Config, script: &Path, folder: &Path) -> anyhow::Result<Self> {
        let file = folder.join("krait.toml");
        std::fs::write(&file, config.to_toml()?).with_context(|| format!("{} could not be written", file.display()))?;
        let recording = config.record.path.as_deref().context("a scene records")?;
        let mut command = Command::new(own_program()?);
        command.args(["run", "--engage", "--console", "--instance", bus.instance().as_str(), "--master", "script"]);
        let paths = [("--input", script), ("--recording", recording), ("--config", &file)];
        command.args(paths.into_iter().flat_map(|(name, path)| [OsStr::new(name), path.as_os_str()]));
        command.stdin(Stdio::null()).stdout(Stdio::null());
        let child = command.spawn().context("a chain could not be started")?;
        // The stages, the supervisor and the console.
        let mut chain = Self { child, n_processes: Cast::live().processes.len() + 3 };
        let give_up_ns = clock::monotonic_ns() + STARTS_WITHIN_NS;
        while chain.pids(bus).len() < chain.n_processes {
            if chain.child.try_wait()?.is_some() || clock::monotonic_ns() > give_up_ns {
                bail!("the chain of the command line is not whole: {:?}", bus.members());
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Ok(chain)
    }

    /// Its supervisor.
    pub fn launch_pid(&self) -> u32 {
        self.child.id()
    }

    /// Its console.
    ///
    /// # Errors
    /// It does not run.
    pub fn console_pid(&self, bus: &Bus) -> anyhow::Result<u32> {
        let found = self.pids(bus).into_iter().find(|(name, _)| name == console::NAME);
        found.map(|(_, pid)| pid).context("the console does not run")
    }

    /// Whether none of its processes is left.
    pub fn is_gone(&self, bus: &Bus) -> bool {
        self.pids(bus).is_empty()
    }

    /// Whether all of it is there, or all but the console.
    pub fn is_whole(&self, bus: &Bus, with_console: bool) -> bool {
        self.pids(bus).len() + usize::from(!with_console) >= self.n_processes
    }

    /// Everybody in the instance but its observer.
    fn pids(&self, bus: &Bus) -> Vec<(String, u32)> {
        let is_of_it = |(name, pid): &(String, u32)| {
            *pid != std::process::id() && (name == console::NAME || !TOOLS.contains(&name.as_str()))
        };
        bus.members().into_iter().filter(is_of_it).collect()
    }

    /// Asks it to end as Ctrl-C does, and waits for that.
    ///
    /// # Errors
    /// It does not end.
    pub fn end(&mut self) -> anyhow::Result<()> {
        let told = Pid::from_raw(self.child.id().cast_signed()).map(|pid| kill_process(pid, Signal::INT));
        if let Some(Err(error)) = told {
            tracing::debug!(%error, "the chain had already ended");
        }
        let give_up_ns = clock::monotonic_ns() + ENDS_WITHIN_NS;
        while self.child.try_wait()?.is_none() {
            if clock::monotonic_ns() > give_up_ns {
                bail!("the chain of the command line does not end");
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Ok(())
    }
}

impl Drop for CommandLine {
    fn drop(&mut self) {
        if let Err(error) = self.end() {
            tracing::error!("{error:#}; it is killed");
            let _gone_is_fine = self.child.kill();
            let _no_zombie = self.child.wait();
        }
    }
}
