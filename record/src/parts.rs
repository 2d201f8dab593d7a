//! The parts of a recording: `run.mcap`, then `run.2.mcap`, `run.3.mcap`, each a whole file with everything that a reader needs.
//!
//! A part ends between two chunks, once it is large or old enough, and the next begins with the sample after its last: nothing
//! is lost in between. Samples wait in the queue meanwhile; the disk itself is waited for by a thread of its own.

use crate::about::About;
use crate::config::RecordConfig;
use crate::error::RecordError;
use crate::sink::RecordingSink;
use crate::syncer::{Syncer, is_still_at};
use crate::writer::RecordingWriter;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Key of a part's number, from 1, in the metadata record `krait`.
pub(crate) const PART_KEY: &str = "part";
/// Key of the next part's file name in the metadata record `krait.end`.
pub(crate) const NEXT_PART_KEY: &str = "next_part";

/// The parts of one recording while it is made.
pub(crate) struct Parts<'a> {
    first_path: PathBuf,
    config: &'a RecordConfig,
    about: About,
    syncer: Syncer<'a>,
    writer: RecordingWriter<File>,
    number: u32,
    begun_ns: i64,
    n_bytes_before: u64,
}

impl<'a> Parts<'a> {
    /// Creates the first part.
    ///
    /// # Errors
    /// As [`RecordingWriter::create`].
    pub(crate) fn create(
        path: &Path,
        config: &'a RecordConfig,
        about: About,
        syncer: Syncer<'a>,
        now_ns: i64,
    ) -> Result<Self, RecordError> {
        let writer = create(path, config, &about, 1)?.with_views(config.views()?);
        let first_path = path.to_owned();
        syncer.watch(path);
        Ok(Self { first_path, config, about, syncer, writer, number: 1, begun_ns: now_ns, n_bytes_before: 0 })
    }

    /// The part that is being written.
    pub(crate) fn writer(&mut self) -> &mut RecordingWriter<File> {
        &mut self.writer
    }

    /// Parts so far.
    pub(crate) fn n_parts(&self) -> u32 {
        self.number
    }

    /// Closes the chunk, and says so if the disk has refused what was handed to it before.
    pub(crate) fn flush(&mut self) -> Result<(), RecordError> {
        if let Some(source) = self.syncer.failure() {
            return Err(self.writer.stop_because(source));
        }
        self.writer.flush()
    }

    /// Whether the part is as large or as old as a part may be.
    pub(crate) fn is_full(&self, now_ns: i64) -> bool {
        let RecordConfig { rotate_bytes, rotate_s, .. } = *self.config;
        let age_ns = u64::try_from(now_ns.saturating_sub(self.begun_ns)).unwrap_or(0);
        (rotate_bytes > 0 && self.writer.n_committed() >= rotate_bytes)
            || (rotate_s > 0 && age_ns >= rotate_s.saturating_mul(1_000_000_000))
    }

    /// Ends the part and begins the next.
    ///
    /// # Errors
    /// As [`RecordingWriter::create`] and [`RecordingWriter::finish`]; the parts so far are kept.
    pub(crate) fn rotate(&mut self, mut end: BTreeMap<String, String>, now_ns: i64) -> Result<(), RecordError> {
        let next_path = part_path(&self.first_path, self.number + 1);
        let next = create(&next_path, self.config, &self.about, self.number + 1)?;
        let next = next.with_views(self.writer.take_views());
        let name = next_path.file_name().map(|name| name.to_string_lossy().into_owned());
        end.extend(name.map(|name| (NEXT_PART_KEY.to_owned(), name)));
        self.syncer.watch(&next_path);
        let ended = core::mem::replace(&mut self.writer, next);
        let (n_bytes, file) = ended.close(&end)?;
        self.syncer.close(file);
        self.n_bytes_before += n_bytes;
        self.number += 1;
        self.begun_ns = now_ns;
        Ok(())
    }

    /// Ends the last part. Returns the bytes of all.
    ///
    /// # Errors
    /// As [`RecordingWriter::finish`].
    pub(crate) fn finish(self, end: &BTreeMap<String, String>) -> Result<u64, RecordError> {
        let path = part_path(&self.first_path, self.number);
        let (n_bytes, mut file) = self.writer.close(end)?;
        let whole = file.sync().and_then(|()| is_still_at(&file, &path));
        whole.map_err(|source| RecordError::Write { path, offset: n_bytes, source })?;
        Ok(self.n_bytes_before + n_bytes)
    }
}

fn create(
    path: &Path,
    config: &RecordConfig,
    about: &About,
    number: u32,
) -> Result<RecordingWriter<File>, RecordError> {
    let mut about = about.clone();
    about.metadata.insert(PART_KEY.to_owned(), number.to_string());
    RecordingWriter::create(path, config.chunk_bytes, &about)
}

/// Path of a part, from 1: the first has the name that was asked for.
fn part_path(first: &Path, number: u32) -> PathBuf {
    if number == 1 { first.to_owned() } else { first.with_extension(format!("{number}.mcap")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_stand_beside_the_first_and_sort_behind_it() {
        assert_eq!(part_path(Path::new("a/run.mcap"), 1), Path::new("a/run.mcap"));
        assert_eq!(part_path(Path::new("a/run.mcap"), 2), Path::new("a/run.2.mcap"));
    }
}
