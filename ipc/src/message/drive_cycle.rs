//! One cycle of the bus that the drives hang on: published by `slave` where the drives are real, read by `record`.

use super::{MAX_ACTUATORS, message};
use iceoryx2::prelude::ZeroCopySend;

/// What the bus was told and what it answered in one cycle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.DriveCycle")]
pub struct DriveCycle {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// When the cycle began and took the newest wish of the slave, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// When all answers were in and judged, CLOCK_MONOTONIC, nanoseconds.
    pub answered_ns: i64,
    /// Which cycle of the bus, from 1; 0: what was seen when the bus was opened.
    pub cycle: u64,
    /// Cycles since the opening that were not handed over, because the slave did not fetch them in time.
    pub n_left_out: u64,
    /// When the slave gave the wish, CLOCK_MONOTONIC, nanoseconds (0: none yet).
    pub wish_ns: i64,
    /// How often power had been switched anew until then.
    pub turn: u64,
    /// Bits of [`DriveCycle::WANTS_POWER`] and those after it.
    pub flags: u32,
    /// 0 off, 1 power is coming, 2 goes where the slave wants, 3 braking or at rest under power.
    pub phase: u32,
    /// What has failed since power was switched: 0 nothing, 1 silent, 2 tripped, 3 limp, 4 started anew, 5 leapt, 6 stale, 7 the bus
    /// itself, 8 the slave was silent, 9 switched off by hardware, 10 knows another goal than it was told, 11 all silent.
    pub failure: u32,
    /// Which actuator has failed, from 1; 0: none, or all.
    pub failure_actuator: u32,
    /// Place of the failure's words in the list of the drives' words; 0: it has none.
    pub failure_text: u32,
    /// How many actuators there are.
    pub n_actuators: u32,
    /// Each actuator; zeros behind the last.
    pub actuators: [ActuatorCycle; MAX_ACTUATORS],
}

message!(DriveCycle, "drive_cycle", 1);

/// One actuator in one cycle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.ActuatorCycle")]
pub struct ActuatorCycle {
    /// Where the slave wanted it, m, push positive; NaN: it had not said.
    pub wish_q_m: f64,
    /// When it was measured last, CLOCK_MONOTONIC, nanoseconds.
    pub sampled_ns: i64,
    /// The speed that it was told, counts/s.
    pub told_counts_per_s: f64,
    /// Current of the motor, in the direction in which it drives the encoder, A.
    pub current_a: f64,
    /// Torque of the motor, in the direction in which it drives the encoder, N m; NaN: not measured.
    pub torque_nm: f64,
    /// Temperature, degrees Celsius; NaN: not told.
    pub temperature_celsius: f64,
    /// Supply, V; NaN: not told.
    pub supply_v: f64,
    /// The goal that it was told, encoder counts.
    pub told_counts: i32,
    /// The goal that it has understood, encoder counts.
    pub goal_counts: i32,
    /// Where it is, encoder counts.
    pub counts: i32,
    /// How often it has said that it started anew.
    pub n_boots: u32,
    /// Bits of [`ActuatorCycle::ANSWERED`] and those after it.
    pub flags: u32,
    /// 0 off, 1 switching, 2 on, 3 stopped under power, 4 limp, 5 faulted, 6 lost, 7 relaxing.
    pub state: u32,
    /// What it complains of: 0 nothing, 1 limp, 2 tripped, 3 switched off by hardware.
    pub trouble: u32,
    /// Its own number for that, and the place of the words in the list of the drives' words.
    pub trouble_code: u32,
    /// See above; 0: not known.
    pub trouble_text: u32,
    /// Error code of the newest emergency (EMCY, CiA 301) that it sent and has not taken back since power was switched; 0: none. One
    /// that comes without a trouble stops nothing.
    pub emergency_code: u32,
}

impl DriveCycle {
    /// Flag: the slave wants power.
    pub const WANTS_POWER: u32 = 1;
    /// Flag: the slave wants all to brake and stay.
    pub const WANTS_STOP: u32 = 2;
    /// Flag: the slave wants nothing to move, also not what a failure may move.
    pub const WANTS_STAND: u32 = 4;
    /// Flag: goals were sent in this cycle.
    pub const TOLD: u32 = 8;
    /// Flag: power was switched on in this cycle.
    pub const SWITCHED_ON: u32 = 16;
    /// Flag: power was switched off in this cycle.
    pub const SWITCHED_OFF: u32 = 32;
    /// Flag: the bus failed while it was being told.
    pub const GONE_TELLING: u32 = 64;
    /// Flag: the bus failed while it was being asked.
    pub const GONE_ASKING: u32 = 128;

    /// The actuators that there are.
    pub fn actuators(&self) -> &[ActuatorCycle] {
        &self.actuators[..(self.n_actuators as usize).min(MAX_ACTUATORS)]
    }

    /// Whether a flag is set.
    pub fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }
}

impl ActuatorCycle {
    /// Flag: it has answered in this cycle.
    pub const ANSWERED: u32 = 1;
    /// Flag: it is under power.
    pub const POWERED: u32 = 2;
    /// Flag: it says that nothing holds its line.
    pub const LET_GO: u32 = 4;
    /// Flag: it is being identified and configured, so that no answer is expected of it.
    pub const BUSY: u32 = 8;
    /// Flag: it says that a limit or a watchdog of its own is not as it was told.
    pub const UNGUARDED: u32 = 16;

    /// Whether a flag is set.
    pub fn has(&self, flag: u32) -> bool {
        self.flags & flag != 0
    }
}
