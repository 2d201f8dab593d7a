//! Whether a servo would do what it is told.

use crate::error::OpenError;
use crate::serial::{RangeEnd, check_range, refused, word};
use krait_slave::DriveConfig;

/// Whether these servos, each of which says this of itself, would do what they are told; the ids are the configuration's.
pub(super) fn check(who: &[Vec<u8>], config: &DriveConfig) -> Result<(), OpenError> {
    for (k, (data, actuator)) in who.iter().zip(&config.actuator).enumerate() {
        let (low, high, mode) = (word(data, 9), word(data, 11), data[33]);
        let place = (k, actuator.id as u8);
        let register =
            |register, name, found: u16, expected: &str| refused(place, register, name, found.into(), expected);
        if mode != 0 {
            return register(33, "mode", mode.into(), "0 (position)");
        }
        if low >= high {
            return register(
                11,
                "largest angle",
                high,
                "4095, with 0 in register 9: one turn, so that a count is a place",
            );
        }
        let end = |register, name, counts: u16| RangeEnd { register, name, counts: counts.into() };
        check_range(place, actuator, [end(9, "smallest angle", low), end(11, "largest angle", high)])?;
    }
    Ok(())
}
