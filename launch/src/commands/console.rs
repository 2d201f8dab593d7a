//! `krait console`: the page of a chain that runs, as a process of its own.

use crate::cli::Common;
use crate::cli_console::ConsoleArgs;
use crate::config::Config;
use crate::in_force::ModelInForce;
use crate::{print, signals, supervisor};
use anyhow::Context;
use krait_console::{Allowance, Facts, Settings};
use krait_ipc::Bus;
use krait_master::Presence;
use rustix::process::{Pid, Signal, kill_process};

use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::SystemTime;

/// Its name among the members of an instance; it is no part of a chain, and a chain may start beside it.
pub const NAME: &str = "console";

/// Serves the page until Ctrl-C.
pub fn run(common: &Common, args: &ConsoleArgs) -> anyhow::Result<ExitCode> {
    let stop = signals::stop_flag()?;
    if let Ok(pid) = std::env::var(supervisor::SUPERVISOR_PID) {
        signals::end_with(pid.parse().with_context(|| format!("{} is {pid:?}", supervisor::SUPERVISOR_PID))?)?;
    }
    let config = Config::load(common.config.as_deref())?;
    let bus = Bus::open(&common.instance, NAME)?;
    let path = bus.instance().folder().join("config.toml");
    let model = config.model()?;
    let mut chain = ChainConfig { instance: common.instance.clone(), path, seen: None, config, model };
    let announce = |address: &krait_console::Address| {
        if let Err(error) = print::out(&format!("Console: {}\n", address.page)) {
            tracing::warn!(%error, "the console's address could not be printed");
        }
    };
    krait_console::run(bus, Settings { port: args.port }, move || chain.facts(), announce, &stop)?;
    Ok(ExitCode::SUCCESS)
}

/// The console beside a chain: whatever becomes of it, the chain goes on, and it ends with the chain.
pub struct Companion(Child);

impl Companion {
    /// Starts the console of an instance as a process of its own.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start(instance: &str) -> anyhow::Result<Self> {
        let program = std::env::current_exe().context("the krait program could not find itself")?;
        let mut command = Command::new(program);
        command.args([NAME, "--instance", instance]).stdin(Stdio::null()).process_group(0);
        command.env(supervisor::SUPERVISOR_PID, std::process::id().to_string());
        Ok(Self(command.spawn().context("the console could not be started")?))
    }
}

impl Drop for Companion {
    fn drop(&mut self) {
        let asked = Pid::from_raw(self.0.id().cast_signed()).map(|pid| kill_process(pid, Signal::TERM));
        if let Some(Err(error)) = asked {
            tracing::debug!(%error, "the console had already ended");
        }
        if let Err(error) = self.0.wait() {
            tracing::warn!(%error, "the console could not be waited for");
        }
    }
}

/// The configuration that a chain in this instance runs with: its supervisor leaves it in the instance's folder.
struct ChainConfig {
    instance: String,
    path: PathBuf,
    seen: Option<SystemTime>,
    config: Config,
    model: ModelInForce,
}

impl ChainConfig {
    fn facts(&mut self) -> Facts {
        let changed = std::fs::metadata(&self.path).and_then(|metadata| metadata.modified()).ok();
        if changed.is_some() && changed != self.seen {
            self.seen = changed;
            match Config::load(Some(&self.path)).and_then(|config| Ok((config.model()?, config))) {
                Ok((model, config)) => (self.model, self.config) = (model, config),
                Err(error) => {
                    tracing::warn!(%error, "the chain's configuration could not be read; the page keeps the one before")
                }
            }
        }
        facts_of(&self.instance, &self.config, &self.model)
    }
}

fn facts_of(instance: &str, config: &Config, model: &ModelInForce) -> Facts {
    let allowance =
        |a: crate::budget::Allowance| Allowance { p50_us: a.p50_us, p99_us: a.p99_us, worst_us: a.worst_us };
    let budget = &config.budget;
    Facts {
        instance: instance.to_owned(),
        is_simulated: true,
        l_m: model.chain.machine().l_m,
        r_m: model.chain.machine().r_m,
        max_bend_rad: config.resolve.max_bend_rad,
        max_stroke_m: config.compensate.max_stroke_m,
        max_load_n: config.compensate.max_load_n,
        view_roll_rad: config.resolve.view_roll_rad,
        compensation: model.label.to_owned(),
        presence_hint: presence_hint(config.master.presence),
        recording: config.record.path.as_ref().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned())),
        budgets: budget.hops().into_iter().chain([budget.end_to_end]).map(allowance).collect(),
    }
}

fn presence_hint(presence: Presence) -> String {
    let button = |n: u8| match n {
        0 => "the left button".to_owned(),
        1 => "the right button".to_owned(),
        n => format!("button {}", n + 1),
    };
    match presence {
        Presence::Hold(n) => format!("Hold {} to follow.", button(n)),
        Presence::Toggle(n) => format!("Press {} to follow.", button(n)),
    }
}
