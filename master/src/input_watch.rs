//! What an input device says from moment to moment, in its own counts and by the kernel's names: to look at it, and to calibrate it.

use crate::axis_scale::PlaceScale;
use crate::evdev_decoder::{AxisInfo, EV_ABS, EV_KEY, EV_REL, EV_SYN, InputEvent, SYN_DROPPED};
use crate::evdev_host::{input_at, no_input, open, refusal};
use crate::evdev_ioctl::{InputState, grab};
use crate::evdev_names::{axis_name, button_name, way_name};
use crate::hid::ReadFailure;
use crate::piece_reader::PieceReader;
use crate::way_window::WayWindow;
use crate::{AxisFrom, InputDevice, MasterError, ProfileAxis};
use std::fs::File;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// An absolute axis of a device that is watched.
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

/// An axis that tells a way, of a device that is watched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WatchedWay {
    /// The kernel's number of it.
    pub code: u16,
    /// The way so far, counts.
    pub counts: i64,
}

impl WatchedWay {
    /// As a profile names it.
    pub fn name(&self) -> String {
        way_name(self.code)
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
    reader: PieceReader<File, { InputEvent::N_BYTES }>,
    node: PathBuf,
    device: Option<InputDevice>,
    axes: Vec<WatchedAxis>,
    ways: Vec<WatchedWay>,
    window: WayWindow,
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
        let file = open(node, false).map_err(refused)?;
        let kind = file.metadata().map_err(refused)?.file_type();
        let is_node = kind.is_char_device();
        if kind.is_dir() || is_node && device.is_none() {
            return Err(refused(no_input()));
        }
        let mut axes = Vec::new();
        if is_node {
            for &code in device.iter().flat_map(|device| &device.axes) {
                let info = file.axis_info(code).map_err(refused)?;
                let range = (info.min < info.max).then_some([info.min, info.max]);
                axes.push(WatchedAxis { code, value: Some(info.value), range, noise: info.fuzz.max(info.flat) });
            }
            if is_alone {
                grab(&file).map_err(refused)?;
            }
        }
        let ways = device.iter().flat_map(|device| &device.ways).map(|&code| WatchedWay { code, counts: 0 }).collect();
        let (reader, node) = (PieceReader::new(file), node.to_owned());
        Ok(Self { reader, node, device, axes, ways, window: WayWindow::default(), pressed: Vec::new() })
    }

    /// What the kernel says of the device; nothing for a pipe or file.
    pub fn device(&self) -> Option<&InputDevice> {
        self.device.as_ref()
    }

    /// Its axes as they are now.
    pub fn axes(&self) -> &[WatchedAxis] {
        &self.axes
    }

    /// How far it has gone so far.
    pub fn ways(&self) -> &[WatchedWay] {
        &self.ways
    }

    /// The hand's deflection, counts of -350..=350, that the chain would make of an axis as the device is now; none where that is not
    /// known, or where profile and device do not fit.
    pub fn deflection_counts(&self, axis: &ProfileAxis) -> Option<i16> {
        match axis.from {
            AxisFrom::Place(place) => {
                let watched = self.axes.iter().find(|watched| watched.code == place.code)?;
                let ([min, max], value) = (watched.range.unwrap_or_default(), watched.value?);
                let scale =
                    PlaceScale::new(&place, &AxisInfo { value, min, max, fuzz: watched.noise, flat: 0 }).ok()?;
                Some(axis.counts_of_place(&scale, value))
            }
            AxisFrom::Way { code, full_counts_per_s } => {
                Some(axis.counts_of_speed(self.window.counts_per_s(code), full_counts_per_s))
            }
            AxisFrom::Keys { plus, minus, deflection_ratio } => {
                Some(axis.counts_of_keys([plus, minus].map(|key| self.pressed.contains(&key)), deflection_ratio))
            }
        }
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
            Ok(false) => {
                self.window.end_by_silence();
                return Ok(true);
            }
            Err(ReadFailure::Gone(why)) if self.device.is_some() => return Err(self.lost(why)),
            Err(ReadFailure::Gone(_)) => return Ok(false),
            Err(_) => return Ok(true),
        }
        while let Some(bytes) = self.reader.next_piece() {
            let event = InputEvent::decode(&bytes);
            self.window.advance(event.stamp_us);
            match (event.kind, event.code) {
                (EV_SYN, SYN_DROPPED) => return Err(self.lost("the kernel has dropped events".to_owned())),
                (EV_ABS, code) => {
                    match self.axes.iter_mut().find(|axis| axis.code == code) {
                        Some(axis) => axis.value = Some(event.value),
                        None => self.axes.push(WatchedAxis { code, value: Some(event.value), range: None, noise: 0 }),
                    }
                    on_change(InputChange::Axis(code, event.value));
                }
                (EV_REL, code) => {
                    self.window.add(code, event.value, event.stamp_us);
                    match self.ways.iter_mut().find(|way| way.code == code) {
                        Some(way) => way.counts = way.counts.saturating_add(event.value.into()),
                        None => self.ways.push(WatchedWay { code, counts: event.value.into() }),
                    }
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
