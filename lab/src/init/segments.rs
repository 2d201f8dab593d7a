//! Lengths numbered in a row and the bends of two or three segments, each in two components: snakes in series on their lines.

use super::joints::Checked;
use super::role::Guess;
use super::snake::{angle, length, lines, loads, numbered};
use super::{Assigned, Column};
use crate::Measurements;
use crate::machine::{MachineUnderTest, SegmentsLab};
use crate::read::Dimension;
use krait_model::model_file::ModelFile;
use std::collections::BTreeMap;

/// Segments that are several, and lines that they can have.
const SEGMENTS: core::ops::RangeInclusive<usize> = 2..=3;
const MOST_LINES: usize = 12;
/// Share of a segment's bend below which the proposed model does not follow it.
const FOLLOWS: f64 = 0.5;
/// What a bend is called, and its plane.
const BEND: [&str; 2] = ["bend", "theta"];
const PLANE: [&str; 2] = ["plane", "delta"];

/// Columns of the machine.
pub(super) struct Found {
    pub columns: Vec<Assigned>,
    pub n_segments: usize,
    pub n_lines: usize,
    /// What was guessed, a sentence each.
    pub cautions: Vec<String>,
}

/// Finds them by name and unit; none if the file is of no segments.
///
/// # Errors
/// A reason: they are segments', but not as the lab reads them.
pub(super) fn find(columns: &[Column]) -> Result<Option<Found>, String> {
    let pairs = in_two_axes(columns);
    let Some(bends) = pairs.clone().or_else(|| in_a_row(columns)) else {
        return polar(columns).map_or(Ok(None), Err);
    };
    let n_segments = bends.len() / 2;
    // As many lengths as angles in a row are joints rather, each with its command.
    let fewest = if pairs.is_some() { bends.len() } else { bends.len() + 1 };
    let Some(lines) = lines(columns, |n| n >= fewest) else {
        let names = || bends.iter().filter_map(|place| columns.get(*place)).map(|own| format!("{:?}", own.name()));
        return pairs.map_or(Ok(None), |_| {
            Err(format!(
                "{} are bends of {n_segments} segments, but no lengths of their lines are numbered in a row, expected {} to {MOST_LINES} of them; \
                 add them, or name them, such as --map u1_m=NAME:mm --map y1_rad=NAME:deg, all of both",
                names().collect::<Vec<_>>().join(", "),
                bends.len()
            ))
        });
    };
    let n_lines = lines.len();
    if n_lines > MOST_LINES || n_lines % n_segments != 0 {
        return Err(format!(
            "{n_lines} lines beside the bends of {n_segments} segments, expected as many for each and {MOST_LINES} at most: which one ends where \
             is not in the data; write the model file by hand (docs/segments.md)"
        ));
    }
    let mut cautions = Vec::new();
    let mut assigned = Vec::with_capacity(n_lines + bends.len());
    for (k, &place) in lines.iter().enumerate() {
        let unit = length(columns, &lines, place, &mut cautions);
        assigned.push((format!("u{}_m", k + 1), place, unit, format!("of {n_lines} lengths")));
    }
    for (k, &place) in bends.iter().enumerate() {
        let unit = angle(columns, place, &mut cautions);
        let (segment, axis) = (k / 2 + 1, if k % 2 == 0 { "x" } else { "y" });
        assigned.push((format!("y{}_rad", k + 1), place, unit, format!("bend {segment} in {axis}")));
    }
    let loads = loads(columns, n_lines, &format!("of {n_lines} loads"));
    assigned.extend(loads.into_iter().map(|(target, place, unit, why)| (target, place, Some(unit), why)));
    cautions.push(format!(
        "where each line ends, its angle and every dimension are not in the data: the model has the first {} lines end at segment 1 and so on, \
         evenly spaced, with the paper's dimensions; put in your machine's before you trust a diagnosis",
        n_lines / n_segments
    ));
    Ok(Some(Found { columns: assigned, n_segments, n_lines, cautions }))
}

/// A position that was measured, as far as its name tells.
fn is_seen(column: &Column) -> bool {
    matches!(column.guess, Guess::Measured(_) | Guess::Unclear)
}

fn is_angle(column: &Column) -> bool {
    match column.words.unit.dimension() {
        Some(dimension) => dimension == Dimension::Angle,
        None => BEND.iter().chain(&["segment", "seg"]).any(|word| column.words.has(word)),
    }
}

/// Angles in x and y with the numbers of two or three segments: `bend1_x_rad`, `seg2.y`; x and y of each in turn.
fn in_two_axes(columns: &[Column]) -> Option<Vec<usize>> {
    let mut families: BTreeMap<Vec<String>, BTreeMap<u32, [Option<usize>; 2]>> = BTreeMap::new();
    for (place, column) in columns.iter().enumerate().filter(|(_, column)| is_seen(column) && is_angle(column)) {
        for (axis, word) in ["x", "y"].into_iter().enumerate() {
            let Some(at) = column.words.words.iter().position(|own| own == word) else { continue };
            let mut rest = column.words.clone();
            rest.words.remove(at);
            if let Some((number, others)) = rest.numbered() {
                let stem = others.into_iter().map(str::to_owned).collect();
                families.entry(stem).or_default().entry(number).or_default()[axis] = Some(place);
            }
        }
    }
    let whole = |family: BTreeMap<u32, [Option<usize>; 2]>| {
        let numbers: Vec<u32> = family.keys().copied().collect();
        let is_row = numbers.windows(2).all(|pair| pair[1] == pair[0] + 1);
        let places: Option<Vec<usize>> = family.into_values().flatten().collect();
        places.filter(|places| is_row && SEGMENTS.contains(&(places.len() / 2)))
    };
    families.into_values().find_map(whole)
}

/// Four or six measured angles with numbers in a row, as `krait export` writes them: `y1_rad`.
fn in_a_row(columns: &[Column]) -> Option<Vec<usize>> {
    let is_one = |column: &Column| {
        let is_known = column.words.unit.dimension() == Some(Dimension::Angle);
        matches!(column.guess, Guess::Measured(_)) && is_known && column.looked.moves()
    };
    let of_pairs = |row: &Vec<usize>| row.len().is_multiple_of(2) && SEGMENTS.contains(&(row.len() / 2));
    numbered(columns, is_one).into_iter().find(of_pairs)
}

/// What to do with bends and planes of several segments.
fn polar(columns: &[Column]) -> Option<String> {
    let row = |words: &[&str]| {
        let is_one = |column: &Column| is_seen(column) && words.iter().any(|word| column.words.has(word));
        numbered(columns, is_one).into_iter().find(|row| SEGMENTS.contains(&row.len()))
    };
    let (bends, planes) = (row(&BEND)?, row(&PLANE)?);
    lines(columns, |n| n >= 2 * bends.len())?;
    let name = |places: &[usize]| places.first().and_then(|place| columns.get(*place)).map(Column::name);
    let (bend, plane) = (name(&bends)?, name(&planes)?);
    (bends.len() == planes.len()).then(|| {
        format!(
            "{bend:?} and {plane:?} are a bend and its plane, expected two components of each segment's bend vector; write y1_rad as the bend \
             times the cosine of its plane and y2_rad as the bend times the sine, y3_rad and y4_rad of segment 2, and so on"
        )
    })
}

/// A model file in which as many lines end at each segment.
pub(super) fn model(n_segments: usize, n_lines: usize) -> String {
    let n_own = n_lines / n_segments;
    // Two lines opposite each other would lie in one plane with the backbone.
    let step_deg = if n_own == 2 { 90.0 } else { 360.0 / n_own as f64 };
    let segment = |k: usize| {
        let first_deg = k as f64 * 360.0 / n_lines as f64;
        let azimuths: Vec<String> = (0..n_own).map(|i| format!("{:.4}", first_deg + i as f64 * step_deg)).collect();
        format!("\n[[machine.segment]]\nazimuth_deg = [{}]\n", azimuths.join(", "))
    };
    format!(
        "# Proposed by `krait lab init`. Where lines end, their angles and all dimensions are guesses: put in your machine's,\n\
         # docs/segments.md has every key. It has no effect yet.\n\
         format = 1\n\n[machine]\nkind = \"segments\"\n{}",
        (0..n_segments).map(segment).collect::<String>()
    )
}

/// How the proposed model follows the bend of each segment; nothing of other machines.
pub(super) fn follow(file: &ModelFile, data: &Measurements) -> Checked {
    let mut checked = Checked::default();
    let predicted = SegmentsLab::new(file).and_then(|machine| machine.predict(&[], data).ok());
    let Some(predicted) = predicted else { return checked };
    let mut loose = Vec::new();
    for segment in 0..data.n_outputs / 2 {
        let both = [2 * segment, 2 * segment + 1];
        let rows = || (0..data.n_rows()).filter(|row| data.is_scored(*row));
        let n = rows().count() as f64;
        let (mut left, mut all) = (0.0, 0.0);
        for k in both {
            let mean = rows().map(|row| data.output(row)[k]).sum::<f64>() / n;
            for row in rows() {
                let seen = data.output(row)[k];
                left += (seen - predicted[row * data.n_outputs + k]).powi(2);
                all += (seen - mean).powi(2);
            }
        }
        if all > 0.0 {
            let share = (1.0 - left / all).max(0.0);
            checked.pairs.push(format!(
                "segment {}: {:.0} % of its bend is what the lines make of the proposed model",
                segment + 1,
                100.0 * share
            ));
            if share < FOLLOWS {
                loose.push((segment + 1).to_string());
            }
        }
    }
    if !loose.is_empty() {
        checked.cautions.push(format!(
            "the proposed model explains less than half of the bend of segment {}: are lines, angles and dimensions your machine's?",
            loose.join(", ")
        ));
    }
    checked
}
