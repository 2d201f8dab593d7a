//! What can go wrong with a channel, each in one sentence: what, where, expected, found, what to do.

/// A channel could not be opened or used.
#[derive(Debug, thiserror::Error)]
pub enum IpcError {
    /// The instance name cannot be used in file names.
    #[error(
        "instance name {found:?} cannot be used: expected 1 to 32 of a-z, 0-9, '-' and '_'; choose another with --instance"
    )]
    InstanceName {
        /// What was given.
        found: String,
    },
    /// Shared memory or the node's files could not be made.
    #[error(
        "process {process:?} could not join instance {instance:?}: {source_text}; `krait doctor` looks at what it needs"
    )]
    Node {
        /// The instance.
        instance: String,
        /// The process that wanted to join.
        process: String,
        /// What iceoryx2 said.
        source_text: String,
    },
    /// The other side was built with another version of the payload.
    #[error(
        "channel {channel:?} of instance {instance:?} carries payload version {found}, this program speaks version {expected}; run the same krait build in every process"
    )]
    Version {
        /// The instance.
        instance: String,
        /// The channel.
        channel: String,
        /// The version of this program.
        expected: u32,
        /// The version that the channel was made with.
        found: String,
    },
    /// Somebody already writes on the channel.
    #[error(
        "channel {channel:?} of instance {instance:?} already has its one writer; stop that chain or choose another name with --instance"
    )]
    SecondWriter {
        /// The instance.
        instance: String,
        /// The channel.
        channel: String,
    },
    /// The channel was made by a program that lets in more writers, or fewer.
    #[error(
        "channel {channel:?} of instance {instance:?} was made for {found} writers, expected {expected}, so another program than krait has made it; stop that program, or choose another name with --instance"
    )]
    Writers {
        /// The instance.
        instance: String,
        /// The channel.
        channel: String,
        /// Writers that krait allows.
        expected: usize,
        /// Writers that the channel allows.
        found: usize,
    },
    /// All places for readers are taken.
    #[error("channel {channel:?} of instance {instance:?} already has its {limit} readers; stop one of them")]
    TooManyReaders {
        /// The instance.
        instance: String,
        /// The channel.
        channel: String,
        /// Largest number of readers.
        limit: usize,
    },
    /// Any other failure of the channel.
    #[error(
        "channel {channel:?} of instance {instance:?} failed while {doing}: {source_text}; stop every process of that instance and start again: the next start removes what a killed one left behind"
    )]
    Channel {
        /// The instance.
        instance: String,
        /// The channel.
        channel: String,
        /// What was being done.
        doing: &'static str,
        /// What iceoryx2 or the kernel said.
        source_text: String,
    },
}
