//! What a person has written or measured is not overwritten without being asked to, and no file is called what it is not.

use anyhow::{Context, bail};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Endings that promise a format.
const ENDINGS: [&str; 14] =
    ["csv", "parquet", "xlsx", "xls", "ods", "json", "mat", "hdf5", "h5", "mcap", "toml", "html", "svg", "pdf"];

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

/// Refuses a place for what is written anew whenever it is asked for, without `--force`: another ending, or a file that is there and does
/// not begin like what krait writes, and so is somebody's.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_foreign(path: Option<&Path>, own: &str, begins: &str) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    refuse_other_ending(path, own, "")?;
    if !path.is_file() {
        return Ok(());
    }
    let mut start = Vec::new();
    let read = fs::File::open(path)
        .and_then(|file| io::Read::read_to_end(&mut io::Read::take(file, begins.len() as u64), &mut start));
    read.with_context(|| path.display().to_string())?;
    if start == begins.as_bytes() {
        return Ok(());
    }
    bail!("{} is already there and is not what an earlier call has written there; name another file", path.display())
}

/// Refuses one file for two things: what is written second would take the place of the first, or of what was read.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_same(files: &[(&str, &Path)]) -> anyhow::Result<()> {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_nowhere| path.to_owned());
    let place = |path: &Path| fs::canonicalize(path).unwrap_or_else(|_not_there| absolute(path));
    for (k, (name, path)) in files.iter().enumerate() {
        if let Some((other, _)) = files.iter().take(k).find(|(_, other)| place(other) == place(path)) {
            bail!("{} is named as {other} and as {name}; name two files", path.display());
        }
    }
    Ok(())
}

/// Writes a file whole or not at all: beside it first, so that a full disk leaves what was there. What is no file, a pipe, is written to.
///
/// # Errors
/// What the system says.
pub fn write_whole(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    let before = fs::metadata(path).ok();
    if before.as_ref().is_some_and(|found| !found.is_file()) {
        return fs::write(path, content);
    }
    // What a link leads to takes its place, not the link.
    let path = if before.is_some() { fs::canonicalize(path)? } else { path.to_owned() };
    let beside = beside(&path);
    let mut file = fs::File::create_new(&beside)?;
    let written = file
        .write_all(content.as_ref())
        .and_then(|()| before.map_or(Ok(()), |before| file.set_permissions(before.permissions())))
        .and_then(|()| file.sync_all())
        .and_then(|()| fs::rename(&beside, &path));
    if written.is_err()
        && let Err(error) = fs::remove_file(&beside)
    {
        tracing::warn!(path = %beside.display(), %error, "a half-written file could not be removed");
    }
    written
}

/// A name beside a file that no other process of this machine takes at the same time.
fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.new", std::process::id()));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_written_whole_or_stays_as_it_was() {
        let folder = std::env::temp_dir().join(format!("krait-overwrite-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let (path, link) = (folder.join("a.csv"), folder.join("link.csv"));
        write_whole(&path, "first").unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_whole(&link, "second").unwrap();
        assert!(link.is_symlink() && fs::read_to_string(&path).unwrap() == "second");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 2, "nothing is left beside it");
        // Where the new one cannot be begun, the old one stands, and what was in the way.
        fs::write(beside(&path), "in the way").unwrap();
        assert!(write_whole(&path, "third").is_err() && fs::read_to_string(&path).unwrap() == "second");
        assert_eq!(fs::read_to_string(beside(&path)).unwrap(), "in the way");

        let said = refuse_same(&[("--in", &path), ("--out", &link)]).unwrap_err().to_string();
        assert!(said.ends_with("is named as --in and as --out; name two files"), "{said}");
        refuse_same(&[("--in", &path), ("--out", &folder.join("b.csv"))]).unwrap();
        assert!(refuse_foreign(Some(&path), "csv", "time_s,").unwrap_err().to_string().contains("is already there"));
        refuse_foreign(Some(&path), "csv", "sec").unwrap();
        refuse_foreign(Some(&folder.join("none.csv")), "csv", "time_s,").unwrap();
        assert!(refuse_foreign(Some(&path), "html", "sec").is_err());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_name_that_promises_another_format_is_refused_and_any_other_is_not() {
        let is_taken = |name: &str| refuse_other_ending(Path::new(name), "toml", "").is_ok();
        assert!(["x.toml", "x.TOML", "x", "x.model", ".toml"].into_iter().all(is_taken));
        assert!(!["x.xlsx", "x.XLSX", "x.toml.json", "runs/x.csv"].into_iter().any(is_taken));
    }
}
