//! What a page orders, as JSON, and the arguments of the command that does it. Every name is looked up in the list, never taken as a path.

use super::{COMPARED, Library};
use crate::columns;
use serde::Deserialize;
use std::path::PathBuf;

/// Longest PARAMETER=COLUMN of an order, bytes.
const MOST_OF_BY: usize = 200;

/// Most recordings with a clock of their own, and the longest text of one, bytes.
const MOST_CLOCKS: usize = 16;
const MOST_OF_CLOCK: usize = 40;

/// The option for each clock; the lab itself judges the numbers.
fn clocks(all: &[String]) -> Result<Vec<String>, String> {
    let is_numbers =
        |own: &String| own.len() <= MOST_OF_CLOCK && own.chars().all(|c| c.is_ascii_digit() || "+-.,e".contains(c));
    if all.len() > MOST_CLOCKS || !all.iter().all(is_numbers) {
        return Err(format!("At most {MOST_CLOCKS} clocks can be given, each as seconds and parts per million."));
    }
    Ok(all.iter().map(|own| format!("--clock={own}")).collect())
}

/// Most values of an effect that a page says, and the longest name of one, bytes.
const MOST_SET: usize = 16;
const MOST_OF_SET: usize = 40;

/// The option for each value; the lab itself judges the names.
fn values(all: &[(String, f64)]) -> Result<Vec<String>, String> {
    let is_name = |name: &str| {
        name.len() <= MOST_OF_SET && !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    if all.len() > MOST_SET || !all.iter().all(|(name, value)| is_name(name) && value.is_finite()) {
        return Err(format!("At most {MOST_SET} values can be given, each a name of letters and digits and a number."));
    }
    Ok(all.iter().map(|(name, value)| format!("--set={name}={value}")).collect())
}

/// What a page orders.
#[derive(Debug, Deserialize)]
#[serde(tag = "verb", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Order {
    /// How far model and measurement are apart, by the clocks of the measurements that a diagnosis found.
    Compare {
        model: String,
        data: String,
        #[serde(default)]
        clock: Vec<String>,
    },
    /// Which effect is missing; `effects` is a model whose formulas are tried too.
    Diagnose { model: String, data: String, effects: Option<String> },
    /// The chain of this console goes on with a model.
    Exchange { model: String },
    /// What the columns of a measurement stand for; `map` has what the user says of them.
    Columns { data: String, map: Vec<String> },
    /// Adds an effect and writes another model; of joints on one of them, and with a number that depends on a column: PARAMETER=COLUMN.
    /// `effects` is the model that may have it as a formula, and `set` has the values to start from.
    Add {
        model: String,
        data: String,
        effect: String,
        joint: Option<u32>,
        by: Option<String>,
        effects: Option<String>,
        #[serde(default)]
        set: Vec<(String, f64)>,
        out: String,
        #[serde(default)]
        clock: Vec<String>,
    },
    /// Fits what a model has again and writes another one.
    Fit {
        model: String,
        data: String,
        out: String,
        #[serde(default)]
        clock: Vec<String>,
    },
    /// Hides an effect; without a seed, one from the clock.
    Quiz { level: String, seed: Option<u64> },
    /// What the model leaves of a riddle.
    Look { riddle: String },
    /// Judges a guess; without one the answer is told.
    Guess { riddle: String, guess: Option<String> },
    /// How the lab finds what a riddle hides.
    Solve { riddle: String },
    /// Whether a recording can be repeated byte for byte.
    Verify { data: String },
    /// Two recordings side by side, a chain of each, counted from 1.
    CompareRecordings { a: String, b: String, pass_a: u32, pass_b: u32 },
}

impl Order {
    /// The command that does it, or why there is none.
    pub(super) fn arguments(&self, library: &Library) -> Result<Vec<String>, String> {
        let text = |path: PathBuf| path.to_string_lossy().into_owned();
        let lab = |verb: &str, model: &str, data: &str| -> Result<Vec<String>, String> {
            let (model, data) = (text(library.model(model)?), library.data(data)?);
            let map = columns::map_of(&data);
            let data = text(data);
            let report = text(library.folder.join(format!("{verb}.html")));
            let words = ["lab", verb, "--json", "--model", &model, "--data", &data, "--report", &report];
            let map = map.into_iter().flat_map(|map| ["--map-file".to_owned(), text(map)]);
            Ok(words.map(str::to_owned).into_iter().chain(map).collect())
        };
        let recording = |name: &str| {
            library
                .recordings
                .path_of(name)
                .map(text)
                .ok_or_else(|| format!("There is no recording {name:?} in the list."))
        };
        match self {
            Self::Compare { model, data, clock } => {
                let mut arguments = lab("compare", model, data)?;
                arguments.push("--curves".to_owned());
                arguments.extend(clocks(clock)?);
                Ok(arguments)
            }
            Self::Columns { data, map } => columns::propose(&library.table(data)?, map),
            Self::Diagnose { model, data, effects } => {
                let mut arguments = lab("diagnose", model, data)?;
                arguments.extend(library.effects(effects.as_deref())?);
                Ok(arguments)
            }
            Self::Add { model, data, effect, joint, by, effects, set, out, clock } => {
                let is_effect =
                    effect.len() <= 60 && effect.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
                if !is_effect || effect.starts_with('-') || effect.is_empty() {
                    return Err("An effect's name has letters, digits and hyphens only.".to_owned());
                }
                let out = library.new_model(out)?;
                let mut arguments = lab("add", model, data)?;
                arguments.insert(2, effect.clone());
                arguments.extend(joint.map(|joint| format!("--set=joint={joint}")));
                arguments.extend(library.effects(effects.as_deref())?);
                arguments.extend(values(set)?);
                if let Some(by) = by {
                    if by.len() > MOST_OF_BY || by.chars().any(char::is_control) {
                        return Err("A column's name is one line of at most 200 bytes.".to_owned());
                    }
                    arguments.push(format!("--by={by}"));
                }
                arguments.extend(clocks(clock)?);
                arguments.extend(["--out".to_owned(), text(out)]);
                Ok(arguments)
            }
            Self::Fit { model, data, out, clock } => {
                let out = library.new_model(out)?;
                let mut arguments = lab("fit", model, data)?;
                arguments.extend(clocks(clock)?);
                arguments.extend(["--out".to_owned(), text(out)]);
                Ok(arguments)
            }
            Self::Exchange { model } => {
                let words =
                    ["model", "exchange", &text(library.model(model)?), "--instance", &library.instance, "--json"];
                Ok(words.map(str::to_owned).to_vec())
            }
            Self::Quiz { level, seed } => library.riddles.ask(level, *seed),
            Self::Look { riddle } => library.riddles.look(riddle),
            Self::Guess { riddle, guess } => library.riddles.check(riddle, guess.as_deref()),
            Self::Solve { riddle } => library.riddles.solve(riddle),
            Self::Verify { data } => Ok(vec!["verify".to_owned(), recording(data)?, "--json".to_owned()]),
            Self::CompareRecordings { a, b, pass_a, pass_b } => {
                let (a, b, out) = (recording(a)?, recording(b)?, text(library.folder.join(COMPARED)));
                let (pass_a, pass_b) = (pass_a.to_string(), pass_b.to_string());
                let words = ["compare", &a, &b, "--pass-a", &pass_a, "--pass-b", &pass_b, "--out", &out, "--json"];
                Ok(words.map(str::to_owned).to_vec())
            }
        }
    }
}
