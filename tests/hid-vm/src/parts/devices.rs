//! Finding a hand controller, and saying why it may not be opened.

use crate::chain::{User, VmEnded};
use crate::model::{Model, SERIAL, VENDOR_ID};
use crate::spacemouse::SpaceMouse;
use crate::verdict::PartVerdict;
use anyhow::Context;

/// `krait devices --json` lists the device once, by name, and only while it is plugged in.
pub fn devices() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let before = listed(User::Root)?;
    let mouse = SpaceMouse::plug(Model::Compact)?;
    let found = listed(User::Root)?;
    verdict.check("before", before.is_empty(), before.len());
    verdict.check("listed", found.len() == 1, found.len());
    let device = found.first().context("no device is listed")?;
    let ids = (device["vendor_id"].as_u64(), device["product_id"].as_u64());
    verdict.check(
        "ids",
        ids == (Some(VENDOR_ID.into()), Some(Model::Compact.product_id().into())),
        format!("{ids:04x?}"),
    );
    verdict.check("known_as", device["known_as"] == Model::Compact.name(), &device["known_as"]);
    verdict.check("product", device["product"] == Model::Compact.name(), &device["product"]);
    verdict.check("serial", device["serial"] == SERIAL, &device["serial"]);
    verdict.check("path", device["path"] == mouse.node()?, &device["path"]);
    verdict.check("may_open", device["may_open"] == true, &device["may_open"]);
    mouse.unplug()?;
    let after = listed(User::Root)?;
    verdict.check("after", after.is_empty(), after.len());
    Ok(verdict)
}

/// A user who may only read the node is told the path, why, and the udev rule, in one sentence with exit code 2.
pub fn unreadable() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mouse = SpaceMouse::plug(Model::Compact)?;
    let node = mouse.node()?;
    mouse.permit(0o444)?;
    verdict.check("may_open_0444", may_open()? == Some(false), "no");
    let ended = VmEnded::of(User::Nobody, &["run", "--master", "hid", "--no-recording", "--instance", "unreadable"])?;
    verdict.check("exit_code", ended.code == Some(2), format!("{:?}", ended.code));
    let sentences: Vec<&str> = ended.stderr.lines().filter(|line| line.starts_with("krait: ")).collect();
    verdict.check("sentences", sentences.len() == 1, sentences.len());
    let sentence = sentences.first().copied().unwrap_or_default();
    verdict.check("names_path", sentence.contains(&node), &node);
    verdict.check("names_why", sentence.contains("Permission denied"), "permission");
    let product_id = Model::Compact.product_id();
    let rule =
        format!(r#"KERNEL=="hidraw*", ATTRS{{idVendor}}=="{VENDOR_ID:04x}", ATTRS{{idProduct}}=="{product_id:04x}""#);
    verdict.check("names_rule", sentence.contains(&rule) && sentence.contains("/etc/udev/rules.d/"), "udev");
    mouse.permit(0o666)?;
    verdict.check("may_open_0666", may_open()? == Some(true), "yes");
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    mouse.unplug()?;
    Ok(verdict)
}

fn listed(user: User) -> anyhow::Result<Vec<serde_json::Value>> {
    let ended = VmEnded::of(user, &["devices", "--json"])?;
    let all = ended.json()?.as_array().context("no list of devices")?.clone();
    // The same device is among the input devices too.
    let is_hidraw =
        |device: &serde_json::Value| device["path"].as_str().is_some_and(|path| path.starts_with("/dev/hidraw"));
    Ok(all.into_iter().filter(is_hidraw).collect())
}

/// Whether `krait devices` tells nobody that the only device may be opened.
fn may_open() -> anyhow::Result<Option<bool>> {
    Ok(listed(User::Nobody)?.first().and_then(|device| device["may_open"].as_bool()))
}
