//! The one table of what is recorded: channel, topic, protobuf type and its descriptors, payload version.

use krait_ipc::Process;
use krait_ipc::message::{
    Command, Health, Marker, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState, StateCommand,
};

/// A channel of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Channel {
    /// [`OperatorInput`].
    Input,
    /// [`Setpoint`].
    Setpoint,
    /// [`Command`].
    Command,
    /// [`SlaveState`].
    State,
    /// [`StateCommand`].
    StateCommand,
    /// [`Shape`].
    Shape,
    /// [`ModelUpdate`].
    ModelUpdate,
    /// [`Health`] of one process.
    Health(Process),
    /// [`Marker`]s of `krait mark`.
    Marker,
    /// [`Marker`]s of a button of the operator's device.
    DeviceMarker,
    /// [`crate::RecorderStatus`]: exists in recordings only.
    Recorder,
}

impl Channel {
    /// Channels that are read from shared memory: the first ones of [`Channel::ALL`].
    pub const N_SHARED: usize = 15;

    /// Every channel, in the order of [`Channel::index`].
    pub const ALL: [Self; Self::N_SHARED + 1] = [
        Self::Input,
        Self::Setpoint,
        Self::Command,
        Self::State,
        Self::StateCommand,
        Self::Shape,
        Self::ModelUpdate,
        Self::Health(Process::Master),
        Self::Health(Process::Resolve),
        Self::Health(Process::Compensate),
        Self::Health(Process::Estimate),
        Self::Health(Process::Slave),
        Self::Health(Process::Record),
        Self::Marker,
        Self::DeviceMarker,
        Self::Recorder,
    ];

    /// Place in [`Channel::ALL`].
    pub fn index(self) -> usize {
        match self {
            Self::Input => 0,
            Self::Setpoint => 1,
            Self::Command => 2,
            Self::State => 3,
            Self::StateCommand => 4,
            Self::Shape => 5,
            Self::ModelUpdate => 6,
            Self::Health(process) => 7 + process as usize,
            Self::Marker => 13,
            Self::DeviceMarker => 14,
            Self::Recorder => Self::N_SHARED,
        }
    }

    /// Name in the file, as viewers show it.
    pub fn topic(self) -> &'static str {
        match self {
            Self::Input => "/krait/input",
            Self::Setpoint => "/krait/setpoint",
            Self::Command => "/krait/command",
            Self::State => "/krait/state",
            Self::StateCommand => "/krait/state_command",
            Self::Shape => "/krait/shape",
            Self::ModelUpdate => "/krait/model_update",
            Self::Health(Process::Master) => "/krait/health/master",
            Self::Health(Process::Resolve) => "/krait/health/resolve",
            Self::Health(Process::Compensate) => "/krait/health/compensate",
            Self::Health(Process::Estimate) => "/krait/health/estimate",
            Self::Health(Process::Slave) => "/krait/health/slave",
            Self::Health(Process::Record) => "/krait/health/record",
            Self::Marker => "/krait/marker",
            Self::DeviceMarker => "/krait/marker/device",
            Self::Recorder => "/krait/recorder",
        }
    }

    /// The channel with a topic, or `None` for a topic that krait does not write.
    pub fn from_topic(topic: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|channel| channel.topic() == topic)
    }

    /// Its protobuf type.
    pub fn schema(self) -> Schema {
        macro_rules! schema {
            ($name:literal, $file:literal, $version:expr) => {
                Schema {
                    name: concat!("krait.", $name),
                    descriptors: include_bytes!(concat!(env!("OUT_DIR"), "/", $file, ".fds")),
                    version: $version,
                }
            };
        }
        match self {
            Self::Input => schema!("OperatorInput", "operator_input", OperatorInput::VERSION),
            Self::Setpoint => schema!("Setpoint", "setpoint", Setpoint::VERSION),
            Self::Command => schema!("Command", "command", Command::VERSION),
            Self::State => schema!("SlaveState", "slave_state", SlaveState::VERSION),
            Self::StateCommand => schema!("StateCommand", "state_command", StateCommand::VERSION),
            Self::Shape => schema!("Shape", "shape", Shape::VERSION),
            Self::ModelUpdate => schema!("ModelUpdate", "model_update", ModelUpdate::VERSION),
            Self::Health(_) => schema!("Health", "health", Health::VERSION),
            Self::Marker | Self::DeviceMarker => schema!("Marker", "marker", Marker::VERSION),
            Self::Recorder => schema!("RecorderStatus", "recorder_status", crate::RecorderStatus::VERSION),
        }
    }
}

/// A protobuf message type as a file embeds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Full name, `krait.Command`.
    pub name: &'static str,
    /// Serialised `google.protobuf.FileDescriptorSet` of the type's file and its imports, with comments.
    pub descriptors: &'static [u8],
    /// Version of the payload in shared memory that the type mirrors; kept in the channel's metadata.
    pub version: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_knows_its_place_and_topic() {
        for (idx, channel) in Channel::ALL.into_iter().enumerate() {
            assert_eq!(channel.index(), idx);
            assert_eq!(Channel::from_topic(channel.topic()), Some(channel));
            if let Channel::Health(process) = channel {
                assert!(channel.topic().ends_with(&krait_ipc::health_channel(process)));
            }
        }
        assert_eq!(Channel::from_topic("/krait/unknown"), None);
    }
}
