//! A virtual foot pedal: three buttons through the kernel's input system, and nothing else.

use crate::played::{InputIdentity, PlayedInput};
use crate::uhid::HidBus;

pub const PRODUCT_ID: u16 = 0x00ff;
/// A joystick of three buttons and five bits that say nothing.
const DESCRIPTOR: [u8; 29] = [
    0x05, 0x01, 0x09, 0x04, 0xa1, 0x01, 0x05, 0x09, 0x19, 0x01, 0x29, 0x03, 0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95,
    0x03, 0x81, 0x02, 0x75, 0x05, 0x95, 0x01, 0x81, 0x03, 0xc0,
];
/// Its buttons as the hand's: presence, clutch, and one that does nothing.
pub const PROFILE: &str = "name = \"Pedal\"\nid = \"05f3:00ff\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n[[button]]\nof = 1\nfrom = \"BTN_THUMB\"\n[[button]]\nof = 9\nfrom = \"BTN_THUMB2\"\n";

/// The pedal, plugged in until it is dropped.
pub struct Pedal(PlayedInput);

impl Pedal {
    /// Plugs it in and waits for its node.
    ///
    /// # Errors
    /// The kernel makes no device or no node.
    pub fn plug() -> anyhow::Result<Self> {
        let identity = InputIdentity {
            name: "Krait VM Pedal",
            word: "pedal",
            bus: HidBus::Usb,
            vendor_id: 0x05f3,
            product_id: PRODUCT_ID,
        };
        Ok(Self(PlayedInput::plug(identity, &DESCRIPTOR, |_| {})?))
    }

    /// Its buttons that are down from now on, a bit each.
    ///
    /// # Errors
    /// The device is gone.
    pub fn hold(&mut self, buttons: u8) -> anyhow::Result<()> {
        self.0.input(&[buttons])
    }
}
