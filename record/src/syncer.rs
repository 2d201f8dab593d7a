//! Has the disk keep what was written, from a thread of its own: nothing that a slow disk does holds the recording up.
//!
//! A flush hands a chunk to the kernel, which outlives the recorder; only a sync outlives the machine. So a killed recorder
//! loses what was not flushed, and a machine without power what was not synced.

use crate::sink::RecordingSink;
use core::time::Duration;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender};
use std::fs::File;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// What the thread is told. The queue between the two is bounded by the parts of a recording: a few an hour.
#[derive(Debug)]
pub(crate) enum Job {
    /// This file is being written now.
    Watch(File, PathBuf),
    /// This file is complete.
    Close(File),
}

/// Where the thread leaves what the disk said.
pub(crate) type Failure = Mutex<Option<io::Error>>;

/// The writing thread's end.
#[derive(Debug)]
pub(crate) struct Syncer<'a> {
    jobs: Sender<Job>,
    failure: &'a Failure,
}

impl<'a> Syncer<'a> {
    /// Both ends.
    pub(crate) fn pair(failure: &'a Failure) -> (Self, Receiver<Job>) {
        let (jobs, receiver) = crossbeam_channel::unbounded();
        (Self { jobs, failure }, receiver)
    }

    /// Has a file that is being written synced from now on.
    pub(crate) fn watch(&self, path: &Path) {
        match File::open(path) {
            Ok(file) => self.tell(Job::Watch(file, path.to_owned())),
            Err(error) => tracing::warn!(%error, path = %path.display(), "it will not be synced before its end"),
        }
    }

    /// Has a complete file synced once.
    pub(crate) fn close(&self, file: File) {
        self.tell(Job::Close(file));
    }

    /// What the disk said, once.
    pub(crate) fn failure(&self) -> Option<io::Error> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn tell(&self, job: Job) {
        if self.jobs.send(job).is_err() {
            tracing::warn!("the thread that syncs the recording has ended");
        }
    }
}

/// The thread: syncs the file that is being written once a period, and each complete one, until the other end is gone.
pub(crate) fn sync_all(jobs: &Receiver<Job>, period: Duration, failure: &Failure) {
    let mut watched: Option<(File, PathBuf)> = None;
    loop {
        let synced = match jobs.recv_timeout(period) {
            Ok(Job::Watch(file, path)) => {
                watched = Some((file, path));
                Ok(())
            }
            Ok(Job::Close(mut file)) => file.sync(),
            Err(RecvTimeoutError::Timeout) => watched.as_ref().map_or(Ok(()), |(file, path)| {
                file.sync_data()?;
                is_still_at(file, path)
            }),
            Err(RecvTimeoutError::Disconnected) => return,
        };
        if let Err(error) = synced {
            *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        }
    }
}

/// Whether a file that is written still has its name: otherwise all of it is lost at the end.
pub(crate) fn is_still_at(file: &File, path: &Path) -> io::Result<()> {
    let written = file.metadata()?;
    let place = |found: &std::fs::Metadata| (found.dev(), found.ino());
    let what = match std::fs::metadata(path) {
        Ok(named) if place(&named) == place(&written) => return Ok(()),
        Ok(_) => "another file was put in its place while it was written",
        Err(error) if error.kind() == io::ErrorKind::NotFound => "it was deleted or moved while it was written",
        Err(error) => return Err(error),
    };
    Err(io::Error::new(io::ErrorKind::NotFound, what))
}
