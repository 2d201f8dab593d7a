//! What simulated segments really are: dimensions of each, its lines, and what makes all lines leave the ideal.

use crate::truth::MachineTruth;

/// The largest number of segments.
pub(crate) const MAX_SEGMENTS: usize = 3;
/// The largest number of lines of all segments together.
pub(crate) const MAX_LINES: usize = 12;

/// Segments in series, from the base to the tip, with the friction and the play that every line has alike.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentsTruth {
    /// One to three of them.
    pub segments: Vec<SegmentTruth>,
    /// φ: angle of each of the cone's two arcs, rad; 0 to 3.2.
    pub phi_rad: f64,
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
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentTruth {
    /// Dimensions and material of its backbone and of its own lines; `phi_rad` of it is not used.
    pub machine: MachineTruth,
    /// Azimuths of its lines, rad; each keeps its own in every segment that it passes.
    pub azimuths_rad: Vec<f64>,
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

impl SegmentsTruth {
    /// Elastic lines alone.
    pub fn ideal(segments: Vec<SegmentTruth>) -> Self {
        let phi_rad = MachineTruth::default().phi_rad;
        Self { segments, phi_rad, play_m: 0.0, load_scale: 1.0, mu: 0.0, f_s_n: 0.0, inside: 0.0 }
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
        number("segments", self.segments.len(), 1, MAX_SEGMENTS)?;
        number("lines", self.segments.iter().map(|own| own.azimuths_rad.len()).sum(), 3, MAX_LINES)?;
        let whole = [
            ("phi_rad", self.phi_rad, 0.0, 3.2),
            ("play_m", self.play_m, 0.0, 2e-3),
            ("load_scale", self.load_scale, 0.2, 5.0),
            ("mu", self.mu, 0.0, 1.0),
            ("f_s_n", self.f_s_n, 0.0, 20.0),
            ("inside", self.inside, 0.0, 1.5),
        ];
        let of_segments = self.segments.iter().flat_map(|segment| {
            let m = &segment.machine;
            let own = [
                ("r_m", m.r_m, 5e-4, 5e-3),
                ("e_pa", m.e_pa, 1e9, 3e11),
                ("d_outer_m", m.d_outer_m, 1e-4, 2e-3),
                ("d_inner_m", m.d_inner_m, 0.0, 0.95 * m.d_outer_m),
                ("l_d_m", m.l_d_m, 0.01, 3.0),
                ("l_c_m", m.l_c_m, 1e-3, 1.0),
            ];
            own.into_iter().chain(segment.azimuths_rad.iter().map(|rad| ("azimuths_rad", *rad, -6.3, 6.3)))
        });
        let lengths = self.segments.iter().enumerate().map(|(idx, segment)| {
            let widest_m = self.segments[idx..].iter().fold(0.0_f64, |most, own| most.max(own.machine.r_m));
            ("l_m", segment.machine.l_m, (8.0 * widest_m).max(5e-3), 0.2)
        });
        for (key, found, low, high) in whole.into_iter().chain(of_segments).chain(lengths) {
            // Written so that NaN is out of range.
            if !(low..=high).contains(&found) {
                return Err(SegmentsTruthError::OutOfRange { key, low, high, found });
            }
        }
        Ok(())
    }
}
