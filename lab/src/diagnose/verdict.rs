//! The diagnosis from beginning to end.

use super::accept::{Comparison, FOLDS};
use super::alike::is_alike;
use super::alternatives::Alternatives;
use super::answer::{CandidateAnswer, Diagnosis, FoundEffect, FoundParameter, LoadCell, Remaining, Verdict};
use super::calibration::{calibration, inseparable};
use super::rhythm::{Rhythm, rhythm};
use super::screen::{Cell, orthonormal};
use super::search::{Search, Trial, memory};
use super::sign_flip::SignFlip;
use super::words::{sentence, state};
use super::working::working_rows;
use super::{GroupShare, columns, experiment, force_rest, gate, lists, structure};
use crate::cells::{Usable, load_cells};
use crate::fit::{Fit, dot, held_out_block_squares, held_out_output_squares, uncertainty};
use crate::free::free_variables;
use crate::machine::{Candidate, MachineUnderTest};
use crate::noise::{FloorSource, NoiseFloor};
use crate::prepare::{Prepared, prepare};
use crate::read::scatter_before_filter;
use crate::{LabError, Measurements, Problem, Quantity};

/// How to diagnose.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnoseOptions {
    /// Seed of all random numbers; the same seed gives the same bytes, whatever the number of threads.
    pub seed: u64,
    /// At most so many effects of a joint, or of a snake, are sought together, 1 to 5.
    pub max_effects: usize,
    /// Where several recordings are diagnosed together: name and first trial of each.
    pub recordings: Vec<(String, usize)>,
    /// Parameters of the model's own effects that are free: effect's name and parameter's name.
    pub free: Vec<(String, String)>,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self { seed: 1, max_effects: 5, recordings: Vec::new(), free: Vec::new() }
    }
}

impl DiagnoseOptions {
    /// First trial of each recording.
    pub(crate) fn first_trials(&self) -> Vec<usize> {
        if self.recordings.is_empty() { vec![0] } else { self.recordings.iter().map(|(_, first)| *first).collect() }
    }
}

/// Effects with more free parameters than this may be two simple ones in disguise.
const FEW_PARAMETERS: usize = 2;
/// Of a pair, neither effect may have more look-alikes than this that are as simple.
const MOST_LOOK_ALIKES: usize = 7;
/// Final error up to this ratio of the floor is the floor.
const AT_FLOOR: f64 = 1.04;
/// A rest of structure below this level is no chance.
const LEVEL_OF_REST: f64 = 0.02;
/// White noise cannot make an error of this ratio of the floor, whatever the test of structure sees.
const BEYOND_DOUBT: f64 = 1.1;
/// Nor does slow noise that nothing shows at rest make more than this ratio of what changes from row to row: a sensor that wanders by
/// more is not taken for granted.
const BEYOND_ROWS: f64 = 2.0;
/// Effects that explain less than this share are hypotheses.
const PARTLY: f64 = 0.5;
/// What looks different must leave this much more.
const CLEARLY: f64 = 1.5;

/// Says which effect is missing from a machine's model, or none, or that it cannot be said.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed, or a free parameter does not exist.
pub fn diagnose(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    if let Some(joints) = machine.as_joints() {
        return crate::joint::diagnose(joints, data, options)?.sketched(machine, data);
    }
    let Prepared { problem: full, mut floors, excluded, shortest_block_s, loads } = prepare(machine, data)?;
    let rows = working_rows(data, &excluded);
    let work = Problem::new(machine, data.select(&rows), &[], shortest_block_s)
        .with_loads(loads.cells())
        .with_noise(full.noise);
    let candidates = machine.candidates(data);
    let base_variables = free_variables(machine, data, &options.free)?;
    let search = |problem| Search {
        problem,
        candidates: &candidates,
        base: machine.effects(),
        base_variables: &base_variables,
        seed: options.seed,
    };
    let is_white = loads.cells().is_none_or(|cells| cells.is_white);
    let hint = columns::check(&work, floors.differences)?;
    let most = if hint.is_some() { 0 } else { options.max_effects };
    let mut found = run(&search(&work), &floors, is_white, most)?;
    // Differences of what a model leaves that is far off hold some of its error too, where rows are few: what the effects leave is
    // nearer to the noise, and shows whether they are enough.
    for _ in 0..MOST_FLOORS {
        let nearer = NoiseFloor::new(&work, &work.outputs_of(&found.chosen.fit.residual));
        if !nearer.is_below(&floors) {
            break;
        }
        floors = nearer;
        found = run(&search(&work), &floors, is_white, most)?;
    }
    found.decide(&search(&work), &search(&full));
    let n_outliers = excluded.len();
    Case { full: &search(&full), work: &search(&work), floors, loads, found, n_outliers, hint }
        .conclude()?
        .sketched(machine, data)
}

/// The floor is taken anew so many times.
const MOST_FLOORS: usize = 3;

/// What the search on the working rows found.
struct Findings {
    cells: Vec<Cell>,
    test: SignFlip,
    singles: Vec<Trial>,
    chosen: Trial,
    alternatives: Alternatives,
    /// Whether effects at the edge of what is physical would explain clearly more: the chosen ones are not the truth then.
    is_beaten: bool,
}

/// The best trials are compared on all rows where there are up to this many times as many.
const MORE_ROWS: usize = 4;
/// So many are compared ...
const CLOSEST: usize = 4;
/// ... while they are within this of the best on the working rows, in units of -2 ln likelihood.
const CLOSE_CONTEST: f64 = 40.0;

impl Findings {
    /// Chooses among the closest trials with all rows, of which the working rows are a part.
    fn decide(&mut self, work: &Search, full: &Search) {
        let (n, n_all) = (work.problem.n_scored, full.problem.n_scored);
        if self.chosen.found.is_empty() || n_all <= n || n_all > MORE_ROWS * n {
            return;
        }
        let trials = &self.alternatives.trials;
        let time = memory(work.problem, trials);
        let badness = |trial: &Trial| work.badness(trial, time);
        let Some(best) = trials.first().map(badness) else { return };
        let close = |trial: &&Trial| (badness(trial) - best) * n as f64 / time < CLOSE_CONTEST;
        let refit = |trial: &Trial| full.fitted(trial.found.clone(), &trial.fit.effects).ok();
        let mut again: Vec<Trial> = trials.iter().take_while(close).take(CLOSEST).filter_map(refit).collect();
        full.rank(&mut again);
        let place = again.first().and_then(|best| trials.iter().position(|own| own.found == best.found));
        if let Some(place) = place.filter(|place| *place > 0) {
            self.alternatives.prefer(place);
            self.chosen = self.alternatives.trials[0].clone();
        }
    }
}

fn run(search: &Search, floors: &NoiseFloor, are_cells_white: bool, max_effects: usize) -> Result<Findings, LabError> {
    let start = search.start()?;
    let comparison = Comparison {
        problem: search.problem,
        floor: floors.sigma().map(|(sigma, _)| sigma * (search.problem.data.n_outputs as f64).sqrt()),
        is_white: are_cells_white && matches!(floors.sigma(), Some((_, FloorSource::White))),
    };
    let mut found = one_or_two(search, &comparison, start, max_effects);
    if (1..max_effects).contains(&found.chosen.found.len()) {
        let shorter = &found.alternatives.trials;
        if let Some((chosen, alternatives)) = lists::longer(search, &comparison, &found.chosen, shorter, max_effects) {
            // An effect that almost anything could stand in for is the imperfection of another one's equation.
            if (0..chosen.found.len()).all(|slot| alternatives.n_as_simple(slot) <= MOST_LOOK_ALIKES) {
                found = Findings { chosen, alternatives, is_beaten: false, ..found };
            }
        }
    }
    Ok(found)
}

/// None, one or two effects.
fn one_or_two(search: &Search, comparison: &Comparison, start: Trial, max_effects: usize) -> Findings {
    let (cells, test) = search.look(&start);
    let singles = search.singles(&start, &cells);
    let deserves = |single: &&Trial| max_effects > 0 && comparison.deserves(&start, single, test.p_value);
    let Some(single) = singles.first().filter(deserves) else {
        let alternatives = Alternatives::new(search.problem, vec![start.clone()], search.seed);
        return Findings { chosen: start, cells, test, singles, alternatives, is_beaten: false };
    };
    // Many parameters in one effect may be two simple effects in disguise, but nothing else is periodic in the inputs.
    let periodic = single.found.iter().any(|&k| search.candidates[k].periodic.is_some());
    let n_own = search.base_variables.len();
    let many = !periodic && single.fit.variables.len() > n_own + FEW_PARAMETERS;
    if max_effects > 1 && (many || comparison.leaves_something(single)) {
        let firsts = search.different(&singles);
        let looks: Vec<(Vec<Cell>, SignFlip)> = firsts.iter().map(|first| search.look(first)).collect();
        let p_value = looks.first().map_or(1.0, |(_, test)| test.p_value);
        if many || p_value < 0.05 {
            let second_cells: Vec<Vec<Cell>> = looks.into_iter().map(|(cells, _)| cells).collect();
            let mut pairs = search.pairs(&start, &cells, &firsts, &second_cells);
            if let Some(best) = pairs.first().cloned() {
                pairs.extend(search.swaps(&best));
            }
            let (imitations, pairs) = search.distinct(pairs).into_iter().partition(|pair| search.imitates(pair));
            let (imitations, pairs): (Vec<Trial>, Vec<Trial>) = (imitations, pairs);
            let time = memory(search.problem, &pairs);
            let n = search.problem.n_scored as f64 / time;
            let simpler = |pair: &Trial| {
                let better = (search.badness(single, time) - search.badness(pair, time)) * n;
                let (own, many) = (pair.fit.variables.len() - n_own, single.fit.variables.len() - n_own);
                let doubtful = 2 * own <= many || search.imitates(single);
                better > if doubtful { 0.0 } else { CLOSE_CONTEST } && own <= many
            };
            let deserves = |pair: &&Trial| comparison.deserves(single, pair, p_value) || simpler(pair);
            if let Some(pair) = pairs.first().filter(deserves).cloned() {
                let alternatives = Alternatives::new(search.problem, pairs, search.seed);
                // A second effect that almost anything could stand in for is the imperfection of the first one's equation.
                if (0..pair.found.len()).all(|slot| alternatives.n_as_simple(slot) <= MOST_LOOK_ALIKES) {
                    let better = |own: &Trial| search.badness(&pair, time) - search.badness(own, time);
                    let is_beaten = imitations.iter().any(|own| better(own) * n > CLOSE_CONTEST);
                    return Findings { chosen: pair, cells, test, singles, alternatives, is_beaten };
                }
            }
        }
    }
    let alternatives = Alternatives::new(search.problem, singles.clone(), search.seed);
    Findings { chosen: single.clone(), cells, test, singles, alternatives, is_beaten: false }
}

/// Everything that a conclusion needs.
struct Case<'a> {
    full: &'a Search<'a>,
    work: &'a Search<'a>,
    floors: NoiseFloor,
    loads: Usable,
    found: Findings,
    n_outliers: usize,
    /// What is probably wrong with the columns.
    hint: Option<String>,
}

impl Case<'_> {
    fn conclude(self) -> Result<Diagnosis, LabError> {
        let search = self.full;
        let problem = search.problem;
        let (unit, scale) = problem.machine.error_unit();
        let start = search.start()?;
        let as_given = problem.outputs_of(&problem.residual(search.base)?);
        let mut chosen = search.fitted(self.found.chosen.found.clone(), &self.found.chosen.fit.effects)?;
        let prefixes = self.order(&mut chosen)?;
        let held_out = |trial: &Trial| held_out_rms(problem, &trial.fit) * scale;
        let (before, after) = (held_out(&start), held_out(&chosen));
        let sigma = self.floors.sigma();
        let floor = sigma.map(|(sigma, _)| sigma * (problem.data.n_outputs as f64).sqrt() * scale);
        let remaining = self.remaining(&chosen, before, after, floor)?;
        let effects = self.effects(&chosen, &prefixes, before)?;
        let class = |slot: usize| self.full.candidates[chosen.found[slot]].class;
        let is_doubtful = |slot: usize| remaining.looks_like.is_some_and(|group| is_alike(class(slot), group));
        let is_force = problem.data.quantity == Quantity::Force;
        let doubtful: Vec<bool> = if is_force && remaining.structured {
            let stand = force_rest::standing(problem, &chosen.fit, search.base.len(), search.seed)?;
            stand.into_iter().map(|stands| !stands).collect()
        } else {
            (0..effects.len()).map(|slot| remaining.structured && is_doubtful(slot)).collect()
        };
        let explains = || remaining.unexplained <= 1.0 - PARTLY && self.stands(&chosen);
        let verdict = match (remaining.structured, effects.is_empty()) {
            _ if self.hint.is_some() => Verdict::Unknown,
            (true, false) if (is_force || explains()) && doubtful.contains(&false) => Verdict::Partly,
            (true, _) => Verdict::Unknown,
            (false, true) => Verdict::None,
            (false, false) => Verdict::Missing,
        };
        let n_reversals = gate::reversals(&problem.data);
        let has_loads = problem.loads().is_some();
        let separating = || effects.iter().find_map(|own| experiment::separate(&own.class, n_reversals, has_loads));
        let next_experiment = experiment::next(verdict, separating, remaining.looks_like);
        let candidates = self.candidates(&effects, scale);
        let loads = self.load_cells(&start, &chosen)?;
        let mut cautions = gate::cautions(problem, self.n_outliers, true);
        if let Usable::No(why) = &self.loads {
            cautions.push(why.clone());
        }
        cautions.extend(loads.iter().flatten().filter_map(LoadCell::caution));
        let n_own = search.base_variables.len();
        cautions.extend(inseparable(&chosen.fit, n_own));
        cautions.extend(self.hint.clone());
        let mut terms = chosen.fit.effects.clone();
        let (effects, partial) = if verdict == Verdict::Unknown {
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
        Ok(Diagnosis {
            sentence: match &self.hint {
                Some(hint) => format!("the columns first: {hint}"),
                None => sentence(verdict, &effects, &remaining, after, floor, unit),
            },
            verdict,
            cautions,
            loads,
            unit: unit.to_owned(),
            floor_relative_error: 0.0,
            as_given_rms: problem.rms_of_outputs(dot(&as_given, &as_given)) * scale,
            explained_share: (!effects.is_empty()).then_some(1.0 - remaining.unexplained),
            calibration: calibration(problem, &chosen.fit, n_own),
            calibrated: None,
            noise_floor: floor,
            floor_source: sigma.map_or("the data do not tell", |(_, source): (f64, FloorSource)| source.label()),
            base_heldout_rms: before,
            final_heldout_rms: after,
            effects,
            partial,
            candidates,
            remaining,
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
        let problem = self.full.problem;
        let (Some(rows), Some(cells)) = (problem.loads(), self.loads.cells()) else { return Ok(None) };
        let predicted = |trial: &Trial| -> Result<Vec<f64>, LabError> {
            Ok(problem.predicted_with_loads(&trial.fit.effects, &problem.data)?.1)
        };
        let (before, after) = (predicted(start)?, predicted(chosen)?);
        Ok(Some(load_cells(rows, cells, &before, &after)))
    }

    /// Whether the effects are more than imitations: none at the edge of what is physical, and what explains most is
    /// clearly better than everything that looks different.
    fn stands(&self, chosen: &Trial) -> bool {
        let class = |trial: &Trial| trial.found.first().map(|&k| self.full.candidates[k].class);
        let singles = &self.found.singles;
        let best = singles.first();
        let rival = singles.iter().find(|own| class(own) != best.and_then(class));
        let is_clear = match (best, rival) {
            (Some(best), Some(rival)) => rival.fit.sum_of_squares > CLEARLY * best.fit.sum_of_squares,
            _ => true,
        };
        is_clear && !self.found.is_beaten && !self.full.imitates(chosen)
    }

    /// Puts the effect that brings most first, and gives the fits of the first one, two ... on the working rows.
    fn order(&self, chosen: &mut Trial) -> Result<Vec<Trial>, LabError> {
        if chosen.found.len() < 2 {
            return Ok(Vec::new());
        }
        let (order, prefixes) = lists::order(self.work, chosen);
        let base = self.full.base.len();
        let mut effects = chosen.fit.effects[..base].to_vec();
        effects.extend(order.iter().map(|&i| chosen.fit.effects[base + i].clone()));
        let found = order.iter().map(|&i| chosen.found[i]).collect();
        *chosen = self.full.fitted(found, &effects)?;
        Ok(prefixes)
    }

    fn effects(&self, chosen: &Trial, prefixes: &[Trial], base_rms: f64) -> Result<Vec<FoundEffect>, LabError> {
        let problem = self.full.problem;
        let (_, scale) = problem.machine.error_unit();
        let mut errors = vec![base_rms];
        errors.extend(prefixes.iter().map(|own| held_out_rms(self.work.problem, &own.fit) * scale));
        errors.push(held_out_rms(problem, &chosen.fit) * scale);
        (0..chosen.found.len())
            .map(|slot| {
                let place = self.found.chosen.found.iter().position(|k| *k == chosen.found[slot]).unwrap_or(slot);
                let class = self.found.alternatives.class(place);
                Ok(FoundEffect {
                    name: self.full.candidates[chosen.found[slot]].name.to_owned(),
                    probability: self.found.alternatives.probability(&class),
                    class: class.into_iter().map(|k| self.full.candidates[k].name.to_owned()).collect(),
                    before: errors[slot],
                    after: errors[slot + 1],
                    parameters: self.parameters(chosen, slot)?,
                    joint: None,
                    sketch: None,
                })
            })
            .collect()
    }

    fn parameters(&self, chosen: &Trial, slot: usize) -> Result<Vec<FoundParameter>, LabError> {
        let place = self.full.base.len() + slot;
        let known = uncertainty(self.full.problem, &chosen.fit);
        let term = &chosen.fit.effects[place];
        let own = self.full.problem.machine.parameters(term)?;
        let parameter = |(k, parameter): (usize, crate::Parameter)| {
            let free = chosen.fit.variables.iter().position(|v| v.effect == place && v.parameter == k);
            FoundParameter {
                name: parameter.name,
                unit: parameter.unit,
                value: term.values[k],
                se: free.map_or(0.0, |n| {
                    known.robust[n].hypot(0.5 * self.found.alternatives.spread(&chosen.found, slot, k))
                }),
                se_naive: free.map_or(0.0, |n| known.naive[n]),
                is_free: free.is_some(),
                on_bound: free.is_some_and(|n| chosen.fit.variables[n].bound(&chosen.fit.effects).is_some()),
            }
        };
        Ok(own.into_iter().enumerate().map(parameter).collect())
    }

    fn remaining(&self, chosen: &Trial, before: f64, after: f64, floor: Option<f64>) -> Result<Remaining, LabError> {
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
        if let Some(Rhythm { share, p_value }) = rhythm {
            structure
                .groups
                .insert(0, GroupShare { name: "a rhythm in time that the motion does not have", share, p_value });
            structure.p_value = structure.p_value.min(p_value);
        }
        let above = |rms: f64| (rms.powi(2) - floor.unwrap_or(0.0).powi(2)).max(0.0);
        let unexplained = if above(before) > 0.0 { (above(after) / above(before)).min(1.0) } else { 0.0 };
        let at_floor = floor.is_some_and(|floor| after <= AT_FLOOR * floor);
        let beyond_doubt = white && floor.is_some_and(|floor| after > BEYOND_DOUBT * floor);
        let foreseeable = structure.groups.first().is_some_and(|group| group.share > if white { 0.03 } else { 0.1 });
        let (_, scale) = problem.machine.error_unit();
        // A filter takes away what changes from row to row, so that what it leaves may be far above its floor and slow noise all the same.
        let rows = scatter_before_filter(&problem.data).or(self.floors.differences);
        let rows = rows.map(|sigma| sigma * (problem.data.n_outputs as f64).sqrt() * scale);
        let beyond_rows = rows.is_some_and(|rows| after > BEYOND_ROWS * rows);
        let structured = rhythm.is_some()
            || beyond_rows
            || self.found.is_beaten
            || chosen.found.len() > 1 && self.full.imitates(chosen)
            || !at_floor && (structure.p_value < LEVEL_OF_REST || beyond_doubt || foreseeable);
        if problem.data.quantity == Quantity::Force {
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
                Some(trial) => Some(held_out_block_squares(self.work.problem, &trial.fit, FOLDS).iter().sum()),
                None => cells().map(|(cell, _)| cell.sum_of_squares).reduce(f64::min),
            };
            CandidateAnswer {
                name: candidate.name,
                class: candidate.class,
                heldout_rms: squares.map(|squares: f64| self.work.problem.rms(squares) * scale),
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

/// Error of the outputs on blocks that the fit did not see, in their unit.
fn held_out_rms(problem: &Problem, fit: &Fit) -> f64 {
    problem.rms_of_outputs(held_out_output_squares(problem, fit, FOLDS).iter().sum())
}
