//! Scale and locks of the operator's motion: asked for with `krait state --scale | --lock | --unlock`, done when the operator's
//! next input says so.

use crate::cli::{Lock, StateArgs};
use crate::commands;
use anyhow::{bail, ensure};
use core::time::Duration;
use krait_ipc::message::{MotionWish, OperatorInput};
use krait_ipc::{Bus, ReadOptions, clock};

/// The master publishes every millisecond.
const PATIENCE_NS: i64 = 5_000_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// Asks the master, and waits until its inputs say that it has been done.
///
/// # Errors
/// One sentence: there is no master, the scale is out of range, or the master did not answer.
pub fn ask(bus: &Bus, args: &StateArgs) -> anyhow::Result<()> {
    commands::refuse_without(bus, "master", "state")?;
    let wish = wish_of(args)?;
    let mut inputs = bus.reader::<OperatorInput>(ReadOptions::observing())?;
    let deadline_ns = wish.sample_ns + PATIENCE_NS;
    // What a writer says goes with the writer: it stays until the answer is there.
    let mut writer = commands::writer_by::<MotionWish>(bus, deadline_ns)?;
    writer.send(&wish)?;
    while clock::monotonic_ns() < deadline_ns {
        if inputs.take_newest()?.is_some_and(|input| is_done(&wish, &input)) {
            return Ok(());
        }
        std::thread::sleep(LOOK_EVERY);
    }
    bail!(
        "the master did not answer within {} s; it is stopped, or the machine is too busy",
        PATIENCE_NS / 1_000_000_000
    )
}

fn wish_of(args: &StateArgs) -> anyhow::Result<MotionWish> {
    let (low, high) = (*MotionWish::SCALE_PERMILLE.start(), *MotionWish::SCALE_PERMILLE.end());
    let scale_permille = match args.scale {
        None => 0,
        Some(scale) => {
            let permille = (scale * 1000.0).round();
            ensure!(
                (f64::from(low)..=f64::from(high)).contains(&permille),
                "--scale is {scale}: expected 0.01 to 1, a part of the configured speed"
            );
            permille as u32
        }
    };
    let flag = |lock: Option<Lock>| match lock {
        None => 0,
        Some(Lock::Translation) => OperatorInput::TRANSLATION_LOCKED,
        Some(Lock::Rotation) => OperatorInput::ROTATION_LOCKED,
    };
    let (lock, unlock) = (flag(args.lock), flag(args.unlock));
    ensure!(lock & unlock == 0, "--lock and --unlock name the same; expected one of them");
    let (sequence, sample_ns, sender_pid) = (1, clock::monotonic_ns(), std::process::id());
    Ok(MotionWish { sequence, sample_ns, scale_permille, lock, unlock, sender_pid })
}

fn is_done(wish: &MotionWish, input: &OperatorInput) -> bool {
    let is_scaled = wish.scale_permille == 0 || input.scale_permille == wish.scale_permille;
    is_scaled && input.flags & (wish.lock | wish.unlock) == wish.lock
}
