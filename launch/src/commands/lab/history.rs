//! `krait lab history`: the error after each effect that was added to a model.

use super::page;
use crate::cli_lab::HistoryArgs;
use crate::print;
use krait_lab::open_model;
use krait_lab::report::history_page;
use krait_model::model_file::HistoryEntry;
use krait_report::Table;
use serde_json::{Value, json};
use std::process::ExitCode;

/// Prints a model's history.
pub fn run(args: &HistoryArgs) -> anyhow::Result<ExitCode> {
    page::refuse_place(args.report.as_deref())?;
    let file = open_model(&args.model)?;
    if let Some(path) = &args.report {
        let model = args.model.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        page::write(path, |origin| Ok(history_page(&file, &model, origin)))?;
    }
    if args.json {
        print::json(&file.history().iter().map(answer).collect::<Vec<Value>>())?;
    } else if file.history().is_empty() {
        print::out(&format!("{}: no effect was added yet; krait lab add does\n", args.model.display()))?;
    } else {
        print::out(&table(file.history()).to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn answer(entry: &HistoryEntry) -> Value {
    let rms = entry.heldout_rms;
    let errors = json!({ "before": rms.before, "after": rms.after, "noise_floor": rms.noise_floor });
    json!({
        "effect": entry.effect, "data": entry.data, "data_sha256": entry.data_sha256, "date": entry.date,
        "heldout_rms": errors, "heldout_rms_deg": (entry.unit == "deg").then_some(&errors), "unit": entry.unit,
    })
}

/// A bar as long as the error, the longest 30 characters.
fn table(history: &[HistoryEntry]) -> Table {
    let longest = history.iter().map(|entry| entry.heldout_rms.before).fold(0.0, f64::max).max(1e-12);
    let bar = |rms: f64| "#".repeat((30.0 * rms / longest).round() as usize);
    let unit = history.first().map_or("deg", |entry| entry.unit.as_str());
    let mut table = Table::new(&["effect", &format!("before ({unit})"), "after", "noise floor", "data", "day", ""]);
    for entry in history {
        let rms = entry.heldout_rms;
        table.row(vec![
            entry.effect.clone(),
            format!("{:.4}", rms.before),
            format!("{:.4}", rms.after),
            rms.noise_floor.map_or("-".to_owned(), |floor| format!("{floor:.4}")),
            entry.data.clone(),
            entry.date.clone().unwrap_or_default(),
            format!("{:<30}", bar(rms.after)),
        ]);
    }
    table
}
