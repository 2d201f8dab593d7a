//! From a model to text that reads back as the same model, with or without what each key means.

use super::gripper::{self, FileGripper};
use super::machine::{ForceMachine, Joints, Known, Machine, SNAKE_KEYS, SnakeMachine};
use super::{FileEffect, HistoryEntry, MODEL_FILE_FORMAT, ModelFile, Origin, write_segments};
use crate::effects::{Definition, EffectKind, FORMULA_VARIABLES, Inverse, SLOPE, SegmentEffect, Varying};
use crate::joints::JointEffect;
use crate::segments::{SEGMENT_EFFECTS, SegmentParameters, SegmentsParameters};
use crate::{EffectSetting, Learn};

/// The text of a model file.
pub(super) fn to_toml(file: &ModelFile, documented: bool) -> String {
    let mut out = Out { text: String::new(), documented };
    out.line(&format!("format = {MODEL_FILE_FORMAT}"), "the only format there is");
    out.line("\n[machine]", "");
    match &file.machine {
        Machine::Snake(snake) => out.snake(snake),
        Machine::Segments(segments) => write_segments::segments(&mut out, segments),
        Machine::Joints(joints) => out.joints(joints),
        Machine::Force(force) => out.force(force),
    }
    file.effects.iter().for_each(|effect| out.effect("effect", effect));
    if let Machine::Snake(SnakeMachine { gripper: Some(own), .. }) = &file.machine {
        gripper::write(&mut out, own);
    }
    file.history.iter().for_each(|entry| out.entry(entry));
    out.text
}

/// A snake's model file that names every key of the machine, and as comments every effect with its defaults and what they
/// mean, the variables of formulas, and the same for joints.
///
/// As it stands it is a model of elastic lines alone; an effect is added by taking its `#` away.
pub fn documented_defaults() -> String {
    let mut out = Out { text: String::new(), documented: true };
    out.line(&format!("format = {MODEL_FILE_FORMAT}"), "the only format there is");
    out.line("\n[machine]", "");
    out.snake(&SnakeMachine::default());
    out.comment("\nEvery effect with its defaults; take the `# ` away from the lines of those that the machine has. A parameter is");
    out.comment("learnt while the machine moves with, for example, `eta = { value = 1.0, learn = { sd = 0.3, memory_s = 3600.0 } }`.");
    let mut effects = Out { text: String::new(), documented: true };
    for kind in EffectKind::ALL.into_iter().filter(|kind| *kind != EffectKind::Formula) {
        effects.effect("effect", &FileEffect::new(EffectSetting::new(kind)));
    }
    for line in effects.text.lines() {
        out.comment(line);
    }
    out.comment("\n[[effect]]: formula, the user's own; variables:");
    for variable in FORMULA_VARIABLES {
        let hooks: Vec<_> = variable.hooks.iter().map(|hook| hook.word()).collect();
        out.comment(&format!("  {} [{}], at {}", variable.name, variable.meaning, hooks.join(", ")));
    }
    out.comment(
        "\nA gripper at the end of a snake; its wire's effects are those of joints, below, each as [[gripper.effect]].",
    );
    let mut own = Out { text: String::new(), documented: true };
    if let Ok(example) = FileGripper::example() {
        gripper::write(&mut own, &example);
    }
    for line in own.text.lines() {
        out.comment(line);
    }
    let names = SEGMENT_EFFECTS.map(EffectKind::name).join(", ");
    out.comment("\nAnother kind of machine, snakes in series on any lines. It can have the effects");
    out.comment(&format!("{names}, as above,"));
    let of_second = SegmentEffect::all().filter(|effect| effect.segment == 1).map(|effect| effect.definition().name);
    let of_second = of_second.collect::<Vec<_>>().join(", ");
    out.comment(&format!("and beside them, not learnt, those of one segment: of the second one {of_second}."));
    for line in documented_segments().lines() {
        out.comment(line);
    }
    out.comment("\nAnother kind of machine, any cable-driven joint or instrument; `krait run` drives up to 8 joints.");
    for line in documented_joints().lines() {
        out.comment(line);
    }
    out.text
}

/// Two segments of the paper's dimensions, the second one's lines between those of the first.
fn documented_segments() -> String {
    let mut out = Out { text: String::new(), documented: true };
    out.line("[machine]", "");
    let of = |first_deg: f64| {
        SegmentParameters::of_table_i(&[0.0, 120.0, 240.0].map(|deg: f64| (first_deg + deg).to_radians()))
    };
    let segments = vec![of(0.0), of(60.0)];
    write_segments::segments(&mut out, &SegmentsParameters { segments, ..SegmentsParameters::default() });
    out.text
}

/// The same for one joint.
fn documented_joints() -> String {
    let mut out = Out { text: String::new(), documented: true };
    out.line("[machine]", "");
    let unit = "rad".to_owned();
    let (gain, offset) = (vec![vec![1.0]], vec![0.0]);
    let (gain_known, offset_known) = (vec![Known::Held], vec![Known::Held]);
    out.joints(&Joints { n: 1, gain, gain_known, offset, offset_known, u_unit: unit.clone(), y_unit: unit });
    for effect in JointEffect::ALL {
        out.effect("effect", &FileEffect::new(EffectSetting::new(EffectKind::Joint(effect))));
    }
    out.text
}

pub(super) struct Out {
    text: String,
    documented: bool,
}

impl Out {
    pub(super) fn line(&mut self, text: &str, doc: &str) {
        self.text.push_str(text);
        if self.documented && !doc.is_empty() {
            self.text.push_str("  # ");
            self.text.push_str(doc);
        }
        self.text.push('\n');
    }

    fn comment(&mut self, text: &str) {
        if self.documented {
            let (breaks, text) = text.strip_prefix('\n').map_or(("", text), |rest| ("\n", rest));
            self.text.push_str(breaks);
            self.text.push_str("# ");
            self.text.push_str(text);
            self.text.push('\n');
        }
    }

    fn snake(&mut self, snake: &SnakeMachine) {
        self.line("kind = \"snake\"", "or \"segments\", \"joints\", \"force\"");
        self.lines(snake.parameters.rigid_lines);
        for key in &SNAKE_KEYS {
            let default = number((key.get)(&SnakeMachine::default()));
            let value = known_number((key.get)(snake), snake.known(key.name));
            self.line(&format!("{} = {value}", key.name), &format!("{}; default {default}", key.doc));
        }
    }

    pub(super) fn lines(&mut self, are_rigid: bool) {
        let lines = if are_rigid { "rigid" } else { "elastic" };
        self.line(
            &format!("lines = {}", text(lines)),
            "elastic; or rigid: they give nothing under load, so that no command is compensated for them",
        );
    }

    fn joints(&mut self, joints: &Joints) {
        self.line("kind = \"joints\"", "y = gain u + offset");
        self.line(&format!("n = {}", joints.n), "number of joints");
        let own: Vec<f64> = joints.gain.iter().enumerate().map(|(k, row)| row[k]).collect();
        let held = joints.gain_known.iter().all(|known| *known == Known::Held);
        let gain = if held {
            let rows: Vec<String> = joints.gain.iter().map(|row| numbers(row)).collect();
            Some(format!("[{}]", rows.join(", ")))
        } else {
            known(&own, &joints.gain_known)
        };
        if let Some(gain) = gain {
            self.line(
                &format!("gain = {gain}"),
                "rows of G, or its diagonal; left out or \"free\": every fit finds it",
            );
        }
        if let Some(offset) = known(&joints.offset, &joints.offset_known) {
            self.line(&format!("offset = {offset}"), "c; left out or \"free\": every fit finds it");
        }
        self.line(&format!("u_unit = {}", text(&joints.u_unit)), "unit of the commands; default rad");
        self.line(&format!("y_unit = {}", text(&joints.y_unit)), "unit of the measurements; default rad");
    }

    fn force(&mut self, force: &ForceMachine) {
        self.line("kind = \"force\"", "torque or current that a motion needs");
        self.line(&format!("n = {}", force.n), "number of joints");
        self.line(&format!("unit = {}", text(force.unit.word())), "Nm or A");
    }

    /// An effect in a table of this name.
    pub(super) fn effect(&mut self, under: &str, effect: &FileEffect) {
        let setting = effect.setting();
        let definition = setting.kind().definition();
        self.line(&format!("\n[[{under}]]"), &about(definition));
        self.line(&format!("kind = {}", text(definition.name)), definition.equation);
        if let Some(formula) = setting.formula_text() {
            self.line(&format!("name = {}", text(&formula.name)), "");
            self.line(&format!("hook = {}", text(formula.hook.word())), "");
            self.line(&format!("formula = {}", text(&formula.text)), "");
            let parameters: Vec<String> = formula
                .parameters
                .iter()
                .map(|p| {
                    let learn = setting.learn(&p.name);
                    format!("{} = {}", p.name, table(p.value, Some(&p.unit), learn, effect.origin(&p.name)))
                })
                .collect();
            self.line(&format!("params = {{ {} }}", parameters.join(", ")), "");
            if !formula.columns.is_empty() {
                let columns: Vec<String> =
                    formula.columns.iter().map(|own| format!("{} = {}", own.name, text(&own.column))).collect();
                self.line(
                    &format!("columns = {{ {} }}", columns.join(", ")),
                    "names that stand for columns of the data",
                );
            }
            return;
        }
        for parameter in definition.parameters {
            let value = setting.value(parameter.name).unwrap_or(parameter.default);
            let shown = match (effect.origin(parameter.name), setting.learn(parameter.name)) {
                _ if effect.is_free(parameter.name) => "\"free\"".to_owned(),
                (None, None) => number(value),
                (origin, learn) => table(value, None, learn, origin),
            };
            let doc = format!(
                "{}, {} to {}, default {}: {}",
                parameter.unit,
                number(parameter.low),
                number(parameter.high),
                number(parameter.default),
                parameter.source
            );
            self.line(&format!("{} = {shown}", parameter.name), &doc);
        }
        if let Some(Varying { parameter, column, at }) = setting.varying() {
            let (column, at) = (text(column), number(*at));
            self.line(
                &format!("by = {{ parameter = \"{parameter}\", column = {column}, at = {at} }}"),
                "the parameter is its value + slope (column - at)",
            );
            let slope = setting.value(SLOPE).unwrap_or_default();
            let shown =
                effect.origin(SLOPE).map_or_else(|| number(slope), |origin| table(slope, None, None, Some(origin)));
            self.line(&format!("{SLOPE} = {shown}"), "the parameter's unit for one of the column's");
        }
    }

    fn entry(&mut self, entry: &HistoryEntry) {
        self.line("\n[[history]]", "");
        self.line(&format!("effect = {}", text(&entry.effect)), "");
        self.line(&format!("data = {}", text(&entry.data)), "");
        self.line(&format!("data_sha256 = {}", text(&entry.data_sha256)), "");
        if let Some(date) = &entry.date {
            self.line(&format!("date = {}", text(date)), "");
        }
        let rms = &entry.heldout_rms;
        let mut shown = format!("before = {}, after = {}", number(rms.before), number(rms.after));
        if let Some(floor) = rms.noise_floor {
            shown += &format!(", noise_floor = {}", number(floor));
        }
        if entry.unit == "deg" {
            self.line(&format!("heldout_rms_deg = {{ {shown} }}"), "degrees, on data that it was not fitted to");
        } else {
            let unit = text(&entry.unit);
            self.line(&format!("heldout_rms = {{ {shown}, unit = {unit} }}"), "on data that it was not fitted to");
        }
    }
}

fn about(definition: &Definition) -> String {
    let inverse = match definition.inverse {
        Inverse::NotNeeded(reason) | Inverse::None(reason) => format!("{}, {reason}", definition.inverse.word()),
        _ => definition.inverse.word().to_owned(),
    };
    format!("hook {}, {}; inverse: {inverse}", definition.hook.word(), definition.class.label())
}

fn table(value: f64, unit: Option<&str>, learn: Option<Learn>, origin: Option<&Origin>) -> String {
    let mut shown = format!("{{ value = {}", number(value));
    if let Some(unit) = unit {
        shown += &format!(", unit = {}", text(unit));
    }
    if let Some(Learn { sd, memory_s }) = learn {
        shown += &format!(", learn = {{ sd = {}, memory_s = {} }}", number(sd), number(memory_s));
    }
    if let Some(origin) = origin {
        if let Some(se) = origin.se {
            shown += &format!(", se = {}", number(se));
        }
        for (key, word) in [("from", &origin.from), ("date", &origin.date)] {
            if let Some(word) = word {
                shown += &format!(", {key} = {}", text(word));
            }
        }
    }
    shown + " }"
}

/// Numbers of the machine with what is known of them; `None` where the file left them out.
fn known(values: &[f64], known: &[Known]) -> Option<String> {
    if known.iter().all(|own| *own == Known::Absent) {
        return None;
    }
    if known.iter().all(|own| *own == Known::Free) {
        return Some("\"free\"".to_owned());
    }
    let all: Vec<String> = values.iter().zip(known).map(|(value, known)| known_number(*value, known)).collect();
    Some(format!("[{}]", all.join(", ")))
}

/// A number of the machine with what is known of it. A part of an array cannot be left out: what is absent there is free.
fn known_number(value: f64, known: &Known) -> String {
    match known {
        Known::Held => number(value),
        Known::Absent | Known::Free => "\"free\"".to_owned(),
        Known::Fitted { se, from, date } => {
            let origin = Origin { parameter: String::new(), se: Some(*se), from: from.clone(), date: date.clone() };
            table(value, None, None, Some(&origin))
        }
    }
}

pub(super) fn numbers(values: &[f64]) -> String {
    let shown: Vec<String> = values.iter().map(|&value| number(value)).collect();
    format!("[{}]", shown.join(", "))
}

/// The shortest text that reads back as the same number, and that TOML takes for a float.
pub(super) fn number(value: f64) -> String {
    format!("{value:?}")
}

/// Text in TOML's quotes.
fn text(value: &str) -> String {
    toml::Value::String(value.to_owned()).to_string()
}
