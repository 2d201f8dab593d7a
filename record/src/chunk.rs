//! What is inside a chunk: checked as a whole, so that a damaged chunk yields nothing rather than half a truth.

use crate::framing::MAX_RECORD_BYTES;
use crate::parse::parse;
use mcap::records::{self, MessageHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::ops::Range;

/// The largest chunk that can be configured, and a message over it.
const MAX_UNPACKED_BYTES: u64 = 20 << 20;
/// A chunk of another program: pictures among its messages make it larger.
const MAX_FOREIGN_BYTES: u64 = 64 << 20;
/// Schemas of other programs take some kilobytes.
const MAX_DEFINITION_BYTES: usize = 256 * 1024;

/// Definitions and messages of one chunk, or of one record outside any chunk.
#[derive(Default)]
pub(crate) struct ChunkRecords {
    pub(crate) schemas: Vec<(records::SchemaHeader, Vec<u8>)>,
    pub(crate) channels: Vec<records::Channel>,
    pub(crate) messages: Vec<(MessageHeader, Range<usize>)>,
    bytes: Vec<u8>,
}

impl ChunkRecords {
    /// A message's payload.
    pub(crate) fn payload(&self, range: &Range<usize>) -> &[u8] {
        self.bytes.get(range.clone()).unwrap_or_default()
    }

    /// Replaces what is held by what a record of the file holds. Anything but a chunk, schema or channel leaves nothing: krait writes each
    /// message into a chunk, whose checksum covers it. One flipped bit makes a message of the index behind a chunk.
    ///
    /// # Errors
    /// What is damaged, in words.
    pub(crate) fn read(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if opcode == op::MESSAGE {
            self.clear();
            return Err("a message in no chunk, where nothing says whether it is whole".to_owned());
        }
        self.read_up_to(opcode, body, MAX_UNPACKED_BYTES)
    }

    /// The same for a record of another program.
    pub(crate) fn read_foreign(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        self.read_up_to(opcode, body, MAX_FOREIGN_BYTES)
    }

    fn read_up_to(&mut self, opcode: u8, body: &[u8], most_bytes: u64) -> Result<(), String> {
        self.clear();
        let result = if opcode == op::CHUNK { self.unpack(body, most_bytes) } else { self.add(opcode, body) };
        result.inspect_err(|_| self.clear())
    }

    /// Forgets what is held.
    pub(crate) fn clear(&mut self) {
        self.schemas.clear();
        self.channels.clear();
        self.messages.clear();
        self.bytes.clear();
    }

    fn unpack(&mut self, body: &[u8], most_bytes: u64) -> Result<(), String> {
        check_chunk_lengths(body)?;
        check_unpacked_length(body, most_bytes)?;
        let mut length = [0; 9];
        length[0] = op::CHUNK;
        length[1..].copy_from_slice(&(body.len() as u64).to_le_bytes());
        let mut reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                .with_skip_start_magic(true)
                .with_skip_end_magic(true)
                .with_prevalidate_chunk_crcs(true)
                .with_record_length_limit(usize::try_from(most_bytes.max(MAX_RECORD_BYTES)).unwrap_or(usize::MAX)),
        );
        let mut rest = std::io::Read::chain(&length[..], body);
        while let Some(event) = reader.next_event() {
            match event.map_err(|error| error.to_string())? {
                LinearReadEvent::ReadRequest(n_wanted) => {
                    let n_room = n_wanted.min(length.len() + body.len());
                    let n_read = std::io::Read::read(&mut rest, reader.insert(n_room)).map_err(|e| e.to_string())?;
                    reader.notify_read(n_read);
                }
                LinearReadEvent::Record { opcode, data } => self.add(opcode, data)?,
            }
        }
        Ok(())
    }

    fn add(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
            return Ok(());
        }
        if opcode != op::MESSAGE && body.len() > MAX_DEFINITION_BYTES {
            return Err(format!(
                "a definition in it takes {} bytes, expected at most {MAX_DEFINITION_BYTES}",
                body.len()
            ));
        }
        match parse(opcode, body)? {
            Record::Schema { header, data } => self.schemas.push((header, data.into_owned())),
            Record::Channel(channel) => self.channels.push(channel),
            Record::Message { header, data } => {
                let begin = self.bytes.len();
                self.bytes.extend_from_slice(&data);
                self.messages.push((header, begin..self.bytes.len()));
            }
            _ => {}
        }
        Ok(())
    }
}

/// Every length in a chunk's header must add up to the length of its record; `mcap` trusts them further than a damaged
/// file deserves.
fn check_chunk_lengths(body: &[u8]) -> Result<(), String> {
    let n_name = u32_at(body, 28).ok_or("its header is cut")?;
    let n_header = 40 + u64::from(n_name);
    let n_compressed = usize::try_from(n_header - 8).ok().and_then(|at| u64_at(body, at)).ok_or("its header is cut")?;
    if n_header.checked_add(n_compressed) != Some(body.len() as u64) {
        return Err("its lengths contradict each other".to_owned());
    }
    Ok(())
}

/// A chunk of a hundred kilobytes can claim, and hold, gigabytes: it is unpacked only if the memory for it is known to be
/// little.
fn check_unpacked_length(body: &[u8], most_bytes: u64) -> Result<(), String> {
    match u64_at(body, 16).ok_or("its header is cut")? {
        n_bytes if n_bytes > most_bytes => Err(format!("it unpacks to {n_bytes} bytes, expected at most {most_bytes}")),
        _ => Ok(()),
    }
}

/// Whether an attachment record is long enough for what its header says; `mcap` assumes so.
pub(crate) fn attachment_lengths_add_up(body: &[u8]) -> bool {
    let after_text = |at: usize| at.checked_add(4)?.checked_add(usize::try_from(u32_at(body, at)?).ok()?);
    let data_at = after_text(16).and_then(after_text);
    let n_rest = data_at.and_then(|at| u64_at(body, at)).and_then(|n_data| n_data.checked_add(12));
    data_at.zip(n_rest).and_then(|(at, n)| n.checked_add(at as u64)) == Some(body.len() as u64)
}

/// Checks that a record that holds no samples is one of those that help to find others: a chunk whose opcode a flipped bit has changed
/// would be passed over else.
///
/// # Errors
/// What is damaged, in words.
pub(crate) fn check_index(opcode: u8, body: &[u8]) -> Result<(), String> {
    let is_whole = match opcode {
        op::MESSAGE_INDEX => u32_at(body, 2).map(|n_bytes| u64::from(n_bytes) + 6) == Some(body.len() as u64),
        op::SUMMARY_OFFSET => body.len() == 17,
        op::DATA_END => body.len() == 4,
        op::CHUNK_INDEX | op::STATISTICS | op::ATTACHMENT_INDEX | op::METADATA_INDEX => parse(opcode, body).is_ok(),
        _ => return Err(format!("a record of kind {opcode}, which krait does not write")),
    };
    if is_whole { Ok(()) } else { Err("its lengths contradict each other".to_owned()) }
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at.checked_add(4)?)?.try_into().ok().map(u32::from_le_bytes)
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..at.checked_add(8)?)?.try_into().ok().map(u64::from_le_bytes)
}
