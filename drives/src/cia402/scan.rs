//! Looks for drives on a CAN interface: who answers, and how they are. Only questions for objects are sent.

use super::frame::{Frame, Heard, Said, hear};
use super::open::LISTEN_NS;
use super::sdo::{Place, Reply, download, reply, upload};
use super::steps::{DEVICE_TYPE, MAX_MOTOR_SPEED, PRODUCT, PROFILE, SERIAL, TURNS_PER_MINUTE, VELOCITY_UNIT, VENDOR};
use super::wire::Wire;
use crate::bus::BusGone;
use crate::error::OpenError;

/// How long one answer is waited for, ns.
const ANSWER_NS: i64 = 30_000_000;
/// How long a second answer is waited for, ns.
const LINGER_NS: i64 = 5_000_000;
const STATUS: Place = (0x6041, 0);
const POSITION: Place = (0x6064, 0);
const TORQUE: Place = (0x6077, 0);

/// A node that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundDrive {
    /// Its number on the bus.
    pub id: u8,
    /// Number of its device profile; 402: a drive.
    pub profile: u16,
    /// Maker, by the number that CiA gave.
    pub vendor: u32,
    /// Product, by the maker's number.
    pub product: u32,
    /// Serial number; 0: it tells none.
    pub serial: u32,
    /// Its own limit of its motor's speed (object 6080), in the unit below; `None`: it tells none.
    pub most_speed: Option<u32>,
    /// What its numbers of velocities are (object 60A9); `None`: it does not say.
    pub velocity_unit: Option<u32>,
}

impl FoundDrive {
    /// Whether the unit of its limit of speed is certain: turns a minute.
    pub fn is_in_turns_per_minute(&self) -> bool {
        self.velocity_unit == Some(TURNS_PER_MINUTE)
    }

    /// Whether it is a drive that krait knows how to move.
    pub fn is_known(&self) -> bool {
        u32::from(self.profile) == PROFILE
    }
}

/// How a drive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanReading {
    /// Its status word.
    pub status: u16,
    /// Position, counts.
    pub counts: i32,
    /// Torque, parts of a thousand of the rated one; `None`: it does not measure.
    pub torque_permille: Option<i16>,
}

/// Looks for nodes with numbers up to `last_id`, where no other master is at work.
///
/// # Errors
/// [`OpenError`] where the bus cannot be used, another master is there, or two nodes share a number.
pub fn scan<W: Wire>(wire: &mut W, last_id: u8) -> Result<Vec<FoundDrive>, OpenError> {
    let until_ns = wire.now_ns() + LISTEN_NS;
    while let Some(frame) = wire.receive(until_ns)? {
        if let Heard::Master(what) = hear(&frame) {
            return Err(OpenError::SecondMaster { what });
        }
    }
    let mut found = Vec::new();
    for id in 1..=last_id.min(super::MASTER - 1) {
        let Some(device) = value(wire, id, DEVICE_TYPE)? else { continue };
        let mut part = |place| value(wire, id, place).map(Option::unwrap_or_default);
        let (vendor, product, serial) = (part(VENDOR)?, part(PRODUCT)?, part(SERIAL)?);
        let mut drive =
            FoundDrive { id, profile: device as u16, vendor, product, serial, most_speed: None, velocity_unit: None };
        // A stranger's objects mean something else.
        if drive.is_known() {
            drive.most_speed = value(wire, id, MAX_MOTOR_SPEED)?.filter(|most| *most > 0);
            drive.velocity_unit = value(wire, id, VELOCITY_UNIT)?;
        }
        found.push(drive);
    }
    Ok(found)
}

impl CanReading {
    /// Asks a drive how it is; `None`: it does not answer.
    ///
    /// # Errors
    /// As [`scan`].
    pub fn of<W: Wire>(wire: &mut W, id: u8) -> Result<Option<Self>, OpenError> {
        let (Some(status), Some(counts)) = (value(wire, id, STATUS)?, value(wire, id, POSITION)?) else {
            return Ok(None);
        };
        let torque_permille = value(wire, id, TORQUE)?.map(|torque| (torque as u16).cast_signed());
        Ok(Some(Self { status: status as u16, counts: counts.cast_signed(), torque_permille }))
    }
}

/// An object's value; `None`: the node lacks it, or does not answer.
pub(super) fn value<W: Wire>(wire: &mut W, id: u8, place: Place) -> Result<Option<u32>, OpenError> {
    Ok(match ask(wire, id, place, &upload(id, place))? {
        Some(Reply::Value(value)) => Some(value),
        _ => None,
    })
}

/// Writes an object; what the drive answers, `None`: nothing.
pub(crate) fn set<W: Wire>(
    wire: &mut W,
    id: u8,
    place: Place,
    value: u32,
    n_bytes: u8,
) -> Result<Option<Reply>, OpenError> {
    ask(wire, id, place, &download(id, place, value, n_bytes))
}

fn ask<W: Wire>(wire: &mut W, id: u8, place: Place, question: &Frame) -> Result<Option<Reply>, OpenError> {
    wire.send(question)?;
    let first = next(wire, id, place, wire.now_ns() + ANSWER_NS)?;
    // A second answer is somebody else's.
    if first.is_some() && next(wire, id, place, wire.now_ns() + LINGER_NS)?.is_some() {
        return Err(OpenError::SameId { what: "drive", id, n: 2 });
    }
    Ok(first)
}

fn next<W: Wire>(wire: &mut W, id: u8, place: Place, until_ns: i64) -> Result<Option<Reply>, BusGone> {
    while let Some(frame) = wire.receive(until_ns)? {
        if let Heard::Node(node, Said::Object(data)) = hear(&frame)
            && node == id
            && let Some(reply) = reply(data, place)
        {
            return Ok(Some(reply));
        }
        if wire.now_ns() >= until_ns {
            break;
        }
    }
    Ok(None)
}
