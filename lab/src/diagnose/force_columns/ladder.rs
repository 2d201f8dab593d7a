//! What the plain joint leaves of a force: inertia, gravity, dry and viscous friction, by columns read in another way.

use crate::fit::{Variable, dot};
use crate::read::column;
use crate::{LabError, Measurements, Problem, Term};
use nalgebra::{DMatrix, DVector};

/// The plain joint's terms with one of their numbers 1, and whether that number is never negative.
const TERMS: [(&str, &[f64], bool); 5] = [
    ("inertia", &[0.0, 1.0], true),
    ("gravity", &[0.0, 1.0, 0.0], false),
    ("gravity", &[0.0, 0.0, 1.0], false),
    ("coulomb", &[0.0, 1.0], true),
    ("viscous", &[0.0, 1.0], true),
];
/// A column of which less than this share is new beside the others brings nothing.
const NEW: f64 = 1e-9;

/// One reading of a joint's columns: whose motion makes the force, and factors of angle and force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moved {
    pub joint: usize,
    pub angle: f64,
    pub force: f64,
}

/// What of the model file's values takes part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Values {
    /// Those of the plain joint are looked for anew, all of them.
    Anew,
    /// Those that the file has stand, the others are looked for.
    OfFile,
    /// Those that the file has are zero, the others are looked for.
    Without,
}

/// The plain joint of a machine of kind force.
pub(super) struct Ladder<'a> {
    pub problem: &'a Problem<'a>,
    /// The file's effects whose values no fit finds, and those of them that are the plain joint's.
    known: Vec<Term>,
    plain: Vec<Term>,
}

impl<'a> Ladder<'a> {
    /// `free`: what of the file's values a fit finds.
    pub fn new(problem: &'a Problem<'a>, free: &[Variable]) -> Self {
        let is_free = |place: usize| free.iter().any(|own| own.effect == place && own.prior.is_none());
        let effects = problem.machine.effects().iter().enumerate();
        let known: Vec<Term> = effects.filter(|(place, _)| !is_free(*place)).map(|(_, term)| term.clone()).collect();
        let plain = known.iter().filter(|term| TERMS.iter().any(|own| own.0 == term.name)).cloned().collect();
        Self { problem, known, plain }
    }

    /// Whether the file has values of the plain joint for a joint, from 0.
    pub fn has_values(&self, joint: usize) -> bool {
        TERMS.iter().any(|own| self.has_term(own.0, joint))
    }

    fn has_term(&self, name: &str, joint: usize) -> bool {
        let is_of = |term: &Term| term.values.first().is_none_or(|of| *of == 0.0 || *of == joint as f64 + 1.0);
        let is_there = |term: &Term| term.values.iter().skip(1).any(|value| *value != 0.0);
        self.plain.iter().any(|term| term.name == name && is_of(term) && is_there(term))
    }

    /// Root mean square of what is left of a joint's force, in the unit of its column as it stands.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model's own effects make no chain.
    pub fn left(&self, joint: usize, moved: Moved, values: Values) -> Result<f64, LabError> {
        let data = arranged(&self.problem.data, moved.angle);
        let n = data.n_outputs;
        let rows: Vec<usize> = (0..data.n_rows()).filter(|row| self.problem.weight[row * n + joint] > 0.0).collect();
        let of_motion = |effects: &[Term]| -> Result<Vec<f64>, LabError> {
            let all = self.problem.machine.predict(effects, &data)?;
            Ok(rows.iter().map(|row| all[row * n + moved.joint]).collect())
        };
        let mut target: Vec<f64> = rows.iter().map(|row| moved.force * data.outputs[row * n + joint]).collect();
        target.iter_mut().zip(of_motion(&self.known)?).for_each(|(y, known)| *y -= known);
        if values != Values::OfFile {
            target.iter_mut().zip(of_motion(&self.plain)?).for_each(|(y, plain)| *y += plain);
        }
        let is_sought = |name: &str| values == Values::Anew || !self.has_term(name, moved.joint);
        let sought: Vec<_> = TERMS.into_iter().filter(|own| is_sought(own.0)).collect();
        let mut columns = Vec::with_capacity(sought.len());
        for (name, of_one, _) in &sought {
            columns.push(of_motion(&[Term::new(name, of_one.to_vec())])?);
        }
        // The sensor's offset, one in each trial.
        columns.iter_mut().chain([&mut target]).for_each(|own| without_means(own, &rows, &data));
        let signs: Vec<bool> = sought.iter().map(|own| own.2).collect();
        let square = least_square(&target, &columns, &signs);
        Ok((square / rows.len().max(1) as f64).sqrt() / moved.force.abs())
    }
}

/// The motion with all angles multiplied.
fn arranged(data: &Measurements, angle: f64) -> Measurements {
    let mut own = data.clone();
    own.inputs.iter_mut().for_each(|q| *q *= angle);
    for joint in 0..data.n_inputs {
        let names = [column("speed", joint), column("acceleration", joint)];
        let of_joint = own.extra.iter_mut().filter(|(name, _)| names.contains(name));
        of_joint.for_each(|(_, values)| values.iter_mut().for_each(|value| *value *= angle));
    }
    own
}

/// Takes the mean of each trial away.
fn without_means(values: &mut [f64], rows: &[usize], data: &Measurements) {
    let trial = |k: usize| data.trial.get(rows[k]);
    let mut start = 0;
    while start < values.len() {
        let end = (start..values.len()).find(|k| trial(*k) != trial(start)).unwrap_or(values.len());
        let mean = values[start..end].iter().sum::<f64>() / (end - start) as f64;
        values[start..end].iter_mut().for_each(|value| *value -= mean);
        start = end;
    }
}

/// The least sum of squares that columns leave of a target, where some of their factors may not be negative: of all lists of the
/// columns the best one that keeps to it.
fn least_square(target: &[f64], columns: &[Vec<f64>], not_negative: &[bool]) -> f64 {
    let norms: Vec<f64> = columns.iter().map(|own| dot(own, own).sqrt()).collect();
    let scaled = |k: usize| if norms[k] > 0.0 { 1.0 / norms[k] } else { 0.0 };
    let n = columns.len();
    let gram = DMatrix::from_fn(n, n, |i, k| scaled(i) * scaled(k) * dot(&columns[i], &columns[k]));
    let score = DVector::from_fn(n, |k, _| scaled(k) * dot(&columns[k], target));
    let whole = dot(target, target);
    let of_list = |list: usize| {
        let places: Vec<usize> = (0..n).filter(|k| list >> k & 1 == 1).collect();
        let own = DMatrix::from_fn(places.len(), places.len(), |i, k| gram[(places[i], places[k])]);
        let own_score = DVector::from_fn(places.len(), |k, _| score[places[k]]);
        let factor = own.cholesky().filter(|own| own.l_dirty().diagonal().iter().all(|pivot| pivot * pivot > NEW))?;
        let found = factor.solve(&own_score);
        let is_allowed = places.iter().zip(found.iter()).all(|(k, value)| !not_negative[*k] || *value >= 0.0);
        is_allowed.then(|| (whole - found.dot(&own_score)).max(0.0))
    };
    (1..1_usize << n).filter_map(of_list).fold(whole, f64::min)
}
