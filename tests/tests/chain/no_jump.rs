//! No jump, whatever changes: on the real processes, sample by sample, the first command that is followed after an event equals
//! the slave's own setpoint within one step of its gate, and no write of the whole run is longer than its time allows.

use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Command, OperatingState, OperatorInput, SlaveState, StateCommand, Transition};
use krait_ipc::{Bus, ReadOptions, Reader};
use krait_schema::Sample;
use krait_tests::{
    Ended, Krait, TempFolder, assert_no_jump, assert_starts_at_setpoint, instance_name, is_moving, samples_in,
    states_in, wait_for, wait_until,
};
use rustix::process::Signal;
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);
/// A model that does not learn: with one that does, play learnt late may still move the lines, smoothly, while the hand rests.
const FIXED_MODEL: &str = "--compensation=naive";

/// A hand that goes to and fro for a minute.
fn to_and_fro(folder: &TempFolder) -> String {
    let mut text = String::from("time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0,0,0\n");
    for second in 0..60 {
        let velocity = if second % 2 == 0 { 0.006 } else { -0.006 };
        text += &format!("{second}.1,{velocity},0.001,0\n{second}.9,{velocity},0.001,0\n");
    }
    written(folder, "hand.csv", &text)
}

fn written(folder: &TempFolder, name: &str, text: &str) -> String {
    let path = folder.file(name);
    std::fs::write(&path, text).expect("written");
    path
}

/// Starts a chain that a script moves.
fn start(instance: &str, recording: &str, script: &str, more: &[&str]) -> Krait {
    let all = ["run", "--instance", instance, "--recording", recording, "--master", "script", "--input", script];
    Krait::start(&[&all, more].concat())
}

/// Every check that holds for each of these paths; returns after which commands the motion began.
fn check(recording: &str) -> Vec<Command> {
    let samples = samples_in(recording);
    assert_no_jump(&states_in(recording));
    let commands: Vec<Command> =
        samples.iter().filter_map(|sample| if let Sample::Command(c) = sample { Some(*c) } else { None }).collect();
    assert_starts_at_setpoint(&commands, &states_in(recording))
}

fn inputs_in(recording: &str) -> Vec<OperatorInput> {
    let samples = samples_in(recording).into_iter();
    samples.filter_map(|sample| if let Sample::Input(input) = sample { Some(input) } else { None }).collect()
}

/// Where the drives are told to be stays as it is. The chain must run without learning ([`FIXED_MODEL`]).
fn assert_still(states: &[SlaveState], from_ns: i64, to_ns: i64) {
    let within: Vec<_> = states.iter().filter(|state| (from_ns..to_ns).contains(&state.sample_ns)).collect();
    assert!(within.len() > 50, "{} states", within.len());
    let moved = within.iter().find(|state| state.setpoint_q_m != within[0].setpoint_q_m);
    assert!(moved.is_none(), "nothing moves: from {:?} to {moved:?}, last {:?}", within[0], within[within.len() - 1]);
}

#[test]
fn the_clutch_moves_nothing_when_it_is_pressed_nor_when_it_is_let_go() {
    let (instance, folder) = (instance_name("clutch"), TempFolder::new("clutch"));
    let path = folder.file("run.mcap");
    // The hand goes on while the clutch is pressed.
    let script = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch\n\
                  0,0.006,0,0,1,0\n2,0.006,0,0,1,1\n3.5,-0.006,0.004,0,1,0\n60,-0.006,0.004,0,1,0\n";
    let krait = start(&instance, &path, &written(&folder, "hand.csv", script), &["--engage=again", FIXED_MODEL]);
    wait_for(&instance, "moving", is_moving);
    wait_for(&instance, "held by the clutch", |state| state.is_engaged() && state.flags & SlaveState::FOLLOWING == 0);
    wait_for(&instance, "following", |state| state.flags & SlaveState::FOLLOWING != 0);
    std::thread::sleep(Duration::from_millis(700));
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let starts = check(&path);
    let inputs = inputs_in(&path);
    let clutched: Vec<i64> = inputs.iter().filter(|i| i.clutch_pressed()).map(|i| i.sample_ns).collect();
    let (pressed_ns, let_go_ns) = (clutched[0], clutched[clutched.len() - 1]);
    assert_still(&states_in(&path), pressed_ns + 500_000_000, let_go_ns);
    assert!(starts.iter().any(|command| command.sample_ns > let_go_ns), "{} starts", starts.len());
}

#[test]
fn another_scale_and_a_lock_change_how_fast_it_goes_and_not_where_it_is() {
    let (instance, folder) = (instance_name("scale"), TempFolder::new("scale"));
    let path = folder.file("run.mcap");
    let krait = start(&instance, &path, &to_and_fro(&folder), &["--engage=again", FIXED_MODEL]);
    wait_for(&instance, "moving", is_moving);
    let ask = |words: &[&str]| {
        let all = [&["state", "--json", "--instance", &instance], words].concat();
        let ended = Ended::of(&all, PATIENCE);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        ended.json()
    };
    assert_eq!(ask(&["--scale", "0.25"])["scale"], 0.25);
    std::thread::sleep(Duration::from_millis(1500));
    assert_eq!(ask(&["--lock", "translation"])["is_translation_locked"], true);
    let locked_ns = monotonic_ns();
    std::thread::sleep(Duration::from_millis(1500));
    let unlocking_ns = monotonic_ns();
    let shown = ask(&["--unlock", "translation", "--scale", "1"]);
    assert_eq!((&shown["scale"], &shown["is_translation_locked"]), (&1.0.into(), &false.into()));
    std::thread::sleep(Duration::from_millis(700));
    for (words, named) in [(["--scale", "2"], "0.01 to 1"), (["--scale", "nan"], "0.01 to 1")] {
        let refused = Ended::of(&[&["state", "--instance", &instance], &words[..]].concat(), PATIENCE);
        assert!(refused.code == Some(2) && refused.stderr.contains(named), "{}", refused.stderr);
    }
    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    check(&path);
    assert_still(&states_in(&path), locked_ns + 500_000_000, unlocking_ns);
    let inputs = inputs_in(&path);
    let fastest = |of: &dyn Fn(&&OperatorInput) -> bool| {
        inputs.iter().filter(of).map(|input| input.tip_vel_in_view_m_per_s[0].abs()).fold(0.0, f64::max)
    };
    let (whole, part) = (fastest(&|i| i.scale_permille == 1000), fastest(&|i| i.scale_permille == 250));
    assert!((part / whole - 0.25).abs() < 1e-3, "{part} of {whole} m/s");
    let locked = fastest(&|i| i.flags & OperatorInput::TRANSLATION_LOCKED != 0);
    assert_eq!(locked, 0.0);
    let verified = Ended::of(&["verify", "--json", &path], PATIENCE);
    assert_eq!(verified.code, Some(0), "{}{}", verified.stderr, verified.stdout);
}

#[test]
fn after_a_fault_was_cleared_the_motion_begins_where_the_drives_are() {
    let (instance, folder) = (instance_name("cleared"), TempFolder::new("cleared"));
    let path = folder.file("run.mcap");
    let truth = written(&folder, "truth.toml", "[encoders]\nsticks_at_m = [1e-4, 0.0, 0.0]\n");
    let krait = start(&instance, &path, &to_and_fro(&folder), &["--engage=again", "--truth", &truth]);
    wait_for(&instance, "in FAULT", |state| state.operating() == Some(OperatingState::Fault));
    let order = |word: &str| Ended::of(&["state", word, "--instance", &instance], PATIENCE);
    let cleared = order("clear-fault");
    assert!(cleared.code == Some(0) && cleared.stdout.starts_with("DISABLED"), "{cleared:?}");
    let cleared_ns = monotonic_ns();
    assert_eq!(order("enable").code, Some(0));
    wait_for(&instance, "following", |state| state.flags & SlaveState::FOLLOWING != 0);
    std::thread::sleep(Duration::from_millis(300));
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
    let starts = check(&path);
    assert!(starts.iter().any(|command| command.sample_ns > cleared_ns), "{} starts", starts.len());
}

#[test]
fn a_replay_begins_where_the_drives_are() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/flick.mcap").display().to_string();
    let folder = TempFolder::new("begins");
    for (name, how) in [("own", &["--speed", "max"][..]), ("clock", &["--real-time", "--engage"])] {
        let (instance, path) = (instance_name("begins"), folder.file(&format!("{name}.mcap")));
        let all = ["replay", &shipped, "--from", "0.3", "--instance", &instance, "--recording", &path];
        let ended = Ended::of(&[&all, how].concat(), PATIENCE);
        assert!(matches!(ended.code, Some(0 | 1)), "{name}: {}", ended.stderr);
        assert!(!check(&path).is_empty(), "{name}: it moved");
    }
}

/// A process that runs without a supervisor; killed when the test is over.
struct Lone(Option<Krait>);

impl Lone {
    fn start(process: &str, instance: &str, more: &[&str]) -> Self {
        Self(Some(Krait::start(&[&[process, "--instance", instance], more].concat())))
    }

    fn end(mut self) {
        let krait = self.0.take().expect("it runs");
        krait.signal(Signal::TERM);
        krait.end(PATIENCE);
    }
}

impl Drop for Lone {
    fn drop(&mut self) {
        if let Some(krait) = self.0.take() {
            krait.signal(Signal::KILL);
            krait.end(PATIENCE);
        }
    }
}

/// All that was said since the beginning.
struct Heard {
    states: (Reader<SlaveState>, Vec<SlaveState>),
    commands: (Reader<Command>, Vec<Command>),
}

impl Heard {
    fn wait_for(&mut self, what: &str, is_so: impl Fn(&SlaveState) -> bool) {
        let found = wait_until(PATIENCE, || {
            let before = self.states.1.len();
            while let Some(state) = self.states.0.take().expect("taken") {
                self.states.1.push(*state);
            }
            while let Some(command) = self.commands.0.take().expect("taken") {
                self.commands.1.push(*command);
            }
            self.states.1[before..].iter().any(&is_so)
        });
        assert!(found, "never {what}: {:?}", self.states.1.last());
    }
}

#[test]
fn another_model_takes_over_where_the_drives_are() {
    let (instance, folder) = (instance_name("models"), TempFolder::new("models"));
    let bus = Bus::open(&instance, "launch").expect("joined");
    let mut orders = bus.writer::<StateCommand>().expect("the authority");
    let options = ReadOptions::observing();
    let mut heard = Heard {
        states: (bus.reader(options).expect("read"), Vec::new()),
        commands: (bus.reader(options).expect("read"), Vec::new()),
    };
    let _slave = Lone::start("slave", &instance, &[]);
    heard.wait_for("there", |_| true);
    let stages = |model: &str| {
        let config = written(&folder, &format!("{model}.toml"), &format!("compensation = \"{model}\"\n"));
        ["compensate", "resolve"].map(|process| Lone::start(process, &instance, &["--config", &config]))
    };
    let first = stages("off");
    let script = to_and_fro(&folder);
    let _master =
        Lone::start("master", &instance, &["--source", "script", "--input", &script, "--loop", "--engage=again"]);
    let transition = Transition::Enable as u32;
    orders.send(&StateCommand { sequence: 1, sample_ns: monotonic_ns(), transition, sender_pid: 1 }).expect("sent");
    heard.wait_for("moving", is_moving);
    first.into_iter().for_each(Lone::end);
    heard.wait_for("held", |state| !state.is_engaged());
    let exchanged = heard.commands.1.len();
    let second = stages("naive");
    heard.wait_for("engaged anew", SlaveState::is_engaged);
    heard.wait_for("moving", is_moving);
    let until_ns = monotonic_ns() + 500_000_000;
    heard.wait_for("going on", |state| state.sample_ns > until_ns);
    second.into_iter().for_each(Lone::end);

    assert_no_jump(&heard.states.1);
    let starts = assert_starts_at_setpoint(&heard.commands.1, &heard.states.1);
    let models = [heard.commands.1[0].model_hash, heard.commands.1[exchanged].model_hash];
    assert_ne!(models[0], models[1]);
    for model in models {
        assert!(starts.iter().any(|command| command.model_hash == model), "{} starts", starts.len());
    }
}
