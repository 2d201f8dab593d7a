//! The one table of what is recorded: channel, message, name in shared memory, topic, protobuf type.
//!
//! A new channel is one row of [`channels!`]; the channel's place, the sample, its bytes and its reader follow from it.

use crate::convert::Mirrored;
use crate::source::{self, SampleSource};
use crate::status::RecorderStatus;
use krait_ipc::message::{
    Command, DriveCycle, Health, Marker, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState, StateCommand,
};
use krait_ipc::{Bus, IpcError, Process, ReadOptions, health_channel};
use prost::Message as _;

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

macro_rules! schema {
    ($name:literal, $file:literal, $version:expr) => {
        Schema {
            name: concat!("krait.", $name),
            descriptors: include_bytes!(concat!(env!("OUT_DIR"), "/", $file, ".fds")),
            version: $version,
        }
    };
}

/// Channel, what a sample of it holds, its message, name in shared memory, topic, protobuf type and file of each.
macro_rules! channels {
    ($($(#[$doc:meta])* $name:ident($payload:ty): $message:ty, $shared:expr, $topic:literal, $type:literal, $file:literal;)*) => {
        /// A channel of a recording.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Channel {
            $($(#[$doc])* $name,)*
            /// How a process fares.
            Health(Process),
            /// What the recorder has written and could not: exists in recordings only.
            Recorder,
        }

        /// A message of any recorded channel. The large and rare ones are boxed, so that a queue of samples stays small.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Sample {
            $($(#[$doc])* $name($payload),)*
            /// How a process fares.
            Health(Process, Box<Health>),
            /// What the recorder has written and could not.
            Recorder(Box<RecorderStatus>),
        }

        /// Place of each channel; behind them come those of the processes' health.
        enum Place { $($name,)* Health }

        impl Channel {
            /// Channels that are read from shared memory: the first ones of [`Channel::ALL`].
            pub const N_SHARED: usize = Place::Health as usize + Process::ALL.len();

            const NAMED: [Self; Place::Health as usize] = [$(Self::$name),*];

            /// Place in [`Channel::ALL`].
            pub fn index(self) -> usize {
                match self {
                    $(Self::$name => Place::$name as usize,)*
                    Self::Health(process) => Place::Health as usize + process as usize,
                    Self::Recorder => Self::N_SHARED,
                }
            }

            /// Name in the file, as viewers show it.
            pub fn topic(self) -> &'static str {
                match self {
                    $(Self::$name => concat!("/krait/", $topic),)*
                    Self::Health(process) => HEALTH_TOPICS[process as usize],
                    Self::Recorder => "/krait/recorder",
                }
            }

            /// Its protobuf type.
            pub fn schema(self) -> Schema {
                match self {
                    $(Self::$name => schema!($type, $file, <$message>::VERSION),)*
                    Self::Health(_) => schema!("Health", "health", Health::VERSION),
                    Self::Recorder => schema!("RecorderStatus", "recorder_status", RecorderStatus::VERSION),
                }
            }

            /// Opens a reader of it; `None` for [`Channel::Recorder`], which is not in shared memory.
            ///
            /// # Errors
            /// As [`Bus::reader_on`].
            pub fn source(self, bus: &Bus, options: ReadOptions) -> Result<Option<Box<dyn SampleSource>>, IpcError> {
                Ok(match self {
                    $(Self::$name => Some(source::open::<$message>(bus, $shared, options, |message| {
                        Sample::$name(<$payload>::from(*message))
                    })?),)*
                    Self::Health(process) => {
                        let wrap = move |health: &Health| Sample::Health(process, Box::new(*health));
                        Some(source::open(bus, &health_channel(process), options, wrap)?)
                    }
                    Self::Recorder => None,
                })
            }
        }

        impl Sample {
            /// The channel that it belongs to.
            pub fn channel(&self) -> Channel {
                match self {
                    $(Self::$name(_) => Channel::$name,)*
                    Self::Health(process, _) => Channel::Health(*process),
                    Self::Recorder(_) => Channel::Recorder,
                }
            }

            fn position(&self) -> (u64, i64) {
                fn of<M: Message>(message: &M) -> (u64, i64) {
                    (message.sequence(), message.sample_ns())
                }
                match self {
                    $(Self::$name(message) => of::<$message>(message),)*
                    Self::Health(_, message) => of::<Health>(message),
                    Self::Recorder(status) => (status.sequence, status.sample_ns),
                }
            }
        }

        /// Writes a sample's protobuf bytes into a buffer, which is emptied first and keeps its room.
        ///
        /// # Errors
        /// Never for a buffer that can grow; prost states one for buffers that cannot.
        pub fn encode(sample: &Sample, buffer: &mut Vec<u8>) -> Result<(), prost::EncodeError> {
            buffer.clear();
            match sample {
                $(Sample::$name(message) => <$message>::mirror(message).encode(buffer),)*
                Sample::Health(_, message) => message.mirror().encode(buffer),
                Sample::Recorder(status) => status.mirror().encode(buffer),
            }
        }

        /// The sample that a channel's bytes stand for.
        ///
        /// # Errors
        /// What is wrong with the bytes, in words.
        pub fn decode(channel: Channel, bytes: &[u8]) -> Result<Sample, String> {
            Ok(match channel {
                $(Channel::$name => Sample::$name(<$payload>::from(restored::<$message>(bytes)?)),)*
                Channel::Health(process) => Sample::Health(process, Box::new(restored(bytes)?)),
                Channel::Recorder => Sample::Recorder(Box::new(restored(bytes)?)),
            })
        }
    };
}

channels! {
    /// What the operator's hand asks for.
    Input(OperatorInput): OperatorInput, OperatorInput::CHANNEL, "input", "OperatorInput", "operator_input";
    /// Where the snake shall be.
    Setpoint(Setpoint): Setpoint, Setpoint::CHANNEL, "setpoint", "Setpoint", "setpoint";
    /// What the actuators shall do.
    Command(Command): Command, Command::CHANNEL, "command", "Command", "command";
    /// What the actuators do and measure.
    State(SlaveState): SlaveState, SlaveState::CHANNEL, "state", "SlaveState", "slave_state";
    /// A wish to change the operating state.
    StateCommand(StateCommand): StateCommand, StateCommand::CHANNEL, "state_command", "StateCommand", "state_command";
    /// What a camera saw.
    Shape(Shape): Shape, Shape::CHANNEL, "shape", "Shape", "shape";
    /// What the estimator has learnt.
    ModelUpdate(ModelUpdate): ModelUpdate, ModelUpdate::CHANNEL, "model_update", "ModelUpdate", "model_update";
    /// A word of the operator's, by `krait mark`.
    Marker(Box<Marker>): Marker, Marker::CHANNEL, "marker", "Marker", "marker";
    /// A mark by a button of the operator's device.
    DeviceMarker(Box<Marker>): Marker, Marker::DEVICE_CHANNEL, "marker/device", "Marker", "marker";
    /// What the bus of real drives was told and what it answered, cycle by cycle.
    DriveCycle(Box<DriveCycle>): DriveCycle, DriveCycle::CHANNEL, "drive_cycle", "DriveCycle", "drive_cycle";
}

/// Topics of the processes' health, in the order of [`Process::ALL`].
const HEALTH_TOPICS: [&str; Process::ALL.len()] = [
    "/krait/health/master",
    "/krait/health/resolve",
    "/krait/health/compensate",
    "/krait/health/estimate",
    "/krait/health/slave",
    "/krait/health/record",
    "/krait/health/shape",
];

impl Channel {
    /// Every channel, in the order of [`Channel::index`].
    pub const ALL: [Self; Self::N_SHARED + 1] = {
        let mut all = [Self::Recorder; Self::N_SHARED + 1];
        let mut idx = 0;
        while idx < Self::N_SHARED {
            all[idx] = if idx < Self::NAMED.len() {
                Self::NAMED[idx]
            } else {
                Self::Health(Process::ALL[idx - Self::NAMED.len()])
            };
            idx += 1;
        }
        all
    };

    /// The oldest version of its payload whose recorded form reads as today's.
    pub fn oldest_version(self) -> u32 {
        match self {
            // What they lack are the numbers of actuators and joints, and their absence means the three lines of a snake.
            Self::Setpoint | Self::State => 2,
            Self::Command => 4,
            // It had room for fewer reasons; only those that left a trace are in the file.
            Self::Health(_) => 2,
            _ => self.schema().version,
        }
    }

    /// The channel with a topic, or `None` for a topic that krait does not write.
    pub fn from_topic(topic: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|channel| channel.topic() == topic)
    }
}

impl Sample {
    /// Position on its channel, from 1.
    pub fn sequence(&self) -> u64 {
        self.position().0
    }

    /// The instant that it is about, CLOCK_MONOTONIC, nanoseconds.
    pub fn sample_ns(&self) -> i64 {
        self.position().1
    }
}

fn restored<M: Mirrored>(bytes: &[u8]) -> Result<M, String> {
    M::restore(&M::Mirror::decode(bytes).map_err(|error| error.to_string())?)
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
                assert_eq!(channel.topic(), format!("/krait/{}", health_channel(process)));
            }
        }
        assert_eq!(Channel::from_topic("/krait/unknown"), None);
        assert_eq!(Channel::DeviceMarker.topic(), format!("/krait/{}", Marker::DEVICE_CHANNEL));
    }
}
