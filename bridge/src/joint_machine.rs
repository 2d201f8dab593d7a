//! A model of joints together with the configuration for it: axes, limits and units, checked.

use crate::JointModel;
use crate::config::JointsConfig;
use crate::joints_error::JointsError;
use krait_ipc::message::{Actuators, JointValues, MAX_ACTUATORS, MAX_JOINTS};
use krait_model::ChainError;
use krait_model::joints::JointImplausible;

/// Joints that an operator drives.
#[derive(Clone, Debug)]
pub struct JointMachine {
    pub(crate) model: JointModel,
    pub(crate) rates: [[f64; 6]; MAX_JOINTS],
    pub(crate) low_rad: JointValues,
    pub(crate) high_rad: JointValues,
    pub(crate) margin_rad: f64,
    pub(crate) max_vel_rad_per_s: f64,
    pub(crate) max_accel_rad_per_s2: f64,
    /// Metres of cable in one unit of the model's commands.
    cable_m_per_u: f64,
    si_per_rad: f64,
}

/// Where joints may be by default, rad.
const LIMIT_RAD: f64 = 0.8;
/// Where sliding joints may be by default, m.
const LIMIT_M: f64 = 4e-3;
/// Default of a joint's rate for a velocity of the hand, rad/m: a lever of 40 mm.
const RATE_PER_M: f64 = 25.0;

impl JointMachine {
    /// Checks the configuration against the model.
    ///
    /// # Errors
    /// [`JointsError`] names the key and the joint.
    pub fn new(model: &JointModel, config: &JointsConfig) -> Result<Self, JointsError> {
        let (n, slides) = (model.n(), model.slides());
        let radius_m = config.capstan_radius_m;
        let per_joint = if slides { radius_m } else { 1.0 };
        let limit = if slides { LIMIT_M } else { LIMIT_RAD };
        let low_rad = limits("low_rad", &config.low_rad, n, -limit, slides)?;
        let high_rad = limits("high_rad", &config.high_rad, n, limit, slides)?;
        Ok(Self {
            rates: rates(&config.rates, n, per_joint)?,
            low_rad,
            high_rad,
            margin_rad: config.margin_rad * per_joint,
            max_vel_rad_per_s: config.max_vel_rad_per_s * per_joint,
            max_accel_rad_per_s2: config.max_accel_rad_per_s2 * per_joint,
            cable_m_per_u: model.u.si * if model.u.is_length { 1.0 } else { radius_m },
            si_per_rad: per_joint,
            model: model.clone(),
        })
    }

    /// Looks whether the model may steer the machine over the whole ranges of its joints.
    ///
    /// # Errors
    /// [`ChainError`] when it has no inverse at all; inside, [`JointImplausible`] with the place and the numbers.
    pub fn plausible(&self) -> Result<Result<(), JointImplausible>, ChainError> {
        let (low, high) = (self.of_model(&self.low_rad), self.of_model(&self.high_rad));
        let n = self.model.n();
        self.model.chain.plausible(&low[..n], &high[..n])
    }

    /// How many joints there are.
    pub fn n(&self) -> usize {
        self.model.n()
    }

    /// Whether positions of the joints are lengths.
    pub fn slides(&self) -> bool {
        self.model.slides()
    }

    /// Commands of the model as positions of the actuators, m.
    pub(crate) fn cable_m(&self, u: &[f64]) -> Actuators {
        let mut q_m = [0.0; MAX_ACTUATORS];
        q_m.iter_mut().zip(u).take(self.model.n()).for_each(|(q_m, u)| *q_m = u * self.cable_m_per_u);
        q_m
    }

    /// Positions of the actuators, m, as commands of the model; 0 behind the last.
    pub(crate) fn u_of_cable(&self, q_m: &Actuators) -> Actuators {
        q_m.map(|q_m| q_m / self.cable_m_per_u)
    }

    /// How many units of the model's commands a metre of cable is.
    pub(crate) fn u_per_cable_m(&self) -> f64 {
        1.0 / self.cable_m_per_u
    }

    /// How fast each joint goes for each axis of the hand (m/s three times, rad/s three times), rad (m of a sliding joint); zeros
    /// behind the last joint.
    pub fn rates(&self) -> &[[f64; 6]; MAX_JOINTS] {
        &self.rates
    }

    /// Where joints may be, rad (m of a sliding joint); zeros behind the last.
    pub fn range_rad(&self) -> [&JointValues; 2] {
        [&self.low_rad, &self.high_rad]
    }

    /// Fastest motion of a joint, rad/s (m/s of sliding joints).
    pub fn max_vel_per_s(&self) -> f64 {
        self.max_vel_rad_per_s
    }

    /// What stands for one radian where a number is given for angles: one, or the capstan's radius of sliding joints.
    pub fn si_per_rad(&self) -> f64 {
        self.si_per_rad
    }

    /// Positions or rates in SI as the model counts them; 0 behind the last joint.
    pub(crate) fn of_model(&self, si: &JointValues) -> JointValues {
        si.map(|si| si / self.model.y.si)
    }
}

fn limits(key: &'static str, given: &[f64], n: usize, usual: f64, slides: bool) -> Result<JointValues, JointsError> {
    // Zero, where the drives are homed, lies between a joint's limits.
    let (least, most) = (1e-6, if slides { 0.5 } else { 10.0 });
    let (low, high) = if usual < 0.0 { (-most, -least) } else { (least, most) };
    if !given.is_empty() && given.len() != n {
        return Err(JointsError::Length { key, found: given.len(), expected: n, hint: "; empty for the default" });
    }
    let mut all = [0.0; MAX_JOINTS];
    for (idx, own) in all.iter_mut().enumerate().take(n) {
        *own = given.get(idx).copied().unwrap_or(usual);
        // Written so that NaN is out of range.
        if !(low..=high).contains(own) {
            return Err(JointsError::OutOfRange { key, joint: idx + 1, low, high, found: *own });
        }
    }
    Ok(all)
}

fn rates(given: &[[f64; 6]], n: usize, per_joint: f64) -> Result<[[f64; 6]; MAX_JOINTS], JointsError> {
    let mut all = [[0.0; 6]; MAX_JOINTS];
    if given.is_empty() && n <= 6 {
        for (idx, row) in all.iter_mut().enumerate().take(n) {
            row[idx] = per_joint * if idx < 3 { RATE_PER_M } else { 1.0 };
        }
        return Ok(all);
    }
    if given.len() != n {
        let hint = if given.is_empty() { "; only up to 6 joints have axes by default" } else { "" };
        return Err(JointsError::Length { key: "rates", found: given.len(), expected: n, hint });
    }
    for (idx, (own, row)) in all.iter_mut().zip(given).enumerate() {
        *own = *row;
        if let Some(found) = row.iter().find(|rate| !(-1e4..=1e4).contains(*rate)) {
            let (joint, found) = (idx + 1, *found);
            return Err(JointsError::OutOfRange { key: "rates", joint, low: -1e4, high: 1e4, found });
        }
    }
    Ok(all)
}
