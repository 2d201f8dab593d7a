//! What the search finds on the working rows: none, one or two effects, and longer lists behind them. Of many working rows it tries
//! effects on a part, and compares what comes close on all of them.

use super::accept::{Comparison, FEWEST_OF_LIST};
use super::alternatives::Alternatives;
use super::lists;
use super::omitted::is_scale;
use super::screen::Cell;
use super::search::{Search, Trial, memory};
use super::sign_flip::SignFlip;
use crate::LabError;
use crate::noise::{FloorSource, NoiseFloor};
use crate::stage::stage;
use rayon::prelude::*;

/// Effects with more free parameters than this may be two simple ones in disguise.
const FEW_PARAMETERS: usize = 2;
/// Of a pair, neither effect may have more look-alikes than this that are as simple.
const MOST_LOOK_ALIKES: usize = 7;

/// What the search on the working rows found.
pub(super) struct Findings {
    pub cells: Vec<Cell>,
    pub test: SignFlip,
    pub singles: Vec<Trial>,
    pub chosen: Trial,
    pub alternatives: Alternatives,
    /// Whether effects at the edge of what is physical would explain clearly more: the chosen ones are not the truth then.
    pub is_beaten: bool,
    /// Whether no test speaks for the first effect: the list stands only where it takes away nearly everything.
    is_on_trial: bool,
}

/// A force along the tip's axis is there only where something pushes; a stiffness, a radius and a camera that are not quite those of the
/// data sheet every snake has. Beside a softening the one hardly differs from the others.
const NEEDS_A_PUSH: &str = "axial-tip-force";

/// A list whose first effect passes no test must take away this part of what the model as given leaves above the floor.
const NEARLY_ALL: f64 = 0.9;

/// The best trials are compared on all rows where there are up to this many times as many.
const MORE_ROWS: usize = 4;
/// So many are compared ...
const CLOSEST: usize = 4;
/// ... while they are within this of the best on the working rows, in units of -2 ln likelihood.
const CLOSE_CONTEST: f64 = 40.0;

impl Findings {
    /// What was chosen, fitted to the problem of another search.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the effects make no chain.
    pub(super) fn chosen_on(&self, search: &Search) -> Result<Trial, LabError> {
        search.fitted(self.chosen.found.clone(), &self.chosen.fit.effects)
    }

    /// What was chosen, and what the rows that it was tried on hardly tell from it, fitted to more rows and ranked there.
    fn on_more(mut self, tried: &Search, more: &Search) -> Result<Self, LabError> {
        let refit = |near: Vec<&Trial>| -> Vec<Trial> {
            let on_more = |trial: &Trial| more.fitted(trial.found.clone(), &trial.fit.effects).ok();
            let all = near.into_par_iter().filter_map(on_more);
            all.filter(|own| own.found.len() < 2 || !more.imitates(own)).collect()
        };
        let mut again = refit(self.alternatives.near());
        if again.is_empty() {
            again.push(self.chosen_on(more)?);
        }
        more.rank(&mut again);
        // Stand-ins were sought for what was best on fewer rows: another list has its own.
        let best = again[0].clone();
        if best.found.len() > 1 && best.found != self.chosen.found {
            let stand_ins = Alternatives::new(tried.problem, tried.swaps(&best), tried.seed);
            again.extend(refit(stand_ins.near()));
            again = more.distinct(again);
        }
        self.chosen = again[0].clone();
        self.alternatives = Alternatives::new(more.problem, again, more.seed);
        Ok(self)
    }

    /// With another list in place of the chosen one where it is clearly better as a whole. Noise with a memory makes such lists good too
    /// easily.
    fn or_at_once(self, search: &Search, comparison: &Comparison, max_effects: usize) -> Self {
        if !comparison.is_white || max_effects < 2 || self.chosen.found.is_empty() {
            return self;
        }
        let other = lists::or_at_once(search, comparison, &self.chosen, max_effects);
        self.or(other)
    }

    /// With another list in place of the chosen one, if there is one.
    fn or(self, other: Option<(Trial, Alternatives)>) -> Self {
        match other.filter(|(list, alternatives)| has_few_look_alikes(list, alternatives)) {
            Some((chosen, alternatives)) => Self { chosen, alternatives, is_beaten: false, ..self },
            None => self,
        }
    }

    /// Exchanges what was chosen; what each candidate is by itself stays.
    pub(super) fn exchange_choice(&mut self, other: &mut Self) {
        core::mem::swap(&mut self.chosen, &mut other.chosen);
        core::mem::swap(&mut self.alternatives, &mut other.alternatives);
        core::mem::swap(&mut self.is_beaten, &mut other.is_beaten);
    }

    /// Chooses among the closest trials with all rows, of which the working rows are a part; of names that no rows tell apart the one that
    /// needs no further cause.
    pub(super) fn decide(&mut self, work: &Search, full: &Search) {
        self.decide_with(work, full);
        let found = &self.chosen.found;
        let is_pushed = |k: &usize| work.candidates[*k].name == NEEDS_A_PUSH;
        let Some(slot) = found.iter().position(is_pushed).filter(|_| found.len() >= FEWEST_OF_LIST) else { return };
        let is_scale = |k: usize| is_scale(&work.candidates[k]);
        if let Some(place) = self.alternatives.no_worse_with(slot, is_scale) {
            self.choose(place);
        }
    }

    /// Makes a trial of these alternatives the chosen one.
    fn choose(&mut self, place: usize) {
        self.alternatives.prefer(place);
        self.chosen = self.alternatives.trials[0].clone();
    }

    fn decide_with(&mut self, work: &Search, full: &Search) {
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
            self.choose(place);
        }
    }
}

/// The best list of effects on the working rows, of those that come close on the rows of `tried`.
///
/// # Errors
/// [`LabError`] where the model as given makes no chain.
pub(super) fn run(
    tried: &Search,
    work: &Search,
    floors: &NoiseFloor,
    are_cells_white: bool,
    max_effects: usize,
) -> Result<Findings, LabError> {
    let found = on_rows(tried, floors, are_cells_white, max_effects)?;
    if tried.problem.data.n_rows() == work.problem.data.n_rows() {
        return Ok(found);
    }
    let found = found.on_more(tried, work)?;
    // What a part of the rows did not need, all of them may.
    let comparison = comparison_of(work, floors, are_cells_white);
    if !comparison.leaves_something(&found.chosen) {
        return Ok(found);
    }
    Ok(found.or_at_once(work, &comparison, max_effects))
}

fn comparison_of<'a>(search: &Search<'a>, floors: &NoiseFloor, are_cells_white: bool) -> Comparison<'a> {
    Comparison {
        problem: search.problem,
        floor: floors.sigma().map(|(sigma, _)| sigma * (search.problem.data.n_outputs as f64).sqrt()),
        is_white: are_cells_white && matches!(floors.sigma(), Some((_, FloorSource::White))),
    }
}

fn on_rows(
    search: &Search,
    floors: &NoiseFloor,
    are_cells_white: bool,
    max_effects: usize,
) -> Result<Findings, LabError> {
    let start = search.start()?;
    let comparison = comparison_of(search, floors, are_cells_white);
    let mut found = one_or_two(search, &comparison, &start, max_effects);
    if (1..max_effects).contains(&found.chosen.found.len()) {
        stage("Effects in longer lists");
        let longer = lists::longer(search, &comparison, &found.chosen, &found.alternatives.trials, max_effects);
        found = found.or(longer);
    }
    found = found.or_at_once(search, &comparison, max_effects);
    if found.is_on_trial && !comparison.takes(&start, &found.chosen, NEARLY_ALL) {
        let alternatives = Alternatives::new(search.problem, vec![start.clone()], search.seed);
        found = Findings { chosen: start, alternatives, is_beaten: false, ..found };
    }
    Ok(found)
}

/// An effect that almost anything could stand in for is the imperfection of another one's equation.
fn has_few_look_alikes(list: &Trial, alternatives: &Alternatives) -> bool {
    (0..list.found.len()).all(|slot| alternatives.n_as_simple(slot) <= MOST_LOOK_ALIKES)
}

/// None, one or two effects.
fn one_or_two(search: &Search, comparison: &Comparison, start: &Trial, max_effects: usize) -> Findings {
    stage("Effects, each alone");
    let (cells, test) = search.look(start);
    let singles = search.singles(start, &cells);
    let best = singles.first().filter(|_| max_effects > 0);
    let stands = best.is_some_and(|single| comparison.deserves(start, single, test.p_value));
    let is_on_trial = !stands && best.is_some_and(|single| comparison.takes_half(start, single));
    let Some(single) = best.filter(|_| stands || is_on_trial) else {
        let alternatives = Alternatives::new(search.problem, vec![start.clone()], search.seed);
        return Findings { chosen: start.clone(), cells, test, singles, alternatives, is_beaten: false, is_on_trial };
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
            stage("Effects in pairs");
            let second_cells: Vec<Vec<Cell>> = looks.into_iter().map(|(cells, _)| cells).collect();
            let mut pairs = search.pairs(start, &cells, &firsts, &second_cells);
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
                if has_few_look_alikes(&pair, &alternatives) {
                    let better = |own: &Trial| search.badness(&pair, time) - search.badness(own, time);
                    let is_beaten = imitations.iter().any(|own| better(own) * n > CLOSE_CONTEST);
                    return Findings { chosen: pair, cells, test, singles, alternatives, is_beaten, is_on_trial };
                }
            }
        }
    }
    let alternatives = Alternatives::new(search.problem, singles.clone(), search.seed);
    Findings { chosen: single.clone(), cells, test, singles, alternatives, is_beaten: false, is_on_trial }
}
