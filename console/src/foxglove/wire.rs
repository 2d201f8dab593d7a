//! The protocol's messages as text and bytes: what a server of version 1 says, and the two things that a reader may ask.
//!
//! Source: the specification of `foxglove.websocket.v1` (docs/spec.md of foxglove/ws-protocol); `foxglove.sdk.v1` is the same for a
//! reader.

use super::figures;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use krait_schema::{Channel, Schema, View};
use serde::Deserialize;
use serde_json::{Value, json};

/// Names of the protocol, the newer one first.
pub(super) const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Opcode of a message's data.
const MESSAGE_DATA: u8 = 1;

/// What viewers can read: every channel of shared memory, what is drawn, and the figures in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topic {
    /// A channel of the chain.
    Channel(Channel),
    /// Something that viewers draw.
    View(View),
    /// How far the machine is from where it shall be.
    TrackingError,
    /// Every bend, or every joint.
    Bends,
}

impl Topic {
    /// How many there are.
    pub(super) const COUNT: usize = Channel::N_SHARED + View::ALL.len() + 2;

    /// All of them, in the order of [`Topic::id`].
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let channels = Channel::ALL.into_iter().take(Channel::N_SHARED).map(Self::Channel);
        channels.chain(View::ALL.into_iter().map(Self::View)).chain([Self::TrackingError, Self::Bends])
    }

    /// Its number on the wire.
    pub(super) fn id(self) -> usize {
        match self {
            Self::Channel(channel) => channel.index(),
            Self::View(view) => Channel::N_SHARED + view.index(),
            Self::TrackingError => Channel::N_SHARED + View::ALL.len(),
            Self::Bends => Channel::N_SHARED + View::ALL.len() + 1,
        }
    }
}

/// The first message: nothing but reading is offered.
pub(super) fn server_info(instance: &str, session: &str) -> String {
    json!({ "op": "serverInfo", "name": format!("krait {instance}"), "capabilities": [], "sessionId": session })
        .to_string()
}

/// The second one: every topic with its schema. `unit` is that of the figures: `deg`, or `mm` of joints that slide.
pub(super) fn advertise(unit: &str, n_joints: usize) -> String {
    let topics = Topic::all().map(|topic| match topic {
        Topic::Channel(channel) => protobuf(topic, channel.topic(), channel.schema()),
        Topic::View(view) => protobuf(topic, view.topic(), view.schema()),
        Topic::TrackingError => figure(topic, "/krait/tracking_error", "TrackingError", &figures::error_schema(unit)),
        Topic::Bends => figure(topic, "/krait/bends", "Bends", &figures::bends_schema(unit, n_joints)),
    });
    json!({ "op": "advertise", "channels": topics.collect::<Vec<_>>() }).to_string()
}

fn protobuf(topic: Topic, name: &str, schema: Schema) -> Value {
    json!({
        "id": topic.id(), "topic": name, "encoding": "protobuf", "schemaName": schema.name, "schemaEncoding": "protobuf",
        "schema": base64(schema.descriptors),
    })
}

fn figure(topic: Topic, name: &str, kind: &str, schema: &Value) -> Value {
    json!({
        "id": topic.id(), "topic": name, "encoding": "json", "schemaName": format!("krait.{kind}"),
        "schemaEncoding": "jsonschema", "schema": schema.to_string(),
    })
}

/// A sentence for whoever sits at the viewer.
pub(super) fn status(level: Level, sentence: &str) -> String {
    json!({ "op": "status", "level": level as u8, "message": sentence, "id": sentence.split(' ').next() }).to_string()
}

/// How much a sentence matters.
#[derive(Clone, Copy, Debug)]
pub(super) enum Level {
    /// Something is missing.
    Warning = 1,
    /// Something was refused.
    Error = 2,
}

/// A message's data for one subscription; `wall_ns` counts from 1970.
pub(super) fn message_data(subscription: u32, wall_ns: u64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + payload.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend_from_slice(&subscription.to_le_bytes());
    bytes.extend_from_slice(&wall_ns.to_le_bytes());
    bytes.extend_from_slice(payload);
    bytes
}

/// What a reader may ask.
#[derive(Debug, Deserialize, PartialEq, Eq)]
#[serde(tag = "op", rename_all = "camelCase")]
pub(super) enum Asked {
    /// Messages of topics.
    Subscribe {
        /// Each with a number that the viewer chose.
        subscriptions: Vec<Subscription>,
    },
    /// No more of them.
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        /// The numbers that the viewer chose.
        subscription_ids: Vec<u32>,
    },
}

/// One subscription.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "camelCase")]
pub(super) struct Subscription {
    /// The viewer's number.
    pub(super) id: u32,
    /// The topic's number.
    pub(super) channel_id: usize,
}

/// Bytes as base64 with padding (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_its_standard() {
        let pairs =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")];
        for (plain, text) in pairs {
            assert_eq!(base64(plain.as_bytes()), text);
        }
        assert_eq!(base64(&[0xff, 0xfe, 0xfd]), "//79");
    }

    #[test]
    fn numbers_of_topics_are_their_places_and_a_reader_asks_two_things() {
        assert!(Topic::all().enumerate().all(|(place, topic)| topic.id() == place));
        assert_eq!(Topic::all().count(), Topic::COUNT);
        let asked = |text| serde_json::from_str::<Asked>(text);
        let one = asked(r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":3}]}"#).expect("understood");
        assert_eq!(one, Asked::Subscribe { subscriptions: vec![Subscription { id: 7, channel_id: 3 }] });
        let none = asked(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#).expect("understood");
        assert_eq!(none, Asked::Unsubscribe { subscription_ids: vec![7] });
        assert!(asked(r#"{"op":"advertise","channels":[]}"#).is_err());
        assert_eq!(message_data(2, 3, b"x"), [1, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, b'x']);
    }
}
