//! From what the model asks of the actuators to what they are told: eased in, within stroke, rate and load.
//!
//! where: `offset` is the difference between the slave's own setpoint and what the model asks for. While the slave does not
//! follow, it is taken anew at every sample, so that the command equals the slave's setpoint; then it is let go.

use crate::config::CompensateConfig;
use krait_ipc::message::{GRIPPER_WIRE, SlaveState};
use krait_ipc::{Reason, Reasons};
use nalgebra::SVector;

/// An offset smaller than this has been eased out, m.
const EASED_M: f64 = 1e-9;

/// What one command leaves to the next, for N actuators.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach<const N: usize> {
    /// Place of its first actuator.
    first: usize,
    /// The slave's word that these actuators follow.
    following: u32,
    offset_m: SVector<f64, N>,
    command_m: Option<SVector<f64, N>>,
    load_n: f64,
}

impl<const N: usize> Default for Reach<N> {
    fn default() -> Self {
        let following = SlaveState::FOLLOWING;
        Self { first: 0, following, offset_m: SVector::zeros(), command_m: None, load_n: 0.0 }
    }
}

impl Reach<1> {
    /// For the actuator behind a snake's lines, which stands alone.
    pub(crate) fn behind_lines() -> Self {
        Self { first: GRIPPER_WIRE, following: SlaveState::JAW_FOLLOWING, ..Self::default() }
    }
}

/// What one command rests on.
pub(crate) struct Wish<'a, const N: usize> {
    /// What the model asks for, m.
    pub raw_m: SVector<f64, N>,
    /// The largest load by the model, N; 0 where it has none.
    pub load_n: f64,
    /// The newest slave state.
    pub state: Option<&'a SlaveState>,
    /// Whether setpoint and state are young enough; otherwise the command before is repeated.
    pub is_fresh: bool,
    /// Time since the sample before, s.
    pub step_s: f64,
}

impl<const N: usize> Reach<N> {
    /// The command for a wish, m.
    pub(crate) fn command(
        &mut self,
        wish: &Wish<'_, N>,
        config: &CompensateConfig,
        reasons: &mut Reasons,
    ) -> SVector<f64, N> {
        let wanted_m = wish.raw_m + self.offset_for(wish, config, reasons);
        let command_m = if wish.is_fresh { self.limited(wanted_m, wish, config, reasons) } else { self.held(wanted_m) };
        (self.command_m, self.load_n) = (Some(command_m), wish.load_n);
        command_m
    }

    /// The offset that makes the first command equal the slave's setpoint, and then fades.
    fn offset_for(&mut self, wish: &Wish<'_, N>, config: &CompensateConfig, reasons: &mut Reasons) -> SVector<f64, N> {
        let Some(state) = wish.state else { return self.offset_m };
        if state.flags & self.following == 0 {
            self.offset_m = SVector::from_fn(|i, _| state.setpoint_q_m[self.first + i]) - wish.raw_m;
            self.command_m = None;
        } else {
            let distance_m = self.offset_m.norm();
            let left_m = (distance_m - config.ease_m_per_s * wish.step_s).max(0.0);
            self.offset_m = if distance_m > EASED_M { self.offset_m * (left_m / distance_m) } else { SVector::zeros() };
        }
        reasons.insert_if(Reason::EasingIn, self.offset_m.norm() > EASED_M);
        self.offset_m
    }

    /// The command within stroke, rate and load; one common scale keeps the direction of the step.
    fn limited(
        &self,
        wanted_m: SVector<f64, N>,
        wish: &Wish<'_, N>,
        config: &CompensateConfig,
        reasons: &mut Reasons,
    ) -> SVector<f64, N> {
        let Some(before_m) = self.command_m else { return wanted_m };
        let mut step_m = wanted_m - before_m;
        let largest_m = config.max_rate_m_per_s * wish.step_s;
        if step_m.amax() > largest_m {
            step_m *= largest_m / step_m.amax();
            reasons.insert(Reason::ActuatorRateLimit);
        }
        if wish.load_n > config.max_load_n && wish.load_n > self.load_n {
            reasons.insert(Reason::ForceLimit);
            return before_m;
        }
        let next_m = before_m + step_m;
        if next_m.amax() > config.max_stroke_m && next_m.amax() > before_m.amax() {
            reasons.insert(Reason::StrokeLimit);
            return before_m;
        }
        next_m
    }

    fn held(&self, otherwise_m: SVector<f64, N>) -> SVector<f64, N> {
        self.command_m.unwrap_or(otherwise_m)
    }
}
