//! A virtual gamepad with two motors: to the kernel's own driver (hid-microsoft, ff-memless) a pad of an Xbox One on Bluetooth, whose output
//! reports say how strongly each motor turns.

use crate::spacemouse::wait_for;
use crate::uhid::{HidBus, HidIdentity, Told, Uhid};
use krait_ipc::clock;
use krait_master::{InputDevice, list_inputs};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// What it says it is.
const NAME: &str = "Krait VM Gamepad";
const VENDOR_ID: u16 = 0x045e;
const PRODUCT_ID: u16 = 0x02fd;
/// A stick of two axes of a byte, and eight buttons.
const DESCRIPTOR: [u8; 36] = [
    0x05, 0x01, 0x09, 0x05, 0xa1, 0x01, 0x09, 0x30, 0x09, 0x31, 0x15, 0x00, 0x26, 0xff, 0x00, 0x75, 0x08, 0x95, 0x02,
    0x81, 0x02, 0x05, 0x09, 0x19, 0x01, 0x29, 0x08, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x81, 0x02, 0xc0,
];
/// Its report of the motors: id, which of them, those of the triggers (2), the strong one and the weak one in hundredths, durations (3).
const MOTORS: (u8, usize) = (3, 9);

/// A time, CLOCK_MONOTONIC, ns, and how strongly the strong and the weak motor turn from then on, hundredths.
pub type Turning = (i64, [u8; 2]);

/// The gamepad, plugged in until it is dropped.
pub struct Gamepad {
    uhid: Uhid,
    told: Arc<Mutex<Vec<Turning>>>,
    listener: Option<JoinHandle<()>>,
}

impl Gamepad {
    /// Plugs it in and waits for its node.
    ///
    /// # Errors
    /// The kernel makes no device or no node.
    pub fn plug() -> anyhow::Result<Self> {
        let identity = HidIdentity {
            name: NAME,
            serial: "PAD-1",
            place: "krait-vm/gamepad",
            bus: HidBus::Bluetooth,
            vendor_id: VENDOR_ID,
            product_id: PRODUCT_ID,
        };
        let uhid = Uhid::create(identity, &DESCRIPTOR)?;
        let told = Arc::new(Mutex::new(Vec::new()));
        let (mut heard, noted) = (uhid.handle()?, Arc::clone(&told));
        let listener = std::thread::Builder::new().name("gamepad".to_owned());
        let listener = listener.spawn(move || listen(&mut heard, &noted))?;
        let pad = Self { uhid, told, listener: Some(listener) };
        wait_for("the node of the gamepad", || node().is_some_and(|input| input.may_open))?;
        Ok(pad)
    }

    /// Where the stick and the buttons are from now on.
    ///
    /// # Errors
    /// The device is gone.
    pub fn hold(&mut self, x: u8, buttons: u8) -> anyhow::Result<()> {
        self.uhid.input(&[x, 0x80, buttons])
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
    list_inputs().into_iter().find(|input| input.name == NAME)
}

/// Ends when the device does.
fn listen(uhid: &mut Uhid, told: &Mutex<Vec<Turning>>) {
    loop {
        match uhid.next() {
            Ok(Told::Output(bytes)) if bytes.len() == MOTORS.1 && bytes[0] == MOTORS.0 => {
                if let Ok(mut told) = told.lock() {
                    told.push((clock::monotonic_ns(), [bytes[4], bytes[5]]));
                }
            }
            Ok(Told::Stop) | Err(_) => return,
            Ok(_) => {}
        }
    }
}

impl Drop for Gamepad {
    fn drop(&mut self) {
        if let Some(listener) = self.listener.take()
            && self.uhid.destroy().is_ok()
        {
            let _it_only_listened = listener.join();
            let _it_may_stay_a_little = wait_for("the end of the gamepad's node", || node().is_none());
        }
    }
}
