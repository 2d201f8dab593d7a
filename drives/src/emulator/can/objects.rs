//! The objects of an emulated drive: what it lets be read and written, with lengths.

use crate::cia402::steps::{ERROR_CODE, ERROR_REGISTER, HOME_OFFSET, HOMING_METHOD, MODE};
use std::collections::BTreeMap;

/// An object's place: index and sub-index.
type Place = (u16, u8);

pub(super) const CONTROL: Place = (0x6040, 0);
pub(super) const STATUS: Place = (0x6041, 0);
pub(super) const TARGET: Place = (0x607A, 0);
pub(super) const POSITION: Place = (0x6064, 0);
pub(super) const TORQUE: Place = (0x6077, 0);
pub(super) const QUICK_STOP_RAMP: Place = (0x6085, 0);
pub(super) const PRODUCER: Place = (0x1017, 0);
pub(super) const CONSUMER: Place = (0x1016, 1);
pub(super) const RPDO_ID: Place = (0x1400, 1);
pub(super) const TPDO_ID: Place = (0x1800, 1);
pub(super) const RPDO_MAP: u16 = 0x1600;
pub(super) const TPDO_MAP: u16 = 0x1A00;

/// A value with its length in bytes, and whether it may be written.
#[derive(Clone, Copy, Debug)]
struct Object {
    value: u32,
    n_bytes: u8,
    is_writable: bool,
}

/// All objects of a drive.
#[derive(Clone, Debug)]
pub(super) struct Objects(BTreeMap<Place, Object>);

impl Objects {
    /// As from the maker.
    pub(super) fn new(vendor: u32, product: u32, serial: u32) -> Self {
        let mut objects = Self(BTreeMap::new());
        let constant = [
            ((0x1000, 0), 0x0002_0192, 4),
            ((0x1018, 1), vendor, 4),
            ((0x1018, 2), product, 4),
            ((0x1018, 4), serial, 4),
            (STATUS, 0x40, 2),
            (POSITION, 0, 4),
            (TORQUE, 0, 2),
            (ERROR_CODE, 0, 2),
            (ERROR_REGISTER, 0, 1),
            // Rated torque, mN m; bit 7: cyclic synchronous position, bit 5: homing.
            ((0x6076, 0), (1e3 * super::CanDrive::RATED_NM) as u32, 4),
            ((0x6502, 0), 0xA0, 4),
        ];
        for (place, value, n_bytes) in constant {
            objects.0.insert(place, Object { value, n_bytes, is_writable: false });
        }
        objects.forget();
        objects
    }

    /// What is written is gone without power.
    pub(super) fn forget(&mut self) {
        let written = [
            (CONSUMER, 0, 4),
            (PRODUCER, 0, 2),
            ((0x1029, 1), 0, 1),
            (CONTROL, 0, 2),
            ((0x6007, 0), 1, 2),
            ((0x605A, 0), 2, 2),
            ((0x6065, 0), 0, 4),
            ((0x6072, 0), 1000, 2),
            (MODE, 0, 1),
            (TARGET, 0, 4),
            (HOME_OFFSET, 0, 4),
            (QUICK_STOP_RAMP, 100_000, 4),
            (HOMING_METHOD, 0, 1),
            ((0x60C2, 1), 1, 1),
            ((0x60C2, 2), 0xFE, 1),
            (RPDO_ID, 1 << 31, 4),
            ((0x1400, 2), 255, 1),
            (TPDO_ID, 1 << 31, 4),
            ((0x1800, 2), 255, 1),
        ];
        let maps = [RPDO_MAP, TPDO_MAP].into_iter().flat_map(|map| (0..=4).map(move |sub| ((map, sub), 0, 4)));
        for (place, value, n_bytes) in written.into_iter().chain(maps) {
            let n_bytes = if [RPDO_MAP, TPDO_MAP].contains(&place.0) && place.1 == 0 { 1 } else { n_bytes };
            self.0.insert(place, Object { value, n_bytes, is_writable: true });
        }
    }

    pub(super) fn get(&self, place: Place) -> u32 {
        self.0.get(&place).map_or(0, |object| object.value)
    }

    pub(super) fn put(&mut self, place: Place, value: u32) {
        if let Some(object) = self.0.get_mut(&place) {
            object.value = value;
        }
    }

    /// Adds a constant of 4 bytes.
    pub(super) fn add(&mut self, place: Place, value: u32) {
        self.0.insert(place, Object { value, n_bytes: 4, is_writable: false });
    }

    /// Takes an object away, as from a drive that lacks it.
    pub(super) fn remove(&mut self, place: Place) {
        self.0.remove(&place);
    }

    /// The answer to a question for an object.
    pub(super) fn answer(&mut self, question: [u8; 8]) -> [u8; 8] {
        let [command, low, high, sub, b0, b1, b2, b3] = question;
        let place = (u16::from_le_bytes([low, high]), sub);
        let reply = |command: u8, value: u32| {
            let [b0, b1, b2, b3] = value.to_le_bytes();
            [command, low, high, sub, b0, b1, b2, b3]
        };
        let Some(object) = self.0.get_mut(&place) else { return reply(0x80, 0x0602_0000) };
        match command {
            0x40 => reply(0x43 | (4 - object.n_bytes) << 2, object.value),
            0x23 | 0x27 | 0x2B | 0x2F if !object.is_writable => reply(0x80, 0x0601_0002),
            0x23 | 0x27 | 0x2B | 0x2F if 4 - (command >> 2 & 3) != object.n_bytes => reply(0x80, 0x0607_0010),
            0x23 | 0x27 | 0x2B | 0x2F => {
                object.value = u32::from_le_bytes([b0, b1, b2, b3]);
                reply(0x60, 0)
            }
            _ => reply(0x80, 0x0504_0001),
        }
    }
}
