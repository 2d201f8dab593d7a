//! Scenes of a chain that follow a motion or a time closely: two chains on two cores come late, so one runs at a time; what needs no chain
//! runs beside it.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod gripper;
mod joints;
mod lost_slave;
mod mismatch;
mod segment_chain;

use core::time::Duration;
use krait_tests::{Ended, instance_name};
use serde_json::Value;
use std::sync::{Mutex, MutexGuard, PoisonError};

const PATIENCE: Duration = Duration::from_secs(240);

/// Until it is dropped no other scene of this program runs a chain.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The figures of a chain that a script drives, with more options.
fn scripted(script: &str, recording: &str, more: &[&str]) -> Value {
    let once = || {
        let instance = instance_name("scripted");
        let mut arguments = vec!["run", "--engage=again", "--json", "--master", "script", "--input", script];
        arguments.extend(["--instance", &instance, "--recording", recording]);
        arguments.extend(more);
        Ended::of(&arguments, PATIENCE)
    };
    let _alone = alone();
    let ended = Ended::in_time(recording, once);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    ended.json()
}

/// What a command prints that succeeds.
fn done(arguments: &[&str]) -> Value {
    let ended = Ended::of(arguments, PATIENCE);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    ended.json()
}
