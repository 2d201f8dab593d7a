//! A file that says which column of a log stands for which of the lab's, so that it need not be said with every command.

use super::column_map::NONE;
use super::unit::Unit;
use super::{ColumnMap, Mapping, ReadError};
use krait_ipc::input;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

const FORMAT: u32 = 1;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MapFile {
    format: u32,
    /// Columns that are taken out.
    #[serde(default)]
    none: Vec<String>,
    columns: BTreeMap<String, Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    column: String,
    unit: Option<String>,
    wraps: Option<f64>,
}

impl ColumnMap {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// [`ReadError::MapFile`], one sentence with file and line.
    pub fn from_file(path: &Path) -> Result<Self, ReadError> {
        let wrong = |line: Option<usize>, reason: String| ReadError::MapFile {
            path: path.to_owned(),
            line: line.map_or(String::new(), |line| format!(" line {line}")),
            reason,
        };
        let text = input::text(path, input::CONFIG_BYTES).map_err(|error| wrong(None, error.to_string()))?;
        let file: MapFile = toml::from_str(&text).map_err(|error| {
            let before = error.span().and_then(|span| text.get(..span.start));
            wrong(before.map(|text| text.matches('\n').count() + 1), error.message().replace('\n', " "))
        })?;
        if file.format != FORMAT {
            return Err(wrong(None, format!("format {} is not known, expected {FORMAT}", file.format)));
        }
        let mapping = |(target, entry): (String, Entry)| {
            let unit = entry.unit.map(|unit| {
                let known = Unit::from_suffix(&unit);
                known.ok_or_else(|| wrong(None, format!("unit {unit:?} of {target} is not known")))
            });
            if let Some(turn) = entry.wraps.filter(|turn| !(turn.is_finite() && *turn > 0.0)) {
                return Err(wrong(None, format!("wraps = {turn} of {target} is no turn: it is above 0")));
            }
            Ok(Mapping { unit: unit.transpose()?, target, source: entry.column, wraps: entry.wraps })
        };
        if file.columns.contains_key(NONE) {
            return Err(wrong(
                None,
                "none is no column of the lab; write none = [\"NAME\"] above [columns]".to_owned(),
            ));
        }
        let out = file.none.into_iter().map(|source| Ok(Mapping::new(NONE.to_owned(), &source, None, None)));
        file.columns.into_iter().map(mapping).chain(out).collect()
    }

    /// The text of a mapping file; `about` says of which data.
    pub fn to_toml(&self, about: &str) -> String {
        let mut text = format!("# Which column of {} stands for which of the lab's.\n", one_line(about));
        let _to_text = writeln!(text, "format = {FORMAT}");
        let (out, used): (Vec<_>, Vec<_>) = self.mappings.iter().partition(|own| own.takes_out());
        if !out.is_empty() {
            let names = out.iter().map(|own| toml::Value::String(own.source.clone()).to_string()).collect::<Vec<_>>();
            let _to_text = writeln!(text, "none = [{}]", names.join(", "));
        }
        text += "\n[columns]\n";
        for Mapping { target, source, unit, wraps } in used {
            let unit = unit.map_or(String::new(), |unit| format!(", unit = \"{}\"", unit.suffix));
            let wraps = wraps.map_or(String::new(), |turn| format!(", wraps = {turn:?}"));
            // A value of TOML writes its own quotes.
            let source = toml::Value::String(source.clone());
            let _to_text = writeln!(text, "{target} = {{ column = {source}{unit}{wraps} }}");
        }
        text
    }

    /// The same with others in place of its own for the same columns of the lab, or of the file where they are taken out.
    #[must_use]
    pub fn overridden(mut self, others: Self) -> Self {
        let is_same = |own: &Mapping, other: &Mapping| {
            let takes_out = own.takes_out() || other.takes_out();
            if takes_out { own.source == other.source } else { own.target == other.target }
        };
        self.mappings.retain(|own| !others.mappings.iter().any(|other| is_same(own, other)));
        self.mappings.extend(others.mappings);
        self
    }
}

fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}
