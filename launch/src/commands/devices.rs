//! `krait devices`: the hand controllers on this machine, and what is missing to use them.

use crate::cli::DevicesArgs;
use crate::print;
use krait_master::DeviceInfo;
use krait_report::Table;
use serde::Serialize;
use std::process::ExitCode;

/// One device, as `--json` prints it.
#[derive(Serialize)]
struct Device<'a> {
    path: &'a str,
    vendor_id: u16,
    product_id: u16,
    product: &'a str,
    serial: &'a str,
    /// The name of the hand controller if krait knows its reports.
    known_as: Option<&'static str>,
    may_open: bool,
}

/// Lists every HID device, whether krait knows its reports, and whether it may be opened.
pub fn run(args: &DevicesArgs) -> anyhow::Result<ExitCode> {
    let found = krait_master::list_devices()?;
    let devices: Vec<Device> = found.iter().map(described).collect();
    if args.json {
        print::json(&devices)?;
    } else if devices.is_empty() {
        print::out(
            "no HID device is on this machine; without one, `krait run --engage` plays the shipped recording\n",
        )?;
    } else {
        print::out(&table(&devices).to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn described(info: &DeviceInfo) -> Device<'_> {
    Device {
        path: &info.path,
        vendor_id: info.vendor_id,
        product_id: info.product_id,
        product: &info.product,
        serial: &info.serial,
        known_as: info.known.map(|known| known.name),
        may_open: info.may_open,
    }
}

fn table(devices: &[Device]) -> Table {
    let mut table = Table::new(&["device", "vendor:product", "product", "hand controller", "may be opened"]);
    for device in devices {
        table.row(vec![
            device.path.to_owned(),
            format!("{:04x}:{:04x}", device.vendor_id, device.product_id),
            device.product.to_owned(),
            device.known_as.unwrap_or("no").to_owned(),
            if device.may_open { "yes".to_owned() } else { "no: a udev rule is missing, see README".to_owned() },
        ]);
    }
    table
}
