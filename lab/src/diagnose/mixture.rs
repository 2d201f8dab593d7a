//! What a snake's error is made of, where effects alone do not make it: effects and fine shapes compete for it one by one.
//!
//! Problem: shapes that are chosen from what effects leave mend the wrong effects, and effects beside everything that shapes can make
//! are no longer needed.
//! Intuition: the step that leaves least is taken, each number at its price. A shape of few numbers wins where it is the truth; an
//! effect of one or two wins against the many shapes that would make it together. What later steps make superfluous goes again.

use super::beside::Shapes;
use super::screen::screen;
use super::search::{Search, Trial, price};
use crate::noise::NoiseFloor;
use crate::{LabError, Problem};

const MOST_STEPS: usize = 8;
/// So many effects are refined in each step.
const N_EFFECTS: usize = 4;
/// A step takes away at least this share of what is left.
const LEAST_GAIN: f64 = 0.03;
/// A shape's number costs so many times an effect's: there are many more shapes than effects.
const PRICE_OF_SHAPE: f64 = 2.0;
/// Up to this ratio of the floor nothing is left.
const NOTHING_LEFT: f64 = 1.01;

/// Shapes, and the effects beside them.
struct Mixture<'a> {
    search: &'a Search<'a>,
    shapes: Shapes,
    trial: Trial,
}

/// What a mixture came to.
pub(super) struct Mixed {
    pub shapes: Shapes,
    /// The noise that effects and shapes leave: what sways is noise at rest until a shape has taken it.
    pub floors: NoiseFloor,
    /// Whether they leave no more than so many floors.
    pub is_made: bool,
}

/// The shapes that stand beside effects, and what they come to; `most` times the floor is no more than noise.
///
/// # Errors
/// [`LabError`] where the model as given makes no chain.
pub(super) fn shapes_beside(search: &Search, floors: &NoiseFloor, most: f64) -> Result<Mixed, LabError> {
    let trial = search.start()?;
    let mut mixture = Mixture { search, shapes: Shapes::none(&trial.fit.effects), trial };
    if let Some(wave) = mixture.shapes.wave(search.problem, &mixture.trial.fit)? {
        mixture = mixture.with(mixture.shapes.clone().and(wave), &mixture.trial)?;
    }
    let mut floors = floors.clone();
    for _ in 0..MOST_STEPS {
        let nearer = NoiseFloor::new(search.problem, &search.problem.outputs_of(&mixture.trial.fit.residual));
        let sigma = |own: &NoiseFloor| own.sigma().map_or(f64::INFINITY, |(sigma, _)| sigma);
        if sigma(&nearer) < sigma(&floors) {
            floors = nearer;
        }
        if mixture.is_within(NOTHING_LEFT, &floors) || !mixture.step()? {
            break;
        }
    }
    while mixture.drop_one()? {}
    let is_made = mixture.is_within(most, &floors);
    Ok(Mixed { shapes: mixture.shapes, floors, is_made })
}

/// Whether one jump of the outputs leaves less than an effect of a list does, and has no higher price.
///
/// # Errors
/// [`LabError`] where the other effects make no chain.
pub(super) fn is_jump(search: &Search, chosen: &Trial, slot: usize) -> Result<bool, LabError> {
    let trial = search.without(chosen, slot)?;
    let mixture = Mixture { search, shapes: Shapes::none(search.base), trial };
    let jump = mixture.shapes.jump(search.problem, &mixture.trial.fit)?;
    let other = mixture.with(mixture.shapes.clone().and(jump), &mixture.trial)?;
    Ok(other.badness() < search.badness(chosen, 1.0))
}

impl<'a> Mixture<'a> {
    fn is_within(&self, ratio: f64, floors: &NoiseFloor) -> bool {
        let width = self.search.problem.data.n_outputs as f64;
        floors.sigma().is_some_and(|(sigma, _)| self.rms() <= ratio * sigma * width.sqrt())
    }

    fn rms(&self) -> f64 {
        self.search.problem.rms(self.trial.fit.sum_of_squares)
    }

    /// ln of what is left, and the price of all numbers.
    fn badness(&self) -> f64 {
        let price = price(self.search.problem, 1.0);
        let n_shapes = self.shapes.n_columns() as f64;
        self.search.badness(&self.trial, 1.0) + PRICE_OF_SHAPE * n_shapes * price
    }

    /// These shapes with these effects, fitted to what they leave.
    fn with(&self, shapes: Shapes, trial: &Trial) -> Result<Self, LabError> {
        let problem = self.search.problem.beside(&shapes.columns(self.search.problem)?);
        let trial = self.search.on(&problem).fitted(trial.found.clone(), &trial.fit.effects)?;
        Ok(Mixture { search: self.search, shapes, trial })
    }

    /// Takes the effect or the shape that leaves least; whether there is one.
    fn step(&mut self) -> Result<bool, LabError> {
        let before = self.badness();
        let next = [self.with_effect()?, self.with_shape()?];
        let best = next.into_iter().flatten().min_by(|a, b| a.badness().total_cmp(&b.badness()));
        let Some(best) = best.filter(|own| own.badness() < before - LEAST_GAIN) else { return Ok(false) };
        *self = best;
        Ok(true)
    }

    fn with_effect(&self) -> Result<Option<Self>, LabError> {
        let problem = self.search.problem.beside(&self.shapes.columns(self.search.problem)?);
        let search = self.search.on(&problem);
        let cells = screen(&problem, &self.trial.fit, search.candidates);
        let refined = search.behind(&[(&self.trial, &cells)], N_EFFECTS);
        let best = refined.into_iter().find(|own| !search.imitates(own));
        Ok(best.map(|trial| Mixture { search: self.search, shapes: self.shapes.clone(), trial }))
    }

    fn with_shape(&self) -> Result<Option<Self>, LabError> {
        let problem: &Problem = self.search.problem;
        let price = PRICE_OF_SHAPE * price(problem, 1.0);
        let whole = self.trial.fit.sum_of_squares;
        let offers = self.shapes.offers(problem, &self.trial.fit)?;
        let badness = |(n, gain): (usize, f64)| (whole - gain).max(1e-300).ln() + n as f64 * price;
        let best = offers.into_iter().min_by(|a, b| badness((a.n, a.gain)).total_cmp(&badness((b.n, b.gain))));
        let Some(best) = best else { return Ok(None) };
        self.with(self.shapes.clone().and(best), &self.trial).map(Some)
    }

    /// Leaves out what no longer pays; whether something did not.
    fn drop_one(&mut self) -> Result<bool, LabError> {
        let before = self.badness();
        let mut others = Vec::new();
        for k in 0..self.shapes.len() {
            others.extend(self.with(self.shapes.clone().without(k), &self.trial));
        }
        let problem = self.search.problem.beside(&self.shapes.columns(self.search.problem)?);
        for slot in 0..self.trial.found.len() {
            let trial = self.search.on(&problem).without(&self.trial, slot);
            others.extend(trial.map(|trial| Mixture { search: self.search, shapes: self.shapes.clone(), trial }));
        }
        let best = others.into_iter().min_by(|a, b| a.badness().total_cmp(&b.badness()));
        let Some(best) = best.filter(|own| own.badness() < before + LEAST_GAIN) else { return Ok(false) };
        *self = best;
        Ok(true)
    }
}
