//! `krait lab`: one file for each verb.

mod add;
mod benchmark;
mod compare;
mod diagnose;
mod generate;
mod history;
mod init;
mod next;
mod page;
mod quiz;
mod shell;
mod stages;

use crate::cli_lab::LabVerb;
use std::process::ExitCode;

/// Runs a verb of the lab.
pub fn run(verb: &LabVerb) -> anyhow::Result<ExitCode> {
    match verb {
        LabVerb::Init(args) => init::run(args),
        LabVerb::Compare(args) => compare::run(args),
        LabVerb::Diagnose(args) => diagnose::run(args),
        LabVerb::Add(args) => add::run(args),
        LabVerb::Fit(args) => add::refit(args),
        LabVerb::History(args) => history::run(args),
        LabVerb::Generate(args) => generate::run(args),
        LabVerb::Quiz(args) => quiz::ask(args),
        LabVerb::Check(args) => quiz::check(args),
        LabVerb::Benchmark(args) => benchmark::run(args),
    }
}
