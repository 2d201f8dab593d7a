//! Writes the lab's pages, with the command line that made them at their foot.

use super::shell::quoted;
use crate::commands::overwrite::{refuse_foreign, write_whole};
use anyhow::Context;
use krait_lab::LabError;
use krait_lab::report::PageOrigin;
use krait_lab::report::page::BEGINS;
use std::path::Path;

/// Refuses, before any work, a place where something else than an earlier page is.
///
/// # Errors
/// One sentence that names the file.
pub(super) fn refuse_place(path: Option<&Path>) -> anyhow::Result<()> {
    refuse_foreign(path, "html", BEGINS)
}

/// Makes a page and writes it.
pub(super) fn write(path: &Path, page: impl FnOnce(PageOrigin) -> Result<String, LabError>) -> anyhow::Result<()> {
    let command = command(std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()));
    let text = page(PageOrigin { command: &command, version: env!("CARGO_PKG_VERSION") })?;
    write_whole(path, text).with_context(|| {
        format!(
            "the report {} could not be written; check that its directory exists and may be written",
            path.display()
        )
    })
}

/// The words as a shell takes them, whatever path the program was started by.
fn command(words: impl Iterator<Item = String>) -> String {
    core::iter::once("krait".to_owned()).chain(words.map(|word| quoted(&word))).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::command;

    #[test]
    fn the_command_can_be_pasted_into_a_shell() {
        let words = ["lab", "compare", "--data", "it's mine.csv", ""].map(str::to_owned);
        assert_eq!(command(words.into_iter()), "krait lab compare --data 'it'\\''s mine.csv' ''");
    }
}
