//! The samples of some channels of a recording and of all its parts, read as they are asked for: an hour in little memory.

use crate::error::RecordingReadError;
use crate::reader::{Recorded, Recording, Samples};
use krait_schema::Channel;
use std::path::{Path, PathBuf};

/// Samples in the order of the files. Damaged records are skipped, and so is what other channels hold.
///
/// Unlike [`Recording::open_parts`] it reads nothing twice and does not say what is missing.
pub struct Stream {
    channels: Vec<Channel>,
    run_id: Option<String>,
    parts: Vec<PathBuf>,
    samples: Samples,
}

impl Stream {
    /// Begins at the first sample of the first part.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open(path: &Path, channels: &[Channel]) -> Result<Self, RecordingReadError> {
        let first = Recording::open_beginning(path)?;
        Ok(Self {
            channels: channels.to_vec(),
            run_id: first.run_id().cloned(),
            parts: vec![path.to_owned()],
            samples: first.samples()?.only(channels),
        })
    }

    /// Goes on with the part that follows. Returns whether there is one; as in [`Recording::open_parts`], one that is not
    /// there is missing without a word, and a file of another run is none.
    fn next_part(&mut self) -> Result<bool, RecordingReadError> {
        let Some(path) = self.samples.next_part().map(Path::to_owned) else { return Ok(false) };
        if !path.exists() || self.parts.contains(&path) {
            return Ok(false);
        }
        let part = Recording::open_beginning(&path)?;
        if part.run_id() != self.run_id.as_ref() {
            return Ok(false);
        }
        self.samples = part.samples()?.only(&self.channels);
        self.parts.push(path);
        Ok(true)
    }
}

impl Iterator for Stream {
    type Item = Result<Recorded, RecordingReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(recorded) = self.samples.next() {
                return Some(recorded);
            }
            match self.next_part() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
