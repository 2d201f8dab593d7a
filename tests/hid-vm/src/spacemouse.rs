//! A virtual SpaceMouse in the kernel, and a hand that moves its cap.

use crate::model::{Model, SERIAL, VENDOR_ID};
use crate::played::Played;
use crate::uhid::{HidBus, HidIdentity, Told};
use anyhow::{Context, bail};
use krait_ipc::clock;
use krait_master::{HidRecording, HidReport, led_report};
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A device sends this often while its cap is held.
pub const SLOT_NS: i64 = 8_000_000;

/// Longest wait for anything that must come about; the machine's own time.
const PATIENCE_NS: i64 = 10_000_000_000;

/// How the device spoils what it plays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceFault {
    /// Not at all.
    None,
    /// It sends nothing.
    Silent,
    /// It leaves out one report in the middle.
    Drop,
    /// Two reports in the middle change places.
    Swap,
    /// A bit of the report in the middle is turned round.
    Flip,
    /// Of the times that it should be pulled out, it stays in the middle one.
    Stays,
}

/// The device, plugged in until it is dropped or unplugged.
pub struct SpaceMouse {
    model: Model,
    played: Played,
    place: String,
    lights: Arc<Lights>,
    /// Reports sent so far.
    pub n_sent: u64,
}

/// The output reports that reached the device, and when.
type Lights = Mutex<Vec<(i64, Switched)>>;

/// What an output report did to the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switched {
    /// Switched it on.
    On,
    /// Switched it off.
    Off,
    /// Something else.
    Nothing,
}

impl SpaceMouse {
    /// Plugs a device in and waits for its node.
    ///
    /// # Errors
    /// The kernel makes no device or no node.
    pub fn plug(model: Model) -> anyhow::Result<Self> {
        static N_PLUGGED: AtomicU64 = AtomicU64::new(0);
        let place = format!("krait-vm/{}", N_PLUGGED.fetch_add(1, Ordering::SeqCst));
        let identity = HidIdentity {
            name: model.name(),
            serial: SERIAL,
            place: &place,
            bus: HidBus::Usb,
            vendor_id: VENDOR_ID,
            product_id: model.product_id(),
        };
        let lights = Arc::new(Lights::default());
        let noted = Arc::clone(&lights);
        let played = Played::plug(identity, &model.descriptor(), move |word| note(&word, &noted))?;
        let mouse = Self { model, played, place, lights, n_sent: 0 };
        wait_for("the node of the virtual device", || node_at(&mouse.place).is_some())?;
        Ok(mouse)
    }

    /// The node of the device, from the kernel's own books.
    ///
    /// # Errors
    /// There is none.
    pub fn node(&self) -> anyhow::Result<String> {
        node_at(&self.place).context("the virtual device has no node")
    }

    /// Changes who may open the node; a new node is root's alone.
    ///
    /// # Errors
    /// The node is gone.
    pub fn permit(&self, mode: u32) -> anyhow::Result<()> {
        fs::set_permissions(self.node()?, Permissions::from_mode(mode)).context("permissions of a node")
    }

    /// Waits until krait has switched the light, on or off: from then on it reads.
    ///
    /// # Errors
    /// It does not come about.
    pub fn wait_until_read(&self) -> anyhow::Result<()> {
        wait_for("the light that says that krait reads", || !self.lit().is_empty())
    }

    /// Output reports received, CLOCK_MONOTONIC, ns.
    pub fn lit(&self) -> Vec<(i64, Switched)> {
        self.lights.lock().map_or_else(|_| Vec::new(), |lights| lights.clone())
    }

    /// Sends raw bytes.
    ///
    /// # Errors
    /// The device is gone.
    pub fn send(&mut self, bytes: &[u8]) -> anyhow::Result<()> {
        self.n_sent += 1;
        self.played.input(bytes)
    }

    /// Plays the first seconds of the recording that krait ships, lets the cap go, and gives the number of reports that
    /// were due, spoiled or not.
    ///
    /// # Errors
    /// The device is gone.
    pub fn play(&mut self, duration_s: f64, fault: DeviceFault) -> anyhow::Result<u64> {
        let recording = HidRecording::shipped()?.first_s(duration_s);
        let zeros = [HidReport::Translation([0; 3]), HidReport::Rotation([0; 3])].map(HidReport::encode);
        let end_ns = recording.duration_ns();
        let last = zeros.iter().zip(1..).map(|(report, k)| (end_ns + k * SLOT_NS, report.as_bytes()));
        let reports: Vec<(i64, &[u8])> = recording.reports().chain(last).collect();
        let (begin_ns, n_due) = (clock::monotonic_ns(), reports.len());
        for (idx, (stamp_ns, bytes)) in reports.into_iter().enumerate() {
            sleep_until(begin_ns + stamp_ns);
            let is_spoiled = fault == DeviceFault::Silent || (fault == DeviceFault::Drop && idx == n_due / 2);
            if !is_spoiled {
                self.send(bytes)?;
            }
        }
        Ok(n_due as u64)
    }

    /// Presses and releases a button.
    ///
    /// # Errors
    /// The device is gone.
    pub fn press(&mut self, button: u32) -> anyhow::Result<()> {
        for buttons in [1 << button, 0] {
            self.send(HidReport::Buttons(buttons).encode().as_bytes())?;
            std::thread::sleep(Duration::from_nanos(SLOT_NS.unsigned_abs()));
        }
        Ok(())
    }

    /// Holds the cap to the right (negative: left) for a while, counts; it is still held at the end.
    ///
    /// # Errors
    /// The device is gone.
    pub fn hold(&mut self, x_counts: i16, duration_ms: i64) -> anyhow::Result<()> {
        let begin_ns = clock::monotonic_ns();
        for slot in 0..duration_ms * 1_000_000 / SLOT_NS {
            let report = match slot % 2 {
                _ if self.model.is_combined() => HidReport::Motion([x_counts, 0, 0, 0, 0, 0]),
                0 => HidReport::Translation([x_counts, 0, 0]),
                _ => HidReport::Rotation([0; 3]),
            };
            self.send(report.encode().as_bytes())?;
            sleep_until(begin_ns + (slot + 1) * SLOT_NS);
        }
        Ok(())
    }

    /// Lets the cap go: two pairs of zeros.
    ///
    /// # Errors
    /// The device is gone.
    pub fn release(&mut self) -> anyhow::Result<()> {
        self.hold(0, 4 * SLOT_NS / 1_000_000)
    }

    /// Pulls the plug and waits until the kernel has let go of the device.
    ///
    /// # Errors
    /// It was gone already, or the thread that listens to the kernel died.
    pub fn unplug(mut self) -> anyhow::Result<()> {
        self.played.unplug()?;
        wait_for("the end of the node", || node_at(&self.place).is_none())
    }
}

/// Waits for something by the machine's own time.
///
/// # Errors
/// It has not come about within ten seconds.
pub fn wait_for(what: &str, mut done: impl FnMut() -> bool) -> anyhow::Result<()> {
    let deadline_ns = clock::monotonic_ns() + PATIENCE_NS;
    while !done() {
        if clock::monotonic_ns() > deadline_ns {
            bail!("{what}: it did not come within {} s", PATIENCE_NS / 1_000_000_000);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}

/// Keeps what was done to the light.
fn note(word: &Told, lights: &Lights) {
    let what = match word {
        Told::Output(bytes) if *bytes == led_report(true) => Switched::On,
        Told::Output(bytes) if *bytes == led_report(false) => Switched::Off,
        Told::Output(_) => Switched::Nothing,
        Told::Other | Told::Stop => return,
    };
    if let Ok(mut lights) = lights.lock() {
        lights.push((clock::monotonic_ns(), what));
    }
}

fn node_at(place: &str) -> Option<String> {
    let nodes = fs::read_dir("/sys/class/hidraw").ok()?.flatten();
    let names = nodes.filter_map(|entry| entry.file_name().into_string().ok());
    names.into_iter().find_map(|name| {
        let text = fs::read_to_string(format!("/sys/class/hidraw/{name}/device/uevent")).ok()?;
        let path = format!("/dev/{name}");
        (text.lines().any(|line| line == format!("HID_PHYS={place}")) && fs::exists(&path).is_ok_and(|is| is))
            .then_some(path)
    })
}

fn sleep_until(instant_ns: i64) {
    let left_ns = instant_ns - clock::monotonic_ns();
    if left_ns > 0 {
        std::thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
    }
}
