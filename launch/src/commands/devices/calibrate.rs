//! Asks a person to leave a hand alone, to move all of it, and to leave it alone again; then writes a profile.

use super::node_of;
use crate::cli_devices::DevicesArgs;
use crate::commands::overwrite::{refuse_existing, write_whole};
use crate::{print, signals};
use anyhow::{Context, bail, ensure};
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_master::{HandCalibration, InputWatch, Profile, ProfileAxis};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long it takes, s, and the least that a person and a device need.
const SECONDS: f64 = 20.0;
const LEAST_S: f64 = 3.0;
const MOST_S: f64 = 600.0;
/// Part of it at rest, before and after the motion, and how much of that is for coming to rest.
const REST_PART: f64 = 0.2;
const SETTLE_PART: f64 = 0.25;
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Writes the profile, or says why there is none.
pub(super) fn run(args: &DevicesArgs, path: &Path) -> anyhow::Result<ExitCode> {
    refuse_existing(path, "toml", args.force)?;
    let seconds = args.seconds.unwrap_or(SECONDS);
    ensure!(
        (LEAST_S..=MOST_S).contains(&seconds),
        "--seconds {seconds}: expected {LEAST_S} to {MOST_S} for a calibration; leave it out for {SECONDS}"
    );
    let profile = args.profile.as_deref().map(Profile::load).transpose()?;
    let node: PathBuf = match (&args.node, &profile) {
        (node, Some(profile)) => node_of(node.as_deref(), profile)?,
        (Some(node), None) => node.clone(),
        (None, None) => {
            bail!("which device? name its node with --node (`krait devices` lists them), or its profile with --profile")
        }
    };
    if let Some(profile) = &profile
        && !profile.axes.iter().any(|axis| axis.place().is_some())
    {
        let names: Vec<String> = profile.axes.iter().map(ProfileAxis::name).collect();
        bail!(
            "nothing of the profile {:?} can be calibrated: {} have neither rest nor range; set `full_counts_per_s` of a way and `deflection` of keys in a profile of your own (docs/hands.md), and look at them with `krait devices --live`",
            profile.name,
            names.join(", ")
        );
    }
    let stop = signals::stop_flag()?;
    // Only looked at first: of a device without axes, a keyboard may be, nothing shall be taken away.
    let looked = InputWatch::open(&node, false)?;
    let named: Vec<u16> = match looked.device() {
        Some(device) => device.axes.clone(),
        // A pipe does not say what it will tell.
        None => (0..6).collect(),
    };
    let profile = profile.unwrap_or_else(|| Profile::of_input(looked.device(), &node, &named));
    ensure!(
        !profile.axes.is_empty(),
        "{} has no axis with rest and range (ABS_X to ABS_RZ), so that nothing can be calibrated; of a mouse or keyboard use `--profile mouse` or `--profile keyboard` as it is (docs/hands.md), of another hand name its axes in a profile and that with --profile",
        node.display()
    );
    // A pipe is opened once: what it has told is gone.
    let mut watch = match looked.device() {
        Some(_) => {
            drop(looked);
            InputWatch::open(&node, true)?
        }
        None => looked,
    };
    let mut calibration = HandCalibration::new(profile, watch.axes());
    let part = |part: f64| Duration::from_secs_f64(seconds * part);
    let settling = part(REST_PART * SETTLE_PART);
    let resting = part(REST_PART * (1.0 - SETTLE_PART));
    let rest = format!("Leave it alone for {:.1} s.\n", seconds * REST_PART);
    for is_first in [true, false] {
        print::out(&rest)?;
        calibration.settles();
        follow(&mut watch, &mut calibration, settling, &stop)?;
        calibration.rests();
        follow(&mut watch, &mut calibration, resting, &stop)?;
        if is_first {
            let moving = part(1.0 - 2.0 * REST_PART);
            print::out(&format!(
                "Move every axis to both of its ends, and press its buttons in the order of their numbers: {:.1} s.\n",
                moving.as_secs_f64()
            ))?;
            calibration.moves();
            follow(&mut watch, &mut calibration, moving, &stop)?;
        }
    }
    let profile = calibration.finish()?;
    // Somebody may have made it meanwhile.
    refuse_existing(path, "toml", args.force)?;
    let text = format!(
        "# Calibrated by `krait devices --calibrate` in {seconds} s at {}.\n{}",
        node.display(),
        profile.to_text()
    );
    write_whole(path, text)
        .with_context(|| format!("{} could not be written; name a file in a folder of yours", path.display()))?;
    for (axis, place) in profile.axes.iter().filter_map(|axis| Some((axis, axis.place()?))) {
        if let (Some([low, high]), Some(rest), Some(noise)) = (place.range, place.rest, place.noise) {
            print::out(&format!("{}: {low} to {high}, rest {rest}, noise {noise}\n", axis.name()))?;
        }
    }
    print::out(&format!(
        "{} is written; look at it with `krait devices --live --profile {0}`, drive with `krait run --master hid --profile {0}`\n",
        path.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Hands on what the device tells, for a while.
fn follow(
    watch: &mut InputWatch,
    calibration: &mut HandCalibration,
    time: Duration,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    let end_ns = monotonic_ns() + i64::try_from(time.as_nanos())?;
    while monotonic_ns() < end_ns {
        ensure!(!stop.load(Ordering::Relaxed), "the calibration was ended; nothing is written");
        let is_there = watch.wait(LOOK_EVERY, |change| calibration.take(change))?;
        ensure!(is_there, "the device came to its end before the calibration; nothing is written: do it again");
    }
    Ok(())
}
