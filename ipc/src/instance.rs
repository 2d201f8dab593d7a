//! One chain on a machine: its name, and the files that carry it.

use crate::IpcError;
use std::path::{Path, PathBuf};

/// Where iceoryx2 keeps the small files of every krait instance (its shared memory is in /dev/shm).
const ROOT: &str = "/tmp/krait";
/// Where shared memory is.
const SHARED_MEMORY: &str = "/dev/shm";

/// A checked instance name: 1 to 32 of a-z, 0-9, '-' and '_'.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InstanceName(String);

impl InstanceName {
    /// Checks a name.
    ///
    /// # Errors
    /// [`IpcError::InstanceName`] for anything else than 1 to 32 of a-z, 0-9, '-' and '_'.
    pub fn new(name: &str) -> Result<Self, IpcError> {
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
        if name.is_empty() || name.len() > 32 || !name.chars().all(allowed) {
            return Err(IpcError::InstanceName { found: name.to_owned() });
        }
        Ok(Self(name.to_owned()))
    }

    /// The name itself.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Prefix of every file of this instance. The trailing dot keeps instance `a` from owning the files of `ab`.
    pub(crate) fn prefix(&self) -> String {
        format!("krait.{}.", self.0)
    }

    /// The bell of a channel: a file of this instance like those of iceoryx2, and removed with them.
    pub(crate) fn bell_path(&self, channel: &str) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}{}.bell", self.prefix(), channel.replace('/', ".")))
    }

    /// The folder of this instance; it exists while the instance has members and goes with the last.
    pub fn folder(&self) -> PathBuf {
        Path::new(ROOT).join(&self.0)
    }
}

/// Every file in /dev/shm and under the instance's folder that belongs to an instance; empty after a clean end.
pub fn resources_of(instance: &InstanceName) -> Vec<PathBuf> {
    let prefix = instance.prefix();
    let mut found = Vec::new();
    collect(Path::new(SHARED_MEMORY), false, &mut |p| {
        if p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(&prefix)) {
            found.push(p.to_owned());
        }
    });
    collect(&instance.folder(), true, &mut |p| found.push(p.to_owned()));
    found.sort();
    found
}

fn collect(folder: &Path, deep: bool, visit: &mut dyn FnMut(&Path)) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        if path.is_dir() {
            if deep {
                collect(&path, deep, visit);
            }
        } else {
            visit(&path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_cannot_be_file_names_are_refused_with_the_name() {
        for bad in ["", "A", "a b", "a/b", "..", "a.b", &"x".repeat(33)] {
            let error = InstanceName::new(bad).expect_err(bad).to_string();
            assert!(error.contains(&format!("{bad:?}")), "{error}");
        }
        assert!(InstanceName::new("or-2_left").is_ok());
    }
}
