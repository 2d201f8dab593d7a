//! A virtual joystick whose reports are those of a Logitech Extreme 3D Pro: X and Y of 10 bits, hat, twist of 8 bits, slider, 12 buttons.

use crate::played::{InputIdentity, PlayedInput, node_of};
use crate::uhid::HidBus;
use anyhow::Context;
use krait_master::{AXIS_LIMIT_COUNTS, HidReport, InputDevice};

/// What it says it is.
pub const NAME: &str = "Krait VM Extreme 3D";
pub const VENDOR_ID: u16 = 0x046d;
pub const PRODUCT_ID: u16 = 0xc215;
/// The kernel keeps this device for a driver (hid-logitech) that takes real USB devices only; a word here lets the general one take it.
const ANY_DRIVER: &str = "/sys/module/hid/parameters/ignore_special_drivers";
/// Written from the HID usage tables: the bits in the order of [`StickPose::report`].
const DESCRIPTOR: [u8; 95] = [
    0x05, 0x01, 0x09, 0x04, 0xa1, 0x01, // Generic desktop, joystick, application
    0x09, 0x30, 0x09, 0x31, 0x15, 0x00, 0x26, 0xff, 0x03, 0x75, 0x0a, 0x95, 0x02, 0x81, 0x02, // X, Y: 0 to 1023
    0x09, 0x39, 0x25, 0x07, 0x35, 0x00, 0x46, 0x3b, 0x01, 0x65, 0x14, 0x75, 0x04, 0x95,
    0x01, // hat: 0 to 7, 0 to 315 deg,
    0x81, 0x42, 0x65, 0x00, 0x45, 0x00, // and 8, which is none
    0x09, 0x35, 0x26, 0xff, 0x00, 0x75, 0x08, 0x81, 0x02, // Rz: 0 to 255
    0x05, 0x09, 0x19, 0x01, 0x29, 0x08, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x81, 0x02, // buttons 1 to 8
    0x05, 0x01, 0x09, 0x36, 0x26, 0xff, 0x00, 0x75, 0x08, 0x95, 0x01, 0x81, 0x02, // slider: 0 to 255
    0x05, 0x09, 0x19, 0x09, 0x29, 0x0c, 0x25, 0x01, 0x75, 0x01, 0x95, 0x04, 0x81, 0x02, // buttons 9 to 12
    0x81, 0x03, 0xc0, // four bits that say nothing
];

/// Where the stick, its twist and its buttons are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StickPose {
    /// 0 to 1023.
    pub x: u16,
    pub y: u16,
    /// 0 to 255.
    pub twist: u8,
    /// A bit each.
    pub buttons: u16,
}

impl StickPose {
    /// Nobody touches it.
    pub const REST: Self = Self { x: 512, y: 512, twist: 128, buttons: 0 };

    fn report(self) -> [u8; 7] {
        const NO_HAT: u32 = 8;
        let places = u32::from(self.x) | u32::from(self.y) << 10 | NO_HAT << 20 | u32::from(self.twist) << 24;
        let [a, b, c, d] = places.to_le_bytes();
        let [low, high] = self.buttons.to_le_bytes();
        [a, b, c, d, low, 255, high & 0x0f]
    }

    /// What the shipped profile makes of its axes: krait's x, z and rz, of the range that the descriptor tells and the noise that the kernel
    /// takes for a joystick's, a sixteenth of it.
    pub fn motion(self) -> HidReport {
        let counts = |value: f64, range: f64| {
            let (rest, noise) = (range / 2.0, (range / 16.0).floor());
            let beyond = ((value - rest).abs() - noise).max(0.0) / (rest - noise);
            ((value - rest).signum() * beyond * f64::from(AXIS_LIMIT_COUNTS)).round() as i16
        };
        let [x, y] = [self.x, self.y].map(|place| counts(f64::from(place), 1023.0));
        HidReport::Motion([x, 0, y, 0, 0, counts(f64::from(self.twist), 255.0)])
    }
}

/// The joystick, plugged in until it is dropped.
pub struct Stick(PlayedInput);

impl Stick {
    /// Plugs it in, at rest, and waits for its node.
    ///
    /// # Errors
    /// The kernel makes no device or no node.
    pub fn plug() -> anyhow::Result<Self> {
        let (bus, vendor_id, product_id) = (HidBus::Usb, VENDOR_ID, PRODUCT_ID);
        let identity = InputIdentity { name: NAME, word: "joystick", bus, vendor_id, product_id };
        std::fs::write(ANY_DRIVER, "1").context(ANY_DRIVER)?;
        let plugged = PlayedInput::plug(identity, &DESCRIPTOR, |_| {});
        std::fs::write(ANY_DRIVER, "0").context(ANY_DRIVER)?;
        let mut stick = Self(plugged?);
        stick.hold(StickPose::REST)?;
        Ok(stick)
    }

    /// Where it is from now on.
    ///
    /// # Errors
    /// The device is gone.
    pub fn hold(&mut self, pose: StickPose) -> anyhow::Result<()> {
        self.0.input(&pose.report())
    }
}

/// Its node.
pub fn node() -> Option<InputDevice> {
    node_of(NAME)
}
