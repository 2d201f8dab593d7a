//! `krait paper`: the paper's tables and figures again, beside the printed values, as text, pictures and one page.

use crate::cli::PaperArgs;
use crate::print;
use krait_paper::{Paper, default_truth, terminal};
use krait_sim::Truth;
use std::process::ExitCode;

/// Computes everything, writes the pictures and the page, prints the tables; fails if the paper's claim does not come out.
pub fn run(args: &PaperArgs) -> anyhow::Result<ExitCode> {
    let paper = Paper::compute(&match &args.truth {
        Some(file) => Truth::load(file)?,
        None => default_truth(),
    })?;
    paper.write(&args.out)?;
    if args.json {
        print::json(&paper)?;
    } else {
        print::out(&terminal(&paper, &args.out))?;
    }
    Ok(if paper.verdict.holds { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
