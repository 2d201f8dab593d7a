//! Whose reports a recording rests on: the operator's device and its serial number, for the recording's metadata.

use crate::cli::MasterKind;
use krait_master::{BesideConfig, DeviceInfo, HidRecording, Layout, MasterConfig, Profile, ProfileDevice};
use std::collections::BTreeMap;
use std::path::Path;

/// Key of the device in the metadata record `krait`.
pub const DEVICE_KEY: &str = "device";
/// Key of its serial number.
pub const SERIAL_KEY: &str = "device_serial";

/// Enters the device and its serial number as they are when a run begins. Where no device takes part, what takes its place
/// is named as that, and the serial number says that there is none.
pub fn enter(metadata: &mut BTreeMap<String, String>, config: &MasterConfig, master: MasterKind, input: Option<&Path>) {
    let (device, serial) = match (master, input) {
        (MasterKind::Hid, _) => {
            let (hand, serial) = match &config.profile {
                Some(path) => (profiled(path, config.node.as_deref()), "none (it tells none)".to_owned()),
                None => live(krait_master::chosen_device(&config.device)),
            };
            (hand + &beside(config), serial)
        }
        (MasterKind::Browser, _) => ("drive pad of the console's page".to_owned(), "none (drive pad)".to_owned()),
        (MasterKind::Pose, _) => {
            let listen = config.pose.listen.map_or_else(|| "no address".to_owned(), |listen| listen.to_string());
            (format!("pose sender, heard at {listen}"), "none (pose sender)".to_owned())
        }
        (MasterKind::Guide, _) => ("guide of an experiment".to_owned(), "none (guide)".to_owned()),
        (MasterKind::Replay, path) => (reports(path), "none (recorded reports)".to_owned()),
        (MasterKind::Script, path) => {
            let name = path.map_or_else(|| "unnamed".to_owned(), |path| path.display().to_string());
            (format!("script {name}"), "none (script)".to_owned())
        }
    };
    metadata.insert(DEVICE_KEY.to_owned(), device);
    metadata.insert(SERIAL_KEY.to_owned(), serial);
}

/// The devices beside it, each with what stands between.
fn beside(config: &MasterConfig) -> String {
    let named = |one: &BesideConfig| format!(" with {}", profiled(&one.profile, one.node.as_deref()));
    config.beside.iter().map(named).collect()
}

fn profiled(path: &Path, node: Option<&Path>) -> String {
    match Profile::of_device(path, node) {
        Ok(profile) => match profile.device {
            ProfileDevice::Id(vendor_id, product_id) => format!("{vendor_id:04x}:{product_id:04x} {}", profile.name),
            ProfileDevice::Path(node) => format!("{} {}", node.display(), profile.name),
            ProfileDevice::Unnamed => profile.name,
        },
        // The master refuses it with a sentence of its own.
        Err(_) => "none at the start".to_owned(),
    }
}

/// A device that cannot be had is no reason to say nothing: the master says so too and ends the chain.
fn live(found: Result<DeviceInfo, krait_master::MasterError>) -> (String, String) {
    match found {
        Ok(info) => {
            let serial = if info.serial.is_empty() { "none (it tells none)".to_owned() } else { info.serial };
            let name = info.known.map_or(info.product, |known| known.name.to_owned());
            (format!("{:04x}:{:04x} {name}", info.vendor_id, info.product_id), serial)
        }
        Err(error) => {
            tracing::debug!(%error, "no device to name");
            ("none at the start".to_owned(), "none at the start".to_owned())
        }
    }
}

fn reports(path: Option<&Path>) -> String {
    let (recording, name) = match path {
        Some(path) => (HidRecording::load(path), path.display().to_string()),
        None => (HidRecording::shipped(), "the shipped ones".to_owned()),
    };
    match recording.as_ref().map(HidRecording::header) {
        Ok(header) if header.layout == Some(Layout::Pose) => format!("recorded packets of a pose sender ({name})"),
        Ok(header) => {
            format!("recorded reports of {:04x}:{:04x} ({name})", header.vendor_id, header.product_id)
        }
        // The master refuses them with a sentence of its own.
        Err(_) => format!("recorded reports ({name})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entered(master: MasterKind, input: Option<&Path>) -> (String, String) {
        let mut metadata = BTreeMap::new();
        enter(&mut metadata, &MasterConfig::default(), master, input);
        (metadata[DEVICE_KEY].clone(), metadata[SERIAL_KEY].clone())
    }

    #[test]
    fn what_takes_a_devices_place_is_named_as_that() {
        let (device, serial) = entered(MasterKind::Replay, None);
        assert_eq!(device, "recorded reports of 046d:c626 (the shipped ones)");
        assert_eq!(serial, "none (recorded reports)");
        let (device, serial) = entered(MasterKind::Script, Some(Path::new("flick.csv")));
        assert_eq!((device.as_str(), serial.as_str()), ("script flick.csv", "none (script)"));
        assert_eq!(entered(MasterKind::Browser, None).1, "none (drive pad)");
    }

    #[test]
    fn a_pedal_beside_the_hand_is_named_with_it_and_beside_recorded_reports_there_is_none() {
        let pedal = BesideConfig { profile: "keyboard".into(), node: Some("/dev/input/event9".into()) };
        let stick = Some("extreme-3d-pro".into());
        let config = MasterConfig { profile: stick, beside: vec![pedal], ..MasterConfig::default() };
        for (master, due) in [
            (MasterKind::Hid, "046d:c215 Logitech Extreme 3D Pro with /dev/input/event9 "),
            (MasterKind::Replay, "recorded reports of 046d:c626 (the shipped ones)"),
        ] {
            let mut metadata = BTreeMap::new();
            enter(&mut metadata, &config, master, None);
            assert!(metadata[DEVICE_KEY].starts_with(due), "{}", metadata[DEVICE_KEY]);
        }
    }

    #[test]
    fn a_live_device_is_named_with_its_serial_number_or_with_what_is_wrong() {
        let device = |serial: &str| DeviceInfo {
            path: "/dev/hidraw0".to_owned(),
            vendor_id: 0x1209,
            product_id: 1,
            serial: serial.to_owned(),
            manufacturer: String::new(),
            product: "Cap".to_owned(),
            known: None,
            may_open: true,
        };
        assert_eq!(live(Ok(device("SN-7"))), ("1209:0001 Cap".to_owned(), "SN-7".to_owned()));
        assert_eq!(live(Ok(device(""))).1, "none (it tells none)");
        let gone = krait_master::MasterError::NoDevice { looked_for: "any".to_owned(), present: "none".to_owned() };
        assert_eq!(live(Err(gone)).1, "none at the start");
    }
}
