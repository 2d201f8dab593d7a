//! The `krait` command: one binary, one file per subcommand; each process of the chain is a subcommand too.

mod antagonists;
mod authority;
mod budget;
mod chain_round;
mod cli;
mod cli_bench;
mod cli_calibrate;
mod cli_console;
mod cli_devices;
mod cli_drives;
mod cli_experiment;
mod cli_guide;
mod cli_lab;
mod cli_lab_data;
mod cli_machine;
mod cli_model;
mod cli_process;
mod cli_replay;
mod cli_run;
mod commands;
mod config;
mod device;
mod doctor;
mod evidence;
mod experiment;
mod fault;
mod giving_way;
mod in_force;
mod led_chain;
mod log;
mod old_settings;
mod print;
mod progress;
mod real_drives;
mod recorded;
mod replay_orders;
mod replay_setup;
mod signals;
mod silence;
mod supervisor;
mod terminal;

use anyhow::Context;
use clap::Parser;
use cli::{Cli, Verb};
use commands::overwrite::refuse_other_ending;
use krait_ipc::clock;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Exit code for work that could not be done; 1 is for work that was done and found a failure.
const COULD_NOT_RUN: u8 = 2;

fn main() -> ExitCode {
    giving_way::if_asked();
    let cli = Cli::parse();
    let _until_the_end = log::start();
    let done = signals::survive_full_files().and_then(|()| run(cli));
    match done {
        Ok(code) => code,
        Err(error) => {
            if !error.is::<supervisor::AlreadyTold>() {
                complain(&error);
            }
            ExitCode::from(COULD_NOT_RUN)
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<ExitCode> {
    match cli.verb.unwrap_or_default() {
        Verb::Demo(args) => commands::demo::run(&cli.common, &args),
        Verb::Run(args) => commands::run::run(&cli.common, &args),
        Verb::Devices(args) => commands::devices::run(&cli.common, &args),
        Verb::Drives(args) => commands::drives::run(&cli.common, &args),
        Verb::Paper(args) => commands::paper::run(&args),
        Verb::Experiment(verb) => commands::experiment::run(&cli.common, &verb),
        Verb::Verify(args) => commands::verify::run(&cli.common, &args),
        Verb::State(args) => commands::state::run(&cli.common, &args),
        Verb::Stop => commands::stop::run(&cli.common),
        Verb::Shape(args) => commands::shape::run(&cli.common, &args),
        Verb::Mark(args) => commands::mark::run(&cli.common, &args),
        Verb::Recover(args) => commands::recover::run(&args),
        Verb::Export(args) => commands::export::run(&args),
        Verb::Calibrate(verb) => commands::calibrate::run(&cli.common, &verb),
        Verb::Lab(verb) => commands::lab::run(&verb),
        Verb::Compare(args) => commands::compare::run(&args),
        Verb::Replay(args) => commands::replay::run(&cli.common, &args),
        Verb::Model(verb) => commands::model::run(&cli.common, &verb),
        Verb::Fault(args) => commands::fault::run(&cli.common, &args),
        Verb::Doctor(args) => commands::doctor::run(&args),
        Verb::Bench(args) => commands::bench::run(&cli.common, &args),
        Verb::Yardstick(part) => commands::yardstick::run(&cli.common, &part),
        Verb::Console(args) => commands::console::run(&cli.common, &args),
        Verb::Watch(args) => commands::watch::run(&cli.common, &args),
        Verb::Config => commands::config::run(&cli.common),
        Verb::Process(process) => commands::process::run(&cli.common, &process),
    }
}

/// One sentence on standard error: what was being done, then each cause that it does not name already.
#[allow(clippy::print_stderr)]
fn complain(error: &anyhow::Error) {
    let mut sentence = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !sentence.contains(&cause) {
            sentence += if sentence.is_empty() { "" } else { ": " };
            sentence += &cause;
        }
    }
    eprintln!("krait: {sentence}");
}

/// The path of a recording: as given, or by date in `recordings/`; absolute, because the recorder is another process.
fn recording_path(given: Option<&Path>, what: &str) -> anyhow::Result<PathBuf> {
    let path = match given {
        Some(path) => path.to_owned(),
        None => {
            let (now, pid) = (krait_record::utc_text(clock::wall_ns()), std::process::id());
            Path::new("recordings").join(format!("{now}-{what}-{pid}.mcap"))
        }
    };
    refuse_other_ending(&path, "mcap", "")?;
    anyhow::ensure!(
        !path.exists(),
        "{} exists already and a recording never overwrites one; move it away or choose another path",
        path.display()
    );
    std::path::absolute(&path).with_context(|| format!("recording {}", path.display()))
}
