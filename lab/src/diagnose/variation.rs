//! A number of an effect that is not one number: it depends on a column beside the motion, or is another one in a recording.

use crate::digits::digits;
use serde_json::{Value, json};

/// A number of an effect that depends on a column, or differs in one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterVariation {
    /// The effect's name.
    pub effect: String,
    /// The joint, from 1.
    pub joint: usize,
    /// The number's name in model files.
    pub parameter: &'static str,
    /// Its unit.
    pub unit: String,
    /// What it depends on.
    pub on: DependsOn,
    /// Its values at the two ends: of the column's range, or in the other recordings and in this one.
    pub values: [f64; 2],
    /// Error of the joint on data that it was not fitted to, without and with the dependence, in the machine's unit for errors.
    pub errors: [f64; 2],
    /// Whether the answer's effects have it; else it stands beside them.
    pub is_in_answer: bool,
    /// What it says, one sentence for people.
    pub sentence: String,
}

/// What a number depends on.
#[derive(Clone, Debug, PartialEq)]
pub enum DependsOn {
    /// A column beside the motion.
    Column {
        /// Its name.
        name: String,
        /// Its lowest and highest value.
        range: [f64; 2],
        /// The number's change for one of the column.
        slope: f64,
        /// Standard error of the slope.
        slope_se: f64,
    },
    /// One of several recordings.
    Recording(String),
}

impl ParameterVariation {
    /// The same with its sentence; `joint` is what the file calls the joint.
    pub(crate) fn told(self, joint: &str, error_unit: &str) -> Self {
        Self { sentence: self.say(joint, error_unit), ..self }
    }

    fn say(&self, joint: &str, error_unit: &str) -> String {
        let Self { effect, parameter, unit, values: [first, last], errors: [without, with], .. } = self;
        let (scale, unit) = if unit == "rad" { (180.0 / core::f64::consts::PI, "deg") } else { (1.0, unit.as_str()) };
        let [first, last] = ends([scale * first, scale * last]);
        let falls = format!("with that the error falls from {without:.3} to {with:.3} {error_unit}");
        match &self.on {
            DependsOn::Column { name, range: [low, high], .. } => {
                let [low, high] = ends([*low, *high]);
                format!(
                    "on {joint} {parameter} of {effect} depends on the column {name}: {first} {unit} at {low}, {last} at {high}; {falls}"
                )
            }
            DependsOn::Recording(name) => format!(
                "on {joint} {parameter} of {effect} is another one in {name}: {last} {unit} there, {first} in the rest; {falls}. A \
                 column that says what differed would tell why (--by in krait lab add --help)"
            ),
        }
    }

    /// As JSON.
    pub(super) fn to_json(&self) -> Value {
        let (column, recording, slope) = match &self.on {
            DependsOn::Column { name, range, slope, slope_se } => {
                (Some(json!({ "name": name, "range": range })), None, Some(json!({ "value": slope, "se": slope_se })))
            }
            DependsOn::Recording(name) => (None, Some(name), None),
        };
        json!({
            "effect": self.effect, "joint": self.joint, "parameter": self.parameter, "unit": self.unit, "column": column,
            "recording": recording, "slope": slope, "values": self.values, "heldout_rms": self.errors,
            "in_effects": self.is_in_answer, "sentence": self.sentence,
        })
    }
}

/// The two ends of a range, each in as many digits as their distance deserves.
fn ends([first, last]: [f64; 2]) -> [String; 2] {
    let unit = 10_f64.powf((last - first).abs().max(f64::MIN_POSITIVE).log10().floor() - 3.0);
    [first, last].map(|value| digits((value / unit).round() * unit))
}

#[cfg(test)]
mod tests {
    use super::ends;

    #[test]
    fn ends_have_the_digits_of_their_distance() {
        assert_eq!(ends([2.201e-5, 89.999_98]), ["0", "90"]);
        assert_eq!(ends([0.399_64, 1.300_4]), ["0.3996", "1.3"]);
        assert_eq!(ends([-0.001_234_56, 0.002]), ["-0.001235", "0.002"]);
    }
}
