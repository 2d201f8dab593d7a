//! Writes samples to an MCAP file: zstd chunks, every index and CRC, and a defined end also where the disk is full.

use crate::about::About;
use crate::error::RecordError;
use crate::sink::{Appender, RecordingSink};
use crate::views::Views;
use crate::wall_clock::WallClock;
use core::sync::atomic::{AtomicU64, Ordering};
use krait_schema::{Channel, Sample, View, encode};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Name of the metadata record at the beginning of a file.
pub(crate) const METADATA: &str = "krait";
/// Name of the metadata record at the end of a file; a file without it was not ended in order.
pub(crate) const METADATA_END: &str = "krait.end";
/// Name of the metadata record of a file that was made of a damaged one.
pub(crate) const METADATA_RECOVERED: &str = "krait.recovered";
/// Profile in the file header.
pub(crate) const PROFILE: &str = "krait";
/// Key of the payload version in a channel's metadata.
pub(crate) const VERSION_KEY: &str = "krait.payload.version";
/// zstd's fastest ordinary level: the thread shares its core with control processes.
const ZSTD_LEVEL: u32 = 1;
/// A recording is about a person: nobody else reads it until its owner says so.
const PRIVATE: u32 = 0o600;
/// Bytes of a message record beside its payload: opcode, length, channel, sequence, two times.
const MESSAGE_OVERHEAD: usize = 1 + 8 + 2 + 4 + 8 + 8;
/// A stamp further than this from the moment of recording would make the time axis useless in every viewer, ns.
const STAMP_PATIENCE_NS: u64 = 60_000_000_000;

/// An open recording. Samples become durable when their chunk is closed: by [`RecordingWriter::flush`], or when it is full.
pub struct RecordingWriter<S: RecordingSink> {
    path: PathBuf,
    clock: WallClock,
    chunk_bytes: usize,
    /// `None` once a write has failed.
    mcap: Option<mcap::Writer<Appender<S>>>,
    channel_ids: Option<Ids>,
    views: Option<Views>,
    n_derived: u32,
    buffer: Vec<u8>,
    n_in_chunk: usize,
    n_kept: u64,
    n_committed: Arc<AtomicU64>,
}

impl RecordingWriter<File> {
    /// Creates the file, and its folder where that is missing.
    ///
    /// # Errors
    /// [`RecordError::Exists`], [`RecordError::Create`], or [`RecordError::Write`] where there is no room for the
    /// beginning, in which case no file is left.
    pub fn create(path: &Path, chunk_bytes: usize, about: &About) -> Result<Self, RecordError> {
        let file = create_file(path)?;
        Self::begin(file, path, chunk_bytes, about).inspect_err(|_| {
            if let Err(error) = fs::remove_file(path) {
                tracing::warn!(%error, path = %path.display(), "an empty recording could not be removed");
            }
        })
    }
}

impl<S: RecordingSink> RecordingWriter<S> {
    /// Begins a recording on an empty sink; `path` is its name in error sentences.
    ///
    /// # Errors
    /// [`RecordError::Write`].
    pub fn begin(sink: S, path: &Path, chunk_bytes: usize, about: &About) -> Result<Self, RecordError> {
        let failed = |error| RecordError::Write { path: path.to_owned(), offset: 0, source: io_error(error) };
        let appender = Appender::new(sink);
        let n_committed = appender.counter();
        let mut mcap = options().create(appender).map_err(failed)?;
        begin_file(&mut mcap, about).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            clock: about.clock,
            chunk_bytes,
            mcap: Some(mcap),
            channel_ids: None,
            views: None,
            n_derived: 0,
            buffer: Vec::new(),
            n_in_chunk: 0,
            n_kept: 0,
            n_committed,
        })
    }

    /// Also writes what viewers draw, derived from the samples.
    #[must_use]
    pub fn with_views(self, views: Option<Views>) -> Self {
        Self { views, ..self }
    }

    /// Adds a sample that was taken from shared memory at `taken_ns` (CLOCK_MONOTONIC). Publish time is the sample's own
    /// instant; so is log time, unless that instant is more than a minute away from `taken_ns`, which then counts.
    ///
    /// # Errors
    /// [`RecordError::Write`]: the recording has stopped, its file is ended in order, and every further call is an error.
    pub fn write(&mut self, sample: &Sample, taken_ns: i64) -> Result<(), RecordError> {
        let added = self.add(sample, taken_ns);
        added.map_err(|error| self.stop(error))?;
        if self.n_in_chunk >= self.chunk_bytes { self.flush() } else { Ok(()) }
    }

    /// Closes the chunk and hands it to the file: from here on, the samples in it survive this process.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`].
    pub fn flush(&mut self) -> Result<(), RecordError> {
        let flushed = self.live().and_then(mcap::Writer::flush);
        self.n_in_chunk = 0;
        flushed.map_err(|error| self.stop(error))
    }

    /// Ends the file: last chunk, metadata record `krait.end`, indexes. Returns its length in bytes.
    ///
    /// # Errors
    /// As [`RecordingWriter::write`]; the samples up to the last chunk are kept, without the indexes.
    pub fn finish(self, end: &BTreeMap<String, String>) -> Result<u64, RecordError> {
        let path = self.path.clone();
        let (offset, mut sink) = self.close(end)?;
        sink.sync().map_err(|source| RecordError::Write { path, offset, source })?;
        Ok(offset)
    }

    /// Ends the file as [`RecordingWriter::finish`] does, without waiting for the disk. Returns its length and itself.
    pub(crate) fn close(mut self, end: &BTreeMap<String, String>) -> Result<(u64, S), RecordError> {
        self.flush()?;
        let metadata = Metadata { name: METADATA_END.to_owned(), metadata: end.clone() };
        let ended = self.live().and_then(|mcap| {
            mcap.write_metadata(&metadata)?;
            mcap.finish()
        });
        ended.map_err(|error| self.stop(error))?;
        let Some(mcap) = self.mcap.take() else { return Err(self.stop(stopped())) };
        let mut appender = mcap.into_inner();
        if let Err(source) = io::Write::flush(&mut appender) {
            return Err(RecordError::Write { path: self.path, offset: appender.give_up(), source });
        }
        let offset = appender.n_committed();
        Ok((offset, appender.into_sink()))
    }

    /// Bytes that the file has taken so far.
    pub(crate) fn n_committed(&self) -> u64 {
        self.n_committed.load(Ordering::Relaxed)
    }

    /// What draws for viewers, for the next part.
    pub(crate) fn take_views(&mut self) -> Option<Views> {
        self.views.take()
    }

    /// Ends the file because of what the disk said later.
    pub(crate) fn stop_because(&mut self, source: io::Error) -> RecordError {
        self.stop(McapError::Io(source))
    }

    fn add(&mut self, sample: &Sample, taken_ns: i64) -> Result<(), McapError> {
        encode(sample, &mut self.buffer).map_err(io::Error::other)?;
        let channel_ids = match self.channel_ids {
            Some(ids) => ids,
            // With the first sample, because a chunk without samples would have its time range begin in 1970.
            None => {
                let mcap = self.mcap.as_mut().ok_or_else(stopped)?;
                *self.channel_ids.insert(Ids::declare(mcap, self.views.is_some())?)
            }
        };
        let publish_time = self.clock.wall_ns(sample.sample_ns());
        let plausible = sample.sample_ns().abs_diff(taken_ns) <= STAMP_PATIENCE_NS;
        let header = MessageHeader {
            channel_id: channel_ids.channels[sample.channel().index()],
            // The format has room for 32 bits; the payload holds all 64.
            sequence: (sample.sequence() & u64::from(u32::MAX)) as u32,
            log_time: if plausible { publish_time } else { self.clock.wall_ns(taken_ns) },
            publish_time,
        };
        self.n_in_chunk += MESSAGE_OVERHEAD + self.buffer.len();
        self.mcap.as_mut().ok_or_else(stopped)?.write_to_known_channel(&header, &self.buffer)?;
        self.add_views(sample, &header, &channel_ids)
    }

    fn add_views(&mut self, sample: &Sample, of: &MessageHeader, ids: &Ids) -> Result<(), McapError> {
        let Some(views) = &mut self.views else { return Ok(()) };
        for (view, bytes) in views.of(sample, self.clock) {
            self.n_derived = self.n_derived.wrapping_add(1);
            let header = MessageHeader { channel_id: ids.views[view.index()], sequence: self.n_derived, ..*of };
            self.n_in_chunk += MESSAGE_OVERHEAD + bytes.len();
            self.mcap.as_mut().ok_or_else(stopped)?.write_to_known_channel(&header, &bytes)?;
        }
        Ok(())
    }

    fn live(&mut self) -> Result<&mut mcap::Writer<Appender<S>>, McapError> {
        self.mcap.as_mut().ok_or_else(stopped)
    }

    /// Ends the file at its last good chunk and says so.
    fn stop(&mut self, error: McapError) -> RecordError {
        if let Some(mcap) = self.mcap.take() {
            self.n_kept = mcap.into_inner().give_up();
        }
        RecordError::Write { path: self.path.clone(), offset: self.n_kept, source: io_error(error) }
    }
}

/// A new file, and its folder where that is missing.
pub(crate) fn create_file(path: &Path) -> Result<File, RecordError> {
    let failed = |source: io::Error| match source.kind() {
        io::ErrorKind::AlreadyExists => RecordError::Exists { path: path.to_owned() },
        _ => RecordError::Create { path: path.to_owned(), source },
    };
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|source| RecordError::Create { path: path.to_owned(), source })?;
    }
    File::options().write(true).create_new(true).mode(PRIVATE).open(path).map_err(failed)
}

pub(crate) fn options() -> WriteOptions {
    WriteOptions::new()
        .profile(PROFILE)
        .library(concat!("krait ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        .compression_level(ZSTD_LEVEL)
        // No threads beside the one that writes.
        .compression_threads(0)
        // Chunks are closed here, each with a flush; and are built in memory, so that the file only ever grows.
        .chunk_size(None)
        .disable_seeking(true)
}

/// Metadata and attachments come before the first sample, so that the shortest recording has them.
fn begin_file<S: RecordingSink>(mcap: &mut mcap::Writer<Appender<S>>, about: &About) -> Result<(), McapError> {
    mcap.write_metadata(&Metadata { name: METADATA.to_owned(), metadata: about.metadata.clone() })?;
    let now = about.clock.wall_ns(krait_ipc::clock::monotonic_ns());
    for attachment in &about.attachments {
        mcap.attach(&mcap::Attachment {
            log_time: now,
            create_time: now,
            name: attachment.name.clone(),
            media_type: attachment.media_type.clone(),
            data: attachment.data.as_slice().into(),
        })?;
    }
    mcap.flush()
}

/// Ids of the channels in a file.
#[derive(Clone, Copy)]
struct Ids {
    channels: [u16; Channel::ALL.len()],
    views: [u16; View::ALL.len()],
}

impl Ids {
    fn declare<S: RecordingSink>(mcap: &mut mcap::Writer<Appender<S>>, with_views: bool) -> Result<Self, McapError> {
        let mut ids = Self { channels: [0; Channel::ALL.len()], views: [0; View::ALL.len()] };
        for channel in Channel::ALL {
            let schema = channel.schema();
            let schema_id = mcap.add_schema(schema.name, "protobuf", schema.descriptors)?;
            let metadata = BTreeMap::from([(VERSION_KEY.to_owned(), schema.version.to_string())]);
            ids.channels[channel.index()] = mcap.add_channel(schema_id, channel.topic(), "protobuf", &metadata)?;
        }
        for view in View::ALL.into_iter().filter(|_| with_views) {
            let schema = view.schema();
            let schema_id = mcap.add_schema(schema.name, "protobuf", schema.descriptors)?;
            ids.views[view.index()] = mcap.add_channel(schema_id, view.topic(), "protobuf", &BTreeMap::new())?;
        }
        Ok(ids)
    }
}

fn stopped() -> McapError {
    McapError::AttemptedWriteAfterFailure
}

pub(crate) fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(source) => source,
        other => io::Error::other(other),
    }
}
