//! The control table of the XL330: addresses, and what is read of it each cycle.
//!
//! Source: ROBOTIS e-Manual, XL330-M288 and XL330-M077, "Control Table".

use crate::serial::{Answer, Block, word};

// Kept without power.
pub(crate) const MODEL: u8 = 0;
pub(crate) const ID: u8 = 7;
pub(crate) const RETURN_DELAY: u8 = 9;
pub(crate) const DRIVE_MODE: u8 = 10;
pub(crate) const OPERATING_MODE: u8 = 11;
pub(crate) const SECOND_ID: u8 = 12;
pub(crate) const HOMING_OFFSET: u8 = 20;
pub(crate) const PWM_LIMIT: u8 = 36;
pub(crate) const VELOCITY_LIMIT: u8 = 44;
pub(crate) const MAX_POSITION: u8 = 48;
pub(crate) const MIN_POSITION: u8 = 52;
pub(crate) const STARTUP: u8 = 60;
// Forgotten without power.
pub(crate) const TORQUE_ENABLE: u8 = 64;
pub(crate) const HARDWARE_ERROR: u8 = 70;
pub(crate) const BUS_WATCHDOG: u8 = 98;
pub(crate) const GOAL_PWM: u8 = 100;
pub(crate) const PROFILE_ACCELERATION: u8 = 108;
pub(crate) const PROFILE_VELOCITY: u8 = 112;
pub(crate) const GOAL_POSITION: u8 = 116;
pub(crate) const PRESENT_CURRENT: u8 = 126;
pub(crate) const PRESENT_POSITION: u8 = 132;
pub(crate) const PRESENT_VOLTAGE: u8 = 144;
pub(crate) const PRESENT_TEMPERATURE: u8 = 146;
/// Where the addresses stand, 2 bytes each, whose registers are read at [`INDIRECT_DATA`] side by side.
pub(crate) const INDIRECT_ADDRESS: u8 = 168;
pub(crate) const INDIRECT_DATA: u8 = 208;
/// So many of them.
pub(crate) const N_INDIRECT: usize = 20;

/// What the bus watchdog reads after it has stopped the motor.
pub(crate) const HAS_GIVEN_UP: u8 = 0xFF;
/// Registers that are read each cycle, in this order, through the indirect ones.
const READ: [u8; N_READ] = [
    TORQUE_ENABLE,
    HARDWARE_ERROR,
    BUS_WATCHDOG,
    GOAL_POSITION,
    GOAL_POSITION + 1,
    GOAL_POSITION + 2,
    GOAL_POSITION + 3,
    PRESENT_CURRENT,
    PRESENT_CURRENT + 1,
    PRESENT_POSITION,
    PRESENT_POSITION + 1,
    PRESENT_POSITION + 2,
    PRESENT_POSITION + 3,
    PRESENT_VOLTAGE,
    PRESENT_VOLTAGE + 1,
    PRESENT_TEMPERATURE,
    GOAL_PWM,
    GOAL_PWM + 1,
];
const N_READ: usize = 18;
/// The same as one block.
pub(crate) const STATUS: Block = Block { address: INDIRECT_DATA, n: N_READ };
/// Where its registers are named, and how.
pub(crate) const POINTERS: Block = Block { address: INDIRECT_ADDRESS, n: 2 * N_READ };

/// What [`POINTERS`] must say.
pub(crate) fn pointers() -> [u8; 2 * N_READ] {
    core::array::from_fn(|k| if k % 2 == 0 { READ[k / 2] } else { 0 })
}

/// Three blocks that say the same as [`STATUS`] of a servo whose indirect registers are another's.
pub(crate) const PLAIN: [Block; 3] = [
    Block { address: TORQUE_ENABLE, n: 1 },
    Block { address: HARDWARE_ERROR, n: 1 },
    Block { address: GOAL_POSITION, n: (PRESENT_TEMPERATURE - GOAL_POSITION + 1) as usize },
];

/// What a servo says in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Status {
    pub is_powered: bool,
    pub hardware_error: u8,
    pub watchdog: u8,
    pub goal: i32,
    /// mA, in the direction in which the motor drives the encoder.
    pub current_ma: i16,
    pub position: i32,
    /// Tenths of a volt; 0: these are not the registers that were asked for.
    pub voltage: u16,
    pub temperature_celsius: u8,
    /// Largest duty that it is told, in its steps.
    pub goal_pwm: u16,
}

impl Status {
    /// Of an answer to [`STATUS`].
    pub(crate) fn of(answer: &Answer<'_>) -> Self {
        let data = &answer.data;
        Self {
            is_powered: data[0] == 1,
            hardware_error: data[1],
            watchdog: data[2],
            goal: int(data, 3),
            current_ma: word(data, 7).cast_signed(),
            position: int(data, 9),
            voltage: word(data, 13),
            temperature_celsius: data[15],
            goal_pwm: word(data, 16),
        }
    }

    /// Takes an answer to the `n`-th of [`PLAIN`].
    pub(crate) fn take_plain(&mut self, n: usize, answer: &Answer<'_>) {
        let data = &answer.data;
        let at = |address: u8| usize::from(address - GOAL_POSITION);
        match n {
            0 => self.is_powered = data[0] == 1,
            1 => self.hardware_error = data[0],
            _ => {
                self.goal = int(data, 0);
                self.current_ma = word(data, at(PRESENT_CURRENT)).cast_signed();
                self.position = int(data, at(PRESENT_POSITION));
                self.voltage = word(data, at(PRESENT_VOLTAGE));
                self.temperature_celsius = data[at(PRESENT_TEMPERATURE)];
            }
        }
    }
}

/// Four registers as a number.
pub(crate) fn int(data: &[u8], at: usize) -> i32 {
    i32::from_le_bytes([data[at], data[at + 1], data[at + 2], data[at + 3]])
}
