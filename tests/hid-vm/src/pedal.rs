//! A virtual foot pedal: three buttons through the kernel's input system, and nothing else.

use crate::spacemouse::wait_for;
use crate::uhid::{HidBus, HidIdentity, Told, Uhid};
use krait_master::{InputDevice, list_inputs};
use std::thread::JoinHandle;

/// What it says it is.
const NAME: &str = "Krait VM Pedal";
const VENDOR_ID: u16 = 0x05f3;
pub const PRODUCT_ID: u16 = 0x00ff;
/// A joystick of three buttons and five bits that say nothing.
const DESCRIPTOR: [u8; 29] = [
    0x05, 0x01, 0x09, 0x04, 0xa1, 0x01, 0x05, 0x09, 0x19, 0x01, 0x29, 0x03, 0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95,
    0x03, 0x81, 0x02, 0x75, 0x05, 0x95, 0x01, 0x81, 0x03, 0xc0,
];
/// Its buttons as the hand's: presence, clutch, and one that does nothing.
pub const PROFILE: &str = "name = \"Pedal\"\nid = \"05f3:00ff\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n[[button]]\nof = 1\nfrom = \"BTN_THUMB\"\n[[button]]\nof = 9\nfrom = \"BTN_THUMB2\"\n";

/// The pedal, plugged in until it is dropped.
pub struct Pedal {
    uhid: Uhid,
    listener: Option<JoinHandle<()>>,
}

impl Pedal {
    /// Plugs it in and waits for its node.
    ///
    /// # Errors
    /// The kernel makes no device or no node.
    pub fn plug() -> anyhow::Result<Self> {
        let identity = HidIdentity {
            name: NAME,
            serial: "PEDAL-1",
            place: "krait-vm/pedal",
            bus: HidBus::Usb,
            vendor_id: VENDOR_ID,
            product_id: PRODUCT_ID,
        };
        let uhid = Uhid::create(identity, &DESCRIPTOR)?;
        let mut heard = uhid.handle()?;
        let listener = std::thread::Builder::new().name("pedal".to_owned());
        let listener = listener.spawn(move || while heard.next().is_ok_and(|told| told != Told::Stop) {})?;
        let pedal = Self { uhid, listener: Some(listener) };
        wait_for("the node of the pedal", || node().is_some_and(|input| input.may_open))?;
        Ok(pedal)
    }

    /// Its buttons that are down from now on, a bit each.
    ///
    /// # Errors
    /// The device is gone.
    pub fn hold(&mut self, buttons: u8) -> anyhow::Result<()> {
        self.uhid.input(&[buttons])
    }
}

/// Its node.
pub fn node() -> Option<InputDevice> {
    list_inputs().into_iter().find(|input| input.name == NAME)
}

impl Drop for Pedal {
    fn drop(&mut self) {
        if let Some(listener) = self.listener.take()
            && self.uhid.destroy().is_ok()
        {
            let _it_only_listened = listener.join();
            let _it_may_stay_a_little = wait_for("the end of the pedal's node", || node().is_none());
        }
    }
}
