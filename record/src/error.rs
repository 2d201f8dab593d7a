//! What can go wrong with a recording, each in one sentence: what, where, expected, found, what to do.

use std::io;
use std::path::PathBuf;

/// A recording could not be begun or not be continued.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] krait_ipc::IpcError),
    /// The machine to be drawn cannot be.
    #[error(transparent)]
    Machine(#[from] krait_model::ChainError),
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(#[from] krait_ipc::setting::SettingError),
    /// The file is there already.
    #[error("{} exists already and a recording never overwrites one; move it away or choose another path", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file or its folder could not be made.
    #[error("{} cannot be created: {source}; choose a path in a folder that can be written", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The disk is full or gone.
    #[error(
        "the recording {} stopped at byte {offset}: {source}; everything up to there is kept, free some space before the next one",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// Length of what is kept.
        offset: u64,
        /// What the system said.
        source: io::Error,
    },
    /// The writing thread could not be started or died.
    #[error("the thread that writes the recording {} {what}; the file is readable up to its last chunk", path.display())]
    Thread {
        /// The file.
        path: PathBuf,
        /// What happened to it.
        what: String,
    },
}

/// A file could not be read as a recording of krait.
#[derive(Debug, thiserror::Error)]
pub enum RecordingReadError {
    /// The file could not be opened or read.
    #[error("{} cannot be read at byte {offset}: {source}; check the path and the disk", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What the system said.
        source: io::Error,
    },
    /// The file does not begin as an MCAP file does.
    #[error("{} is not an MCAP file: it begins with {found:02x?}, expected {expected:02x?}; give a file that `krait` recorded", path.display(), expected = mcap::MAGIC)]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Its first bytes.
        found: Vec<u8>,
    },
    /// The file is an MCAP file of another major version.
    #[error("{} at byte {offset}: MCAP version {:?}, this program reads version '0'; give a file that `krait` recorded", path.display(), char::from(*found))]
    McapVersion {
        /// The file.
        path: PathBuf,
        /// Where the version stands.
        offset: u64,
        /// The version.
        found: u8,
    },
    /// The file ends before its header does.
    #[error("{} is cut at byte {offset}, inside the file header, so nothing can be read; give another copy", path.display())]
    NoHeader {
        /// The file.
        path: PathBuf,
        /// Its length.
        offset: u64,
    },
    /// A file of another program that is cut or damaged.
    #[error("{} at byte {offset}: {what}; give a whole copy of the file, or repair it with the program that wrote it", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What is damaged.
        what: String,
    },
    /// The file is an MCAP file of somebody else.
    #[error("{} is an MCAP file with profile {found:?}, expected \"krait\"; give a file that `krait` recorded", path.display())]
    NotKrait {
        /// The file.
        path: PathBuf,
        /// The profile in its header.
        found: String,
    },
    /// A krait topic or type that this program does not know.
    #[error(
        "{} at byte {offset}: topic {topic:?} has schema {found:?}, expected {expected}; read it with the krait version in its header",
        path.display()
    )]
    UnknownSchema {
        /// The file.
        path: PathBuf,
        /// Where the chunk with the channel begins.
        offset: u64,
        /// The topic.
        topic: String,
        /// The schema's name, encoding and the message encoding.
        found: String,
        /// What this program knows.
        expected: String,
    },
    /// The payload was recorded in another version.
    #[error(
        "{} at byte {offset}: topic {topic:?} has payload version {found}, this program reads version {expected}; read it with the krait version in its header",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Where the chunk with the channel begins.
        offset: u64,
        /// The topic.
        topic: String,
        /// The version in the channel's metadata.
        found: String,
        /// The version of this program.
        expected: u32,
    },
    /// A message's bytes are no message of its type although their chunk is undamaged.
    #[error("{} at byte {offset}: message {sequence} of {topic} is malformed: {reason}; the program that recorded it is at fault", path.display())]
    Payload {
        /// The file.
        path: PathBuf,
        /// Where its chunk begins.
        offset: u64,
        /// The topic.
        topic: &'static str,
        /// Low 32 bits of its sequence number.
        sequence: u32,
        /// What is wrong.
        reason: String,
    },
}
