//! What is in a recording and what is missing from it: found by one walk through the whole file, trusting nothing in it.

use crate::about::Attachment;
use crate::chunk::{ChunkRecords, attachment_lengths_add_up, check_index};
use crate::error::RecordingReadError;
use crate::framing::{Framing, Step};
use crate::parse::parse;
use crate::recover::DROPPED_KEY;
use crate::writer::{METADATA_END, METADATA_RECOVERED, VERSION_KEY};
use krait_schema::{Channel, View};
use mcap::records::{self, Record, op};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::Path;

/// What a recording holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// Program that recorded it, `krait 0.1.0`.
    pub library: String,
    /// Metadata records by name: `krait` from the beginning, `krait.end` from the end.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Embedded files.
    pub attachments: Vec<Attachment>,
    /// Channels that hold at least one sample.
    pub channels: BTreeMap<Channel, ChannelContents>,
    /// Messages derived for viewers, see [`View`].
    pub n_views: u64,
    /// Messages on topics of other programs.
    pub n_foreign: u64,
    /// Whether the file ends with indexes, so that viewers can jump in it.
    pub is_indexed: bool,
    /// Everything that is known to be missing, in the order of the file; empty for a recording that ended in order.
    pub missing: Vec<Missing>,
}

/// What a recording holds of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelContents {
    /// Readable messages.
    pub n_messages: u64,
    /// Earliest log time, nanoseconds since 1970.
    pub first_log_ns: u64,
    /// Latest log time, nanoseconds since 1970.
    pub last_log_ns: u64,
}

/// Something that a recording lacks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Missing {
    /// The file ends inside a record.
    #[error("the recording is cut inside the record at byte {offset}; samples after it are missing")]
    Cut {
        /// Where that record begins.
        offset: u64,
    },
    /// The file ends after a whole record, but not as a file ends.
    #[error(
        "the recording breaks off at byte {offset}; the recorder was killed or its disk was full, and what came after is missing"
    )]
    End {
        /// Length of the file.
        offset: u64,
    },
    /// The file ends in order, but the recorder gave up before the chain did.
    #[error("the recorder stopped early, as it does on a full disk; later samples are missing")]
    Rest,
    /// The file was made of a damaged one.
    #[error("it was recovered from a damaged file, {n_bytes} bytes of which could not be read")]
    Recovered {
        /// How many.
        n_bytes: u64,
    },
    /// A record is damaged.
    #[error("the record at byte {offset} is damaged: {what}; what it held is missing")]
    Record {
        /// Where it begins.
        offset: u64,
        /// What is wrong with it.
        what: String,
    },
    /// What stands there is no record, so nothing after it can be found.
    #[error("there is no record at byte {offset}; everything from there on is missing")]
    Framing {
        /// Where the records end.
        offset: u64,
    },
    /// Messages whose channel is defined nowhere.
    #[error("{n_messages} messages cannot be read because the definition of their channel is damaged")]
    Definition {
        /// How many.
        n_messages: u64,
    },
    /// What the recorder has counted of itself cannot be read.
    #[error("its own count {key:?} of what is missing is no number, so messages may be missing")]
    Count {
        /// Which.
        key: &'static str,
    },
    /// The recorder itself counted what it could not record.
    #[error("the recorder dropped {n_dropped} messages and {n_lost} never reached it")]
    Messages {
        /// Taken and not written.
        n_dropped: u64,
        /// Never arrived.
        n_lost: u64,
    },
}

/// Attachments and metadata are held in memory; those of a chain take some kilobytes.
const MAX_HELD_BYTES: usize = 32 << 20;
/// Damaged records that are named one by one.
const MAX_MISSING: usize = 1000;

/// Channel ids of a file; `None` for topics of other programs.
pub(crate) type Directory = BTreeMap<u16, Option<Channel>>;

/// Walks through a file behind its magic.
pub(crate) fn scan(path: &Path, source: impl Read) -> Result<(Contents, Directory), RecordingReadError> {
    let mut framing = Framing::after_magic(source);
    let mut scan = Scan::new(path);
    loop {
        let step = framing.step();
        match step.map_err(|source| RecordingReadError::Io {
            path: path.to_owned(),
            offset: framing.offset(),
            source,
        })? {
            Step::Record { opcode, offset } => scan.record(opcode, offset, framing.body())?,
            Step::TooLong { offset, length } => scan.damaged(offset, format!("it claims to hold {length} bytes")),
            ending => return scan.end(&ending),
        }
    }
}

/// Walks through a file behind its magic as far as its first sample: metadata and attachments stand before it.
pub(crate) fn scan_beginning(path: &Path, source: impl Read) -> Result<Contents, RecordingReadError> {
    let mut framing = Framing::after_magic(source);
    let mut scan = Scan::new(path);
    loop {
        let step = framing.step();
        match step.map_err(|source| RecordingReadError::Io {
            path: path.to_owned(),
            offset: framing.offset(),
            source,
        })? {
            Step::Record { opcode: op::CHUNK | op::MESSAGE | op::DATA_END, .. } if scan.has_header => {
                return Ok(scan.contents);
            }
            Step::Record { opcode, offset } => scan.record(opcode, offset, framing.body())?,
            Step::TooLong { offset, length } => scan.damaged(offset, format!("it claims to hold {length} bytes")),
            ending => return scan.end(&ending).map(|(contents, _)| contents),
        }
    }
}

struct Scan<'a> {
    path: &'a Path,
    contents: Contents,
    has_header: bool,
    schemas: BTreeMap<u16, (String, String)>,
    directory: Directory,
    views: BTreeSet<u16>,
    counts: BTreeMap<u16, ChannelContents>,
    chunk: ChunkRecords,
    n_held_bytes: usize,
}

impl<'a> Scan<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            contents: Contents::default(),
            has_header: false,
            schemas: BTreeMap::new(),
            directory: BTreeMap::new(),
            views: BTreeSet::new(),
            counts: BTreeMap::new(),
            chunk: ChunkRecords::default(),
            n_held_bytes: 0,
        }
    }

    fn record(&mut self, opcode: u8, offset: u64, body: &[u8]) -> Result<(), RecordingReadError> {
        match opcode {
            op::CHUNK | op::SCHEMA | op::CHANNEL | op::MESSAGE => self.definitions_and_messages(opcode, offset, body),
            op::ATTACHMENT if !attachment_lengths_add_up(body) => {
                self.damaged(offset, "its lengths contradict each other".to_owned());
                Ok(())
            }
            op::ATTACHMENT | op::METADATA if self.n_held_bytes + body.len() > MAX_HELD_BYTES => {
                self.damaged(offset, format!("attachments and metadata take more than {MAX_HELD_BYTES} bytes"));
                Ok(())
            }
            op::HEADER | op::ATTACHMENT | op::METADATA | op::FOOTER => match parse(opcode, body) {
                Ok(record) => {
                    self.n_held_bytes += body.len();
                    self.outer(record)
                }
                Err(error) => {
                    self.damaged(offset, error.to_string());
                    Ok(())
                }
            },
            _ => {
                if let Err(what) = check_index(opcode, body) {
                    self.damaged(offset, what);
                }
                Ok(())
            }
        }
    }

    fn outer(&mut self, record: Record<'_>) -> Result<(), RecordingReadError> {
        match record {
            Record::Header(header) if !self.has_header => {
                if header.profile != crate::writer::PROFILE {
                    return Err(RecordingReadError::NotKrait { path: self.path.to_owned(), found: header.profile });
                }
                self.has_header = true;
                self.contents.library = header.library;
            }
            Record::Attachment { header, data, .. } => self.contents.attachments.push(Attachment {
                name: header.name,
                media_type: header.media_type,
                data: data.into_owned(),
            }),
            Record::Metadata(metadata) => {
                self.contents.metadata.insert(metadata.name, metadata.metadata);
            }
            Record::Footer(footer) => self.contents.is_indexed = footer.summary_start != 0,
            _ => {}
        }
        Ok(())
    }

    fn definitions_and_messages(&mut self, opcode: u8, offset: u64, body: &[u8]) -> Result<(), RecordingReadError> {
        if let Err(what) = self.chunk.read(opcode, body) {
            self.damaged(offset, what);
        }
        for (schema, _) in self.chunk.schemas.drain(..) {
            self.schemas.insert(schema.id, (shortened(schema.name), shortened(schema.encoding)));
        }
        for channel in self.chunk.channels.drain(..) {
            let known = known_channel(self.path, offset, &channel, self.schemas.get(&channel.schema_id))?;
            self.directory.insert(channel.id, known);
            if View::from_topic(&channel.topic).is_some() {
                self.views.insert(channel.id);
            }
        }
        for (header, _) in &self.chunk.messages {
            let time = header.log_time;
            let first = ChannelContents { n_messages: 0, first_log_ns: time, last_log_ns: time };
            let counts = self.counts.entry(header.channel_id).or_insert(first);
            counts.n_messages += 1;
            counts.first_log_ns = counts.first_log_ns.min(time);
            counts.last_log_ns = counts.last_log_ns.max(time);
        }
        Ok(())
    }

    fn damaged(&mut self, offset: u64, what: String) {
        if self.contents.missing.len() < MAX_MISSING {
            self.contents.missing.push(Missing::Record { offset, what });
        }
    }

    fn end(mut self, ending: &Step) -> Result<(Contents, Directory), RecordingReadError> {
        if !self.has_header {
            let offset = match *ending {
                Step::EndOfFile { offset } | Step::Cut { offset } | Step::Garbage { offset } => offset,
                _ => mcap::MAGIC.len() as u64,
            };
            return Err(RecordingReadError::NoHeader { path: self.path.to_owned(), offset });
        }
        for (id, counts) in &self.counts {
            match self.directory.get(id) {
                Some(Some(channel)) => {
                    self.contents.channels.insert(*channel, *counts);
                }
                Some(None) if self.views.contains(id) => self.contents.n_views += counts.n_messages,
                Some(None) => self.contents.n_foreign += counts.n_messages,
                None => self.contents.missing.push(Missing::Definition { n_messages: counts.n_messages }),
            }
        }
        let end = self.contents.metadata.get(METADATA_END);
        let missing = match *ending {
            Step::EndOfFile { offset } => Some(Missing::End { offset }),
            Step::Cut { offset } => Some(Missing::Cut { offset }),
            Step::Garbage { offset } => Some(Missing::Framing { offset }),
            _ if end.is_none() => Some(Missing::Rest),
            _ => None,
        };
        self.contents.is_indexed &= matches!(ending, Step::End);
        let Contents { metadata, missing: found, .. } = &mut self.contents;
        if let Some(recovered) = metadata.get(METADATA_RECOVERED) {
            let n_bytes = count_of(recovered, DROPPED_KEY);
            found.push(n_bytes.map_or_else(|unknown| unknown, |n_bytes| Missing::Recovered { n_bytes }));
        }
        found.extend(missing);
        if let Some(end) = metadata.get(METADATA_END) {
            match (count_of(end, "n_dropped"), count_of(end, "n_lost")) {
                (Ok(0), Ok(0)) => {}
                (Ok(n_dropped), Ok(n_lost)) => found.push(Missing::Messages { n_dropped, n_lost }),
                (Err(unknown), _) | (_, Err(unknown)) => found.push(unknown),
            }
        }
        Ok((self.contents, self.directory))
    }
}

/// A count that the recorder wrote about itself; 0 where it wrote none.
fn count_of(entries: &BTreeMap<String, String>, key: &'static str) -> Result<u64, Missing> {
    entries.get(key).map_or(Ok(0), |n| n.parse().map_err(|_no_number| Missing::Count { key }))
}

/// Names are held in memory; no name of krait is longer than this, and a cut one is none of krait's.
pub(crate) fn shortened(name: String) -> String {
    if name.len() <= 256 { name } else { name.chars().take(64).collect() }
}

/// The channel that a definition stands for, or `None` for a topic of another program.
pub(crate) fn known_channel(
    path: &Path,
    offset: u64,
    found: &records::Channel,
    schema: Option<&(String, String)>,
) -> Result<Option<Channel>, RecordingReadError> {
    if !found.topic.starts_with("/krait/") {
        return Ok(None);
    }
    let (name, encoding) = schema.map_or(("none", ""), |(name, encoding)| (name, encoding));
    let unknown = |expected: String| RecordingReadError::UnknownSchema {
        path: path.to_owned(),
        offset,
        topic: found.topic.clone(),
        found: format!("{name} ({encoding}, messages {})", found.message_encoding),
        expected,
    };
    let Some(channel) = Channel::from_topic(&found.topic) else {
        return Err(unknown("one of the topics of this version".to_owned()));
    };
    let expected = channel.schema();
    if name != expected.name || encoding != "protobuf" || found.message_encoding != "protobuf" {
        return Err(unknown(format!("{} (protobuf, messages protobuf)", expected.name)));
    }
    match found.metadata.get(VERSION_KEY) {
        Some(version)
            if version.parse().is_ok_and(|found| (channel.oldest_version()..=expected.version).contains(&found)) =>
        {
            Ok(Some(channel))
        }
        version => Err(RecordingReadError::Version {
            path: path.to_owned(),
            offset,
            topic: found.topic.clone(),
            found: version.cloned().unwrap_or_else(|| "none".to_owned()),
            expected: expected.version,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_that_cannot_be_read_is_not_zero() {
        let entries = |n: &str| BTreeMap::from([("n_lost".to_owned(), n.to_owned())]);
        assert_eq!(count_of(&entries("3"), "n_lost").ok(), Some(3));
        for unreadable in ["", "-1", "three"] {
            assert!(matches!(count_of(&entries(unreadable), "n_lost"), Err(Missing::Count { key: "n_lost" })));
        }
        assert_eq!(count_of(&entries("3"), "n_dropped").ok(), Some(0), "a recorder that counts nothing");
    }
}
