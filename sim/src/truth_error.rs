//! What can be wrong with a truth file, each in one sentence, and the search for the key that was meant.

use crate::SegmentsTruthError;
use std::path::Path;

/// A truth file was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TruthError {
    /// The file could not be read.
    #[error(
        "truth file {file} cannot be read: {source_text}; check the path, or leave it out for the built-in default snake"
    )]
    Unreadable {
        /// Its path.
        file: String,
        /// What the operating system said.
        source_text: String,
    },
    /// The text is no TOML, or a value is of the wrong kind.
    #[error("truth file {file}, line {line} cannot be understood: {message}; compare with sim/truth/default.toml")]
    NotToml {
        /// Its path.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What the parser said.
        message: String,
    },
    /// A key that the simulated snake does not have.
    #[error(
        "truth file {file} has the unknown key `{key}`, the nearest known one is `{nearest}`; correct or delete it"
    )]
    UnknownKey {
        /// Its path.
        file: String,
        /// The key as found.
        key: String,
        /// The known key most like it.
        nearest: String,
    },
    /// Another number of joints than the model has.
    #[error(
        "truth file {file} describes {found} joints, expected {expected} as in the model; give each joint one [[joint]] table, or none at all"
    )]
    OtherNumber {
        /// Its path.
        file: String,
        /// Joints in the file.
        found: usize,
        /// Joints of the model.
        expected: usize,
    },
    /// Other segments or lines than the model has.
    #[error(
        "truth file {file} describes segments of {found:?} lines, expected {expected:?} as in the model; give each segment one [[segment]] \
         table with as many azimuths_rad, or none at all"
    )]
    OtherLines {
        /// Its path.
        file: String,
        /// Lines of each segment in the file.
        found: Vec<usize>,
        /// Lines of each segment of the model.
        expected: Vec<usize>,
    },
    /// Segments that cannot be simulated.
    #[error("truth file {file}: {source}")]
    Segments {
        /// Its path.
        file: String,
        /// What is wrong.
        source: SegmentsTruthError,
    },
    /// A value outside its range.
    #[error(
        "truth file {file}: {key} is {found}, expected {low} to {high}; correct it, or delete it to use the default"
    )]
    OutOfRange {
        /// Its path.
        file: String,
        /// The key.
        key: &'static str,
        /// Smallest allowed value.
        low: f64,
        /// Largest allowed value.
        high: f64,
        /// The value found.
        found: f64,
    },
}

/// A truth file's path, as sentences name it, and its text.
pub(crate) fn file_and_text(path: &Path) -> Result<(String, String), TruthError> {
    let file = path.display().to_string();
    match krait_ipc::input::text(path, krait_ipc::input::CONFIG_BYTES) {
        Ok(text) => Ok((file, text)),
        Err(source) => Err(TruthError::Unreadable { file, source_text: source.to_string() }),
    }
}

/// Makes one sentence of a parser's error.
pub(super) fn not_toml(file: &str, text: &str, error: &toml::de::Error) -> TruthError {
    let start = error.span().map_or(0, |span| span.start).min(text.len());
    let line = 1 + text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count();
    TruthError::NotToml { file: file.to_owned(), line, message: error.message().replace('\n', ", ") }
}

/// Refuses the first key that `known` does not have, naming the one most like it.
pub(super) fn refuse_unknown_keys(
    found: &toml::Table,
    known: &toml::Table,
    prefix: &str,
    file: &str,
) -> Result<(), TruthError> {
    for (key, value) in found {
        match (known.get(key), value) {
            (None, _) => {
                let nearest = known
                    .keys()
                    .max_by(|a, b| strsim::jaro_winkler(a, key).total_cmp(&strsim::jaro_winkler(b, key)))
                    .cloned()
                    .unwrap_or_default();
                return Err(TruthError::UnknownKey {
                    file: file.to_owned(),
                    key: format!("{prefix}{key}"),
                    nearest: format!("{prefix}{nearest}"),
                });
            }
            (Some(toml::Value::Table(inner)), toml::Value::Table(table)) => {
                refuse_unknown_keys(table, inner, &format!("{prefix}{key}."), file)?;
            }
            _ => {}
        }
    }
    Ok(())
}
