//! Figures on standard output: as tables for people, as JSON for programs.

use crate::evidence::Figures;
use crate::report::{PassReport, Quantiles, SCORED_FROM_S};
use crate::table::Table;
use anyhow::Context;
use std::io::{Write, stdout};

/// Prints figures as one JSON object.
///
/// # Errors
/// Standard output that cannot be written, unless its reader has simply gone.
pub fn json<T: serde::Serialize>(figures: &T) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(figures).context("the figures could not be written as JSON")?;
    out(&format!("{text}\n"))
}

/// Prints figures as tables, and what to try next.
///
/// # Errors
/// As [`json`].
pub fn figures(figures: &Figures, next: &str) -> anyhow::Result<()> {
    let mut text = String::new();
    text += &format!(
        "Tracking error, degrees (measured shape against setpoint, from {SCORED_FROM_S:.0} s after the first motion on)\n"
    );
    text += &passes(&figures.passes).to_string();
    text += "\nLatency, microseconds (each hop ends when the next stage has published)\n";
    text += &latency(figures).to_string();
    let samples = &figures.samples;
    text += &format!("\nSamples: {} sent, {} received, {} lost\n", samples.sent, samples.received, samples.lost);
    let whole =
        if figures.recording_is_whole { "" } else { " (it stops before the run's end; what it holds is readable)" };
    text += &format!("Recording: {}{whole}\nNext: {next}\n", figures.recording.display());
    out(&text)
}

/// Writes to standard output; a reader that has gone (`krait ... | head`) is no error.
///
/// # Errors
/// Any other failure of standard output.
pub fn out(text: &str) -> anyhow::Result<()> {
    let written = stdout().lock().write_all(text.as_bytes());
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(error).context("standard output could not be written")
        }
        _ => Ok(()),
    }
}

fn passes(passes: &[PassReport]) -> Table {
    let mut table = Table::new(&[
        "compensation",
        "rms",
        "p95",
        "max",
        "bend rms",
        "plane rms",
        "plane max",
        "peak commanded",
        "reached",
        "eta",
        "lambda mm",
    ]);
    for pass in passes {
        let mut cells = vec![pass.compensation.to_owned()];
        let values = [
            pass.error_deg.rms,
            pass.error_deg.p95,
            pass.error_deg.max,
            pass.bend_error_deg.rms,
            pass.plane_error_deg.rms,
            pass.plane_error_deg.max,
        ];
        cells.extend(values.map(|value| format!("{value:.2}")));
        cells.extend([pass.peak_bend_deg.commanded, pass.peak_bend_deg.reached].map(|value| format!("{value:.1}")));
        cells.extend([format!("{:.3}", pass.eta), format!("{:.4}", pass.lambda_mm)]);
        table.row(cells);
    }
    table
}

fn latency(figures: &Figures) -> Table {
    let mut table = Table::new(&["hop", "p50", "p99", "p99.9", "max"]);
    let mut row = |name: String, q: &Quantiles| {
        let mut cells = vec![name];
        cells.extend([q.p50, q.p99, q.p999, q.max].map(|value| format!("{value:.0}")));
        table.row(cells);
    };
    for hop in &figures.latency_us.hops {
        row(format!("{} -> {}", hop.from, hop.to), &hop.quantiles);
    }
    row("device -> drive, end to end".to_owned(), &figures.latency_us.end_to_end);
    table
}
