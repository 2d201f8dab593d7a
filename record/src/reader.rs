//! Reads a recording back, also one that was cut or damaged, as the messages that were recorded.

use crate::channel::Channel;
use crate::chunk::ChunkRecords;
use crate::codec;
use crate::contents::{Contents, Directory, scan};
use crate::error::ReadError;
use crate::framing::{Framing, Step};
use crate::sample::Sample;
use mcap::MAGIC;
use mcap::records::MessageHeader;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

/// A recording whose contents are known. It is streamed, never loaded whole.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    contents: Contents,
    directory: Directory,
}

/// One sample as it was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// The sample.
    pub sample: Sample,
    /// When it counts as recorded, nanoseconds since 1970; what viewers sort by.
    pub log_ns: u64,
    /// The instant that it is about, nanoseconds since 1970.
    pub publish_ns: u64,
}

impl Recording {
    /// Opens a recording and walks through it once, so that everything that is missing or damaged is known.
    ///
    /// # Errors
    /// [`ReadError`] for a file that cannot be read or is no recording of this version. A cut or damaged recording is no
    /// error: see [`Contents::missing`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let (contents, directory) = scan(path, open_behind_magic(path)?)?;
        Ok(Self { path: path.to_owned(), contents, directory })
    }

    /// What is in it and what is missing from it.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Its readable samples, in the order in which they were recorded.
    ///
    /// # Errors
    /// [`ReadError::Io`] when the file is gone.
    pub fn samples(&self) -> Result<Samples, ReadError> {
        Ok(Samples {
            path: self.path.clone(),
            directory: self.directory.clone(),
            framing: Framing::after_magic(open_behind_magic(&self.path)?),
            chunk: ChunkRecords::default(),
            chunk_offset: 0,
            next_idx: 0,
            is_over: false,
        })
    }
}

/// The samples of a recording. Damaged records are skipped; they are named in [`Contents::missing`].
pub struct Samples {
    path: PathBuf,
    directory: Directory,
    framing: Framing<BufReader<File>>,
    chunk: ChunkRecords,
    chunk_offset: u64,
    next_idx: usize,
    is_over: bool,
}

impl Iterator for Samples {
    type Item = Result<Recorded, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            while let Some((header, range)) = self.chunk.messages.get(self.next_idx) {
                self.next_idx += 1;
                if let Some(Some(channel)) = self.directory.get(&header.channel_id) {
                    return Some(self.recorded(*channel, header, self.chunk.payload(range)));
                }
            }
            if self.is_over {
                return None;
            }
            if let Err(source) = self.next_chunk() {
                self.is_over = true;
                return Some(Err(ReadError::Io { path: self.path.clone(), offset: self.framing.offset(), source }));
            }
        }
    }
}

impl Samples {
    fn next_chunk(&mut self) -> io::Result<()> {
        self.next_idx = 0;
        self.chunk.clear();
        match self.framing.step()? {
            Step::Record { opcode, offset } => {
                self.chunk_offset = offset;
                if let Err(what) = self.chunk.read(opcode, self.framing.body()) {
                    tracing::debug!(offset, what, "a damaged record was skipped");
                }
            }
            Step::TooLong { .. } => {}
            _ => self.is_over = true,
        }
        Ok(())
    }

    fn recorded(&self, channel: Channel, header: &MessageHeader, payload: &[u8]) -> Result<Recorded, ReadError> {
        let sample = codec::decode(channel, payload).map_err(|reason| ReadError::Payload {
            path: self.path.clone(),
            offset: self.chunk_offset,
            topic: channel.topic(),
            sequence: header.sequence,
            reason,
        })?;
        Ok(Recorded { sample, log_ns: header.log_time, publish_ns: header.publish_time })
    }
}

fn open_behind_magic(path: &Path) -> Result<BufReader<File>, ReadError> {
    let failed = |source| ReadError::Io { path: path.to_owned(), offset: 0, source };
    let mut file = BufReader::new(File::open(path).map_err(failed)?);
    let mut found = Vec::new();
    file.by_ref().take(MAGIC.len() as u64).read_to_end(&mut found).map_err(failed)?;
    if found == MAGIC {
        Ok(file)
    } else if !found.is_empty() && MAGIC.starts_with(&found) {
        Err(ReadError::NoHeader { path: path.to_owned(), offset: found.len() as u64 })
    } else {
        Err(ReadError::NotMcap { path: path.to_owned(), found })
    }
}
