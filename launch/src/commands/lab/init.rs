//! `krait lab init`: what a file of measurements holds, and a mapping and a model to begin with.

use super::shell::shell;
use crate::COULD_NOT_RUN;
use crate::cli_lab::InitArgs;
use crate::commands::overwrite::{refuse_existing, refuse_same, write_whole};
use crate::print;
use anyhow::Context;
use krait_lab::init::{InitError, Proposal, SeenColumn, columns, propose};
use krait_lab::read::ColumnMap;
use krait_report::Table;
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;

/// Characters that a name, a unit and a reason may take, so that a row stays within 80.
const NAME: usize = 18;
const UNIT: usize = 5;
const WHY: usize = 18;

/// Looks, proposes, writes both files, and says what comes next.
pub fn run(args: &InitArgs) -> anyhow::Result<ExitCode> {
    let beside =
        |given: &Option<PathBuf>, ending: &str| given.clone().unwrap_or_else(|| args.data.with_extension(ending));
    let (map, model) = (beside(&args.map_out, "map.toml"), beside(&args.model_out, "model.toml"));
    refuse_same(&[("the measurements", &args.data), ("--map-out", &map), ("--model-out", &model)])?;
    for file in [&map, &model] {
        refuse_existing(file, "toml", args.force)?;
    }
    let given: ColumnMap = args.map.iter().cloned().collect();
    let found = match propose(&args.data, &given) {
        Ok(found) => found,
        Err(error) => return refused(args, error),
    };
    let name = args.data.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    for (file, text) in [(&map, &found.map.to_toml(&name)), (&model, &found.model)] {
        write_whole(file, text)
            .with_context(|| format!("{} could not be written; choose another place", file.display()))?;
    }
    let next =
        format!("krait lab diagnose --model {} --data {} --map-file {}", shell(&model), shell(&args.data), shell(&map));
    if args.json {
        let columns: Vec<_> = found.columns.iter().map(column).collect();
        print::json(&json!({
            "data": args.data, "map": map, "model": model, "next": next, "kind": found.kind, "dialect": found.dialect,
            "rows": found.rows, "scored_rows": found.scored_rows, "duration_s": found.seconds, "rate_hz": found.rate_hz,
            "pairs": found.pairs, "cautions": found.cautions, "columns": columns,
        }))?;
    } else {
        print::out(&text(&found, &name))?;
        print::out(&format!("Wrote {} and {}\nNext: {next}\n", map.display(), model.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// With `--json` the columns come with the sentence, so that whoever asked can name them.
fn refused(args: &InitArgs, error: InitError) -> anyhow::Result<ExitCode> {
    match columns(&args.data) {
        Ok(seen) if args.json => {
            let seen: Vec<_> = seen.iter().map(column).collect();
            print::json(&json!({ "data": args.data, "refused": error.to_string(), "columns": seen }))?;
            Ok(ExitCode::from(COULD_NOT_RUN))
        }
        _ => Err(error.into()),
    }
}

fn column(seen: &SeenColumn) -> serde_json::Value {
    let (least, largest) = seen.range.unzip();
    json!({
        "name": seen.name, "is": seen.stands_for, "unit": seen.unit, "least": least, "largest": largest, "why": seen.why,
    })
}

fn text(found: &Proposal, name: &str) -> String {
    // Angle and force go through one filter as they are read, and rows are thinned to what it lets through.
    let (kept, uncounted) = match found.kind {
        "force" => {
            (" are left by the filter that angle and force share", "near a reversal or at rest, which do not count")
        }
        _ => ("", "without a measurement"),
    };
    let unscored = match found.rows - found.scored_rows {
        0 => String::new(),
        n => format!(", {n} of them {uncounted}"),
    };
    let why = |text: &str| format!("{:<WHY$}", cut(text, WHY));
    let mut table = Table::new(&["column", "is", "unit", "least", "largest", &why("why")]);
    for seen in &found.columns {
        let (least, largest) = seen.range.unzip();
        table.row(vec![
            cut(&seen.name, NAME),
            seen.stands_for.clone().unwrap_or_else(|| "not used".to_owned()),
            cut(&seen.unit, UNIT),
            least.map_or(String::new(), number),
            largest.map_or(String::new(), number),
            why(&seen.why),
        ]);
    }
    let mut text = format!(
        "{name}: {} rows{kept}{unscored}\n{:.1} s at {:.4} rows a second; {}\n{table}Machine: {}\n",
        found.rows, found.seconds, found.rate_hz, found.dialect, found.machine
    );
    if !found.is_whole {
        text += "  (ranges are those of the first rows; every row was read)\n";
    }
    found.pairs.iter().for_each(|pair| text += &format!("  {pair}\n"));
    found.cautions.iter().for_each(|caution| text += &format!("Caution: {caution}\n"));
    text
}

/// At most so many characters, none of which moves a terminal's cursor.
pub(super) fn cut(text: &str, most: usize) -> String {
    let plain = text.replace(char::is_control, "?");
    if plain.chars().count() <= most {
        return plain;
    }
    plain.chars().take(most - 1).chain(['~']).collect()
}

/// Four digits or so in at most eight characters.
fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if size > 0.0 && !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        _ if size >= 1000.0 => format!("{value:.0}"),
        _ if size >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.4}"),
    }
}
