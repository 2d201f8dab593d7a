//! A procedure's CSV: every reading is on the disk before the next is asked for, and a command that ended goes on from it.

use crate::CalibrateError;
use krait_ipc::input;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Most bytes of a table of readings: more than a day of typing.
pub(crate) const MOST_BYTES: u64 = 64 << 20;

/// An open file of readings.
#[derive(Debug)]
pub struct ReadingLog {
    path: PathBuf,
    file: File,
    empty: bool,
}

impl ReadingLog {
    /// Opens or makes a file and reads what it holds.
    ///
    /// A last line without its end was cut off when the machine stopped: the file is kept beside it with the ending `.cut`, and
    /// the half line is left out.
    ///
    /// # Errors
    /// [`CalibrateError::File`]; [`CalibrateError::Row`] for a row that is no reading, by its number.
    pub fn open<T: DeserializeOwned>(path: &Path) -> Result<(Self, Vec<T>), CalibrateError> {
        let failed = |what| move |e: std::io::Error| file_error(path, what, &e);
        let text = match input::text(path, MOST_BYTES) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            read => read.map_err(failed("read"))?,
        };
        let file = OpenOptions::new().append(true).create(true).open(path).map_err(failed("opened"))?;
        let whole = text.rfind('\n').map_or(0, |at| at + 1);
        if whole < text.len() {
            std::fs::write(path.with_extension("csv.cut"), &text).map_err(failed("kept beside the cut one"))?;
            file.set_len(whole as u64).map_err(failed("shortened to its last whole line"))?;
        }
        let rows = rows(path, &text[..whole])?;
        Ok((Self { path: path.to_owned(), file, empty: whole == 0 }, rows))
    }

    /// Adds a reading; it is on the disk when this returns.
    ///
    /// # Errors
    /// [`CalibrateError::File`].
    pub fn add<T: Serialize>(&mut self, reading: &T) -> Result<(), CalibrateError> {
        let mut writer = csv::WriterBuilder::new().has_headers(self.empty).from_writer(Vec::new());
        let refused = |e: &dyn core::fmt::Display| CalibrateError::File {
            file: self.path.display().to_string(),
            what: "written",
            reason: e.to_string(),
        };
        writer.serialize(reading).map_err(|e| refused(&e))?;
        let line = writer.into_inner().map_err(|e| refused(&e))?;
        self.file.write_all(&line).and_then(|()| self.file.sync_data()).map_err(|e| refused(&e))?;
        self.empty = false;
        Ok(())
    }

    /// The file's name.
    pub fn name(&self) -> String {
        self.path
            .file_name()
            .map_or_else(|| self.path.display().to_string(), |name| name.to_string_lossy().into_owned())
    }
}

/// Every row of a CSV's text.
pub fn rows<T: DeserializeOwned>(path: &Path, text: &str) -> Result<Vec<T>, CalibrateError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let mut found = Vec::new();
    for (k, row) in reader.deserialize().enumerate() {
        found.push(row.map_err(|e: csv::Error| CalibrateError::Row {
            file: path.display().to_string(),
            row: k + 2,
            reason: reason(&e),
        })?);
    }
    Ok(found)
}

/// What is wrong with a row, without the library's own place in the file.
fn reason(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Deserialize { err, .. } => err.to_string(),
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("it has {len} columns, expected {expected_len}")
        }
        _ => error.to_string(),
    }
}

/// A file that the system refuses.
pub fn file_error(path: &Path, what: &'static str, error: &std::io::Error) -> CalibrateError {
    CalibrateError::File { file: path.display().to_string(), what, reason: error.to_string() }
}
