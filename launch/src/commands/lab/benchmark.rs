//! `krait lab benchmark`: the lab on a grid of generated data, with a table, a page and every result as a line.

use crate::cli_lab_data::{BenchmarkArgs, BenchmarkMachine};
use crate::print;
use anyhow::Context;
use krait_lab_benchmark::benchmark::{
    Options, Outcome, Rate, Summary, force_grid, grid, joint_grid, page, run as work, segments_grid,
};
use krait_report::Table;
use std::process::ExitCode;

/// Works, prints, writes the page.
pub fn run(args: &BenchmarkArgs) -> anyhow::Result<ExitCode> {
    let options = Options { seed: args.seed, seconds: args.seconds, with_baselines: !args.no_baselines };
    let mut cells = match args.machine {
        BenchmarkMachine::Snake => grid(args.seed, usize::from(args.rounds), args.seconds),
        BenchmarkMachine::Joints => joint_grid(args.seed, usize::from(args.rounds), args.seconds),
        BenchmarkMachine::Force => force_grid(args.seed, usize::from(args.rounds), args.seconds),
        BenchmarkMachine::Segments => segments_grid(args.seed, usize::from(args.rounds), args.seconds),
    };
    cells.retain(|cell| args.groups.is_empty() || args.groups.contains(&cell.group));
    let outcomes = work(&options, &cells, &args.out.join("results.jsonl"), progress)?;
    let summary = Summary::new(&outcomes);
    let about = format!(
        "{} sets of {} s, seed {}, krait {}.",
        summary.n_cells,
        args.seconds,
        args.seed,
        env!("CARGO_PKG_VERSION")
    );
    let report = args.out.join("report.html");
    std::fs::write(&report, page(&summary, &outcomes, &about))
        .with_context(|| format!("the report {} could not be written", report.display()))?;
    if args.json {
        print::json(&summary)?;
    } else {
        print::out(&format!("{}\nReport: {}\n", text(&summary), report.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

#[allow(clippy::print_stderr)]
fn progress(n_done: usize, n_cells: usize, outcome: &Outcome) {
    let said = match (&outcome.said, &outcome.refused) {
        (Some(said), _) => format!("{} {}", said.verdict, said.named.join(" + ")),
        (None, reason) => reason.clone().unwrap_or_default(),
    };
    eprintln!("{n_done}/{n_cells} {}: {said}", outcome.id);
}

fn text(summary: &Summary) -> String {
    let mut table = Table::new(&["what", "share", "95 % interval", "cells"]);
    let alarms = summary.false_alarms.get("all").copied().unwrap_or_else(|| Rate::new(0, 0));
    let rows = [
        ("nothing hidden: an effect claimed", alarms),
        ("one effect: first name right", summary.top_1),
        ("one effect: a look-alike of it right", summary.in_class),
        ("one effect: one of the three best right", summary.top_3),
        ("one effect: claimed and right", summary.claimed_right),
        ("one effect: claimed and wrong", summary.claimed_wrong),
        ("one effect: a second one added", summary.extras),
        ("one effect: exactly this one", summary.single_exact),
        ("two effects: exactly these", summary.pairs_exact),
        ("three to five: exactly these", summary.several_exact),
        ("three to five: recall", summary.several_recall),
        ("three to five: precision", summary.several_precision),
        ("known beside unknown: named, and partly", summary.beside_right),
        ("known beside unknown: a wrong one named", summary.beside_wrong),
        ("outside the library: an effect asserted", summary.outside_asserted),
        ("outside the library: an effect claimed", summary.outside_claimed),
        ("geometry off 5 % and free: exactly", summary.off_base_exact),
        ("geometry off 5 % and free: a look-alike", summary.off_base_in_class),
        ("one-way ramp: honest", summary.poor_honest),
        ("intervals that hold the truth", summary.coverage),
    ];
    for (what, rate) in rows.into_iter().filter(|(_, rate)| rate.of > 0) {
        table.row(vec![
            what.to_owned(),
            format!("{:.1} %", 100.0 * rate.rate),
            format!("{:.1} to {:.1} %", 100.0 * rate.low, 100.0 * rate.high),
            format!("{} of {}", rate.n, rate.of),
        ]);
    }
    let mut text = table.to_string();
    text += &format!(
        "  held-out error over the noise: median {:.3}, 90th percentile {:.3}; true effect fitted {:.3}; without names {:.3}\n",
        summary.over_floor_median,
        summary.over_floor_p90,
        summary.oracle_over_floor_median,
        summary.generic_over_floor_median
    );
    let mut table = Table::new(&["baseline", "false alarms", "first name right", "pairs exact"]);
    for (name, rates) in &summary.baselines {
        let mut cells = vec![name.clone()];
        cells.extend(rates.iter().map(|rate| format!("{:.1} %", 100.0 * rate.rate)));
        table.row(cells);
    }
    text += &format!("\n{table}");
    for (id, reason) in &summary.refused {
        text += &format!("  no result: {id}: {reason}\n");
    }
    text
}
