//! The diagnosis of joints: each one by itself, then all together.

use super::answer::{self, Answer};
use super::beside::{Variation, varied, with_common_columns};
use super::clock::Diagnosed;
use super::clock_rate::{Rate, rates};
use super::columns;
use super::first::first;
use super::floor::{Floor, floor};
use super::following::follows;
use super::gate::{Blocks, HeldOut, gate, held_out, in_errors, order};
use super::kind::Kind;
use super::numbers::{excluded, solutions};
use super::own;
use super::proposals::proposals;
use super::refine::{Fit, Loss, as_given, refine, tangents};
use super::search::{Plan, Search, n_effective};
use super::shapes::{beside, strongest_shape, without_harm};
use super::signal::Signal;
use super::simulate::Member;
use super::starts::settled;
use super::terms::{self, Value, Values};
use crate::diagnose::screen::orthonormal;
use crate::diagnose::{
    DiagnoseOptions, FormulaTerm, GroupShare, SAME, Structure, Verdict, rhythm, sections, structure,
};
use crate::machine::{JointsLab, MachineUnderTest};
use crate::noise;
use crate::stage::stage;
use crate::{LabError, Measurements, Problem, scored_time_s};
use rayon::prelude::*;

/// Rows of the loss while lists are searched, and at the end.
const MOST_SEARCHED: usize = 2500;
const MOST_JUDGED: usize = 20_000;
/// Uneven hysteresis is sought where a motion has as many strokes: of fewer, its bend fits what differs from stroke to stroke (20 s of a
/// real jaw: 0.20 deg where even hysteresis leaves 0.25, but 0.29 against 0.25 deg in another recording).
const STROKES_OF_UNEVEN: usize = 12;
/// Of records of more rows lists are searched and judged on sections.
const LONG: usize = 60_000;
/// Lists that are kept at each depth.
const WIDTH: usize = 3;
/// Family-wise level of the first effect.
const LEVEL: f64 = 0.05;
/// An effect that takes away this much, beyond so many standard errors, needs no test.
const OVERWHELMING: f64 = 0.35;
const BEYOND_CHANCE: f64 = 3.0;
/// Nor does one that leaves less than this of the mean square: where a motion turns once, the error stands in few blocks, and
/// neither a standard error over blocks nor the test can see what it takes away.
const NEXT_TO_NOTHING: f64 = 0.1;
/// Fewer correlation times than this are too short for any test.
const FEWEST_TIMES: f64 = 15.0;
/// Effects that explain less than this share are hypotheses.
const PARTLY: f64 = 0.5;
/// The same beside a shape that no effect makes: share of what is left without the effects.
const BESIDE: f64 = 0.25;
/// A rest of structure below this level is no chance.
const LEVEL_OF_REST: f64 = 0.02;
/// An error of this ratio of the noise from row to row is not called the measurement's own where its floor is unknown.
pub(super) const FAR_ABOVE_ROWS: f64 = 3.0;
/// White noise cannot make an error of this ratio of the floor.
const BEYOND_DOUBT: f64 = 1.1;
/// A column that leaves less than this part of the mean square that the effects leave, with one gain beside the calibrated model, is what
/// they imitate: they are hypotheses until it is in the model.
const IMITATED: f64 = 0.5;

/// What was found of one joint.
pub(super) struct Found {
    pub joint: usize,
    pub verdict: Verdict,
    /// Whether the measurement follows the command, as far as anybody can say.
    pub is_followed: bool,
    /// The list that stands, or the hypotheses.
    pub fit: Fit,
    pub values: Values,
    /// Its members, the one that brings most first, with their shares, and the mean squares before and after each.
    pub order: Vec<Kind>,
    pub steps: Vec<f64>,
    pub classes: Vec<Vec<Kind>>,
    pub probabilities: Vec<f64>,
    pub before: HeldOut,
    pub after: HeldOut,
    pub floor: Floor,
    pub structure: Structure,
    pub structured: bool,
    pub singles: Vec<Single>,
    pub proposals: Vec<FormulaTerm>,
    pub variations: Vec<Variation>,
    pub needed_s: Option<f64>,
    pub as_given: f64,
    pub n_blocks: usize,
    /// What is left says of the clock's rate in each recording.
    pub rates: Vec<Option<Rate>>,
}

impl Found {
    /// Whether the effects of the list are asserted.
    pub fn stands(&self) -> bool {
        matches!(self.verdict, Verdict::Missing | Verdict::Partly)
    }

    /// Its effects as they stand in a chain, which has neither shapes without a name nor measurements that come ahead.
    pub fn in_chain(&self) -> impl Iterator<Item = (Kind, &Vec<Value>)> {
        let members = self.fit.members.iter().zip(&self.values.members);
        members.filter(|(m, _)| is_in_chain(m)).map(|(m, values)| (m.kind, values))
    }
}

/// Whether it is an effect with a name.
pub(super) fn is_in_chain(member: &Member) -> bool {
    !member.kind.is_shape() && !member.is_ahead()
}

/// One candidate alone.
pub(super) struct Single {
    pub kind: Kind,
    pub mean_square: f64,
    pub p_value: f64,
}

/// Says what is missing from a machine of joints, by the clock that the data have.
///
/// # Errors
/// [`LabError::Chain`] where the model as given cannot be computed.
pub(super) fn diagnose(
    machine: &JointsLab,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosed, LabError> {
    let excluded = excluded(machine, data)?;
    let is_long = data.n_rows() > LONG;
    let (work, left_out) =
        if is_long { (sections(data, &excluded), Vec::new()) } else { (data.clone(), excluded.clone()) };
    let hints = columns::check(machine, data)?;
    let (machine, _) = settled(machine, &work, &options.recordings)?;
    let machine = &machine;
    let search = |machine: &JointsLab| {
        let case = Case { machine, data, work: &work, excluded: &excluded, left_out: &left_out, options };
        (0..data.n_outputs).into_par_iter().map(|joint| case.joint(joint)).collect()
    };
    let (own, found) = own::in_turn(machine, &work, options, search)?;
    let machine = own.as_ref().map_or(machine, |own| &own.joints);
    let own_values = own.as_ref().map_or(&[][..], |own| &own.values);
    let of_recording = |k: usize| Rate::told(&found.iter().map(|own| own.rates[k]).collect::<Vec<_>>());
    let rates = (0..options.first_trials().len()).map(of_recording).collect();
    let answer = Answer { machine, data, options, found, own_values, hints, n_outliers: excluded.len() };
    Ok(Diagnosed { answer: answer::diagnosis(answer)?, rates })
}

struct Case<'a> {
    machine: &'a JointsLab,
    data: &'a Measurements,
    work: &'a Measurements,
    excluded: &'a [usize],
    left_out: &'a [usize],
    options: &'a DiagnoseOptions,
}

impl Case<'_> {
    fn joint(&self, joint: usize) -> Result<Found, LabError> {
        stage(&format!("Effects of joint {}", joint + 1));
        let recordings = self.options.first_trials();
        let signal = Signal::new(self.machine, self.work, joint, self.left_out, MOST_SEARCHED, &recordings)?;
        let line = self.line(joint)?;
        let offered = &self.options.offered;
        let mut signal = signal.with_columns(self.work).with_formulas(self.work, offered, line);
        // The last steps on all rows.
        let is_long = self.data.n_rows() > LONG;
        let all = if is_long { None } else { Some(self.data) };
        let judged = match all {
            Some(data) => {
                let all = Signal::new(self.machine, data, joint, self.excluded, MOST_JUDGED, &recordings)?;
                all.with_columns(data).with_formulas(data, offered, line)
            }
            None => signal.clone(),
        };
        let judged = with_common_columns(&mut signal, judged);
        let weight = vec![1.0; signal.rows.len()];
        let noise = fast_noise(&signal);
        let loss = Loss { weight: &weight, noise };
        let mut candidates = if signal.moves() { candidates(&signal) } else { Vec::new() };
        if signal.n_strokes() < STROKES_OF_UNEVEN {
            candidates.retain(|kind| *kind != Kind::UnevenPlays);
        }
        if signal.moves() {
            candidates.extend(offered.iter().copied().map(Kind::Own));
            candidates.extend(Kind::shapes(&signal));
        }
        let mut search = Search::new(&signal, loss, candidates);
        let best = search.run(Plan { width: WIDTH, depth: self.options.max_effects });
        let weight = vec![1.0; judged.rows.len()];
        let loss = Loss { weight: &weight, noise };
        let mut last = Search::new(&judged, loss, search.candidates.clone());
        let kinds = best.kinds();
        let parts = search.pool.iter().filter(|(key, _)| key.iter().all(|kind| kinds.contains(kind)));
        let parts: Vec<(Vec<Kind>, Fit)> =
            parts.map(|(key, fit)| (key.clone(), as_given(&judged, &fit.members, loss))).collect();
        last.pool.extend(parts);
        let best = refine(&judged, &best.members, loss, 8, 1e-6, true);
        last.n_effective = n_effective(&best);
        stage("How sure each effect is");
        Ok(self.judge(&search, &last, best))
    }

    /// Gain and offset of a joint as a formula sees its position: as far as they are known before anything is found.
    fn line(&self, joint: usize) -> Result<(f64, f64), LabError> {
        if self.options.offered.is_empty() {
            return Ok((1.0, 0.0));
        }
        let own = solutions(self.machine, self.work, &[0])?.swap_remove(joint);
        Ok((own.gains[0], own.offsets[0]))
    }

    fn judge(&self, search: &Search, last: &Search, best: Fit) -> Found {
        let (signal, loss) = (last.signal, last.loss);
        let base = last.base().clone();
        let blocks =
            if signal.n_recordings >= 3 { Blocks::recordings(signal) } else { Blocks::new(signal, last.n_effective) };
        let before = held_out(signal, &base, loss, &blocks, 3);
        let (mut fit, mut after) = gate(last, &best, &blocks);
        let times = n_effective(if fit.members.is_empty() { &best } else { &fit });
        let problem = problem(self.machine, self.data_of(signal), signal, times);
        let test = first(last, &problem, self.options.seed);
        let gained = in_errors(&before.blocks, &after.blocks);
        let left = after.mean_square / before.mean_square.max(1e-300);
        let overwhelming = left < NEXT_TO_NOTHING || left < OVERWHELMING && gained > BEYOND_CHANCE;
        let mut hypotheses = None;
        let no_known = fit.members.iter().all(|m| m.kind.is_shape());
        let is_chance = if no_known { gained < BEYOND_CHANCE } else { test.p_value > LEVEL && !overwhelming };
        if !fit.members.is_empty() && is_chance {
            hypotheses = Some(fit);
            (fit, after) = (base.clone(), before.clone());
        }
        let (fit, after, mut variations) = varied(last, fit, after, (self.machine, self.data_of(signal)));
        let (mut fit, mut after) = without_harm(last, fit, after, &blocks);
        variations.retain(|own| fit.members.iter().any(|member| member.kind == own.kind));
        let floor = floor(signal, &problem, &fit, after.mean_square.min(before.mean_square).sqrt());
        let shape = strongest_shape(last, &fit, &blocks, &after);
        let with_shapes = after.mean_square;
        if shape.is_some() {
            let known = last.part(&fit, |kind| !kind.is_shape(), 8);
            after = held_out(signal, &known, loss, &blocks, 3);
        }
        let at_floor = |mean_square: f64| {
            floor.sigma.map(|sigma| mean_square.sqrt() <= sigma * noise::at_floor(floor.relative_error))
        };
        let (mut structure, mut structured) =
            remaining(&problem, signal, &fit, &floor, at_floor(with_shapes), self.options.seed);
        let share = floor.sigma.and_then(|sigma| {
            let above = before.mean_square - sigma * sigma;
            (above > 0.0 && !fit.members.is_empty())
                .then(|| ((before.mean_square - after.mean_square) / above).clamp(0.0, 1.0))
        });
        let mut explained = share.unwrap_or(1.0 - after.mean_square / before.mean_square);
        let n_known = fit.members.iter().filter(|m| is_in_chain(m)).count();
        if let Some((kind, part)) = shape {
            structured = true;
            structure.groups.insert(0, GroupShare { name: kind.name(), share: part, p_value: structure.p_value });
            explained = beside(last, &fit, &blocks, with_shapes);
        }
        structured |=
            floor.is_far_below(after.mean_square.sqrt()) || is_far_above_rows(signal, &floor, after.mean_square);
        let mut verdict = match (n_known == 0, structured) {
            (true, false) => Verdict::None,
            (false, false) => Verdict::Missing,
            (false, true) if explained >= if shape.is_some() { BESIDE } else { PARTLY } => Verdict::Partly,
            _ => Verdict::Unknown,
        };
        // Beside what is asserted, as it will stand in the model.
        let of_rest = |beside: &Fit| proposals(self.machine, self.data_of(signal), &problem, signal, beside);
        if matches!(verdict, Verdict::None | Verdict::Missing) && !signal.columns.is_empty() {
            let of_column = of_rest(&fit).into_iter().find(|own| own.column.is_some());
            if let Some(own) = of_column {
                structured = true;
                verdict = if n_known == 0 { Verdict::Unknown } else { Verdict::Partly };
                structure.groups.insert(0, recorded_beside(own.share, structure.p_value));
            }
        }
        if matches!(verdict, Verdict::Missing | Verdict::Partly) && !signal.columns.is_empty() {
            let alone = of_rest(&base).into_iter().next().filter(|own| own.column.is_some());
            let left = |own: &FormulaTerm| (1.0 - own.share) * before.mean_square;
            if let Some(own) = alone.filter(|own| left(own) < IMITATED * after.mean_square) {
                (verdict, structured) = (Verdict::Unknown, true);
                structure.groups.insert(0, recorded_beside(own.share, structure.p_value));
            }
        }
        let seconds = scored_time_s(self.data);
        let mut needed_s = None;
        if times < FEWEST_TIMES && verdict != Verdict::Missing {
            verdict = Verdict::TooShort;
            needed_s = Some(seconds * 2.0 * FEWEST_TIMES / times);
        }
        let idea = hypotheses.or_else(|| (!best.members.is_empty()).then(|| best.clone()));
        if fit.members.is_empty()
            && matches!(verdict, Verdict::Unknown | Verdict::TooShort)
            && let Some(own) = idea
        {
            after = held_out(signal, &own, loss, &blocks, 3);
            fit = own;
        }
        let is_followed = verdict == Verdict::TooShort
            || follows(self.machine, signal, before.mean_square.min(after.mean_square), n_effective(&base));
        if !is_followed {
            verdict = Verdict::Unknown;
            (fit, after) = (base.clone(), before.clone());
        }
        let proposals = match verdict {
            _ if !is_followed => Vec::new(),
            Verdict::Partly => of_rest(&last.part(&fit, |kind| !kind.is_shape(), 8)),
            Verdict::Unknown => of_rest(&base),
            _ => Vec::new(),
        };
        // Measurements that come ahead are calibration, as gain and offset are.
        let is_asserted = matches!(verdict, Verdict::None | Verdict::Missing | Verdict::Partly);
        let before = if is_asserted && fit.members.iter().any(Member::is_ahead) {
            let delayed = last.part(&fit, |kind| kind == Kind::Latency, 8);
            held_out(signal, &delayed, loss, &blocks, 3)
        } else {
            before
        };
        let mut order: Vec<Kind> =
            order(last, &fit).into_iter().map(|(kind, _)| kind).filter(|kind| !kind.is_shape()).collect();
        order.sort_by_key(|kind| !fit.members.iter().any(|own| own.kind == *kind && own.is_ahead()));
        let steps = steps(last, &fit, &order, &blocks, &before, &after);
        let (classes, probabilities) = classes(search, &fit, &order, self.options.seed);
        let singles = singles(search, &test.of_kind);
        let rates = rates(signal, &fit, &self.options.first_trials(), self.data);
        Found {
            joint: signal.joint,
            verdict,
            is_followed,
            values: terms::values(signal, &fit, &problem),
            as_given: given(self.machine, self.data, signal.joint),
            fit,
            order,
            steps,
            classes,
            probabilities,
            before,
            after,
            floor,
            structure,
            structured,
            proposals,
            variations,
            singles,
            needed_s,
            n_blocks: problem.n_blocks,
            rates,
        }
    }

    fn data_of(&self, signal: &Signal) -> &Measurements {
        if signal.n() == self.data.n_rows() { self.data } else { self.work }
    }
}

fn recorded_beside(share: f64, p_value: f64) -> GroupShare {
    GroupShare { name: "a column that was recorded beside the motion", share, p_value }
}

/// What a joint may have. A gain and an offset that the model holds may be wrong; a curve of two terms is looked for only where
/// a free gain and offset take up what it does to them.
pub(super) fn candidates(signal: &Signal) -> Vec<Kind> {
    use super::signal::Number;
    let is_held = |number: Number| matches!(number, Number::Held(_));
    let (gain, offset) = (is_held(signal.gain), is_held(signal.offset));
    let mut all: Vec<Kind> =
        Kind::all(signal).into_iter().filter(|kind| !(gain || offset) || *kind != Kind::Curve).collect();
    all.extend(gain.then_some(Kind::Scale));
    all.extend(offset.then_some(Kind::Offset));
    all
}

/// Variance of a row's noise that is new in every row: third differences of what is measured.
pub(super) fn fast_noise(signal: &Signal) -> f64 {
    let rows: Vec<f64> = signal.measured.iter().copied().filter(|y| y.is_finite()).collect();
    let mut squares: Vec<f64> =
        rows.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).powi(2) / 20.0).collect();
    squares.sort_by(f64::total_cmp);
    // The median of a squared normal variable is 0.455 of its mean.
    squares.get(squares.len() / 2).map_or(0.0, |middle| middle / 0.455)
}

/// Whether an error is so much more than what changes from row to row that, where nobody knows the floor, it is taken for no noise.
fn is_far_above_rows(signal: &Signal, floor: &Floor, mean_square: f64) -> bool {
    floor.sigma.is_none() && mean_square > FAR_ABOVE_ROWS * FAR_ABOVE_ROWS * fast_noise(signal)
}

/// Error of the model as given, with gain 1 and offset 0 where it leaves them out: mean square.
fn given(machine: &JointsLab, data: &Measurements, joint: usize) -> f64 {
    let Ok(predicted) = machine.predict(machine.effects(), data) else { return f64::NAN };
    let own = predicted.iter().zip(&data.outputs).skip(joint).step_by(data.n_outputs);
    let (sum, n) = own.filter(|(_, y)| y.is_finite()).fold((0.0, 0.0), |(s, n), (f, y)| (s + (f - y).powi(2), n + 1.0));
    sum / f64::max(n, 1.0)
}

/// The rows of the loss as a problem of one output, in blocks as long as its memory asks for.
pub(super) fn problem<'a>(machine: &'a JointsLab, data: &Measurements, signal: &Signal, times: f64) -> Problem<'a> {
    let mut own = data.select(&signal.rows);
    own.inputs = signal.rows.iter().map(|&row| signal.inputs[signal.joint][row]).collect();
    own.outputs = signal.rows.iter().map(|&row| signal.measured[row]).collect();
    (own.n_inputs, own.n_outputs) = (1, 1);
    own.sigma = None;
    let seconds = scored_time_s(&own);
    let shortest_s = (4.0 * seconds / times).min(seconds / 8.0).max(1e-9);
    Problem::new(machine, own, &[], shortest_s)
}

/// What a fit leaves: whether it has structure, and what it depends on.
fn remaining(
    problem: &Problem,
    signal: &Signal,
    fit: &Fit,
    floor: &Floor,
    at_floor: Option<bool>,
    seed: u64,
) -> (Structure, bool) {
    let residual = &fit.solution.residual;
    let predicted: Vec<f64> = problem.data.outputs.iter().zip(residual).map(|(y, r)| y - r).collect();
    let mut structure = structure(problem, residual, &orthonormal(&tangents(signal, fit)), &predicted, seed);
    let rhythm = if floor.is_white { None } else { rhythm(problem, residual) };
    if let Some(rhythm) = &rhythm {
        let name = "a rhythm in time that the motion does not have";
        structure.groups.insert(0, GroupShare { name, share: rhythm.share, p_value: rhythm.p_value });
        structure.p_value = structure.p_value.min(rhythm.p_value);
    }
    let rms = (fit.square() / residual.len().max(1) as f64).sqrt();
    let beyond_doubt = floor.is_white && floor.sigma.is_some_and(|sigma| rms > BEYOND_DOUBT * sigma);
    let foreseeable = structure.groups.first().is_some_and(|own| own.share > if floor.is_white { 0.03 } else { 0.1 });
    let is_at_floor = at_floor == Some(true);
    let structured =
        rhythm.is_some() || !is_at_floor && (structure.p_value < LEVEL_OF_REST || beyond_doubt || foreseeable);
    (structure, structured)
}

/// Held-out mean squares with none, one, two ... of the effects in their order.
fn steps(search: &Search, fit: &Fit, order: &[Kind], blocks: &Blocks, before: &HeldOut, after: &HeldOut) -> Vec<f64> {
    let between = (1..order.len()).into_par_iter().map(|n| {
        let part = search.part(fit, |kind| order[..n].contains(&kind), 6);
        held_out(search.signal, &part, search.loss, blocks, 3).mean_square
    });
    let mut steps = vec![before.mean_square];
    steps.extend(between.collect::<Vec<f64>>());
    if !order.is_empty() {
        steps.push(after.mean_square);
    }
    steps
}

/// What is not even this near is not compared.
const COMPARED: f64 = 1.3;
/// One-sided 5 % of Student's t for the usual number of blocks.
const T_ONE_SIDED: f64 = 1.69;
/// An effect that leaves so much more is another one, whatever few blocks say.
const CLEARLY_WORSE: f64 = 1.15;
const RESAMPLES: usize = 500;

/// For each member the kinds that these data cannot tell from it, itself first, and how often one of them comes out best.
fn classes(search: &Search, fit: &Fit, order: &[Kind], seed: u64) -> (Vec<Vec<Kind>>, Vec<f64>) {
    let own = refine(search.signal, &fit.members, search.loss, 4, 1e-5, true);
    let blocks = Blocks::new(search.signal, search.n_effective);
    let best = held_out(search.signal, &own, search.loss, &blocks, 3);
    let one = |slot: &Kind| {
        let rest = search.part(&own, |kind| kind != *slot, 6);
        let others: Vec<(Kind, HeldOut)> = search
            .others(&own, *slot)
            .into_par_iter()
            .filter_map(|kind| {
                let other = search.extend(&rest, kind)?;
                if other.square() > COMPARED * own.square() || other.imitates(search.signal) {
                    return None;
                }
                Some((kind, held_out(search.signal, &other, search.loss, &blocks, 3)))
            })
            .collect();
        let is_same = |other: &HeldOut| {
            let ratio = other.mean_square / best.mean_square.max(1e-300);
            ratio <= SAME * SAME || ratio < CLEARLY_WORSE && in_errors(&other.blocks, &best.blocks) < T_ONE_SIDED
        };
        let mut class = vec![*slot];
        class.extend(others.iter().filter(|(_, other)| is_same(other)).map(|(kind, _)| *kind));
        let probability = answer::frequency(&best, &others, &class, RESAMPLES, seed);
        (class, probability)
    };
    order.iter().map(one).unzip()
}

/// Every candidate alone.
fn singles(search: &Search, p_values: &[(Kind, f64)]) -> Vec<Single> {
    let blocks = Blocks::new(search.signal, search.n_effective);
    let one = |(kind, p_value): &(Kind, f64)| {
        let fit = search.pool.get(&vec![*kind])?;
        let held = held_out(search.signal, fit, search.loss, &blocks, 1);
        Some(Single { kind: *kind, mean_square: held.mean_square, p_value: *p_value })
    };
    p_values.par_iter().filter_map(one).collect()
}
