//! The configuration that a chain runs with, kept beside its channels: a console that is started later reads what this machine is.

use crate::config::Config;
use anyhow::Context;
use krait_ipc::{Bus, input};
use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Its file in the instance's folder, which nobody else may enter.
const FILE: &str = "chain.toml";
/// What is being written; nobody reads half of it.
const NEXT: &str = "chain.toml.next";

/// Keeps the configuration of the chain that runs. Where there is no room for it, the chain goes on, and a console that is started
/// later asks for `--config`.
pub(super) fn keep(bus: &Bus, config: &Config) {
    if let Err(error) = write(&bus.instance().folder(), config) {
        // That of the chain before would be of another machine.
        remove(bus);
        tracing::warn!(
            "the configuration could not be kept for consoles that are started later: {error:#}; start them with --config"
        );
    }
}

/// Takes it away: nothing runs.
pub(super) fn remove(bus: &Bus) {
    for name in [FILE, NEXT] {
        let path = bus.instance().folder().join(name);
        if let Err(error) = fs::remove_file(&path)
            && error.kind() != io::ErrorKind::NotFound
        {
            tracing::warn!(file = %path.display(), %error, "the configuration of an ended chain could not be removed");
        }
    }
}

/// The configuration of the chain that runs in an instance, looked for again and again.
pub struct KeptConfig {
    path: PathBuf,
    /// What was read last: the file's number and when it was written.
    read: Option<(u64, SystemTime)>,
}

impl KeptConfig {
    /// Of an instance; nothing is read yet.
    pub fn of(bus: &Bus) -> Self {
        Self { path: bus.instance().folder().join(FILE), read: None }
    }

    /// The configuration, where one was written since it was asked for last; nothing where no chain runs.
    ///
    /// # Errors
    /// One sentence with file, line and key, once for each file.
    pub fn newer(&mut self) -> anyhow::Result<Option<Config>> {
        let found = match fs::metadata(&self.path).and_then(|file| Ok((file.ino(), file.modified()?))) {
            Ok(found) => Some(found),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error).with_context(|| self.cannot()),
        };
        let is_newer = found.is_some() && found != self.read;
        self.read = found;
        if !is_newer {
            return Ok(None);
        }
        match input::text(&self.path, input::CONFIG_BYTES) {
            Ok(text) => Config::read(&text, &self.path).map(Some),
            // The chain has ended just now.
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error).with_context(|| self.cannot()),
        }
    }

    fn cannot(&self) -> String {
        format!("the chain's configuration {} could not be read", self.path.display())
    }
}

fn write(folder: &Path, config: &Config) -> anyhow::Result<()> {
    let (next, path) = (folder.join(NEXT), folder.join(FILE));
    let text = config.to_toml()?;
    let written = File::options().write(true).create(true).truncate(true).mode(0o600).open(&next);
    written.and_then(|mut file| file.write_all(text.as_bytes())).with_context(|| format!("{}", next.display()))?;
    fs::rename(&next, &path).with_context(|| format!("{}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn what_was_kept_is_read_by_this_user_alone_and_is_gone_with_the_chain() {
        let bus = Bus::open(&format!("effective-{}", std::process::id()), "test").expect("a bus");
        let mut kept = KeptConfig::of(&bus);
        assert!(kept.newer().expect("no chain").is_none());
        for max_bend_rad in [0.7, 0.8] {
            let mut config = Config::default().with_model_text().expect("a model");
            config.resolve.max_bend_rad = max_bend_rad;
            keep(&bus, &config);
            assert_eq!(kept.newer().expect("kept"), Some(config));
            assert_eq!(kept.newer().expect("read before"), None);
        }
        let mode = fs::metadata(bus.instance().folder().join(FILE)).expect("there").permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        remove(&bus);
        remove(&bus);
        assert!(kept.newer().expect("no chain").is_none());
        let config = Config::default().with_model_text().expect("a model");
        keep(&bus, &config);
        assert_eq!(kept.newer().expect("the next chain's"), Some(config));
        remove(&bus);
    }
}
