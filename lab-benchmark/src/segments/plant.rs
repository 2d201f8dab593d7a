//! Simulated segments under hidden effects along a path of encoder readings, and what a camera without noise would see of them.

use super::SegmentsRecipe;
use super::base::{azimuths_deg, parameters};
use crate::generate::{GenerateError, apart_rad};
use core::f64::consts::TAU;
use krait_model::segments::{Bends, MAX_SEGMENTS, SegmentChain};
use krait_sim::{SegmentEffectsTruth, SegmentTruth, SegmentsTruth, SimulatedSegments, TruthError};

/// The bend vectors of one segment, row after row, rad.
pub(super) type OfSegment = Vec<[f64; 2]>;

/// The machine and how it is seen.
#[derive(Clone, Debug)]
pub(super) struct Plant {
    pub truth: SegmentsTruth,
    sight: [Sight; MAX_SEGMENTS],
    /// Segment 2 is moved in x by this times the square of what segment 1 bends beyond 0.1 rad to one side.
    pub push_per_rad: f64,
    /// Every segment is moved by this, to and fro.
    pub sway_rad: [f64; 2],
    pub sway_hz: f64,
    /// Segment 1 is moved by this from then on.
    pub shift_rad: [f64; 2],
    pub shift_from_s: f64,
    /// What is seen is the machine of so long ago.
    pub delay_s: f64,
}

/// What camera and load cells without noise measure.
pub(super) struct Measured {
    /// Of each segment, one after the other.
    pub seen_rad: Vec<OfSegment>,
    /// Loads at the actuators, N, push positive, row after row of all lines.
    pub load_n: Vec<f64>,
}

/// How the camera sees one segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub scale: f64,
    pub offset_rad: [f64; 2],
}

impl Plant {
    /// Nothing is hidden.
    pub(super) fn bare(recipe: &SegmentsRecipe) -> Self {
        let segment = |k: usize| SegmentTruth {
            azimuths_rad: azimuths_deg(k).map(f64::to_radians).to_vec(),
            ..SegmentTruth::default()
        };
        let ideal = SegmentsTruth::ideal((0..recipe.n_segments).map(segment).collect());
        let effects = if recipe.is_ideal() { ideal.effects } else { SegmentEffectsTruth::default() };
        Self {
            truth: SegmentsTruth { effects, ..ideal },
            sight: [Sight { scale: 1.0, offset_rad: [0.0; 2] }; MAX_SEGMENTS],
            push_per_rad: 0.0,
            sway_rad: [0.0; 2],
            sway_hz: 0.0,
            shift_rad: [0.0; 2],
            shift_from_s: 0.0,
            delay_s: 0.0,
        }
    }

    /// Changes what one segment has, or all of them.
    pub(super) fn change(&mut self, segment: Option<usize>, change: impl Fn(&mut SegmentEffectsTruth)) {
        let all = self.truth.effects;
        match segment {
            Some(k) => {
                if let Some(own) = self.truth.segment.get_mut(k) {
                    change(own.effects.get_or_insert(all));
                }
            }
            None => {
                change(&mut self.truth.effects);
                self.truth.segment.iter_mut().filter_map(|own| own.effects.as_mut()).for_each(change);
            }
        }
    }

    /// Changes how the camera sees a segment.
    pub(super) fn see(&mut self, segment: Option<usize>, change: impl Fn(&mut Sight)) {
        self.sight.get_mut(segment.unwrap_or(0)).into_iter().for_each(change);
    }

    /// What is seen of each segment, one after the other.
    pub(super) fn seen_rad(&self, readings_m: &[f64], period_s: f64) -> Result<Vec<OfSegment>, GenerateError> {
        Ok(self.measured(readings_m, period_s)?.seen_rad)
    }

    /// What is seen, and the loads at the actuators.
    pub(super) fn measured(&self, readings_m: &[f64], period_s: f64) -> Result<Measured, GenerateError> {
        let refused =
            |source| GenerateError::Truth(TruthError::Segments { file: "the hidden effect".to_owned(), source });
        let mut segments = SimulatedSegments::new(&self.truth).map_err(refused)?;
        let n_lines = segments.n_lines();
        let mut seen = vec![OfSegment::with_capacity(readings_m.len() / n_lines); segments.n_segments()];
        let mut load_n = Vec::with_capacity(readings_m.len());
        for (row, q_m) in readings_m.chunks_exact(n_lines).enumerate() {
            segments.move_to(q_m);
            load_n.extend(segments.actuator_loads_n());
            let time_s = row as f64 * period_s;
            let first = segments.bend_rad(0);
            for (k, seen) in seen.iter_mut().enumerate() {
                seen.push(self.shown_rad(k, segments.bend_rad(k), first, time_s));
            }
        }
        if segments.n_unsolved() > 0 {
            return Err(GenerateError::Unsolved { n: segments.n_unsolved() });
        }
        Ok(Measured { seen_rad: seen.into_iter().map(|own| late(own, self.delay_s / period_s)).collect(), load_n })
    }

    fn shown_rad(&self, segment: usize, bend_rad: [f64; 2], first_rad: [f64; 2], time_s: f64) -> [f64; 2] {
        let sight = self.sight[segment.min(MAX_SEGMENTS - 1)];
        let pushed = if segment == 1 { self.push_per_rad * (first_rad[0] - 0.1).max(0.0).powi(2) } else { 0.0 };
        let is_shifted = segment == 0 && time_s >= self.shift_from_s;
        let sway = (TAU * self.sway_hz * time_s).sin();
        core::array::from_fn(|k| {
            let moved = if k == 0 { pushed } else { 0.0 } + if is_shifted { self.shift_rad[k] } else { 0.0 };
            sight.scale * bend_rad[k] + sight.offset_rad[k] + moved + sway * self.sway_rad[k]
        })
    }
}

/// The same so many rows later, straight between rows; the first row before it.
fn late(seen_rad: OfSegment, rows: f64) -> OfSegment {
    if rows == 0.0 {
        return seen_rad;
    }
    let at = |row: usize| {
        let then = (row as f64 - rows).max(0.0);
        let (before, part) = (then as usize, then.fract());
        let after = (before + 1).min(seen_rad.len() - 1);
        core::array::from_fn(|k| seen_rad[before][k] * (1.0 - part) + seen_rad[after][k] * part)
    };
    (0..seen_rad.len()).map(at).collect()
}

/// Encoder readings, m, row after row, that bring elastic segments to these bends.
pub(super) fn planned_m(path_rad: &[OfSegment]) -> Result<Vec<f64>, GenerateError> {
    let mut compensator = SegmentChain::new(&parameters(path_rad.len()), &[])?.compensator();
    let n_lines = (0..path_rad.len()).map(|k| azimuths_deg(k).len()).sum();
    let n_rows = path_rad.first().map_or(0, Vec::len);
    let mut readings_m = Vec::with_capacity(n_rows * n_lines);
    for row in 0..n_rows {
        let mut bends_rad = Bends::zeros();
        let wanted = path_rad.iter().filter_map(|own| own.get(row)).flatten();
        bends_rad.iter_mut().zip(wanted).for_each(|(own, wanted)| *own = *wanted);
        readings_m.extend(compensator.step(&bends_rad).q_tilde_m.iter().take(n_lines));
    }
    Ok(readings_m)
}

/// Root mean square length of the difference over all segments, rad.
pub(super) fn all_apart_rad(a: &[OfSegment], b: &[OfSegment]) -> f64 {
    a.iter().zip(b).map(|(a, b)| apart_rad(a, b).powi(2)).sum::<f64>().sqrt()
}
