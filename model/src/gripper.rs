//! A gripper at the end of a snake: one more cable-driven joint, whose wire runs through the central tube.
//!
//! Problem: what must the jaw's wire do for a wanted angle of the jaw?
//!
//! Intuition: the primary backbone keeps its length L at every bend, and the wire lies in its middle, so the wire's path keeps its
//! length too: to first order no bend moves the jaw and the jaw bends nothing. The wire's command is then the joint's own,
//! u = wire y, with the effects of [`crate::joints`], whatever the snake does.
//!
//! where: this is an assumption about the geometry (the parts are those of Fig. 2 of the paper, which gives no dimensions, drive or
//! travel of a gripper); friction of the wire that grows with the bend is not in it.

use crate::joints::{JointChain, JointImplausible, JointInverseSettings};
use crate::parameters::in_range;
use crate::{ChainError, EffectSetting, KnownColumns};

/// The numbers of a gripper, as a model file has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GripperNumbers {
    /// Metres of wire for one radian of the jaw, above zero: pushed it opens, pulled it closes.
    pub wire_m_per_rad: f64,
    /// The jaw closed and open, deg; the drive's zero is the jaw at 0.
    pub range_deg: [f64; 2],
    /// Fastest motion of the jaw, deg/s.
    pub max_vel_deg_per_s: f64,
}

/// A gripper with the effects of its wire, checked.
#[derive(Clone, Debug)]
pub struct Gripper {
    numbers: GripperNumbers,
    effects: Vec<EffectSetting>,
    chain: JointChain,
}

/// Two grippers are the same whose numbers and effects are.
impl PartialEq for Gripper {
    fn eq(&self, other: &Self) -> bool {
        (self.numbers, &self.effects) == (other.numbers, &other.effects)
    }
}

impl Gripper {
    /// Checks the numbers and the effects, which are those of joints.
    ///
    /// # Errors
    /// [`ChainError`]: a number out of its range, an effect that is not a joint's or not to be undone, one that shall be learnt.
    pub fn new(numbers: GripperNumbers, effects: &[EffectSetting]) -> Result<Self, ChainError> {
        let GripperNumbers { wire_m_per_rad, range_deg: [closed_deg, open_deg], max_vel_deg_per_s } = numbers;
        in_range("wire_m_per_rad", wire_m_per_rad, 1e-4, 0.02, "m/rad")?;
        in_range("range_deg", closed_deg, -180.0, 0.0, "deg")?;
        in_range("range_deg", open_deg, (closed_deg + 1.0).max(0.0), 180.0, "deg")?;
        in_range("max_vel_deg_per_s", max_vel_deg_per_s, 1.0, 720.0, "deg/s")?;
        // A chain that runs has the time and nothing else besides.
        let columns = KnownColumns { time: true, ..KnownColumns::default() };
        let chain = JointChain::new(&numbers.joints(), effects, columns)?;
        if let Some(learnt) = chain.learnt().first() {
            let (effect, key) = learnt.name.split_once('.').unwrap_or((&learnt.name, ""));
            let (effect, key) = (effect.to_owned(), key.to_owned());
            return Err(ChainError::NotLearnt { effect, key, reason: "of the gripper's wire" });
        }
        chain.compensator(JointInverseSettings::default())?;
        Ok(Self { numbers, effects: effects.to_vec(), chain })
    }

    /// The numbers.
    pub fn numbers(&self) -> &GripperNumbers {
        &self.numbers
    }

    /// The effects of the wire, in order.
    pub fn effects(&self) -> &[EffectSetting] {
        &self.effects
    }

    /// The jaw as a chain of one joint: commands in m of wire, positions in rad.
    pub fn chain(&self) -> &JointChain {
        &self.chain
    }

    /// The jaw closed and open, rad.
    pub fn range_rad(&self) -> [f64; 2] {
        self.numbers.range_deg.map(f64::to_radians)
    }

    /// The longest way of the wire from its zero without effects, m.
    pub fn travel_m(&self) -> f64 {
        self.range_rad().into_iter().fold(0.0_f64, |most, rad| most.max(rad.abs())) * self.numbers.wire_m_per_rad
    }

    /// Whether it may be steered over its whole range, as for joints.
    ///
    /// # Errors
    /// Inside, [`JointImplausible`] with the place and the numbers; outside, what building would have met.
    pub fn plausible(&self) -> Result<Result<(), JointImplausible>, ChainError> {
        let [closed_rad, open_rad] = self.range_rad();
        self.chain.plausible(&[closed_rad], &[open_rad])
    }
}
