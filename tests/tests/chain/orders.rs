//! Orders from outside to a chain that runs: stops from many at once, and each word of `krait state` that ends a motion.

use core::time::Duration;
use krait_ipc::message::{OperatingState, SlaveState};
use krait_tests::{Ended, Krait, TempFolder, assert_no_jump, instance_name, is_moving, states_in, wait_for};
use rustix::process::Signal;

const PATIENCE: Duration = Duration::from_secs(240);

fn state(instance: &str, word: &str) -> Ended {
    Ended::of(&["state", word, "--instance", instance], PATIENCE)
}

/// States of a thousandth of a second each within which a motion that was stopped is braked.
const N_BRAKING: usize = 50;

/// The setpoint of the states after an order stands still once it is braked.
fn assert_stands(states: &[SlaveState], is_after: impl Fn(&SlaveState) -> bool) {
    let after: Vec<&SlaveState> = states.iter().filter(|state| is_after(state)).skip(N_BRAKING).collect();
    assert!(after.len() > 10, "{} states", after.len());
    assert!(after.iter().all(|state| state.setpoint_q_m == after[0].setpoint_q_m && !state.is_engaged()));
}

#[test]
fn eight_stops_at_once_are_all_acknowledged() {
    let (instance, folder) = (instance_name("eight"), TempFolder::new("eight"));
    let path = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &path]);
    wait_for(&instance, "moving", is_moving);
    let all: Vec<Krait> = (0..8).map(|_| Krait::start(&["stop", "--instance", &instance])).collect();
    for stop in all {
        let ended = stop.end(PATIENCE);
        assert!(ended.code == Some(0) && ended.stdout.contains("stand still"), "{ended:?}");
    }
    let shown = Ended::of(&["state", "--json", "--instance", &instance], PATIENCE).json();
    assert_eq!((&shown["state"], &shown["is_engaged"]), (&"PAUSED".into(), &false.into()), "{shown}");
    // Stops that come within one step of the slave are obeyed, and counted, together.
    assert!(shown["n_stops"].as_u64().is_some_and(|n| (1..=8).contains(&n)), "{shown}");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let states = states_in(&path);
    assert_no_jump(&states);
    assert_stands(&states, |state| state.operating() == Some(OperatingState::Paused));
}

#[test]
fn pause_disable_and_home_end_the_motion_of_a_chain_and_what_is_not_valid_is_named() {
    let (instance, folder) = (instance_name("words"), TempFolder::new("words"));
    let path = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &path]);
    wait_for(&instance, "moving", is_moving);
    let refused = state(&instance, "clear-fault");
    assert_eq!(refused.code, Some(2), "{refused:?}");
    for (word, shown, back) in [("pause", "PAUSED", "resume"), ("disable", "DISABLED", "enable")] {
        let done = state(&instance, word);
        assert!(done.code == Some(0) && done.stdout.starts_with(shown), "{word}: {done:?}");
        wait_for(&instance, word, |state| !state.is_engaged());
        assert_eq!(state(&instance, back).code, Some(0), "{back}");
        wait_for(&instance, "engaged anew", SlaveState::is_engaged);
    }
    // Another search for zero ends the motion too; the operator engages anew.
    let homed = state(&instance, "home");
    assert!(homed.code == Some(0) && homed.stdout.starts_with("ENABLED"), "{homed:?}");
    wait_for(&instance, "engaged anew", SlaveState::is_engaged);
    assert_eq!(state(&instance, "pause").code, Some(0));
    let refused = state(&instance, "home");
    assert!(refused.code == Some(2) && refused.sentence().contains("`home` is not valid in PAUSED"), "{refused:?}");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let states = states_in(&path);
    assert_no_jump(&states);
    assert!(states.iter().filter(|state| state.operating() == Some(OperatingState::Paused)).all(|s| !s.is_engaged()));
    let is_busy = |state: &&SlaveState| state.flags & SlaveState::IS_BUSY != 0;
    assert!(states.iter().filter(is_busy).all(|state| !state.is_engaged()), "nobody drives while zero is looked for");
}
