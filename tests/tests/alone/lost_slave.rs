//! A slave that is killed and started again is enabled only if the one before was, and nobody has asked for less since; a held
//! terminal keeps the supervisor from nothing.

use super::{PATIENCE, alone};
use core::time::Duration;
use krait_ipc::Bus;
use krait_ipc::message::SlaveState;
use krait_tests::{
    Ended, Krait, TempFolder, held_terminal, instance_name, is_moving, kill_until_back, krait_program, processes_of,
    states_in, wait_for, wait_until,
};
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;

fn state(instance: &str, ask: &[&str]) -> Ended {
    let shown = Ended::of(&[&["state"], ask, &["--json", "--instance", instance]].concat(), PATIENCE);
    assert_eq!(shown.code, Some(0), "{ask:?}: {}", shown.stderr);
    shown
}

#[test]
fn a_slave_that_was_disabled_paused_or_stopped_stays_so_when_it_is_started_again() {
    let _alone = alone();
    let (instance, folder) = (instance_name("lost"), TempFolder::new("lost"));
    let path = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &path]);
    wait_for(&instance, "moving", is_moving);
    let bus = Bus::open(&instance, "test").expect("joined");
    for before in ["disable", "pause", "stop", "stop while it is away"] {
        match before {
            "disable" | "pause" => drop(state(&instance, &[before])),
            "stop" => assert_eq!(Ended::of(&["stop", "--instance", &instance], PATIENCE).code, Some(0)),
            _ => {}
        }
        kill_until_back(&instance, "slave", || {
            if before == "stop while it is away" {
                bus.stop_switch().expect("the switch").press();
            }
        });
        // An Enable of the supervisor's would come with the first look at a slave that is ready.
        std::thread::sleep(Duration::from_millis(1500));
        let shown = state(&instance, &[]).json();
        assert_eq!((&shown["state"], &shown["is_engaged"]), (&"DISABLED".into(), &false.into()), "{before}: {shown}");
        state(&instance, &["enable"]);
        wait_for(&instance, "engaged anew", SlaveState::is_engaged);
    }
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "a loss is no success: {}", ended.stderr);
    for why in ["the one before was DISABLED", "the one before was PAUSED", "a stop was asked for"] {
        assert!(ended.stderr.contains(&format!("stays DISABLED, because {why}")), "{why}: {}", ended.stderr);
    }
    assert!(!states_in(&path).is_empty());
}

#[test]
fn a_chain_whose_terminal_stands_still_is_watched_answers_and_ends() {
    let _alone = alone();
    let (instance, folder) = (instance_name("held"), TempFolder::new("held"));
    let path = folder.file("run.mcap");
    let (read_end, write_end) = held_terminal();
    let mut chain = std::process::Command::new(krait_program())
        .args(["run", "--engage=again", "--instance", &instance, "--recording", &path])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::from(write_end))
        .spawn()
        .expect("started");
    wait_for(&instance, "moving", is_moving);
    // More than one period of the progress line.
    std::thread::sleep(Duration::from_millis(5500));
    kill_until_back(&instance, "resolve", || {});
    assert_eq!(state(&instance, &["pause"]).json()["state"], "PAUSED");
    kill_process(Pid::from_child(&chain), Signal::TERM).expect("it lives");
    let mut status = None;
    let has_ended = wait_until(PATIENCE, || {
        status = chain.try_wait().expect("watched");
        status.is_some()
    });
    assert!(has_ended, "{:?}", processes_of(&instance));
    assert_eq!(status.and_then(|status| status.code()), Some(1), "a loss is no success");
    drop(read_end);
}
