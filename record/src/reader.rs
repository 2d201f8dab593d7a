//! Reads a recording back, also one that was cut or damaged, as the messages that were recorded.

use crate::between::recorded;
use crate::chunk::ChunkRecords;
use crate::contents::{Contents, Directory, known_channel, scan, scan_beginning, shortened};
use crate::error::RecordingReadError;
use crate::framing::{Framing, Step};
use crate::parse::parse;
use crate::parts::NEXT_PART_KEY;
use crate::writer::{METADATA, METADATA_END};
use krait_ipc::input;
use krait_schema::{Channel, Sample};
use mcap::MAGIC;
use mcap::records::{Record, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Place of the version in an MCAP file's magic.
const VERSION_AT: usize = 5;

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
    /// [`RecordingReadError`] for a file that cannot be read or is no recording of this version. A cut or damaged recording is no
    /// error: see [`Contents::missing`].
    pub fn open(path: &Path) -> Result<Self, RecordingReadError> {
        let (contents, directory) = scan(path, behind_magic(path)?)?;
        Ok(Self { path: path.to_owned(), contents, directory })
    }

    /// Opens a recording and reads only what stands before its first sample: metadata and attachments. Of its samples, and
    /// of what is missing, its [`Contents`] say nothing.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open_beginning(path: &Path) -> Result<Self, RecordingReadError> {
        let contents = scan_beginning(path, behind_magic(path)?)?;
        Ok(Self { path: path.to_owned(), contents, directory: Directory::new() })
    }

    /// Opens a recording and the parts that follow it, where it was rotated. A last part that is not there is missing
    /// without a word, as after a crash; a file of another run is none of its parts.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open_parts(path: &Path) -> Result<Vec<Self>, RecordingReadError> {
        let mut parts = vec![Self::open(path)?];
        while let Some(next) = parts.last().and_then(Self::next_part) {
            if !next.exists() || parts.iter().any(|part| part.path == next) {
                break;
            }
            let next = Self::open(&next)?;
            if next.run_id() != parts[0].run_id() {
                break;
            }
            parts.push(next);
        }
        Ok(parts)
    }

    pub(crate) fn run_id(&self) -> Option<&String> {
        self.contents.metadata.get(METADATA)?.get("run_id")
    }

    fn next_part(&self) -> Option<PathBuf> {
        part_named(&self.path, self.contents.metadata.get(METADATA_END)?)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is in it and what is missing from it.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Its readable samples, in the order in which they were recorded.
    ///
    /// # Errors
    /// [`RecordingReadError::Io`] when the file is gone.
    pub fn samples(&self) -> Result<Samples, RecordingReadError> {
        Ok(Samples {
            path: self.path.clone(),
            directory: self.directory.clone(),
            schemas: BTreeMap::new(),
            wanted: None,
            next_part: None,
            framing: Framing::after_magic(behind_magic(&self.path)?),
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
    /// Name and encoding of the schemas met so far.
    schemas: BTreeMap<u16, (String, String)>,
    /// The channels that are decoded; none means all.
    wanted: Option<Vec<Channel>>,
    /// The part that follows, once its name has been met.
    next_part: Option<PathBuf>,
    framing: Framing<BufReader<File>>,
    chunk: ChunkRecords,
    chunk_offset: u64,
    next_idx: usize,
    is_over: bool,
}

impl Iterator for Samples {
    type Item = Result<Recorded, RecordingReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            while let Some((header, range)) = self.chunk.messages.get(self.next_idx) {
                self.next_idx += 1;
                if let Some(Some(channel)) = self.directory.get(&header.channel_id)
                    && self.wanted.as_ref().is_none_or(|wanted| wanted.contains(channel))
                {
                    let payload = self.chunk.payload(range);
                    return Some(recorded(&self.path, self.chunk_offset, *channel, header, payload));
                }
            }
            if self.is_over {
                return None;
            }
            if let Err(error) = self.next_chunk() {
                self.is_over = true;
                return Some(Err(error));
            }
        }
    }
}

impl Samples {
    /// Decodes samples of these channels only.
    pub(crate) fn only(self, channels: &[Channel]) -> Self {
        Self { wanted: Some(channels.to_vec()), ..self }
    }

    /// The part that follows; known once all samples have been taken.
    pub(crate) fn next_part(&self) -> Option<&Path> {
        self.next_part.as_deref()
    }

    fn next_chunk(&mut self) -> Result<(), RecordingReadError> {
        self.next_idx = 0;
        self.chunk.clear();
        let step = self.framing.step();
        match step.map_err(|source| RecordingReadError::Io {
            path: self.path.clone(),
            offset: self.framing.offset(),
            source,
        })? {
            Step::Record { opcode: op::METADATA, .. } => {
                if let Ok(Record::Metadata(metadata)) = parse(op::METADATA, self.framing.body())
                    && metadata.name == METADATA_END
                {
                    self.next_part = part_named(&self.path, &metadata.metadata);
                }
            }
            Step::Record { opcode, offset } => {
                self.chunk_offset = offset;
                if let Err(what) = self.chunk.read(opcode, self.framing.body()) {
                    tracing::debug!(offset, what, "a damaged record was skipped");
                }
                self.learn_channels(offset)?;
            }
            Step::TooLong { .. } => {}
            _ => self.is_over = true,
        }
        Ok(())
    }

    /// A file that was opened by its beginning is known no further than it has been read.
    fn learn_channels(&mut self, offset: u64) -> Result<(), RecordingReadError> {
        for (schema, _) in self.chunk.schemas.drain(..) {
            self.schemas.insert(schema.id, (shortened(schema.name), shortened(schema.encoding)));
        }
        for channel in self.chunk.channels.drain(..) {
            let known = known_channel(&self.path, offset, &channel, self.schemas.get(&channel.schema_id))?;
            self.directory.insert(channel.id, known);
        }
        Ok(())
    }
}

/// A name that stands in a file is untrusted: only its last component counts.
fn part_named(path: &Path, end: &BTreeMap<String, String>) -> Option<PathBuf> {
    Some(path.with_file_name(Path::new(end.get(NEXT_PART_KEY)?).file_name()?))
}

pub(crate) fn behind_magic(path: &Path) -> Result<BufReader<File>, RecordingReadError> {
    let failed = |source| RecordingReadError::Io { path: path.to_owned(), offset: 0, source };
    let mut file = BufReader::new(input::regular(path, input::ANY_BYTES).map_err(failed)?);
    let mut found = Vec::new();
    file.by_ref().take(MAGIC.len() as u64).read_to_end(&mut found).map_err(failed)?;
    if found == MAGIC {
        Ok(file)
    } else if !found.is_empty() && MAGIC.starts_with(&found) {
        Err(RecordingReadError::NoHeader { path: path.to_owned(), offset: found.len() as u64 })
    } else if found.len() > VERSION_AT && MAGIC.starts_with(&found[..VERSION_AT]) {
        Err(RecordingReadError::McapVersion {
            path: path.to_owned(),
            offset: VERSION_AT as u64,
            found: found[VERSION_AT],
        })
    } else {
        Err(RecordingReadError::NotMcap { path: path.to_owned(), found })
    }
}
