//! A virtual gamepad with two motors: to the kernel's own driver (hid-microsoft, ff-memless) a pad of an Xbox One on Bluetooth, whose output
//! reports say how strongly each motor turns. It may also be told that a pad of an Xbox 360 is one of these.

use crate::played::{InputIdentity, PlayedInput, node_of};
use crate::spacemouse::wait_for;
use crate::uhid::{HidBus, Told};
use anyhow::Context;
use krait_ipc::clock;
use krait_master::InputDevice;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// What it says it is.
const NAME: &str = "Krait VM Gamepad";
const VENDOR_ID: u16 = 0x045e;
/// A stick of two axes of a byte, and eight buttons.
const DESCRIPTOR: [u8; 36] = [
    0x05, 0x01, 0x09, 0x05, 0xa1, 0x01, 0x09, 0x30, 0x09, 0x31, 0x15, 0x00, 0x26, 0xff, 0x00, 0x75, 0x08, 0x95, 0x02,
    0x81, 0x02, 0x05, 0x09, 0x19, 0x01, 0x29, 0x08, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x81, 0x02, 0xc0,
];
/// The same with two sticks whose axes have 16 bits, as a pad of an Xbox 360 has.
const DESCRIPTOR_360: [u8; 43] = [
    0x05, 0x01, 0x09, 0x05, 0xa1, 0x01, 0x09, 0x30, 0x09, 0x31, 0x09, 0x33, 0x09, 0x34, 0x16, 0x00, 0x80, 0x26, 0xff,
    0x7f, 0x75, 0x10, 0x95, 0x04, 0x81, 0x02, 0x05, 0x09, 0x19, 0x01, 0x29, 0x08, 0x15, 0x00, 0x25, 0x01, 0x75, 0x01,
    0x95, 0x08, 0x81, 0x02, 0xc0,
];
/// Where the driver is told of another device, and what: on Bluetooth, vendor, product, with the motors of a pad (bit 7).
const NEW_ID: (&str, &str) = ("/sys/bus/hid/drivers/microsoft/new_id", "0005 045e 028e 80");
/// Its report of the motors: id, which of them, those of the triggers (2), the strong one and the weak one in hundredths, durations (3).
const MOTORS: (u8, usize) = (3, 9);

/// A time, CLOCK_MONOTONIC, ns, and how strongly the strong and the weak motor turn from then on, hundredths.
pub type Turning = (i64, [u8; 2]);

/// Which gamepad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PadKind {
    XboxOne,
    Xbox360,
}

impl PadKind {
    /// USB product id.
    pub fn product_id(self) -> u16 {
        match self {
            Self::XboxOne => 0x02fd,
            Self::Xbox360 => 0x028e,
        }
    }
}

/// The gamepad, plugged in until it is dropped.
pub struct Gamepad {
    played: PlayedInput,
    kind: PadKind,
    told: Arc<Mutex<Vec<Turning>>>,
}

impl Gamepad {
    /// Plugs it in and waits for its node.
    ///
    /// # Errors
    /// The kernel makes no device or no node.
    pub fn plug(kind: PadKind) -> anyhow::Result<Self> {
        let descriptor: &[u8] = match kind {
            PadKind::XboxOne => &DESCRIPTOR,
            PadKind::Xbox360 => {
                std::fs::write(NEW_ID.0, NEW_ID.1).context(NEW_ID.0)?;
                &DESCRIPTOR_360
            }
        };
        let (bus, vendor_id, product_id) = (HidBus::Bluetooth, VENDOR_ID, kind.product_id());
        let identity = InputIdentity { name: NAME, word: "gamepad", bus, vendor_id, product_id };
        let told = Arc::new(Mutex::new(Vec::new()));
        let noted = Arc::clone(&told);
        let played = PlayedInput::plug(identity, descriptor, move |word| note(&word, &noted))?;
        Ok(Self { played, kind, told })
    }

    /// Where the stick and the buttons are from now on.
    ///
    /// # Errors
    /// The device is gone.
    pub fn hold(&mut self, x: u8, buttons: u8) -> anyhow::Result<()> {
        match self.kind {
            PadKind::XboxOne => self.played.input(&[x, 0x80, buttons]),
            PadKind::Xbox360 => {
                let [low, high] = ((i16::from(x) - 0x80) << 8).to_le_bytes();
                self.played.input(&[low, high, 0, 0, 0, 0, 0, 0, buttons])
            }
        }
    }

    /// What the motors were told.
    pub fn told(&self) -> Vec<Turning> {
        self.told.lock().map_or_else(|_| Vec::new(), |told| told.clone())
    }

    /// Waits until the motors are told that they turn so strongly, and says when that was.
    ///
    /// # Errors
    /// It does not come about.
    pub fn wait_until(&self, since_ns: i64, motors: [u8; 2]) -> anyhow::Result<i64> {
        let find = || self.told().into_iter().find(|(at_ns, told)| *at_ns >= since_ns && *told == motors);
        wait_for(&format!("motors that turn as {motors:?}"), || find().is_some())?;
        Ok(find().map_or_else(clock::monotonic_ns, |(at_ns, _)| at_ns))
    }
}

/// Its node.
pub fn node() -> Option<InputDevice> {
    node_of(NAME)
}

/// The node that the kernel's older joystick driver (joydev) makes of it.
pub fn js_node() -> Option<PathBuf> {
    let entries = std::fs::read_dir("/sys/class/input").ok()?.flatten();
    let is_pad =
        |folder: &Path| std::fs::read_to_string(folder.join("device/name")).is_ok_and(|name| name.trim() == NAME);
    let mut names =
        entries.filter(|entry| is_pad(&entry.path())).filter_map(|entry| entry.file_name().into_string().ok());
    names.find(|name| name.starts_with("js")).map(|name| Path::new("/dev/input").join(name))
}

/// Keeps what the motors are told.
fn note(word: &Told, told: &Mutex<Vec<Turning>>) {
    if let Told::Output(bytes) = word
        && bytes.len() == MOTORS.1
        && bytes[0] == MOTORS.0
        && let Ok(mut told) = told.lock()
    {
        told.push((clock::monotonic_ns(), [bytes[4], bytes[5]]));
    }
}
