//! The two questions that only the kernel's input system answers, and nothing else: the range of an axis, and to be the only reader.

#![allow(unsafe_code, reason = "an ioctl is a call of the kernel with a pointer")]

use crate::evdev_decoder::AxisInfo;
use std::io::{Error, Result};
use std::os::fd::{AsFd, AsRawFd};

/// `EVIOCGRAB`: `_IOW('E', 0x90, int)`.
const GRAB: u32 = 0x4004_4590;
/// `EVIOCGABS(0)`: `_IOR('E', 0x40, struct input_absinfo)`, six 32-bit numbers; the axis' number is added.
const ABS_INFO: u32 = 0x8018_4540;

/// What the kernel knows of an axis; zeros for one that the device does not have.
pub(crate) fn axis_info(device: &impl AsFd, code: u16) -> Result<AxisInfo> {
    let mut info = [0_i32; 6];
    // SAFETY: the descriptor is open for as long as the borrow, and the kernel writes six numbers of 32 bits, for which there
    // is room; the request's own bits say that size.
    let answer =
        unsafe { libc::ioctl(device.as_fd().as_raw_fd(), (ABS_INFO + u32::from(code)) as _, info.as_mut_ptr()) };
    if answer < 0 {
        return Err(Error::last_os_error());
    }
    let [value, min, max, fuzz, flat, _resolution] = info;
    Ok(AxisInfo { value, min, max, fuzz, flat })
}

/// Makes this descriptor the only one that the device's events go to, until it is closed.
pub(crate) fn grab(device: &impl AsFd) -> Result<()> {
    // SAFETY: the descriptor is open for as long as the borrow, and this request takes a number, no pointer.
    let answer = unsafe { libc::ioctl(device.as_fd().as_raw_fd(), GRAB as _, 1) };
    if answer < 0 { Err(Error::last_os_error()) } else { Ok(()) }
}
