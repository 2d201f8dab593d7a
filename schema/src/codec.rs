//! The bytes of a sample in the file, and the sample of those bytes.

use crate::channel::Channel;
use crate::convert::Mirrored;
use crate::sample::Sample;
use prost::Message as _;

/// Writes a sample's protobuf bytes into a buffer, which is emptied first and keeps its room.
///
/// # Errors
/// Never for a buffer that can grow; prost states one for buffers that cannot.
pub fn encode(sample: &Sample, buffer: &mut Vec<u8>) -> Result<(), prost::EncodeError> {
    buffer.clear();
    match sample {
        Sample::Input(message) => message.mirror().encode(buffer),
        Sample::Setpoint(message) => message.mirror().encode(buffer),
        Sample::Command(message) => message.mirror().encode(buffer),
        Sample::State(message) => message.mirror().encode(buffer),
        Sample::StateCommand(message) => message.mirror().encode(buffer),
        Sample::Shape(message) => message.mirror().encode(buffer),
        Sample::ModelUpdate(message) => message.mirror().encode(buffer),
        Sample::Health(_, message) => message.mirror().encode(buffer),
        Sample::Marker(message) | Sample::DeviceMarker(message) => message.mirror().encode(buffer),
        Sample::Recorder(status) => status.mirror().encode(buffer),
    }
}

/// The sample that a channel's bytes stand for.
///
/// # Errors
/// What is wrong with the bytes, in words.
pub fn decode(channel: Channel, bytes: &[u8]) -> Result<Sample, String> {
    Ok(match channel {
        Channel::Input => Sample::Input(restored(bytes)?),
        Channel::Setpoint => Sample::Setpoint(restored(bytes)?),
        Channel::Command => Sample::Command(restored(bytes)?),
        Channel::State => Sample::State(restored(bytes)?),
        Channel::StateCommand => Sample::StateCommand(restored(bytes)?),
        Channel::Shape => Sample::Shape(restored(bytes)?),
        Channel::ModelUpdate => Sample::ModelUpdate(restored(bytes)?),
        Channel::Health(process) => Sample::Health(process, Box::new(restored(bytes)?)),
        Channel::Marker => Sample::Marker(Box::new(restored(bytes)?)),
        Channel::DeviceMarker => Sample::DeviceMarker(Box::new(restored(bytes)?)),
        Channel::Recorder => Sample::Recorder(Box::new(restored(bytes)?)),
    })
}

fn restored<M: Mirrored>(bytes: &[u8]) -> Result<M, String> {
    M::restore(&M::Mirror::decode(bytes).map_err(|error| error.to_string())?)
}
