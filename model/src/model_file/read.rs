//! From text to a checked model: every key is known, every value has its kind and its range, every refusal names its line.

use super::error::nearest;
use super::history::{HeldOutRms, HistoryEntry};
use super::machine::{ForceMachine, ForceUnit, Joints, Known, Machine, SNAKE_KEYS, SnakeMachine};
use super::{FileEffect, MODEL_FILE_FORMAT, ModelFile, ModelFileError, gripper, read_effect, read_segments};
use crate::joints::MAX_JOINTS;
use crate::parameters::in_range;
use crate::{ChainError, ParameterError, Snake};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Reads a file's text.
pub(super) fn parse(text: &str) -> Result<ModelFile, ModelFileError> {
    let root = DeTable::parse(text).map_err(|error| ModelFileError::Syntax {
        line: error.span().map_or(1, |span| line_of(text, span.start)),
        reason: error.message().replace('\n', ", "),
    })?;
    let root = Section { text, place: "the file".to_owned(), line: 1, table: root.get_ref() };
    root.only(&["format", "machine", "effect", "gripper", "history"])?;
    let format = root.number("format")?.ok_or_else(|| root.missing("format", "format = 1"))?;
    if format.value != MODEL_FILE_FORMAT as f64 {
        return Err(ModelFileError::OutOfRange {
            line: format.line,
            key: "format".to_owned(),
            found: format.value,
            low: MODEL_FILE_FORMAT as f64,
            high: MODEL_FILE_FORMAT as f64,
            unit: "(the only format there is)",
        });
    }
    let mut machine = machine(&root.section("machine")?.ok_or_else(|| root.missing("machine", "a table [machine]"))?)?;
    if let Some(section) = root.section("gripper")? {
        let Machine::Snake(snake) = &mut machine else {
            return Err(ModelFileError::NoGripper { line: section.line, machine: machine.kind() });
        };
        snake.gripper = Some(Box::new(gripper::gripper(&section)?));
    }
    let effects = effects(&root, &machine)?;
    let history = root.sections("history")?.iter().map(history_entry).collect::<Result<_, _>>()?;
    Ok(ModelFile { machine, effects, history })
}

fn machine(section: &Section) -> Result<Machine, ModelFileError> {
    let kind = section
        .text("kind")?
        .ok_or_else(|| section.missing("kind", "\"snake\", \"segments\", \"joints\" or \"force\""))?;
    match kind.value.as_str() {
        "snake" => snake(section).map(Machine::Snake),
        "segments" => read_segments::segments(section).map(Machine::Segments),
        "joints" => joints(section).map(Machine::Joints),
        "force" => force(section).map(Machine::Force),
        _ => Err(kind.unknown("kind", ["snake", "segments", "joints", "force"])),
    }
}

/// The largest number of joints of a machine of kind force.
const MOST_FORCES: usize = 6;

fn force(section: &Section) -> Result<ForceMachine, ModelFileError> {
    section.only(&["kind", "n", "unit"])?;
    let n = section.number("n")?.ok_or_else(|| section.missing("n", "the number of joints"))?;
    if !(n.value.fract() == 0.0 && (1.0..=MOST_FORCES as f64).contains(&n.value)) {
        return Err(n.out_of_range("n", 1.0, MOST_FORCES as f64, "(a whole number)"));
    }
    let unit = section.text("unit")?.ok_or_else(|| section.missing("unit", "\"Nm\" or \"A\""))?;
    let known = ForceUnit::ALL.into_iter().find(|own| own.word() == unit.value);
    let known = known.ok_or_else(|| unit.unknown("unit", ForceUnit::ALL.map(ForceUnit::word)))?;
    Ok(ForceMachine { n: n.value as usize, unit: known })
}

fn snake(section: &Section) -> Result<SnakeMachine, ModelFileError> {
    let mut known = vec!["kind", "lines"];
    known.extend(SNAKE_KEYS.iter().map(|key| key.name));
    section.only(&known)?;
    let mut machine = SnakeMachine::default();
    for key in &SNAKE_KEYS {
        let Some(given) = section.get(key.name) else { continue };
        // A bare number is checked with all others below, which tells its range.
        if key.is_geometry() && as_number(given.get_ref()).is_none() {
            let (value, known) = number_or_free(section, key.name, given, (key.get)(&machine))?;
            machine = machine.with(key.name, value, known);
        } else if let Some(given) = section.number(key.name)? {
            (key.set)(&mut machine, given.value);
        }
    }
    machine.parameters.rigid_lines = section.rigid_lines()?;
    let checked = Snake::new(&machine.parameters)
        .map(|_| ())
        .and_then(|()| in_range("strain_limit", machine.settings.strain_limit, 0.001, 0.08, "(no unit)"))
        .and_then(|()| in_range("transition_m", machine.settings.transition_m, 1e-9, 1e-3, "m"));
    checked.map_err(|source| {
        let (ParameterError::OutOfRange { key, .. } | ParameterError::Contradiction { key, .. }) = &source;
        ModelFileError::Chain { line: section.line_of_key(key), source: ChainError::Machine(source) }
    })?;
    Ok(machine)
}

fn joints(section: &Section) -> Result<Joints, ModelFileError> {
    section.only(&["kind", "n", "gain", "offset", "u_unit", "y_unit"])?;
    let n = section.number("n")?.ok_or_else(|| section.missing("n", "the number of joints"))?;
    if !(n.value.fract() == 0.0 && (1.0..=MAX_JOINTS as f64).contains(&n.value)) {
        return Err(n.out_of_range("n", 1.0, MAX_JOINTS as f64, "(a whole number)"));
    }
    let n = n.value as usize;
    let word = |key| Ok(section.text(key)?.map_or_else(|| "rad".to_owned(), |unit| unit.value));
    let (gain, gain_known) = gain(section, n)?;
    let (offset, offset_known) = numbers_or_free(section, "offset", n, 0.0)?;
    Ok(Joints { n, gain, gain_known, offset, offset_known, u_unit: word("u_unit")?, y_unit: word("y_unit")? })
}

/// n rows of n numbers are a full matrix, anything else is a diagonal.
fn gain(section: &Section, n: usize) -> Result<(Vec<Vec<f64>>, Vec<Known>), ModelFileError> {
    let rows = section.get("gain").and_then(|value| value.get_ref().as_array().map(|rows| (value, rows)));
    if let Some((value, rows)) = rows.filter(|(_, rows)| rows.iter().all(|row| row.get_ref().is_array())) {
        count(section.line_at(value), "gain", rows.len(), n)?;
        let rows = rows.iter().map(|row| section.numbers("gain", row, n)).collect::<Result<_, _>>()?;
        return Ok((rows, vec![Known::Held; n]));
    }
    let (own, known) = numbers_or_free(section, "gain", n, 1.0)?;
    let row = |i: usize| (0..n).map(|k| if i == k { own[i] } else { 0.0 }).collect();
    Ok(((0..n).map(row).collect(), known))
}

/// One for each joint: a number, "free", or a table with value and standard error. Nothing at all is free as well; one joint needs
/// no brackets.
fn numbers_or_free(
    section: &Section,
    key: &'static str,
    n: usize,
    open: f64,
) -> Result<(Vec<f64>, Vec<Known>), ModelFileError> {
    let Some(value) = section.get(key) else { return Ok((vec![open; n], vec![Known::Absent; n])) };
    if value.get_ref().as_str() == Some("free") {
        return Ok((vec![open; n], vec![Known::Free; n]));
    }
    let items: Vec<&Spanned<DeValue>> = match value.get_ref().as_array() {
        Some(items) => items.iter().collect(),
        None if n == 1 => vec![value],
        None => return Err(section.wrong(key, value, "an array of numbers")),
    };
    count(section.line_at(value), key, items.len(), n)?;
    let one = |item| number_or_free(section, key, item, open);
    Ok(items.into_iter().map(one).collect::<Result<Vec<_>, _>>()?.into_iter().unzip())
}

fn number_or_free<'a>(
    section: &Section<'a>,
    key: &'static str,
    item: &'a Spanned<DeValue<'a>>,
    open: f64,
) -> Result<(f64, Known), ModelFileError> {
    const EXPECTED: &str = "a finite number, \"free\", or { value, se, from, date }";
    if item.get_ref().as_str() == Some("free") {
        return Ok((open, Known::Free));
    }
    let Some(table) = item.get_ref().as_table() else {
        return match as_number(item.get_ref()) {
            Some(number) if number.is_finite() => Ok((number, Known::Held)),
            _ => Err(section.wrong(key, item, EXPECTED)),
        };
    };
    let table = section.inner(format!("[machine] {key}"), item, table);
    table.only(&["value", "se", "from", "date"])?;
    let value = table.number("value")?.ok_or_else(|| table.missing("value", "a number"))?;
    let se = table.number("se")?.ok_or_else(|| table.missing("se", "the value's standard error, or a bare number"))?;
    if !value.value.is_finite() {
        return Err(value.out_of_range("value", f64::NEG_INFINITY, f64::INFINITY, "(a finite number)"));
    }
    if !(se.value.is_finite() && se.value > 0.0) {
        return Err(se.out_of_range("se", 0.0, f64::INFINITY, "(above zero; a bare number is held)"));
    }
    let word = |key| Ok(table.text(key)?.map(|text| text.value));
    Ok((value.value, Known::Fitted { se: se.value, from: word("from")?, date: word("date")? }))
}

fn effects(root: &Section, machine: &Machine) -> Result<Vec<FileEffect>, ModelFileError> {
    let sections = root.sections("effect")?;
    let mut effects = Vec::with_capacity(sections.len());
    for section in &sections {
        effects.push(read_effect::effect(section, machine)?);
        // The whole list so far: what is wrong with it is wrong with its last effect.
        let so_far = ModelFile { machine: machine.clone(), effects, history: Vec::new() };
        so_far.check().map_err(|source| ModelFileError::Chain { line: section.line, source })?;
        effects = so_far.effects;
    }
    Ok(effects)
}

fn history_entry(section: &Section) -> Result<HistoryEntry, ModelFileError> {
    section.only(&["effect", "data", "data_sha256", "date", "heldout_rms_deg", "heldout_rms"])?;
    let word = |key: &'static str, expected| {
        section.text(key)?.map(|text| text.value).ok_or_else(|| section.missing(key, expected))
    };
    // Degrees under a name of their own; any other unit beside the errors.
    let (rms, unit, most) = match section.section("heldout_rms")? {
        Some(rms) => {
            rms.only(&["before", "after", "noise_floor", "unit"])?;
            let unit = rms.text("unit")?.ok_or_else(|| rms.missing("unit", "the unit of the errors, in quotes"))?;
            (rms, unit.value, f64::MAX)
        }
        None => {
            let rms = section.section("heldout_rms_deg")?.ok_or_else(|| {
                section.missing("heldout_rms_deg", "{ before = ..., after = ..., noise_floor = ... }")
            })?;
            rms.only(&["before", "after", "noise_floor"])?;
            (rms, "deg".to_owned(), 360.0)
        }
    };
    let error = |key: &'static str| -> Result<Option<f64>, ModelFileError> {
        match rms.number(key)? {
            Some(given) if !(0.0..=most).contains(&given.value) => {
                Err(given.out_of_range(key, 0.0, most, "(the error's unit)"))
            }
            given => Ok(given.map(|g| g.value)),
        }
    };
    Ok(HistoryEntry {
        effect: word("effect", "the name of an effect")?,
        data: word("data", "the name of the data")?,
        data_sha256: word("data_sha256", "64 hexadecimal digits")?,
        date: section.text("date")?.map(|date| date.value),
        heldout_rms: HeldOutRms {
            before: error("before")?.ok_or_else(|| rms.missing("before", "an error"))?,
            after: error("after")?.ok_or_else(|| rms.missing("after", "an error"))?,
            noise_floor: error("noise_floor")?,
        },
        unit,
    })
}

/// One table of the file.
pub(super) struct Section<'a> {
    text: &'a str,
    pub place: String,
    pub line: usize,
    table: &'a DeTable<'a>,
}

/// A value and where it stands.
pub(super) struct Given<T> {
    pub value: T,
    pub line: usize,
}

impl Given<String> {
    pub(super) fn unknown<'a>(&self, key: &str, known: impl IntoIterator<Item = &'a str>) -> ModelFileError {
        ModelFileError::UnknownWord {
            line: self.line,
            key: key.to_owned(),
            found: self.value.clone(),
            nearest: nearest(&self.value, known),
        }
    }
}

impl Given<f64> {
    fn out_of_range(&self, key: &str, low: f64, high: f64, unit: &'static str) -> ModelFileError {
        ModelFileError::OutOfRange { line: self.line, key: key.to_owned(), found: self.value, low, high, unit }
    }
}

impl<'a> Section<'a> {
    /// Refuses every key that is not in the list.
    pub(super) fn only(&self, known: &[&str]) -> Result<(), ModelFileError> {
        match self.table.keys().find(|key| !known.contains(&key.get_ref().as_ref())) {
            Some(key) => Err(ModelFileError::UnknownKey {
                line: line_of(self.text, key.span().start),
                key: key.get_ref().to_string(),
                place: self.place.clone(),
                nearest: nearest(key.get_ref(), known.iter().copied()),
            }),
            None => Ok(()),
        }
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &str> {
        self.table.keys().map(|key| key.get_ref().as_ref())
    }

    pub(super) fn get(&self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table.get(key)
    }

    /// The line of a key's value, or of the table where the key is missing.
    pub(super) fn line_of_key(&self, key: &str) -> usize {
        self.get(key).map_or(self.line, |value| self.line_at(value))
    }

    pub(super) fn line_at(&self, value: &Spanned<DeValue>) -> usize {
        line_of(self.text, value.span().start)
    }

    pub(super) fn number(&self, key: &str) -> Result<Option<Given<f64>>, ModelFileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let number = as_number(value.get_ref()).ok_or_else(|| self.wrong(key, value, "a number"))?;
        Ok(Some(Given { value: number, line: self.line_at(value) }))
    }

    pub(super) fn text(&self, key: &str) -> Result<Option<Given<String>>, ModelFileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let text = value.get_ref().as_str().ok_or_else(|| self.wrong(key, value, "text in quotes"))?;
        Ok(Some(Given { value: text.to_owned(), line: self.line_at(value) }))
    }

    /// A table within this one.
    pub(super) fn section(&self, key: &str) -> Result<Option<Section<'a>>, ModelFileError> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let table = value.get_ref().as_table().ok_or_else(|| self.wrong(key, value, "a table"))?;
        Ok(Some(self.inner(format!("[{key}]"), value, table)))
    }

    /// Whether the lines are taken for rigid; elastic where nothing is said.
    pub(super) fn rigid_lines(&self) -> Result<bool, ModelFileError> {
        let Some(lines) = self.text("lines")? else { return Ok(false) };
        match lines.value.as_str() {
            "elastic" => Ok(false),
            "rigid" => Ok(true),
            _ => Err(lines.unknown("lines", ["elastic", "rigid"])),
        }
    }

    /// An array of tables within this one.
    pub(super) fn sections(&self, key: &str) -> Result<Vec<Section<'a>>, ModelFileError> {
        let Some(value) = self.get(key) else { return Ok(Vec::new()) };
        let wrong = |value| self.wrong(key, value, "tables, each under a line [[...]]");
        let items = value.get_ref().as_array().ok_or_else(|| wrong(value))?;
        let one = |(k, item): (usize, &'a Spanned<DeValue<'a>>)| {
            let table = item.get_ref().as_table().ok_or_else(|| wrong(item))?;
            let within = self.place.strip_prefix('[').and_then(|own| own.strip_suffix(']'));
            let path = within.map_or_else(|| key.to_owned(), |own| format!("{own}.{key}"));
            Ok(self.inner(format!("[[{path}]] number {}", k + 1), item, table))
        };
        items.iter().enumerate().map(one).collect()
    }

    fn inner(&self, place: String, value: &Spanned<DeValue>, table: &'a DeTable<'a>) -> Section<'a> {
        Section { text: self.text, place, line: self.line_at(value), table }
    }

    fn numbers(&self, key: &str, value: &Spanned<DeValue>, n: usize) -> Result<Vec<f64>, ModelFileError> {
        let numbers = self.all_numbers(key, value)?;
        count(self.line_at(value), key, numbers.len(), n)?;
        Ok(numbers)
    }

    /// The numbers of an array, however many there are.
    pub(super) fn all_numbers(&self, key: &str, value: &Spanned<DeValue>) -> Result<Vec<f64>, ModelFileError> {
        let items = value.get_ref().as_array().ok_or_else(|| self.wrong(key, value, "an array of numbers"))?;
        let number = |item: &Spanned<DeValue>| match as_number(item.get_ref()) {
            Some(number) if number.is_finite() => Ok(number),
            _ => Err(self.wrong(key, item, "a finite number")),
        };
        items.iter().map(number).collect()
    }

    pub(super) fn missing(&self, key: &'static str, expected: &'static str) -> ModelFileError {
        ModelFileError::MissingKey { line: self.line, key, place: self.place.clone(), expected }
    }

    pub(super) fn wrong(&self, key: &str, value: &Spanned<DeValue>, expected: &'static str) -> ModelFileError {
        let found = match value.get_ref() {
            DeValue::Float(x) => x.as_str().to_owned(),
            other => format!("of kind {}", other.type_str()),
        };
        ModelFileError::WrongKind { line: self.line_at(value), key: key.to_owned(), found, expected }
    }
}

pub(super) fn count(line: usize, key: &str, found: usize, expected: usize) -> Result<(), ModelFileError> {
    if found == expected {
        return Ok(());
    }
    Err(ModelFileError::Count { line, key: key.to_owned(), found, expected })
}

pub(super) fn as_number(value: &DeValue) -> Option<f64> {
    match value {
        DeValue::Float(x) => x.as_str().parse().ok(),
        DeValue::Integer(x) => i64::from_str_radix(x.as_str(), x.radix()).ok().map(|n| n as f64),
        _ => None,
    }
}

fn line_of(text: &str, at: usize) -> usize {
    text.as_bytes().iter().take(at).filter(|&&byte| byte == b'\n').count() + 1
}
