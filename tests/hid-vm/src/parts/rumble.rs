//! A gamepad's motors tell of limit, load and fault through the kernel's force feedback, as strongly as the profile says, and stop with the
//! master even where that is killed. A device without motors is refused.

use super::lights::FAST_HAND;
use crate::chain::{User, VmChain, VmEnded, signal};
use crate::gamepad::{Gamepad, PadKind, js_node, node};
use crate::pedal::{PROFILE, Pedal};
use crate::usb_hand::Stranger;
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use std::thread::sleep;
use std::time::Duration;

const RUMBLE: &str = "rumble = { limit = 0.5, fault = 1.0, load = 0.25 }\n";
const PAD: &str =
    "[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\nrest = 128\nnoise = 3\n[[button]]\nof = 0\nfrom = \"BTN_SOUTH\"\n";
/// What the motors are told for each, hundredths: limit and fault turn both, load the strong one.
const LIMIT: [u8; 2] = [50, 50];
const FAULT: [u8; 2] = [100, 100];
const LOAD: [u8; 2] = [25, 0];
const STILL: [u8; 2] = [0, 0];
/// A limit's pulse is a quarter of a second, a fault's half of one; looks, the reading thread and the machine add to it, ns.
const LIMIT_NS: core::ops::Range<i64> = 150_000_000..450_000_000;
/// A pulse of the load is an eighth of a second, ns.
const LOAD_NS: i64 = 240_000_000;
/// How soon the motors stop after the master was killed: the kernel does it, long before the fault's pulse would end, ns.
const KILLED_NS: i64 = 200_000_000;

/// Each in turn.
pub fn rumble() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    refused(&mut verdict)?;
    let profile = "/tmp/gamepad.toml";
    let text = format!("name = \"Gamepad\"\nid = \"045e:02fd\"\n{RUMBLE}{PAD}");
    std::fs::write(profile, text).context(profile)?;
    std::fs::write(FAST_HAND.0, FAST_HAND.1).context(FAST_HAND.0)?;
    let mut pad = Gamepad::plug(PadKind::XboxOne)?;
    let rumbles = node().is_some_and(|input| input.rumbles);
    verdict.check("listed", rumbles, rumbles);
    let arguments = ["--config", FAST_HAND.0, "--profile", profile];
    let chain = VmChain::start_with("rumble", User::Root, 14.0, &arguments)?;
    let begun_ns = pushed(&mut pad, &mut verdict)?;
    let limit_ns = pad.wait_until(begun_ns, LIMIT)?;
    // Two codes at the limit.
    sleep(Duration::from_millis(4200));
    let at_limit = pad.told();
    let is_of = |motors: [u8; 2]| at_limit.iter().filter(|(_, told)| *told == motors).count();
    let over = at_limit.iter().find(|(at_ns, told)| *at_ns > limit_ns && *told != LIMIT);
    let lasted_ns = over.map_or(i64::MAX, |(at_ns, _)| at_ns - limit_ns);
    verdict.check("limit_ms", LIMIT_NS.contains(&lasted_ns), lasted_ns / 1_000_000);
    verdict.check("n_load", (2..=8).contains(&is_of(LOAD)), is_of(LOAD));
    // Each pulse ends before the next one would begin, which is a quarter of a second after it.
    let lasted = at_limit.windows(2).filter(|two| two[0].1 == LOAD).map(|two| two[1].0 - two[0].0);
    let longest_ns = lasted.max().unwrap_or(i64::MAX);
    verdict.check("load_ms", longest_ns < LOAD_NS, longest_ns / 1_000_000);
    let n_other = at_limit.iter().filter(|(_, told)| ![LIMIT, LOAD, STILL].contains(told)).count();
    verdict.check("other", n_other == 0, format!("{n_other} of {}", at_limit.len()));
    pad.hold(0x80, 0)?;
    // The drives fall silent; while that is told, the master is killed.
    let silent_ns = clock::monotonic_ns();
    signal("slave", "STOP")?;
    pad.wait_until(silent_ns, FAULT)?;
    let killed_ns = clock::monotonic_ns();
    signal("master", "KILL")?;
    let stopped = pad.wait_until(killed_ns, STILL);
    signal("slave", "CONT")?;
    let stopped_ns = stopped? - killed_ns;
    verdict.check("killed_ms", stopped_ns < KILLED_NS, stopped_ns / 1_000_000);
    let ended = still_at_end(chain, &pad, &mut verdict)?;
    if !verdict.passed() {
        let told: Vec<String> =
            pad.told().iter().map(|(at, [a, b])| format!("{}:{a},{b}", (at - begun_ns) / 1_000_000)).collect();
        verdict.check("told", false, format!("{told:?} {:?}", ended.stderr));
    }
    Ok(verdict)
}

/// What the profile `xbox-360`, which krait ships, tells the motors at a limit and for the load.
const SHIPPED_LIMIT: [u8; 2] = [60, 60];
const SHIPPED_LOAD: [u8; 2] = [30, 0];

/// A pad of an Xbox 360 goes by the profile that krait ships for it, and its motors turn. Its other node, joydev's, is no second hand, and
/// whoever reads that hears nothing while krait has the pad.
pub fn shipped_rumble() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    std::fs::write(FAST_HAND.0, FAST_HAND.1).context(FAST_HAND.0)?;
    let mut pad = Gamepad::plug(PadKind::Xbox360)?;
    let rumbles = node().is_some_and(|input| input.rumbles);
    verdict.check("listed", rumbles, rumbles);
    let mut stranger = beside_joydev(&mut verdict)?;
    let arguments = ["--config", FAST_HAND.0, "--profile", "xbox-360"];
    let chain = VmChain::start_with("xbox-360", User::Root, 10.0, &arguments)?;
    let begun_ns = pushed(&mut pad, &mut verdict)?;
    let limit_ns = pad.wait_until(begun_ns, SHIPPED_LIMIT)?;
    verdict.check("limit_after_ms", limit_ns >= begun_ns, (limit_ns - begun_ns) / 1_000_000);
    pad.wait_until(limit_ns, SHIPPED_LOAD)?;
    let n_other = pad.told().iter().filter(|(_, told)| ![SHIPPED_LIMIT, SHIPPED_LOAD, STILL].contains(told)).count();
    verdict.check("other", n_other == 0, n_other);
    pad.hold(0x80, 0)?;
    let n_stolen = stranger.heard();
    verdict.check("js_hears", n_stolen == 0, n_stolen);
    still_at_end(chain, &pad, &mut verdict)?;
    pad.hold(0xff, 0)?;
    let n_given_back = stranger.heard();
    verdict.check("js_given_back", n_given_back > 0, n_given_back);
    Ok(verdict)
}

/// A stranger at joydev's node of the pad, which has heard how the pad was when it came, and nothing since.
fn beside_joydev(verdict: &mut PartVerdict) -> anyhow::Result<Stranger> {
    let js = js_node().context("joydev has made no node of the pad")?;
    verdict.check("js_node", js.exists(), js.display());
    let listed = VmEnded::of(User::Root, &["devices", "--json"])?.json()?;
    let listed = listed.as_array().context("no list of devices")?;
    let of_pad = |device: &&serde_json::Value| device["product_id"] == PadKind::Xbox360.product_id();
    let paths: Vec<&str> = listed.iter().filter(of_pad).filter_map(|device| device["path"].as_str()).collect();
    let hands = paths.iter().filter(|path| path.starts_with("/dev/input/")).count();
    let has_js = paths.iter().any(|path| path.contains("/js"));
    verdict.check("js_is_no_hand", hands == 1 && !has_js, paths.join(","));
    let mut stranger = Stranger::at_node(&js)?;
    let n_begun = stranger.heard();
    verdict.check("js_begins", n_begun > 0, n_begun);
    Ok(stranger)
}

/// At rest nothing is told; then a hand with its operator present pushes to the end. When that was, ns.
fn pushed(pad: &mut Gamepad, verdict: &mut PartVerdict) -> anyhow::Result<i64> {
    pad.hold(0x80, 0)?;
    sleep(Duration::from_millis(300));
    verdict.check("still_at_rest", pad.told().is_empty(), pad.told().len());
    for buttons in [1, 0] {
        pad.hold(0x80, buttons)?;
        sleep(Duration::from_millis(30));
    }
    let begun_ns = clock::monotonic_ns();
    pad.hold(0xff, 0)?;
    Ok(begun_ns)
}

/// The chain ends, and the motors are still.
fn still_at_end(chain: VmChain, pad: &Gamepad, verdict: &mut PartVerdict) -> anyhow::Result<VmEnded> {
    let (ended, _) = chain.end()?;
    verdict.check("ended", ended.code.is_some(), format!("{:?}", ended.code));
    let last = pad.told().last().map(|(_, motors)| *motors);
    verdict.check("still_at_end", last == Some(STILL), format!("{last:?}"));
    Ok(ended)
}

/// A pedal cannot rumble.
fn refused(verdict: &mut PartVerdict) -> anyhow::Result<()> {
    let _pedal = Pedal::plug()?;
    let profile = "/tmp/pedal-rumble.toml";
    std::fs::write(profile, format!("{RUMBLE}{PROFILE}")).context(profile)?;
    let arguments = ["run", "--master", "hid", "--profile", profile, "--instance", "no-motors", "--no-recording"];
    let ended = VmEnded::of(User::Root, &arguments)?;
    let says = "expected a device with motors that rumble, found none";
    let is_refused = ended.code.is_some_and(|code| code != 0) && ended.stderr.contains(says);
    verdict.check("refused", is_refused, format!("{:?}{}", ended.code, if is_refused { "" } else { &ended.stderr }));
    Ok(())
}
