//! The whole chain on the live device, and the proof that a spoiled device would have been noticed.

use crate::chain::{User, VmChain};
use crate::model::Model;
use crate::repeated;
use crate::spacemouse::{DeviceFault, SpaceMouse, Switched};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::message::DeviceState;
use std::path::Path;

/// How much of the shipped recording is played, s: one stroke to 55 deg and a part of a rotation of the plane.
const PLAY_S: f64 = 3.0;
/// What the chain runs beyond that, s: sockets, a rest, and what the machine spends on waking up.
const MORE_S: f64 = 0.7;
const CONFIG: &str = "/tmp/chain.toml";
const REPORTS: &str = "/tmp/chain.krr";
/// The recording's first stroke goes to 55 deg; a chain that lost a part of it gets less far.
const LEAST_COMMANDED_DEG: f64 = 50.0;
/// The simulated lines take some of the motion away before the estimator knows them.
const LEAST_REACHED_DEG: f64 = 35.0;

/// The shipped recording through the kernel: every report counted, nothing lost, the snake bends.
pub fn chain(fault: DeviceFault) -> anyhow::Result<PartVerdict> {
    let mut mouse = SpaceMouse::plug(Model::Compact)?;
    std::fs::write(CONFIG, format!("[master]\nrecord_reports = \"{REPORTS}\"\n")).context(CONFIG)?;
    if std::fs::exists(REPORTS)? {
        std::fs::remove_file(REPORTS).context(REPORTS)?;
    }
    let chain = VmChain::start_with("chain", User::Root, PLAY_S + MORE_S, &["--config", CONFIG])?;
    mouse.wait_until_read()?;
    let n_due = mouse.play(PLAY_S, fault)?;
    let (ended, journal, recording) = chain.end_with_recording()?;
    let lit = mouse.lit();
    mouse.unplug()?;

    let mut verdict = PartVerdict::default();
    let figures = ended.json()?;
    let figure = |pointer: &str| figures.pointer(pointer).and_then(serde_json::Value::as_f64).unwrap_or(f64::NAN);
    let last = journal.inputs.last().context("no input was recorded")?;
    let n_lost_states = journal.inputs.iter().filter(|input| input.device() == Some(DeviceState::Lost)).count();
    let commanded_deg = figure("/passes/0/peak_bend_deg/commanded");
    let reached_deg = figure("/passes/0/peak_bend_deg/reached");
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    verdict.check("reports", last.n_reports == n_due, format!("{}/{n_due}", last.n_reports));
    verdict.check("refused", last.n_refused == 0, last.n_refused);
    verdict.check("drained", last.n_drained == 0, last.n_drained);
    verdict.check("commanded_deg", commanded_deg > LEAST_COMMANDED_DEG, format!("{commanded_deg:.1}"));
    verdict.check("reached_deg", reached_deg > LEAST_REACHED_DEG, format!("{reached_deg:.1}"));
    verdict.check("sent", figure("/samples/sent") > 0.0, figure("/samples/sent"));
    verdict.check("lost", figure("/samples/lost") == 0.0, figure("/samples/lost"));
    verdict.check("whole", figures["recording_is_whole"] == true, &figures["recording_is_whole"]);
    verdict.check("device_lost", n_lost_states == 0, n_lost_states);
    verdict.check("at_rest_last", last.device() == Some(DeviceState::AtRest), format!("{:?}", last.device()));
    let is_dark = lit.last().is_some_and(|(_, what)| *what == Switched::Off);
    verdict.check("dark_at_end", is_dark, lit.len());
    let end_to_end_us = figure("/latency_us/end_to_end/p50");
    verdict.check("virtual_us_p50", end_to_end_us.is_finite(), format!("{end_to_end_us:.0}"));
    match fault {
        DeviceFault::None => repeated::judge(&mut verdict, &journal, Path::new(REPORTS), &recording)?,
        _ => std::fs::remove_file(recording).context("removing a recording")?,
    }
    Ok(verdict)
}

/// The part `chain` must fail on a silent device and on one that leaves out a single report, and for these reasons.
pub fn control() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let silent = chain(DeviceFault::Silent)?.failed();
    let is_noticed =
        ["reports", "commanded_deg", "reached_deg", "at_rest_last"].iter().all(|name| silent.contains(name));
    verdict.check("silent_fails", is_noticed, silent.join(","));
    let dropped = chain(DeviceFault::Drop)?.failed();
    verdict.check("drop_fails", dropped == ["reports"], dropped.join(","));
    Ok(verdict)
}
