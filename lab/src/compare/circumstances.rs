//! What rows can be sorted by: shape, motion, time, load, trial, and whatever else was measured.

use super::motion::{self, Motion};
use super::parts::pair;
use crate::machine::MachineUnderTest;
use crate::noise::bounds;
use crate::{Measurements, Quantity};
use std::rc::Rc;

/// What of a row's error counts in a bin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// All of it.
    Whole,
    /// One output's.
    Output(usize),
    /// One segment's, from 0, along and across its bend.
    Segment(usize),
}

/// One way to sort rows into bins.
pub(super) struct Dimension<'a> {
    pub by: String,
    pub labels: Vec<String>,
    /// The bin of a row, if it belongs to any.
    pub place: Box<dyn Fn(usize) -> Option<usize> + 'a>,
    /// What of the error counts.
    pub part: Part,
    /// Whether the mean of a signed error means anything.
    pub has_mean: bool,
}

const RAD: f64 = core::f64::consts::PI / 180.0;
/// Width of a bin of the bend, deg.
const BEND_STEP_DEG: f64 = 10.0;
/// Sectors of the plane.
const N_SECTORS: usize = 8;
/// Below this bend, rad, noise decides the sector.
const SECTOR_FROM_BEND_RAD: f64 = 5.0 * RAD;
/// Equal slices of the whole time.
const N_SLICES: usize = 10;
/// More trials than this are told together in groups.
const MOST_TRIALS: usize = 20;

/// Every way in which these rows can be sorted.
pub(super) fn dimensions<'a>(
    machine: &dyn MachineUnderTest,
    data: &'a Measurements,
    scored: &'a [usize],
) -> Vec<Dimension<'a>> {
    let motions: Rc<[Motion]> = motion::all(data).into();
    let is_snake = data.quantity == Quantity::Snake;
    let mut found = match data.quantity {
        Quantity::Snake => {
            let unit_free = [bend(data, 0, scored), plane(data, 0), direction(&motions)];
            unit_free.into_iter().collect()
        }
        Quantity::Segments => segments(data, scored, &motions),
        Quantity::Joints | Quantity::Force => joints(machine, data),
    };
    found.push(speed(machine, data, scored, &motions));
    found.push(time(&motions));
    found.push(rest(&motions));
    if let Some(loads) = &data.loads_n {
        let n = data.n_inputs;
        let largest = move |row: usize| {
            loads.get(n * row..n * (row + 1)).map_or(f64::NAN, |l| l.iter().fold(0.0, |a, b| b.abs().max(a)))
        };
        found.push(quarters("load", "N", scored, largest));
    }
    let column = |values: &'a [f64], scale: f64| move |row: usize| values.get(row).map_or(f64::NAN, |v| v * scale);
    if let Some(angles) = &data.stem_angle_rad {
        found.push(quarters("stem angle", "deg", scored, column(angles, RAD.recip())));
    }
    if let Some(temperatures) = &data.temperature_c {
        found.push(quarters("temperature", "deg C", scored, column(temperatures, 1.0)));
    }
    found.extend(trial(data));
    found.iter_mut().for_each(|dimension| dimension.has_mean |= is_snake || data.n_outputs == 1);
    found
}

fn dimension<'a>(by: &str, labels: Vec<String>, place: impl Fn(usize) -> Option<usize> + 'a) -> Dimension<'a> {
    Dimension { by: by.to_owned(), labels, place: Box::new(place), part: Part::Whole, has_mean: false }
}

/// Each segment's error by its own bend and plane, and the whole error by the direction of motion.
fn segments<'a>(data: &'a Measurements, scored: &[usize], motions: &Rc<[Motion]>) -> Vec<Dimension<'a>> {
    let of_one = |segment: usize| {
        let own = |dimension: Dimension<'a>| Dimension {
            by: format!("{} of segment {}", dimension.by, segment + 1),
            part: Part::Segment(segment),
            has_mean: true,
            ..dimension
        };
        [own(bend(data, segment, scored)), own(plane(data, segment))]
    };
    (0..data.n_outputs / 2).flat_map(of_one).chain([direction(motions)]).collect()
}

fn bend<'a>(data: &'a Measurements, segment: usize, scored: &[usize]) -> Dimension<'a> {
    let bend_deg = move |row: usize| {
        let [x, y] = pair(&data.output(row)[2 * segment..]);
        x.hypot(y) / RAD
    };
    let largest = scored.iter().map(|&row| bend_deg(row)).fold(0.0, f64::max);
    let label = |k: usize| format!("{}-{} deg", k * 10, k * 10 + 10);
    let labels = (0..=(largest / BEND_STEP_DEG) as usize).map(label).collect();
    dimension("bend", labels, move |row| Some((bend_deg(row) / BEND_STEP_DEG) as usize))
}

fn plane(data: &Measurements, segment: usize) -> Dimension<'_> {
    let step = 360.0 / N_SECTORS as f64;
    let label = |k: usize| {
        let middle = k as f64 * step;
        let middle = if middle > 180.0 { middle - 360.0 } else { middle };
        format!("{middle:.0} deg")
    };
    dimension("plane", (0..N_SECTORS).map(label).collect(), move |row| {
        let [x, y] = pair(&data.output(row)[2 * segment..]);
        let turn = y.atan2(x) / RAD / step;
        (x.hypot(y) >= SECTOR_FROM_BEND_RAD).then(|| turn.round().rem_euclid(N_SECTORS as f64) as usize % N_SECTORS)
    })
}

fn direction<'a>(motions: &Rc<[Motion]>) -> Dimension<'a> {
    let labels = ["loading", "unloading", "turning", "at rest"].map(str::to_owned).to_vec();
    let motions = Rc::clone(motions);
    dimension("direction", labels, move |row| {
        let motion = motions.get(row)?;
        Some(match (motion.is_moving, motion.outward) {
            (false, _) => 3,
            (true, 1) => 0,
            (true, -1) => 1,
            (true, _) => 2,
        })
    })
}

fn speed<'a>(
    machine: &dyn MachineUnderTest,
    data: &'a Measurements,
    scored: &[usize],
    motions: &Rc<[Motion]>,
) -> Dimension<'a> {
    // Three lines that bend a snake at a rate move together sqrt(3/2) times as fast as one of them at most.
    let of_one = if data.quantity == Quantity::Snake { (2.0_f64 / 3.0).sqrt() } else { 1.0 };
    let (unit, scale) = shown(machine.input_unit());
    let motions = Rc::clone(motions);
    let value = move |row: usize| match motions.get(row) {
        Some(motion) if motion.is_moving => motion.speed * of_one * scale,
        _ => f64::NAN,
    };
    quarters("speed", &format!("{unit}/s"), scored, value)
}

fn time<'a>(motions: &Rc<[Motion]>) -> Dimension<'a> {
    let motions = Rc::clone(motions);
    let slice_s = (motions.last().map_or(0.0, |m| m.elapsed_s) / N_SLICES as f64).max(f64::MIN_POSITIVE);
    let label = |k: usize| format!("{:.0}-{:.0} s", k as f64 * slice_s, (k + 1) as f64 * slice_s);
    dimension("time", (0..N_SLICES).map(label).collect(), move |row| {
        motions.get(row).map(|m| ((m.elapsed_s / slice_s) as usize).min(N_SLICES - 1))
    })
}

fn rest<'a>(motions: &Rc<[Motion]>) -> Dimension<'a> {
    let labels = ["moving", "0-1 s at rest", "1-5 s at rest", "5-20 s at rest", "over 20 s at rest"];
    let motions = Rc::clone(motions);
    dimension("rest", labels.map(str::to_owned).to_vec(), move |row| {
        let motion = motions.get(row)?;
        let is_past = |limit_s: &&f64| motion.rest_s >= **limit_s;
        Some(if motion.is_moving { 0 } else { 1 + [1.0, 5.0, 20.0].iter().filter(is_past).count() })
    })
}

fn trial(data: &Measurements) -> Option<Dimension<'_>> {
    let n_trials = data.trial.last().map_or(0, |last| *last as usize + 1);
    let group = n_trials.div_ceil(MOST_TRIALS);
    let label = |k: usize| match (k * group + 1, ((k + 1) * group).min(n_trials)) {
        (first, last) if first == last => format!("trial {first}"),
        (first, last) => format!("trials {first}-{last}"),
    };
    let place = move |row: usize| data.trial.get(row).map(|trial| *trial as usize / group);
    (n_trials > 1).then(|| dimension("trial", (0..n_trials.div_ceil(group)).map(label).collect(), place))
}

/// Each joint's error by its own position and by the direction of its own motion.
fn joints<'a>(machine: &dyn MachineUnderTest, data: &'a Measurements) -> Vec<Dimension<'a>> {
    let (unit, scale) = shown(machine.input_unit());
    let mut found = Vec::new();
    for k in 0..data.n_inputs {
        let value = move |row: usize| data.input(row).get(k).map_or(f64::NAN, |u| u * scale);
        let all = (0..data.n_rows()).map(value);
        let (low, high) = bounds(all);
        let edges: Vec<f64> = (0..=6).map(|i| low + (high - low) * f64::from(i) / 6.0).collect();
        let position = between(&data.names.input(k), &unit, edges, value);
        let rising = rising(data, k);
        let labels = ["rising", "falling"].map(str::to_owned).to_vec();
        let direction =
            dimension(&format!("direction of {}", data.names.input(k)), labels, move |row| *rising.get(row)?);
        found.extend([position, direction].map(|d| Dimension { part: Part::Output(k), has_mean: true, ..d }));
    }
    found
}

/// Bin of each row by the last change of an input: 0 rising, 1 falling.
fn rising(data: &Measurements, input: usize) -> Vec<Option<usize>> {
    let mut last = None;
    let value = |row: usize| data.input(row)[input];
    let mut bins = Vec::with_capacity(data.n_rows());
    for row in 0..data.n_rows() {
        let step = if data.starts_trial(row) { f64::NAN } else { value(row) - value(row - 1) };
        last = match step {
            _ if step > 0.0 => Some(0),
            _ if step < 0.0 => Some(1),
            _ if step.is_nan() => None,
            _ => last,
        };
        bins.push(last);
    }
    bins
}

/// Four bins with equally many rows each.
fn quarters<'a>(by: &str, unit: &str, scored: &[usize], value: impl Fn(usize) -> f64 + 'a) -> Dimension<'a> {
    // The edges are for people to read; a thousand values place them well enough.
    let stride = (scored.len() / 1000).max(1);
    let mut sample: Vec<f64> = scored.iter().step_by(stride).map(|&row| value(row)).filter(|v| v.is_finite()).collect();
    sample.sort_by(f64::total_cmp);
    let quantile = |k: usize| sample.get((sample.len().saturating_sub(1)) * k / 4).copied();
    let edges: Vec<f64> = (0..=4).filter_map(quantile).collect();
    between(by, unit, edges, value)
}

/// Bins between edges; the first and the last reach to infinity.
fn between<'a>(by: &str, unit: &str, mut edges: Vec<f64>, value: impl Fn(usize) -> f64 + 'a) -> Dimension<'a> {
    edges.dedup();
    if edges.len() < 2 {
        return dimension(by, Vec::new(), |_| None);
    }
    let labels = edges.windows(2).map(|edge| format!("{}-{} {unit}", short(edge[0]), short(edge[1]))).collect();
    dimension(by, labels, move |row| {
        let value = value(row);
        let inner = edges.get(1..edges.len() - 1).unwrap_or_default();
        value.is_finite().then(|| inner.iter().filter(|edge| value >= **edge).count())
    })
}

/// The unit that people read, and how many of it there are to one of these.
fn shown(unit: &str) -> (String, f64) {
    match unit {
        "m" => ("mm".to_owned(), 1e3),
        "rad" => ("deg".to_owned(), RAD.recip()),
        other => (other.to_owned(), 1.0),
    }
}

/// A number with three digits.
fn short(value: f64) -> String {
    let digits = match value.abs() {
        size if size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    format!("{value:.digits$}")
}
