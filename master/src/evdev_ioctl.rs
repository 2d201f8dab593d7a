//! The questions that only the kernel's input system answers, and nothing else: an axis, the keys that are down, the lights that are on, to be the only reader.

#![allow(unsafe_code, reason = "an ioctl is a call of the kernel with a pointer")]

use crate::evdev_decoder::{AxisInfo, EV_LED, EV_SYN, InputEvent, SYN_REPORT};
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

/// What an open device says of itself when it is asked, and its lights.
pub(crate) trait InputState {
    /// An absolute axis; zeros for one that the device does not have.
    fn axis_info(&self, code: u16) -> Result<AxisInfo>;

    /// Its keys and buttons that are down. What it has told of keys and was not read yet is then gone.
    fn keys_down(&self) -> Result<KeysDown>;

    /// Its lights that are on, a bit each.
    fn lit(&self) -> Result<Lit>;

    /// Switches a light on or off; one that it does not have stays dark.
    fn set_light(&self, code: u16, is_on: bool) -> Result<()>;
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
}
