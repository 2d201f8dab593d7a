//! A SpaceMouse on hidraw and a pedal on evdev in one master of a real chain: the pedal is presence and clutch, either loss ends the motion at
//! once, and the file of both gives the same inputs again, across both losses.

use super::unplug::stop_after;
use crate::aside::Aside;
use crate::chain::{Journal, User, VmChain, VmEnded};
use crate::model::Model;
use crate::pedal::{PRODUCT_ID, PROFILE, Pedal};
use crate::repeated;
use crate::spacemouse::SpaceMouse;
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_ipc::message::DeviceState;
use krait_master::{MasterConfig, Presence};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

const MOVED_DEG: f64 = 2.0;
const REPORTS: &str = "/tmp/pedal.krr";
/// The master's silence limit: a loss that is told sooner was told by the kernel, ns.
const TOLD_NS: i64 = 100_000_000;
/// How long the snake may take to brake, ns.
const BRAKING_NS: i64 = 100_000_000;
/// Longer than the master's pause between two searches.
const FOUND: Duration = Duration::from_millis(900);

/// Stretches of time, CLOCK_MONOTONIC, ns.
#[derive(Default)]
struct Instants {
    absent: (i64, i64),
    present: (i64, i64),
    clutched: (i64, i64),
    /// From each loss until presence is given anew, and then on.
    lost: [(i64, i64); 2],
    given_anew: [(i64, i64); 2],
}

/// Both in one chain.
pub fn pedal() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let (profile, config) = ("/tmp/pedal.toml", "/tmp/pedal-chain.toml");
    std::fs::write(profile, PROFILE).context("a profile")?;
    let beside = format!("record_reports = \"{REPORTS}\"\n[[master.beside]]\nprofile = \"{profile}\"\n");
    std::fs::write(config, format!("[master]\npresence = \"hold:0\"\n{beside}")).context("a configuration")?;
    let (mouse, pedal) = (SpaceMouse::plug(Model::Compact)?, Pedal::plug()?);
    let listed = VmEnded::of(User::Root, &["devices", "--config", config])?;
    verdict.check(
        "fits",
        listed.stdout.lines().any(|line| line.contains("05f3:00ff") && line.contains("Pedal")),
        "Pedal",
    );
    let found = VmEnded::of(User::Root, &["devices", "--json"])?.json()?;
    let found = found.as_array().context("no list of devices")?;
    let is_node = |device: &&serde_json::Value| {
        device["product_id"] == PRODUCT_ID
            && device["path"].as_str().is_some_and(|path| path.starts_with("/dev/input/"))
    };
    let could_be = found.iter().find(is_node).map(|device| &device["could_be"]);
    verdict.check("could_be", could_be.is_some_and(|name| *name == "pedal"), "pedal");
    let chain = VmChain::start_with("pedal", User::Root, 24.0, &["--config", config])?;
    mouse.wait_until_read().context("at the start")?;
    let other = VmEnded::of(
        User::Root,
        &["run", "--master", "hid", "--config", config, "--instance", "other", "--no-recording", "--seconds", "1"],
    )?;
    let is_refused = other.code == Some(2) && other.stderr.contains("is read by another krait");
    verdict.check("second_master", is_refused, format!("{:?}", other.code));
    let aside = Aside::begin()?;
    let at = play(mouse, pedal)?;
    drop(aside);
    let (ended, journal, recording) = chain.end_with_recording()?;
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    let is_told =
        ended.stderr.contains("the hand is the SpaceMouse and beside it \"Pedal\" (button 0, button 1, button 9)");
    verdict.check("told_at_start", is_told, is_told);
    judge(&mut verdict, &journal, &at)?;
    let config = MasterConfig { presence: Presence::Hold(0), ..MasterConfig::default() };
    repeated::judge_inputs(&mut verdict, &journal.inputs, &config, Path::new(REPORTS))?;
    repeated::judge_commands(&mut verdict, &recording)?;
    Ok(verdict)
}

fn play(mut mouse: SpaceMouse, mut pedal: Pedal) -> anyhow::Result<Instants> {
    let mut at = Instants::default();
    let now = clock::monotonic_ns;
    let lasted = |begun_ns: i64| (begun_ns, clock::monotonic_ns());
    let begun = now();
    // The cap's own button 0 is none.
    mouse.press(0)?;
    mouse.hold(250, 200)?;
    mouse.release()?;
    at.absent = lasted(begun);
    let begun = now();
    pedal.hold(0b001)?;
    mouse.hold(250, 300)?;
    at.present = lasted(begun);
    pedal.hold(0b011)?;
    mouse.hold(250, 150)?;
    let begun = now();
    mouse.hold(250, 200)?;
    at.clutched = lasted(begun);
    pedal.hold(0b001)?;
    mouse.hold(250, 100)?;

    // The pedal goes while the cap is held, and comes back.
    let begun = now();
    drop(pedal);
    mouse.hold(250, 400)?;
    let mut pedal = Pedal::plug()?;
    sleep(FOUND);
    mouse.hold(250, 200)?;
    mouse.release()?;
    at.lost[0] = lasted(begun);
    let begun = now();
    pedal.hold(0b001)?;
    mouse.hold(-250, 300)?;
    at.given_anew[0] = lasted(begun);

    // The hand goes while the pedal is held, and comes back; the pedal stays down and another of its buttons is pressed.
    let begun = now();
    mouse.unplug()?;
    sleep(Duration::from_millis(400));
    let mut mouse = SpaceMouse::plug(Model::Compact)?;
    mouse.wait_until_read().context("plugged in again")?;
    mouse.release()?;
    mouse.hold(250, 100)?;
    pedal.hold(0b101)?;
    mouse.hold(250, 200)?;
    mouse.release()?;
    at.lost[1] = lasted(begun);
    let begun = now();
    pedal.hold(0)?;
    pedal.hold(0b001)?;
    mouse.hold(250, 300)?;
    at.given_anew[1] = lasted(begun);
    mouse.release()?;
    pedal.hold(0)?;
    Ok(at)
}

fn judge(verdict: &mut PartVerdict, journal: &Journal, at: &Instants) -> anyhow::Result<()> {
    let moved = |(from_ns, to_ns)| journal.moved_deg(from_ns, to_ns);
    let absent = moved(at.absent);
    verdict.check("caps_button_moved_deg", absent == 0.0, absent);
    let present = moved(at.present);
    verdict.check("pedal_moved_deg", present > MOVED_DEG, format!("{present:.1}"));
    let clutched = moved(at.clutched);
    verdict.check("clutched_moved_deg", clutched == 0.0, clutched);
    for (nth, name) in ["pedal_stop_command_virtual_us", "hand_stop_command_virtual_us"].into_iter().enumerate() {
        stop_after(journal, Path::new(REPORTS), nth)?.judge(verdict, name);
    }
    let names = [
        ("pedal_told_virtual_ms", "pedal_inputs_moving", "pedal_rest_moved_deg", "pedal_again_moved_deg"),
        ("hand_told_virtual_ms", "hand_inputs_moving", "hand_rest_moved_deg", "hand_again_moved_deg"),
    ];
    for (idx, (is_told, is_still, is_at_rest, is_back)) in names.into_iter().enumerate() {
        let (lost_ns, until_ns) = at.lost[idx];
        let told = journal.inputs.iter().find(|i| i.sample_ns > lost_ns && i.device() == Some(DeviceState::Lost));
        let told_ns = told.with_context(|| format!("{is_told}: the loss is in no input"))?.sample_ns - lost_ns;
        verdict.check(is_told, told_ns < TOLD_NS, format!("{:.1}", told_ns as f64 * 1e-6));
        let from_ns = lost_ns + told_ns;
        let n_moving = journal
            .inputs
            .iter()
            .filter(|i| (from_ns..until_ns).contains(&i.sample_ns))
            .filter(|i| i.tip_vel_in_view_m_per_s != [0.0; 3])
            .count();
        verdict.check(is_still, n_moving == 0, n_moving);
        let rest = moved((from_ns + BRAKING_NS, until_ns));
        verdict.check(is_at_rest, rest == 0.0, rest);
        let again = moved(at.given_anew[idx]);
        verdict.check(is_back, again > MOVED_DEG, format!("{again:.1}"));
    }
    Ok(())
}
