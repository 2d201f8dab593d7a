//! Makes a whole file of what a killed recorder, a dead machine or a damaged disk has left.

use crate::chunk::{ChunkRecords, attachment_lengths_add_up, check_index};
use crate::contents::Missing;
use crate::error::{RecordError, RecordingReadError};
use crate::framing::{Framing, RECORD_HEAD, Step};
use crate::parse::parse;
use crate::reader::{Recording, behind_magic};
use crate::sink::{Appender, RecordingSink};
use crate::writer::{METADATA_RECOVERED, create_file, io_error, options};
use mcap::McapError;
use mcap::records::{self, Record, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::Path;

/// Key of the bytes that could not be read, in the metadata record `krait.recovered`.
pub(crate) const DROPPED_KEY: &str = "n_bytes_dropped";

/// What was saved.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recovered {
    /// Messages per topic, those derived for viewers included.
    pub messages: BTreeMap<String, u64>,
    /// Earliest log time, nanoseconds since 1970; 0 where there is no message.
    pub first_log_ns: u64,
    /// Latest log time, nanoseconds since 1970; 0 where there is no message.
    pub last_log_ns: u64,
    /// Bytes of the damaged file.
    pub n_bytes: u64,
    /// Bytes of it that could not be read, and are not in the new one.
    pub n_bytes_dropped: u64,
    /// What is missing, as [`crate::Contents::missing`] of the damaged file.
    pub missing: Vec<Missing>,
}

/// A recording could not be recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// The damaged file could not be read, or is none of krait's.
    #[error(transparent)]
    Read(#[from] RecordingReadError),
    /// The new file could not be written.
    #[error(transparent)]
    Write(#[from] RecordError),
}

/// Writes everything readable of a recording, cut and damaged as it may be, to a new file that is whole: same messages, same
/// bytes, same metadata and attachments, new indexes and checksums. A metadata record `krait.recovered` says what is lost,
/// and so does [`crate::Contents::missing`] of the new file.
///
/// # Errors
/// [`RecoverError`]; an existing file is never overwritten, and a new one that could not be completed is removed.
pub fn recover(path: &Path, out: &Path) -> Result<Recovered, RecoverError> {
    let missing = Recording::open(path)?.contents().missing.clone();
    let definitions = Definitions::read(path)?;
    let file = create_file(out)?;
    let written = write(path, file, out, &definitions, missing);
    written.inspect_err(|_| {
        if let Err(error) = std::fs::remove_file(out) {
            tracing::warn!(%error, path = %out.display(), "a half-written file could not be removed");
        }
    })
}

fn write(
    path: &Path,
    file: File,
    out: &Path,
    definitions: &Definitions,
    missing: Vec<Missing>,
) -> Result<Recovered, RecoverError> {
    let failed = |error: McapError| RecordError::Write { path: out.to_owned(), offset: 0, source: io_error(error) };
    let mcap = options().create(Appender::new(file)).map_err(failed)?;
    let saved = Recovered { n_bytes: length(path)?, missing, ..Recovered::default() };
    let mut copy = Copy { mcap, definitions, is_declared: false, saved };
    let mut chunk = ChunkRecords::default();
    walk(path, |found| match found {
        Found::Record(opcode, body) => copy.record(opcode, body, &mut chunk).map_err(|e| failed(e).into()),
        Found::Unreadable(n_bytes) => {
            copy.saved.n_bytes_dropped += n_bytes;
            Ok(())
        }
    })?;
    Ok(copy.finish(path).map_err(failed)?)
}

/// Something in the damaged file.
enum Found<'a> {
    Record(u8, &'a [u8]),
    /// So many bytes are no record.
    Unreadable(u64),
}

fn walk(path: &Path, mut visit: impl FnMut(Found<'_>) -> Result<(), RecoverError>) -> Result<(), RecoverError> {
    let n_bytes = length(path)?;
    let mut framing = Framing::after_magic(behind_magic(path)?);
    loop {
        let step = framing.step();
        let step =
            step.map_err(|source| RecordingReadError::Io { path: path.to_owned(), offset: framing.offset(), source })?;
        match step {
            Step::Record { opcode, .. } => visit(Found::Record(opcode, framing.body()))?,
            Step::TooLong { length, .. } => visit(Found::Unreadable(length + RECORD_HEAD))?,
            Step::Cut { offset } | Step::Garbage { offset } => {
                return visit(Found::Unreadable(n_bytes.saturating_sub(offset)));
            }
            Step::End | Step::EndOfFile { .. } => return Ok(()),
        }
    }
}

fn length(path: &Path) -> Result<u64, RecordingReadError> {
    let metadata = std::fs::metadata(path);
    metadata.map(|m| m.len()).map_err(|source| RecordingReadError::Io { path: path.to_owned(), offset: 0, source })
}

/// Definitions are held in memory; those of a chain take some kilobytes.
const MAX_DEFINITIONS_BYTES: usize = 32 << 20;

/// Schemas and channels, wherever in the file they stand: chunks repeat none, but a summary at the end repeats all.
#[derive(Default)]
struct Definitions {
    n_bytes: usize,
    schemas: BTreeMap<u16, (records::SchemaHeader, Vec<u8>)>,
    channels: BTreeMap<u16, records::Channel>,
}

impl Definitions {
    fn read(path: &Path) -> Result<Self, RecoverError> {
        let (mut all, mut chunk) = (Self::default(), ChunkRecords::default());
        walk(path, |found| {
            if let Found::Record(opcode @ (op::CHUNK | op::SCHEMA | op::CHANNEL), body) = found
                && chunk.read(opcode, body).is_ok()
            {
                for (header, data) in chunk.schemas.drain(..) {
                    if all.n_bytes + data.len() <= MAX_DEFINITIONS_BYTES {
                        all.n_bytes += data.len();
                        all.schemas.entry(header.id).or_insert((header, data));
                    }
                }
                for channel in chunk.channels.drain(..) {
                    all.channels.entry(channel.id).or_insert(channel);
                }
            }
            Ok(())
        })?;
        Ok(all)
    }
}

/// The new file while it is written.
struct Copy<'a> {
    mcap: mcap::Writer<Appender<File>>,
    definitions: &'a Definitions,
    is_declared: bool,
    saved: Recovered,
}

impl Copy<'_> {
    fn record(&mut self, opcode: u8, body: &[u8], chunk: &mut ChunkRecords) -> Result<(), McapError> {
        let is_readable = match opcode {
            op::CHUNK => match chunk.read(opcode, body) {
                Ok(()) => {
                    self.messages(chunk)?;
                    true
                }
                Err(_) => false,
            },
            op::ATTACHMENT if !attachment_lengths_add_up(body) => false,
            op::ATTACHMENT | op::METADATA => match parse(opcode, body) {
                Ok(record) => {
                    self.outer(record)?;
                    true
                }
                Err(_) => false,
            },
            op::HEADER | op::SCHEMA | op::CHANNEL => parse(opcode, body).is_ok(),
            op::FOOTER => body.len() == 20,
            _ => check_index(opcode, body).is_ok(),
        };
        if !is_readable {
            self.saved.n_bytes_dropped += body.len() as u64 + RECORD_HEAD;
        }
        Ok(())
    }

    fn outer(&mut self, record: Record<'_>) -> Result<(), McapError> {
        match record {
            Record::Metadata(metadata) => self.mcap.write_metadata(&metadata),
            Record::Attachment { header, data, .. } => self.mcap.attach(&mcap::Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data,
            }),
            _ => Ok(()),
        }
    }

    /// One chunk becomes one chunk.
    fn messages(&mut self, chunk: &ChunkRecords) -> Result<(), McapError> {
        for (header, range) in &chunk.messages {
            let payload = chunk.payload(range);
            let Some(channel) = self.definitions.channels.get(&header.channel_id) else {
                self.saved.n_bytes_dropped += payload.len() as u64;
                continue;
            };
            if !self.is_declared {
                self.declare()?;
            }
            self.mcap.write_to_known_channel(header, payload)?;
            let (saved, time) = (&mut self.saved, header.log_time);
            let is_first = saved.messages.is_empty();
            saved.first_log_ns = if is_first { time } else { saved.first_log_ns.min(time) };
            saved.last_log_ns = saved.last_log_ns.max(time);
            *saved.messages.entry(channel.topic.clone()).or_default() += 1;
        }
        self.mcap.flush()
    }

    /// With the first message: a chunk of definitions alone would have its time range begin in 1970.
    fn declare(&mut self) -> Result<(), McapError> {
        self.is_declared = true;
        for (header, data) in self.definitions.schemas.values() {
            self.mcap.add_schema_with_id(header.id, &header.name, &header.encoding, data)?;
        }
        for channel in self.definitions.channels.values() {
            let records::Channel { id, schema_id, topic, message_encoding, metadata } = channel;
            self.mcap.add_channel_with_id(*id, *schema_id, topic, message_encoding, metadata)?;
        }
        Ok(())
    }

    fn finish(mut self, path: &Path) -> Result<Recovered, McapError> {
        let from = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let about = [("from", from), (DROPPED_KEY, self.saved.n_bytes_dropped.to_string())];
        let metadata = about.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        self.mcap.write_metadata(&records::Metadata { name: METADATA_RECOVERED.to_owned(), metadata })?;
        self.mcap.finish()?;
        let mut appender = self.mcap.into_inner();
        io::Write::flush(&mut appender)?;
        appender.into_sink().sync()?;
        Ok(self.saved)
    }
}
