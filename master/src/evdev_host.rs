//! Finds and opens the device of a profile among the kernel's input devices, and says in plain words what stands in the way.

use crate::evdev_decoder::EvdevDecoder;
use crate::evdev_ioctl::{FF_RUMBLE, InputState, KeysDown, grab};
use crate::evdev_names::{axis_name, button_name, light_name, way_name};
use crate::evdev_port::EvdevPort;
use crate::hid::{HidHost, OpenPort, RULES_FILE};
use crate::{AxisFrom, DeviceChoice, LightRole, MasterError, Profile, ProfileAxis, ProfileDevice};
use krait_ipc::clock;
use rustix::fs::OFlags;
use std::fs::{File, read_to_string};
use std::io::{Error, ErrorKind};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Where the kernel describes its input devices.
const SYS: &str = "/sys/class/input";

/// The kernel's numbers below this one are keys of keyboards; above are buttons.
pub(crate) const FIRST_BUTTON: u16 = 0x100;
/// Buttons of mice.
const MOUSE_BUTTONS: core::ops::RangeInclusive<u16> = 0x110..=0x117;
/// How long keys that are down are waited for, ns, and how often they are asked for.
const HELD_PATIENCE_NS: i64 = 2_000_000_000;
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// An input device of this machine, a node of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputDevice {
    /// Its node, such as `/dev/input/event3`.
    pub node: PathBuf,
    /// Vendor id.
    pub vendor_id: u16,
    /// Product id.
    pub product_id: u16,
    /// What it calls itself.
    pub name: String,
    /// Numbers of its absolute axes.
    pub axes: Vec<u16>,
    /// Numbers of its axes that tell a way.
    pub ways: Vec<u16>,
    /// Numbers of its buttons and keys.
    pub buttons: Vec<u16>,
    /// Numbers of its lights.
    pub lights: Vec<u16>,
    /// Whether it has motors that rumble.
    pub rumbles: bool,
    /// Whether this process may open it for reading.
    pub may_open: bool,
}

impl InputDevice {
    /// Whether it has every axis and button of a profile.
    pub fn has_all_of(&self, profile: &Profile) -> bool {
        let has = |axis: &ProfileAxis| match axis.from {
            AxisFrom::Place(place) => self.axes.contains(&place.code),
            AxisFrom::Way { code, .. } => self.ways.contains(&code),
            AxisFrom::Keys { .. } => true,
        };
        profile.axes.iter().all(has) && profile.keys().chain(profile.release).all(|key| self.buttons.contains(&key))
    }

    /// Its axes, as a profile names them.
    pub fn axis_names(&self) -> Vec<String> {
        let places = self.axes.iter().map(|code| axis_name(*code));
        places.chain(self.ways.iter().map(|code| way_name(*code))).collect()
    }

    /// Its buttons and keys, as a profile names them.
    pub fn button_names(&self) -> Vec<String> {
        self.buttons.iter().map(|code| button_name(*code)).collect()
    }

    /// Its lights, as a profile names them.
    pub fn light_names(&self) -> Vec<String> {
        self.lights.iter().map(|code| light_name(*code)).collect()
    }

    /// What a profile wants of it to be told by, and it does not have: the key, and what it has instead. A light for engaged, limit or fault
    /// may be missing, since built-in profiles name them for every keyboard.
    fn cannot_tell(&self, profile: &Profile) -> Option<(&'static str, &'static str, String)> {
        let listed = |names: Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let mut missing = profile.lights.iter().filter(|(_, code)| !self.lights.contains(code));
        let light = missing.find_map(|(role, _)| match role {
            LightRole::Load => Some("lights.load"),
            LightRole::Compensation => Some("lights.compensation"),
            LightRole::All | LightRole::Engaged | LightRole::Limit | LightRole::Fault => None,
        });
        if let Some(key) = light {
            return Some((key, "a light that this device has", listed(self.light_names())));
        }
        let lacks_motors = !profile.rumble.is_empty() && !self.rumbles;
        lacks_motors.then(|| ("rumble", "a device with motors that rumble", "none".to_owned()))
    }

    /// Whether a profile is of this device.
    pub fn is_of(&self, profile: &Profile) -> bool {
        match &profile.device {
            ProfileDevice::Id(vendor_id, product_id) => (self.vendor_id, self.product_id) == (*vendor_id, *product_id),
            ProfileDevice::Path(path) => path.canonicalize().is_ok_and(|node| node == self.node),
            ProfileDevice::Unnamed => false,
        }
    }

    /// The line for udev that lets the user of this seat open the device, and nobody's keyboard: a wireless receiver may serve a mouse
    /// and a keyboard under one vendor and product, so that its name counts too, where udev can take it as it is.
    pub fn udev_rule(&self) -> String {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || " ._-:()/+,".contains(c);
        let name = if !self.name.is_empty() && self.name.chars().all(is_plain) {
            format!(", ATTRS{{name}}==\"{}\"", self.name)
        } else {
            String::new()
        };
        format!(
            "KERNEL==\"event*\", ATTRS{{id/vendor}}==\"{:04x}\", ATTRS{{id/product}}==\"{:04x}\"{name}, MODE=\"0660\", TAG+=\"uaccess\"",
            self.vendor_id, self.product_id
        )
    }
}

/// The input device behind a node or a link to one; none where the kernel describes none there.
pub fn input_at(node: &Path) -> Option<InputDevice> {
    let node = node.canonicalize().ok()?;
    inputs().into_iter().find(|device| device.node == node)
}

/// Refuses what is there and is no input device. A node that is not there yet is looked for by whoever opens it.
///
/// # Errors
/// [`MasterError::File`].
pub fn refuse_no_input(node: &Path) -> Result<(), MasterError> {
    if !node.exists() || input_at(node).is_some() {
        return Ok(());
    }
    Err(MasterError::File { path: node.to_owned(), doing: "read", source: no_input() })
}

/// What is said of a node that is something else.
pub(crate) fn no_input() -> Error {
    Error::other("it is no input device; krait devices lists those that are there")
}

/// Every input device of this machine, by the numbers of their nodes.
pub fn list_inputs() -> Vec<InputDevice> {
    let mut devices = inputs();
    for device in &mut devices {
        device.may_open = open(&device.node, false).is_ok();
    }
    devices
}

/// The same without a node being touched: `may_open` is not asked.
fn inputs() -> Vec<InputDevice> {
    listed(Path::new(SYS), Path::new("/dev/input"))
}

/// Opens a node to read it, and to write too where a light or a motor shall be switched.
pub(crate) fn open(node: &Path, is_told: bool) -> std::io::Result<File> {
    let flags = (OFlags::NONBLOCK | OFlags::CLOEXEC).bits().cast_signed();
    File::options().read(true).write(is_told).custom_flags(flags).open(node)
}

fn listed(sys: &Path, dev: &Path) -> Vec<InputDevice> {
    let entries = std::fs::read_dir(sys).into_iter().flatten().flatten();
    let mut numbered: Vec<(u32, InputDevice)> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let number = name.strip_prefix("event")?.parse().ok()?;
            Some((number, described(&entry.path().join("device"), dev.join(name))?))
        })
        .collect();
    numbered.sort_by_key(|(number, _)| *number);
    numbered.into_iter().map(|(_, device)| device).collect()
}

/// The device behind a folder of the kernel's description; none where it has gone meanwhile.
fn described(folder: &Path, node: PathBuf) -> Option<InputDevice> {
    let text = |name: &str| read_to_string(folder.join(name)).ok().map(|text| text.trim().to_owned());
    let id = |name: &str| text(name).and_then(|hex| u16::from_str_radix(&hex, 16).ok());
    Some(InputDevice {
        vendor_id: id("id/vendor")?,
        product_id: id("id/product")?,
        name: text("name").unwrap_or_default(),
        axes: bits(&text("capabilities/abs").unwrap_or_default()),
        ways: bits(&text("capabilities/rel").unwrap_or_default()),
        buttons: bits(&text("capabilities/key").unwrap_or_default()),
        lights: bits(&text("capabilities/led").unwrap_or_default()),
        rumbles: bits(&text("capabilities/ff").unwrap_or_default()).contains(&FF_RUMBLE),
        may_open: false,
        node,
    })
}

/// Which bits are set in words of hexadecimal, the highest word first, as the kernel prints them.
fn bits(words: &str) -> Vec<u16> {
    let mut found = Vec::new();
    for (word_idx, word) in words.split_whitespace().rev().enumerate() {
        let Ok(word) = u64::from_str_radix(word, 16) else { continue };
        let of_word = (0..u64::BITS).filter(|bit| word >> bit & 1 == 1);
        found.extend(of_word.filter_map(|bit| u16::try_from(word_idx * u64::BITS as usize + bit as usize).ok()));
    }
    found
}

/// The kernel's input system, for the device of one profile.
pub(crate) struct EvdevHost {
    pub(crate) profile: Profile,
}

impl HidHost for EvdevHost {
    fn open(&mut self, _choice: &DeviceChoice) -> Result<OpenPort, MasterError> {
        let device = self.chosen(&inputs())?;
        if let Some((key, expected, found)) = device.cannot_tell(&self.profile) {
            let (file, place) = (self.profile.name.clone(), format!("key {key}, device {}", device.node.display()));
            return Err(MasterError::Profile { file, place, expected: expected.to_owned(), found });
        }
        let refused = |source: Error| refusal(&device, source);
        let is_told = !(self.profile.lights.is_empty() && self.profile.rumble.is_empty());
        let file = open(&device.node, is_told).map_err(refused)?;
        // While it is open its node keeps its name: is it still the same device?
        let again = inputs().into_iter().find(|now| now.node == device.node);
        if again.is_none_or(|now| (now.vendor_id, now.product_id) != (device.vendor_id, device.product_id)) {
            return Err(refusal(&device, Error::other("another device has taken its node")));
        }
        wait_until_let_go(&file, &device)?;
        grab(&file).map_err(refused)?;
        let decoder = EvdevDecoder::new(&self.profile, &file);
        let decoder = decoder.map_err(|found| MasterError::Profile {
            file: self.profile.name.clone(),
            place: format!("device {}", device.node.display()),
            expected: "axes of this device with a range".to_owned(),
            found,
        })?;
        let vid_pid = (device.vendor_id, device.product_id);
        Ok(OpenPort { port: Box::new(EvdevPort::new(file, decoder, &self.profile)), vid_pid })
    }
}

impl EvdevHost {
    /// The node of the profile's device, as it would be opened now; nothing is opened.
    pub(crate) fn node(&self) -> Result<PathBuf, MasterError> {
        Ok(self.chosen(&inputs())?.node)
    }

    fn chosen(&self, devices: &[InputDevice]) -> Result<InputDevice, MasterError> {
        let found = devices.iter().find(|device| device.is_of(&self.profile) && device.has_all_of(&self.profile));
        found.cloned().ok_or_else(|| {
            let of_it: Vec<&InputDevice> = devices.iter().filter(|device| device.is_of(&self.profile)).collect();
            let wanted = match &self.profile.device {
                ProfileDevice::Id(vendor_id, product_id) => format!("{vendor_id:04x}:{product_id:04x}"),
                ProfileDevice::Path(path) => path.display().to_string(),
                ProfileDevice::Unnamed => "a device that nobody has named".to_owned(),
            };
            let named = |device: &InputDevice| {
                format!(
                    "{:04x}:{:04x} {:?} at {}",
                    device.vendor_id,
                    device.product_id,
                    device.name,
                    device.node.display()
                )
            };
            let present: Vec<String> = devices.iter().map(named).collect();
            let present = if present.is_empty() { "none".to_owned() } else { present.join(", ") };
            let lacking = if of_it.is_empty() { "" } else { ", with every axis and button of its profile" };
            MasterError::NoInput { looked_for: format!("{wanted} ({}){lacking}", self.profile.name), present }
        })
    }
}

/// Waits until no key of a keyboard and no button of a mouse is down: whoever hears the device now would never hear it let go,
/// after Enter has started krait for one.
fn wait_until_let_go(file: &impl InputState, device: &InputDevice) -> Result<(), MasterError> {
    let types = |code: &u16| *code < FIRST_BUTTON || MOUSE_BUTTONS.contains(code);
    let keys: Vec<u16> = device.buttons.iter().copied().filter(types).collect();
    let until_ns = clock::monotonic_ns() + HELD_PATIENCE_NS;
    while !keys.is_empty() {
        let down: KeysDown = file.keys_down().map_err(|source| refusal(device, source))?;
        let held: Vec<String> = keys.iter().filter(|key| down.contains(**key)).map(|key| button_name(*key)).collect();
        if held.is_empty() {
            break;
        }
        if clock::monotonic_ns() > until_ns {
            let (name, path) = (format!("{:?}", device.name), device.node.display().to_string());
            return Err(MasterError::KeysHeld { name, path, keys: held.join(", ") });
        }
        std::thread::sleep(LOOK_AGAIN);
    }
    Ok(())
}

pub(crate) fn refusal(device: &InputDevice, source: Error) -> MasterError {
    let (name, path) = (format!("{:?}", device.name), device.node.display().to_string());
    if source.kind() == ErrorKind::PermissionDenied {
        return MasterError::Unreadable { name, path, source, rule: device.udev_rule(), rules_file: RULES_FILE };
    }
    MasterError::Input { name, path, source }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evdev_decoder::AxisInfo;
    use crate::evdev_ioctl::Answers;
    use std::cell::Cell;

    /// A description as the kernel writes it, of a stick and of a keyboard with the same ids.
    fn described_inputs(of: &str) -> Vec<InputDevice> {
        let root = std::env::temp_dir().join(format!("krait-inputs-{of}-{}", std::process::id()));
        for (node, name, abs, key) in [
            ("event12", "Stick", "3003f", "fff00000000 0 0 0 0"),
            ("event3", "Keys", "0", "40000800 1e16c0000000003 10f908b17c000 403ffffff73fffff fffffffffffffffe"),
        ] {
            let device = root.join(node).join("device");
            for sub in ["id", "capabilities"] {
                std::fs::create_dir_all(device.join(sub)).expect("a folder");
            }
            let texts = [("name", name), ("id/vendor", "046d"), ("id/product", "c215"), ("capabilities/abs", abs)];
            for (file, text) in texts.into_iter().chain([("capabilities/key", key)]) {
                std::fs::write(device.join(file), format!("{text}\n")).expect("written");
            }
        }
        std::fs::create_dir_all(root.join("mouse0")).expect("a folder");
        let devices = listed(&root, Path::new("/nowhere"));
        std::fs::remove_dir_all(&root).expect("removed");
        devices
    }

    #[test]
    fn the_node_that_has_the_profiles_axes_is_chosen_and_no_keyboard_of_the_same_maker() {
        let devices = described_inputs("chosen");
        let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
        assert_eq!(names, ["Keys", "Stick"], "by number, nodes of events only");
        assert_eq!(devices[1].axes, [0, 1, 2, 3, 4, 5, 16, 17]);
        assert_eq!(devices[1].buttons[0], 0x120);
        let text = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n";
        let host = |text: &str| EvdevHost { profile: Profile::parse("stick.toml", text).expect("a profile") };
        assert_eq!(host(text).chosen(&devices).expect("there").node, Path::new("/nowhere/event12"));
        let more = host(&text.replace("ABS_X", "ABS_GAS")).chosen(&devices).expect_err("no such axis").to_string();
        assert!(
            more.contains("with every axis and button") && more.contains("\"Stick\" at /nowhere/event12"),
            "{more}"
        );
        let other = host(&text.replace("c215", "c216")).chosen(&devices).expect_err("no such device").to_string();
        assert!(other.contains("046d:c216 (Stick)") && !other.contains("with every"), "{other}");
        assert!(host(text).chosen(&[]).expect_err("nothing").to_string().contains("are none"));
    }

    #[test]
    fn what_a_profile_wants_to_be_told_by_is_refused_where_the_device_has_none() {
        let [plain, _] = described_inputs("tells").try_into().expect("two");
        let (lights, rumbles) = (vec![0, 1], true);
        let gamepad = InputDevice { lights, rumbles, ..plain.clone() };
        let asked = |device: &InputDevice, head: &str| {
            let text =
                format!("name = \"Stick\"\nid = \"046d:c215\"\n{head}\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\n");
            device.cannot_tell(&Profile::parse("stick.toml", &text).expect("a profile"))
        };
        let load = "lights = { load = \"LED_CAPSL\" }";
        let lit = |found: &str| Some(("lights.load", "a light that this device has", found.to_owned()));
        assert_eq!(asked(&plain, load), lit("none"));
        assert_eq!(asked(&gamepad, load), None);
        assert_eq!(asked(&gamepad, "lights = { load = \"LED_MUTE\" }"), lit("LED_NUML, LED_CAPSL"));
        assert_eq!(asked(&plain, "lights = { limit = \"LED_CAPSL\" }"), None, "it stays dark");
        assert_eq!(asked(&plain, "rumble = { limit = 1.0 }").expect("no motors").0, "rumble");
        assert_eq!(asked(&gamepad, "rumble = { limit = 1.0 }"), None);
        assert_eq!(bits("107030000 0"), [80, 81, 88, 89, 90, 96], "as an Xbox pad says it");
    }

    #[test]
    fn a_device_that_may_not_be_opened_is_told_with_its_own_rule() {
        let devices = described_inputs("refused");
        let text = refusal(&devices[1], Error::from(ErrorKind::PermissionDenied)).to_string();
        let rule = r#"KERNEL=="event*", ATTRS{id/vendor}=="046d", ATTRS{id/product}=="c215", ATTRS{name}=="Stick", MODE="0660", TAG+="uaccess""#;
        assert!(text.contains(rule) && text.contains("/nowhere/event12"), "{text}");
        let busy = refusal(&devices[1], Error::from(ErrorKind::ResourceBusy)).to_string();
        assert!(busy.contains("another program") && !busy.contains("udevadm"), "{busy}");
    }

    #[test]
    fn a_keyboard_is_taken_when_its_keys_are_up_and_no_other_button_is_waited_for() {
        let devices = described_inputs("let-go");
        let n_asked = Cell::new(0);
        let let_go_later = || {
            n_asked.set(n_asked.get() + 1);
            if n_asked.get() < 3 { vec![28] } else { Vec::new() }
        };
        wait_until_let_go(&Answers(|_| AxisInfo::default(), let_go_later), &devices[0]).expect("let go");
        assert_eq!(n_asked.get(), 3);
        let held = Answers(|_| AxisInfo::default(), || vec![28]);
        let refused = wait_until_let_go(&held, &devices[0]).expect_err("held").to_string();
        assert!(refused.contains("KEY_ENTER is held down") && refused.contains("let go of all keys"), "{refused}");
        let latched = Answers(|_| AxisInfo::default(), || vec![0x120]);
        wait_until_let_go(&latched, &devices[1]).expect("a stick's own");
    }
}
