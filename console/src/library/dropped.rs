//! A measurement that a page hands over: nothing that is there is overwritten, and the page is told the name that it was given.
//!
//! What was kept of a file's columns lies beside it: where only that is left, it would be taken for another file's, so the name is not free.

use super::unwritten;
use crate::columns;
use serde::Serialize;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// Measurements that may have been handed over under one name.
const MOST_OF_A_NAME: usize = 100;

/// Where a measurement is, by name in the lab's folder.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(super) struct Taken {
    /// The name that it was given.
    pub name: String,
    /// Whether it was written now; otherwise the same bytes were there.
    pub is_new: bool,
}

/// Keeps a measurement under its name, which ends in `.csv`, or under that name with the first number that is free.
pub(super) fn take(folder: &Path, name: &str, bytes: &[u8]) -> Result<Taken, String> {
    fs::create_dir_all(folder).map_err(|error| unwritten(folder, &error))?;
    let stem = name.strip_suffix(".csv").unwrap_or(name);
    let names = (2..=MOST_OF_A_NAME).map(|n| format!("{stem}-{n}.csv"));
    for name in core::iter::once(name.to_owned()).chain(names) {
        let path = folder.join(&name);
        if holds(&path, bytes) {
            return Ok(Taken { name, is_new: false });
        }
        if columns::map_of(&path).is_some() {
            continue;
        }
        match write_new(&path, bytes) {
            Ok(()) => return Ok(Taken { name, is_new: true }),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(unwritten(folder, &error)),
        }
    }
    Err(format!("{MOST_OF_A_NAME} measurements of the name {name} are there; delete those that nobody needs."))
}

/// Whether a file has these bytes; its length is asked first.
fn holds(path: &Path, bytes: &[u8]) -> bool {
    let is_file = |about: fs::Metadata| about.is_file() && about.len() == bytes.len() as u64;
    fs::metadata(path).is_ok_and(is_file) && fs::read(path).is_ok_and(|own| own == bytes)
}

/// Writes a file where none is; one that could not be written whole is taken away again.
fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create_new(path)?;
    file.write_all(bytes).inspect_err(|_| {
        if let Err(error) = fs::remove_file(path) {
            tracing::warn!(%error, path = %path.display(), "half a measurement could not be removed");
        }
    })
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_overwritten_and_the_same_bytes_are_the_file_that_is_there() {
        let folder = std::env::temp_dir().join(format!("krait-dropped-{}", std::process::id()));
        let dropped = |name: &str, text: &str| take(&folder, name, text.as_bytes()).expect("taken");
        let taken = |name: &str, is_new| Taken { name: name.to_owned(), is_new };
        assert_eq!(dropped("run.csv", "one"), taken("run.csv", true));
        assert_eq!(dropped("run.csv", "one"), taken("run.csv", false));
        assert_eq!(dropped("run.csv", "two"), taken("run-2.csv", true));
        assert_eq!(dropped("run.csv", "2.0"), taken("run-3.csv", true), "as long, and another");
        assert_eq!(dropped("run.csv", "two"), taken("run-2.csv", false));
        assert_eq!(fs::read_to_string(folder.join("run.csv")).expect("there"), "one");
        // The mapping is of a file that has gone.
        fs::write(folder.join("old.map.toml"), "format = 1").expect("written");
        assert_eq!(dropped("old.csv", "one"), taken("old-2.csv", true));
        // With its file beside it, it is that file's.
        fs::write(folder.join("run.map.toml"), "format = 1").expect("written");
        assert_eq!(dropped("run.csv", "one"), taken("run.csv", false));
        fs::create_dir(folder.join("folder.csv")).expect("made");
        assert_eq!(dropped("folder.csv", "one"), taken("folder-2.csv", true));
        fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn what_cannot_be_written_is_said_in_one_sentence() {
        let file = std::env::temp_dir().join(format!("krait-dropped-no-folder-{}", std::process::id()));
        fs::write(&file, "a file").expect("written");
        let why = take(&file, "run.csv", b"one").expect_err("no folder");
        assert!(why.contains("could not be written: ") && why.ends_with('.'), "{why}");
        fs::remove_file(&file).expect("removed");
    }
}
