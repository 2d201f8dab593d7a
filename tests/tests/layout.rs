//! The layout that is shipped for Foxglove and Lichtblick names topics and fields that krait publishes: each path is looked up in the
//! schemas that a viewer is given, and those of the recorder in a recording's.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use krait_schema::Channel;
use krait_tests::{Console, Krait, TempFolder, instance_name};
use prost::Message as _;
use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;
use tungstenite::Message;

const PATIENCE: Duration = Duration::from_secs(240);

/// What is needed of `google.protobuf.FileDescriptorSet`.
#[derive(Clone, PartialEq, prost::Message)]
struct Files {
    #[prost(message, repeated, tag = "1")]
    file: Vec<File>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct File {
    #[prost(string, tag = "2")]
    package: String,
    #[prost(message, repeated, tag = "4")]
    message_type: Vec<Kind>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Kind {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, repeated, tag = "2")]
    field: Vec<Field>,
}

#[derive(Clone, PartialEq, prost::Message)]
struct Field {
    #[prost(string, tag = "1")]
    name: String,
    /// 3: repeated.
    #[prost(int32, tag = "4")]
    label: i32,
    /// Full name of a message's type, with a point before it.
    #[prost(string, tag = "6")]
    type_name: String,
}

/// What is published under a topic.
enum Published {
    Protobuf { root: String, kinds: BTreeMap<String, Kind> },
    Json(Value),
}

impl Published {
    fn protobuf(root: &str, descriptors: &[u8]) -> Self {
        let files = Files::decode(descriptors).expect("a descriptor set").file.into_iter();
        let kinds = files.flat_map(|File { package, message_type }| {
            message_type.into_iter().map(move |kind| (format!(".{package}.{}", kind.name), kind))
        });
        Self::Protobuf { root: format!(".{root}"), kinds: kinds.collect() }
    }

    /// Whether a path of fields leads to a value; `[0]` is an element of a list.
    fn has(&self, path: &[&str]) -> bool {
        match self {
            Self::Json(schema) => matches!(path, [name] if !schema["properties"][name].is_null()),
            Self::Protobuf { root, kinds } => {
                let mut kind = kinds.get(root);
                path.iter().all(|part| {
                    let (name, index) = part.split_once('[').map_or((*part, None), |(name, rest)| (name, Some(rest)));
                    let found = kind.and_then(|kind| kind.field.iter().find(|field| field.name == name));
                    kind = found.and_then(|field| kinds.get(&field.type_name));
                    found.is_some_and(|field| {
                        let is_element = index.is_some_and(|rest| rest.trim_end_matches(']').parse::<u32>().is_ok());
                        is_element == (field.label == 3)
                    })
                })
            }
        }
    }
}

/// Every text of the layout that begins as a topic does, be it a name or a value.
fn paths(value: &Value, found: &mut Vec<String>) {
    let mut take = |text: &str| {
        if text.starts_with('/') {
            found.push(text.to_owned());
        }
    };
    match value {
        Value::String(text) => take(text),
        Value::Array(all) => all.iter().for_each(|own| paths(own, found)),
        Value::Object(all) => {
            all.keys().for_each(|name| take(name));
            all.values().for_each(|own| paths(own, found));
        }
        _ => {}
    }
}

/// What is wrong with a path of the layout, if anything.
fn fault_of(path: &str, published: &BTreeMap<String, Published>) -> Option<String> {
    let mut parts = path.split('.');
    let topic = parts.next().expect("a topic");
    let Some(own) = published.get(topic) else { return Some(format!("{path}: there is no topic {topic}")) };
    let fields: Vec<&str> = parts.collect();
    (!own.has(&fields)).then(|| format!("{path}: {topic} has no such field"))
}

#[test]
fn every_path_of_the_shipped_layout_is_a_field_that_is_published() {
    let (instance, folder) = (instance_name("layout"), TempFolder::new("layout"));
    let lab = folder.file("lab");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--lab", &lab, "--foxglove"]);
    let console = Console::of(&mut krait);
    let address = krait.line();
    let path = address.strip_prefix(&format!("Foxglove: ws://127.0.0.1:{}", console.port)).expect("a third address");
    let mut live = console.open(path, &[("Sec-WebSocket-Protocol", "foxglove.sdk.v1")]).expect("a viewer");
    let mut published = BTreeMap::new();
    let recorder = Channel::Recorder.schema();
    published.insert(Channel::Recorder.topic().to_owned(), Published::protobuf(recorder.name, recorder.descriptors));
    while published.len() < 2 {
        let Message::Text(text) = live.read().expect("a message") else { continue };
        let said: Value = serde_json::from_str(&text).expect("JSON");
        for channel in said["channels"].as_array().into_iter().flatten() {
            let text = |key: &str| channel[key].as_str().expect("text").to_owned();
            let own = match text("encoding").as_str() {
                "protobuf" => {
                    let descriptors = STANDARD.decode(text("schema")).expect("base64");
                    Published::protobuf(&text("schemaName"), &descriptors)
                }
                _ => Published::Json(serde_json::from_str(&text("schema")).expect("a schema")),
            };
            published.insert(text("topic"), own);
        }
    }
    let layout =
        std::fs::read_to_string(format!("{}/../docs/krait.layout.json", env!("CARGO_MANIFEST_DIR"))).expect("a layout");
    let mut all = Vec::new();
    paths(&serde_json::from_str(&layout).expect("JSON"), &mut all);
    let faults: Vec<String> = all.iter().filter_map(|path| fault_of(path, &published)).collect();
    assert!(all.len() > 30 && faults.is_empty(), "{} paths, of which wrong: {faults:#?}", all.len());
    // What is not published is found out.
    for wrong in [
        "/krait/states.operating_state",
        "/krait/state.operating",
        "/krait/state.measured_q_m.line_99",
        "/krait/state.measured_q_m[0]",
        "/krait/command.learnt.value",
        "/krait/bends.setpoint_rad",
    ] {
        assert!(fault_of(wrong, &published).is_some(), "{wrong}");
    }
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}
