//! A snake that is not the one that the model describes: the measured shape says so, and the motion ends; a model that has yet to
//! learn, and models that are there to show their error, are left alone.

use super::{PATIENCE, alone};
use core::time::Duration;
use krait_ipc::message::Phase;
use krait_ipc::{Reason, Reasons};
use krait_schema::Sample;
use krait_tests::{
    Ended, Krait, TempFolder, assert_no_jump, instance_name, samples_in, signal_process, states_in, wait_for,
};
use rustix::process::Signal;

fn has(bits: u64, reason: Reason) -> bool {
    Reasons::from_bits(bits).contains(reason)
}

/// The largest part of the shape that a model left unexplained, deg, and how many commands carry a reason.
fn found_in(path: &str) -> (f64, usize, usize) {
    let (mut worst_deg, mut n_warned, mut n_tripped) = (0.0_f64, 0, 0);
    for sample in samples_in(path) {
        match sample {
            Sample::ModelUpdate(update) => worst_deg = worst_deg.max(update.innovation_rms_rad.to_degrees()),
            Sample::Command(command) => {
                n_warned += usize::from(has(command.reasons, Reason::ModelMismatch));
                n_tripped += usize::from(has(command.reasons, Reason::MismatchTrip));
            }
            _ => {}
        }
    }
    (worst_deg, n_warned, n_tripped)
}

/// A repetition judges alike.
fn assert_verified(path: &str) {
    let verified = Ended::of(&["verify", "--json", path], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stderr, verified.stdout);
}

#[test]
fn a_snake_that_is_grossly_another_than_its_model_warns_and_then_ends_the_motion() {
    let _alone = alone();
    let (instance, folder) = (instance_name("other"), TempFolder::new("other"));
    let (path, truth) = (folder.file("run.mcap"), folder.file("truth.toml"));
    // The camera was turned by a quarter: the snake is seen to bend across where it is told to.
    std::fs::write(&truth, "[camera]\nplane_offset_rad = 1.6\n").expect("written");
    let krait =
        Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &path, "--truth", &truth]);
    wait_for(&instance, "tripped", |state| has(state.reasons, Reason::MismatchTrip));
    let shown = Ended::of(&["state", "--json", "--instance", &instance], PATIENCE).json();
    for reason in ["ModelMismatch", "MismatchTrip"] {
        let held = shown["reasons"].as_array().and_then(|all| all.iter().find(|held| held["reason"] == reason));
        let number =
            |key: &str| held.and_then(|held| held[key].as_f64()).unwrap_or_else(|| panic!("{reason}: {shown}"));
        assert!(number("value") > 0.0 && number("limit") > 1.0, "deg: {shown}");
    }
    std::thread::sleep(Duration::from_millis(1500));
    // Only `compensate` remembers that it has tripped: without it, the chain ends instead of moving on.
    signal_process(&instance, "compensate", Signal::KILL);
    let ended = krait.end(PATIENCE);
    assert!(ended.code == Some(2) && ended.stderr.contains("had left the model"), "{ended:?}");
    let states = states_in(&path);
    assert_no_jump(&states);
    let tripped = states.iter().position(|state| has(state.reasons, Reason::MismatchTrip)).expect("it tripped");
    assert!(states[tripped..].iter().all(|state| !state.is_engaged()), "nobody engages any more");
    let (from, to) = (&states[tripped + 200], &states[states.len() - 300]);
    assert!(to.sequence > from.sequence && from.setpoint_q_m == to.setpoint_q_m, "the snake holds: {from:?} {to:?}");
    let commands: Vec<_> =
        samples_in(&path).into_iter().filter_map(|s| if let Sample::Command(c) = s { Some(c) } else { None }).collect();
    let first = |reason| commands.iter().position(|command| has(command.reasons, reason)).expect("it was said");
    let (warned, tripped) = (first(Reason::ModelMismatch), first(Reason::MismatchTrip));
    let followed = commands[warned..tripped].iter().any(|command| command.phase == Phase::Following as u32);
    assert!(warned < tripped && followed, "a warning comes first: {warned} {tripped}");
    assert_verified(&path);
}

/// The first joint has another zero than its model says, by 57 deg.
#[test]
fn a_wrist_that_is_grossly_another_than_its_model_ends_the_motion() {
    let _alone = alone();
    let (instance, folder) = (instance_name("wrist"), TempFolder::new("wrist"));
    let (path, truth, model) = (folder.file("run.mcap"), folder.file("truth.toml"), folder.file("wrist.toml"));
    let joints = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints");
    let text = std::fs::read_to_string(format!("{joints}/wrist.toml")).expect("the shipped model");
    let learns = "half_width = { value = 0.05, learn = { sd = 0.01, memory_s = 600.0 } }";
    std::fs::write(&model, text.replace("half_width = 0.05", learns)).expect("written");
    std::fs::write(&truth, "[[joint]]\nzero_rad = 1.0\n[[joint]]\n[[joint]]\n").expect("written");
    let script = format!("{joints}/wrist.csv");
    let krait = Krait::start(&[
        "run",
        "--engage=again",
        "--instance",
        &instance,
        "--recording",
        &path,
        "--truth",
        &truth,
        "--model",
        &model,
        "--master",
        "script",
        "--input",
        &script,
    ]);
    wait_for(&instance, "tripped", |state| has(state.reasons, Reason::MismatchTrip));
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
    let states = states_in(&path);
    let tripped = states.iter().position(|state| has(state.reasons, Reason::MismatchTrip)).expect("it tripped");
    assert!(states[..tripped].iter().any(|state| state.is_engaged()), "it was engaged before");
    assert!(states[tripped..].iter().all(|state| !state.is_engaged()), "nobody engages any more");
    assert_verified(&path);
}

#[test]
fn models_that_show_their_error_and_one_that_has_yet_to_learn_do_not_trip() {
    let (instance, folder) = (instance_name("left"), TempFolder::new("left"));
    let estimated = folder.file("estimated.mcap");
    {
        let _alone = alone();
        let run = ["run", "--engage=again", "--seconds", "6", "--compensation", "estimated", "--instance", &instance];
        let ended = Ended::of(&[&run[..], &["--recording", &estimated]].concat(), PATIENCE);
        assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
    }
    // The same hand through the same processes with the others, in the simulated snake's time.
    let replayed = |model: &'static str| {
        let path = folder.file(&format!("{model}.mcap"));
        let replay = ["replay", &estimated, "--speed", "max", "--compensation", model, "--recording", &path];
        let ended = Ended::of(&replay, PATIENCE);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        (model, path)
    };
    for (model, path) in [replayed("off"), replayed("naive"), ("estimated", estimated.clone())] {
        let (worst_deg, n_warned, n_tripped) = found_in(&path);
        println!("{model}: at most {worst_deg:.2} deg along an axis unexplained, {n_warned} commands warned");
        assert!(worst_deg > 0.1, "{model}: the camera saw it move");
        assert_eq!(n_tripped, 0, "{model}");
    }
}
