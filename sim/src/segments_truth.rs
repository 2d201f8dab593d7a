//! The truth file of simulated segments: dimensions of each, its lines, and what makes all lines leave the ideal.

use crate::process::SegmentsOfModel;
use crate::truth::{CameraTruth, DriveTruth, MachineTruth};
use crate::truth_error::{self, TruthError};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The largest number of segments.
pub(crate) const MAX_SEGMENTS: usize = 3;
/// The largest number of lines of all segments together.
pub(crate) const MAX_LINES: usize = 12;

/// Segments in series, from the base to the tip, with the friction and the play that every line has alike. A key that a file leaves
/// out keeps its default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmentsTruth {
    /// φ: angle of each of the cone's two arcs, rad; 0 to 3.2; by default the paper's.
    pub phi_rad: f64,
    /// One table for each segment, at most three; none: those of the model.
    pub segment: Vec<SegmentTruth>,
    /// What makes them leave the ideal.
    pub effects: SegmentEffectsTruth,
    /// Actuators and encoders.
    pub drive: DriveTruth,
    /// The camera that measures every segment's bend vector.
    pub camera: CameraTruth,
}

/// What makes segments leave the ideal, for every line alike; each effect is off at its neutral value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmentEffectsTruth {
    /// Total play of each actuator, m; 0 to 0.002; neutral 0.
    pub play_m: f64,
    /// η: factor on the elastic bending load, 1; 0.2 to 5; neutral 1.
    pub load_scale: f64,
    /// μ: friction of a line in the cone, 1; 0 to 1; neutral 0.
    pub mu: f64,
    /// f_s: friction of the bent-in wire, N; 0 to 20; neutral 0.
    pub f_s_n: f64,
    /// Lines stretch inside the segments too, by this share of what their length there gives, 1; 0 to 1.5; neutral 0.
    pub inside: f64,
}

/// One segment and the lines that end at its disk.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmentTruth {
    /// Azimuths of its lines, rad, -6.3 to 6.3; each keeps its own in every segment that it passes.
    pub azimuths_rad: Vec<f64>,
    /// Distance of each of these lines from the backbone, m, as `machine.r_m`; empty: `machine.r_m` of all.
    pub radii_m: Vec<f64>,
    /// What makes this segment and its own lines leave the ideal, instead of what makes all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effects: Option<SegmentEffectsTruth>,
    /// Dimensions and material of its backbone and of its own lines; `phi_rad` of it is not used.
    pub machine: MachineTruth,
}

/// Segments that cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SegmentsTruthError {
    /// Too few or too many.
    #[error("there are {found} {what}, expected {low} to {high}; correct the truth")]
    Number {
        /// Segments, or lines of a segment or of all.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// Fewest.
        low: usize,
        /// Most.
        high: usize,
    },
    /// A value outside its range.
    #[error("{key} is {found}, expected {low} to {high}; correct the truth")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// The value found.
        found: f64,
    },
}

impl Default for SegmentsTruth {
    fn default() -> Self {
        Self {
            phi_rad: MachineTruth::default().phi_rad,
            segment: Vec::new(),
            effects: SegmentEffectsTruth::default(),
            drive: DriveTruth::default(),
            camera: CameraTruth::default(),
        }
    }
}

impl Default for SegmentEffectsTruth {
    fn default() -> Self {
        Self { play_m: 0.178e-3, load_scale: 1.22, mu: 0.1727, f_s_n: 1.959, inside: 1.0 }
    }
}

impl SegmentTruth {
    /// Distance of line `k` of the segment (from 0) from the backbone, m.
    pub(crate) fn radius_m(&self, k: usize) -> f64 {
        self.radii_m.get(k).copied().unwrap_or(self.machine.r_m)
    }

    /// Distance of the widest line, m.
    fn widest_m(&self) -> f64 {
        (0..self.azimuths_rad.len()).fold(0.0, |most, k| most.max(self.radius_m(k)))
    }
}

impl SegmentsTruth {
    /// Elastic lines alone.
    pub fn ideal(segment: Vec<SegmentTruth>) -> Self {
        let effects = SegmentEffectsTruth { play_m: 0.0, load_scale: 1.0, mu: 0.0, f_s_n: 0.0, inside: 0.0 };
        Self { segment, effects, ..Self::default() }
    }

    /// Segments of these dimensions with the default effects.
    pub fn of(own: &SegmentsOfModel) -> Self {
        Self { segment: own.segments.clone(), phi_rad: own.phi_rad, ..Self::default() }
    }

    /// Reads and checks a truth file for segments such as these; where it describes none, these are the truth.
    ///
    /// # Errors
    /// [`TruthError`]: unreadable, not TOML, an unknown key, a value of the wrong kind or out of its range, other numbers of segments
    /// or lines.
    pub fn load(path: &Path, own: &SegmentsOfModel) -> Result<Self, TruthError> {
        let (file, text) = truth_error::file_and_text(path)?;
        Self::parse(&text, &file, own)
    }

    /// Checks the text of a truth file; `file` names it in error sentences.
    ///
    /// # Errors
    /// As [`SegmentsTruth::load`], except unreadable.
    pub fn parse(text: &str, file: &str, own: &SegmentsOfModel) -> Result<Self, TruthError> {
        let mut truth: Self = toml::from_str(text).map_err(|e| truth_error::not_toml(file, text, &e))?;
        let n_lines = |segments: &[SegmentTruth]| -> Vec<usize> {
            segments.iter().map(|segment| segment.azimuths_rad.len()).collect()
        };
        if truth.segment.is_empty() {
            truth.segment = own.segments.clone();
        } else if n_lines(&truth.segment) != n_lines(&own.segments) {
            let (found, expected) = (n_lines(&truth.segment), n_lines(&own.segments));
            return Err(TruthError::OtherLines { file: file.to_owned(), found, expected });
        }
        truth.check().map_err(|source| TruthError::Segments { file: file.to_owned(), source })?;
        Ok(truth)
    }

    /// Checks every value. A segment must be at least eight times as long as the radius of the widest line that runs in it.
    ///
    /// # Errors
    /// [`SegmentsTruthError`] for the first that is not finite or out of range.
    pub fn check(&self) -> Result<(), SegmentsTruthError> {
        let number = |what, found, low, high| {
            let is_within = (low..=high).contains(&found);
            if is_within { Ok(()) } else { Err(SegmentsTruthError::Number { what, found, low, high }) }
        };
        number("segments", self.segment.len(), 1, MAX_SEGMENTS)?;
        number("lines", self.segment.iter().map(|own| own.azimuths_rad.len()).sum(), 3, MAX_LINES)?;
        for own in &self.segment {
            if !own.radii_m.is_empty() {
                let n = own.azimuths_rad.len();
                number("radii_m of a segment", own.radii_m.len(), n, n)?;
            }
        }
        let effects = core::iter::once(&self.effects).chain(self.segment.iter().filter_map(|own| own.effects.as_ref()));
        let effects = effects.flat_map(|e| {
            [
                ("effects.play_m", e.play_m, 0.0, 2e-3),
                ("effects.load_scale", e.load_scale, 0.2, 5.0),
                ("effects.mu", e.mu, 0.0, 1.0),
                ("effects.f_s_n", e.f_s_n, 0.0, 20.0),
                ("effects.inside", e.inside, 0.0, 1.5),
            ]
        });
        let whole = core::iter::once(("phi_rad", self.phi_rad, 0.0, 3.2)).chain(effects);
        let whole = whole.chain(self.drive.ranges(2e-2)).chain(self.camera.ranges());
        let of_segments = self.segment.iter().flat_map(|segment| {
            let m = &segment.machine;
            let own = [
                ("e_pa", m.e_pa, 1e9, 3e11),
                ("d_outer_m", m.d_outer_m, 1e-4, 2e-3),
                ("d_inner_m", m.d_inner_m, 0.0, 0.95 * m.d_outer_m),
                ("l_d_m", m.l_d_m, 0.01, 3.0),
                ("l_c_m", m.l_c_m, 1e-3, 1.0),
            ];
            let azimuths = segment.azimuths_rad.iter().map(|rad| ("azimuths_rad", *rad, -6.3, 6.3));
            let radii = (0..segment.azimuths_rad.len()).map(|k| ("r_m", segment.radius_m(k), 5e-4, 5e-3));
            own.into_iter().chain(azimuths).chain(radii)
        });
        let lengths = self.segment.iter().enumerate().map(|(idx, segment)| {
            let widest_m = self.segment[idx..].iter().fold(0.0_f64, |most, own| most.max(own.widest_m()));
            ("l_m", segment.machine.l_m, (8.0 * widest_m).max(5e-3), 0.2)
        });
        for (key, found, low, high) in whole.chain(of_segments).chain(lengths) {
            // Written so that NaN is out of range.
            if !(low..=high).contains(&found) {
                return Err(SegmentsTruthError::OutOfRange { key, low, high, found });
            }
        }
        Ok(())
    }
}
