//! One chain on a machine: its name, and the files that carry it.

use crate::IpcError;
use crate::ground::ground_of;
use std::path::{Path, PathBuf};

/// How the name of an instance's lock ends.
const LOCK: &str = ".lock";

/// A checked instance name: 1 to 32 of a-z, 0-9, '-' and '_'; and where its files are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InstanceName {
    name: String,
    /// Looked up once, so that all that is said of an instance is of one place.
    ground: &'static Path,
}

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
        Ok(Self { name: name.to_owned(), ground: ground_of(&[&format!("{name}{LOCK}"), name]) })
    }

    /// The name itself.
    pub fn as_str(&self) -> &str {
        &self.name
    }

    /// The directory in which its files are.
    pub(crate) fn ground(&self) -> &Path {
        self.ground
    }

    /// The doorbell of a channel: a file of this instance like those of iceoryx2, and removed with them.
    pub(crate) fn bell_path(&self, channel: &str) -> PathBuf {
        self.folder().join(format!("{}.doorbell", channel.replace('/', ".")))
    }

    /// The folder of this instance, shared memory included; it exists while the instance has members and goes with the last.
    pub fn folder(&self) -> PathBuf {
        self.ground.join(&self.name)
    }

    /// The file whose lock says who is in.
    pub fn lock_path(&self) -> PathBuf {
        self.ground.join(format!("{}{LOCK}", self.name))
    }
}

/// Every file that belongs to an instance; empty after a clean end.
pub fn resources_of(instance: &InstanceName) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect(&instance.folder(), &mut found);
    found.sort();
    found
}

fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            collect(&entry.path(), found);
        } else {
            found.push(entry.path());
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
