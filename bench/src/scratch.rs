//! Files of one measurement that go with it, however it ends: a folder, and everything in /dev/shm under its name.

use crate::BenchError;
use rand::TryRng;
use rand::rngs::SysRng;
use std::fs::{self, DirBuilder};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// Where shared memory is.
const SHARED_MEMORY: &str = "/dev/shm";

/// A folder, and a prefix for files in /dev/shm; both are removed when it is dropped.
#[derive(Debug)]
pub struct Scratch {
    folder: PathBuf,
    prefix: String,
}

impl Scratch {
    /// A new, empty folder that nobody else may enter, under a name that nobody else has.
    ///
    /// # Errors
    /// [`BenchError::File`].
    pub fn new() -> Result<Self, BenchError> {
        // Both places are open to every user: a name that nobody can foresee, nobody can take first.
        let random = SysRng.try_next_u64().map_err(BenchError::Random)?;
        let prefix = format!("krait-bench-{random:016x}.");
        let folder = std::env::temp_dir().join(prefix.trim_end_matches('.'));
        DirBuilder::new().mode(0o700).create(&folder).map_err(BenchError::file("made", &folder))?;
        Ok(Self { folder, prefix })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How the names of this measurement's files in /dev/shm begin.
    pub fn prefix(&self) -> &str {
        &self.prefix
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        for entry in fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.prefix) {
                let _kept_if_it_cannot_be_removed = fs::remove_file(entry.path());
            }
        }
        let _kept_if_it_cannot_be_removed = fs::remove_dir_all(&self.folder);
    }
}
