//! The messages that travel between krait's processes: fixed size, `repr(C)`, versioned, with the unit in each field's name.
//!
//! Purpose: one definition of every payload, so that two processes either agree byte for byte or refuse to connect.
//!
//! Terms: a message's `sequence` counts from 1 on its channel without gaps; `sample_ns` is the instant that the content is
//! about (CLOCK_MONOTONIC) and the only time that a control step may integrate with; [`HopStamps`] say when each stage
//! touched the sample and never influence a command.
//!
//! Invalid floats are NaN, never 0 or -1. Flags and enumerations travel as `u32`, because a foreign process could put any
//! bit pattern there; the typed view is checked.

mod actuators;
mod command;
mod cue;
mod drive_cycle;
mod drive_wish;
mod health;
mod marker;
mod model_request;
mod model_update;
mod motion_wish;
mod operator_input;
mod setpoint;
mod shape;
mod slave_state;
mod stamps;
mod state_command;
mod state_request;
mod text;

pub use actuators::{
    Actuators, GRIPPER_WIRE, JAW, JointValues, MAX_ACTUATORS, MAX_JOINTS, N_LINES, N_WITH_GRIPPER, largest, lines,
    n_actuators, n_of_snake, three, used,
};
pub use command::Command;
pub use cue::Cue;
pub use drive_cycle::{ActuatorCycle, DriveCycle};
pub use drive_wish::DriveWish;
pub use health::{Health, N_REASONS_MAX, ReasonRecord};
pub use marker::{MARKER_TEXT_MAX, Marker, MarkerTextError};
pub use model_request::{MODEL_TEXT_MAX, ModelAnswer, ModelRequest};
pub use model_update::{LearningState, LearntValue, MAX_LEARNT, ModelUpdate};
pub use motion_wish::MotionWish;
pub use operator_input::{DeviceState, OperatorInput};
pub use setpoint::{Phase, Setpoint};
pub use shape::{Shape, Validity};
pub use slave_state::{OperatingState, SlaveState};
pub use stamps::{HopStamps, LatencyLimits, N_HOPS};
pub use state_command::{StateCommand, Transition};
pub use state_request::{RequestOutcome, StateAnswer, StateRequest};

use crate::bus::ChannelAddress;
use crate::port::{self, Publish, Subscribe};
use crate::{Bus, IpcError};
use iceoryx2::prelude::ZeroCopySend;

/// A payload that may travel on a channel.
pub trait Message: ZeroCopySend + Copy + core::fmt::Debug + Send + Sync + 'static {
    /// The channel that carries this message, unless a channel is named explicitly (health has one per process).
    const CHANNEL: &'static str;
    /// Counted up whenever a field's meaning, place or unit changes; checked at connect.
    const VERSION: u32;
    /// Samples that a reader's queue can hold: 2 s at 1 kHz, so that a recorder may sleep through a slow disk. Shared
    /// memory has room for that many for each possible reader.
    const DEPTH: usize = USUAL;
    /// Processes that may write on the channel at once: one, except where anybody may ask.
    const MAX_WRITERS: usize = 1;
    /// Position of this message on its channel: 1, 2, 3, ... without gaps.
    fn sequence(&self) -> u64;
    /// The instant that the content is about, CLOCK_MONOTONIC, nanoseconds.
    fn sample_ns(&self) -> i64;
    #[doc(hidden)]
    fn publisher(bus: &Bus, address: &ChannelAddress) -> Result<Box<dyn Publish<Self>>, IpcError> {
        port::publisher(bus, address)
    }
    #[doc(hidden)]
    fn subscriber(bus: &Bus, address: &ChannelAddress, buffer: usize) -> Result<Box<dyn Subscribe<Self>>, IpcError> {
        port::subscriber(bus, address, buffer)
    }
}

/// Depth of most channels: 2 s at 1 kHz.
const USUAL: usize = 2048;
/// Depth of the channels that carry every sample: 1 s at 8 kHz.
const EVERY_SAMPLE: usize = 8192;
/// Depth of channels that carry ten messages a second, or few at all.
const RARE: usize = 128;

/// Implements [`Message`] for a payload with the usual `sequence` and `sample_ns` fields.
macro_rules! message {
    ($type:ty, $channel:literal, $version:literal) => {
        $crate::message::message!($type, $channel, $version, $crate::message::USUAL);
    };
    ($type:ty, $channel:literal, $version:literal, $depth:expr) => {
        $crate::message::message!($type, $channel, $version, $depth, 1);
    };
    ($type:ty, $channel:literal, $version:literal, $depth:expr, $writers:expr) => {
        impl $crate::message::Message for $type {
            const CHANNEL: &'static str = $channel;
            const VERSION: u32 = $version;
            const DEPTH: usize = $depth;
            const MAX_WRITERS: usize = $writers;
            fn sequence(&self) -> u64 {
                self.sequence
            }
            fn sample_ns(&self) -> i64 {
                self.sample_ns
            }
            // The same as without these two, but compiled in this crate and nowhere else.
            fn publisher(
                bus: &$crate::Bus,
                address: &$crate::bus::ChannelAddress,
            ) -> Result<Box<dyn $crate::port::Publish<Self>>, $crate::IpcError> {
                $crate::port::publisher(bus, address)
            }
            fn subscriber(
                bus: &$crate::Bus,
                address: &$crate::bus::ChannelAddress,
                buffer: usize,
            ) -> Result<Box<dyn $crate::port::Subscribe<Self>>, $crate::IpcError> {
                $crate::port::subscriber(bus, address, buffer)
            }
        }
    };
}
pub(crate) use message;
