//! `krait experiment`: the paper's experiments on a chain that runs, and the same tables and pictures from the recording.

use crate::cli::Common;
use crate::cli_experiment::{ExperimentArgs, ExperimentVerb, TurnProtocol};
use crate::experiment::{Settings, ask, outcome_of, refuse_other, run_passes};
use crate::{print, signals};
use krait_paper::experiment::{self, Part, Protocol};
use std::path::Path;
use std::process::ExitCode;

/// Runs an experiment, or reads the recording of one; exit code 1 if a pose of it is missing.
pub fn run(common: &Common, verb: &ExperimentVerb) -> anyhow::Result<ExitCode> {
    match verb {
        ExperimentVerb::Fig10(args) => {
            run_one(common, &args.run, Protocol::fig_10(args.step, args.to, args.run.before())?)
        }
        ExperimentVerb::Fig11(args) => {
            let parts: &[Part] = match args.protocol {
                TurnProtocol::Turn => &[Part::Turn],
                TurnProtocol::FromStraight => &[Part::FromStraight],
                TurnProtocol::Both => &[Part::Turn, Part::FromStraight],
            };
            run_one(common, &args.run, Protocol::fig_11(args.bend, parts, args.step, args.run.before())?)
        }
        ExperimentVerb::Poses(args) => {
            run_one(common, &args.run, Protocol::poses(args.poses.as_deref(), args.run.before())?)
        }
    }
}

fn run_one(common: &Common, args: &ExperimentArgs, protocol: Protocol) -> anyhow::Result<ExitCode> {
    if let Some(path) = &args.from {
        refuse_other(path, protocol.figure)?;
        return show(path, args);
    }
    let settings = Settings::of(common, args, protocol)?;
    let stop = signals::stop_flag()?;
    ask(&settings, args.engage)?;
    run_passes(&common.instance, &settings, &stop)?;
    let code = show(&settings.recording, args)?;
    if !args.json {
        print::out(&format!("Recording: {}\n", settings.recording.display()))?;
    }
    Ok(code)
}

/// Everything that is shown comes out of the recording.
fn show(path: &Path, args: &ExperimentArgs) -> anyhow::Result<ExitCode> {
    let (outcome, snake) = outcome_of(path)?;
    experiment::write(&outcome, &snake, &args.out)?;
    if args.json {
        print::json(&outcome)?;
    } else {
        print::out(&experiment::terminal(&outcome, &args.out))?;
    }
    Ok(if outcome.is_complete() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
