//! `krait recover FILE`: a whole file of what a killed recorder or a damaged disk has left, and what was saved.

use crate::cli::RecoverArgs;
use crate::commands::overwrite::refuse_other_ending;
use crate::print;
use anyhow::{Context, bail};
use krait_record::{Recording, recover, utc_text};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What was saved, in the shape of `--json`.
#[derive(Debug, Serialize)]
struct Saved {
    /// The new file; null where the old one is whole and none was asked for.
    out: Option<PathBuf>,
    messages: BTreeMap<String, u64>,
    span_s: f64,
    first_utc: String,
    bytes: u64,
    bytes_dropped: u64,
    /// What is missing, a sentence each.
    missing: Vec<String>,
}

/// Writes the new file and tells what is in it.
pub fn run(args: &RecoverArgs) -> anyhow::Result<ExitCode> {
    args.out.as_deref().map_or(Ok(()), |out| refuse_other_ending(out, "mcap", ""))?;
    let is_whole = Recording::open(&args.recording)?.contents().missing.is_empty();
    if is_whole && args.out.is_none() {
        return whole(args);
    }
    let out = args.out.clone().unwrap_or_else(|| beside(&args.recording));
    let recovered = recover(&args.recording, &out)?;
    if recovered.messages.is_empty() {
        std::fs::remove_file(&out).with_context(|| format!("the empty {} could not be removed", out.display()))?;
        bail!(
            "{}: none of its {} bytes is a whole message, so that nothing can be saved; look for another copy",
            args.recording.display(),
            recovered.n_bytes
        );
    }
    let saved = Saved {
        out: Some(out),
        span_s: recovered.last_log_ns.saturating_sub(recovered.first_log_ns) as f64 / 1e9,
        first_utc: utc_text(recovered.first_log_ns.cast_signed()),
        messages: recovered.messages,
        bytes: recovered.n_bytes,
        bytes_dropped: recovered.n_bytes_dropped,
        missing: recovered.missing.iter().map(ToString::to_string).collect(),
    };
    if args.json {
        print::json(&saved)?
    } else {
        print::out(&saved.text())?
    }
    Ok(ExitCode::SUCCESS)
}

fn whole(args: &RecoverArgs) -> anyhow::Result<ExitCode> {
    if args.json {
        print::json(&serde_json::json!({ "out": null, "missing": [] }))?;
    } else {
        print::out(&format!("{} is whole; there is nothing to recover\n", args.recording.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// `run.recovered.mcap` beside `run.mcap`.
fn beside(path: &Path) -> PathBuf {
    path.with_extension("recovered.mcap")
}

impl Saved {
    fn text(&self) -> String {
        let n_messages: u64 = self.messages.values().sum();
        let mut text = format!(
            "{}: {n_messages} messages over {:.3} s from {}; {} of {} bytes could not be read\n",
            self.out.as_deref().unwrap_or(Path::new("")).display(),
            self.span_s,
            self.first_utc,
            self.bytes_dropped,
            self.bytes
        );
        for (topic, n_messages) in &self.messages {
            text += &format!("  {topic:<30} {n_messages:>9}\n");
        }
        for sentence in &self.missing {
            text += &format!("  lost: {sentence}\n");
        }
        text
    }
}
