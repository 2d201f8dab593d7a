//! Finds and opens the device of a profile among the kernel's input devices, and says in plain words what stands in the way.

use crate::evdev_decoder::EvdevDecoder;
use crate::evdev_ioctl::{axis_info, grab};
use crate::evdev_names::{axis_name, button_name};
use crate::evdev_port::EvdevPort;
use crate::hid::{HidHost, OpenPort, RULES_FILE};
use crate::{DeviceChoice, MasterError, Profile, ProfileDevice};
use rustix::fs::OFlags;
use std::fs::{File, read_to_string};
use std::io::{Error, ErrorKind};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// Where the kernel describes its input devices.
const SYS: &str = "/sys/class/input";

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
    /// Numbers of its axes.
    pub axes: Vec<u16>,
    /// Numbers of its buttons and keys.
    pub buttons: Vec<u16>,
    /// Whether this process may open it for reading.
    pub may_open: bool,
}

impl InputDevice {
    /// Whether it has every axis and button of a profile.
    pub fn has_all_of(&self, profile: &Profile) -> bool {
        profile.axes.iter().all(|axis| self.axes.contains(&axis.code))
            && profile.buttons.iter().all(|button| self.buttons.contains(&button.code))
    }

    /// Its axes, as a profile names them.
    pub fn axis_names(&self) -> Vec<String> {
        self.axes.iter().map(|code| axis_name(*code)).collect()
    }

    /// Its buttons and keys, as a profile names them.
    pub fn button_names(&self) -> Vec<String> {
        self.buttons.iter().map(|code| button_name(*code)).collect()
    }

    /// Whether a profile is of this device.
    pub fn is_of(&self, profile: &Profile) -> bool {
        match &profile.device {
            ProfileDevice::Id(vendor_id, product_id) => (self.vendor_id, self.product_id) == (*vendor_id, *product_id),
            ProfileDevice::Path(path) => path.canonicalize().is_ok_and(|node| node == self.node),
        }
    }

    /// The line for udev that lets the user of this seat open the device, and nobody's keyboard.
    pub fn udev_rule(&self) -> String {
        format!(
            "KERNEL==\"event*\", ATTRS{{id/vendor}}==\"{:04x}\", ATTRS{{id/product}}==\"{:04x}\", MODE=\"0660\", TAG+=\"uaccess\"",
            self.vendor_id, self.product_id
        )
    }
}

/// The input device behind a node or a link to one; none where the kernel describes none there.
pub fn input_at(node: &Path) -> Option<InputDevice> {
    let node = node.canonicalize().ok()?;
    inputs().into_iter().find(|device| device.node == node)
}

/// Every input device of this machine, by the numbers of their nodes.
pub fn list_inputs() -> Vec<InputDevice> {
    let mut devices = inputs();
    for device in &mut devices {
        device.may_open = open(&device.node).is_ok();
    }
    devices
}

/// The same without a node being touched: `may_open` is not asked.
fn inputs() -> Vec<InputDevice> {
    listed(Path::new(SYS), Path::new("/dev/input"))
}

pub(crate) fn open(node: &Path) -> std::io::Result<File> {
    let flags = (OFlags::NONBLOCK | OFlags::CLOEXEC).bits().cast_signed();
    File::options().read(true).custom_flags(flags).open(node)
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
        buttons: bits(&text("capabilities/key").unwrap_or_default()),
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
        let refused = |source: Error| refusal(&device, source);
        let file = open(&device.node).map_err(refused)?;
        // While it is open its node keeps its name: is it still the same device?
        let again = inputs().into_iter().find(|now| now.node == device.node);
        if again.is_none_or(|now| (now.vendor_id, now.product_id) != (device.vendor_id, device.product_id)) {
            return Err(refusal(&device, Error::other("another device has taken its node")));
        }
        grab(&file).map_err(refused)?;
        let decoder = EvdevDecoder::new(&self.profile, |code| axis_info(&file, code));
        let decoder = decoder.map_err(|found| MasterError::Profile {
            file: self.profile.name.clone(),
            place: format!("device {}", device.node.display()),
            expected: "axes of this device with a range".to_owned(),
            found,
        })?;
        let vid_pid = (device.vendor_id, device.product_id);
        Ok(OpenPort { port: Box::new(EvdevPort::new(file, decoder)), vid_pid })
    }
}

impl EvdevHost {
    fn chosen(&self, devices: &[InputDevice]) -> Result<InputDevice, MasterError> {
        let found = devices.iter().find(|device| device.is_of(&self.profile) && device.has_all_of(&self.profile));
        found.cloned().ok_or_else(|| {
            let of_it: Vec<&InputDevice> = devices.iter().filter(|device| device.is_of(&self.profile)).collect();
            let wanted = match &self.profile.device {
                ProfileDevice::Id(vendor_id, product_id) => format!("{vendor_id:04x}:{product_id:04x}"),
                ProfileDevice::Path(path) => path.display().to_string(),
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
    fn a_device_that_may_not_be_opened_is_told_with_its_own_rule() {
        let devices = described_inputs("refused");
        let text = refusal(&devices[1], Error::from(ErrorKind::PermissionDenied)).to_string();
        let rule =
            r#"KERNEL=="event*", ATTRS{id/vendor}=="046d", ATTRS{id/product}=="c215", MODE="0660", TAG+="uaccess""#;
        assert!(text.contains(rule) && text.contains("/nowhere/event12"), "{text}");
        let busy = refusal(&devices[1], Error::from(ErrorKind::ResourceBusy)).to_string();
        assert!(busy.contains("another program") && !busy.contains("udevadm"), "{busy}");
    }
}
