//! `krait verify FILE`: does recorded input still give the same setpoints and commands, bit for bit?

use crate::cli::VerifyArgs;
use crate::print;
use crate::verify::{Verdict, verify};
use std::process::ExitCode;

/// Repeats every step of a recording and says whether all came out the same, or shows the first that did not.
pub fn run(args: &VerifyArgs) -> anyhow::Result<ExitCode> {
    let verdict = verify(&args.recording)?;
    if args.json {
        print::json(&verdict)?;
    } else {
        print::out(&sentence(&verdict))?;
    }
    Ok(if verdict.first_difference.is_none() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn sentence(verdict: &Verdict) -> String {
    let Verdict { passes, setpoints_identical, commands_identical, recorded_with, verified_with, first_difference } =
        verdict;
    let counts = format!("{setpoints_identical} setpoints and {commands_identical} commands in {passes} passes");
    match first_difference {
        None => format!("identical: {counts} came out bit for bit as they were recorded\n"),
        Some(d) => format!(
            "different: after {counts}, `{}` gives another {} in its output {} of pass {}: recorded {}, now {} \
             (recorded with krait {recorded_with}, verified with krait {verified_with})\n",
            d.process, d.field, d.sequence, d.pass, d.recorded, d.repeated
        ),
    }
}
