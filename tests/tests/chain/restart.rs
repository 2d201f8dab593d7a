//! Each process of a running chain killed in turn: the chain comes back, is engaged anew, and its recording is repeated byte
//! for byte across every restart, which it names.

use core::time::Duration;
use krait_ipc::message::{OperatorInput, SlaveState};
use krait_schema::Sample;
use krait_tests::{
    Ended, Krait, TempFolder, assert_no_jump, assert_starts_at_setpoint, instance_name, is_moving, kill_until_back,
    samples_in, states_in, wait_for,
};
use rustix::process::Signal;

const PATIENCE: Duration = Duration::from_secs(240);

/// Kills a process and waits until the chain moves again.
fn lose(instance: &str, victim: &str) {
    kill_until_back(instance, victim, || {});
    if victim == "estimate" {
        // Nobody is held by its loss; a second of shapes for the next one.
        std::thread::sleep(Duration::from_millis(1500));
        return;
    }
    wait_for(instance, "held", |state| !state.is_engaged());
    wait_for(instance, "engaged anew", SlaveState::is_engaged);
    wait_for(instance, "moving", is_moving);
}

/// How often the motion began in a recording across one loss of the slave, each time at the setpoint of the slave.
fn n_starts(recording: &str) -> usize {
    let samples = samples_in(recording);
    let mut newest = 0;
    let is_anew = |sample: &Sample| match sample {
        Sample::State(state) => core::mem::replace(&mut newest, state.sequence) > state.sequence,
        _ => false,
    };
    let anew = samples.iter().position(is_anew).expect("the slave began anew");
    let halves = [&samples[..anew], &samples[anew..]];
    let n_of = |half: &[Sample]| {
        let states: Vec<_> =
            half.iter().filter_map(|s| if let Sample::State(m) = s { Some(*m) } else { None }).collect();
        let commands: Vec<_> =
            half.iter().filter_map(|s| if let Sample::Command(m) = s { Some(*m) } else { None }).collect();
        assert_starts_at_setpoint(&commands, &states).len()
    };
    halves.into_iter().map(n_of).sum()
}

#[test]
fn a_recording_is_repeated_byte_for_byte_across_the_restart_of_each_process() {
    let victims = ["resolve", "compensate", "estimate", "slave", "master"];
    let (instance, folder) = (instance_name("again"), TempFolder::new("again"));
    let path = folder.file("run.mcap");
    let (config, reports) = (folder.file("krait.toml"), folder.file("hand.krr"));
    std::fs::write(&config, format!("[master]\nrecord_reports = {reports:?}\n")).expect("written");
    let run = ["run", "--engage=again", "--instance", &instance, "--recording", &path, "--config", &config];
    let krait = Krait::start(&run);
    wait_for(&instance, "moving", is_moving);
    let slower = Ended::of(&["state", "--instance", &instance, "--scale", "0.8", "--lock", "rotation"], PATIENCE);
    assert_eq!(slower.code, Some(0), "{}", slower.stderr);
    for victim in victims {
        lose(&instance, victim);
    }
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "a loss is no success");
    // The master that came back could not write on in the file of the one before, and let it be.
    assert!(ended.stderr.contains("not recorded any more"), "{}", ended.stderr);
    assert!(std::fs::read_to_string(&reports).expect("still there").lines().count() > 100);

    let verified = Ended::of(&["verify", "--json", &path], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stderr, verified.stdout);
    let verdict = verified.json();
    let named: Vec<&str> =
        verdict["restarts"].as_array().expect("a list").iter().filter_map(|r| r["process"].as_str()).collect();
    assert_eq!(named, victims, "{verdict}");
    let (mut n_setpoints, mut n_commands, mut n_updates) = (0, 0, 0);
    let (mut is_slower, mut n_full) = (false, 0);
    for sample in samples_in(&path) {
        match sample {
            Sample::Input(input) => {
                let is_locked = input.flags & OperatorInput::ROTATION_LOCKED != 0;
                is_slower |= input.scale_permille == 800 && is_locked;
                n_full += u32::from(is_slower && (input.scale_permille != 800 || !is_locked));
            }
            Sample::Setpoint(_) => n_setpoints += 1,
            Sample::Command(_) => n_commands += 1,
            Sample::ModelUpdate(_) => n_updates += 1,
            _ => {}
        }
    }
    assert!(is_slower && n_full == 0, "{n_full} inputs forgot scale or lock, also those of a master that came back");
    assert!(verdict["first_difference"].is_null(), "{verdict}");
    assert_eq!(
        (&verdict["setpoints_identical"], &verdict["commands_identical"]),
        (&n_setpoints.into(), &n_commands.into())
    );
    assert_eq!((&verdict["updates_identical"], &verdict["not_repeated"]), (&n_updates.into(), &0.into()), "{verdict}");
    assert_eq!(verdict["passes"], 1);
    assert_no_jump(&states_in(&path));
    assert!(n_starts(&path) >= 5, "one start, and all but `estimate` end the motion, which begins anew");
    let text = Ended::of(&["verify", &path], PATIENCE).stdout;
    assert!(text.contains("`resolve` was started again") && text.contains("identical: "), "{text}");
}
