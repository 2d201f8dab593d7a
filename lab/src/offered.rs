//! Effects that a user wrote and offers: formulas that the diagnosis tries beside those of the library.
//!
//! They stand in a model file of their own, of the same machine, so that nothing is on that nobody found. A formula that takes part
//! needs a parameter that scales it: what is missing is found by its size, and without it nothing says what "not there" is.

use crate::machine::Candidate;
use crate::{LabError, Measurements, Term};
use krait_model::Circumstances;
use krait_model::effects::{
    Class, EffectKind, FormulaError, FormulaText, Hook, MAX_COLUMNS, MAX_PARAMETERS, amplitudes,
};
use krait_model::joints::{AtJoint, JointFormula};
use krait_model::model_file::{Machine, ModelFile};
use std::path::{Path, PathBuf};

/// A formula that is offered. Copies are the same one: it lives as long as the program, which reads a few of them once.
#[derive(Clone, Copy, Debug)]
pub struct Offered(&'static Own);

#[derive(Debug)]
struct Own {
    name: &'static str,
    text: FormulaText,
    /// Names of the parameters, as answers hold them.
    parameters: Vec<&'static str>,
    /// Places of those that scale it, and of the others.
    amplitudes: Vec<usize>,
    shapes: Vec<usize>,
    /// Of joints: the formula by itself.
    of_joint: Option<JointFormula>,
    /// Joints of the machine.
    n_joints: usize,
}

/// Effects cannot be offered.
#[derive(Debug, thiserror::Error)]
pub enum OfferedError {
    /// The file is of another machine.
    #[error("--effects {path}: its machine is {found}, expected that of the model, {expected}; offer effects of the same machine", path = path.display())]
    Machine {
        /// The file.
        path: PathBuf,
        /// Its machine.
        found: String,
        /// The model's.
        expected: String,
    },
    /// The file has nothing to offer.
    #[error("--effects {path}: it has no effect of kind formula, expected at least one; the library's own take part anyway", path = path.display())]
    None {
        /// The file.
        path: PathBuf,
    },
    /// Two effects would have one name in the answer.
    #[error("--effects {path}: formula {name:?} has the name of another effect, expected a name of its own; rename it", path = path.display())]
    Name {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// No size of it is none.
    #[error(
        "--effects {path}: formula {name:?} has no parameter that scales it, expected one at whose zero it is zero and whose double doubles it; \
         multiply it by such a parameter, as in \"a * (...)\"",
        path = path.display()
    )]
    NoAmplitude {
        /// The file.
        path: PathBuf,
        /// The formula.
        name: String,
    },
    /// The formula is refused.
    #[error("--effects {path}: {source}", path = path.display())]
    Formula {
        /// The file.
        path: PathBuf,
        /// Why.
        source: FormulaError,
    },
}

/// The formulas of a model file, for a machine.
///
/// # Errors
/// [`OfferedError`], one sentence.
pub fn offered(path: &Path, file: &ModelFile, machine: &Machine) -> Result<Vec<Offered>, OfferedError> {
    let [found, expected] = [file.machine(), machine].map(in_words);
    let path = || path.to_owned();
    if found != expected {
        return Err(OfferedError::Machine { path: path(), found, expected });
    }
    let n_joints = if let Machine::Joints(joints) = machine { joints.n } else { 0 };
    let mut all: Vec<Offered> = Vec::new();
    for text in file.effects().iter().filter_map(|effect| effect.setting().formula_text()) {
        let name = text.name.clone();
        let is_taken = EffectKind::from_name(&name).is_some() || krait_model::effects::explanation(&name).is_some();
        if is_taken || all.iter().any(|own| own.name() == name) {
            return Err(OfferedError::Name { path: path(), name });
        }
        let own = Offered::new(text, n_joints).map_err(|source| OfferedError::Formula { path: path(), source })?;
        all.push(own.ok_or_else(|| OfferedError::NoAmplitude { path: path(), name })?);
    }
    if all.is_empty() { Err(OfferedError::None { path: path() }) } else { Ok(all) }
}

fn in_words(machine: &Machine) -> String {
    match machine {
        Machine::Snake(_) => "a snake".to_owned(),
        Machine::Segments(_) => "a snake of segments".to_owned(),
        Machine::Force(_) => "a force".to_owned(),
        Machine::Joints(joints) => format!("{} joints", joints.n),
    }
}

impl Offered {
    /// `None` for a formula that no parameter scales.
    fn new(text: &FormulaText, n_joints: usize) -> Result<Option<Self>, FormulaError> {
        let amplitudes = amplitudes(text)?;
        if amplitudes.is_empty() {
            return Ok(None);
        }
        let shapes = (0..text.parameters.len()).filter(|k| !amplitudes.contains(k)).collect();
        let is_of_joint = text.hook == Hook::Joint;
        if is_of_joint {
            // As it would stand in a model, on one joint of several.
            JointFormula::new(&on_joint(text, n_joints, 0))?;
        }
        let own = Own {
            name: text.name.clone().leak(),
            text: text.clone(),
            parameters: text.parameters.iter().map(|own| &*own.name.clone().leak()).collect(),
            amplitudes,
            shapes,
            of_joint: if is_of_joint { Some(JointFormula::new(text)?) } else { None },
            n_joints,
        };
        Ok(Some(Self(Box::leak(Box::new(own)))))
    }

    /// Its name in answers.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// Its name as the list of all that look like it.
    pub(crate) fn names(self) -> &'static [&'static str] {
        core::slice::from_ref(&self.0.name)
    }

    /// What it looks like, for a table.
    pub(crate) fn class(self) -> &'static str {
        Class::User.label()
    }

    /// Parameters that scale it: place among all, and name.
    pub(crate) fn amplitudes(self) -> impl ExactSizeIterator<Item = (usize, &'static str)> {
        self.0.amplitudes.iter().map(move |&k| (k, self.0.parameters[k]))
    }

    /// The others: name and given value.
    pub(crate) fn shapes(self) -> impl ExactSizeIterator<Item = (&'static str, f64)> {
        self.0.shapes.iter().map(move |&k| (self.0.parameters[k], self.0.text.parameters[k].value))
    }

    /// Where a search starts: values of the shapes, one of them changed at a time.
    pub(crate) fn grid(self) -> Vec<Vec<f64>> {
        let variants = |given: f64| if given == 0.0 { [1.0, -1.0, 0.0] } else { [given, 0.4 * given, 2.5 * given] };
        let all: Vec<[f64; 3]> = self.shapes().map(|(_, given)| variants(given)).collect();
        let first: Vec<f64> = all.iter().map(|own| own[0]).collect();
        let other = |(k, n): (usize, usize)| {
            let mut values = first.clone();
            values[k] = all[k][n];
            values
        };
        let others = (0..all.len()).flat_map(|k| [(k, 1), (k, 2)]);
        core::iter::once(first.clone()).chain(others.map(other)).collect()
    }

    /// All parameters from those that scale it and the others, each in their order.
    fn values(self, amplitudes: &[f64], shapes: &[f64]) -> Vec<f64> {
        let mut values: Vec<f64> = self.0.text.parameters.iter().map(|own| own.value).collect();
        self.0.amplitudes.iter().zip(amplitudes).for_each(|(&k, value)| values[k] = *value);
        self.0.shapes.iter().zip(shapes).for_each(|(&k, value)| values[k] = *value);
        values
    }

    /// Its parameters with one of its amplitudes, by its number among them, 1 and the others 0.
    pub(crate) fn unit(self, amplitude: usize, shapes: &[f64]) -> [f64; MAX_PARAMETERS] {
        let one: Vec<f64> = (0..self.0.amplitudes.len()).map(|k| f64::from(u8::from(k == amplitude))).collect();
        let mut parameters = [0.0; MAX_PARAMETERS];
        parameters.iter_mut().zip(self.values(&one, shapes)).for_each(|(own, value)| *own = value);
        parameters
    }

    /// What it adds to a joint's position; 0 where it is not finite, as in a chain.
    pub(crate) fn value(self, here: AtJoint, at: &Circumstances, parameters: &[f64; MAX_PARAMETERS]) -> f64 {
        self.0.of_joint.as_ref().and_then(|own| own.value(here, at, parameters)).unwrap_or(0.0)
    }

    /// The columns that its names stand for, in the formula's order.
    pub(crate) fn columns(self) -> impl Iterator<Item = &'static str> {
        self.0.text.columns.iter().map(|own| own.column.as_str()).take(MAX_COLUMNS)
    }

    /// As an effect of a model, of one joint, from 0; `value` is that of each parameter by its name, `None` the file's own.
    pub fn term(self, joint: usize, value: impl Fn(&str) -> Option<f64>) -> Term {
        let given = &self.0.text.parameters;
        let values = given.iter().map(|own| value(&own.name).unwrap_or(own.value)).collect();
        Term {
            values,
            formula: Some(on_joint(&self.0.text, self.0.n_joints, joint)),
            ..Term::new("formula", Vec::new())
        }
    }

    /// As a candidate of a snake.
    pub(crate) fn candidate(self) -> Candidate {
        let own = self.0;
        let sized = self.sizes();
        let cells = self.grid();
        Candidate {
            name: own.name,
            class: self.class(),
            cannot: None,
            neutral: self.values(&vec![0.0; sized.len()], &cells[0]),
            free: own.amplitudes.iter().chain(&own.shapes).copied().collect(),
            amplitudes: own.amplitudes.clone(),
            one_sided: false,
            starts: cells.iter().map(|shapes| self.values(&sized, shapes)).collect(),
            highest: None,
            periodic: None,
            formula: Some(own.text.clone()),
        }
    }

    /// Sizes to look at: those that are given, else what such a value usually is.
    fn sizes(self) -> Vec<f64> {
        let typical = match self.0.text.hook {
            Hook::Tau => 1.0,
            Hook::Force => 0.1,
            Hook::Meas => 0.01,
            _ => 1e-4,
        };
        let given = self.0.amplitudes.iter().map(|&k| self.0.text.parameters[k].value);
        given.map(|value| if value == 0.0 { typical } else { value }).collect()
    }
}

/// A formula on one joint, from 0, of several: a formula of a model stands on every joint.
pub(crate) fn on_joint(text: &FormulaText, n_joints: usize, joint: usize) -> FormulaText {
    if n_joints < 2 {
        return text.clone();
    }
    FormulaText { text: format!("{} * ({})", one_on(joint + 1), text.text), ..text.clone() }
}

/// A factor that is 1 on a joint, by its number, and 0 on the others.
fn one_on(number: usize) -> String {
    format!("max(1 - abs(joint - {number}), 0)")
}

/// Whether a formula that was found is that of a joint, by its number.
pub(crate) fn is_on_joint(text: &FormulaText, number: usize) -> bool {
    text.text.starts_with(&one_on(number)) || !text.text.starts_with("max(1 - abs(joint - ")
}

/// Refuses what these data cannot show: a column that is not there, a hook that the machine does not have.
pub(crate) fn check(
    all: &[Offered],
    machine: &dyn crate::machine::MachineUnderTest,
    data: &Measurements,
) -> Result<(), LabError> {
    let first = data.select(&[0]);
    for own in all {
        let mut effects = machine.effects().to_vec();
        effects.push(own.term(0, |_| None));
        machine.predict(&effects, &first)?;
    }
    Ok(())
}

/// A name is an effect's own, so that equal names are the same effect.
impl PartialEq for Offered {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Offered {}

impl PartialOrd for Offered {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Offered {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        self.name().cmp(other.name())
    }
}

impl core::hash::Hash for Offered {
    fn hash<H: core::hash::Hasher>(&self, state: &mut H) {
        self.name().hash(state);
    }
}
