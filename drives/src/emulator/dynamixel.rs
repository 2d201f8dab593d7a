//! What only an emulated XL330 does: what it forgets, what it refuses, indirect registers, bus watchdog, shutdown.

use super::registers::Register;
use super::servo::Servo;
use crate::xl330::table::{
    BUS_WATCHDOG, GOAL_POSITION, GOAL_PWM, HARDWARE_ERROR, HAS_GIVEN_UP, INDIRECT_ADDRESS, INDIRECT_DATA, MAX_POSITION,
    MIN_POSITION, N_INDIRECT, OPERATING_MODE, PRESENT_CURRENT, PRESENT_TEMPERATURE, PRESENT_VOLTAGE, PROFILE_VELOCITY,
    PWM_LIMIT, RETURN_DELAY, SECOND_ID, TORQUE_ENABLE, VELOCITY_LIMIT,
};

/// Unit of the bus watchdog.
const WATCHDOG_NS: i64 = 20_000_000;
/// Current of the stalled motor at 5 V, mA.
const STALL_MA: f64 = 1470.0;
/// Hardware errors that take the power: supply, heat, electrical shock, overload.
const SHUTDOWN: u8 = 0b11_0101;
const SHUTDOWN_AT: usize = 63;
/// Full duty.
const MOST_PWM: f64 = 885.0;

/// Registers as they come from the maker, but for the return delay.
pub(super) fn fill_in(servo: &mut Servo) {
    let four = |at: u8| Register { at: at.into(), n: 4 };
    servo.registers[6] = 46;
    (servo.registers[usize::from(RETURN_DELAY)], servo.registers[usize::from(SECOND_ID)]) = (0, 255);
    (servo.registers[usize::from(OPERATING_MODE)], servo.registers[13]) = (3, 2);
    servo.set(Register { at: PWM_LIMIT.into(), n: 2 }, MOST_PWM as i32);
    servo.set(four(VELOCITY_LIMIT), 445);
    servo.set(four(MAX_POSITION), 4095);
    servo.registers[SHUTDOWN_AT] = SHUTDOWN;
    start_anew(servo);
}

/// What it does when it gets its supply, or is rebooted: all from register 64 on is forgotten, and the errors too.
pub(super) fn start_anew(servo: &mut Servo) {
    servo.registers[usize::from(TORQUE_ENABLE)..].fill(0);
    for k in 0..N_INDIRECT {
        let at = usize::from(INDIRECT_ADDRESS) + 2 * k;
        servo.registers[at] = INDIRECT_DATA + k as u8;
    }
    // What it measures of itself.
    servo.set(Register { at: PRESENT_VOLTAGE.into(), n: 2 }, 50);
    servo.registers[usize::from(PRESENT_TEMPERATURE)] = 31;
    servo.faults.error = 0;
}

/// Where a register really is: what stands behind an indirect one.
pub(super) fn behind(servo: &Servo, at: usize) -> usize {
    match at.checked_sub(INDIRECT_DATA.into()) {
        Some(k) if k < N_INDIRECT => servo.registers[usize::from(INDIRECT_ADDRESS) + 2 * k].into(),
        _ => at,
    }
}

/// Whether it takes a value: none of the first registers under power, no goal after its watchdog, and only what is in range.
pub(super) fn may_write(servo: &Servo, address: usize, data: &[u8]) -> bool {
    if address < TORQUE_ENABLE.into() {
        return !servo.is_powered();
    }
    // What would stand in registers, where all of them are written.
    let new = |at: u8, n: usize| {
        let bytes = data.get(usize::from(at).checked_sub(address)?..)?.get(..n)?;
        Some(bytes.iter().rev().fold(0, |number, byte| number << 8 | i64::from(*byte)))
    };
    let limit = |at: u8, n| i64::from(servo.get(Register { at: at.into(), n }));
    let is_goal = new(GOAL_PWM, 1).or(new(GOAL_POSITION, 1)).is_some();
    let is_locked = servo.registers[usize::from(BUS_WATCHDOG)] == HAS_GIVEN_UP;
    let is_shut_down = servo.registers[usize::from(HARDWARE_ERROR)] & servo.registers[SHUTDOWN_AT] != 0;
    !(is_goal && is_locked)
        && new(TORQUE_ENABLE, 1).is_none_or(|on| on == 0 || !is_shut_down)
        && new(BUS_WATCHDOG, 1).is_none_or(|units| units <= 127)
        && new(GOAL_PWM, 2).is_none_or(|pwm| pwm <= limit(PWM_LIMIT, 2))
        && new(PROFILE_VELOCITY, 4).is_none_or(|speed| speed <= limit(VELOCITY_LIMIT, 4))
        && new(GOAL_POSITION, 4).is_none_or(|goal| (limit(MIN_POSITION, 4)..=limit(MAX_POSITION, 4)).contains(&goal))
}

/// When it stops by itself if it is told nothing more, ns; none: it does not watch.
pub(super) fn gives_up_ns(servo: &Servo) -> Option<i64> {
    let units = servo.registers[usize::from(BUS_WATCHDOG)];
    let watches = servo.make == crate::ServoMake::Xl330 && servo.is_powered() && (1..=127).contains(&units);
    watches.then(|| servo.heard_ns + i64::from(units) * WATCHDOG_NS)
}

/// It stops where it is, under power.
pub(super) fn give_up(servo: &mut Servo) {
    servo.registers[usize::from(BUS_WATCHDOG)] = HAS_GIVEN_UP;
    servo.set(servo.table().goal, servo.place.round() as i32);
}

/// Shows what is wrong with it, and lets go where it must; what was wrong stays until it starts anew.
pub(super) fn shut_down(servo: &mut Servo) {
    servo.registers[usize::from(HARDWARE_ERROR)] |= servo.faults.error;
    if servo.registers[usize::from(HARDWARE_ERROR)] & servo.registers[SHUTDOWN_AT] != 0 {
        servo.registers[usize::from(TORQUE_ENABLE)] = 0;
    }
}

/// The part of its largest torque that its duty allows.
pub(super) fn most_load(servo: &Servo) -> f64 {
    f64::from(servo.get(Register { at: GOAL_PWM.into(), n: 2 })) / MOST_PWM
}

pub(super) fn show(servo: &mut Servo) {
    servo.set(Register { at: PRESENT_CURRENT.into(), n: 2 }, (servo.whole_load() * STALL_MA) as i32);
}
