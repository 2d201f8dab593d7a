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
mod parquet;

use crate::error::RecordingReadError;
use crate::reader::Recording;
use krait_ipc::message::{Shape, SlaveState, three};
use krait_schema::Sample;
use std::path::Path;

pub use self::parquet::write_parquet;
pub use csv::write_csv;

/// Furthest that an encoder stamp and an exposure may be apart to count as one measurement, ns: ten rows at 1 kHz.
pub const PAIRING_LIMIT_NS: i64 = 10_000_000;

/// One measurement of the machine. NaN: not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Instant of the encoders since the first row of the recording, s; never falls, and rises within a trial.
    pub time_s: f64,
    /// Encoder positions q~ of the three lines, m, push positive.
    pub q_m: [f64; 3],
    /// Measured bend vector b (cos delta, sin delta), rad; NaN where the camera gave none.
    pub bend_rad: [f64; 2],
    /// Standard deviation of each component of `bend_rad` as the camera states it, rad; NaN where the camera gave none.
    pub sigma_bend_rad: f64,
    /// Load of each line at its actuator, N, push positive; NaN where it is not measured.
    pub tau_n: [f64; 3],
    /// Counts from 1; a new one begins where the slave was started or homed anew, and the machine's history with it.
    pub trial: u32,
}

/// The measurements of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// The rows, in the order of time.
    pub rows: Vec<Row>,
    /// Shapes that stand in a row.
    pub n_shapes: u64,
    /// Shapes that stand in none: the camera saw nothing, or no row was near enough.
    pub n_shapes_left_out: u64,
    /// Whether the machine has joints: there are no rows then, because a row is of a snake.
    pub is_of_joints: bool,
    /// States that became no row: the drives did not know their zero, or the stamp did not rise.
    pub n_states_left_out: u64,
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

    /// Whether any row has a load.
    pub fn has_tau(&self) -> bool {
        self.rows.iter().any(|row| row.tau_n.iter().any(|tau| !tau.is_nan()))
    }
}

impl Row {
    /// Whether the camera gave a shape for this row.
    pub fn has_shape(&self) -> bool {
        !self.bend_rad[0].is_nan()
    }
}

/// Puts measurements together from samples in the order of the file; give it the parts of a rotated recording in turn.
#[derive(Debug, Default)]
pub struct Builder {
    columns: Columns,
    // Stamp of each row, and the distance of its shape's exposure.
    stamps_ns: Vec<i64>,
    shapes: Vec<(i64, [f64; 2], f64)>,
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
        if self.columns.is_of_joints {
            return Columns { is_of_joints: true, ..Columns::default() };
        }
        let mut distances_ns = vec![i64::MAX; self.stamps_ns.len()];
        for (exposed_ns, bend_rad, sigma_bend_rad) in self.shapes {
            let Some((idx, distance_ns)) = nearest(&self.stamps_ns, exposed_ns) else {
                self.columns.n_shapes_left_out += 1;
                continue;
            };
            let (row, taken) = (&mut self.columns.rows[idx], &mut distances_ns[idx]);
            if distance_ns > PAIRING_LIMIT_NS || distance_ns >= *taken {
                self.columns.n_shapes_left_out += 1;
                continue;
            }
            let replaces_another = *taken != i64::MAX;
            (row.bend_rad, row.sigma_bend_rad, *taken) = (bend_rad, sigma_bend_rad, distance_ns);
            self.columns.n_shapes += u64::from(!replaces_another);
            self.columns.n_shapes_left_out += u64::from(replaces_another);
        }
        self.columns
    }

    fn state(&mut self, state: &SlaveState) {
        self.columns.is_of_joints |= state.n_joints > 0;
        let is_measuring = state.flags & SlaveState::IS_HOMED != 0
            && state.flags & SlaveState::IS_BUSY == 0
            && state.measured_q_m.iter().all(|q| q.is_finite());
        let is_new_slave = state.sequence <= self.last_sequence;
        self.last_sequence = state.sequence;
        let rises = self.stamps_ns.last().is_none_or(|last_ns| state.sample_ns > *last_ns);
        if !is_measuring || !rises {
            self.was_homed &= is_measuring && !is_new_slave;
            self.columns.n_states_left_out += 1;
            return;
        }
        self.trial += u32::from(is_new_slave || !self.was_homed);
        self.was_homed = true;
        let first_ns = self.stamps_ns.first().copied().unwrap_or(state.sample_ns);
        self.stamps_ns.push(state.sample_ns);
        self.columns.rows.push(Row {
            time_s: state.sample_ns.saturating_sub(first_ns) as f64 / 1e9,
            q_m: three(&state.measured_q_m),
            bend_rad: [f64::NAN; 2],
            sigma_bend_rad: f64::NAN,
            tau_n: three(&state.measured_tau_n),
            trial: self.trial,
        });
    }

    fn shape(&mut self, shape: &Shape) {
        match shape.valid_bend_rad() {
            Some(bend_rad) => self.shapes.push((shape.sample_ns, bend_rad, shape.sigma_bend_rad())),
            None => self.columns.n_shapes_left_out += 1,
        }
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
