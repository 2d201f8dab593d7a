//! Where a recording goes, byte by byte, so that what is there is always a readable prefix of a good file.

use core::sync::atomic::{AtomicU64, Ordering};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;

/// A file, or something that can take its place in a test.
pub trait RecordingSink: Write + Seek {
    /// Cuts everything from `length` on away and continues there.
    ///
    /// # Errors
    /// What the system says.
    fn truncate_to(&mut self, length: u64) -> io::Result<()>;

    /// Waits until everything has reached the disk.
    ///
    /// # Errors
    /// What the system says: a full or failing disk may say so only now.
    fn sync(&mut self) -> io::Result<()>;
}

impl RecordingSink for File {
    fn truncate_to(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(|_| ())
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_all()
    }
}

/// Collects what the MCAP writer produces and hands it on whole, at each flush: one system call per chunk, and a failed
/// write can be undone, because it is known where the last good one ended.
#[derive(Debug)]
pub(crate) struct Appender<S> {
    sink: S,
    pending: Vec<u8>,
    // Shared, because the MCAP writer does not let go of its sink.
    n_committed: Arc<AtomicU64>,
}

impl<S: RecordingSink> Appender<S> {
    pub(crate) fn new(sink: S) -> Self {
        Self { sink, pending: Vec::new(), n_committed: Arc::default() }
    }

    /// Bytes that the sink has taken.
    pub(crate) fn n_committed(&self) -> u64 {
        self.n_committed.load(Ordering::Relaxed)
    }

    /// The same for whoever cannot ask.
    pub(crate) fn counter(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.n_committed)
    }

    pub(crate) fn into_sink(self) -> S {
        self.sink
    }

    /// After a failed write: cuts the half-written rest away and ends the file as an MCAP file without an index, which
    /// needs 50 bytes of the room that the cut has made. Where even that fails, the file stays readable up to its last
    /// chunk. Returns the length that is kept.
    pub(crate) fn give_up(mut self) -> u64 {
        let ended = self.sink.truncate_to(self.n_committed()).and_then(|()| self.sink.write_all(&END_WITHOUT_INDEX));
        if ended.is_err() && self.sink.truncate_to(self.n_committed()).is_err() {
            tracing::warn!("the recording's half-written last chunk could not be cut away; readers skip it");
        }
        self.n_committed()
    }
}

/// Data end (opcode 0x0f, no CRC), footer (opcode 0x02, no summary, no CRC), magic.
const END_WITHOUT_INDEX: [u8; 50] = {
    let mut end = [0; 50];
    end[0] = 0x0f;
    end[1] = 4;
    end[13] = 0x02;
    end[14] = 20;
    let mut idx = 0;
    while idx < mcap::MAGIC.len() {
        end[42 + idx] = mcap::MAGIC[idx];
        idx += 1;
    }
    end
};

impl<S: RecordingSink> Write for Appender<S> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.pending.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.write_all(&self.pending)?;
        self.n_committed.fetch_add(self.pending.len() as u64, Ordering::Relaxed);
        self.pending.clear();
        self.sink.flush()
    }
}

impl<S: RecordingSink> Seek for Appender<S> {
    /// Tells the position; a recording is written from front to back.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = self.n_committed() + self.pending.len() as u64;
        match to {
            SeekFrom::Current(0) | SeekFrom::End(0) => Ok(position),
            _ => Err(io::Error::new(io::ErrorKind::Unsupported, "a recording is only ever appended to")),
        }
    }
}
