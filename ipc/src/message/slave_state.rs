//! What the actuators do and measure: published by `slave`, read by everyone.

use super::{Actuators, HopStamps, JointValues, message};
use iceoryx2::prelude::ZeroCopySend;

/// CRTK operating state, joint setpoints and encoder measurements of the actuators.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.SlaveState")]
pub struct SlaveState {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// Instant of the measurement, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// Stamps of the newest command that was written to the drives.
    pub stamps: HopStamps,
    /// Sequence number of that command (0: none yet).
    pub command_sequence: u64,
    /// See [`OperatingState`].
    pub operating_state: u32,
    /// Bits of [`SlaveState::IS_HOMED`], [`SlaveState::IS_BUSY`], [`SlaveState::FOLLOWING`], [`SlaveState::ENGAGED`],
    /// [`SlaveState::COMMAND_REFUSED`], [`SlaveState::JAW_FOLLOWING`]; in FAULT also of [`SlaveState::HARDWARE_STOP`], [`SlaveState::OTHERS_HOLD`] and the number of
    /// [`SlaveState::failed_drive`]; and from bit 16 on which actuators are under power ([`SlaveState::has_power`]).
    pub flags: u32,
    /// The operating state that was asked for last, see [`OperatingState`]; after a fault the two differ.
    pub desired_state: u32,
    /// Stops obeyed since start ([`crate::StopSwitch`]).
    pub n_stops: u32,
    /// Sequence number of the newest state command that was heard (0: none).
    pub state_command_sequence: u64,
    /// When the drives were last written, CLOCK_MONOTONIC, nanoseconds (0: never).
    pub setpoint_ns: i64,
    /// `setpoint_js`: what the drives were last told, m, push positive.
    pub setpoint_q_m: Actuators,
    /// `setpoint` in configuration space: the bend vector that the last accepted command was for, rad; NaN for joints.
    pub setpoint_bend_rad: [f64; 2],
    /// The positions of joints that the last accepted command was for, rad (m for a sliding joint); zeros for a snake, but for the jaw of
    /// its gripper in the place [`super::JAW`].
    pub setpoint_joints_rad: JointValues,
    /// `measured_js` position: the encoders, m, push positive.
    pub measured_q_m: Actuators,
    /// `measured_js` effort: load of each line at its actuator, N, push positive; NaN where not measured.
    pub measured_tau_n: Actuators,
    /// How many actuators there are; 0: the three lines of a snake.
    pub n_actuators: u32,
    /// How many joints the last accepted command was for; 0 for a snake, and before the first command.
    pub n_joints: u32,
    /// The set of reasons ([`crate::Reasons`]) that hold now.
    pub reasons: u64,
    /// Commands taken from the channel since start.
    pub n_commands: u64,
    /// Commands refused since start (not finite, out of range, out of order, stale, too large a step).
    pub n_refused: u64,
}

message!(SlaveState, "state", 3, super::EVERY_SAMPLE);

impl SlaveState {
    /// Flag: the drives know their zero.
    pub const IS_HOMED: u32 = 1;
    /// Flag: a homing move is under way.
    pub const IS_BUSY: u32 = 2;
    /// Flag: the newest command was written to the drives as it came.
    pub const FOLLOWING: u32 = 4;
    /// Flag: the operator has engaged, and nothing has ended that since. Without it no command is executed.
    pub const ENGAGED: u32 = 8;
    /// Flag: the newest state command was not valid and changed nothing.
    pub const COMMAND_REFUSED: u32 = 16;
    /// Flag: a drive reports that hardware has taken its power, as an emergency stop does.
    pub const HARDWARE_STOP: u32 = 32;
    /// Flag: every drive that has not failed is under power by its own report.
    pub const OTHERS_HOLD: u32 = 64;
    /// Flag: the actuator that stands alone, a gripper's wire, was written as the newest command has it.
    pub const JAW_FOLLOWING: u32 = 128;
    /// Flag: `home` moves nothing, because the drives know their place.
    pub const HOMES_IN_PLACE: u32 = 1 << 12;
    /// Place of the failed drive's number among the flags.
    const FAILED_DRIVE_SHIFT: u32 = 8;
    const FAILED_DRIVE_MASK: u32 = 0xF;

    /// Place of the first actuator's power among the flags.
    const POWER_SHIFT: usize = 16;

    /// The flags' bit of an actuator under power, from 0.
    pub fn power_flag(actuator: usize) -> u32 {
        const { assert!(Self::POWER_SHIFT + super::MAX_ACTUATORS <= u32::BITS as usize) };
        1 << (Self::POWER_SHIFT + actuator.min(super::MAX_ACTUATORS - 1))
    }

    /// Of each actuator whether it is under power by its drive's own report.
    pub fn has_power(&self) -> impl Iterator<Item = bool> {
        let n = super::n_actuators(self.n_actuators).min(super::MAX_ACTUATORS);
        (0..n).map(|actuator| self.flags & Self::power_flag(actuator) != 0)
    }

    /// The flags' bits for a failed drive, from 1.
    pub fn failed_drive_flags(drive: usize) -> u32 {
        const { assert!(super::MAX_ACTUATORS <= Self::FAILED_DRIVE_MASK as usize) };
        (drive.min(super::MAX_ACTUATORS) as u32) << Self::FAILED_DRIVE_SHIFT
    }

    /// The drive that failed, from 1; `None` where none did, or where it is not one alone.
    pub fn failed_drive(&self) -> Option<u32> {
        let drive = self.flags >> Self::FAILED_DRIVE_SHIFT & Self::FAILED_DRIVE_MASK;
        (drive != 0).then_some(drive)
    }

    /// Whether a drive reports that hardware has taken its power.
    pub fn is_hardware_stopped(&self) -> bool {
        self.flags & Self::HARDWARE_STOP != 0
    }

    /// The typed operating state, or `None` for a value that no version of krait sends.
    pub fn operating(&self) -> Option<OperatingState> {
        OperatingState::from_u32(self.operating_state)
    }

    /// The typed desired state, or `None` for a value that no version of krait sends.
    pub fn desired(&self) -> Option<OperatingState> {
        OperatingState::from_u32(self.desired_state)
    }

    /// Whether the operator has engaged.
    pub fn is_engaged(&self) -> bool {
        self.flags & Self::ENGAGED != 0
    }

    /// Whether the setpoint was put anew between the state before and this one, instead of written by the slave's gate: power came,
    /// or zero was looked for. What takes power or the engagement away writes through the gate like everything else.
    pub fn is_seeded_after(&self, before: &Self) -> bool {
        let had_power = matches!(before.operating(), Some(OperatingState::Enabled | OperatingState::Paused));
        before.flags & Self::IS_BUSY != 0 || (!had_power && before.operating() != self.operating())
    }

    /// Whether power was asked off and lines are relaxed before it goes: PAUSED, with DISABLED desired.
    pub fn is_letting_go(&self) -> bool {
        self.operating() == Some(OperatingState::Paused) && self.desired() == Some(OperatingState::Disabled)
    }

    /// CRTK `is_ready`: Enabled and homed.
    pub fn is_ready(&self) -> bool {
        self.operating() == Some(OperatingState::Enabled) && self.flags & Self::IS_HOMED != 0
    }
}

/// CRTK meta-states; exactly one holds.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperatingState {
    /// Drive power off, no fault.
    Disabled = 0,
    /// Power on, may move.
    Enabled = 1,
    /// Power on, may not move.
    Paused = 2,
    /// The drives failed and nothing may move; stays until it clears and `disable` or `enable` is sent. What becomes of the power
    /// is the drives' business.
    Fault = 3,
}

impl OperatingState {
    /// The state for a value received from another process.
    pub fn from_u32(value: u32) -> Option<Self> {
        [Self::Disabled, Self::Enabled, Self::Paused, Self::Fault].into_iter().find(|s| *s as u32 == value)
    }

    /// CRTK's word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Disabled => "DISABLED",
            Self::Enabled => "ENABLED",
            Self::Paused => "PAUSED",
            Self::Fault => "FAULT",
        }
    }
}
