//! How a replay steers a machine as an operator would: where it stands, and the velocities of the hand that bring it elsewhere.

use krait_ipc::message::{
    JAW, JointValues, MAX_JOINTS, N_WITH_GRIPPER, OperatorInput, Setpoint, SlaveState, n_actuators,
};
use krait_model::Snake;
use krait_model::segments::{Bends, MAX_BENDS, Segments};
use krait_report::Lanes;
use nalgebra::{Rotation3, SMatrix, SVector, Vector2, Vector3, Vector6};

/// Where a machine stands: a snake's bend vector and the jaw of its gripper (`JAW_PLACE`), the bend vectors of all segments, or the
/// positions of joints, rad (m of sliding joints); zeros behind the last.
pub type MachinePose = SVector<f64, MAX_JOINTS>;

/// The jaw of a gripper in a snake's pose.
const JAW_PLACE: usize = 2;
/// Nearer to where it shall be than this a jaw is let go of by its button, rad: it comes to rest within as much.
const JAW_NEAR_RAD: f64 = 0.02;

/// Directions in which no axis moves the joints have smaller singular values than this, as a part of the largest.
const NO_AXIS: f64 = 1e-9;

/// What a replay must know of a machine to bring it to where the score begins.
#[derive(Clone, Debug)]
pub enum Steering {
    /// A snake: the hand's linear velocity moves its tip.
    Snake {
        /// The kinematics.
        snake: Snake,
        /// From the base's frame to the operator's view.
        view_from_base: Rotation3<f64>,
        /// Whether it has a gripper; a trajectory leaves its jaw at zero.
        has_gripper: bool,
    },
    /// Joints: the hand's six velocities turn them by fixed rates.
    Joints {
        /// Velocities of the hand for velocities of the joints: the pseudo-inverse of their rates.
        hand_from_joints: SMatrix<f64, 6, MAX_JOINTS>,
        /// What stands for one radian where the joints slide, m; 1 where they turn.
        si_per_rad: f64,
        /// Whether their positions are lengths.
        slides: bool,
        /// How many there are.
        n: usize,
    },
    /// Segments in series: the hand's six velocities move their tip.
    Segments {
        /// The kinematics.
        machine: Box<Segments>,
        /// From the base's frame to the operator's view.
        view_from_base: Rotation3<f64>,
    },
}

impl Steering {
    /// A snake, and whether it has a gripper, that is seen with a roll of the view.
    pub fn snake(snake: Snake, has_gripper: bool, view_roll_rad: f64) -> Self {
        let view_from_base = Rotation3::from_axis_angle(&Vector3::z_axis(), view_roll_rad).inverse();
        Self::Snake { snake, view_from_base, has_gripper }
    }

    /// Segments that are seen with a roll of the view.
    pub fn segments(machine: Segments, view_roll_rad: f64) -> Self {
        let view_from_base = Rotation3::from_axis_angle(&Vector3::z_axis(), view_roll_rad).inverse();
        Self::Segments { machine: Box::new(machine), view_from_base }
    }

    /// `n` joints with the rates at which the hand's axes turn them, rad (m) each.
    pub fn joints(rates: &[[f64; 6]; MAX_JOINTS], n: usize, si_per_rad: f64, slides: bool) -> Self {
        let rates = SMatrix::<f64, MAX_JOINTS, 6>::from_fn(|joint, axis| rates[joint][axis]);
        let svd = rates.svd(true, true);
        let least = NO_AXIS * svd.singular_values.max();
        // Both bases were asked for, so there is an inverse; without any axis it is zero, and the way has no end.
        let hand_from_joints = svd.pseudo_inverse(least).unwrap_or_else(|_| SMatrix::zeros());
        Self::Joints { hand_from_joints, si_per_rad, slides, n }
    }

    /// The velocities of the hand, linear (m/s) and angular (rad/s), that change the pose at this rate.
    pub(crate) fn hand_velocity(&self, pose: &MachinePose, rate_per_s: &MachinePose) -> Vector6<f64> {
        match self {
            Self::Snake { snake, view_from_base, .. } => {
                let linear_rows = snake.j_x_bend(pose.fixed_rows::<2>(0).into_owned()).fixed_rows::<3>(0).into_owned();
                let tip = view_from_base * (linear_rows * rate_per_s.fixed_rows::<2>(0));
                Vector6::new(tip.x, tip.y, tip.z, 0.0, 0.0, 0.0)
            }
            Self::Joints { hand_from_joints, .. } => hand_from_joints * rate_per_s,
            Self::Segments { machine, view_from_base } => {
                let (_, j) = machine.tip(&bends_of(pose));
                let twist = j * bends_of(rate_per_s);
                let (linear, angular) = (twist.fixed_rows::<3>(0).into_owned(), twist.fixed_rows::<3>(3).into_owned());
                let (v, w) = (view_from_base * linear, view_from_base * angular);
                Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
            }
        }
    }

    /// The way of a jaw taken out of a pose's way, and the flags of a hand that holds the button for it.
    pub(crate) fn jaw_taken_from(&self, way: &mut MachinePose) -> u32 {
        let Self::Snake { has_gripper: true, .. } = self else { return 0 };
        let jaw_rad = core::mem::replace(&mut way[JAW_PLACE], 0.0);
        match jaw_rad.abs() > JAW_NEAR_RAD {
            true if jaw_rad > 0.0 => OperatorInput::JAW_OPENS,
            true => OperatorInput::JAW_CLOSES,
            false => 0,
        }
    }

    /// What stands in a message's places for joints at a pose, or for a rate of it.
    pub(crate) fn joint_values(&self, pose: &MachinePose) -> JointValues {
        let mut values = [0.0; MAX_JOINTS];
        match self {
            Self::Snake { has_gripper, .. } => values[JAW] = if *has_gripper { pose[JAW_PLACE] } else { 0.0 },
            Self::Joints { .. } | Self::Segments { .. } => values = (*pose).into(),
        }
        values
    }

    /// What stands for one radian in the machine's poses.
    pub(crate) fn si_per_rad(&self) -> f64 {
        match self {
            Self::Snake { .. } | Self::Segments { .. } => 1.0,
            Self::Joints { si_per_rad, .. } => *si_per_rad,
        }
    }

    /// How many joints there are, or twice the number of segments; 0 for a snake.
    pub(crate) fn n_joints(&self) -> u32 {
        match self {
            Self::Snake { .. } => 0,
            Self::Joints { n, .. } => *n as u32,
            Self::Segments { machine, .. } => machine.n_bends() as u32,
        }
    }

    /// How many actuators a setpoint says that there are, and a command after it; 0 is the three lines of a snake.
    pub(crate) fn n_actuators(&self) -> u32 {
        match self {
            Self::Snake { has_gripper: true, .. } => N_WITH_GRIPPER as u32,
            Self::Snake { .. } => 0,
            Self::Joints { n, .. } => *n as u32,
            Self::Segments { machine, .. } => machine.n_lines() as u32,
        }
    }

    /// Actuators of a command.
    pub fn n_commanded(&self) -> usize {
        n_actuators(self.n_actuators())
    }

    /// The tip of a snake or of segments at a pose, m; NaN for joints.
    pub(crate) fn tip_pos_in_base_m(&self, pose: &MachinePose) -> [f64; 3] {
        match self {
            Self::Snake { snake, .. } => snake.tip_pos_in_base_m(Vector2::new(pose[0], pose[1])).into(),
            Self::Joints { .. } => [f64::NAN; 3],
            Self::Segments { machine, .. } => machine.tip_pos_in_base_m(&bends_of(pose)).into(),
        }
    }

    /// What the places of poses are; a snake's are shown as one joint's that turns.
    pub fn lanes(&self) -> Lanes {
        match self {
            Self::Segments { .. } => Lanes::Segments,
            Self::Joints { slides, .. } => Lanes::of_joints(*slides),
            Self::Snake { .. } => Lanes::Turning,
        }
    }

    /// A pose in words, with its unit.
    pub(crate) fn words(&self, pose: &MachinePose) -> String {
        let (what, n) = match self {
            Self::Snake { .. } => ("a bend vector of", 2),
            Self::Joints { n, .. } => ("joints at", *n),
            Self::Segments { machine, .. } => ("bend vectors of", machine.n_bends()),
        };
        let (unit, per_si) = self.unit();
        let values: Vec<f64> = pose.iter().take(n).map(|value| value * per_si).collect();
        format!("{what} {values:.2?} {unit}")
    }

    /// A distance between two poses in words, with its unit.
    pub(crate) fn distance_words(&self, distance: f64) -> String {
        let (unit, per_si) = self.unit();
        format!("{:.2} {unit}", distance * per_si)
    }

    /// The unit in which poses are shown, and how many of it are one of SI.
    pub fn unit(&self) -> (&'static str, f64) {
        self.lanes().unit()
    }
}

/// The bends of segments at a pose.
fn bends_of(pose: &MachinePose) -> Bends {
    const _: () = assert!(MAX_BENDS <= MAX_JOINTS);
    Bends::from_fn(|k, _| pose[k])
}

/// A snake's bend vector as a pose.
pub(crate) fn pose_of_bend(bend_rad: [f64; 2]) -> MachinePose {
    let mut pose = MachinePose::zeros();
    (pose[0], pose[1]) = (bend_rad[0], bend_rad[1]);
    pose
}

/// The pose of a setpoint.
pub(crate) fn pose_of_setpoint(setpoint: &Setpoint) -> MachinePose {
    if setpoint.n_joints > 0 {
        return MachinePose::from(setpoint.joints_rad);
    }
    let mut pose = pose_of_bend(setpoint.bend_rad);
    pose[JAW_PLACE] = setpoint.jaw_rad().unwrap_or(0.0);
    pose
}

/// The pose that the slave took last; its bend vector is NaN where it drives joints, which begin at their zero.
pub(crate) fn pose_of_state(state: &SlaveState) -> MachinePose {
    if state.setpoint_bend_rad.iter().any(|bend| bend.is_nan()) {
        return MachinePose::from(state.setpoint_joints_rad);
    }
    let mut pose = pose_of_bend(state.setpoint_bend_rad);
    // Zero where there is no gripper.
    pose[JAW_PLACE] = state.setpoint_joints_rad[JAW];
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hand_s_velocities_turn_the_joints_as_wanted_where_the_axes_can() {
        let mut rates = [[0.0; 6]; MAX_JOINTS];
        (rates[0], rates[1]) = ([25.0, 5.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
        let steering = Steering::joints(&rates, 2, 1.0, false);
        let mut wanted = MachinePose::zeros();
        (wanted[0], wanted[1]) = (0.3, -0.1);
        let hand = steering.hand_velocity(&MachinePose::zeros(), &wanted);
        let turned = |joint: usize| -> f64 { rates[joint].iter().zip(hand.iter()).map(|(rate, v)| rate * v).sum() };
        assert!((turned(0) - 0.3).abs() < 1e-12 && (turned(1) + 0.1).abs() < 1e-12, "{hand}");
        let none = Steering::joints(&[[0.0; 6]; MAX_JOINTS], 2, 1.0, false);
        assert_eq!(none.hand_velocity(&MachinePose::zeros(), &wanted), Vector6::zeros());
    }

    #[test]
    fn a_pose_is_said_in_the_machine_s_own_unit() {
        let mut pose = MachinePose::zeros();
        (pose[0], pose[1]) = (1e-3, 2e-3);
        let slides = Steering::joints(&[[0.0; 6]; MAX_JOINTS], 2, 0.005, true);
        assert_eq!(slides.words(&pose), "joints at [1.00, 2.00] mm");
        assert_eq!(slides.distance_words(1e-4), "0.10 mm");
    }
}
