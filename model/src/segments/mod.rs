//! Snakes of one to three segments in series on three to twelve lines at any angles: the general case of [`crate::Snake`].
//!
//! Problem: segment j bends by b_j, 2x1, rad. Line k is of segment m(k), ends at that segment's disk and passes every one before it
//! at the same azimuth g_k and radius r_k (no frame is twisted). All lengths, loads and bends follow from
//!
//! ```text
//! q_k  = sum_(j <= m) J_k b_j,     J_k = -r_k (cos g_k, -sin g_k)              J is block lower triangular over (line, bend)
//! E    = sum_j |b_j|^2/2 (E I_j/L_j + sum_(k passes j) E I_k/(L_j + J_k b_j))   every line that passes is bent too
//! J^T tau = eta grad E                                                         loads of the lines at the snake, push positive
//! q~_k = q_k + sum_(j <= m) u_j + eps_k(tau_k),   u_j = (L_j/E A_j) sum_(k passes j) tau_k
//! ```
//!
//! where: u_j is what segment j's primary backbone is stretched by the loads that pass it, which vanishes where they sum to
//! zero. Rows of unused lines and columns of unused segments are zero everywhere. Eta may be another in each segment, as may
//! friction and play of its lines.
//!
//! Source: the paper's Eqs. (1), (9)-(11) and (26) for each segment; for more than one by virtual work on the sum of the energies.
//! The paper shows two sections and does not say how lines pass: that they keep their azimuth is an assumption.

mod chain;
mod forward;
mod friction;
mod inverse;
mod machine;
mod of_segments;
mod parameters;
mod rate;
mod seen;
mod sharing;
mod statics;
mod tangents;
mod tip;

pub use chain::{SEGMENT_EFFECTS, SegmentChain};
pub use forward::SegmentPredictor;
pub use inverse::{SegmentCommand, SegmentCompensator, SegmentMemory, SegmentStatus};
pub use machine::Segments;
pub use parameters::{LineParameters, SegmentParameters, SegmentsError, SegmentsParameters};
pub use rate::{SegmentRate, SegmentRateWeights};
pub use sharing::{LoadSharing, SharedLoads, Sharing};
pub use tangents::SegmentTangents;

use crate::vector_learner::{VectorLearner, VectorLearnerParameters, VectorSight};
use nalgebra::{SMatrix, SVector};

/// The largest number of segments.
pub const MAX_SEGMENTS: usize = 3;
/// The largest number of lines of all segments together.
pub const MAX_LINES: usize = 12;
/// Components of the bend vectors of all segments.
pub const MAX_BENDS: usize = 2 * MAX_SEGMENTS;

/// Bend vectors of all segments, rad, one after the other; zeros behind the last.
pub type Bends = SVector<f64, MAX_BENDS>;
/// One value for each line, segment 1's first; zeros behind the last.
pub type LineValues = SVector<f64, MAX_LINES>;
/// One row for each line, one column for each component of the bends.
pub type LinesByBends = SMatrix<f64, MAX_LINES, MAX_BENDS>;
/// One row for each component of the bends, one column for each line.
pub type BendsByLines = SMatrix<f64, MAX_BENDS, MAX_LINES>;
/// A row for each component of the tip's twist, linear (m/rad), then angular (rad/rad), base frame; a column for each component of the bends.
pub type TwistByBends = SMatrix<f64, 6, MAX_BENDS>;
/// One row and one column for each component of the bends.
pub type BendsByBends = SMatrix<f64, MAX_BENDS, MAX_BENDS>;
/// Learns parameters of segments; see [`VectorLearner`].
pub type SegmentLearner = VectorLearner<SegmentTangents, MAX_BENDS, MAX_LINES>;
/// What a model of segments saw at an instant: bends, rad, for positions of the actuators, m.
pub type SegmentSight = VectorSight<MAX_BENDS, MAX_LINES>;

impl SegmentChain {
    /// The forward model with slopes by the parameters that the chain learns.
    pub fn learning_predictor(&self) -> SegmentTangents {
        SegmentTangents::new(self)
    }

    /// A learner of the parameters that the chain names, which starts from the values of the model file.
    pub fn learner(&self, parameters: VectorLearnerParameters) -> SegmentLearner {
        VectorLearner::new(self.learning_predictor(), self.learnt(), self.machine.n_bends(), parameters)
    }
}
