//! A recording as measurements: one row per encoder sample, with the camera's shape where there is one. What the model lab
//! reads, and what `krait export` writes.
//!
//! Which row gets which shape: a camera measures rarely and says so late, so a shape goes to the row whose encoder stamp is
//! nearest to its instant of exposure, if that is within [`PAIRING_LIMIT_NS`]; where two shapes are nearest to one row, the
//! nearer one wins. At 1 kHz the two instants differ by at most half a millisecond. Every encoder row stays, also without a
//! shape, because hysteresis remembers them all.
//!
//! Encoders mean something only when the drives know their zero: rows begin when the slave is homed and end when it is not.

mod csv;
mod header;
mod parquet;

use crate::error::RecordingReadError;
use crate::reader::Recording;
use krait_ipc::message::{
    JointValues, MAX_ACTUATORS, MAX_JOINTS, N_LINES, N_WITH_GRIPPER, Shape, SlaveState, n_actuators,
};
use krait_schema::Sample;
use std::path::Path;

pub use self::parquet::write_parquet;
pub use csv::write_csv;
pub use header::ColumnUnits;

/// Furthest that an encoder stamp and an exposure may be apart to count as one measurement, ns: ten rows at 1 kHz.
pub const PAIRING_LIMIT_NS: i64 = 10_000_000;

/// The measurements of a recording: a row for each sample of the encoders. NaN: not measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// How many joints the machine has; 0: a snake.
    pub n_joints: usize,
    /// Instant of the encoders since the first row of the recording, s; never falls, and rises within a trial.
    pub time_s: Vec<f64>,
    /// Actuators of each row: three lines of a snake.
    pub n_actuators: usize,
    /// Encoder positions of the actuators, m, push positive, row after row.
    pub q_m: Vec<f64>,
    /// Load of each actuator, N, push positive, row after row; NaN where it is not measured.
    pub tau_n: Vec<f64>,
    /// What was measured of the shape, row after row of [`Columns::n_outputs`]: the bend vector b (cos delta, sin delta) of a
    /// snake, rad, or the positions of joints, rad (m where they slide); NaN where the camera gave none.
    pub outputs: Vec<f64>,
    /// Standard deviation of each output of a row as the camera states it (of joints the root mean square), in the outputs'
    /// unit; NaN where the camera gave none.
    pub sigma: Vec<f64>,
    /// The gripper of a snake that has one.
    pub jaw: Option<JawColumns>,
    /// Counts from 1; a new one begins where the slave was started or homed anew, and the machine's history with it.
    pub trial: Vec<u32>,
    /// Shapes that stand in a row.
    pub n_shapes: u64,
    /// Shapes that stand in none: the camera saw nothing, or no row was near enough.
    pub n_shapes_left_out: u64,
    /// States that became no row: the drives did not know their zero, or the stamp did not rise.
    pub n_states_left_out: u64,
}

/// What was measured of a snake's gripper, a number for each row; NaN: not measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JawColumns {
    /// Encoder position of its wire, m, push positive.
    pub wire_m: Vec<f64>,
    /// Load of its wire at the actuator, N, push positive.
    pub wire_n: Vec<f64>,
    /// Angle of the jaw, rad.
    pub jaw_rad: Vec<f64>,
}

impl JawColumns {
    /// Takes the wire of a gripper out of rows of four actuators, which become rows of three lines.
    fn taken_from(q_m: &mut Vec<f64>, tau_n: &mut Vec<f64>) -> Self {
        let take = |all: &mut Vec<f64>| {
            let own = all.iter().skip(N_LINES).step_by(N_WITH_GRIPPER).copied().collect();
            let mut place = 0;
            all.retain(|_| {
                place += 1;
                place % N_WITH_GRIPPER != 0
            });
            own
        };
        let (wire_m, wire_n): (Vec<f64>, Vec<f64>) = (take(q_m), take(tau_n));
        Self { jaw_rad: vec![f64::NAN; wire_m.len()], wire_m, wire_n }
    }
}

impl Columns {
    /// Reads the measurements of a recording. What is missing from it is missing here too: see
    /// [`crate::Contents::missing`].
    ///
    /// # Errors
    /// [`RecordingReadError`] when the recording cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingReadError> {
        Self::of_parts(core::slice::from_ref(recording))
    }

    /// Reads the measurements of the parts of a rotated recording, in their order.
    ///
    /// # Errors
    /// As [`Columns::of`].
    pub fn of_parts(parts: &[Recording]) -> Result<Self, RecordingReadError> {
        let mut builder = Builder::default();
        for part in parts {
            for recorded in part.samples()? {
                builder.add(&recorded?.sample);
            }
        }
        Ok(builder.finish())
    }

    /// Opens a recording with the parts that follow it and reads its measurements.
    ///
    /// # Errors
    /// [`RecordingReadError`] when the file cannot be read or is no recording of this version.
    pub fn read(path: &Path) -> Result<Self, RecordingReadError> {
        Self::of_parts(&Recording::open_parts(path)?)
    }

    /// The gripper of a snake alone, as a machine of one joint: the wire is its command, the jaw its position. `None` for a
    /// recording without one.
    pub fn of_jaw(self) -> Option<Self> {
        let JawColumns { wire_m, wire_n, jaw_rad } = self.jaw?;
        let n_shapes = jaw_rad.iter().filter(|rad| !rad.is_nan()).count() as u64;
        Some(Self {
            n_joints: 1,
            n_actuators: 1,
            q_m: wire_m,
            tau_n: wire_n,
            sigma: vec![f64::NAN; jaw_rad.len()],
            outputs: jaw_rad,
            jaw: None,
            n_shapes,
            n_shapes_left_out: self.n_shapes_left_out + self.n_shapes - n_shapes,
            ..self
        })
    }

    /// Rows.
    pub fn n_rows(&self) -> usize {
        self.time_s.len()
    }

    /// Outputs of each row: two of a snake, one for each joint.
    pub fn n_outputs(&self) -> usize {
        if self.n_joints == 0 { 2 } else { self.n_joints }
    }

    /// Whether any row has a load.
    pub fn has_tau(&self) -> bool {
        self.tau_n.iter().any(|tau| !tau.is_nan())
    }

    /// Whether the camera gave a shape for a row.
    pub fn has_shape(&self, row: usize) -> bool {
        self.outputs.get(row * self.n_outputs()).is_some_and(|first| !first.is_nan())
    }
}

/// A shape that waits for its row.
#[derive(Clone, Copy, Debug)]
struct Seen {
    exposed_ns: i64,
    outputs: JointValues,
    sigma: f64,
    jaw_rad: f64,
}

/// Puts measurements together from samples in the order of the file; give it the parts of a rotated recording in turn.
#[derive(Debug, Default)]
pub struct Builder {
    columns: Columns,
    stamps_ns: Vec<i64>,
    shapes: Vec<Seen>,
    last_sequence: u64,
    was_homed: bool,
    trial: u32,
}

impl Builder {
    /// Notes a sample; only states and shapes matter.
    pub fn add(&mut self, sample: &Sample) {
        match sample {
            Sample::State(state) => self.state(state),
            Sample::Shape(shape) => self.shape(shape),
            _ => {}
        }
    }

    /// The measurements, with each shape in its row.
    pub fn finish(mut self) -> Columns {
        let columns = &mut self.columns;
        // Four actuators and no joints are a snake's three lines and its gripper's wire.
        if columns.n_joints == 0 && columns.n_actuators == N_WITH_GRIPPER {
            columns.jaw = Some(JawColumns::taken_from(&mut columns.q_m, &mut columns.tau_n));
            columns.n_actuators = N_LINES;
        }
        let n = columns.n_outputs();
        (columns.outputs, columns.sigma) =
            (vec![f64::NAN; n * self.stamps_ns.len()], vec![f64::NAN; self.stamps_ns.len()]);
        // How far each row's exposure is from its stamp.
        let mut distances_ns = vec![i64::MAX; self.stamps_ns.len()];
        for Seen { exposed_ns, outputs, sigma, jaw_rad } in self.shapes {
            let Some((row, distance_ns)) = nearest(&self.stamps_ns, exposed_ns) else {
                columns.n_shapes_left_out += 1;
                continue;
            };
            let taken = &mut distances_ns[row];
            if distance_ns > PAIRING_LIMIT_NS || distance_ns >= *taken {
                columns.n_shapes_left_out += 1;
                continue;
            }
            let replaces_another = core::mem::replace(taken, distance_ns) != i64::MAX;
            columns.outputs[row * n..][..n].copy_from_slice(&outputs[..n]);
            columns.sigma[row] = sigma;
            if let Some(jaw) = &mut columns.jaw {
                jaw.jaw_rad[row] = jaw_rad;
            }
            columns.n_shapes += u64::from(!replaces_another);
            columns.n_shapes_left_out += u64::from(replaces_another);
        }
        self.columns
    }

    fn state(&mut self, state: &SlaveState) {
        let n_actuators = n_actuators(state.n_actuators).min(MAX_ACTUATORS);
        let is_measuring = state.flags & SlaveState::IS_HOMED != 0
            && state.flags & SlaveState::IS_BUSY == 0
            && state.measured_q_m[..n_actuators].iter().all(|q| q.is_finite());
        let is_new_slave = state.sequence <= self.last_sequence;
        self.last_sequence = state.sequence;
        // A machine of joints says so from its first command on.
        self.columns.n_joints = self.columns.n_joints.max((state.n_joints as usize).min(MAX_JOINTS));
        let rises = self.stamps_ns.last().is_none_or(|last_ns| state.sample_ns > *last_ns);
        let is_same_machine = self.columns.n_actuators == 0 || self.columns.n_actuators == n_actuators;
        if !is_measuring || !rises || !is_same_machine {
            self.was_homed &= is_measuring && !is_new_slave;
            self.columns.n_states_left_out += 1;
            return;
        }
        self.trial += u32::from(is_new_slave || !self.was_homed);
        self.was_homed = true;
        let first_ns = self.stamps_ns.first().copied().unwrap_or(state.sample_ns);
        self.stamps_ns.push(state.sample_ns);
        let columns = &mut self.columns;
        columns.n_actuators = n_actuators;
        columns.time_s.push(state.sample_ns.saturating_sub(first_ns) as f64 / 1e9);
        columns.q_m.extend(&state.measured_q_m[..n_actuators]);
        columns.tau_n.extend(&state.measured_tau_n[..n_actuators]);
        columns.trial.push(self.trial);
    }

    fn shape(&mut self, shape: &Shape) {
        let mut outputs = [f64::NAN; MAX_JOINTS];
        let sigma = match (shape.valid_bend_rad(), shape.valid_joints_rad()) {
            (Some(bend_rad), _) => {
                outputs[..2].copy_from_slice(&bend_rad);
                shape.sigma_bend_rad()
            }
            (None, Some(joints)) => {
                outputs[..joints.len()].copy_from_slice(joints);
                (shape.joint_variances_rad2[..joints.len()].iter().sum::<f64>() / joints.len() as f64).sqrt()
            }
            (None, None) => {
                self.columns.n_shapes_left_out += 1;
                return;
            }
        };
        let jaw_rad = shape.valid_jaw_rad().unwrap_or(f64::NAN);
        self.shapes.push(Seen { exposed_ns: shape.sample_ns, outputs, sigma, jaw_rad });
    }
}

/// Index of the stamp nearest to an instant, and how far that is, ns. The stamps rise.
fn nearest(stamps_ns: &[i64], instant_ns: i64) -> Option<(usize, i64)> {
    let after = stamps_ns.partition_point(|stamp_ns| *stamp_ns < instant_ns);
    let distance =
        |idx: usize| stamps_ns.get(idx).map(|stamp_ns| (idx, instant_ns.saturating_sub(*stamp_ns).saturating_abs()));
    [after.checked_sub(1).and_then(distance), distance(after)].into_iter().flatten().min_by_key(|(_, far_ns)| *far_ns)
}

#[cfg(test)]
mod tests;
