//! One recorded message, whichever channel it came from.

use crate::channel::Channel;
use crate::status::RecorderStatus;
use krait_ipc::Process;
use krait_ipc::message::{
    Command, Health, Marker, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState, StateCommand,
};

/// A message of any recorded channel. The large and rare ones are boxed, so that a queue of samples stays small.
#[derive(Clone, Debug, PartialEq)]
pub enum Sample {
    /// What the operator's hand asks for.
    Input(OperatorInput),
    /// Where the snake shall be.
    Setpoint(Setpoint),
    /// What the actuators shall do.
    Command(Command),
    /// What the actuators do and measure.
    State(SlaveState),
    /// A wish to change the operating state.
    StateCommand(StateCommand),
    /// What a camera saw.
    Shape(Shape),
    /// What the estimator has learnt.
    ModelUpdate(ModelUpdate),
    /// How a process fares.
    Health(Process, Box<Health>),
    /// A word of the operator's, by `krait mark`.
    Marker(Box<Marker>),
    /// A mark by a button of the operator's device.
    DeviceMarker(Box<Marker>),
    /// What the recorder has written and could not.
    Recorder(Box<RecorderStatus>),
}

impl Sample {
    /// The channel that it belongs to.
    pub fn channel(&self) -> Channel {
        match self {
            Self::Input(_) => Channel::Input,
            Self::Setpoint(_) => Channel::Setpoint,
            Self::Command(_) => Channel::Command,
            Self::State(_) => Channel::State,
            Self::StateCommand(_) => Channel::StateCommand,
            Self::Shape(_) => Channel::Shape,
            Self::ModelUpdate(_) => Channel::ModelUpdate,
            Self::Health(process, _) => Channel::Health(*process),
            Self::Marker(_) => Channel::Marker,
            Self::DeviceMarker(_) => Channel::DeviceMarker,
            Self::Recorder(_) => Channel::Recorder,
        }
    }

    /// Position on its channel, from 1.
    pub fn sequence(&self) -> u64 {
        self.position().0
    }

    /// The instant that it is about, CLOCK_MONOTONIC, nanoseconds.
    pub fn sample_ns(&self) -> i64 {
        self.position().1
    }

    fn position(&self) -> (u64, i64) {
        fn of(message: &impl Message) -> (u64, i64) {
            (message.sequence(), message.sample_ns())
        }
        match self {
            Self::Input(message) => of(message),
            Self::Setpoint(message) => of(message),
            Self::Command(message) => of(message),
            Self::State(message) => of(message),
            Self::StateCommand(message) => of(message),
            Self::Shape(message) => of(message),
            Self::ModelUpdate(message) => of(message),
            Self::Health(_, message) => of(&**message),
            Self::Marker(message) | Self::DeviceMarker(message) => of(&**message),
            Self::Recorder(status) => (status.sequence, status.sample_ns),
        }
    }
}
