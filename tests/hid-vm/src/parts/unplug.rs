//! Pulling the plug while the cap is held, and plugging it in again, for an ordinary user whom udev lets in a little later.

use crate::aside::Aside;
use crate::chain::{Journal, User, VmChain, VmEnded};
use crate::model::Model;
use crate::repeated::zero_ns;
use crate::spacemouse::SpaceMouse;
use crate::verdict::PartVerdict;
use anyhow::{Context, ensure};
use krait_ipc::message::{Command, DeviceState, Phase};
use krait_ipc::{Reason, Reasons, clock};
use krait_master::{HidRecording, Plug, RecordedEvent};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

/// The master's silence limit: a loss that is told sooner was told by the kernel, not by silence, ns.
const SILENCE_LIMIT_NS: i64 = 100_000_000;
/// From a loss to the command that ends the motion, ns: two ticks of the master. 0.2 to 1.2 ms were measured, 41 times.
pub const STOP_NS: i64 = 2_000_000;
/// How often it is pulled out once more, how long the cap is held before it, and how long it stays out.
const N_MORE: u8 = 4;
const HELD_MS: i64 = 100;
const OUT: Duration = Duration::from_millis(150);
/// How long the snake may take to brake after the loss, ns.
const BRAKING_NS: i64 = 100_000_000;
/// A chain that goes on leaves no larger gap between two setpoints, ns: half of what its readers call stale.
const LARGEST_GAP_NS: i64 = 25_000_000;
const MOVED_DEG: f64 = 5.0;
/// How long the new node stays closed to the user: longer than the master's pause between two searches.
const UDEV_DELAY: Duration = Duration::from_millis(600);
const CONFIG: &str = "/tmp/unplug.toml";
const REPORTS: &str = "/tmp/unplug.krr";

/// When things happened to the device, CLOCK_MONOTONIC, ns.
struct Instants {
    held: i64,
    unplugged: i64,
    plugged: i64,
    pressed: i64,
    released: i64,
    /// How often krait had lit the second device before it was allowed to open it.
    n_lit_too_early: usize,
}

/// The snake comes to rest, the loss is named, the chain goes on; the device comes back and moves it after a press only.
pub fn unplug() -> anyhow::Result<PartVerdict> {
    let mouse = SpaceMouse::plug(Model::Compact)?;
    mouse.permit(0o666)?;
    std::fs::write(CONFIG, format!("[master]\nrecord_reports = \"{REPORTS}\"\n")).context(CONFIG)?;
    let chain = VmChain::start_with("unplug", User::Nobody, 9.0, &["--config", CONFIG])?;
    mouse.wait_until_read()?;
    let aside = Aside::begin()?;
    let (instants, mouse) = play(mouse)?;
    drop(aside);
    let (ended, journal) = chain.end()?;
    mouse.unplug()?;
    let mut verdict = PartVerdict::default();
    judge_stops(&mut verdict, &journal)?;
    judge_loss(&mut verdict, &ended, &journal, &instants)?;
    judge_return(&mut verdict, &ended, &journal, &instants)?;
    Ok(verdict)
}

/// The device that it gives back is the second one, still plugged in.
fn play(mut mouse: SpaceMouse) -> anyhow::Result<(Instants, SpaceMouse)> {
    let held = clock::monotonic_ns();
    mouse.press(0)?;
    mouse.hold(250, 400)?;
    let unplugged = clock::monotonic_ns();
    mouse.unplug()?;
    sleep(Duration::from_millis(700));
    let mut mouse = SpaceMouse::plug(Model::Compact)?;
    sleep(UDEV_DELAY);
    let n_lit_too_early = mouse.lit().len();
    mouse.permit(0o666)?;
    mouse.wait_until_read()?;
    let plugged = clock::monotonic_ns();
    mouse.hold(-250, 200)?;
    mouse.release()?;
    let pressed = clock::monotonic_ns();
    mouse.press(0)?;
    mouse.hold(-250, 300)?;
    mouse.release()?;
    let released = clock::monotonic_ns();
    for round in 0..N_MORE {
        mouse.press(0)?;
        // Not always at the same instant of a tick.
        mouse.hold(if round % 2 == 0 { 250 } else { -250 }, HELD_MS + 8 * i64::from(round))?;
        mouse.unplug()?;
        sleep(OUT);
        mouse = SpaceMouse::plug(Model::Compact)?;
        mouse.permit(0o666)?;
        mouse.wait_until_read()?;
    }
    Ok((Instants { held, unplugged, plugged, pressed, released, n_lit_too_early }, mouse))
}

/// The first command that tells of a loss.
pub struct Stop<'a> {
    command: &'a Command,
    /// How long master, `resolve` and `compensate` took one after the other until each had published, ns.
    hops_ns: [i64; 3],
}

impl Stop<'_> {
    /// Judges how long after the loss it was sent.
    pub fn judge(&self, verdict: &mut PartVerdict, name: &'static str) {
        verdict.check(name, (0..=STOP_NS).contains(&self.whole_ns()), self.figure());
    }

    fn whole_ns(&self) -> i64 {
        self.hops_ns.iter().sum()
    }

    /// The whole and its hops, us.
    fn figure(&self) -> String {
        let [master, resolve, compensate] = self.hops_ns.map(|ns| ns / 1000);
        format!("{}={master}+{resolve}+{compensate}", self.whole_ns() / 1000)
    }
}

/// The stop of the `nth` loss of a file: from the loss as the thread that reads the device stamps it there, by the input that tells of it
/// first.
pub fn stop_after<'a>(journal: &'a Journal, reports: &Path, nth: usize) -> anyhow::Result<Stop<'a>> {
    let events: Vec<(i64, usize, RecordedEvent)> = HidRecording::load(reports)?.events().collect();
    let mut losses = events.iter().filter(|(.., event)| matches!(event, RecordedEvent::Plug(Plug::Out)));
    let (out_ns, ..) = losses.nth(nth).context("the file does not know of the loss")?;
    let out_ns = zero_ns(&journal.inputs, &events)? + out_ns;
    let input = journal.inputs.iter().find(|i| i.sample_ns >= out_ns && i.device() == Some(DeviceState::Lost));
    let input = input.context("the loss is in no input")?;
    let is_stop = |command: &Command| Reasons::from_bits(command.reasons).contains(Reason::DeviceLost);
    let mut commands = journal.commands.iter().skip_while(|command| command.sample_ns < out_ns);
    let stop = commands.find(|command| is_stop(command)).context("no command tells of the loss")?;
    ensure!(stop.input_sequence == input.sequence, "the first command that tells of the loss is of another input");
    let s = &stop.stamps;
    let at_ns = [out_ns, s.input_sent_ns, s.setpoint_sent_ns, s.command_sent_ns];
    Ok(Stop { command: stop, hops_ns: core::array::from_fn(|hop| at_ns[hop + 1] - at_ns[hop]) })
}

/// From each loss to the command that ends the motion; after the first it goes no further.
fn judge_stops(verdict: &mut PartVerdict, journal: &Journal) -> anyhow::Result<()> {
    let stops = (0..=usize::from(N_MORE)).map(|nth| stop_after(journal, Path::new(REPORTS), nth));
    let stops = stops.collect::<anyhow::Result<Vec<Stop>>>()?;
    let in_time = stops.iter().all(|stop| (0..=STOP_NS).contains(&stop.whole_ns()));
    let figures: Vec<String> = stops.iter().map(Stop::figure).collect();
    verdict.check("stop_commands_virtual_us", in_time, figures.join(","));
    let stop = stops[0].command;
    // The cap was held to one side, so that all motion went outwards.
    let bend_rad = |command: &Command| command.bend_rad[0].hypot(command.bend_rad[1]);
    let before = journal.commands.iter().rfind(|command| command.sequence < stop.sequence);
    let was_moving = before.is_some_and(|command| command.phase == Phase::Following as u32);
    let goes_on_rad = bend_rad(stop) - before.map_or(f64::NAN, bend_rad);
    let holds = was_moving && stop.phase == Phase::Holding as u32 && goes_on_rad <= 0.0;
    verdict.check("stop_goes_on_deg", holds, goes_on_rad.to_degrees());
    Ok(())
}

fn judge_loss(verdict: &mut PartVerdict, ended: &VmEnded, journal: &Journal, at: &Instants) -> anyhow::Result<()> {
    let moved_deg = journal.moved_deg(at.held, at.unplugged);
    verdict.check("moved_deg", moved_deg > MOVED_DEG, format!("{moved_deg:.1}"));
    let lost = journal.inputs.iter().find(|i| i.sample_ns > at.unplugged && i.device() == Some(DeviceState::Lost));
    let told_ns = lost.context("the loss is in no input")?.sample_ns - at.unplugged;
    verdict.check("told_virtual_ms", told_ns < SILENCE_LIMIT_NS, format!("{:.1}", told_ns as f64 * 1e-6));
    let resting_ns = at.unplugged + told_ns + BRAKING_NS;
    let rest_deg = journal.moved_deg(resting_ns, at.plugged);
    verdict.check("rest_moved_deg", rest_deg == 0.0, rest_deg);
    let drives = journal.states.iter().filter(|state| (resting_ns..at.plugged).contains(&state.sample_ns));
    let mut positions: Vec<[f64; 3]> = drives.map(|state| krait_ipc::message::three(&state.setpoint_q_m)).collect();
    let n_states = positions.len();
    positions.dedup();
    verdict.check("drives_at_rest", n_states > 100 && positions.len() == 1, format!("{}/{n_states}", positions.len()));
    let (mut n_named, mut n_rest, mut last_ns, mut gap_ns) = (0, 0, None, 0);
    for setpoint in journal.setpoints_within(at.unplugged, at.released) {
        gap_ns = gap_ns.max(setpoint.sample_ns - last_ns.replace(setpoint.sample_ns).unwrap_or(setpoint.sample_ns));
        if (resting_ns..at.plugged - SILENCE_LIMIT_NS).contains(&setpoint.sample_ns) {
            n_rest += 1;
            n_named += u32::from(Reasons::from_bits(setpoint.reasons).contains(Reason::DeviceLost));
        }
    }
    verdict.check("named_in_setpoints", n_rest > 100 && n_named == n_rest, format!("{n_named}/{n_rest}"));
    verdict.check("named_in_health", journal.master_reasons().contains(Reason::DeviceLost), "DeviceLost");
    verdict.check("named_in_log", ended.stderr.contains("the hand controller was lost"), "lost");
    verdict.check("largest_gap_ms", gap_ns < LARGEST_GAP_NS, format!("{:.1}", gap_ns as f64 * 1e-6));
    Ok(())
}

fn judge_return(verdict: &mut PartVerdict, ended: &VmEnded, journal: &Journal, at: &Instants) -> anyhow::Result<()> {
    let live = journal.input_at(at.pressed).context("no input before the press")?;
    verdict.check("live_again", live.device() == Some(DeviceState::Live), format!("{:?}", live.device()));
    verdict.check("lit_too_early", at.n_lit_too_early == 0, at.n_lit_too_early);
    let unpressed_deg = journal.moved_deg(at.plugged, at.pressed);
    verdict.check("unpressed_moved_deg", unpressed_deg == 0.0, unpressed_deg);
    let pressed_deg = journal.moved_deg(at.pressed, at.released);
    verdict.check("pressed_moved_deg", pressed_deg > MOVED_DEG, format!("{pressed_deg:.1}"));
    let n_lost = ended.json()?.pointer("/samples/lost").and_then(serde_json::Value::as_u64);
    verdict.check("lost", n_lost == Some(0), format!("{n_lost:?}"));
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    Ok(())
}
