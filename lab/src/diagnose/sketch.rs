//! A sketch of each effect that was found: what it alone does to this machine, out and back slowly, the inner loop half as wide.
//!
//! Drawn by the model with the fitted values, not by hand: the machine moves between the two rows of the data that are furthest
//! apart, once with the whole list of effects and once without this one; the curve is the difference over the position.

use super::{Diagnosis, FoundEffect};
use crate::machine::MachineUnderTest;
use crate::noise::bounds;
use crate::offered::is_on_joint;
use crate::{LabError, Measurements, Term};

/// Where the motion turns, as shares of the way; the first lap brings hysteresis into its loop and is not drawn.
const TURNS: [f64; 9] = [0.0, 1.0, 0.0, 1.0, 0.25, 0.75, 0.25, 1.0, 0.0];
/// Turns of the first lap.
const N_UNSEEN: usize = 2;
/// Time for the whole way, s.
const WAY_S: f64 = 4.0;
/// Points on the whole way.
const N_POINTS: usize = 40;
/// A difference of less than this part of the position's range is no picture.
const LEAST: f64 = 1e-6;

/// The curve of an effect. Both lists are as long.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// Position without the effect, in the machine's unit of errors.
    pub position: Vec<f64>,
    /// What the effect adds to it, in the same unit.
    pub change: Vec<f64>,
    /// Whether it adds across the motion: out of the plane of the bend.
    pub is_across: bool,
    /// The unit of both.
    pub unit: String,
}

impl Diagnosis {
    /// The same with a sketch of each effect that stands in the chain and shows itself in such a motion.
    pub(super) fn sketched(mut self, machine: &dyn MachineUnderTest, data: &Measurements) -> Result<Self, LabError> {
        let calibrated = self.calibrated.take();
        let own = calibrated.as_ref().map_or(machine, |joints| joints as &dyn MachineUnderTest);
        let base = machine.effects().len();
        for found in [&mut self.effects, &mut self.partial] {
            let places: Vec<Option<usize>> =
                (0..found.len()).map(|slot| place(found, slot, &self.terms, base)).collect();
            for (effect, place) in found.iter_mut().zip(places) {
                let joint = effect.joint.map_or(0, |number| number - 1);
                effect.sketch = place.map(|place| sketch(own, data, &self.terms, place, joint)).transpose()?.flatten();
            }
        }
        self.calibrated = calibrated;
        Ok(self)
    }
}

/// Where the term of an effect stands behind the first `base` terms: that of its name and joint; several of one name and joint stand in
/// the same order in both lists.
pub(super) fn place(found: &[FoundEffect], slot: usize, terms: &[Term], base: usize) -> Option<usize> {
    let effect = found.get(slot)?;
    let is_alike = |own: &&FoundEffect| own.name == effect.name && own.joint == effect.joint;
    let n_before = found[..slot].iter().filter(is_alike).count();
    let own = |(place, term): (usize, &Term)| {
        let joint = || term.values.first().map(|joint| joint.round() as usize);
        let is_of =
            |own: usize| term.formula.as_ref().map_or_else(|| joint() == Some(own), |text| is_on_joint(text, own));
        let is_own = term.label() == effect.name && effect.joint.is_none_or(is_of);
        (place >= base && is_own).then_some(place)
    };
    let places: Vec<usize> = terms.iter().enumerate().filter_map(own).collect();
    let n_found = found.iter().filter(is_alike).count();
    if places.len() == n_found { places.get(n_before).copied() } else { None }
}

fn sketch(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    terms: &[Term],
    place: usize,
    joint: usize,
) -> Result<Option<Sketch>, LabError> {
    // A slow motion shows no force that depends on speed.
    if data.quantity == crate::Quantity::Force {
        return Ok(None);
    }
    let moved = machine.as_joints().map(|_| joint);
    let Some(motion) = motion(data, moved) else { return Ok(None) };
    let mut without = terms.to_vec();
    without.remove(place);
    let (with, without) = (machine.predict(terms, &motion)?, machine.predict(&without, &motion)?);
    let unseen = N_UNSEEN * N_POINTS;
    let column = |values: &[f64], k: usize| -> Vec<f64> {
        values.iter().skip(k).step_by(data.n_outputs).skip(unseen).copied().collect()
    };
    let (unit, scale) = machine.error_unit();
    let columns = 0..data.n_outputs;
    // A joint moves alone; a bend moves along its plane, and an effect may push it across.
    let along = moved.unwrap_or_else(|| widest(columns.clone().map(|k| range(&column(&without, k)))));
    let changes: Vec<Vec<f64>> =
        columns.map(|k| column(&with, k).iter().zip(column(&without, k)).map(|(a, b)| a - b).collect()).collect();
    let most = moved.unwrap_or_else(|| widest(changes.iter().map(|own| size(own))));
    // Segments bend in many planes: what changes is shown beside where that component goes.
    let along = if data.quantity == crate::Quantity::Segments { most } else { along };
    let position = column(&without, along);
    let Some(change) = changes.get(most) else { return Ok(None) };
    if change.iter().chain(&position).any(|x| !x.is_finite()) || size(change) <= LEAST * range(&position) {
        return Ok(None);
    }
    let in_unit = |values: &[f64]| values.iter().map(|x| x * scale).collect();
    let (position, change) = (in_unit(&position), in_unit(change));
    Ok(Some(Sketch { position, change, is_across: most != along, unit: unit.to_owned() }))
}

/// From the row with the least inputs to that with the largest and back, everything else as in the first of them; of a joint
/// its own input only.
fn motion(data: &Measurements, joint: Option<usize>) -> Option<Measurements> {
    let size = |row: &usize| match joint {
        Some(joint) => data.input(*row)[joint],
        None => data.input(*row).iter().map(|x| x * x).sum::<f64>(),
    };
    let rows = (0..data.n_rows()).filter(|row| data.input(*row).iter().all(|x| x.is_finite()));
    let rows: Vec<usize> = rows.collect();
    let by_size = |a: &&usize, b: &&usize| size(a).total_cmp(&size(b));
    let (from, to) = (*rows.iter().min_by(by_size)?, *rows.iter().max_by(by_size)?);
    let shares: Vec<f64> = TURNS.windows(2).flat_map(leg).collect();
    let mut motion = data.select(&vec![from; shares.len()]);
    motion.time_s = (0..shares.len()).map(|row| row as f64 * WAY_S / N_POINTS as f64).collect();
    motion.trial = vec![0; shares.len()];
    for (own, share) in motion.inputs.chunks_mut(data.n_inputs).zip(&shares) {
        for (k, (own, to)) in own.iter_mut().zip(data.input(to)).enumerate() {
            if joint.is_none_or(|joint| k == joint) {
                *own += share * (to - *own);
            }
        }
    }
    Some(motion)
}

/// The shares of one leg, without its end.
fn leg(turns: &[f64]) -> Vec<f64> {
    let (from, to) = (turns[0], turns[1]);
    let n = ((to - from).abs() * N_POINTS as f64).round().max(1.0);
    (0..n as usize).map(|k| from + (to - from) * k as f64 / n).collect()
}

fn range(values: &[f64]) -> f64 {
    let (low, high) = bounds(values.iter().copied());
    high - low
}

fn size(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// The place of the largest.
fn widest(sizes: impl Iterator<Item = f64>) -> usize {
    sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(place, _)| place)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Effects stand by what they bring, terms joint by joint.
    #[test]
    fn an_effect_s_term_is_that_of_its_own_joint() {
        let effect = |joint| FoundEffect {
            name: "backlash".to_owned(),
            class: Vec::new(),
            before: 0.0,
            after: 0.0,
            probability: 1.0,
            parameters: Vec::new(),
            joint: Some(joint),
            sketch: None,
        };
        let term = |joint| Term::new("backlash", vec![joint, 0.1]);
        let (found, terms) = ([effect(3), effect(1)], [term(3.0), term(1.0), term(3.0)]);
        assert_eq!([place(&found, 0, &terms, 1), place(&found, 1, &terms, 1)], [Some(2), Some(1)]);
        assert_eq!(place(&[effect(2)], 0, &terms, 1), None);
    }
}
