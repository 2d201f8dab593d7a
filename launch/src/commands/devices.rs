//! `krait devices`: the hand controllers on this machine, and what is missing to use them.

mod calibrate;
mod live;

use crate::cli::Common;
use crate::cli_devices::DevicesArgs;
use crate::config::Config;
use crate::print;
use anyhow::Context;
use krait_master::{DeviceInfo, InputDevice, JoinedHand, MasterError, Profile, ProfileDevice, RULES_FILE};
use krait_report::Table;
use serde::Serialize;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// One device, as `--json` prints it: first what sends raw HID reports, then the nodes of the kernel's input system.
#[derive(Debug, Serialize)]
struct Device {
    path: String,
    vendor_id: u16,
    product_id: u16,
    product: String,
    serial: String,
    /// The name of the hand controller if krait knows its reports or a profile is of it.
    known_as: Option<String>,
    /// The built-in profile that would fit a mouse, keyboard or pedal, which is a hand only where it is named.
    could_be: Option<&'static str>,
    may_open: bool,
    /// Axes, buttons and lights of an input node, as a profile names them.
    axes: Vec<String>,
    buttons: Vec<String>,
    lights: Vec<String>,
    /// Whether it has motors that rumble.
    rumbles: bool,
    /// The line for udev that lets the user of this seat open it.
    udev_rule: String,
}

/// Lists every device that could be a hand, whether krait knows it or a profile is of it, and whether it may be opened.
/// With `--config` the profiles of its hand and of the devices beside that are looked for too. With `--live` or `--calibrate`: reads one of them.
pub fn run(common: &Common, args: &DevicesArgs) -> anyhow::Result<ExitCode> {
    if let Some(path) = &args.calibrate {
        return calibrate::run(args, path);
    }
    if args.live {
        return live::run(args);
    }
    anyhow::ensure!(
        args.seconds.is_none(),
        "--seconds is for --live and --calibrate; add one of them, or leave it out for the list"
    );
    anyhow::ensure!(
        args.node.is_none() || args.profile.is_some(),
        "--node says which device --profile is of, or is for --live and --calibrate; add one of them, or leave it out for the list"
    );
    // One's own comes first.
    let mut own =
        Vec::from_iter(args.profile.as_deref().map(|path| profile_of(path, args.node.as_deref())).transpose()?);
    if let Some(path) = &common.config {
        own.extend(JoinedHand::read(&Config::load(Some(path))?.master)?.profiles().cloned());
    }
    let shipped = Profile::shipped()?;
    let mut devices: Vec<Device> = krait_master::list_devices()?.into_iter().map(of_hid).collect();
    devices.extend(krait_master::list_inputs().into_iter().map(|input| of_input(input, &own, &shipped)));
    if let Some(path) = &args.write_udev {
        write_rules(path, &rules(&devices))?;
        say_next(path);
    }
    if args.json {
        print::json(&devices)?;
    } else if devices.is_empty() {
        print::out(
            "no HID or input device is on this machine; without one, `krait run --engage` plays the shipped recording\n",
        )?;
    } else {
        print::out(&(table(&devices).to_string() + &advice(&devices)))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A profile, of the device that was named for it if one was.
fn profile_of(path: &Path, node: Option<&Path>) -> Result<Profile, MasterError> {
    node.map_or_else(|| Profile::load(path), |node| Profile::of_device(path, Some(node)))
}

/// The node of the device that shall be read: the one that was named, else the first that the profile is of.
fn node_of(node: Option<&Path>, profile: &Profile) -> anyhow::Result<PathBuf> {
    if let Some(node) = node {
        return Ok(node.to_owned());
    }
    let inputs = krait_master::list_inputs();
    let found = inputs.into_iter().find(|input| input.is_of(profile) && input.has_all_of(profile));
    found.map(|input| input.node).with_context(|| {
        format!("no device of the profile {:?} is here; plug it in, or name its node with --node", profile.name)
    })
}

fn of_hid(info: DeviceInfo) -> Device {
    Device {
        udev_rule: info.udev_rule(),
        path: info.path,
        vendor_id: info.vendor_id,
        product_id: info.product_id,
        product: info.product,
        serial: info.serial,
        known_as: info.known.map(|known| known.name.to_owned()),
        could_be: None,
        may_open: info.may_open,
        axes: Vec::new(),
        buttons: Vec::new(),
        lights: Vec::new(),
        rumbles: false,
    }
}

fn of_input(input: InputDevice, own: &[Profile], shipped: &[(&'static str, Profile)]) -> Device {
    let mut profiles = own.iter().chain(shipped.iter().map(|(_, profile)| profile));
    let fitting = profiles.find(|profile| input.is_of(profile) && input.has_all_of(profile));
    // A stick has the buttons of a pedal too.
    let could_be = |profile: &Profile| input.has_all_of(profile) && (input.axes.is_empty() || !profile.axes.is_empty());
    let unnamed = shipped.iter().find(|(_, profile)| profile.device == ProfileDevice::Unnamed && could_be(profile));
    Device {
        known_as: fitting.map(|profile| profile.name.clone()),
        could_be: unnamed.map(|(name, _)| *name).filter(|_| fitting.is_none()),
        udev_rule: input.udev_rule(),
        axes: input.axis_names(),
        buttons: input.button_names(),
        lights: input.light_names(),
        rumbles: input.rumbles,
        path: input.node.display().to_string(),
        vendor_id: input.vendor_id,
        product_id: input.product_id,
        product: input.name,
        serial: String::new(),
        may_open: input.may_open,
    }
}

/// The lines that the hands among the devices need, each once. Of what is no hand nothing is opened: it may be a keyboard.
fn rules(devices: &[Device]) -> Vec<&str> {
    let mut lines: Vec<&str> = Vec::new();
    for device in devices.iter().filter(|device| device.known_as.is_some()) {
        if !lines.contains(&device.udev_rule.as_str()) {
            lines.push(&device.udev_rule);
        }
    }
    lines
}

/// Never over a file that there is.
fn write_rules(path: &Path, lines: &[&str]) -> anyhow::Result<()> {
    anyhow::ensure!(
        !lines.is_empty(),
        "{} was not written: no hand controller that krait or a profile knows is here; plug it in, or name its profile with --profile, and of a mouse or keyboard its node with --node too",
        path.display()
    );
    let text = format!("# Hand controllers of krait, for the user at this seat.\n{}\n", lines.join("\n"));
    let file = File::options().write(true).create_new(true).open(path);
    file.and_then(|mut file| file.write_all(text.as_bytes()))
        .with_context(|| format!("{} could not be written; name a new file in a folder of yours", path.display()))
}

/// What is left to do with the file, on standard error: standard output may be JSON.
#[allow(clippy::print_stderr)]
fn say_next(path: &Path) {
    eprintln!(
        "{} is written; now `sudo cp {0} {RULES_FILE} && sudo udevadm control --reload && sudo udevadm trigger`",
        path.display()
    );
}

fn advice(devices: &[Device]) -> String {
    let missing = devices.iter().filter(|device| device.known_as.is_some() && !device.may_open);
    let mut said: String = missing.map(|device| format!("\n{} needs this line in {RULES_FILE}, then `sudo udevadm control --reload && sudo udevadm trigger`:\n  {}\n", device.path, device.udev_rule)).collect();
    let could_be = |device: &Device, is_pedal: bool| device.could_be.filter(|name| (*name == "pedal") == is_pedal);
    if let Some(device) = devices.iter().find(|device| could_be(device, true).is_some()) {
        said += &format!(
            "\nA pedal is part of a hand only where you name it: `krait run --master hid --beside pedal={}`.\n",
            device.path
        );
    }
    if let Some((device, name)) = devices.iter().find_map(|device| Some((device, could_be(device, false)?))) {
        said += &format!(
            "\nA mouse or keyboard is a hand only where you name it, and then it does nothing else: `krait run --master hid --profile {name} --node {}`.\n",
            device.path
        );
    }
    said
}

fn table(devices: &[Device]) -> Table {
    let mut table =
        Table::new(&["device", "vendor:product", "product", "hand controller", "axes", "buttons", "may be opened"]);
    for device in devices {
        let is_input = !device.axes.is_empty() || !device.buttons.is_empty();
        let count = |names: &[String]| if is_input { names.len().to_string() } else { String::new() };
        table.row(vec![
            device.path.clone(),
            format!("{:04x}:{:04x}", device.vendor_id, device.product_id),
            device.product.clone(),
            device.known_as.clone().unwrap_or_else(|| {
                device.could_be.map_or_else(|| "no".to_owned(), |name| format!("with --profile {name}"))
            }),
            count(&device.axes),
            count(&device.buttons),
            if device.may_open { "yes".to_owned() } else { "no".to_owned() },
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stick(node: &str, axes: &[u16], may_open: bool) -> InputDevice {
        InputDevice {
            node: node.into(),
            vendor_id: 0x046d,
            product_id: 0xc215,
            name: "Stick".to_owned(),
            axes: axes.to_vec(),
            ways: Vec::new(),
            buttons: vec![0x120, 0x121, 0x122],
            lights: vec![8],
            rumbles: true,
            may_open,
        }
    }

    fn shipped() -> Vec<(&'static str, Profile)> {
        Profile::shipped().expect("good")
    }

    #[test]
    fn a_profile_fits_the_node_with_its_axes_and_its_missing_rule_is_printed_and_written_once() {
        let nodes = [
            stick("/dev/input/event5", &[0, 1, 5], false),
            stick("/dev/input/event6", &[0, 1, 5], false),
            stick("/dev/input/event7", &[0], false),
        ];
        let devices: Vec<Device> = nodes.into_iter().map(|node| of_input(node, &[], &shipped())).collect();
        let names: Vec<Option<&str>> = devices.iter().map(|device| device.known_as.as_deref()).collect();
        assert_eq!(names, [Some("Logitech Extreme 3D Pro"), Some("Logitech Extreme 3D Pro"), None]);
        assert_eq!((devices[0].axes[2].as_str(), devices[0].buttons[0].as_str()), ("ABS_RZ", "BTN_TRIGGER"));
        assert_eq!((devices[0].lights[0].as_str(), devices[0].rumbles), ("LED_MISC", true));
        let said = advice(&devices);
        assert!(said.contains("/dev/input/event5 needs") && !said.contains("event7"), "{said}");
        let path = std::env::temp_dir().join(format!("krait-rules-{}", std::process::id()));
        write_rules(&path, &rules(&devices)).expect("written");
        let text = std::fs::read_to_string(&path).expect("read");
        assert_eq!(text.matches("KERNEL==\"event*\", ATTRS{id/vendor}==\"046d\"").count(), 1, "{text}");
        let again = format!("{:#}", write_rules(&path, &rules(&devices)).expect_err("never over a file"));
        assert!(again.contains("name a new file"), "{again}");
        std::fs::remove_file(&path).expect("removed");
        assert!(write_rules(&path, &[]).expect_err("nothing to write").to_string().contains("--profile"));
        assert!(!path.exists());
    }

    #[test]
    fn a_mouse_and_a_keyboard_are_told_what_they_could_be_and_get_no_rule_before_they_are_named() {
        let mouse = InputDevice {
            ways: vec![0, 1, 8, 11],
            buttons: vec![0x110, 0x111, 0x112],
            name: "Wheel [Mouse]".to_owned(),
            ..stick("/dev/input/event3", &[], true)
        };
        let keyboard = InputDevice {
            buttons: (1..120).collect(),
            name: "Keys".to_owned(),
            ..stick("/dev/input/event4", &[], false)
        };
        let devices = [mouse.clone(), keyboard.clone()].map(|input| of_input(input, &[], &shipped()));
        assert_eq!([0, 1].map(|idx| devices[idx].could_be), [Some("mouse"), Some("keyboard")]);
        assert_eq!(devices[0].axes, ["REL_X", "REL_Y", "REL_WHEEL", "REL_WHEEL_HI_RES"]);
        assert!(rules(&devices).is_empty(), "nobody has named them");
        let said = advice(&devices);
        assert!(
            said.contains("--profile mouse --node /dev/input/event3") && !said.contains("needs this line"),
            "{said}"
        );
        assert!(table(&devices).to_string().contains("with --profile keyboard"));
        let pedal = InputDevice { name: "Foot".to_owned(), ..stick("/dev/input/event9", &[], true) };
        let unknown = InputDevice { vendor_id: 1, ..stick("/dev/input/event10", &[0, 1], true) };
        let devices = [pedal, unknown].map(|input| of_input(input, &[], &shipped()));
        assert_eq!([0, 1].map(|idx| devices[idx].could_be), [Some("pedal"), None], "a stick is no pedal");
        let said = advice(&devices);
        assert!(said.contains("--beside pedal=/dev/input/event9`") && !said.contains("mouse"), "{said}");
        let own = Profile::parse(
            "own.toml",
            "name = \"Mine\"\nid = \"046d:c215\"\nrelease = \"KEY_ESC\"\n[[axis]]\nof = \"x\"\nplus = \"KEY_D\"\nminus = \"KEY_A\"\n",
        );
        let own = own.expect("a profile");
        let devices = [mouse, keyboard].map(|input| of_input(input, std::slice::from_ref(&own), &shipped()));
        assert_eq!((devices[0].known_as.as_deref(), devices[1].known_as.as_deref()), (None, Some("Mine")));
        let lines = rules(&devices);
        assert!(lines.len() == 1 && lines[0].contains("ATTRS{name}==\"Keys\""), "{lines:?}");
        assert!(!devices[0].udev_rule.contains("ATTRS{name}"), "brackets mean something to udev");
    }
}
