//! The outermost layer of an MCAP file: opcode, length, body, one record after the other, with the offset of each.
//!
//! Read here rather than with `mcap`'s readers because a damaged file needs exact offsets, and because nothing in a file
//! may make this process allocate more than the file holds.

use mcap::MAGIC;
use mcap::records::op;
use std::io::{self, Read};

/// No record of krait is longer; a longer one is skipped.
pub(crate) const MAX_RECORD_BYTES: u64 = 32 << 20;

/// Bytes of a record's opcode and length.
pub(crate) const RECORD_HEAD: u64 = 9;

/// What the next step through a file found.
pub(crate) enum Step {
    /// A record; its body is in [`Framing::body`].
    Record { opcode: u8, offset: u64 },
    /// A record that is too long to be read and was skipped.
    TooLong { offset: u64, length: u64 },
    /// The end magic.
    End,
    /// The file ends between two records.
    EndOfFile { offset: u64 },
    /// The file ends inside a record that begins at `offset`.
    Cut { offset: u64 },
    /// What begins at `offset` is no record.
    Garbage { offset: u64 },
}

/// Walks through the records of a file, after its magic.
pub(crate) struct Framing<R> {
    source: R,
    offset: u64,
    body: Vec<u8>,
    is_after_footer: bool,
}

impl<R: Read> Framing<R> {
    /// Starts behind the magic, which the caller has read.
    pub(crate) fn after_magic(source: R) -> Self {
        Self::at(MAGIC.len() as u64, source)
    }

    /// Starts at a record in the middle of a file.
    pub(crate) fn at(offset: u64, source: R) -> Self {
        Self { source, offset, body: Vec::new(), is_after_footer: false }
    }

    /// Body of the record that the last step found.
    pub(crate) fn body(&self) -> &[u8] {
        &self.body
    }

    /// Bytes walked through.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Goes to the next record. After anything but a record (or one too long), the walk is over.
    pub(crate) fn step(&mut self) -> io::Result<Step> {
        let offset = self.offset;
        if self.is_after_footer {
            let found = self.fill(MAGIC.len() as u64)?;
            return Ok(match () {
                () if self.body == MAGIC => Step::End,
                () if found < MAGIC.len() as u64 => Step::Cut { offset },
                () => Step::Garbage { offset },
            });
        }
        match self.fill(9)? {
            0 => return Ok(Step::EndOfFile { offset }),
            9 => {}
            _ => return Ok(Step::Cut { offset }),
        }
        let [opcode, ref length @ ..] = self.body[..] else { return Ok(Step::Cut { offset }) };
        let Ok(length) = length.try_into().map(u64::from_le_bytes) else { return Ok(Step::Cut { offset }) };
        if opcode == 0 {
            return Ok(Step::Garbage { offset });
        }
        if length > MAX_RECORD_BYTES {
            let skipped = io::copy(&mut self.source.by_ref().take(length), &mut io::sink())?;
            self.offset += skipped;
            return Ok(if skipped == length { Step::TooLong { offset, length } } else { Step::Cut { offset } });
        }
        if self.fill(length)? < length {
            return Ok(Step::Cut { offset });
        }
        self.is_after_footer = opcode == op::FOOTER;
        Ok(Step::Record { opcode, offset })
    }

    /// Reads up to `length` bytes into the body; returns how many there were.
    fn fill(&mut self, length: u64) -> io::Result<u64> {
        self.body.clear();
        let n_read = self.source.by_ref().take(length).read_to_end(&mut self.body)? as u64;
        self.offset += n_read;
        Ok(n_read)
    }
}
