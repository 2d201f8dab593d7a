//! What a model file does not say and a reader therefore assumes: every key that takes its default.

use super::ModelFile;
use super::machine::{Machine, SNAKE_KEYS, SnakeMachine};
use super::segment_keys::{RADIUS_DOC, SEGMENT_KEYS, WHOLE_KEYS, default_radius_m, default_segment};
use crate::segments::SegmentsParameters;

/// One key that the file leaves out.
#[derive(Clone, Debug, PartialEq)]
pub struct Assumed {
    /// `machine`, `segment` with its number from 1, or the effect.
    pub place: String,
    /// The key.
    pub key: &'static str,
    /// The value that is assumed.
    pub value: f64,
    /// Its unit, range and meaning, or its unit.
    pub doc: &'static str,
}

/// The keys of the machine and of the effects that a file's text leaves out; none for a text that is no model file.
pub fn assumed(text: &str) -> Vec<Assumed> {
    let (Ok(file), Ok(root)) = (ModelFile::parse(text), text.parse::<toml::Table>()) else { return Vec::new() };
    let mut found = Vec::new();
    if let (Machine::Snake(_), Some(machine)) = (file.machine(), root.get("machine").and_then(toml::Value::as_table)) {
        let missing = SNAKE_KEYS.iter().filter(|key| !machine.contains_key(key.name));
        found.extend(missing.map(|key| Assumed {
            place: "machine".to_owned(),
            key: key.name,
            value: (key.get)(&SnakeMachine::default()),
            doc: key.doc,
        }));
    }
    if let (Machine::Segments(_), Some(machine)) = (file.machine(), root.get("machine").and_then(toml::Value::as_table))
    {
        found.extend(of_segments(machine));
    }
    let effects = root.get("effect").and_then(toml::Value::as_array);
    for (effect, given) in file.effects().iter().zip(effects.into_iter().flatten()) {
        let Some(given) = given.as_table() else { continue };
        let specs = effect.setting().kind().definition().parameters;
        found.extend(specs.iter().filter(|spec| !given.contains_key(spec.name)).map(|spec| Assumed {
            place: effect.setting().label().to_owned(),
            key: spec.name,
            value: spec.default,
            doc: spec.unit,
        }));
    }
    found
}

/// The keys that a machine of segments leaves out.
fn of_segments(machine: &toml::Table) -> Vec<Assumed> {
    let missing = WHOLE_KEYS.iter().filter(|key| !machine.contains_key(key.name));
    let whole = missing.map(|key| Assumed {
        place: "machine".to_owned(),
        key: key.name,
        value: (key.get)(&SegmentsParameters::default()),
        doc: key.doc,
    });
    let mut found: Vec<Assumed> = whole.collect();
    let segments = machine.get("segment").and_then(toml::Value::as_array);
    for (idx, given) in segments.into_iter().flatten().enumerate() {
        let Some(given) = given.as_table() else { continue };
        let keys = SEGMENT_KEYS.iter().map(|key| (key.name, (key.get)(&default_segment()), key.doc));
        let all = [("r_m", default_radius_m(), RADIUS_DOC)].into_iter().chain(keys);
        let place = format!("segment {}", idx + 1);
        let missing = all.filter(|(key, ..)| !given.contains_key(*key));
        found.extend(missing.map(|(key, value, doc)| Assumed { place: place.clone(), key, value, doc }));
    }
    found
}
