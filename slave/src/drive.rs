//! What the slave needs of its actuators: the seam behind which a simulated machine or real hardware sits.

use crate::DriveTraits;
pub use crate::drive_error::DriveError;
use krait_ipc::message::{Actuators, DriveCycle, JointValues, MAX_ACTUATORS};

/// Push-pull actuators with encoders and loads, and perhaps a camera on what they move.
///
/// # Real-time
/// No method allocates, blocks, logs or reads a clock; every instant is the argument `stamp_ns`, CLOCK_MONOTONIC,
/// nanoseconds, which never decreases from call to call.
pub trait Drive {
    /// How many actuators there are, 1 to 12; never changes.
    fn n_actuators(&self) -> usize;

    /// What the drives can do; never changes. The slave's limits are checked against it before anything moves.
    fn traits(&self) -> DriveTraits;

    /// Tells the actuators where to be: q~, m, push positive; zeros behind the last. It is the newest wish; where the
    /// actuators go between two cycles of a bus is the bus's business.
    ///
    /// # Errors
    /// [`DriveError`]; the actuators then stay where they are.
    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError>;

    /// The newest reading of encoders and loads, with each actuator's own instant and state. A reading is never waited for:
    /// an old one comes with its age.
    ///
    /// # Errors
    /// [`DriveError`] when there is nothing to be read any more.
    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError>;

    /// Begins or continues the search for the drives' zero; called every tick until it says [`Homing::Done`]. A search
    /// that is not continued is abandoned. The actuator that stands alone, a gripper's wire, stays where it is: its jaw may hold
    /// something.
    ///
    /// # Errors
    /// [`DriveError`] when the search fails.
    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError>;

    /// Begins or continues switching the power of the drives; called every tick until it says [`Switching::Done`]. Off is
    /// wished for and not awaited.
    ///
    /// # Errors
    /// [`DriveError`] when the drives refuse.
    fn set_power(&mut self, stamp_ns: i64, on: bool) -> Result<Switching, DriveError>;

    /// Brings the actuators to rest by a ramp of their own, where they then stay under power until it is switched anew.
    /// Valid in every state.
    fn quick_stop(&mut self, stamp_ns: i64);

    /// Nothing moves any more until power is switched anew, also not what a failure may move.
    fn stand(&mut self, stamp_ns: i64) {
        self.quick_stop(stamp_ns);
    }

    /// What has failed since power was last switched; motion is then forbidden, whatever comes back.
    fn failure(&self) -> Option<DriveError> {
        None
    }

    /// Whether the actuators hang on a bus, whose cycles are then the slave's to publish.
    fn has_bus(&self) -> bool {
        false
    }

    /// The next cycle of the bus that has ended, if the actuators hang on one; its `sequence` has no meaning yet.
    fn next_cycle(&mut self) -> Option<DriveCycle> {
        None
    }

    /// Whether this drive has a camera, whose shapes are then the slave's to publish.
    fn has_camera(&self) -> bool {
        false
    }

    /// The next measured shape that has become available, if this drive has a camera.
    fn shape(&mut self, _stamp_ns: i64) -> Option<ShapeReading> {
        None
    }
}

/// What the actuators measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveReading {
    /// Encoder positions q~, m, push positive; zeros behind the last actuator.
    pub q_tilde_m: Actuators,
    /// Load at each actuator, N, push positive; NaN where it is not measured, zeros behind the last actuator.
    pub tau_n: Actuators,
    /// When each actuator was measured, CLOCK_MONOTONIC, nanoseconds; zeros behind the last.
    pub sampled_ns: [i64; MAX_ACTUATORS],
    /// What each actuator is doing; Off behind the last.
    pub state: [ActuatorState; MAX_ACTUATORS],
    /// Whether any has sent an emergency that stands and has stopped nothing by itself.
    pub has_emergency: bool,
}

impl DriveReading {
    /// A reading of so many actuators that were all measured at one instant and are all in one state.
    pub fn at_once(n: usize, stamp_ns: i64, (q_tilde_m, tau_n): (Actuators, Actuators), state: ActuatorState) -> Self {
        Self {
            q_tilde_m,
            tau_n,
            sampled_ns: core::array::from_fn(|k| if k < n { stamp_ns } else { 0 }),
            state: core::array::from_fn(|k| if k < n { state } else { ActuatorState::Off }),
            has_emergency: false,
        }
    }
}

/// What one actuator is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum ActuatorState {
    /// Without power.
    #[default]
    Off = 0,
    /// Power is being switched.
    Switching = 1,
    /// Under power, where it is told to be.
    On = 2,
    /// Under power, at rest until power is switched anew.
    QuickStopped = 3,
    /// It has let go by itself: its line is not held.
    Limp = 4,
    /// It reports a failure of its own.
    Faulted = 5,
    /// It does not answer.
    Lost = 6,
    /// Under power, gives way to its line because another has let go of its own.
    Relaxing = 7,
}

impl ActuatorState {
    /// Whether it is under power by its own report.
    pub fn has_power(self) -> bool {
        matches!(self, Self::On | Self::QuickStopped | Self::Relaxing)
    }
}

/// How far switching the power is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switching {
    /// Not all actuators have answered yet.
    Busy,
    /// All have.
    Done,
}

/// What a camera saw of a snake, or of joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeReading {
    /// Instant of exposure, CLOCK_MONOTONIC, nanoseconds.
    pub exposure_ns: i64,
    /// What it saw.
    pub seen: SeenShape,
    /// Angle of the jaw of a snake's gripper, rad; NaN where there is none.
    pub jaw_rad: f64,
    /// Standard deviation of each number of it, rad (m for a sliding joint).
    pub sigma_rad: f64,
    /// Encoder positions q~ at the instant of exposure, m; NaN where not known. Of joints the camera's maker gives none.
    pub q_tilde_m: [f64; 3],
}

/// The shape of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SeenShape {
    /// Of a snake: bend vector b (cos delta, sin delta), rad.
    Bend([f64; 2]),
    /// Of so many joints: their positions, rad (m for a sliding joint).
    Joints(JointValues, usize),
}

/// How far the search for the zero is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Homing {
    /// The actuators are still searching.
    Busy,
    /// The zero is known and the actuators stand still.
    Done,
}
