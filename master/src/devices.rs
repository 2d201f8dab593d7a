//! Which hand controllers krait knows, which one it shall read, and which HID devices this machine has.

use crate::hid::{list_hid, may_open, udev_rule};
use crate::recording_lines::parse_vid_pid;
use crate::{Layout, MasterError};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A device whose reports krait decodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KnownDevice {
    /// USB vendor id.
    pub vendor_id: u16,
    /// USB product id.
    pub product_id: u16,
    /// Its maker's name for it.
    pub name: &'static str,
    /// How it lays out its reports.
    pub layout: Layout,
}

/// The devices that `any` stands for, in the order of preference.
pub const KNOWN_DEVICES: [KnownDevice; 12] = [
    known(0x046d, 0xc625, "SpacePilot", Layout::Split),
    known(0x046d, 0xc626, "SpaceNavigator", Layout::Split),
    known(0x046d, 0xc627, "SpaceExplorer", Layout::Split),
    known(0x046d, 0xc62b, "SpaceMouse Pro", Layout::Split),
    known(0x256f, 0xc635, "SpaceMouse Compact", Layout::Split),
    known(0x256f, 0xc62e, "SpaceMouse Wireless", Layout::Combined),
    known(0x256f, 0xc63a, "SpaceMouse Wireless", Layout::Combined),
    known(0x256f, 0xc631, "SpaceMouse Pro Wireless", Layout::Combined),
    known(0x256f, 0xc632, "SpaceMouse Pro Wireless", Layout::Combined),
    known(0x256f, 0xc638, "SpaceMouse Pro Wireless", Layout::Combined),
    known(0x256f, 0xc633, "SpaceMouse Enterprise", Layout::Combined),
    known(0x256f, 0xc652, "Universal Receiver", Layout::Combined),
];

/// The layout that a device is known to use.
pub(crate) fn layout_of(vendor_id: u16, product_id: u16) -> Option<Layout> {
    known_device(vendor_id, product_id).map(|device| device.layout)
}

/// Which live device to read: `any` known one, `vid:pid`, or `vid:pid:serial`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum DeviceChoice {
    /// The first known device.
    #[default]
    Any,
    /// This vendor and product, whether krait knows it or not, with this serial number if one is given.
    Exactly {
        /// USB vendor id.
        vendor_id: u16,
        /// USB product id.
        product_id: u16,
        /// Serial number.
        serial: Option<String>,
    },
}

impl DeviceChoice {
    /// Whether a device is the one.
    pub(crate) fn admits(&self, vid: u16, pid: u16, found_serial: &str) -> bool {
        match self {
            Self::Any => known_device(vid, pid).is_some(),
            Self::Exactly { vendor_id, product_id, serial } => {
                (vid, pid) == (*vendor_id, *product_id) && serial.as_ref().is_none_or(|serial| serial == found_serial)
            }
        }
    }
}

impl TryFrom<String> for DeviceChoice {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        if text == "any" {
            return Ok(Self::Any);
        }
        let (vid_pid, serial) = match text.match_indices(':').nth(1) {
            Some((at, _)) => (&text[..at], Some(text[at + 1..].to_owned())),
            None => (text.as_str(), None),
        };
        match parse_vid_pid(vid_pid) {
            Some((vendor_id, product_id)) => Ok(Self::Exactly { vendor_id, product_id, serial }),
            None => Err(format!(
                "{text:?} is no device, expected \"any\", \"vid:pid\" or \"vid:pid:serial\", as in \"046d:c626\""
            )),
        }
    }
}

impl From<DeviceChoice> for String {
    fn from(choice: DeviceChoice) -> Self {
        choice.to_string()
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => f.write_str("any"),
            Self::Exactly { vendor_id, product_id, serial } => {
                write!(f, "{vendor_id:04x}:{product_id:04x}")?;
                serial.iter().try_for_each(|serial| write!(f, ":{serial}"))
            }
        }
    }
}

/// A HID device of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Its node, such as `/dev/hidraw0`.
    pub path: String,
    /// USB vendor id.
    pub vendor_id: u16,
    /// USB product id.
    pub product_id: u16,
    /// Serial number; empty when it has none.
    pub serial: String,
    /// Maker's name; empty when it tells none.
    pub manufacturer: String,
    /// Product's name; empty when it tells none.
    pub product: String,
    /// The known hand controller that it is, if any.
    pub known: Option<&'static KnownDevice>,
    /// Whether this process may open it for reading and writing.
    pub may_open: bool,
}

impl DeviceInfo {
    /// The line for udev that lets the user of this seat open it, and no other device of its maker.
    pub fn udev_rule(&self) -> String {
        udev_rule(self.vendor_id, self.product_id)
    }
}

impl fmt::Display for DeviceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:04x} {:?} at {}", self.vendor_id, self.product_id, self.product, self.path)
    }
}

/// Every HID device of this machine, each once, known hand controllers first. Slow (13 ms and more): not for a control loop.
///
/// # Errors
/// [`MasterError::Hid`] when the HID system cannot be asked; a machine without HID devices is an empty list.
pub fn list_devices() -> Result<Vec<DeviceInfo>, MasterError> {
    let mut devices = list_hid()?;
    for device in &mut devices {
        device.may_open = may_open(&device.path);
    }
    Ok(devices)
}

/// The known device behind a vendor and product id.
pub(crate) fn known_device(vendor_id: u16, product_id: u16) -> Option<&'static KnownDevice> {
    KNOWN_DEVICES.iter().find(|d| (d.vendor_id, d.product_id) == (vendor_id, product_id))
}

const fn known(vendor_id: u16, product_id: u16, name: &'static str, layout: Layout) -> KnownDevice {
    KnownDevice { vendor_id, product_id, name, layout }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_is_read_and_written_the_same_and_admits_only_its_device() {
        for text in ["any", "046d:c626", "256f:c652:AB:12"] {
            assert_eq!(DeviceChoice::try_from(text.to_owned()).expect("choice").to_string(), text);
        }
        let one = DeviceChoice::try_from("256f:c652:AB:12".to_owned()).expect("choice");
        assert!(one.admits(0x256f, 0xc652, "AB:12") && !one.admits(0x256f, 0xc652, "other"));
        assert!(DeviceChoice::Any.admits(0x046d, 0xc626, "") && !DeviceChoice::Any.admits(0x046d, 0xc52b, ""));
    }
}
