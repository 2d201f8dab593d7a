//! `krait doctor`: what this machine lacks for a punctual chain, and how late it wakes a process.

use crate::cli::DoctorArgs;
use crate::doctor::{self, Finding, Grade, WakeUp};
use crate::{print, signals};
use anyhow::bail;
use krait_report::Table;
use serde::Serialize;
use std::process::ExitCode;

/// Priority of the second measurement, where it is granted.
const PRIORITY: u8 = 80;

/// What `--json` prints.
#[derive(Serialize)]
struct Report {
    findings: Vec<Finding>,
    wake_up: Vec<WakeUp>,
}

/// Looks, measures, prints; exit code 1 if something keeps a chain from running.
pub fn run(args: &DoctorArgs) -> anyhow::Result<ExitCode> {
    if !(0.0..=3600.0).contains(&args.seconds) {
        bail!("--seconds {}: expected 0 (do not measure) to 3600", args.seconds);
    }
    let stop = signals::stop_flag()?;
    let findings = doctor::look();
    let mut wake_up = Vec::new();
    if args.seconds > 0.0 {
        say(args.seconds);
        wake_up = doctor::measure_wake_up(args.seconds / 2.0, 0, &stop);
        wake_up.extend(
            doctor::measure_wake_up(args.seconds / 2.0, PRIORITY, &stop).into_iter().filter(|w| w.priority > 0),
        );
    }
    let report = Report { findings, wake_up };
    if args.json {
        print::json(&report)?
    } else {
        print::out(&text(&report))?
    }
    let is_bad = report.findings.iter().any(|finding| finding.verdict == Grade::Bad);
    Ok(if is_bad { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn text(report: &Report) -> String {
    let mut text = String::new();
    for finding in &report.findings {
        text += &format!("{:<7}{}: {}\n", finding.verdict.word(), finding.name, finding.found);
        text += &format!("       {}\n", finding.meaning);
        if let Some(mend) = &finding.mend {
            text += &format!("       mend: {mend}\n");
        }
    }
    if !report.wake_up.is_empty() {
        text += "\nLateness of a wake-up at 1 kHz, microseconds\n";
        text += &wake_up_table(&report.wake_up).to_string();
        text +=
            "A chain of three hops wakes three processes for each sample: `krait bench` measures what that takes.\n";
    }
    text
}

fn wake_up_table(wake_up: &[WakeUp]) -> Table {
    let mut table = Table::new(&["core", "scheduling", "p50", "p99", "p99.9", "max", "wake-ups"]);
    for core in wake_up {
        let scheduling = if core.priority > 0 { format!("FIFO {}", core.priority) } else { "time sharing".to_owned() };
        let mut cells = vec![core.core.to_string(), scheduling];
        let q = &core.late_us;
        cells.extend([q.p50, q.p99, q.p999, q.max].map(|us| format!("{us:.1}")));
        cells.push(core.n_samples.to_string());
        table.row(cells);
    }
    table
}

#[allow(clippy::print_stderr)]
fn say(seconds: f64) {
    eprintln!("krait doctor: measuring wake-ups for {seconds} s");
}
