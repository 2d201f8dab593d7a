//! The questions that only the kernel's input system answers, and nothing else: an axis, the keys that are down, the lights that are on, a rumble, to be the only reader.

#![allow(unsafe_code, reason = "an ioctl is a call of the kernel with a pointer")]

use crate::evdev_decoder::{AxisInfo, EV_FF, EV_LED, EV_SYN, InputEvent, SYN_REPORT};
use crate::evdev_names::KEY_MAX;
use std::fs::File;
use std::io::{Error, Result, Write};
use std::os::fd::{AsFd, AsRawFd};

/// `EVIOCGRAB`: `_IOW('E', 0x90, int)`.
const GRAB: u32 = 0x4004_4590;
/// `EVIOCGABS(0)`: `_IOR('E', 0x40, struct input_absinfo)`, six 32-bit numbers; the axis' number is added.
const ABS_INFO: u32 = 0x8018_4540;

/// Bytes of the kernel's list of keys, a bit each.
const KEYS_BYTES: usize = KEY_MAX as usize / 8 + 1;
/// `EVIOCGKEY(KEYS_BYTES)`: `_IOC(_IOC_READ, 'E', 0x18, KEYS_BYTES)`.
const KEYS_DOWN: u32 = 0x8000_4518 | (KEYS_BYTES as u32) << 16;

/// Bits of the kernel's list of lights, of which it writes as many bytes as it has.
pub(crate) type Lit = u64;
/// `EVIOCGLED(8)`: `_IOC(_IOC_READ, 'E', 0x19, 8)`.
const LIT: u32 = 0x8000_4519 | (size_of::<Lit>() as u32) << 16;

/// `EVIOCSFF`: `_IOW('E', 0x80, struct ff_effect)`; the kernel writes the effect's number into it all the same.
const PUT_EFFECT: u32 = 0x4000_4580 | (size_of::<libc::ff_effect>() as u32) << 16;
/// `FF_RUMBLE`, the kind of effect of two motors.
pub(crate) const FF_RUMBLE: u16 = 0x50;
/// An effect of which the kernel shall choose the number.
const NEW_EFFECT: i16 = -1;

/// What an open device says of itself when it is asked, its lights and its motors.
pub(crate) trait InputState {
    /// An absolute axis; zeros for one that the device does not have.
    fn axis_info(&self, code: u16) -> Result<AxisInfo>;

    /// Its keys and buttons that are down. What it has told of keys and was not read yet is then gone.
    fn keys_down(&self) -> Result<KeysDown>;

    /// Its lights that are on, a bit each.
    fn lit(&self) -> Result<Lit>;

    /// Switches a light on or off; one that it does not have stays dark.
    fn set_light(&self, code: u16, is_on: bool) -> Result<()>;

    /// Makes the effect of a number, or a new one, a rumble of both motors that ends by itself; returns its number. It plays when it is
    /// told to, and vanishes with the descriptor, whoever closes it.
    fn put_rumble(&self, id: Option<i16>, motors: Motors, length_ms: u16) -> Result<i16>;

    /// Plays an effect from its beginning, or stops it.
    fn play(&self, id: i16, is_on: bool) -> Result<()>;
}

/// How strongly each motor turns, of `u16::MAX`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Motors {
    /// The slow, strong one.
    pub(crate) strong: u16,
    /// The fast, weak one.
    pub(crate) weak: u16,
}

impl Motors {
    /// `struct ff_rumble_effect` in the union behind the effect's head.
    fn effect(self, id: i16, length_ms: u16) -> libc::ff_effect {
        let mut data = [0; size_of::<u64>()];
        data[..2].copy_from_slice(&self.strong.to_ne_bytes());
        data[2..4].copy_from_slice(&self.weak.to_ne_bytes());
        #[cfg(target_pointer_width = "64")]
        let u = [u64::from_ne_bytes(data), 0, 0, 0];
        #[cfg(target_pointer_width = "32")]
        let u = [u32::from_ne_bytes([data[0], data[1], data[2], data[3]]), 0, 0, 0, 0, 0, 0];
        libc::ff_effect {
            type_: FF_RUMBLE,
            id,
            direction: 0,
            trigger: libc::ff_trigger { button: 0, interval: 0 },
            replay: libc::ff_replay { length: length_ms, delay: 0 },
            u,
        }
    }
}

/// Keys and buttons, by the kernel's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct KeysDown([u8; KEYS_BYTES]);

impl KeysDown {
    /// Whether a key is among them.
    pub(crate) fn contains(&self, code: u16) -> bool {
        self.0.get(usize::from(code / 8)).is_some_and(|byte| byte >> (code % 8) & 1 == 1)
    }
}

impl FromIterator<u16> for KeysDown {
    /// Numbers beyond the kernel's last are left out.
    fn from_iter<T: IntoIterator<Item = u16>>(codes: T) -> Self {
        let mut bytes = [0; KEYS_BYTES];
        for code in codes {
            if let Some(byte) = bytes.get_mut(usize::from(code / 8)) {
                *byte |= 1 << (code % 8);
            }
        }
        Self(bytes)
    }
}

impl InputState for File {
    fn axis_info(&self, code: u16) -> Result<AxisInfo> {
        let mut info = [0_i32; 6];
        // SAFETY: the descriptor is open for as long as the borrow, and the kernel writes six numbers of 32 bits, for which there
        // is room; the request's own bits say that size.
        let answer =
            unsafe { libc::ioctl(self.as_fd().as_raw_fd(), (ABS_INFO + u32::from(code)) as _, info.as_mut_ptr()) };
        if answer < 0 {
            return Err(Error::last_os_error());
        }
        let [value, min, max, fuzz, flat, _resolution] = info;
        Ok(AxisInfo { value, min, max, fuzz, flat })
    }

    fn keys_down(&self) -> Result<KeysDown> {
        let mut bytes = [0; KEYS_BYTES];
        // SAFETY: the descriptor is open for as long as the borrow, and the kernel writes at most as many bytes as the request's own
        // bits say, for which there is room.
        let answer = unsafe { libc::ioctl(self.as_fd().as_raw_fd(), KEYS_DOWN as _, bytes.as_mut_ptr()) };
        if answer < 0 { Err(Error::last_os_error()) } else { Ok(KeysDown(bytes)) }
    }

    fn lit(&self) -> Result<Lit> {
        let mut bytes = [0; size_of::<Lit>()];
        // SAFETY: the descriptor is open for as long as the borrow, and the kernel writes at most as many bytes as the request's own
        // bits say, for which there is room.
        let answer = unsafe { libc::ioctl(self.as_fd().as_raw_fd(), LIT as _, bytes.as_mut_ptr()) };
        if answer < 0 { Err(Error::last_os_error()) } else { Ok(Lit::from_ne_bytes(bytes)) }
    }

    fn set_light(&self, code: u16, is_on: bool) -> Result<()> {
        let events = [InputEvent::to_kernel(EV_LED, code, is_on.into()), InputEvent::to_kernel(EV_SYN, SYN_REPORT, 0)];
        let mut file = self;
        file.write_all(&events.concat())
    }

    fn put_rumble(&self, id: Option<i16>, motors: Motors, length_ms: u16) -> Result<i16> {
        let mut effect = motors.effect(id.unwrap_or(NEW_EFFECT), length_ms);
        // SAFETY: the descriptor is open for as long as the borrow; the kernel reads an effect, whose size the request's own bits say, and
        // writes its number into it.
        let answer = unsafe { libc::ioctl(self.as_fd().as_raw_fd(), PUT_EFFECT as _, &raw mut effect) };
        if answer < 0 { Err(Error::last_os_error()) } else { Ok(effect.id) }
    }

    fn play(&self, id: i16, is_on: bool) -> Result<()> {
        let mut file = self;
        file.write_all(&InputEvent::to_kernel(EV_FF, id.cast_unsigned(), is_on.into()))
    }
}

/// Makes this descriptor the only one that the device's events go to, until it is closed.
pub(crate) fn grab(device: &impl AsFd) -> Result<()> {
    // SAFETY: the descriptor is open for as long as the borrow, and this request takes a number, no pointer.
    let answer = unsafe { libc::ioctl(device.as_fd().as_raw_fd(), GRAB as _, 1) };
    if answer < 0 { Err(Error::last_os_error()) } else { Ok(()) }
}

/// A device that a test answers for.
#[cfg(test)]
pub(crate) struct Answers<A, K>(pub(crate) A, pub(crate) K);

#[cfg(test)]
impl<A: Fn(u16) -> AxisInfo, K: Fn() -> Vec<u16>> InputState for Answers<A, K> {
    fn axis_info(&self, code: u16) -> Result<AxisInfo> {
        Ok(self.0(code))
    }

    fn keys_down(&self) -> Result<KeysDown> {
        Ok(self.1().into_iter().collect())
    }

    fn lit(&self) -> Result<Lit> {
        Ok(0)
    }

    fn set_light(&self, _: u16, _: bool) -> Result<()> {
        Ok(())
    }

    fn put_rumble(&self, _: Option<i16>, _: Motors, _: u16) -> Result<i16> {
        Ok(0)
    }

    fn play(&self, _: i16, _: bool) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_has_the_kernels_form() {
        // linux/input.h: type, id, direction, trigger (2), replay (2), then the union, aligned to a pointer.
        assert_eq!(core::mem::offset_of!(libc::ff_effect, replay), 10);
        let effect = Motors { strong: 0x1234, weak: 0x5678 }.effect(7, 900);
        assert_eq!((effect.type_, effect.id, effect.replay.length, effect.replay.delay), (0x50, 7, 900, 0));
        let data = effect.u[0].to_ne_bytes();
        assert_eq!([0, 2].map(|at| u16::from_ne_bytes([data[at], data[at + 1]])), [0x1234, 0x5678]);
        #[cfg(target_pointer_width = "64")]
        assert_eq!(PUT_EFFECT, 0x4030_4580);
    }
}
