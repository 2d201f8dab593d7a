//! Writes what a replay sends and gets back to a new recording: a thread behind a bounded queue that makes the replay wait
//! when it is full, so that nothing is ever dropped.

use crate::ReplayError;
use crossbeam_channel::{Receiver, Sender, bounded};
use krait_record::{About, RecordError, RecordingWriter};
use krait_schema::Sample;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

/// Samples that may wait for the disk: a second of a replay at full speed is tens of thousands; this bounds the memory.
const QUEUE_LENGTH: usize = 8192;
/// Uncompressed bytes of a chunk: the recorder's default.
const CHUNK_BYTES: usize = 256 * 1024;

/// What the thread does, for error sentences.
const DOING: &str = "writes the new recording";

/// A recording in the making.
#[derive(Debug)]
pub struct Keeper {
    path: PathBuf,
    queue: Sender<Sample>,
    thread: JoinHandle<Result<u64, RecordError>>,
    n_kept: u64,
}

impl Keeper {
    /// Creates the file and starts the thread.
    ///
    /// # Errors
    /// [`ReplayError::Record`] when the file cannot be created, [`ReplayError::Thread`] when the thread cannot be started.
    pub fn create(path: &Path, about: &About) -> Result<Self, ReplayError> {
        let writer = RecordingWriter::create(path, CHUNK_BYTES, about)?;
        let (queue, samples) = bounded(QUEUE_LENGTH);
        let thread = std::thread::Builder::new()
            .name("replay-write".to_owned())
            .spawn(move || write_all(writer, &samples))
            .map_err(|error| ReplayError::Thread { doing: DOING, what: error.to_string() })?;
        Ok(Self { path: path.to_owned(), queue, thread, n_kept: 0 })
    }

    /// Adds a sample; waits while the queue is full.
    ///
    /// # Errors
    /// [`ReplayError::Thread`] when the recording has stopped; [`Keeper::finish`] says why.
    pub fn keep(&mut self, sample: Sample) -> Result<(), ReplayError> {
        self.n_kept += 1;
        self.queue.send(sample).map_err(|_ended| ReplayError::Thread {
            doing: DOING,
            what: format!("{} cannot be written any more", self.path.display()),
        })
    }

    /// Ends the file. Returns how many samples it holds.
    ///
    /// # Errors
    /// [`ReplayError::Record`] when a sample or the end could not be written.
    pub fn finish(self) -> Result<u64, ReplayError> {
        let Self { queue, thread, n_kept, .. } = self;
        drop(queue);
        let ended =
            thread.join().map_err(|panic| ReplayError::Thread { doing: DOING, what: format!("it died: {panic:?}") })?;
        ended?;
        Ok(n_kept)
    }
}

fn write_all(mut writer: RecordingWriter<std::fs::File>, samples: &Receiver<Sample>) -> Result<u64, RecordError> {
    let mut n_written: u64 = 0;
    for sample in samples {
        // In a replay's own time a sample is recorded at its own instant.
        writer.write(&sample, sample.sample_ns())?;
        n_written += 1;
    }
    writer.finish(&BTreeMap::from([
        ("reason".to_owned(), "the replay ended".to_owned()),
        ("n_written".to_owned(), n_written.to_string()),
    ]))
}
