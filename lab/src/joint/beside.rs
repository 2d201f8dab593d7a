//! Columns beside commands and measurements: which of them may act on a joint, and what they do to the numbers of its effects.
//!
//! A play that grows with the angle of a sheath, a friction that falls with warmth: the list of effects is right, one of their numbers
//! is not one number. Where a column says so on blocks of time that the fit did not see, it is said, with its size. Recordings are
//! columns too: in one of them a number may be another one, whatever the reason.

use super::decide::{is_in_chain, problem};
use super::gate::{Blocks, HeldOut, gate, held_out, in_errors};
use super::kind::Kind;
use super::refine::{Fit, polish, refine};
use super::search::{Search, n_effective};
use super::signal::{Column, Signal};
use super::simulate::{Member, Varies};
use super::terms::{self, Value};
use crate::Measurements;
use crate::fit::dot;
use crate::machine::JointsLab;
use crate::noise::bounds;
use rayon::prelude::*;
use std::sync::Arc;

/// Columns that are looked at.
const MOST_COLUMNS: usize = 12;
/// A column that is this much of what was measured, and less of what was commanded, repeats the measurement: it explains nothing.
const REPEATS: f64 = 0.98;
/// What a number that depends on a column takes away of what is left without, at least, ...
const LEAST: f64 = 0.1;
/// ... beyond so many standard errors over blocks: many are tried.
const ERRORS: f64 = 3.5;
/// One that takes so much away is part of the answer, and not only beside it.
const MUCH: f64 = 0.5;

/// A number of an effect that depends on a column, or is another one in a recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variation {
    pub kind: Kind,
    /// The number's name in model files.
    pub parameter: &'static str,
    /// The column; `None` for a recording.
    pub column: Option<String>,
    /// The recording, from 0.
    pub recording: Option<usize>,
    /// The number at the column's lowest and highest value; of a recording in the others and in it.
    pub values: [f64; 2],
    /// These two values of the column.
    pub at: [f64; 2],
    /// The slope, the number's unit for one of the column's, and its standard error.
    pub slope: (f64, f64),
    /// Mean squares on blocks that the fit did not see, without and with it.
    pub mean_squares: [f64; 2],
    /// Whether it stands in the list.
    pub is_in_list: bool,
}

/// The columns that may act on a joint.
pub(super) fn columns(data: &Measurements, joint: usize) -> Vec<Column> {
    let own = |k: usize, values: &[f64], n: usize| -> Vec<f64> { values.iter().skip(k).step_by(n).copied().collect() };
    let measured = own(joint, &data.outputs, data.n_outputs);
    let command = own(joint, &data.inputs, data.n_inputs);
    let one = |name: &str| {
        let column = column(name, data.beside(name)?)?;
        let [to_measured, to_command] = [&measured, &command].map(|other| likeness(&column.values, other, &measured));
        (to_measured < REPEATS || to_measured <= to_command).then_some(column)
    };
    data.names_beside().filter_map(one).take(MOST_COLUMNS).collect()
}

/// A column from its middle in halves of its range, each gap as the row before; `None` for one that stands still or is mostly gaps.
fn column(name: &str, values: &[f64]) -> Option<Column> {
    let n_known = values.iter().filter(|value| value.is_finite()).count();
    let (low, high) = bounds(values.iter().copied().filter(|value| value.is_finite()));
    if 2 * n_known < values.len() || high - low <= 1e-9 * high.abs().max(low.abs()) {
        return None;
    }
    let middle = rounded(0.5 * (low + high), high - low);
    let half = (high - middle).max(middle - low);
    let mut last = 0.0;
    let scaled = values.iter().map(|value| {
        if value.is_finite() {
            last = (value - middle) / half;
        }
        last
    });
    Some(Column { name: name.to_owned(), values: Arc::new(scaled.collect()), middle, half })
}

/// A number with as many digits as a range deserves.
fn rounded(value: f64, range: f64) -> f64 {
    let digits = (2.0 - range.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.digits$}").parse().unwrap_or(value)
}

/// Squared correlation of two columns over the rows that were measured.
fn likeness(a: &[f64], b: &[f64], measured: &[f64]) -> f64 {
    let rows: Vec<usize> = (0..a.len()).filter(|&row| measured[row].is_finite() && b[row].is_finite()).collect();
    let centred = |values: &[f64]| -> Vec<f64> {
        let mean = rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len().max(1) as f64;
        rows.iter().map(|&row| values[row] - mean).collect()
    };
    let (a, b) = (centred(a), centred(b));
    dot(&a, &b).powi(2) / (dot(&a, &a) * dot(&b, &b)).max(1e-300)
}

/// Two signals of one joint, of which the second has more rows, with the columns that both have.
pub(super) fn with_common_columns(some: &mut Signal, mut all: Signal) -> Signal {
    all.columns.retain(|own| some.columns.iter().any(|other| other.name == own.name));
    some.columns.retain(|own| all.columns.iter().any(|other| other.name == own.name));
    all
}

/// The number of an effect, by its name, that may depend on a column: what its value or its amplitude is called in model files.
pub(crate) fn varying_number_of(effect: &str) -> Option<&'static str> {
    match effect {
        "backlash" | "dead-zone" => Some("half_width"),
        "saturation" => Some("limit"),
        "first-order-lag" => Some("time_s"),
        "bouc-wen" | "periodic-error" => Some("amplitude"),
        "load-friction" => Some("share"),
        "creep" => Some("a1"),
        "quadratic" => Some("quadratic"),
        "cubic" => Some("cubic"),
        "cross-coupling" => Some("k"),
        _ => None,
    }
}

/// The same of a kind; a curve of two terms has no one number.
pub(super) fn varying_number(kind: Kind) -> Option<&'static str> {
    if kind == Kind::Curve { None } else { varying_number_of(kind.name()) }
}

/// The middle of a column, where a number that depends on it has its value; `None` for a column that stands still or is not there.
pub(crate) fn middle(data: &Measurements, name: &str) -> Option<f64> {
    column(name, data.beside(name)?).map(|own| own.middle)
}

/// The list with its number that depends most on a column, and what else depends on one or is another one in a recording.
pub(super) fn varied(
    search: &Search,
    fit: Fit,
    after: HeldOut,
    (machine, data): (&JointsLab, &Measurements),
) -> (Fit, HeldOut, Vec<Variation>) {
    let signal = search.signal;
    let (mut fit, mut after, mut all) = (fit, after, Vec::new());
    if fit.members.is_empty() || signal.columns.is_empty() && signal.n_recordings < 2 {
        return (fit, after, all);
    }
    let blocks = Blocks::new(signal, n_effective(&fit));
    let of = |signal: &Signal, fit: &Fit, place: usize, squares: [f64; 2]| {
        let problem = problem(machine, data, signal, n_effective(fit));
        variation(signal, fit, place, &terms::values(signal, fit, &problem).members, squares)
    };
    if let Some((better, held, place, squares)) = best(search, &fit, &blocks) {
        let mut found = of(signal, &better, place, squares);
        found.is_in_list = squares[1] < MUCH * squares[0] && is_in_chain(&better.members[place]);
        if found.is_in_list {
            (fit, after) = gate(search, &better, &blocks);
            // What pays beside a number that depends on its column; the effect itself stays.
            if !fit.members.iter().any(|own| own.kind == found.kind) {
                (fit, after) = (better, held);
            }
        }
        all.push(found);
    }
    if (2..=MOST_COLUMNS).contains(&signal.n_recordings) {
        let by_recording = Signal { columns: indicators(signal), ..signal.clone() };
        let steady = fit.members.iter().all(|own| own.varies.is_none());
        let other = Search::new(&by_recording, search.loss, search.candidates.clone());
        if let Some((better, _, place, squares)) = steady.then(|| best(&other, &fit, &blocks)).flatten() {
            all.push(of(&by_recording, &better, place, squares));
        }
    }
    (fit, after, all)
}

/// Each recording as a column, 1 there and -1 in the others; of two, one says it.
fn indicators(signal: &Signal) -> Vec<Column> {
    let n = if signal.n_recordings == 2 { 1 } else { signal.n_recordings };
    let values = |k: usize| (0..signal.n()).map(|row| if signal.recording(row) == k { 1.0 } else { -1.0 }).collect();
    let first = signal.n_recordings - n;
    (first..signal.n_recordings)
        .map(|k| Column { name: String::new(), values: Arc::new(values(k)), middle: 0.0, half: 1.0 })
        .collect()
}

/// The fit with the number that depends most on a column, its place, and the held-out mean squares without and with it; `None` where
/// none pays.
fn best(search: &Search, fit: &Fit, blocks: &Blocks) -> Option<(Fit, HeldOut, usize, [f64; 2])> {
    let signal = search.signal;
    let starts = starts(search, fit);
    let tried: Vec<(&Fit, usize, usize)> =
        starts.iter().flat_map(|(start, i)| (0..signal.columns.len()).map(move |column| (start, *i, column))).collect();
    let fits = tried.par_iter().map(|&(start, i, column)| {
        let mut members: Vec<Member> = start.members.clone();
        members[i].varies = Some(Varies { column, slope: 0.0 });
        (refine(signal, &members, search.loss, 8, 1e-5, true), i)
    });
    let (better, place) = fits.collect::<Vec<_>>().into_iter().min_by(|a, b| a.0.square().total_cmp(&b.0.square()))?;
    if better.square() > (1.0 - LEAST) * fit.square() {
        return None;
    }
    let better = settle(search, better);
    let [without, with] = [fit, &better].map(|own| held_out(signal, own, search.loss, blocks, 3));
    let pays = in_errors(&without.blocks, &with.blocks) > ERRORS
        && with.mean_square < (1.0 - LEAST) * without.mean_square
        && !better.imitates(signal);
    let squares = [without.mean_square, with.mean_square];
    pays.then_some((better, with, place, squares))
}

/// Lists with the place of a number that may depend on a column: the fit's own, and with another law of the same class in a member's
/// place. A play of many widths looks like a smooth hysteresis until its width may follow the column.
fn starts(search: &Search, fit: &Fit) -> Vec<(Fit, usize)> {
    let may = |own: &Member| own.varies.is_none() && varying_number(own.kind).is_some();
    let mut all = Vec::new();
    for (i, member) in fit.members.iter().enumerate().filter(|(_, own)| is_in_chain(own)) {
        all.extend(may(member).then(|| (fit.clone(), i)));
        let same_class = |kind: &Kind| kind.class() == member.kind.class() && *kind != member.kind;
        let others =
            search.candidates.iter().copied().filter(|kind| same_class(kind) && varying_number(*kind).is_some());
        let rest = search.part(fit, |kind| kind != member.kind, 6);
        for kind in others {
            let Some(other) = search.extend(&rest, kind) else { continue };
            let place = other.members.iter().position(|own| own.kind == kind);
            all.extend(place.map(|place| (other, place)));
        }
    }
    all
}

/// A fit taken past the corners that a play has in its loss, over which the steps of the method do not see.
pub(super) fn settle(search: &Search, fit: Fit) -> Fit {
    let over = polish(search.signal, fit, search.loss);
    refine(search.signal, &over.members, search.loss, 8, 1e-7, true)
}

fn variation(signal: &Signal, fit: &Fit, place: usize, values: &[Vec<Value>], mean_squares: [f64; 2]) -> Variation {
    let member = &fit.members[place];
    let Varies { column, slope } = member.varies.unwrap_or(Varies { column: 0, slope: 0.0 });
    let own = &signal.columns[column];
    let parameter = varying_number(member.kind).unwrap_or_default();
    let find = |name: &str| values[place].iter().find(|value| value.name == name);
    let middle = find(parameter).map_or(0.0, |value| value.value);
    let (low, high) = bounds(signal.rows.iter().map(|&row| own.values[row]));
    let is_recording = own.name.is_empty();
    Variation {
        kind: member.kind,
        parameter,
        column: (!is_recording).then(|| own.name.clone()),
        recording: is_recording.then_some(if signal.n_recordings == 2 { 1 } else { column }),
        values: [low, high].map(|z| middle * (1.0 + slope * z)),
        at: [low, high].map(|z| own.middle + own.half * z),
        slope: find(krait_model::effects::SLOPE).map_or((0.0, 0.0), |value| (value.value, value.se)),
        mean_squares,
        is_in_list: false,
    }
}
