//! The files of generated data: the data for the lab, the base model, and the answer, apart, with a hash that proves it unmodified.

use super::{Answer, Generated};
use krait_model::model_file::{Machine, ModelFile, SnakeMachine};
use sha2::{Digest, Sha256};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Where everything was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Sealed {
    /// The data, CSV.
    pub data: PathBuf,
    /// The base model, TOML.
    pub model: PathBuf,
    /// The answer, JSON.
    pub answer: PathBuf,
    /// Hashes of data and answer, in the format of `sha256sum`.
    pub hashes: PathBuf,
    /// SHA-256 of the answer.
    pub answer_sha256: String,
    /// SHA-256 of the data.
    pub data_sha256: String,
}

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{} cannot be written: {source}; choose another place", file.display())]
pub struct SealError {
    /// Which.
    pub file: PathBuf,
    /// Why.
    pub source: io::Error,
}

impl<T> Generated<T> {
    /// Writes DATA.csv, beside it base.toml and DATA.sha256, and the answer where it is wanted, by default DATA.answer.json.
    ///
    /// # Errors
    /// [`SealError`] for the first file that cannot be written.
    pub fn seal(mut self, data: &Path, answer: Option<&Path>) -> Result<Sealed, SealError> {
        let answer = answer.map_or_else(|| data.with_extension("answer.json"), Path::to_owned);
        let model = data.with_file_name("base.toml");
        let hashes = data.with_extension("sha256");
        self.answer.file = name_of(data);
        let (csv, text) = (self.csv(), self.answer.to_json());
        let (data_sha256, answer_sha256) = (hash(&csv), hash(&text));
        let lines = format!("{data_sha256}  {}\n{answer_sha256}  {}\n", name_of(data), name_of(&answer));
        for (file, text) in [(data, &csv), (&model, &self.model), (&answer, &text), (&hashes, &lines)] {
            fs::write(file, text).map_err(|source| SealError { file: file.to_owned(), source })?;
        }
        Ok(Sealed { data: data.to_owned(), model, answer, hashes, answer_sha256, data_sha256 })
    }
}

impl Answer {
    /// The answer's file: a list of one, as for many data sets together.
    pub fn to_json(&self) -> String {
        // A structure of text and numbers always has a form in JSON.
        serde_json::to_string_pretty(&[self]).unwrap_or_default() + "\n"
    }

    /// The answer in a file that [`Answer::to_json`] made.
    ///
    /// # Errors
    /// What is wrong with the text, and where.
    pub fn from_json(text: &str) -> Result<Self, serde_json::Error> {
        let [answer]: [Self; 1] = serde_json::from_str(text)?;
        Ok(answer)
    }
}

/// Whether a list of hashes, in the format of `sha256sum`, has those of both texts.
pub fn is_unmodified(hashes: &str, texts: [&str; 2]) -> bool {
    texts.into_iter().all(|text| {
        let own = hash(text);
        hashes.lines().any(|line| line.split_whitespace().next() == Some(own.as_str()))
    })
}

/// The base model's file: elastic lines alone.
pub fn base_model() -> String {
    ModelFile::new(Machine::Snake(SnakeMachine::default()), Vec::new(), Vec::new())
        .map_or_else(|_refused| String::new(), |file| file.to_toml())
}

fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn hash(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}
