//! Which effects stand beside what no effect makes, and what is put beside them for that.

use super::beside::{self, Shapes, Standing};
use super::findings::Findings;
use super::mixture::{self, Mixed};
use super::search::{Search, Trial};
use super::verdict::{BEYOND_DOUBT, Case};
use crate::fit::fit;
use crate::noise::NoiseFloor;
use crate::{LabError, Problem, Quantity};
use krait_model::effects::Class;

/// An effect stands where it takes this share of what shapes and the other effects leave, a force's and a snake's.
const BESIDE: f64 = 0.25;
const BESIDE_OF_SNAKE: f64 = 0.4;
/// Of more rows than this shapes are made on the working ones alone: their columns would fill the memory.
const MOST_SHAPED: usize = 30_000;

/// Searches on all and on the working rows beside these shapes, and what they found.
pub(super) struct Beside<'a> {
    pub(super) full: &'a Search<'a>,
    pub(super) work: &'a Search<'a>,
    pub(super) shapes: (&'a Shapes, &'a NoiseFloor),
    pub(super) found: Findings,
}

impl<'a> Case<'a> {
    /// The shapes to search beside, where the chosen effects leave something that no noise makes and that shapes make.
    pub(super) fn first_shapes(&self, start: &Trial, chosen: &Trial) -> Result<Option<Mixed>, LabError> {
        let [before, after] = [start, chosen].map(|own| self.error(own));
        if self.hint.is_some() || !self.remaining(chosen, before, after, &self.floor(chosen))?.structured {
            return Ok(None);
        }
        if self.is_snake() {
            let mixed = mixture::shapes_beside(self.alone[1], &self.floors, BEYOND_DOUBT)?;
            return Ok(Some(mixed).filter(|own| own.is_made && own.shapes.len() > 0));
        }
        let is_made = self.is_made(&self.beside_shapes(chosen)?);
        let shapes = Shapes::none(&chosen.fit.effects);
        Ok(is_made.then(|| Mixed { shapes, floors: self.floors.clone(), is_made }))
    }

    pub(super) fn is_snake(&self) -> bool {
        self.full.problem.data.quantity == Quantity::Snake
    }

    /// Takes what was found beside shapes, where at least as many effects stand there.
    pub(super) fn or_beside(
        mut self,
        chosen: Trial,
        beside: Beside<'a>,
        other: Trial,
    ) -> Result<(Self, Trial), LabError> {
        let n_standing = |case: &Self, chosen: &Trial| -> Result<usize, LabError> {
            Ok(case.standing(chosen)?.into_iter().filter(|stands| *stands).count())
        };
        let before = n_standing(&self, &chosen)?;
        let mut found = beside.found;
        self.found.exchange_choice(&mut found);
        (self.full, self.work, self.beside) = (beside.full, beside.work, Some(beside.shapes));
        if n_standing(&self, &other)? >= before.max(1) {
            return Ok((self, other));
        }
        self.found.exchange_choice(&mut found);
        ([self.full, self.work], self.beside) = (self.alone, None);
        Ok((self, chosen))
    }

    /// The problem on which shapes are made.
    pub(super) fn shaped(&self) -> &'a Problem<'a> {
        let [full, work] = self.alone.map(|search| search.problem);
        if full.data.n_rows() <= MOST_SHAPED { full } else { work }
    }

    /// What the effects do beside the shapes of the search, or beside those of what they leave.
    fn beside_shapes(&self, chosen: &Trial) -> Result<Standing, LabError> {
        let problem = self.shaped();
        // Here: with nothing taken out of residuals and slopes.
        let here = fit(problem, &chosen.fit.effects, &chosen.fit.variables, 0, 0.0)?;
        let mut own = Shapes::none(&chosen.fit.effects);
        if self.beside.is_none() {
            while own.grow(problem, &here, self.full.seed)? {}
        }
        beside::standing(problem, &here, self.full.base.len(), self.beside.map_or(&own, |(shapes, _)| shapes))
    }

    /// Whether effects and shapes make everything; a force's need not, as its shapes are finer.
    fn is_made(&self, standing: &Standing) -> bool {
        let left = standing.left_rms * self.full.problem.machine.error_unit().1;
        let floors = self.beside.map_or(&self.floors, |(_, floors)| floors);
        self.is_force() || self.least_of(floors).is_some_and(|floor| left <= BEYOND_DOUBT * floor)
    }

    pub(super) fn is_force(&self) -> bool {
        self.full.problem.data.quantity == Quantity::Force
    }

    /// Which of the effects stand beside what no effect makes.
    pub(super) fn standing(&self, chosen: &Trial) -> Result<Vec<bool>, LabError> {
        if self.is_snake() && self.beside.is_none() {
            return Ok(vec![false; chosen.found.len()]);
        }
        let standing = self.beside_shapes(chosen)?;
        let is_made = self.is_made(&standing);
        let least = if self.is_force() { BESIDE } else { BESIDE_OF_SNAKE };
        let stands = |(slot, share): (usize, &f64)| is_made && *share >= least && !self.full.is_imitation(chosen, slot);
        Ok(standing.shares.iter().enumerate().map(stands).collect())
    }

    /// Whether a drift that was found is a jump: a snake that was hit.
    pub(super) fn is_jump(&self) -> Result<bool, LabError> {
        let (search, chosen) = (self.alone[1], &self.found.chosen);
        if !self.is_snake() || self.beside.is_some() {
            return Ok(false);
        }
        let is_drift = |slot: &usize| search.candidates[chosen.found[*slot]].class == Class::Drift.label();
        let mut drifts = (0..chosen.found.len()).filter(is_drift);
        drifts.try_fold(false, |is_jump, slot| Ok(is_jump || mixture::is_jump(search, chosen, slot)?))
    }
}
