//! Nothing moves by itself: an experiment asks, or was told on the command line; with real drives it always asks.

use super::Settings;
use anyhow::{Context, bail};
use std::io::{BufRead, Read, Write, stderr, stdin};

/// Longest answer that is read, bytes.
const ANSWER_BYTES: u64 = 80;

/// Asks whether the machine may move, unless that was said and it is simulated.
///
/// # Errors
/// One sentence: nobody said yes.
pub fn ask(settings: &Settings, engage: bool) -> anyhow::Result<()> {
    if engage && !settings.is_real {
        return Ok(());
    }
    let drives = if settings.is_real { "REAL drives" } else { "the simulated snake" };
    let largest_deg = settings.protocol.poses.iter().map(|pose| pose.bend_deg).fold(0.0, f64::max);
    let question = format!(
        "This homes and moves {drives}, {} times, through {} poses of up to {largest_deg:.0} deg each time.\nType yes to go on, anything else to leave it:\n",
        settings.passes.len(),
        settings.protocol.poses.len(),
    );
    stderr().lock().write_all(question.as_bytes()).context("the question could not be shown")?;
    let mut answer = String::new();
    let read = stdin().lock().take(ANSWER_BYTES).read_line(&mut answer);
    if read.is_ok() && answer.trim() == "yes" {
        return Ok(());
    }
    let how = if settings.is_real { "answer yes" } else { "answer yes, or add --engage" };
    bail!("nothing was moved, because an experiment moves the machine only when it is told to; {how}")
}
