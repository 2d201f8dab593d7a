//! Whether a servo would do what it is told, and what it is set to.

use super::table::{
    DRIVE_MODE, HOMING_OFFSET, MAX_POSITION, MIN_POSITION, OPERATING_MODE, PWM_LIMIT, RETURN_DELAY, SECOND_ID, STARTUP,
    VELOCITY_LIMIT, int,
};
use super::{STATUS, VELOCITY_STEP_COUNTS_PER_S};
use crate::error::OpenError;
use crate::serial::{Ask, Block, Line, Protocol, RangeEnd, check_range, exchange_ns, refused, settings, word};
use krait_slave::DriveConfig;

/// Unit of the return delay, ns.
const DELAY_UNIT_NS: i64 = 2_000;
/// Ids from here on are nobody's.
const NO_ID: u8 = 253;

/// What a servo is set to that limits what it may be told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Own {
    /// Largest duty of the motor, in its steps.
    pub pwm_limit: u16,
    /// Largest speed, in its steps.
    pub velocity_limit: u32,
}

/// Checks servos that each say this of themselves; the ids are the configuration's. What they are set to comes back.
pub(super) fn check(line: &mut Line, who: &[Vec<u8>], config: &DriveConfig, how: Ask) -> Result<Vec<Own>, OpenError> {
    let offsets = settings(line, Block { address: HOMING_OFFSET, n: 4 }, how)?;
    let pwm = settings(line, Block { address: PWM_LIMIT, n: 2 }, how)?;
    // Velocity limit, largest and smallest position.
    let limits = settings(line, Block { address: VELOCITY_LIMIT, n: 12 }, how)?;
    let startup = settings(line, Block { address: STARTUP, n: 1 }, how)?;
    let most_delay = most_delay(config);
    let mut all = Vec::new();
    for (k, actuator) in config.actuator.iter().enumerate() {
        let place = (k, actuator.id as u8);
        check_who(place, &who[k], most_delay)?;
        let offset = int(&offsets[k], 0);
        if offset != 0 {
            let why = "0: with another one its bus watchdog moves the motor where it shall stop it";
            return refused(place, HOMING_OFFSET, "homing offset", offset, why);
        }
        if startup[k][0] & 1 != 0 {
            let why = "0: it would have power from the moment that it is supplied";
            return refused(place, STARTUP, "startup configuration", startup[k][0].into(), why);
        }
        let at = |address: u8| int(&limits[k], usize::from(address - VELOCITY_LIMIT));
        let velocity = at(VELOCITY_LIMIT);
        let needed = (config.speed_counts_per_s / VELOCITY_STEP_COUNTS_PER_S).ceil();
        if f64::from(velocity) < needed {
            let expected = format!("at least {needed:.0}, which is speed_counts_per_s");
            return refused(place, VELOCITY_LIMIT, "velocity limit", velocity, &expected);
        }
        let end = |register, name| RangeEnd { register, name, counts: at(register) };
        check_range(place, actuator, [end(MIN_POSITION, "smallest position"), end(MAX_POSITION, "largest position")])?;
        all.push(Own { pwm_limit: word(&pwm[k], 0), velocity_limit: velocity.cast_unsigned() });
    }
    Ok(all)
}

fn check_who(place: (usize, u8), who: &[u8], most_delay: i64) -> Result<(), OpenError> {
    let at = |address: u8| who[usize::from(address)];
    let register = |register: u8, name, expected: &str| refused(place, register, name, at(register).into(), expected);
    if at(OPERATING_MODE) != 3 {
        return register(OPERATING_MODE, "operating mode", "3 (position): one turn, so that a count is a place");
    }
    if at(DRIVE_MODE) != 0 {
        return register(DRIVE_MODE, "drive mode", "0 (normal, profile by velocity, no power by a goal)");
    }
    if at(SECOND_ID) < NO_ID {
        return register(SECOND_ID, "secondary id", "255 (none): it would do what another is told");
    }
    if i64::from(at(RETURN_DELAY)) > most_delay {
        let expected = format!("at most {most_delay}, so that all answer within timeout_ms (0 is best)");
        return register(RETURN_DELAY, "return delay time", &expected);
    }
    Ok(())
}

/// The largest return delay, in its unit, with which all servos answer within the time-out.
fn most_delay(config: &DriveConfig) -> i64 {
    let n = config.actuator.len();
    let room_ns = (config.timeout_ms * 1e6) as i64 - exchange_ns(Protocol::Two, n, (0, STATUS.n), config.baud);
    room_ns.max(0) / (n as i64 * DELAY_UNIT_NS)
}
