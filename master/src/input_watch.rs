//! What an input device says from moment to moment, in its own counts and by the kernel's names: to look at it, and to calibrate it.

use crate::evdev_decoder::{EV_ABS, EV_KEY, EV_SYN, SYN_DROPPED};
use crate::evdev_host::{input_at, open, refusal};
use crate::evdev_ioctl::{axis_info, grab};
use crate::evdev_names::{axis_name, button_name};
use crate::evdev_reader::EventReader;
use crate::hid::ReadFailure;
use crate::{InputDevice, MasterError};
use std::fs::File;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// An axis of a device that is watched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WatchedAxis {
    /// The kernel's number of it.
    pub code: u16,
    /// Its value, counts; none until it is known.
    pub value: Option<i32>,
    /// Smallest and largest value, counts, as the kernel says; none where it says none.
    pub range: Option<[i32; 2]>,
    /// How far the value strays at rest, counts, as the kernel says; 0 where it says nothing.
    pub noise: i32,
}

impl WatchedAxis {
    /// As a profile names it.
    pub fn name(&self) -> String {
        axis_name(self.code)
    }
}

/// What a device has told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputChange {
    /// An axis, by the kernel's number, has this value, counts.
    Axis(u16, i32),
    /// A button, by the kernel's number, is down or not.
    Button(u16, bool),
}

/// An input device that is watched: a node of the kernel, or a pipe or file that holds what a node tells.
#[derive(Debug)]
pub struct InputWatch {
    reader: EventReader<File>,
    node: PathBuf,
    device: Option<InputDevice>,
    axes: Vec<WatchedAxis>,
    pressed: Vec<u16>,
}

impl InputWatch {
    /// Opens a node, a pipe or a file. With `is_alone` nobody else hears the device meanwhile, and one that is in use is refused;
    /// of a pipe or file that cannot be asked for.
    ///
    /// # Errors
    /// [`MasterError::Unreadable`], [`MasterError::Input`], or [`MasterError::File`] for what is no node.
    pub fn open(node: &Path, is_alone: bool) -> Result<Self, MasterError> {
        let device = input_at(node);
        let refused = |source: std::io::Error| match &device {
            Some(device) => refusal(device, source),
            None => MasterError::File { path: node.to_owned(), doing: "read", source },
        };
        let file = open(node).map_err(refused)?;
        let is_node = file.metadata().map_err(refused)?.file_type().is_char_device();
        let mut axes = Vec::new();
        if is_node {
            for &code in device.iter().flat_map(|device| &device.axes) {
                let info = axis_info(&file, code).map_err(refused)?;
                let range = (info.min < info.max).then_some([info.min, info.max]);
                axes.push(WatchedAxis { code, value: Some(info.value), range, noise: info.fuzz.max(info.flat) });
            }
            if is_alone {
                grab(&file).map_err(refused)?;
            }
        }
        Ok(Self { reader: EventReader::new(file), node: node.to_owned(), device, axes, pressed: Vec::new() })
    }

    /// What the kernel says of the device; nothing for a pipe or file.
    pub fn device(&self) -> Option<&InputDevice> {
        self.device.as_ref()
    }

    /// Its axes as they are now.
    pub fn axes(&self) -> &[WatchedAxis] {
        &self.axes
    }

    /// The names of the buttons that are down, in the order in which they were pressed.
    pub fn pressed(&self) -> Vec<String> {
        self.pressed.iter().map(|code| button_name(*code)).collect()
    }

    /// Waits for what the device tells; every change is handed on in order. False when it has come to its end.
    ///
    /// # Errors
    /// [`MasterError::File`] for a device that is gone, or whose events the kernel had to drop.
    pub fn wait(&mut self, timeout: Duration, mut on_change: impl FnMut(InputChange)) -> Result<bool, MasterError> {
        match self.reader.wait(timeout) {
            Ok(true) => {}
            Ok(false) | Err(ReadFailure::Interrupted) => return Ok(true),
            Err(ReadFailure::Gone(_)) if self.device.is_none() => return Ok(false),
            Err(ReadFailure::Gone(why)) => return Err(self.lost(why)),
        }
        while let Some(event) = self.reader.next_event() {
            match (event.kind, event.code) {
                (EV_SYN, SYN_DROPPED) => return Err(self.lost("the kernel has dropped events".to_owned())),
                (EV_ABS, code) => {
                    match self.axes.iter_mut().find(|axis| axis.code == code) {
                        Some(axis) => axis.value = Some(event.value),
                        None => self.axes.push(WatchedAxis { code, value: Some(event.value), range: None, noise: 0 }),
                    }
                    on_change(InputChange::Axis(code, event.value));
                }
                (EV_KEY, code) => {
                    let is_down = event.value != 0;
                    // 2 is a key that repeats: it is still down.
                    if is_down != self.pressed.contains(&code) {
                        self.pressed.retain(|pressed| *pressed != code);
                        self.pressed.extend(is_down.then_some(code));
                        on_change(InputChange::Button(code, is_down));
                    }
                }
                _ => {}
            }
        }
        Ok(true)
    }

    fn lost(&self, why: String) -> MasterError {
        MasterError::File { path: self.node.clone(), doing: "read on", source: std::io::Error::other(why) }
    }
}
