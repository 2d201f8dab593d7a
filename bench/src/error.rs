//! Why a measurement could not be made, each in one sentence.

use std::path::PathBuf;

/// A chain could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A setting is out of range.
    #[error("{option} is {found}: expected {expected}")]
    Setting {
        /// The option of the command line.
        option: &'static str,
        /// What was given.
        found: String,
        /// The range.
        expected: &'static str,
    },
    /// A file or folder could not be made, read or written.
    #[error("{} could not be {doing}: {source}", path.display())]
    File {
        /// What was being done.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The kernel's random numbers.
    #[error("the bench gets no random numbers from the kernel for the names of its files: {0}")]
    Random(rand::rngs::SysError),
    /// A process could not be started or did not become ready.
    #[error("process {role} of chain {chain} {what}; run the same command again, or leave the chain out with --chains")]
    Process {
        /// The chain.
        chain: &'static str,
        /// source, relay-1, relay-2 or sink.
        role: &'static str,
        /// What happened.
        what: String,
    },
    /// Passing a message failed.
    #[error("chain {chain}: {doing} failed: {what}")]
    Transport {
        /// The chain.
        chain: &'static str,
        /// What was being done.
        doing: &'static str,
        /// What the library or the system said.
        what: String,
    },
    /// The picture could not be drawn.
    #[error("the picture could not be drawn: {0}")]
    Picture(String),
}

impl BenchError {
    /// For `map_err`: a file that could not be dealt with.
    pub(crate) fn file(doing: &'static str, path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { doing, path, source }
    }

    /// For `map_err`: a transport that failed.
    pub fn transport<E: core::fmt::Debug>(chain: &'static str, doing: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self::Transport { chain, doing, what: format!("{error:?}") }
    }
}
