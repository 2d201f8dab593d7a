//! The diagnosis from beginning to end.

use super::accept::FOLDS;
use super::answer::{
    CandidateAnswer, Diagnosis, FoundEffect, FoundParameter, LoadCell, Remaining, Verdict, columns_first,
};
use super::beside::Shapes;
use super::calibration::{calibration, inseparable};
use super::findings::{Findings, run};
use super::floor::Floor;
use super::mixture::Mixed;
use super::rhythm::{Rhythm, rhythm};
use super::screen::orthonormal;
use super::search::{Search, Trial};
use super::stand::Beside;
use super::whole::DiagnoseOptions;
use super::words::{sentence, state, too_short};
use super::working::{tried_rows, working_rows};
use super::{GroupShare, columns, experiment, force_columns, force_rest, gate, lists, omitted, structure};
use crate::cells::{Usable, load_cells};
use crate::fit::{Uncertainty, dot, held_out_block_squares, uncertainty};
use crate::free::free_variables;
use crate::machine::{Candidate, MachineUnderTest};
use crate::noise::{FloorSource, NoiseFloor};
use crate::prepare::{Prepared, prepare};
use crate::read::scatter_before_filter;
use crate::stage::stage;
use crate::{FEWEST_BLOCKS, LabError, Measurements, Problem, Quantity, Term};

/// A rest of structure below this level is no chance.
const LEVEL_OF_REST: f64 = 0.02;
/// White noise cannot make an error of this ratio of the floor, whatever the test of structure sees.
pub(super) const BEYOND_DOUBT: f64 = 1.1;
/// Nor does slow noise that nothing shows at rest make more than this ratio of what changes from row to row: a sensor that wanders by
/// more is not taken for granted.
const BEYOND_ROWS: f64 = 2.0;
/// A slow wave that is more than this share of a force's rest is a rest.
const SLOW_REST: f64 = 0.6;

/// Says which effect is missing from a snake, from segments or from a joint's force, or none, or that it cannot be said; by the one
/// clock that the data have.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed, or a free parameter does not exist.
pub(super) fn by_one_clock(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    stage("The measurement's own noise");
    let Prepared { problem: full, mut floors, excluded, shortest_block_s, loads } = prepare(machine, data)?;
    let rows = working_rows(data, &excluded);
    let of_rows = |data: Measurements| {
        let all = Problem::new(machine, data, &[], shortest_block_s).by_output(full.output_factors());
        all.with_loads(loads.cells()).with_noise(full.noise)
    };
    let work = of_rows(data.select(&rows));
    let few = tried_rows(&work.data).map(|rows| (of_rows(work.data.select(&rows)), rows));
    let tried = few.as_ref().map_or(&work, |(few, _)| few);
    let mut candidates = machine.candidates(data);
    candidates.extend(options.offered.iter().map(|own| own.candidate()));
    let base_variables = free_variables(machine, data, &options.free)?;
    let search = |problem| Search {
        problem,
        candidates: &candidates,
        base: machine.effects(),
        base_variables: &base_variables,
        seed: options.seed,
    };
    let is_white = loads.cells().is_none_or(|cells| cells.is_white);
    let hint = match data.quantity {
        Quantity::Force => force_columns::check(&work, &base_variables)?.map(columns::Hint::of),
        _ => columns::check(&work, floors.differences)?,
    };
    let most = if hint.is_some() { 0 } else { options.max_effects };
    let mut found = run(&search(tried), &search(&work), &floors, is_white, most)?;
    // Differences of what a model leaves that is far off hold some of its error too, where rows are few: what the effects leave is
    // nearer to the noise, and shows whether they are enough.
    for _ in 0..MOST_FLOORS {
        let nearer = NoiseFloor::new(&work, &work.outputs_of(&found.chosen.fit.residual));
        if !nearer.is_below(&floors) {
            break;
        }
        floors = nearer;
        found = run(&search(tried), &search(&work), &floors, is_white, most)?;
    }
    stage("The best lists on all rows");
    found.decide(&search(&work), &search(&full));
    let n_outliers = excluded.len();
    let alone = [&search(&full), &search(&work)];
    let tried = &search(tried);
    let case = Case {
        full: alone[0],
        work: alone[1],
        alone,
        tried,
        beside: None,
        recordings: &options.recordings,
        floors,
        loads,
        found,
        n_outliers,
        hint,
    };
    let (start, chosen) = (alone[0].start()?, case.found.chosen_on(alone[0])?);
    let Some(Mixed { mut shapes, floors, .. }) = case.first_shapes(&start, &chosen)? else {
        return case.conclude(&start, chosen)?.sketched(machine, data);
    };
    // What no effect makes is put beside the effects shape by shape, and the search is begun anew beside each; a snake's shapes are
    // chosen together.
    let shaped = case.shaped();
    let mut last: Option<(Problem, Problem, Findings, Trial)> = None;
    loop {
        let (problem, fit) = last.as_ref().map_or((shaped, &chosen.fit), |(full, .., own)| (full, &own.fit));
        let is_more = if case.is_snake() { last.is_none() } else { shapes.grow(problem, fit, options.seed)? };
        if !is_more {
            break;
        }
        stage("Effects beside what none of them makes");
        let columns = shapes.columns(&work)?;
        let few = few.as_ref().map(|(few, rows)| few.beside(&work.part_of(&columns, rows)));
        let (full, work) = (shaped.beside(&shapes.columns(shaped)?), work.beside(&columns));
        let tried = few.as_ref().unwrap_or(&work);
        let mut found = run(&alone[0].on(tried), &alone[0].on(&work), &floors, is_white, most)?;
        found.decide(&alone[0].on(&work), &alone[0].on(&full));
        let own = found.chosen_on(&alone[0].on(&full))?;
        last = Some((full, work, found, own));
    }
    let Some((full, work, found, own)) = last else { return case.conclude(&start, chosen)?.sketched(machine, data) };
    let beside = Beside { full: &alone[0].on(&full), work: &alone[0].on(&work), shapes: (&shapes, &floors), found };
    let (case, chosen) = case.or_beside(chosen, beside, own)?;
    case.conclude(&start, chosen)?.sketched(machine, data)
}

/// The floor is taken anew so many times.
const MOST_FLOORS: usize = 3;

/// Of more rows than this a list that stands in its order already is not fitted once more.
const MOST_REFITTED: usize = 30_000;

/// A list in another order that leaves up to this much more of the squares is as good.
const AS_GOOD: f64 = 1.002;

/// How well the variables of a fit are known.
struct Known {
    /// Given the names.
    errors: Uncertainty,
    /// By how much a scale that is not named may have moved each.
    moved: Vec<f64>,
}

/// Everything that a conclusion needs.
pub(super) struct Case<'a> {
    /// On all rows; beside shapes on those of [`Case::shaped`].
    pub(super) full: &'a Search<'a>,
    /// On the working rows.
    pub(super) work: &'a Search<'a>,
    /// On all and on the working rows with nothing beside the effects: what a model file with these effects leaves.
    pub(super) alone: [&'a Search<'a>; 2],
    /// On the rows where effects were tried, with nothing beside them.
    pub(super) tried: &'a Search<'a>,
    /// Shapes that `full` and `work` have beside the effects, and the noise that both leave.
    pub(super) beside: Option<(&'a Shapes, &'a NoiseFloor)>,
    /// Name and first trial of each recording, where there are several.
    pub(super) recordings: &'a [(String, usize)],
    pub(super) floors: NoiseFloor,
    pub(super) loads: Usable,
    pub(super) found: Findings,
    pub(super) n_outliers: usize,
    /// What is probably wrong with the columns.
    pub(super) hint: Option<columns::Hint>,
}

impl Case<'_> {
    /// Error on blocks that a fit did not see, in the unit of errors; of a fit with nothing beside the effects.
    pub(super) fn error(&self, trial: &Trial) -> f64 {
        let problem = self.alone[0].problem;
        length(problem, &self.held_out_squares(problem, &trial.fit))
    }

    fn conclude(self, start: &Trial, mut chosen: Trial) -> Result<Diagnosis, LabError> {
        stage("How sure each effect is");
        let search = self.alone[0];
        let problem = search.problem;
        let (unit, scale) = problem.machine.error_unit();
        let as_given = problem.outputs_of(&problem.residual(search.base)?);
        let prefixes = self.order(&mut chosen)?;
        let refitted = match self.beside {
            None => None,
            Some(_) => Some(search.fitted(chosen.found.clone(), &chosen.fit.effects)?),
        };
        let alone = refitted.as_ref().unwrap_or(&chosen);
        let squares = [start, alone].map(|own| self.held_out_squares(problem, &own.fit));
        let [before, after] = squares.each_ref().map(|own| length(problem, own));
        let (is_denied, odd) =
            if chosen.found.is_empty() { (false, Vec::new()) } else { self.by_recordings(&squares[0], &squares[1]) };
        let floor = self.floor(&chosen);
        let remaining = self.remaining(&chosen, before, after, &floor)?;
        let known = self.known(&chosen)?;
        let effects = self.effects(&chosen, &prefixes, [before, after], &known)?;
        let doubtful: Vec<bool> = if remaining.structured {
            self.standing(&chosen)?.into_iter().map(|stands| !stands).collect()
        } else {
            vec![false; effects.len()]
        };
        let verdict = match (remaining.structured, effects.is_empty()) {
            _ if self.hint.is_some() => Verdict::Unknown,
            (true, false) if doubtful.contains(&false) && !is_denied => Verdict::Partly,
            // No test was possible: nobody knows whether something remains, or whether known effects explain it.
            _ if problem.n_blocks < FEWEST_BLOCKS && (remaining.structured || !floor.is_reached(after)) => {
                Verdict::TooShort
            }
            (true, _) => Verdict::Unknown,
            (false, false) if is_denied => Verdict::Unknown,
            (false, true) => Verdict::None,
            (false, false) => Verdict::Missing,
        };
        let next_experiment = experiment::asked_for(problem, verdict, &effects, remaining.looks_like);
        let candidates = self.candidates(&effects, scale);
        let loads = self.load_cells(start, &chosen)?;
        let mut cautions = gate::cautions(problem, self.n_outliers, true);
        if let Usable::No(why) = &self.loads {
            cautions.push(why.clone());
        }
        cautions.extend(loads.iter().flatten().filter_map(LoadCell::caution));
        let n_own = search.base_variables.len();
        cautions.extend(inseparable(&chosen.fit, n_own));
        cautions.extend(self.hidden_scale(&chosen, &known));
        cautions.extend(self.hint.iter().map(|hint| hint.said.clone()));
        cautions.extend(odd);
        let mut terms = chosen.fit.effects.clone();
        let (effects, partial) = if matches!(verdict, Verdict::Unknown | Verdict::TooShort) {
            (Vec::new(), effects)
        } else {
            let base = self.full.base.len();
            (0..doubtful.len()).rev().filter(|slot| doubtful[*slot]).for_each(|slot| {
                terms.remove(base + slot);
            });
            let (partial, stand): (Vec<_>, Vec<_>) = effects.into_iter().zip(doubtful).partition(|(_, own)| *own);
            let only = |all: Vec<(FoundEffect, bool)>| all.into_iter().map(|(effect, _)| effect).collect::<Vec<_>>();
            (only(stand), only(partial))
        };
        let explained_share = floor.rms.filter(|_| !effects.is_empty()).map(|_| 1.0 - remaining.unexplained);
        Ok(Diagnosis {
            sentence: match &self.hint {
                Some(hint) => columns_first(&hint.said),
                None if verdict == Verdict::TooShort => too_short(problem),
                None => sentence(verdict, &effects, |_| String::new(), &remaining, after, floor.rms, unit),
            },
            needed_s: (verdict == Verdict::TooShort).then(|| problem.needed_s()),
            verdict,
            cautions,
            loads,
            clocks: Vec::new(),
            cameras: Vec::new(),
            order: self.hint.iter().flat_map(|hint| hint.order.clone()).collect(),
            model_free_rms: None,
            locked: None,
            unit: unit.to_owned(),
            floor_relative_error: floor.relative_error,
            as_given_rms: problem.rms_of_outputs(dot(&as_given, &as_given)) * scale,
            explained_share,
            calibration: calibration(self.full.problem, &chosen.fit, n_own),
            calibrated: None,
            noise_floor: floor.rms,
            floor_source: floor.source,
            base_heldout_rms: before,
            final_heldout_rms: after,
            effects,
            partial,
            candidates,
            remaining,
            proposals: Vec::new(),
            variations: Vec::new(),
            next_experiment,
            terms,
            rows: [
                problem.data.n_rows(),
                problem.n_scored_outputs() / problem.data.n_outputs,
                self.n_outliers,
                problem.n_blocks,
            ],
            floors: self.floors,
            seed: search.seed,
        })
    }

    /// What the load cells were found to read, with the model as given and with the effects.
    fn load_cells(&self, start: &Trial, chosen: &Trial) -> Result<Option<Vec<LoadCell>>, LabError> {
        let problem = self.alone[0].problem;
        let (Some(rows), Some(cells)) = (problem.loads(), self.loads.cells()) else { return Ok(None) };
        let predicted = |trial: &Trial| -> Result<Vec<f64>, LabError> {
            Ok(problem.predicted_with_loads(&trial.fit.effects, &problem.data)?.1)
        };
        let (before, after) = (predicted(start)?, predicted(chosen)?);
        Ok(Some(load_cells(rows, cells, &before, &after)))
    }

    /// Puts the effect that brings most first, and gives the fits of the first one, two ... on the rows of the trials; the list is fitted
    /// to the end, because its values are told. An error of a screw that stood before a scale has another period behind it, to which
    /// no downhill way may lead: a list that explains less in this order stays in its own.
    fn order(&self, chosen: &mut Trial) -> Result<Vec<Trial>, LabError> {
        let (order, [prefixes, as_they_stand]) = match chosen.found.len() {
            0 => return Ok(Vec::new()),
            1 => (vec![0], [Vec::new(), Vec::new()]),
            _ => lists::order(self.tried, chosen),
        };
        let is_long = self.full.problem.data.n_rows() > MOST_REFITTED;
        if order.is_sorted() && is_long {
            return Ok(prefixes);
        }
        let fitted = |found: Vec<usize>, effects: &[Term]| match is_long {
            true => self.full.fitted(found, effects),
            false => self.full.fitted_to_end(found, effects),
        };
        let base = self.full.base.len();
        let mut effects = chosen.fit.effects[..base].to_vec();
        effects.extend(order.iter().map(|&i| chosen.fit.effects[base + i].clone()));
        let ordered = fitted(order.iter().map(|&i| chosen.found[i]).collect(), &effects)?;
        if ordered.fit.sum_of_squares <= AS_GOOD * chosen.fit.sum_of_squares {
            *chosen = ordered;
            return Ok(prefixes);
        }
        *chosen = fitted(chosen.found.clone(), &chosen.fit.effects)?;
        Ok(as_they_stand)
    }

    /// How well the variables of a fit are known.
    fn known(&self, chosen: &Trial) -> Result<Known, LabError> {
        Ok(Known { errors: uncertainty(self.full.problem, &chosen.fit), moved: self.moved_by_scale(chosen)? })
    }

    fn effects(
        &self,
        chosen: &Trial,
        prefixes: &[Trial],
        ends: [f64; 2],
        known: &Known,
    ) -> Result<Vec<FoundEffect>, LabError> {
        let problem = self.tried.problem;
        let mut errors = vec![ends[0]];
        errors.extend(prefixes.iter().map(|own| length(problem, &self.held_out_squares(problem, &own.fit))));
        errors.push(ends[1]);
        (0..chosen.found.len())
            .map(|slot| {
                let class = self.found.alternatives.class(self.place_of(chosen, slot));
                Ok(FoundEffect {
                    name: self.full.candidates[chosen.found[slot]].name.to_owned(),
                    probability: self.found.alternatives.probability(&class),
                    class: class.into_iter().map(|k| self.full.candidates[k].name.to_owned()).collect(),
                    before: errors[slot],
                    after: errors[slot + 1],
                    parameters: self.parameters(chosen, slot, known)?,
                    joint: None,
                    sketch: None,
                })
            })
            .collect()
    }

    /// By how much a scale that no effect of a snake's list is or looks like may have moved each variable.
    fn moved_by_scale(&self, chosen: &Trial) -> Result<Vec<f64>, LabError> {
        let is_scale = |k: &usize| omitted::is_scale(&self.full.candidates[*k]);
        let stands_for_one =
            |slot: usize| self.found.alternatives.class(self.place_of(chosen, slot)).iter().any(is_scale);
        if !self.is_snake() || (0..chosen.found.len()).any(stands_for_one) {
            return Ok(vec![0.0; chosen.fit.variables.len()]);
        }
        omitted::moved_by_scale(self.full, chosen)
    }

    /// A sentence on the effects of whose standard errors such a scale makes the most.
    fn hidden_scale(&self, chosen: &Trial, known: &Known) -> Option<String> {
        let place = |slot: usize| self.full.base.len() + slot;
        let is_most = |slot: &usize| {
            let own = chosen.fit.variables.iter().zip(known.moved.iter().zip(&known.errors.robust));
            own.filter(|(own, _)| own.effect == place(*slot)).any(|(_, (moved, robust))| moved > robust)
        };
        let names: Vec<&str> =
            (0..chosen.found.len()).filter(is_most).map(|slot| self.full.candidates[chosen.found[slot]].name).collect();
        omitted::caution(&names)
    }

    /// Where the effect in a place of a list stands in the list as it was found.
    fn place_of(&self, chosen: &Trial, slot: usize) -> usize {
        self.found.chosen.found.iter().position(|k| *k == chosen.found[slot]).unwrap_or(slot)
    }

    fn parameters(&self, chosen: &Trial, slot: usize, known: &Known) -> Result<Vec<FoundParameter>, LabError> {
        let place = self.full.base.len() + slot;
        let term = &chosen.fit.effects[place];
        let own = self.full.problem.machine.parameters(term)?;
        let parameter = |(k, parameter): (usize, crate::Parameter)| {
            let free = chosen.fit.variables.iter().position(|v| v.effect == place && v.parameter == k);
            FoundParameter {
                name: parameter.name,
                unit: parameter.unit,
                value: term.values[k],
                se: free.map_or(0.0, |n| {
                    let spread = 0.5 * self.found.alternatives.spread(&chosen.found, slot, k);
                    known.errors.robust[n].hypot(spread).hypot(known.moved[n])
                }),
                se_naive: free.map_or(0.0, |n| known.errors.naive[n]),
                is_free: free.is_some(),
                on_bound: free.is_some_and(|n| chosen.fit.variables[n].bound(&chosen.fit.effects).is_some()),
            }
        };
        Ok(own.into_iter().enumerate().map(parameter).collect())
    }

    pub(super) fn remaining(
        &self,
        chosen: &Trial,
        before: f64,
        after: f64,
        floor: &Floor,
    ) -> Result<Remaining, LabError> {
        // Of the shape alone: what is left of the loads is said beside it.
        let slopes: Vec<Vec<f64>> =
            self.found.chosen.fit.slopes.iter().map(|slope| self.work.problem.outputs_of(slope)).collect();
        let problem = &self.work.problem.of_outputs();
        let predicted = problem.machine.predict(&chosen.fit.effects, &problem.data)?;
        let residual = problem.weigh(&predicted);
        let basis = orthonormal(&slopes);
        let mut structure = structure::structure(problem, &residual, &basis, &predicted, self.full.seed);
        // A floor of slow noise contains a rhythm, so that an error at the floor says nothing about one.
        let white = matches!(self.floors.sigma(), Some((_, FloorSource::White)));
        let rhythm = if white { None } else { rhythm(problem, &residual) };
        if let Some(Rhythm { share, p_value, .. }) = rhythm {
            structure
                .groups
                .insert(0, GroupShare { name: "a rhythm in time that the motion does not have", share, p_value });
            structure.p_value = structure.p_value.min(p_value);
        }
        let above = |rms: f64| (rms.powi(2) - floor.rms.unwrap_or(0.0).powi(2)).max(0.0);
        let unexplained = if above(before) > 0.0 { (above(after) / above(before)).min(1.0) } else { 0.0 };
        let at_floor = floor.is_reached(after);
        let beyond_doubt = white && floor.rms.is_some_and(|floor| after > BEYOND_DOUBT * floor);
        let foreseeable = structure.groups.first().is_some_and(|group| group.share > if white { 0.03 } else { 0.1 });
        let (_, scale) = problem.machine.error_unit();
        // A filter takes away what changes from row to row, so that what it leaves may be far above its floor and slow noise all the same.
        let rows = scatter_before_filter(&problem.data).or(self.floors.differences);
        let rows = rows.map(|sigma| sigma * (problem.data.n_outputs as f64).sqrt() * scale);
        let beyond_rows = rows.is_some_and(|rows| after > BEYOND_ROWS * rows);
        // Beside effects that stand, a slow wave that is most of the rest is told, although a sensor may wander like that.
        let is_slow = || force_rest::slow_share(problem, &residual) > SLOW_REST;
        let has_slow_rest = self.is_force() && !chosen.found.is_empty() && !at_floor && is_slow();
        let structured = rhythm.is_some()
            || beyond_rows
            || has_slow_rest
            || self.found.is_beaten
            || self.is_jump()?
            || chosen.found.len() > 1 && self.full.imitates(chosen)
            || !at_floor && (structure.p_value < LEVEL_OF_REST || beyond_doubt || foreseeable);
        if self.is_force() {
            force_rest::name_rest(problem, &residual, structured, &mut structure);
        }
        Ok(Remaining {
            structured,
            p_value: structure.p_value,
            looks_like: structure
                .groups
                .first()
                .filter(|group| structured && group.share > 0.0)
                .map(|group| group.name),
            unexplained,
            structure,
        })
    }

    fn candidates(&self, effects: &[FoundEffect], scale: f64) -> Vec<CandidateAnswer> {
        let answer = |(k, candidate): (usize, &Candidate)| {
            let cells = || self.found.cells.iter().zip(&self.found.test.p_of_cell).filter(|(c, _)| c.candidate == k);
            let p_value = cells().map(|(_, p)| *p).fold(1.0, f64::min);
            let visible = cells().map(|(cell, _)| cell.visible).fold(0.0, f64::max);
            let refined = self.found.singles.iter().find(|trial| trial.found == [k]);
            let squares = match refined {
                Some(trial) => Some(held_out_block_squares(self.tried.problem, &trial.fit, FOLDS).iter().sum()),
                None => cells().map(|(cell, _)| cell.sum_of_squares).reduce(f64::min),
            };
            CandidateAnswer {
                name: candidate.name,
                class: candidate.class,
                heldout_rms: squares.map(|squares: f64| self.tried.problem.rms(squares) * scale),
                probability: if effects.is_empty() { 0.0 } else { self.found.alternatives.probability(&[k]) },
                p_value,
                state: state(candidate, effects, refined.is_some(), visible, p_value),
            }
        };
        let mut all: Vec<CandidateAnswer> = self.full.candidates.iter().enumerate().map(answer).collect();
        all.sort_by(|a, b| a.heldout_rms.unwrap_or(f64::INFINITY).total_cmp(&b.heldout_rms.unwrap_or(f64::INFINITY)));
        all
    }
}

/// Error whose outputs have these squares in all, in the unit of errors.
fn length(problem: &Problem, squares: &[f64]) -> f64 {
    problem.rms_of_outputs(squares.iter().sum()) * problem.machine.error_unit().1
}
