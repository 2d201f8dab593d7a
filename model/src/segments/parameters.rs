//! What segments and their lines are made of, checked once, so that no formula behind it meets a length of zero or a NaN.

use super::{MAX_LINES, MAX_SEGMENTS};
use crate::{ChainSettings, MachineParameters};
use core::f64::consts::PI;

/// Segments in series, from the base to the tip.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentsParameters {
    /// One to three of them.
    pub segments: Vec<SegmentParameters>,
    /// Angle phi of each of the two arcs in the cone, rad, 0 to pi.
    pub phi_rad: f64,
    /// Whether the lines are taken for rigid: they then give nothing under load, and q~ = q.
    pub rigid_lines: bool,
    /// Load that every line would have by itself, N, push positive, -200 to 200: what of it bends nothing is kept.
    pub preload_n: f64,
    /// Smallest load of a line, N, at most `high_n` and 200; negative infinity for none. A wire drive, which only pulls, has one below.
    pub low_n: f64,
    /// Largest load of a line, N, at least -200; infinity for none. A wire drive has a negative one: the least pull.
    pub high_n: f64,
    /// Largest strain of a backbone's outer fibre, and the travel over which a line's sign of motion turns.
    pub settings: ChainSettings,
}

/// One segment: its primary backbone, and the lines that end at its disk. Every line keeps the material of its own segment.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentParameters {
    /// Length L of the primary backbone, m, 0.005 to 0.5.
    pub l_m: f64,
    /// Young's modulus E of its backbones, Pa, 1e9 to 4e11.
    pub e_pa: f64,
    /// Outer diameter of its backbones, m, 0.00005 to 0.005.
    pub d_outer_m: f64,
    /// Inner diameter of its backbones, m, 0 to less than the outer one.
    pub d_inner_m: f64,
    /// Length L_d of its lines in the holder, m, 0.001 to 10.
    pub l_d_m: f64,
    /// Length L_c of its lines in the cone, m, 0.001 to 10.
    pub l_c_m: f64,
    /// Two or more lines that do not lie in one plane with the primary backbone.
    pub lines: Vec<LineParameters>,
}

/// One line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineParameters {
    /// Azimuth about the primary backbone, rad, -2 pi to 2 pi; line i of three has (i-1) 120 deg in the paper.
    pub azimuth_rad: f64,
    /// Distance from the primary backbone, m, 0.0003 to 0.02.
    pub radius_m: f64,
}

/// Segments cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SegmentsError {
    /// None, or more than three.
    #[error("the machine has {found} segments, expected 1 to 3; write one [[machine.segment]] for each")]
    Segments {
        /// How many there are.
        found: usize,
    },
    /// Fewer than three lines or more than twelve.
    #[error("the segments have {found} lines in all, expected 3 to 12; correct azimuth_deg")]
    Lines {
        /// How many there are.
        found: usize,
    },
    /// A number of the whole machine.
    #[error("[machine] {key} is {found}, expected {low} to {high} {unit}; correct it")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// What was given.
        found: f64,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Unit of the three numbers.
        unit: &'static str,
    },
    /// A number of one segment.
    #[error("segment {segment}: {key} is {found}, expected {low} to {high} {unit}; correct it")]
    OfSegment {
        /// Which, from 1.
        segment: usize,
        /// The key.
        key: &'static str,
        /// What was given.
        found: f64,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Unit of the three numbers.
        unit: &'static str,
    },
    /// Lines that can bend their segment in one plane only.
    #[error(
        "segment {segment}: its {n_lines} lines lie in one plane with its backbone, or nearly, expected lines around it; correct azimuth_deg"
    )]
    OnePlane {
        /// Which, from 1.
        segment: usize,
        /// Lines that end at its disk.
        n_lines: usize,
    },
    /// The friction that the cone multiplies stands behind the cone.
    #[error(
        "effect static-friction stands behind cone-friction, expected before it: in segments the cone multiplies both loads; exchange the two"
    )]
    ConeFirst,
}

impl SegmentsError {
    /// The segment that it is about, from 1; `None`: the machine as a whole.
    pub fn segment(&self) -> Option<usize> {
        match self {
            Self::OfSegment { segment, .. } | Self::OnePlane { segment, .. } => Some(*segment),
            Self::Segments { .. } | Self::Lines { .. } | Self::OutOfRange { .. } | Self::ConeFirst => None,
        }
    }

    /// The key of the model file that it is about.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Segments { .. } | Self::ConeFirst => "segment",
            Self::Lines { .. } | Self::OnePlane { .. } => "azimuth_deg",
            Self::OutOfRange { key, .. } | Self::OfSegment { key, .. } => key,
        }
    }
}

/// Least ratio of the two directions in which the lines of a segment can bend it: the smaller eigenvalue of J^T J over the larger.
const LEAST_RATIO: f64 = 1e-2;

impl Default for SegmentsParameters {
    /// No segments yet; the numbers of the machine as in Table I.
    fn default() -> Self {
        Self {
            segments: Vec::new(),
            phi_rad: MachineParameters::default().phi_rad,
            rigid_lines: false,
            preload_n: 0.0,
            low_n: f64::NEG_INFINITY,
            high_n: f64::INFINITY,
            settings: ChainSettings::default(),
        }
    }
}

impl SegmentParameters {
    /// A segment of the paper's dimensions with lines at these azimuths, rad.
    pub fn of_table_i(azimuths_rad: &[f64]) -> Self {
        let MachineParameters { l_m, r_m, e_pa, d_outer_m, d_inner_m, l_d_m, l_c_m, .. } = MachineParameters::default();
        let line = |&azimuth_rad: &f64| LineParameters { azimuth_rad, radius_m: r_m };
        Self { l_m, e_pa, d_outer_m, d_inner_m, l_d_m, l_c_m, lines: azimuths_rad.iter().map(line).collect() }
    }

    /// E A of each of its backbones, N.
    pub fn axial_stiffness_n(&self) -> f64 {
        self.e_pa * (PI / 4.0 * (self.d_outer_m.powi(2) - self.d_inner_m.powi(2)))
    }
}

impl SegmentsParameters {
    /// Checks every value.
    ///
    /// # Errors
    /// [`SegmentsError`] for the first that is not finite, out of range or at odds with another one.
    pub fn check(&self) -> Result<(), SegmentsError> {
        let ChainSettings { strain_limit, transition_m } = self.settings;
        in_range("phi_rad", self.phi_rad, [0.0, PI], "rad")?;
        in_range("preload_n", self.preload_n, [-200.0, 200.0], "N")?;
        in_range("high_n", self.high_n, [-200.0, f64::INFINITY], "N")?;
        in_range("low_n", self.low_n, [f64::NEG_INFINITY, self.high_n.min(200.0)], "N")?;
        in_range("strain_limit", strain_limit, [0.001, 0.08], "(no unit)")?;
        in_range("transition_m", transition_m, [1e-9, 1e-3], "m")?;
        let n = self.segments.len();
        if n == 0 || n > MAX_SEGMENTS {
            return Err(SegmentsError::Segments { found: n });
        }
        let n_lines = self.segments.iter().map(|segment| segment.lines.len()).sum();
        // A line's radius also decides about the segments that it passes: a wrong one is told where it stands.
        for (idx, segment) in self.segments.iter().enumerate() {
            segment.check_numbers(idx + 1)?;
        }
        for (idx, segment) in self.segments.iter().enumerate() {
            segment.check_lines(idx + 1, &self.segments[idx..])?;
        }
        if !(3..=MAX_LINES).contains(&n_lines) {
            return Err(SegmentsError::Lines { found: n_lines });
        }
        Ok(())
    }
}

impl SegmentParameters {
    /// Checks each number of segment `segment` (from 1) by itself.
    fn check_numbers(&self, segment: usize) -> Result<(), SegmentsError> {
        let check = |key, found, range, unit| of_segment(segment, key, found, range, unit);
        check("l_m", self.l_m, [0.005, 0.5], "m")?;
        check("e_pa", self.e_pa, [1e9, 4e11], "Pa")?;
        check("d_outer_m", self.d_outer_m, [0.00005, 0.005], "m")?;
        check("d_inner_m", self.d_inner_m, [0.0, 0.99 * self.d_outer_m], "m")?;
        check("l_d_m", self.l_d_m, [0.001, 10.0], "m")?;
        check("l_c_m", self.l_c_m, [0.001, 10.0], "m")?;
        for line in &self.lines {
            check("azimuth_deg", line.azimuth_rad.to_degrees(), [-360.0, 360.0], "deg")?;
            check("r_m", line.radius_m, [0.0003, 0.02], "m")?;
        }
        Ok(())
    }

    /// Checks that the lines leave segment `segment` (from 1) its length and can bend it; `passing` are the segments whose lines run
    /// in it, this one first.
    fn check_lines(&self, segment: usize, passing: &[Self]) -> Result<(), SegmentsError> {
        // A line of length L + q has to keep a positive length up to a bend of pi.
        let widest_m = passing.iter().flat_map(|own| &own.lines).fold(0.0_f64, |most, line| most.max(line.radius_m));
        let shortest_m = (1.01 * PI * widest_m).max(0.005);
        of_segment(segment, "l_m", self.l_m, [shortest_m, 0.5], "m (more than pi times the largest radius)")?;
        let rows = self.lines.iter().map(|line| {
            let (sin, cos) = line.azimuth_rad.sin_cos();
            [line.radius_m * cos, line.radius_m * sin]
        });
        let [xx, xy, yy] = rows.fold([0.0; 3], |[xx, xy, yy], [x, y]| [xx + x * x, xy + x * y, yy + y * y]);
        let (middle, half) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(xy));
        if middle - half <= LEAST_RATIO * (middle + half) {
            return Err(SegmentsError::OnePlane { segment, n_lines: self.lines.len() });
        }
        Ok(())
    }
}

fn of_segment(
    segment: usize,
    key: &'static str,
    found: f64,
    [low, high]: [f64; 2],
    unit: &'static str,
) -> Result<(), SegmentsError> {
    // Written so that NaN is out of range.
    let is_within = (low..=high).contains(&found);
    if is_within { Ok(()) } else { Err(SegmentsError::OfSegment { segment, key, found, low, high, unit }) }
}

fn in_range(key: &'static str, found: f64, [low, high]: [f64; 2], unit: &'static str) -> Result<(), SegmentsError> {
    if (low..=high).contains(&found) { Ok(()) } else { Err(SegmentsError::OutOfRange { key, found, low, high, unit }) }
}
