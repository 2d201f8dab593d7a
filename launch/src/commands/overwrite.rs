//! What a person has written or measured is not overwritten without being asked to, and no file is called what it is not.

use anyhow::bail;
use std::path::Path;

/// Endings that promise a format.
const ENDINGS: [&str; 13] =
    ["csv", "parquet", "xlsx", "xls", "ods", "json", "mat", "hdf5", "h5", "mcap", "toml", "html", "svg"];

/// Refuses to go on when a file is already there or its name promises another format, before any work is done for it; `own` is the
/// ending of what will be written.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_existing(path: &Path, own: &str, force: bool) -> anyhow::Result<()> {
    refuse_other_ending(path, own, "")?;
    if force || !path.exists() {
        return Ok(());
    }
    bail!("{} is already there; name another file, or say --force to overwrite it", path.display())
}

/// A file whose name promises another format would be opened by a program that cannot read it; `option` says how that format is had.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_other_ending(path: &Path, own: &str, option: &str) -> anyhow::Result<()> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ending == own || !ENDINGS.contains(&ending.as_str()) {
        return Ok(());
    }
    bail!("{} ends in .{ending}, and what would be written is .{own}; name a .{own} file{option}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_promises_another_format_is_refused_and_any_other_is_not() {
        let is_taken = |name: &str| refuse_other_ending(Path::new(name), "toml", "").is_ok();
        assert!(["x.toml", "x.TOML", "x", "x.model", ".toml"].into_iter().all(is_taken));
        assert!(!["x.xlsx", "x.XLSX", "x.toml.json", "runs/x.csv"].into_iter().any(is_taken));
    }
}
