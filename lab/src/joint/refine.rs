//! The nonlinear part of a fit: Levenberg and Marquardt's method on the projected residual, on logarithms of the parameters.

use super::kind::{Class, Kind};
use super::signal::Signal;
use super::simulate::{Member, Run, Varies};
use super::solve::{Design, Solution, evaluate, solve, weighted_normal};
use core::f64::consts::TAU;
use nalgebra::DVector;

/// A fitted list.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// In the order of the chain.
    pub members: Vec<Member>,
    /// Gains, offsets and amplitudes, and what is left.
    pub solution: Solution,
}

/// Which rows count, and the variance of a row's noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loss<'a> {
    pub weight: &'a [f64],
    pub noise: f64,
}

/// One coordinate of a fit.
#[derive(Clone, Copy, Debug)]
enum Coordinate {
    /// Member and parameter.
    Value(usize, usize),
    /// Member and trial.
    Start(usize, usize),
    /// Member: how a number of it depends on a column.
    Slope(usize),
}

/// How far a difference quotient reaches, and the longest step.
const REACH: f64 = 3e-3;
const LONGEST: f64 = 0.7;
const TRIES: usize = 5;
/// A shorter delay, in rows, is not told from what a slow effect does between them.
const SHORTEST_DELAY: f64 = 0.25;
/// What is left of a slow effect's delay once measurements that come ahead have taken it back, as a part of it.
const UNDONE: f64 = 0.25;
/// A number changes at most by this part of itself over half the range of a column.
pub(super) const STEEPEST: f64 = 0.9;

impl Fit {
    /// Effects without their values, which name a list.
    pub fn kinds(&self) -> Vec<Kind> {
        kinds(&self.members)
    }

    /// Sum of squares.
    pub fn square(&self) -> f64 {
        self.solution.square
    }

    /// Parameters beyond gain and offset; a start state and a shape of unloading, known within bounds, count half.
    pub fn n_parameters(&self) -> f64 {
        let of = |m: &Member| {
            let starts = if m.starts.is_empty() { 0.0 } else { 0.5 + 0.25 * (m.starts.len() as f64 - 1.0).min(6.0) };
            let slopes = f64::from(u8::from(m.varies.is_some()));
            let bounded = if m.kind == Kind::BoucWen { 0.5 } else { 0.0 };
            m.values.len() as f64 - bounded + m.kind.n_linear() as f64 + starts + slopes
        };
        self.members.iter().map(of).sum()
    }

    /// Whether a member imitates something else: a parameter lies at an end that matters, hysteresis
    /// runs ahead of the motion, a rhythm is the motion's, or its loops are no more uneven than those of a plainer kind.
    pub fn imitates(&self, signal: &Signal) -> bool {
        (0..self.members.len()).any(|i| self.member_imitates(signal, i))
    }

    /// The same of one member.
    pub fn member_imitates(&self, signal: &Signal, i: usize) -> bool {
        let own = &self.members[i];
        let at_end = own.values.iter().zip(own.kind.ranges(signal)).any(|(value, range)| range.at_end(*value));
        let is_motion = own.kind == Kind::Rhythm && signal.is_of_motion(own.values[0]);
        at_end
            || is_motion
            || own.kind == Kind::Periodic && (self.is_beyond_its_period(i) || is_line_on_levels(signal, own.values[0]))
            || own.kind.is_plainer(&own.values, signal)
            || own.kind == Kind::Latency && self.is_within_a_row(signal, own.values[0])
            || self.is_undone(own)
            || own.kind.lags_behind() && self.amplitudes(i).iter().any(|a| a * self.solution.gains[0] < 0.0)
    }

    /// Whether a repeating error is larger than the period in which it repeats: a part out of centre by so much would not turn.
    fn is_beyond_its_period(&self, i: usize) -> bool {
        let size = self.amplitudes(i).iter().map(|a| a * a).sum::<f64>().sqrt();
        size > self.members[i].values[0] * self.solution.gains[0].abs()
    }

    /// Whether a delay beside a slow effect is so short that the rows are too coarse for it: what the slow effect does between them is not
    /// known so well.
    fn is_within_a_row(&self, signal: &Signal, delay_s: f64) -> bool {
        let is_slow = |own: &Member| own.kind != Kind::Latency && own.kind.class() == Class::Rate;
        delay_s.abs() < SHORTEST_DELAY * signal.typical_step_s && self.members.iter().any(is_slow)
    }

    /// Whether measurements that come ahead take back what a slow effect is late by: both together only smooth the command, which one
    /// that was rounded looks like.
    fn is_undone(&self, own: &Member) -> bool {
        let late_s = match (own.kind, own.values.as_slice()) {
            (Kind::Lag, [time_s]) => *time_s,
            (Kind::SecondOrder, [frequency, damping]) => swing_late_s(*frequency, *damping),
            _ => return false,
        };
        self.members.iter().any(|other| other.is_ahead() && is_taken_back(late_s, -other.values[0]))
    }

    /// Amplitudes of a member's columns.
    fn amplitudes(&self, i: usize) -> &[f64] {
        let from: usize = self.members[..i].iter().map(|own| own.kind.n_linear()).sum();
        &self.solution.amplitudes[from..from + self.members[i].kind.n_linear()]
    }
}

/// How late a swing is, s, as far as its motion is slow.
pub(super) fn swing_late_s(frequency_rad_per_s: f64, damping: f64) -> f64 {
    2.0 * damping / frequency_rad_per_s
}

/// Whether measurements that come so far ahead take back what an effect is late by.
pub(super) fn is_taken_back(late_s: f64, ahead_s: f64) -> bool {
    (late_s - ahead_s).abs() < UNDONE * late_s
}

/// Where a straight line has more than this share of a wave's squares, it is no wave.
const MOST_OF_LINE: f64 = 0.5;

/// Whether waves of this period are mostly a straight line at the few commands that a joint is told: it goes a whole number of periods
/// from each to the next, or nearly.
fn is_line_on_levels(signal: &Signal, period: f64) -> bool {
    let levels = &signal.levels;
    let n = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / n;
    let square: f64 = levels.iter().map(|u| (u - mean).powi(2)).sum();
    let on_line = |wave: fn(f64) -> f64| {
        let (sum, along) = levels.iter().fold((0.0, 0.0), |(sum, along), u| {
            let own = wave(TAU * u / period);
            (sum + own, along + own * (u - mean))
        });
        sum * sum / n + along * along / square
    };
    // Of sine and cosine together the squares are n.
    levels.len() > 1 && on_line(f64::sin) + on_line(f64::cos) > MOST_OF_LINE * n
}

/// The kinds of a list, sorted: lists with the same kinds are the same.
pub(super) fn kinds(members: &[Member]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = members.iter().map(|m| m.kind).collect();
    kinds.sort_unstable();
    kinds
}

/// Fits the amplitudes alone.
pub(super) fn as_given(signal: &Signal, members: &[Member], loss: Loss) -> Fit {
    let (_, _, solution) = evaluate(signal, members, loss.weight, loss.noise);
    Fit { members: members.to_vec(), solution }
}

fn coordinates(signal: &Signal, members: &[Member], with_starts: bool) -> Vec<Coordinate> {
    let mut all = Vec::new();
    for (i, member) in members.iter().enumerate() {
        all.extend((0..member.values.len()).map(|k| Coordinate::Value(i, k)));
        all.extend(member.varies.map(|_| Coordinate::Slope(i)));
        if with_starts && !member.starts.is_empty() && signal.n_trials <= MOST_STARTS {
            all.extend((0..member.starts.len()).map(|trial| Coordinate::Start(i, trial)));
        }
    }
    all
}

/// Of more trials start states are not fitted: each matters little then.
const MOST_STARTS: usize = 40;

/// Fits everything from these values; `with_starts` frees the start states.
pub(super) fn refine(
    signal: &Signal,
    members: &[Member],
    loss: Loss,
    iterations: usize,
    tolerance: f64,
    with_starts: bool,
) -> Fit {
    let mut members = members.to_vec();
    let (mut run, mut design, mut solution) = evaluate(signal, &members, loss.weight, loss.noise);
    let coordinates = coordinates(signal, &members, with_starts);
    if coordinates.is_empty() {
        return Fit { members, solution };
    }
    let mut damping = 1e-3;
    for _ in 0..iterations {
        let changes = changes(signal, &members, &run, &design, &solution, &coordinates);
        let (mut gram, gradient) = weighted_normal(&changes, &solution.residual, loss.weight);
        gram -= solution.taken(&changes, loss.weight);
        let before = solution.square;
        let mut better = None;
        for _ in 0..TRIES {
            let Some(step) = step(&gram, &gradient, damping) else { break };
            let there = moved(signal, &members, &coordinates, &step);
            let run = Run::new(signal, &there);
            let design = Design::new(signal, &run);
            let solved = solve(signal, &design, loss.weight, loss.noise);
            if solved.square < solution.square {
                damping = f64::max(damping / 5.0, 1e-9);
                better = Some((there, run, design, solved));
                break;
            }
            damping *= 8.0;
        }
        let Some(next) = better else { break };
        (members, run, design, solution) = next;
        if before - solution.square < tolerance * before {
            break;
        }
    }
    Fit { members, solution }
}

/// What a unit of each coordinate does to the prediction, amplitudes held.
fn changes(
    signal: &Signal,
    members: &[Member],
    run: &Run,
    design: &Design,
    solution: &Solution,
    coordinates: &[Coordinate],
) -> Vec<Vec<f64>> {
    let quotient = |there: &[Member], from: usize, reach: f64| -> Vec<f64> {
        let mut other = run.clone();
        other.redo(signal, there, from);
        let mut change = design.change(&Design::new(signal, &other), signal, solution);
        change.iter_mut().for_each(|x| *x /= reach);
        change
    };
    let mut all = Vec::with_capacity(coordinates.len());
    let mut of_starts: Option<(usize, Vec<f64>)> = None;
    for coordinate in coordinates {
        match *coordinate {
            Coordinate::Value(i, k) => {
                let range = members[i].kind.ranges(signal)[k];
                let here = range.coordinate(members[i].values[k]);
                let inside = here + REACH <= range.coordinate(range.high);
                let reach = if inside { REACH } else { -REACH };
                let mut there = members.to_vec();
                there[i].values[k] = range.value(here + reach);
                all.push(quotient(&there, i, reach));
            }
            Coordinate::Slope(i) => {
                let mut there = members.to_vec();
                let here = members[i].varies.map_or(0.0, |own| own.slope);
                let reach = if here > 0.0 { -REACH } else { REACH };
                there[i] = sloped(&members[i], reach);
                all.push(quotient(&there, i, reach));
            }
            Coordinate::Start(i, trial) => {
                // One simulation moves the starts of all trials: each acts on its own rows alone.
                if of_starts.as_ref().is_none_or(|(own, _)| *own != i) {
                    let mut there = members.to_vec();
                    let inward = |start: f64| if start > 0.5 { -10.0 * REACH } else { 10.0 * REACH };
                    let reaches: Vec<f64> = members[i].starts.iter().map(|start| inward(*start)).collect();
                    there[i].starts.iter_mut().zip(&reaches).for_each(|(start, reach)| *start += reach);
                    let mut change = quotient(&there, i, 1.0);
                    change.iter_mut().zip(&signal.rows).for_each(|(x, &row)| *x /= reaches[signal.trial[row]]);
                    of_starts = Some((i, change));
                }
                let own = of_starts.as_ref().map_or(&[] as &[f64], |(_, change)| change);
                let rows = own.iter().zip(&signal.rows);
                all.push(rows.map(|(x, &row)| if signal.trial[row] == trial { *x } else { 0.0 }).collect());
            }
        }
    }
    all
}

fn step(gram: &nalgebra::DMatrix<f64>, gradient: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let n = gradient.len();
    let mut matrix = gram.clone();
    for k in 0..n {
        matrix[(k, k)] = matrix[(k, k)] * (1.0 + damping) + 1e-12 * (1.0 + gram[(k, k)].abs());
    }
    let scale = DVector::from_fn(n, |k, _| matrix[(k, k)].max(1e-300).sqrt().recip());
    let scaled = nalgebra::DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let step = scaled.cholesky()?.solve(&gradient.component_mul(&scale)).component_mul(&scale);
    step.iter().all(|s| s.is_finite()).then(|| step.map(|s| s.clamp(-LONGEST, LONGEST)))
}

fn moved(signal: &Signal, members: &[Member], coordinates: &[Coordinate], step: &DVector<f64>) -> Vec<Member> {
    let mut there = members.to_vec();
    for (coordinate, step) in coordinates.iter().zip(step.iter()) {
        match *coordinate {
            Coordinate::Value(i, k) => {
                let range = members[i].kind.ranges(signal)[k];
                there[i].values[k] = range.value(range.coordinate(members[i].values[k]) + step);
            }
            Coordinate::Start(i, trial) => {
                there[i].starts[trial] = (members[i].starts[trial] + step).clamp(-1.0, 1.0);
            }
            Coordinate::Slope(i) => there[i] = sloped(&members[i], *step),
        }
    }
    there
}

/// A member whose number depends more on its column, so far that it keeps its sign.
fn sloped(member: &Member, step: f64) -> Member {
    let slope = |own: Varies| Varies { slope: (own.slope + step).clamp(-STEEPEST, STEEPEST), ..own };
    Member { varies: member.varies.map(slope), ..member.clone() }
}

/// A compass search, which corners of the loss do not stop.
pub(super) fn polish(signal: &Signal, fit: Fit, loss: Loss) -> Fit {
    let coordinates: Vec<Coordinate> = coordinates(signal, &fit.members, false);
    if coordinates.is_empty() {
        return fit;
    }
    let mut best = fit;
    let mut reach = 0.15;
    for _ in 0..14 {
        let mut improved = false;
        for coordinate in &coordinates {
            for sign in [1.0, -1.0] {
                let there = moved(signal, &best.members, &[*coordinate], &DVector::from_element(1, sign * reach));
                let tried = as_given(signal, &there, loss);
                if tried.square() < best.square() * (1.0 - 1e-7) {
                    best = tried;
                    improved = true;
                    break;
                }
            }
        }
        if !improved {
            reach *= 0.45;
        }
        if reach < 2e-3 {
            break;
        }
    }
    best
}

/// What a fit can do to the prediction, to first order: offset, gain, amplitudes and nonlinear parameters.
pub(super) fn tangents(signal: &Signal, fit: &Fit) -> Vec<Vec<f64>> {
    let Design { passed, columns, .. } = Design::new(signal, &Run::new(signal, &fit.members));
    let mut slopes = vec![vec![1.0; passed.len()], passed];
    slopes.extend(columns);
    slopes.extend(slopes_by_value(signal, fit).into_iter().map(|(_, _, slope)| slope));
    slopes
}

/// Slopes of the prediction by each nonlinear parameter in its own unit, for uncertainties.
pub(super) fn slopes_by_value(signal: &Signal, fit: &Fit) -> Vec<(usize, usize, Vec<f64>)> {
    let run = Run::new(signal, &fit.members);
    let design = Design::new(signal, &run);
    let coordinates: Vec<Coordinate> = coordinates(signal, &fit.members, false);
    let changes = changes(signal, &fit.members, &run, &design, &fit.solution, &coordinates);
    let per_unit = |(coordinate, mut change): (&Coordinate, Vec<f64>)| {
        let (i, k) = match *coordinate {
            Coordinate::Value(i, k) => (i, k),
            // Behind the values.
            Coordinate::Slope(i) => return (i, fit.members[i].values.len(), change),
            Coordinate::Start(i, _) => return (i, usize::MAX, change),
        };
        let (range, value) = (fit.members[i].kind.ranges(signal)[k], fit.members[i].values[k]);
        let here = range.coordinate(value);
        let unit = (range.value(here + 1e-4) - range.value(here - 1e-4)) / 2e-4;
        change.iter_mut().for_each(|x| *x /= if unit == 0.0 { 1.0 } else { unit });
        (i, k, change)
    };
    coordinates.iter().zip(changes).map(per_unit).collect()
}
