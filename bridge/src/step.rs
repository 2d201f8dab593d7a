//! What the stages between the operator and the actuators have in common: a step on a core, and how it refuses.

use crate::config::{CompensateConfig, ResolveConfig};
use crate::hop::{Arriving, Departing};
use krait_ipc::message::{
    DeviceState, Health, HopStamps, ModelUpdate, OperatingState, OperatorInput, Setpoint, SlaveState,
};
use krait_ipc::{IpcError, Reason, Reasons};
use krait_model::ModelHash;

/// A bridge process could not go on.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The chain of a model file cannot be built or inverted.
    #[error(transparent)]
    Chain(#[from] krait_model::ChainError),
    /// A model of joints that no chain can drive.
    #[error(transparent)]
    Joints(#[from] crate::JointsError),
    /// A model of which a number is not known yet.
    #[error(
        "{key} of {of} is not known, expected a number: a chain drives calibrated machines only; \
         `krait lab fit` finds it from a recording and writes a model file with it"
    )]
    Uncalibrated {
        /// The number's key.
        key: &'static str,
        /// What it is of: `[machine]` or an effect.
        of: String,
    },
    /// The watch for changes cannot be set up so.
    #[error(transparent)]
    Watch(#[from] krait_model::ParameterError),
    /// A replay sent a sample and not what its steps depend on.
    #[error(
        "input {input_sequence} came without a cue, expected one before it; the replay that sends them has failed, so start it again"
    )]
    NoCue {
        /// The sample.
        input_sequence: u64,
    },
    /// A cue names a message that was never published.
    #[error(
        "a cue names message {sequence} of channel {channel:?}, found {found} there; the replay that sends them has failed, so start it again"
    )]
    NotThere {
        /// The channel.
        channel: &'static str,
        /// What is named.
        sequence: u64,
        /// What came in its place.
        found: u64,
    },
    /// A value of the configuration is out of range.
    #[error(transparent)]
    Config(#[from] krait_ipc::setting::SettingError),
}

/// A sample that was refused; nothing is published for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refused {
    /// Why.
    pub reason: Reason,
    /// The value that was out of bounds, in the reason's unit.
    pub found: f64,
    /// The bound.
    pub limit: f64,
}

/// What one sample's step needs besides the sample, and what it makes of it: the core of a stage between two channels.
///
/// Who feeds it decides what the core is told: [`crate::live`] the newest there is, [`crate::cued`] what a cue names.
pub(crate) trait Step {
    /// What wakes the stage.
    type In: Arriving;
    /// What it publishes.
    type Out: Departing;
    /// Whether it takes model updates; else it is told of none.
    const TAKES_UPDATES: bool;

    /// Notes the newest slave state; it counts from the next step on.
    fn note_state(&mut self, state: &SlaveState);
    /// Notes a model update; it counts from the next step on.
    fn note_update(&mut self, _update: &ModelUpdate) -> Result<(), Refused> {
        Ok(())
    }
    /// One step. Allocates nothing, reads no clock.
    fn step(&mut self, input: &Self::In, begun_ns: i64) -> Result<Self::Out, Refused>;
    /// Says into the health, for people, by how much the limits are broken that the reasons of a step are about.
    fn tell(&self, input: &Self::In, begun_ns: i64, reasons: Reasons, health: &mut Health);
    /// Does what a step would do, and forgets it: the next step then finds at hand what it needs. Changes nothing, allocates
    /// nothing.
    fn warm_up(&mut self, input: &Self::In, now_ns: i64);
}

/// Time since the sample before, s, by the samples' own stamps: at most [`MAX_STEP_S`], so that a gap never becomes a jump.
pub(crate) fn step_s(before_ns: Option<i64>, now_ns: i64) -> f64 {
    let Some(before_ns) = before_ns else { return 0.0 };
    (seconds_between(before_ns, now_ns)).clamp(0.0, MAX_STEP_S)
}

/// Longest time that one sample may stand for, s.
pub(crate) const MAX_STEP_S: f64 = 10e-3;

/// Seconds from one stamp to another.
pub(crate) fn seconds_between(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// Refuses a message that rests on another model than this process.
pub(crate) fn check_model(own: ModelHash, model_hash: u64) -> Result<(), Refused> {
    if model_hash == own.0 {
        return Ok(());
    }
    // Two models, where one is allowed: the hashes themselves are no measure of anything.
    Err(Refused { reason: Reason::OtherModel, found: 2.0, limit: 1.0 })
}

/// Refuses a sample whose numbers are not finite or whose stamp does not follow the one before.
pub(crate) fn check_order_and_numbers(before_ns: Option<i64>, sample_ns: i64, numbers: &[f64]) -> Result<(), Refused> {
    if let Some(found) = numbers.iter().copied().find(|n| !n.is_finite()) {
        return Err(Refused { reason: Reason::NotFinite, found, limit: f64::MAX });
    }
    match before_ns {
        Some(before_ns) if sample_ns <= before_ns => {
            Err(Refused { reason: Reason::OutOfOrder, found: seconds_between(before_ns, sample_ns), limit: 0.0 })
        }
        _ => Ok(()),
    }
}

/// Fastest hand that a message may tell of, m/s and rad/s; anything beyond is none.
pub(crate) const MAX_TIP_VEL_M_PER_S: f64 = 1.0;
const MAX_ANGULAR_VEL_RAD_PER_S: f64 = 50.0;

/// The hand's six axes in the view, m/s and rad/s, or a refusal as of [`check_order_and_numbers`] or where it is no hand's.
pub(crate) fn check_hand(before_ns: Option<i64>, input: &OperatorInput) -> Result<[f64; 6], Refused> {
    let [x, y, z] = input.tip_vel_in_view_m_per_s;
    let [rx, ry, rz] = input.tip_angular_vel_in_view_rad_per_s;
    let axes = [x, y, z, rx, ry, rz];
    check_order_and_numbers(before_ns, input.sample_ns, &axes)?;
    let limits = [MAX_TIP_VEL_M_PER_S; 3].into_iter().chain([MAX_ANGULAR_VEL_RAD_PER_S; 3]);
    match axes.iter().map(|v| v.abs()).zip(limits).find(|(found, limit)| found > limit) {
        Some((found, limit)) => Err(Refused { reason: Reason::OutOfRange, found, limit }),
        None => Ok(axes),
    }
}

/// Refuses a setpoint of another number of joints, or of bends, than the machine has; else as [`check_order_and_numbers`].
pub(crate) fn check_joints(before_ns: Option<i64>, setpoint: &Setpoint, n: usize) -> Result<(), Refused> {
    if setpoint.n_joints as usize != n {
        return Err(Refused { reason: Reason::OutOfRange, found: f64::from(setpoint.n_joints), limit: n as f64 });
    }
    check_order_and_numbers(before_ns, setpoint.sample_ns, &setpoint.joints_rad)
}

/// The stamps of a step's output: those of its input, and when this stage had it in hand.
pub(crate) fn stamps_begun(input: &HopStamps, enter: impl FnOnce(&mut HopStamps)) -> HopStamps {
    let mut stamps = *input;
    enter(&mut stamps);
    stamps
}

/// Why a setpoint shall stand still: what the operator and the slave say, and how old it is.
pub(crate) fn reasons_to_hold(
    config: &ResolveConfig,
    state: Option<&SlaveState>,
    input: &OperatorInput,
    begun_ns: i64,
) -> Reasons {
    let mut reasons = Reasons::NONE;
    reasons.insert_if(Reason::OperatorAbsent, !input.operator_present());
    reasons.insert_if(Reason::Clutched, input.clutch_pressed());
    let device = input.device();
    reasons.insert_if(Reason::DeviceLost, matches!(device, Some(DeviceState::Lost) | None));
    reasons.insert_if(Reason::InputEnded, device == Some(DeviceState::Ended));
    reasons.insert_if(Reason::HandJumped, input.flags & OperatorInput::HAND_JUMPED != 0);
    let input_age_ms = seconds_between(input.sample_ns, begun_ns) * 1e3;
    reasons.insert_if(Reason::InputStale, input_age_ms > config.input_stale_ms);
    match state {
        None => reasons.insert(Reason::StateStale),
        Some(state) => {
            let state_age_ms = seconds_between(state.sample_ns, begun_ns) * 1e3;
            reasons.insert_if(Reason::StateStale, state_age_ms > config.state_stale_ms);
            reasons.insert_if(Reason::NotEngaged, !state.is_engaged());
            reasons.insert_if(Reason::SlaveNotHomed, state.flags & SlaveState::IS_HOMED == 0);
            reasons.insert_if(Reason::SlaveNotEnabled, state.operating() != Some(OperatingState::Enabled));
        }
    }
    reasons
}

/// Whether a setpoint is young enough to be followed; also names a slave state that is too old.
pub(crate) fn check_age(
    config: &CompensateConfig,
    state: Option<&SlaveState>,
    setpoint: &Setpoint,
    begun_ns: i64,
    reasons: &mut Reasons,
) -> bool {
    let setpoint_age_ms = seconds_between(setpoint.sample_ns, begun_ns) * 1e3;
    let stale = setpoint_age_ms > config.setpoint_stale_ms;
    reasons.insert_if(Reason::SetpointStale, stale);
    let state_stale =
        state.is_none_or(|state| seconds_between(state.sample_ns, begun_ns) * 1e3 > config.state_stale_ms);
    reasons.insert_if(Reason::StateStale, state_stale);
    !stale && !state_stale
}

/// Notes how old input and state are that `resolve` finds too old; see [`reasons_to_hold`].
pub(crate) fn tell_resolve_ages(
    config: &ResolveConfig,
    state: Option<&SlaveState>,
    input: &OperatorInput,
    begun_ns: i64,
    reasons: Reasons,
    health: &mut Health,
) {
    let input = (Reason::InputStale, Some(input.sample_ns), config.input_stale_ms);
    let state = (Reason::StateStale, state.map(|state| state.sample_ns), config.state_stale_ms);
    tell_ages([input, state], begun_ns, reasons, health);
}

/// Notes how old setpoint and state are that `compensate` finds too old; see [`check_age`].
pub(crate) fn tell_compensate_ages(
    config: &CompensateConfig,
    state: Option<&SlaveState>,
    setpoint: &Setpoint,
    begun_ns: i64,
    reasons: Reasons,
    health: &mut Health,
) {
    let setpoint = (Reason::SetpointStale, Some(setpoint.sample_ns), config.setpoint_stale_ms);
    let state = (Reason::StateStale, state.map(|state| state.sample_ns), config.state_stale_ms);
    tell_ages([setpoint, state], begun_ns, reasons, health);
}

/// Notes the ages, ms, of what is too old beside their limits.
fn tell_ages(ages: [(Reason, Option<i64>, f64); 2], begun_ns: i64, reasons: Reasons, health: &mut Health) {
    for (reason, sample_ns, limit_ms) in ages {
        if let Some(sample_ns) = sample_ns.filter(|_| reasons.contains(reason)) {
            health.note(reason, seconds_between(sample_ns, begun_ns) * 1e3, limit_ms);
        }
    }
}
