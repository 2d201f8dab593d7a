//! The only file that touches hidapi: lists and opens devices, and says in plain words what stands in the way.

use crate::devices::{DeviceChoice, DeviceInfo, KNOWN_DEVICES, known_device};
use crate::hid_nodes::HidNodes;
use crate::lights::{LightRole, Lights};
use crate::{MasterError, RawReport};
use hidapi::{HidApi, HidDevice, HidError};
use rustix::fs::{FlockOperation, flock};
use std::ffi::CString;
use std::fs::{File, OpenOptions};
use std::io;
use std::time::Duration;

/// Where the udev rule belongs: before 73-seat-late.rules, which acts upon the `uaccess` tag.
pub const RULES_FILE: &str = "/etc/udev/rules.d/70-krait.rules";

/// Usage page and usage of a multi-axis controller.
const MULTI_AXIS: (u16, u16) = (1, 8);
/// Usage page and usage of a pointer, a mouse, a keyboard and a keypad.
const MOUSE_OR_KEYBOARD: [(u16, u16); 4] = [(1, 1), (1, 2), (1, 6), (1, 7)];

/// Why a read brought no report.
#[derive(Debug)]
pub(crate) enum ReadFailure {
    /// A signal came; read again.
    Interrupted,
    /// The device is gone, in the words of hidapi.
    Gone(String),
    /// What the device told was lost in part; it is there, and what it tells next is whole.
    Dropped,
    /// Its user has pressed the key that gives it back.
    GivenBack,
}

/// An open device, real or a test's.
pub(crate) trait HidPort: Send {
    /// Waits for a report and returns its length; 0 when the time is up.
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure>;

    /// Switches the lights and the motors. A device without one stays dark and still; that is no failure.
    fn show(&mut self, lights: Lights);

    /// Leaves the lights as they were before the device was taken, and the motors still.
    fn rest_lights(&mut self);
}

/// Where ports come from, real or a test's.
pub(crate) trait HidHost: Send {
    /// Opens the device that a choice names.
    fn open(&mut self, choice: &DeviceChoice) -> Result<OpenPort, MasterError>;
}

/// A port and whose it is.
pub(crate) struct OpenPort {
    pub(crate) port: Box<dyn HidPort>,
    pub(crate) vid_pid: (u16, u16),
}

/// The HID system of this machine.
pub(crate) struct SystemHost;

impl HidHost for SystemHost {
    fn open(&mut self, choice: &DeviceChoice) -> Result<OpenPort, MasterError> {
        let api = HidApi::new().map_err(|e| failed("listing the devices", e))?;
        let devices = devices_of(&api);
        let device = chosen(&api, choice, &devices)?;
        let nodes = devices
            .iter()
            .filter(|d| is_same_device(d, device) && (d.path == device.path || may_be_hand(&api, &d.path)));
        let ports = nodes.map(|node| open_node(&api, choice, node)).collect::<Result<_, _>>()?;
        let port = Box::new(HidNodes::new(ports));
        Ok(OpenPort { port, vid_pid: (device.vendor_id, device.product_id) })
    }
}

/// The device that a choice names, as [`crate::HidSource`] would open it now. Slow, and nothing is opened.
///
/// # Errors
/// [`MasterError::NoDevice`] when there is none, [`MasterError::Hid`] when the HID system cannot be asked.
pub fn chosen_device(choice: &DeviceChoice) -> Result<DeviceInfo, MasterError> {
    let api = HidApi::new().map_err(|e| failed("listing the devices", e))?;
    chosen(&api, choice, &devices_of(&api)).cloned()
}

fn chosen<'a>(api: &HidApi, choice: &DeviceChoice, devices: &'a [DeviceInfo]) -> Result<&'a DeviceInfo, MasterError> {
    let mut admitted = devices.iter().filter(|d| choice.admits(d.vendor_id, d.product_id, &d.serial));
    // A mouse is taken only where nothing else is admitted: somebody has asked for it by name.
    let wanted = admitted.clone().find(|d| may_be_hand(api, &d.path)).or_else(|| admitted.next());
    wanted.ok_or_else(|| no_device(choice, devices))
}

/// An open node.
struct SystemPort {
    device: HidDevice,
    /// Whether its light is known to be on or off.
    is_lit: Option<bool>,
    /// The same node, locked while it is open.
    _alone: File,
}

impl SystemPort {
    fn set_light(&mut self, is_on: bool) {
        if self.is_lit.replace(is_on) != Some(is_on)
            && let Err(error) = self.device.write(&crate::led_report(is_on))
        {
            tracing::debug!(%error, "the device did not take its light's report");
        }
    }
}

impl HidPort for SystemPort {
    fn read(&mut self, buffer: &mut [u8; RawReport::MAX_BYTES], timeout: Duration) -> Result<usize, ReadFailure> {
        let timeout_ms = i32::try_from(timeout.as_millis()).unwrap_or(i32::MAX);
        self.device.read_timeout(buffer, timeout_ms).map_err(|error| match error {
            HidError::IoError { error } if error.kind() == io::ErrorKind::Interrupted => ReadFailure::Interrupted,
            other => ReadFailure::Gone(other.to_string()),
        })
    }

    fn show(&mut self, lights: Lights) {
        self.set_light(lights.is_lit(LightRole::All));
    }

    fn rest_lights(&mut self) {
        self.set_light(false);
    }
}

fn open_node(api: &HidApi, choice: &DeviceChoice, node: &DeviceInfo) -> Result<Box<dyn HidPort>, MasterError> {
    let alone = opened(&node.path).map_err(|source| unreadable(node, source))?;
    lock(&alone, node)?;
    let path = CString::new(node.path.as_str()).map_err(|e| failed("naming a device", e))?;
    let device = api.open_path(&path).map_err(|e| failed("opening a device", e))?;
    // The node may have been given to another device since it was listed; while it is open it keeps its name.
    let (vendor_id, product_id, serial) = identity_of(&node.path)?;
    if !choice.admits(vendor_id, product_id, &serial) {
        return Err(no_device(choice, &list_hid()?));
    }
    Ok(Box::new(SystemPort { device, is_lit: None, _alone: alone }))
}

/// One hand moves one robot: hidraw itself lets any number of readers hear a device.
fn lock(node: &File, device: &DeviceInfo) -> Result<(), MasterError> {
    flock(node, FlockOperation::NonBlockingLockExclusive).map_err(|error| match error {
        rustix::io::Errno::WOULDBLOCK => MasterError::HandInUse { name: named(device), path: device.path.clone() },
        other => failed("locking a device", other),
    })
}

/// Whether two nodes cannot be told apart by vendor, product and serial number.
fn is_same_device(a: &DeviceInfo, b: &DeviceInfo) -> bool {
    (a.vendor_id, a.product_id, &a.serial) == (b.vendor_id, b.product_id, &b.serial)
}

/// Whether a node may belong to a hand controller: a receiver may serve a mouse and a keyboard too, and their reports could
/// be taken for pushes of the cap.
fn may_be_hand(api: &HidApi, path: &str) -> bool {
    let usages = api.device_list().filter(|found| found.path().to_bytes() == path.as_bytes());
    let usages: Vec<(u16, u16)> = usages.map(|found| (found.usage_page(), found.usage())).collect();
    usages.contains(&MULTI_AXIS) || !usages.iter().any(|usage| MOUSE_OR_KEYBOARD.contains(usage))
}

/// Every HID device, each once (hidapi lists a node once per usage), known hand controllers first. `may_open` is not asked.
pub(crate) fn list_hid() -> Result<Vec<DeviceInfo>, MasterError> {
    HidApi::new().map(|api| devices_of(&api)).map_err(|e| failed("listing the devices", e))
}

/// Whether a node may be opened.
pub(crate) fn may_open(path: &str) -> bool {
    opened(path).is_ok()
}

/// An opened node, or the kernel's own answer, which hidapi hides in a text.
fn opened(path: &str) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).open(path)
}

fn devices_of(api: &HidApi) -> Vec<DeviceInfo> {
    let mut devices: Vec<DeviceInfo> = Vec::new();
    for found in api.device_list() {
        let path = found.path().to_string_lossy().into_owned();
        if devices.iter().any(|d| d.path == path) {
            continue;
        }
        devices.push(DeviceInfo {
            path,
            vendor_id: found.vendor_id(),
            product_id: found.product_id(),
            serial: found.serial_number().unwrap_or_default().to_owned(),
            manufacturer: found.manufacturer_string().unwrap_or_default().to_owned(),
            product: found.product_string().unwrap_or_default().to_owned(),
            known: known_device(found.vendor_id(), found.product_id()),
            may_open: false,
        });
    }
    devices.sort_by(|a, b| (a.known.is_none(), &a.path).cmp(&(b.known.is_none(), &b.path)));
    devices
}

/// Vendor, product and serial number of the device that has a node now, from the kernel.
fn identity_of(path: &str) -> Result<(u16, u16, String), MasterError> {
    let node = path.rsplit('/').next().unwrap_or(path);
    let text = std::fs::read_to_string(format!("/sys/class/hidraw/{node}/device/uevent"))
        .map_err(|e| failed("asking which device was opened", e))?;
    parse_uevent(&text).ok_or_else(|| failed("asking which device was opened", format!("{node} has no HID_ID")))
}

/// `HID_ID=0003:0000046D:0000C626` and `HID_UNIQ=serial`.
fn parse_uevent(text: &str) -> Option<(u16, u16, String)> {
    let value = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    let mut ids = value("HID_ID")?.split(':').skip(1).map(|hex| u16::from_str_radix(hex, 16).ok());
    Some((ids.next()??, ids.next()??, value("HID_UNIQ").unwrap_or_default().to_owned()))
}

fn no_device(choice: &DeviceChoice, devices: &[DeviceInfo]) -> MasterError {
    let looked_for = match choice {
        DeviceChoice::Any => {
            KNOWN_DEVICES.map(|d| format!("{:04x}:{:04x} ({})", d.vendor_id, d.product_id, d.name)).join(", ")
        }
        one => one.to_string(),
    };
    let present = match devices {
        [] => "none".to_owned(),
        some => some.iter().map(DeviceInfo::to_string).collect::<Vec<_>>().join(", "),
    };
    MasterError::NoDevice { looked_for, present }
}

fn unreadable(device: &DeviceInfo, source: io::Error) -> MasterError {
    if source.kind() != io::ErrorKind::PermissionDenied {
        return failed("opening a device", format!("{}: {source}", device.path));
    }
    MasterError::Unreadable {
        name: named(device),
        path: device.path.clone(),
        source,
        rule: device.udev_rule(),
        rules_file: RULES_FILE,
    }
}

fn named(device: &DeviceInfo) -> String {
    format!("{:04x}:{:04x} {:?}", device.vendor_id, device.product_id, device.product)
}

/// One device's line: a vendor's keyboards stay closed.
pub(crate) fn udev_rule(vendor_id: u16, product_id: u16) -> String {
    format!(
        "KERNEL==\"hidraw*\", ATTRS{{idVendor}}==\"{vendor_id:04x}\", ATTRS{{idProduct}}==\"{product_id:04x}\", MODE=\"0660\", TAG+=\"uaccess\""
    )
}

fn failed(doing: &'static str, source: impl ToString) -> MasterError {
    MasterError::Hid { doing, source_text: source.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(path: &str) -> DeviceInfo {
        DeviceInfo {
            path: path.to_owned(),
            vendor_id: 0x046d,
            product_id: 0xc626,
            serial: String::new(),
            manufacturer: "3Dconnexion".to_owned(),
            product: "SpaceNavigator".to_owned(),
            known: known_device(0x046d, 0xc626),
            may_open: false,
        }
    }

    #[test]
    fn a_missing_device_is_told_with_what_was_looked_for_and_what_is_there() {
        let error = no_device(&DeviceChoice::Any, &[device("/dev/hidraw3")]).to_string();
        for part in ["256f:c652 (Universal Receiver)", "046d:c626 \"SpaceNavigator\" at /dev/hidraw3", "vid:pid"] {
            assert!(error.contains(part), "{error}");
        }
        let exact = DeviceChoice::try_from("1234:5678:SN".to_owned()).expect("choice");
        assert!(no_device(&exact, &[]).to_string().contains("looked for 1234:5678:SN, the HID devices here are none"));
    }

    #[test]
    fn an_unreadable_device_is_told_with_the_rule_to_add() {
        let error = unreadable(&device("/dev/hidraw3"), io::Error::from(io::ErrorKind::PermissionDenied));
        let rule = device("/dev/hidraw3").udev_rule();
        assert_eq!(
            rule,
            r#"KERNEL=="hidraw*", ATTRS{idVendor}=="046d", ATTRS{idProduct}=="c626", MODE="0660", TAG+="uaccess""#
        );
        let text = error.to_string();
        for part in ["/dev/hidraw3", "permission denied", "70-krait.rules", "udevadm control --reload", &rule] {
            assert!(text.contains(part), "{text}");
        }
        let vanished = unreadable(&device("/dev/hidraw3"), io::Error::from(io::ErrorKind::NotFound)).to_string();
        assert!(vanished.contains("/dev/hidraw3") && !vanished.contains("udevadm"), "{vanished}");
    }

    #[test]
    fn a_node_that_another_krait_reads_is_refused_until_that_one_lets_it_go() {
        let path = std::env::temp_dir().join(format!("krait-hidraw-{}", std::process::id()));
        std::fs::write(&path, "").expect("written");
        let [first, second] = [(), ()].map(|()| opened(path.to_str().expect("a name")).expect("opened"));
        let node = device("/dev/hidraw3");
        lock(&first, &node).expect("nobody else reads it");
        let error = lock(&second, &node).expect_err("the first has it").to_string();
        assert!(error.contains("/dev/hidraw3") && error.contains("is read by another krait"), "{error}");
        drop(first);
        lock(&second, &node).expect("it was let go");
        std::fs::remove_file(path).expect("removed");
    }

    #[test]
    fn the_kernels_own_words_say_whose_node_it_is() {
        let text = "DRIVER=hid-generic\nHID_ID=0003:0000256F:0000C652\nHID_NAME=x\nHID_UNIQ=SN-A\n";
        assert_eq!(parse_uevent(text), Some((0x256f, 0xc652, "SN-A".to_owned())));
        assert_eq!(parse_uevent("HID_ID=0003:zz:1\n"), None);
        assert_eq!(parse_uevent(""), None);
    }
}
