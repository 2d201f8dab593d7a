//! What a drive is asked and told before it may have power: who it is, what it does on its own, what it says each cycle.
//!
//! The same steps are gone through when it has started anew, because it has then forgotten all of it.

use super::frame::{FROM_DRIVE, MASTER, Nmt, TO_DRIVE};
use super::sdo::Place;
use crate::Units;
use crate::error::OpenError;
use krait_slave::{ActuatorConfig, SlaveConfig};

/// Device type: its low half is the profile's number.
pub(crate) const DEVICE_TYPE: Place = (0x1000, 0);
/// Number of the device profile for drives.
pub(crate) const PROFILE: u32 = 402;
/// Identity.
pub(crate) const VENDOR: Place = (0x1018, 1);
pub(crate) const PRODUCT: Place = (0x1018, 2);
pub(crate) const SERIAL: Place = (0x1018, 4);
/// Why a drive has failed, and of which kind that is.
pub(crate) const ERROR_CODE: Place = (0x603F, 0);
pub(crate) const ERROR_REGISTER: Place = (0x1001, 0);
/// Mode of operation: 8 cyclic synchronous position, 6 homing.
pub(crate) const MODE: Place = (0x6060, 0);
pub(crate) const MODE_CSP: u32 = 8;
pub(crate) const MODE_HOMING: u32 = 6;
pub(crate) const HOME_OFFSET: Place = (0x607C, 0);
pub(crate) const HOMING_METHOD: Place = (0x6098, 0);
/// Homing where the drive stands, without motion.
pub(crate) const METHOD_HERE: u32 = 37;
pub(crate) const MAX_TORQUE: Place = (0x6072, 0);
const RATED_TORQUE: Place = (0x6076, 0);
const SUPPORTED_MODES: Place = (0x6502, 0);
/// The drive's own limit of its motor's speed.
pub(crate) const MAX_MOTOR_SPEED: Place = (0x6080, 0);
/// What a drive's numbers of velocities are, and the value for turns a minute.
pub(crate) const VELOCITY_UNIT: Place = (0x60A9, 0);
pub(crate) const TURNS_PER_MINUTE: u32 = 0x00B4_4700;

/// A limit that is exactly what is needed is enough, whatever the product rounds to.
const ROUNDING: f64 = 1.0 - 1e-9;

/// One step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// An object must have a value, as far as the mask goes.
    Expect { place: Place, mask: u32, value: u32, need: Need },
    /// The torque that loads are parts of, mN m, is read, where the drive knows it.
    RatedTorque { place: Place },
    /// What its numbers of velocities are is read, where the drive says so.
    VelocityUnit,
    /// Its own limit of speed must be so many turns a minute at least, where it has one and says that this is its unit.
    MotorSpeed { least_per_min: u32 },
    /// An object gets a value.
    Write { place: Place, value: u32, n_bytes: u8, need: Need },
    /// A command of the network's management.
    Manage(Nmt),
}

/// Whether a drive may do without an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// It must have it.
    Must,
    /// It may lack it.
    May,
}

/// All steps for one drive, in order.
///
/// `rate_m_per_s` is how fast it shall be able to go.
///
/// # Errors
/// [`OpenError::BusPeriod`] where the period cannot be told to drives.
pub(crate) fn steps(
    config: &SlaveConfig,
    actuator: &ActuatorConfig,
    units: &Units,
    rate_m_per_s: f64,
) -> Result<Vec<Step>, OpenError> {
    let mut steps = vec![expect(DEVICE_TYPE, 0xFFFF, PROFILE, Need::Must)];
    for (place, value) in [(VENDOR, actuator.vendor), (PRODUCT, actuator.product)] {
        steps.extend(value.map(|value| expect(place, u32::MAX, value, Need::Must)));
    }
    // Bit 7: cyclic synchronous position.
    steps.push(expect(SUPPORTED_MODES, 1 << 7, 1 << 7, Need::May));
    steps.push(Step::RatedTorque { place: RATED_TORQUE });
    let turns_per_s = units.magnitude_counts(rate_m_per_s) / f64::from(actuator.counts_per_turn.max(1));
    let least_per_min = (60.0 * turns_per_s * ROUNDING).ceil().clamp(0.0, f64::from(u32::MAX)) as u32;
    steps.extend([Step::VelocityUnit, Step::MotorSpeed { least_per_min }]);
    // Cyclic frames stop while what is in them is chosen.
    steps.push(Step::Manage(Nmt::PreOperational));
    steps.extend(on_its_own(config, actuator, units));
    let (value, index) = interpolation(config.drive.period_ms)?;
    steps.push(write((0x60C2, 1), value, 1, Need::Must));
    steps.push(write((0x60C2, 2), index, 1, Need::Must));
    steps.push(write(MODE, MODE_CSP, 1, Need::Must));
    let id = actuator.id;
    // Bit 31: not used while it is changed; bit 30: nobody may ask for it. Type 1: at each SYNC.
    steps.extend(mapping(0x1400, u32::from(TO_DRIVE) + id, 0, &[0x6040_0010, 0x607A_0020]));
    steps.extend(mapping(0x1800, u32::from(FROM_DRIVE) + id, 1 << 30, &[0x6041_0010, 0x6064_0020, 0x6077_0010]));
    steps.push(Step::Manage(Nmt::Start));
    Ok(steps)
}

/// What the drive does when nobody tells it anything, and its limits.
fn on_its_own(config: &SlaveConfig, actuator: &ActuatorConfig, units: &Units) -> Vec<Step> {
    let whole = |counts: f64| counts.clamp(1.0, f64::from(u32::MAX)) as u32;
    let consumer = u32::from(MASTER) << 16 | config.drive.gives_up_ms;
    let mut steps = vec![
        write((0x1017, 0), config.drive.heartbeat_ms, 2, Need::Must),
        // Without this program's sign of life for so long it stops by itself ...
        write((0x1016, 1), consumer, 4, Need::Must),
        // ... by a quick stop, and goes on answering.
        write((0x6007, 0), 3, 2, Need::May),
        write((0x1029, 1), 1, 1, Need::May),
        // A quick stop takes the ramp below and keeps the power.
        write((0x605A, 0), 6, 2, Need::May),
        write((0x6085, 0), whole(units.magnitude_counts(config.deceleration_m_per_s2)), 4, Need::May),
        write((0x6065, 0), whole(units.magnitude_counts(config.limits.following_error_m)), 4, Need::May),
    ];
    if actuator.torque_limit < 1.0 {
        steps.push(write(MAX_TORQUE, (actuator.torque_limit * 1000.0).round() as u32, 2, Need::Must));
    }
    steps
}

/// What the cyclic frame of a communication object holds: it is switched off, described, switched on.
fn mapping(object: u16, id: u32, flags: u32, parts: &[u32]) -> Vec<Step> {
    let map = object + 0x200;
    let mut steps = vec![
        write((object, 1), 1 << 31 | flags | id, 4, Need::Must),
        write((object, 2), 1, 1, Need::Must),
        write((map, 0), 0, 1, Need::Must),
    ];
    for (k, part) in parts.iter().enumerate() {
        steps.push(write((map, k as u8 + 1), *part, 4, Need::Must));
    }
    steps.push(write((map, 0), parts.len() as u32, 1, Need::Must));
    steps.push(write((object, 1), flags | id, 4, Need::Must));
    steps
}

/// The bus's period as a number of units of ten to the power of an index, s.
fn interpolation(period_ms: f64) -> Result<(u32, u32), OpenError> {
    for (scale, index) in [(1.0, -3_i8), (10.0, -4), (100.0, -5)] {
        let value = period_ms * scale;
        if value.fract() == 0.0 && (1.0..=255.0).contains(&value) {
            return Ok((value as u32, u32::from(index.cast_unsigned())));
        }
    }
    Err(OpenError::BusPeriod { period_ms })
}

fn expect(place: Place, mask: u32, value: u32, need: Need) -> Step {
    Step::Expect { place, mask, value, need }
}

fn write(place: Place, value: u32, n_bytes: u8, need: Need) -> Step {
    Step::Write { place, value, n_bytes, need }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_are_told_to_drives_in_whole_units_or_refused() {
        assert_eq!(interpolation(2.0).unwrap(), (2, 0xFD));
        assert_eq!(interpolation(2.5).unwrap(), (25, 0xFC));
        assert_eq!(interpolation(1.25).unwrap(), (125, 0xFB));
        for period_ms in [1.001, 33.33, 0.0] {
            assert!(interpolation(period_ms).unwrap_err().to_string().contains("period_ms"), "{period_ms}");
        }
    }
}
