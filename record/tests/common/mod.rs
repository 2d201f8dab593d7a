//! What several tests need: every message as the bits of its fields, messages with meaning, and places for files.
#![allow(dead_code, clippy::expect_used, reason = "each test uses its own part; a panic is how a test fails")]

use krait_ipc::Process;
use krait_ipc::message::{
    ActuatorCycle, Command, DriveCycle, Health, HopStamps, LearntValue, MARKER_TEXT_MAX, MAX_ACTUATORS, MAX_LEARNT,
    Marker, ModelUpdate, N_REASONS_MAX, OperatorInput, ReasonRecord, Setpoint, Shape, SlaveState, StateCommand,
};
use krait_schema::{Channel, ChannelCounts, RecorderStatus, Sample};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// A value as 64-bit words, so that two messages can be compared bit for bit, NaN and -0.0 included.
pub trait Words: Sized {
    fn take(words: &mut dyn Iterator<Item = u64>) -> Self;
    fn put(&self, words: &mut Vec<u64>);
}

macro_rules! number {
    ($($type:ty: $from:expr, $into:expr;)*) => {$(
        impl Words for $type {
            fn take(words: &mut dyn Iterator<Item = u64>) -> Self {
                ($from)(words.next().expect("enough words"))
            }
            fn put(&self, words: &mut Vec<u64>) {
                words.push(($into)(*self));
            }
        }
    )*};
}

number! {
    u64: |w| w, |x| x;
    i64: |w: u64| w as i64, |x: i64| x as u64;
    u32: |w: u64| w as u32, u64::from;
    i32: |w: u64| w as i32, |x: i32| x as u64;
    i16: |w: u64| w as i16, |x: i16| x as u64;
    u16: |w: u64| w as u16, u64::from;
    u8: |w: u64| w as u8, u64::from;
    f64: f64::from_bits, f64::to_bits;
}

impl<T: Words, const N: usize> Words for [T; N] {
    fn take(words: &mut dyn Iterator<Item = u64>) -> Self {
        std::array::from_fn(|_| T::take(words))
    }
    fn put(&self, words: &mut Vec<u64>) {
        self.iter().for_each(|x| x.put(words));
    }
}

/// Names every field of a struct: one that is missing here does not compile.
macro_rules! fields {
    ($($type:ident { $($field:ident),* })*) => {$(
        impl Words for $type {
            fn take(words: &mut dyn Iterator<Item = u64>) -> Self {
                Self { $($field: Words::take(words)),* }
            }
            fn put(&self, words: &mut Vec<u64>) {
                let Self { $($field),* } = self;
                $($field.put(words);)*
            }
        }
    )*};
}

fields! {
    HopStamps {
        device_ns, input_sent_ns, resolve_begun_ns, setpoint_sent_ns, compensate_begun_ns, command_sent_ns,
        slave_begun_ns, drive_written_ns
    }
    OperatorInput {
        sequence, sample_ns, stamps, tip_vel_in_view_m_per_s, tip_angular_vel_in_view_rad_per_s, raw_axes, flags,
        buttons, device_state, scale_permille, n_reports, n_drained, n_refused
    }
    Setpoint {
        sequence, sample_ns, stamps, input_sequence, state_sequence, bend_rad, bend_vel_rad_per_s, joints_rad,
        joints_vel_rad_per_s, q_tilde_vel_m_per_s, n_actuators, n_joints, tip_pos_in_base_m, motion_scale, model_hash, phase, reserved, reasons
    }
    Command {
        sequence, sample_ns, stamps, setpoint_sequence, input_sequence, state_sequence, model_update_sequence, bend_rad,
        joints_rad, n_actuators, n_joints, q_uncompensated_m, q_tilde_m, q_tilde_vel_m_per_s, model_hash, learnt, n_learnt, phase, reasons
    }
    SlaveState {
        sequence, sample_ns, stamps, command_sequence, operating_state, flags, desired_state, n_stops,
        state_command_sequence, setpoint_ns, setpoint_q_m, setpoint_bend_rad, setpoint_joints_rad, n_actuators, n_joints, measured_q_m, measured_tau_n, reasons, n_commands, n_refused
    }
    StateCommand { sequence, sample_ns, transition, sender_pid }
    Shape {
        sequence, sample_ns, available_ns, bend_rad, theta_l_rad, delta_rad, bend_covariance_rad2, q_tilde_m,
        joints_rad, joint_variances_rad2, n_joints, validity
    }
    ModelUpdate {
        sequence, sample_ns, shape_sequence, state_sequence, n_states, model_hash, innovation_rms_rad, n_used,
        n_left_out, n_changes, changed_ns, change_kind, is_watching, n_learnt, changed_segment, learnt
    }
    LearntValue { value, sd, effect, parameter, state, tied_to }
    ReasonRecord { count, worst, newest, limit }
    Health {
        sequence, sample_ns, pid, reserved, n_received, n_sent, n_lost, n_refused, reasons_now, reasons_ever, records
    }
    Marker { sequence, sample_ns, sender_pid, n_text, text }
    DriveCycle {
        sequence, sample_ns, answered_ns, cycle, n_left_out, wish_ns, turn, flags, phase, failure, failure_actuator,
        failure_text, n_actuators, actuators
    }
    ActuatorCycle {
        wish_q_m, sampled_ns, told_counts_per_s, current_a, torque_nm, temperature_celsius, supply_v, told_counts,
        goal_counts, counts, n_boots, flags, state, trouble, trouble_code, trouble_text, emergency_code
    }
    ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order }
    RecorderStatus { sequence, sample_ns, channels }
}

/// Words that the largest message needs.
pub const MAX_WORDS: usize = 16 + 4 * N_REASONS_MAX;
const _: () = assert!(4 * N_REASONS_MAX >= MARKER_TEXT_MAX);

/// The message of a channel that has these words as the bits of its fields, in order.
pub fn sample_of(channel: Channel, words: &[u64]) -> Sample {
    let words = &mut words.iter().copied();
    let mut sample = match channel {
        Channel::Input => Sample::Input(Words::take(words)),
        Channel::Setpoint => Sample::Setpoint(Words::take(words)),
        Channel::Command => Sample::Command(Words::take(words)),
        Channel::State => Sample::State(Words::take(words)),
        Channel::StateCommand => Sample::StateCommand(Words::take(words)),
        Channel::Shape => Sample::Shape(Words::take(words)),
        Channel::ModelUpdate => Sample::ModelUpdate(Words::take(words)),
        Channel::Health(process) => Sample::Health(process, Box::new(Words::take(words))),
        Channel::Marker => Sample::Marker(Box::new(Words::take(words))),
        Channel::DeviceMarker => Sample::DeviceMarker(Box::new(Words::take(words))),
        Channel::DriveCycle => Sample::DriveCycle(Box::new(Words::take(words))),
        Channel::Recorder => Sample::Recorder(Box::new(Words::take(words))),
    };
    // What stands behind the learnt values says nothing, and is always the same.
    match &mut sample {
        Sample::Command(command) => {
            command.n_learnt %= MAX_LEARNT as u32 + 1;
            command.learnt[command.n_learnt as usize..].fill(f64::NAN);
        }
        Sample::ModelUpdate(update) => {
            update.n_learnt %= MAX_LEARNT as u32 + 1;
            update.learnt[update.n_learnt as usize..].fill(LearntValue::default());
        }
        // The same behind the last actuator.
        Sample::DriveCycle(cycle) => {
            cycle.n_actuators %= MAX_ACTUATORS as u32 + 1;
            cycle.actuators[cycle.n_actuators as usize..].fill(ActuatorCycle::default());
        }
        _ => {}
    }
    sample
}

/// The bits of every field of a sample, in order.
pub fn words_of(sample: &Sample) -> Vec<u64> {
    let mut words = Vec::new();
    match sample {
        Sample::Input(message) => message.put(&mut words),
        Sample::Setpoint(message) => message.put(&mut words),
        Sample::Command(message) => message.put(&mut words),
        Sample::State(message) => message.put(&mut words),
        Sample::StateCommand(message) => message.put(&mut words),
        Sample::Shape(message) => message.put(&mut words),
        Sample::ModelUpdate(message) => message.put(&mut words),
        Sample::Health(_, message) => message.put(&mut words),
        Sample::Marker(message) | Sample::DeviceMarker(message) => message.put(&mut words),
        Sample::DriveCycle(message) => message.put(&mut words),
        Sample::Recorder(status) => status.put(&mut words),
    }
    words
}

/// The `sequence`-th message of a channel in a plausible chain: numbers that differ from sample to sample, NaN among them.
pub fn plausible(channel: Channel, sequence: u64, sample_ns: i64) -> Sample {
    let phase = sequence as f64 * 1e-3;
    let mut words: Vec<u64> = (0..MAX_WORDS).map(|idx| (phase + idx as f64).sin().to_bits()).collect();
    words[0] = sequence;
    words[1] = sample_ns as u64;
    let mut sample = sample_of(channel, &words);
    let stamps =
        HopStamps { device_ns: sample_ns, input_sent_ns: sample_ns.saturating_add(2_000), ..HopStamps::default() };
    match &mut sample {
        Sample::Input(input) => {
            *input = OperatorInput { stamps, raw_axes: [350, -350, 0, 1, -1, 7], flags: 1, ..*input };
            (input.buttons, input.device_state, input.scale_permille) = (0, 1, 0);
            (input.n_reports, input.n_drained, input.n_refused) = (sequence / 16, 3, 0);
        }
        Sample::Setpoint(setpoint) => {
            (setpoint.stamps, setpoint.input_sequence, setpoint.state_sequence) = (stamps, sequence, sequence - 1);
            (setpoint.phase, setpoint.reserved, setpoint.reasons) = (1, 0, 1 << 14);
        }
        Sample::Command(command) => {
            *command = Command { stamps, setpoint_sequence: sequence, state_sequence: sequence - 1, ..*command };
            (command.model_update_sequence, command.n_learnt) = (sequence / 60, 3);
            command.learnt[3..].fill(f64::NAN);
            (command.phase, command.reasons) = (1, 0);
        }
        Sample::State(state) => {
            *state = SlaveState {
                stamps,
                command_sequence: sequence - 1,
                operating_state: 1,
                desired_state: 1,
                flags: 5,
                ..*state
            };
            (state.reasons, state.n_commands, state.n_refused) = (0, sequence, 0);
        }
        Sample::StateCommand(command) => (command.transition, command.sender_pid) = (4, 4711),
        Sample::Shape(shape) => {
            *shape = Shape::of_bend(sequence, sample_ns, sample_ns.saturating_add(40_000_000), shape.bend_rad);
        }
        Sample::ModelUpdate(update) => {
            (update.shape_sequence, update.n_used, update.n_left_out) = (sequence, sequence, 2);
            update.n_learnt = 2;
            update.learnt[2..].fill(LearntValue::default());
            for learnt in &mut update.learnt[..2] {
                learnt.state = 1;
            }
        }
        Sample::Health(_, health) => {
            **health = Health { sequence, sample_ns, pid: 4711, n_received: sequence * 400, ..Health::default() };
        }
        Sample::Marker(marker) | Sample::DeviceMarker(marker) => {
            **marker = Marker::new(sequence, sample_ns, &format!("mark {sequence}")).expect("a text");
        }
        Sample::DriveCycle(cycle) => {
            (cycle.n_actuators, cycle.failure) = (3, 1);
            for (k, actuator) in cycle.actuators.iter_mut().enumerate() {
                *actuator = if k < 3 { ActuatorCycle { state: 2, ..*actuator } } else { ActuatorCycle::default() };
            }
        }
        Sample::Recorder(status) => **status = RecorderStatus { sequence, sample_ns, ..RecorderStatus::default() },
    }
    sample
}

/// What a chain at 1 kHz publishes in `n_ms` milliseconds, in the order of time: input, setpoint, command and state every
/// millisecond, shape and model update 60 times a second, six healths ten times a second. Stamps begin at `begin_ns`.
pub fn chain(n_ms: u64, begin_ns: i64) -> impl Iterator<Item = Sample> {
    (0..n_ms).flat_map(move |ms| {
        let now_ns = begin_ns + ms as i64 * 1_000_000;
        let mut samples = Vec::with_capacity(12);
        for channel in [Channel::Input, Channel::Setpoint, Channel::Command, Channel::State] {
            samples.push(plausible(channel, ms + 1, now_ns));
        }
        let n_shapes = |ms: u64| ms * 60 / 1000;
        if n_shapes(ms + 1) > n_shapes(ms) {
            samples.push(plausible(Channel::Shape, n_shapes(ms + 1), now_ns - 40_000_000));
            samples.push(plausible(Channel::ModelUpdate, n_shapes(ms + 1), now_ns));
        }
        if ms % 100 == 0 {
            for process in Process::ALL {
                samples.push(plausible(Channel::Health(process), ms / 100 + 1, now_ns));
            }
        }
        samples
    })
}

/// A path in a folder of its own, with nothing there; the folder is removed with it.
#[derive(Debug)]
pub struct TestPath(PathBuf);

pub fn fresh_path(name: &str) -> TestPath {
    static N_FOLDERS: AtomicU64 = AtomicU64::new(0);
    let own = format!("record-{}-{}", std::process::id(), N_FOLDERS.fetch_add(1, Ordering::Relaxed));
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(own);
    std::fs::remove_dir_all(&folder).ok();
    std::fs::create_dir_all(&folder).expect("folder for a test");
    TestPath(folder.join(name))
}

/// Where the records of a file with this opcode begin: behind the magic stand opcode, length and body of each.
pub fn places_of(opcode: u8, bytes: &[u8]) -> Vec<usize> {
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 < bytes.len() - 8 {
        if bytes[at] == opcode {
            found.push(at);
        }
        at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight bytes")) as usize;
    }
    found
}

impl Drop for TestPath {
    fn drop(&mut self) {
        self.0.parent().map(std::fs::remove_dir_all);
    }
}

impl Deref for TestPath {
    type Target = Path;
    fn deref(&self) -> &Path {
        &self.0
    }
}

impl AsRef<Path> for TestPath {
    fn as_ref(&self) -> &Path {
        self
    }
}
