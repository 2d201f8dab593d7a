//! The samples of a stretch of time, found through the file's index: a minute of an hour without reading the hour.

use crate::chunk::ChunkRecords;
use crate::contents::{Directory, known_channel};
use crate::error::RecordingReadError;
use crate::framing::{Framing, MAX_RECORD_BYTES, RECORD_HEAD, Step};
use crate::parse::parse;
use crate::reader::{Recorded, Recording, behind_magic};
use core::ops::Range;
use krait_schema::{Channel, decode};
use mcap::MAGIC;
use mcap::records::{ChunkIndex, MessageHeader, Record, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes of a footer record and the magic behind it.
const END_BYTES: i64 = 9 + 20 + 8;

/// Reads the samples whose log time (wall clock, nanoseconds since 1970) lies in a range, in the order of the file.
///
/// With the index of a file that was ended in order, only the chunks of that stretch are read. A file without one, because
/// its recorder was killed, is read through.
///
/// # Errors
/// [`RecordingReadError`] when the file cannot be read or is no recording of this version; a damaged chunk is passed over.
pub fn samples_between(path: &Path, log_ns: Range<u64>) -> Result<Vec<Recorded>, RecordingReadError> {
    match Index::read(path)? {
        Some(mut index) => index.samples(&log_ns),
        None => {
            let samples = Recording::open(path)?.samples()?;
            samples.filter(|recorded| recorded.as_ref().map_or(true, |r| log_ns.contains(&r.log_ns))).collect()
        }
    }
}

/// What stands at the end of a file.
struct Index {
    path: PathBuf,
    file: BufReader<File>,
    directory: Directory,
    chunks: Vec<ChunkIndex>,
}

impl Index {
    /// `None` for a file without an index that can be used.
    fn read(path: &Path) -> Result<Option<Self>, RecordingReadError> {
        let mut file = behind_magic(path)?;
        let failed = |source| RecordingReadError::Io { path: path.to_owned(), offset: 0, source };
        let Some(begin) = summary_begin(&mut file).map_err(failed)? else { return Ok(None) };
        file.seek(SeekFrom::Start(begin)).map_err(failed)?;
        let mut index = Self { path: path.to_owned(), file, directory: Directory::new(), chunks: Vec::new() };
        Ok(index.read_summary(begin)?.then_some(index))
    }

    /// Whether the summary is whole.
    fn read_summary(&mut self, begin: u64) -> Result<bool, RecordingReadError> {
        let mut framing = Framing::at(begin, &mut self.file);
        let mut schemas = BTreeMap::new();
        loop {
            let step = framing.step();
            let step =
                step.map_err(|source| RecordingReadError::Io { path: self.path.clone(), offset: begin, source })?;
            let Step::Record { opcode, offset } = step else { return Ok(matches!(step, Step::End)) };
            if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::CHUNK_INDEX) {
                continue;
            }
            match parse(opcode, framing.body()) {
                Ok(Record::Schema { header, .. }) => drop(schemas.insert(header.id, (header.name, header.encoding))),
                Ok(Record::Channel(channel)) => {
                    let known = known_channel(&self.path, offset, &channel, schemas.get(&channel.schema_id))?;
                    self.directory.insert(channel.id, known);
                }
                Ok(Record::ChunkIndex(chunk)) => self.chunks.push(chunk),
                _ => return Ok(false),
            }
        }
    }

    fn samples(&mut self, log_ns: &Range<u64>) -> Result<Vec<Recorded>, RecordingReadError> {
        let mut found = Vec::new();
        let mut chunk = ChunkRecords::default();
        let overlaps = |c: &ChunkIndex| c.message_start_time < log_ns.end && c.message_end_time >= log_ns.start;
        let places: Vec<_> =
            self.chunks.iter().filter(|c| overlaps(c)).map(|c| (c.chunk_start_offset, c.chunk_length)).collect();
        for (offset, length) in places {
            let body = self.chunk_body(offset, length);
            let body = body.map_err(|source| RecordingReadError::Io { path: self.path.clone(), offset, source })?;
            if let Err(what) = chunk.read(op::CHUNK, &body) {
                tracing::debug!(offset, what, "a damaged chunk was passed over");
            }
            for (header, range) in chunk.messages.iter().filter(|(header, _)| log_ns.contains(&header.log_time)) {
                if let Some(Some(channel)) = self.directory.get(&header.channel_id) {
                    found.push(recorded(&self.path, offset, *channel, header, chunk.payload(range))?);
                }
            }
        }
        Ok(found)
    }

    fn chunk_body(&mut self, offset: u64, length: u64) -> io::Result<Vec<u8>> {
        if !(RECORD_HEAD..=MAX_RECORD_BYTES).contains(&length) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, format!("its index gives a chunk {length} bytes")));
        }
        self.file.seek(SeekFrom::Start(offset.saturating_add(RECORD_HEAD)))?;
        let mut body = Vec::new();
        self.file.by_ref().take(length - RECORD_HEAD).read_to_end(&mut body)?;
        Ok(body)
    }
}

/// A message as it was recorded.
pub(crate) fn recorded(
    path: &Path,
    offset: u64,
    channel: Channel,
    header: &MessageHeader,
    payload: &[u8],
) -> Result<Recorded, RecordingReadError> {
    let sample = decode(channel, payload).map_err(|reason| RecordingReadError::Payload {
        path: path.to_owned(),
        offset,
        topic: channel.topic(),
        sequence: header.sequence,
        reason,
    })?;
    Ok(Recorded { sample, log_ns: header.log_time, publish_ns: header.publish_time })
}

/// Where the summary begins, if the file ends with a footer that names one.
fn summary_begin(file: &mut (impl Read + Seek)) -> io::Result<Option<u64>> {
    if file.seek(SeekFrom::End(0))? < END_BYTES.unsigned_abs() + MAGIC.len() as u64 {
        return Ok(None);
    }
    let end_at = file.seek(SeekFrom::End(-END_BYTES))?;
    let mut end = [0; END_BYTES as usize];
    file.read_exact(&mut end)?;
    let begin = end[9..17].try_into().map_or(0, u64::from_le_bytes);
    let is_end = end[0] == op::FOOTER && end[29..] == *MAGIC && (MAGIC.len() as u64..end_at).contains(&begin);
    Ok(is_end.then_some(begin))
}
