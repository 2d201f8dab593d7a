//! The messages of an MCAP file of another program, for readers of other types: every length in it is checked, as in krait's own.

use crate::RecordingReadError;
use crate::chunk::ChunkRecords;
use crate::contents::shortened;
use crate::framing::{Framing, MAX_RECORD_BYTES, Step};
use crate::parse::parse;
use crate::reader::behind_magic;
use crate::writer::PROFILE;
use mcap::records::{Record, op};
use std::collections::BTreeMap;
use std::path::Path;

/// Channels that a file may define; a robot has some hundred.
const MOST_CHANNELS: usize = 4096;

/// A topic of another program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ForeignTopic {
    /// Its name: `/joint_states`.
    pub name: String,
    /// Name of its messages' type: `sensor_msgs/msg/JointState`; empty where the file has none.
    pub schema: String,
    /// How its messages are written: `cdr`.
    pub encoding: String,
}

/// Whether the header of an MCAP file names another program than krait.
///
/// # Errors
/// [`RecordingReadError`]: the file cannot be read, or ends in its header.
pub fn is_foreign(path: &Path) -> Result<bool, RecordingReadError> {
    let mut framing = Framing::after_magic(behind_magic(path)?);
    let failed = |source| RecordingReadError::Io { path: path.to_owned(), offset: 0, source };
    let Step::Record { opcode: op::HEADER, .. } = framing.step().map_err(failed)? else { return Ok(false) };
    Ok(matches!(parse(op::HEADER, framing.body()), Ok(Record::Header(header)) if header.profile != PROFILE))
}

/// Gives every message of a file to `take`, in the file's order: the channel's number, its topic, the log time (ns), the payload.
///
/// # Errors
/// [`RecordingReadError::Io`], [`RecordingReadError::Damaged`] with its place, or what `take` refuses.
pub fn foreign_messages<E: From<RecordingReadError>>(
    path: &Path,
    mut take: impl FnMut(u16, &ForeignTopic, u64, &[u8]) -> Result<(), E>,
) -> Result<(), E> {
    let mut framing = Framing::after_magic(behind_magic(path)?);
    let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
    let mut topics: BTreeMap<u16, ForeignTopic> = BTreeMap::new();
    let mut chunk = ChunkRecords::default();
    let damaged = |offset: u64, what: String| RecordingReadError::Damaged { path: path.to_owned(), offset, what };
    loop {
        let step = framing.step().map_err(|source| RecordingReadError::Io {
            path: path.to_owned(),
            offset: framing.offset(),
            source,
        })?;
        let (opcode, offset) = match step {
            Step::Record { opcode: op::DATA_END, .. } | Step::End => return Ok(()),
            Step::Record { opcode, offset } => (opcode, offset),
            Step::TooLong { offset, length } => {
                let what = format!("a record of {length} bytes, expected at most {MAX_RECORD_BYTES}");
                return Err(damaged(offset, what).into());
            }
            Step::EndOfFile { offset } | Step::Cut { offset } => {
                return Err(damaged(offset, "the file ends before its data do".to_owned()).into());
            }
            Step::Garbage { offset } => return Err(damaged(offset, "what stands there is no record".to_owned()).into()),
        };
        chunk.read_foreign(opcode, framing.body()).map_err(|what| damaged(offset, what))?;
        for (schema, _) in chunk.schemas.drain(..) {
            schemas.insert(schema.id, shortened(schema.name));
        }
        for channel in chunk.channels.drain(..) {
            let schema = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
            let (name, encoding) = (shortened(channel.topic), shortened(channel.message_encoding));
            topics.insert(channel.id, ForeignTopic { name, schema, encoding });
        }
        if topics.len().max(schemas.len()) > MOST_CHANNELS {
            return Err(damaged(offset, format!("more than {MOST_CHANNELS} channels are defined")).into());
        }
        for (header, range) in &chunk.messages {
            let topic = topics.get(&header.channel_id).ok_or_else(|| {
                damaged(offset, format!("a message of channel {} that is not defined", header.channel_id))
            })?;
            take(header.channel_id, topic, header.log_time, chunk.payload(range))?;
        }
    }
}
