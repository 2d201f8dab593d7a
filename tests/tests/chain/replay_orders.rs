//! Orders to a replay that runs: pause, resume, stop and Ctrl-C, in its own time and on the machine's clock.

use core::time::Duration;
use krait_ipc::message::{Phase, Setpoint, SlaveState};
use krait_ipc::{Bus, ReadOptions, Reader};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name, processes_of, wait_until};
use rustix::process::Signal;
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::ChildStdin;
use std::thread;

const PATIENCE: Duration = Duration::from_secs(240);
/// What flows at 1 kHz is seen within this, whatever else the machine does for most of it.
const WHILE: Duration = Duration::from_millis(300);

/// A replay of the shipped recording that is watched and told what to do.
struct Replay {
    krait: Krait,
    orders: ChildStdin,
    instance: String,
    setpoints: Reader<Setpoint>,
    newest: Option<Setpoint>,
    _bus: Bus,
}

impl Replay {
    fn start(options: &[&str]) -> Self {
        let instance = instance_name("orders");
        let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/flick.mcap").display().to_string();
        let all = [&["replay", "--json", "--instance", &instance, &recording], options].concat();
        let (krait, orders) = Krait::start_with_input(&all);
        // The chain refuses to start where somebody else is a member already.
        assert!(wait_until(PATIENCE, || processes_of(&instance).len() >= 4), "the chain starts");
        let bus = Bus::open(&instance, "test").expect("bus");
        let setpoints = bus.reader(ReadOptions::observing()).expect("a reader");
        Self { krait, orders, instance, setpoints, newest: None, _bus: bus }
    }

    fn order(&mut self, word: &str) {
        self.orders.write_all(format!("{word}\n").as_bytes()).expect("it listens");
    }

    /// Setpoints that have come since the last look; a buffer holds two seconds of them.
    fn n_new(&mut self) -> u64 {
        let mut n_new = 0;
        while let Some(setpoint) = self.setpoints.take().expect("taken") {
            self.newest = Some(*setpoint);
            n_new += 1;
        }
        n_new
    }

    fn wait_until_it_follows(&mut self) {
        let follows = wait_until(PATIENCE, || {
            self.n_new();
            // The approach follows too; the recording begins after its hundred samples.
            self.newest.is_some_and(|setpoint| setpoint.phase() == Some(Phase::Following) && setpoint.sequence > 200)
        });
        assert!(follows, "the replay moves the setpoint");
    }

    fn bend_rad(&self) -> [f64; 2] {
        self.newest.expect("a setpoint").bend_rad
    }

    fn is_gone(&self) -> bool {
        processes_of(&self.instance).is_empty()
    }

    /// Its end, with nothing left behind.
    fn end(self) -> Ended {
        let ended = self.krait.end(PATIENCE);
        assert_eq!(processes_of(&self.instance), [], "no process is left");
        ended
    }
}

/// Setpoints and the last state of a whole recording.
fn read(path: &str) -> (Vec<Setpoint>, SlaveState) {
    let recording = Recording::open(Path::new(path)).expect("readable");
    assert!(recording.contents().missing.is_empty(), "{:?}", recording.contents().missing);
    let (mut setpoints, mut last) = (Vec::new(), None);
    for recorded in recording.samples().expect("samples") {
        match recorded.expect("readable").sample {
            Sample::Setpoint(setpoint) => setpoints.push(setpoint),
            Sample::State(state) => last = Some(state),
            _ => {}
        }
    }
    (setpoints, last.expect("states"))
}

fn check_nothing_dropped(figures: &Value) {
    let samples = &figures["samples"];
    assert_eq!((&samples["lost"], &samples["answered"]), (&0.into(), &figures["messages_sent"]), "{figures}");
    assert_eq!(figures["commands_refused"], 0, "{figures}");
}

fn check_rest(setpoints: &[Setpoint], last: &SlaveState) {
    assert_eq!(last.flags & SlaveState::FOLLOWING, 0, "the slave holds at the end");
    let [.., before, end] = setpoints else { panic!("no setpoints") };
    assert_eq!(end.bend_rad, before.bend_rad, "the setpoint has come to rest: {end:?}");
    assert!(setpoints.iter().map(|s| s.sequence).eq(1..=setpoints.len() as u64), "nothing is missing in between");
}

/// In its own time a pause leaves no trace at all: the same bytes as without.
#[test]
fn a_pause_in_its_own_time_stands_still_and_changes_no_byte() {
    let folder = TempFolder::new("pause");
    let (paused, plain) = (folder.file("paused.mcap"), folder.file("plain.mcap"));
    let mut replay = Replay::start(&["--loops", "3", "--speed", "0.5", "--recording", &paused]);
    replay.wait_until_it_follows();
    replay.order("pause");
    let stands = wait_until(PATIENCE, || {
        thread::sleep(WHILE);
        replay.n_new() == 0
    });
    assert!(stands, "no setpoint comes in a pause");
    thread::sleep(WHILE);
    assert_eq!(replay.n_new(), 0, "nor later");
    assert!(processes_of(&replay.instance).len() >= 4, "it has not simply ended");
    replay.order("resume");
    assert!(wait_until(PATIENCE, || replay.n_new() > 0), "it goes on");
    let ended = replay.end();
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let figures = ended.json();
    check_nothing_dropped(&figures);
    assert_eq!(
        figures["samples"]["recorded"].as_u64(),
        figures["samples_in_loop"].as_u64().map(|n| 3 * n),
        "{figures}"
    );

    let all = ["replay", "--loops", "3", "--speed", "max", "--recording", &plain];
    let flick = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/flick.mcap").display().to_string();
    let instance = instance_name("plain");
    let ended = Ended::of(&[&all[..], &["--instance", &instance, &flick]].concat(), PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(read(&paused), read(&plain));
}

/// A pause on the clock: how it ended, and the setpoint that stood still. `None` where the machine itself stood still for so long
/// that the slave ended the engagement, as it must.
fn pause_on_the_clock(path: &str) -> Option<(Ended, Setpoint)> {
    let mut replay = Replay::start(&["--real-time", "--engage", "--speed", "0.5", "--recording", path]);
    replay.wait_until_it_follows();
    replay.order("pause");
    let mut before = [f64::NAN; 2];
    let holds = wait_until(PATIENCE, || {
        thread::sleep(WHILE);
        let n_new = replay.n_new();
        let now = replay.bend_rad();
        replay.is_gone() || (n_new > 0 && now == std::mem::replace(&mut before, now))
    });
    assert!(holds, "the setpoint stands still in a pause and goes on being sent");
    let held = replay.newest.expect("a setpoint");
    if !replay.is_gone() {
        replay.order("resume");
        let goes_on = wait_until(PATIENCE, || {
            replay.n_new();
            replay.bend_rad() != held.bend_rad || replay.is_gone()
        });
        assert!(goes_on, "it goes on");
    }
    let ended = replay.end();
    let machine_stalled = ended.stderr.contains("the way from the hand to the actuators stood still for too long");
    (!machine_stalled).then_some((ended, held))
}

#[test]
fn a_pause_on_the_clock_holds_the_setpoint_and_drops_nothing() {
    let folder = TempFolder::new("pause_clock");
    let tried = (1..=3).find_map(|turn| {
        let path = folder.file(&format!("paused{turn}.mcap"));
        pause_on_the_clock(&path).map(|(ended, held)| (path, ended, held))
    });
    let (path, ended, Setpoint { sequence, bend_rad: before, .. }) =
        tried.expect("a machine that runs for some seconds");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let figures = ended.json();
    check_nothing_dropped(&figures);
    assert_eq!(figures["samples"]["recorded"], figures["samples_in_loop"], "{figures}");
    let (setpoints, last) = read(&path);
    check_rest(&setpoints, &last);
    let held = setpoints.iter().find(|setpoint| setpoint.sequence == sequence).expect("recorded");
    assert_eq!(held.bend_rad, before, "the recording holds the pause");
    // Whatever the pause did, the setpoint never ran away from it: 1 deg is more than a braking takes.
    let nearby = |s: &&Setpoint| s.sequence.abs_diff(sequence) <= 100;
    for setpoint in setpoints.iter().filter(nearby) {
        let way = (setpoint.bend_rad[0] - before[0]).hypot(setpoint.bend_rad[1] - before[1]);
        assert!(way < 1f64.to_radians(), "{way} rad at setpoint {}", setpoint.sequence);
    }
}

/// A stop by a word and one by Ctrl-C are the same: rest, a whole recording, exit code 0 because nothing went wrong.
#[test]
fn a_stop_and_ctrl_c_end_at_rest_with_a_whole_recording() {
    let folder = TempFolder::new("stop");
    for (name, options, by_word) in [
        ("word", &["--loops", "500", "--speed", "1"][..], true),
        ("ctrl_c", &["--loops", "500", "--speed", "1"][..], false),
        ("word_clock", &["--loops", "500", "--real-time", "--engage"][..], true),
        ("ctrl_c_clock", &["--loops", "500", "--real-time", "--engage"][..], false),
        ("ctrl_c_in_a_pause", &["--loops", "500", "--real-time", "--engage"][..], false),
    ] {
        let path = folder.file(&format!("{name}.mcap"));
        let mut replay = Replay::start(&[options, &["--recording", &path]].concat());
        replay.wait_until_it_follows();
        if name == "ctrl_c_in_a_pause" {
            replay.order("pause");
        }
        if by_word {
            replay.order("stop");
        } else {
            replay.krait.signal(Signal::INT);
        }
        let ended = replay.end();
        assert_eq!(ended.code, Some(0), "{name}: {}", ended.stderr);
        let figures = ended.json();
        assert_eq!(figures["stopped"], true, "{name}: {figures}");
        check_nothing_dropped(&figures);
        let (setpoints, last) = read(&path);
        check_rest(&setpoints, &last);
        let n_recorded = figures["samples"]["recorded"].as_u64().expect("a number");
        assert!(n_recorded > 0 && setpoints.len() as u64 >= n_recorded, "{name}: {figures}");
    }
}
