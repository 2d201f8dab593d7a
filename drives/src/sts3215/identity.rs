//! Whether a servo would do what it is told.

use crate::error::OpenError;
use crate::serial::{ServoMake, refused, word};
use krait_slave::DriveConfig;

/// Whether these servos, each of which says this of itself, would do what they are told; the ids are the configuration's.
pub(super) fn check(who: &[Vec<u8>], config: &DriveConfig) -> Result<(), OpenError> {
    for (k, (data, actuator)) in who.iter().zip(&config.actuator).enumerate() {
        let (low, high, mode) = (word(data, 9), word(data, 11), data[33]);
        let register = |register, name, found: u16, expected: &str| {
            refused((k, actuator.id as u8), register, name, found.into(), expected)
        };
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
        // Without a zero nothing moves, so nothing can pass the limits.
        let Some(zero) = actuator.zero_count else { continue };
        let units = crate::Units::new(actuator, k + 1, ServoMake::COUNTS_PER_TURN)?;
        let stroke = units.magnitude_counts(actuator.travel_m);
        let (lowest, highest) = (f64::from(zero) - stroke, f64::from(zero) + stroke);
        if f64::from(low) > lowest {
            return register(9, "smallest angle", low, &format!("at most {lowest:.0}, the end of the travel"));
        }
        if f64::from(high) < highest {
            return register(11, "largest angle", high, &format!("at least {highest:.0}, the end of the travel"));
        }
    }
    Ok(())
}
