//! Figures on standard output: as tables for people, as JSON for programs.

use crate::budget::BudgetReport;
use crate::evidence::Figures;
use anyhow::Context;
use krait_report::{LearntReport, PassReport, Quantiles, SCORED_FROM_S, Spread, TOO_SHORT, Table};
use std::io::{Write, stdout};

/// Prints figures as one JSON object.
///
/// # Errors
/// Standard output that cannot be written, unless its reader has simply gone.
pub fn json<T: serde::Serialize>(figures: &T) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(figures).context("the figures could not be written as JSON")?;
    out(&format!("{text}\n"))
}

/// "1 row", "2 rows".
pub fn counted(n: u64, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}

/// Prints figures as tables, and what to try next.
///
/// # Errors
/// As [`json`].
pub fn figures(figures: &Figures, next: &str) -> anyhow::Result<()> {
    let mut text = String::new();
    let unit = figures.passes.iter().find_map(|pass| pass.joints.as_ref()).map_or("degrees", |joints| joints.unit);
    text += &format!(
        "Tracking error, {unit} (measured shape against setpoint, from {SCORED_FROM_S:.0} s after the first motion on)\n"
    );
    let (joints, snakes): (Vec<_>, Vec<_>) = figures.passes.iter().partition(|pass| pass.peak_bend_deg.is_none());
    if !snakes.is_empty() {
        text += &passes(&snakes).to_string();
    }
    if !joints.is_empty() {
        text += &joint_passes(&joints).to_string();
    }
    figures.passes.iter().for_each(|pass| text += &jaw_line(pass));
    if figures.passes.iter().any(|pass| match &pass.joints {
        Some(joints) => joints.error.is_none(),
        None => pass.tracking.error_deg.is_none(),
    }) {
        text += &format!("  No tracking error where there is a dash: {TOO_SHORT} after the first motion\n");
    }
    text += &learnt(&figures.passes);
    text += &changes(figures);
    text += "\nLatency, microseconds (each hop ends when the next stage has published)\n";
    text += &latency(figures).to_string();
    text += &figures.budget.as_ref().map(BudgetReport::text).unwrap_or_default();
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

/// A text in lines of at most so many letters.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        if let Some(line) = lines.last_mut()
            && (line.is_empty() || line.len() + 1 + word.len() <= width)
        {
            line.push_str(if line.is_empty() { "" } else { " " });
            line.push_str(word);
            continue;
        }
        lines.push(word.to_owned());
    }
    lines
}

/// A text in lines of 80 columns.
pub fn lines(text: &str) -> String {
    wrapped(text, 80).iter().map(|line| format!("{line}\n")).collect()
}

/// A text as a paragraph of 80 columns that stands two further in.
pub fn paragraph(text: &str) -> String {
    wrapped(text, 78).iter().map(|line| format!("  {line}\n")).collect()
}

/// Error of the bend angle, of the bending plane, and of both together.
fn passes(passes: &[&PassReport]) -> Table {
    let mut table = Table::new(&[
        "compensation",
        "bend rms",
        "p95",
        "max",
        "plane rms",
        "p95",
        "max",
        "both rms",
        "p95",
        "max",
        "peak commanded",
        "reached",
    ]);
    for pass in passes {
        let mut cells = vec![pass.compensation.to_owned()];
        let score = &pass.tracking;
        for spread in [score.bend_error_deg, score.plane_error_deg, score.error_deg] {
            cells.extend(match spread {
                Some(spread) => [spread.rms, spread.p95, spread.max].map(|value| format!("{value:.2}")),
                None => ["-"; 3].map(str::to_owned),
            });
        }
        let peak = pass.peak_bend_deg.unwrap_or_default();
        cells.push(format!("{:.1}", peak.commanded));
        cells.push(peak.reached.map_or("-".to_owned(), |value| format!("{value:.1}")));
        table.row(cells);
    }
    table
}

/// How the jaw of a gripper followed, where there is one.
fn jaw_line(pass: &PassReport) -> String {
    let Some(jaw) = pass.jaw.as_ref().and_then(|score| score.joints.first()) else { return String::new() };
    let error = jaw.error.map_or("no error: too little motion".to_owned(), |error| {
        format!("{:.2} rms, {:.2} p95, {:.2} max", error.rms, error.p95, error.max)
    });
    let PassReport { compensation, .. } = pass;
    format!(
        "  jaw, {compensation}: {error}; widest {:.1} commanded, {:.1} reached\n",
        jaw.peak_commanded, jaw.peak_reached
    )
}

/// Error of each joint or segment, and of all together.
fn joint_passes(passes: &[&PassReport]) -> Table {
    let each = passes.iter().find_map(|pass| pass.joints.as_ref()).map_or("joint", |score| score.each);
    let mut table = Table::new(&["compensation", each, "rms", "p95", "max", "peak commanded", "reached"]);
    let numbers = |spread: Option<Spread>| match spread {
        Some(spread) => [spread.rms, spread.p95, spread.max].map(|value| format!("{value:.2}")),
        None => ["-"; 3].map(str::to_owned),
    };
    for pass in passes {
        let Some(score) = &pass.joints else { continue };
        for (idx, joint) in score.joints.iter().enumerate() {
            let mut cells = vec![pass.compensation.clone(), format!("{}", idx + 1)];
            cells.extend(numbers(joint.error));
            cells.extend([joint.peak_commanded, joint.peak_reached].map(|value| format!("{value:.1}")));
            table.row(cells);
        }
        let mut cells = vec![pass.compensation.clone(), "all".to_owned()];
        cells.extend(numbers(score.error));
        cells.extend(["", ""].map(str::to_owned));
        table.row(cells);
    }
    table
}

/// What the estimator has learnt, where a pass learnt anything.
fn learnt(passes: &[PassReport]) -> String {
    let learning = passes.iter().filter(|pass| !pass.learnt.is_empty());
    let sentence = |pass: &PassReport| {
        let all: Vec<String> = pass.learnt.iter().map(LearntReport::sentence).collect();
        format!("  Learnt while moving ({}): {}\n", pass.compensation, all.join("; "))
    };
    learning.map(sentence).collect()
}

/// What the estimator's watch saw; it proposes to look, and adds nothing to any model.
fn changes(figures: &Figures) -> String {
    let mut text = String::new();
    for pass in &figures.passes {
        let Some(first) = pass.changes.first() else { continue };
        let more = match pass.changes.len() {
            1 => String::new(),
            n => format!(" (and {} more)", n - 1),
        };
        let of = first.segment.map_or(String::new(), |segment| format!("in segment {segment} "));
        let next = "record 60 s of motion and run `krait lab diagnose --model MODEL --data FILE`";
        text += &format!(
            "  Something changed {of}at t = {:.1} s{more}: {}, and the model no longer explains the camera as it did.\n  \
             Nothing was added to the model; {next}\n",
            first.at_s, first.looks_like
        );
    }
    text
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
