//! What a model file does not say and a reader therefore assumes: every key that takes its default.

use super::ModelFile;
use super::machine::{Machine, SNAKE_KEYS, SnakeMachine};

/// One key that the file leaves out.
#[derive(Clone, Debug, PartialEq)]
pub struct Assumed {
    /// `machine` or the effect.
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
