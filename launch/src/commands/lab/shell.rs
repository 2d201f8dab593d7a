//! Commands that are printed to be typed again.

use crate::cli_lab::LabFiles;
use std::path::Path;

/// A path as a shell takes it.
pub fn shell(path: &Path) -> String {
    quoted(&path.display().to_string())
}

/// A word as a shell takes it.
pub fn quoted(text: &str) -> String {
    let is_plain = !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_./=,:+".contains(c));
    if is_plain { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// The options that name the same measurements again.
pub fn data_words(files: &LabFiles) -> String {
    let data = files.data.iter().map(|path| format!("--data {}", shell(path)));
    let maps = files.map.iter().map(|map| format!("--map {}", quoted(&map.to_string())));
    let file = files.map_file.iter().map(|path| format!("--map-file {}", shell(path)));
    let with = files.with.iter().map(|path| format!("--with {}", shell(path)));
    let clock = files.clock.iter().map(|own| format!("--clock {}", own.words()));
    let camera = files.camera_offset.iter().map(|own| format!("--camera-offset {}", own.words()));
    data.chain(with).chain(camera).chain(clock).chain(maps).chain(file).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_shell_would_take_apart_is_quoted() {
        assert_eq!(quoted("a/b-1.csv"), "a/b-1.csv");
        assert_eq!(quoted("my data.csv"), "'my data.csv'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
    }
}
