//! What can be set about the bridge: every value with its unit, default, range and reason.

use krait_ipc::setting::{SettingError, check};
use krait_ipc::{WaitMode, settings};

settings! {
    /// `resolve`: limits of the operator's motion.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ResolveConfig in "resolve" {
        /// Largest bend, rad. 1.31 rad (75 deg) keeps the outer fibre of the tubes below 1.7 % strain; the model holds up to
        /// 90 deg.
        max_bend_rad: f64 = 75f64.to_radians(), 0.05..=core::f64::consts::FRAC_PI_2;
        /// The outward part of the motion fades out over this much bend before the limit, rad.
        bend_margin_rad: f64 = 4f64.to_radians(), 0.001..=0.5;
        /// Fastest bending, rad/s.
        max_bend_vel_rad_per_s: f64 = 2.0, 0.01..=10.0;
        /// Largest change of the bending rate, rad/s^2; every stop and start is at most this sharp.
        max_bend_accel_rad_per_s2: f64 = 40.0, 0.1..=1000.0;
        /// How much the axial component of the wanted tip velocity counts beside the lateral ones. 0: a hand that pushes
        /// sideways gets exactly that, and the tip sinks as its arc makes it; 1: least squares over all three components.
        axial_weight: f64 = 0.0, 0.0..=1.0;
        /// Damping of the least-squares inverse of the tip Jacobian, m/rad. More than the snake's length moves nothing.
        damping_m_per_rad: f64 = 0.5e-3, 0.0..=0.02;
        /// Of segments in series only: how much turning the tip counts beside moving it, m/rad. 1 mm: where the segments cannot do
        /// both they move it, and where they can a hand that turns turns it.
        turn_m_per_rad: f64 = 1e-3, 0.0..=0.1;
        /// Roll of the camera's view about the snake's straight axis, rad: `base_from_view` = Rz(view_roll_rad).
        view_roll_rad: f64 = 0.0, -3.2..=3.2;
        /// An operator input older than this when it is taken is not followed, ms.
        input_stale_ms: f64 = 50.0, 1.0..=1000.0;
        /// A slave state older than this is not trusted, ms.
        state_stale_ms: f64 = 100.0, 1.0..=1000.0;
        /// How the process waits for operator input.
        wait: WaitMode = WaitMode::Ahead;
    }
}

settings! {
    /// `compensate`: the limits of the actuator command.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct CompensateConfig in "compensate" {
        /// Fastest change of a learnt value while an update is blended in, prior standard deviations per second.
        blend_sds_per_s: f64 = 0.6, 1e-3..=10.0;
        /// Speed at which a difference to the slave's setpoint is eased out at engagement, m/s.
        ease_m_per_s: f64 = 1e-3, 1e-5..=20e-3;
        /// Actuator stroke, m: |q~| at most. A bend of 80 deg needs 4.98 mm on the default machine.
        max_stroke_m: f64 = 5.2e-3, 0.1e-3..=20e-3;
        /// Actuator rate, m/s.
        max_rate_m_per_s: f64 = 20e-3, 0.1e-3..=0.2;
        /// Load of a line by the model, N: |tau| at most. A bend of 80 deg needs 48 N on the default machine; a line buckles
        /// or yields beyond its own limit.
        max_load_n: f64 = 55.0, 1.0..=200.0;
        /// A setpoint older than this when it is taken is not followed, ms.
        setpoint_stale_ms: f64 = 50.0, 1.0..=1000.0;
        /// A slave state older than this is not trusted, ms.
        state_stale_ms: f64 = 100.0, 1.0..=1000.0;
        /// Error of the measured shape that is the measurement's own, rad, where the model file states none. 0.3 deg: the
        /// simulated camera's.
        mismatch_floor_rad: f64 = 0.3f64.to_radians(), 1e-5..=0.2;
        /// What the model does not explain of the shape, in floors (root mean square along an axis, over half a second of
        /// motion), beyond which a warning says so.
        mismatch_warn_floors: f64 = 12.0, 1.0..=1e6;
        /// The same, beyond which the motion ends until the chain is started anew. 40: 12 deg, more than a model that has yet to
        /// learn leaves.
        mismatch_trip_floors: f64 = 40.0, 1.0..=1e6;
        /// For so long it must be beyond the second limit, s: a glitch of the camera ends nothing.
        mismatch_trip_after_s: f64 = 0.5, 0.0..=60.0;
        /// Both limits for a model that learns nothing and states no floor, like `off` and `naive`: it is there to show its error.
        /// 200: 60 deg, which only a machine that does something else altogether leaves.
        mismatch_wide_floors: f64 = 200.0, 1.0..=1e6;
        /// How the process waits for setpoints.
        wait: WaitMode = WaitMode::Ahead;
    }
}

settings! {
    /// `estimate`: what it assumes of the measurements.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct EstimateConfig in "estimate" {
        /// Standard deviation of each axis of the measured bend vector, or of each measured joint (sliding: times the
        /// capstan's radius), rad, where the camera states none.
        sigma_bend_rad: f64 = 0.3f64.to_radians(), 1e-5..=0.2;
        /// Largest distance of a measurement from its prediction, standard deviations; fewer would refuse good ones.
        outlier_sigmas: f64 = 6.0, 2.0..=100.0;
        /// A shape whose encoders are further away in time than this is left out, ms.
        max_state_gap_ms: f64 = 5.0, 0.1..=100.0;
        /// How often "something has changed" may be said per hour of motion though nothing has, 1/h. Rarer means later.
        false_alarms_per_hour: f64 = 1.0, 1e-4..=1e3;
        /// Motion from which is learnt how well the model explains the camera before a change can be seen, s.
        learn_s: f64 = 30.0, 2.0..=600.0;
    }
}

settings! {
    /// `resolve` and `compensate` with a model of joints: how the operator's hand moves them, and how far.
    #[derive(Clone, Debug, PartialEq)]
    pub struct JointsConfig in "joints" {
        /// Rate of each joint for each axis of the operator: one row for each joint of the model, with six numbers: for the tip
        /// velocity x, y, z in the view frame, rad/s per m/s, and for the angular velocity x, y, z, 1. Of a sliding joint m
        /// for rad. Empty: joints 1 to 3 follow x, y, z by 25 rad/m, and 4 to 6 the angular velocity by 1.
        rates: Vec<[f64; 6]> = Vec::new();
        /// Smallest position of each joint, rad, or m of a sliding joint. Empty: -0.8 rad, or -4 mm.
        low_rad: Vec<f64> = Vec::new();
        /// Largest position of each joint, rad, or m of a sliding joint. Empty: 0.8 rad, or 4 mm.
        high_rad: Vec<f64> = Vec::new();
        /// Metres of cable for one radian of the model's commands; commands that are lengths of cable need none.
        capstan_radius_m: f64 = 5e-3, 5e-4..=0.1;
        /// The motion towards a joint's limit fades out over this much, rad; of a sliding joint times capstan_radius_m.
        margin_rad: f64 = 4f64.to_radians(), 0.001..=0.5;
        /// Fastest joint, rad/s; of a sliding joint times capstan_radius_m.
        max_vel_rad_per_s: f64 = 2.0, 0.01..=20.0;
        /// Largest change of a joint's rate, rad/s^2; of a sliding joint times capstan_radius_m.
        max_accel_rad_per_s2: f64 = 40.0, 0.1..=2000.0;
    }
}

settings! {
    /// `resolve` with a snake that has a gripper: how the operator's hand moves the jaw.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct GripperConfig in "gripper" {
        /// Speed of the jaw while a button (`jaw_open`, `jaw_close` in [master]) asks for it, rad/s; never more than the model's
        /// `max_vel_deg_per_s`. 0.8: a jaw of 60 deg closes in 1.3 s.
        button_rad_per_s: f64 = 0.8, 0.01..=12.0;
        /// How far the jaw opens for each radian that the hand turns about x, y and z of the view, 1; -10 to 10 each. Zeros: turning,
        /// which a snake has no other use for, does not move it.
        open_per_turn: [f64; 3] = [0.0; 3];
        /// The motion towards an end of the jaw's range fades out over this much, rad.
        margin_rad: f64 = 3f64.to_radians(), 0.001..=0.5;
        /// Largest change of the jaw's rate, rad/s^2.
        max_accel_rad_per_s2: f64 = 20.0, 0.1..=2000.0;
    }
}

impl GripperConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        let range = (-10.0, 10.0);
        self.open_per_turn.iter().try_for_each(|part| check((Self::TABLE, "open_per_turn"), *part, range, 0.0))?;
        self.check_ranges()
    }
}

impl ResolveConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()
    }
}

impl CompensateConfig {
    /// Floors that no shape is away: 1e6 of the smallest are more than a turn.
    pub const NO_MISMATCH_FLOORS: f64 = 1e6;

    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()
    }
}

impl EstimateConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()
    }
}

impl JointsConfig {
    /// Checks every range that does not depend on the model; [`crate::JointMachine::new`] checks the rest.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_in_range() {
        ResolveConfig::default().check().expect("resolve");
        CompensateConfig::default().check().expect("compensate");
        EstimateConfig::default().check().expect("estimate");
        JointsConfig::default().check().expect("joints");
        GripperConfig::default().check().expect("gripper");
    }

    #[test]
    fn a_value_out_of_range_is_named_with_its_range() {
        let error = ResolveConfig { max_bend_rad: 60.0, ..ResolveConfig::default() }.check().expect_err("60 rad");
        assert!(error.to_string().starts_with("[resolve] max_bend_rad = 60: expected 0.05 to 1.57"), "{error}");
        let error = CompensateConfig { max_load_n: f64::NAN, ..CompensateConfig::default() }.check().expect_err("NaN");
        assert_eq!(error.key, "max_load_n");
        let error =
            GripperConfig { open_per_turn: [0.0, 11.0, 0.0], ..GripperConfig::default() }.check().expect_err("11");
        assert!(error.to_string().starts_with("[gripper] open_per_turn = 11: expected -10 to 10"), "{error}");
    }
}
