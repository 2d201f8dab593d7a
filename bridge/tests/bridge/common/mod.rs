//! Samples as the other processes would send them.

#![allow(dead_code, reason = "each test file uses its own part")]

pub mod segments;

use krait_bridge::{CompensateConfig, CompensateCore, ResolveConfig, ResolveCore};
use krait_ipc::message::{
    DeviceState, HopStamps, LearntValue, MAX_LEARNT, ModelUpdate, OperatingState, OperatorInput, Phase, Setpoint,
    SlaveState,
};
use krait_model::model_file::{ModelFile, built_in};
use krait_model::{Chain, KnownColumns};

/// One sample at 1 kHz, ns.
pub const TICK_NS: i64 = 1_000_000;
/// An instant from which tests count, ns.
pub const T0_NS: i64 = 5_000_000_000;

/// The operator's input number `sequence` (from 1), one per millisecond, with a tip velocity in the view frame.
pub fn input(sequence: u64, tip_vel_in_view_m_per_s: [f64; 3]) -> OperatorInput {
    OperatorInput {
        sequence,
        sample_ns: T0_NS + sequence as i64 * TICK_NS,
        stamps: HopStamps::default(),
        tip_vel_in_view_m_per_s,
        tip_angular_vel_in_view_rad_per_s: [0.0; 3],
        raw_axes: [0; 6],
        flags: OperatorInput::OPERATOR_PRESENT,
        buttons: 0,
        device_state: DeviceState::Live as u32,
        scale_permille: 1000,
        n_reports: sequence,
        n_drained: 0,
        n_refused: 0,
    }
}

/// The chain of a built-in model.
pub fn chain(name: &str) -> Chain {
    chain_of(built_in(name).expect("one of the built-in models"))
}

/// The chain of a model file's text.
pub fn chain_of(text: &str) -> Chain {
    ModelFile::parse(text).expect("a model file").chain(KnownColumns::default()).expect("a chain").expect("of a snake")
}

/// An update of a model with values for the parameters that it learns.
pub fn update_of(chain: &Chain, sequence: u64, values: &[f64]) -> ModelUpdate {
    let mut learnt = [LearntValue::default(); MAX_LEARNT];
    for ((slot, own), value) in learnt.iter_mut().zip(chain.learnt()).zip(values) {
        let (effect, parameter) = (own.effect as u16, own.parameter as u16);
        *slot = LearntValue { value: *value, sd: 0.01 * own.learn.sd, effect, parameter, state: 1, tied_to: 0 };
    }
    ModelUpdate {
        sequence,
        sample_ns: T0_NS + sequence as i64 * TICK_NS,
        shape_sequence: sequence,
        state_sequence: sequence,
        n_states: sequence,
        model_hash: chain.hash().0,
        innovation_rms_rad: 0.005,
        n_used: 100,
        n_left_out: 0,
        n_changes: 0,
        changed_ns: 0,
        change_kind: 0,
        is_watching: 0,
        n_learnt: values.len() as u32,
        changed_segment: 0,
        learnt,
    }
}

/// A setpoint as `resolve` would send it with the built-in model `estimated`.
pub fn setpoint(sequence: u64, bend_rad: [f64; 2]) -> Setpoint {
    setpoint_of(&chain("estimated"), sequence, bend_rad)
}

/// The same with a model.
pub fn setpoint_of(chain: &Chain, sequence: u64, bend_rad: [f64; 2]) -> Setpoint {
    Setpoint {
        sequence,
        sample_ns: T0_NS + sequence as i64 * TICK_NS,
        input_sequence: sequence,
        state_sequence: sequence,
        bend_rad,
        n_actuators: 3,
        tip_pos_in_base_m: [0.0, 0.0, 0.026],
        motion_scale: 1.0,
        model_hash: chain.hash().0,
        phase: Phase::Following as u32,
        ..Setpoint::default()
    }
}

/// A slave that is enabled, homed and follows, in the straight pose.
pub fn ready_state(sequence: u64) -> SlaveState {
    SlaveState {
        sequence,
        sample_ns: T0_NS + sequence as i64 * TICK_NS,
        stamps: HopStamps::default(),
        command_sequence: sequence,
        operating_state: OperatingState::Enabled as u32,
        flags: SlaveState::IS_HOMED | SlaveState::FOLLOWING | SlaveState::ENGAGED,
        setpoint_q_m: [0.0; 12],
        setpoint_bend_rad: [0.0; 2],
        setpoint_joints_rad: [0.0; 8],
        n_actuators: 3,
        n_joints: 0,
        measured_q_m: [0.0; 12],
        measured_tau_n: [0.0; 12],
        reasons: 0,
        n_commands: 0,
        n_refused: 0,
        ..SlaveState::default()
    }
}

/// A slave that is ready but follows nothing, with a setpoint of its own.
pub fn waiting_state(sequence: u64, setpoint_q_m: [f64; 3], setpoint_bend_rad: [f64; 2]) -> SlaveState {
    SlaveState {
        flags: SlaveState::IS_HOMED | SlaveState::ENGAGED,
        setpoint_q_m: krait_ipc::message::lines(setpoint_q_m),
        setpoint_bend_rad,
        ..ready_state(sequence)
    }
}

/// `resolve` with the built-in model `estimated`.
pub fn resolve(config: ResolveConfig) -> ResolveCore {
    ResolveCore::new(&chain("estimated"), config).expect("defaults")
}

/// `compensate` with the built-in model `estimated`.
pub fn compensate(config: CompensateConfig) -> CompensateCore {
    CompensateCore::new(&chain("estimated"), config).expect("defaults")
}

/// Length of a bend vector.
pub fn length(bend: [f64; 2]) -> f64 {
    bend[0].hypot(bend[1])
}
