//! The glance in a terminal: what it says, and that its keys stop, pause and mark a chain that runs on without it.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::message::{OperatingState, SlaveState};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{
    Ended, Krait, TempFolder, instance_name, is_moving, krait_program, processes_of, wait_for, wait_for_motion,
    wait_until,
};
use rustix::process::Signal;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

const PATIENCE: Duration = Duration::from_secs(240);

/// `krait watch` in a terminal of its own.
struct Watched {
    child: std::process::Child,
    keyboard: File,
    screen: Arc<Mutex<String>>,
}

impl Watched {
    fn start(instance: &str) -> Self {
        let ours =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a terminal can be had");
        grantpt(&ours).expect("granted");
        unlockpt(&ours).expect("unlocked");
        let path = ptsname(&ours, Vec::new()).expect("it has a name").into_string().expect("plain");
        let theirs = || File::options().read(true).write(true).open(&path).expect("opened");
        let mut command = Command::new(krait_program());
        command.args(["watch", "--instance", instance]).stdin(theirs()).stdout(theirs()).stderr(Stdio::null());
        let child = command.spawn().expect("started");
        let keyboard = File::from(ours);
        let screen = Arc::new(Mutex::new(String::new()));
        let (mut reader, shown) = (keyboard.try_clone().expect("cloned"), Arc::clone(&screen));
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(n) = reader.read(&mut bytes) {
                let text = String::from_utf8_lossy(&bytes[..n]).into_owned();
                shown.lock().unwrap_or_else(PoisonError::into_inner).push_str(&text);
            }
        });
        Self { child, keyboard, screen }
    }

    fn screen(&self) -> String {
        self.screen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn shows(&self, text: &str) {
        assert!(wait_until(PATIENCE, || self.screen().contains(text)), "never {text:?} in:\n{}", self.screen());
    }

    fn press(&mut self, keys: &str) {
        self.keyboard.write_all(keys.as_bytes()).expect("typed");
    }
}

#[test]
fn the_glance_says_what_the_chain_does_and_its_keys_mark_pause_and_stop_it() {
    let (instance, folder) = (instance_name("watch"), TempFolder::new("watch"));
    let recording = folder.file("run.mcap");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let once = Ended::of(&["watch", "--once", "--instance", &instance], PATIENCE);
    assert_eq!(once.code, Some(0), "{}", once.stderr);
    for word in
        ["operator    ", "bend        ", "plane", "actuator 3", "latency     p50", "recording   ", "model       "]
    {
        assert!(once.stdout.contains(word), "{word}:\n{}", once.stdout);
    }
    assert!(once.stdout.lines().all(|line| line.chars().count() < 80), "{}", once.stdout);

    let mut watched = Watched::start(&instance);
    watched.shows(&format!("krait watch: {instance}"));
    watched.shows("q: end the watch");
    watched.press("mvessel touched");
    watched.shows("mark (Enter sets it, Escape leaves it): vessel touched_");
    watched.press("\r");
    watched.shows("marked \"vessel touched\" at 20");
    watched.shows("1 marks seen, the last: vessel touched");
    watched.press("p");
    wait_for(&instance, "paused", |state| state.operating() == Some(OperatingState::Paused));
    watched.shows("PAUSED, power on");
    let resumed = Ended::of(&["state", "resume", "--instance", &instance], PATIENCE);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    wait_for(&instance, "moving", is_moving);
    let n_stops = |state: &SlaveState| state.n_stops;
    wait_for(&instance, "no stop yet", |state| n_stops(state) == 0);
    watched.press(" ");
    wait_for(&instance, "stopped", |state| n_stops(state) == 1 && state.operating() == Some(OperatingState::Paused));
    watched.shows("STOPPED: the actuators stand still");
    watched.press("q");
    assert!(wait_until(PATIENCE, || watched.child.try_wait().expect("watched").is_some()), "it ends");
    assert_eq!(watched.child.wait().expect("ended").code(), Some(0));
    assert!(watched.screen().ends_with("\x1b[?25h\x1b[?1049l"), "the terminal is given back");
    assert_eq!(processes_of(&instance).len(), 7, "the chain goes on");

    krait.signal(Signal::INT);
    assert_eq!(krait.end(PATIENCE).code, Some(0));
    let recorded = Recording::open(Path::new(&recording)).expect("readable");
    let marks = recorded.samples().expect("samples").filter_map(|recorded| match recorded.expect("readable").sample {
        Sample::Marker(mark) => mark.text().map(str::to_owned),
        _ => None,
    });
    assert_eq!(marks.collect::<Vec<_>>(), ["vessel touched"]);
}

#[test]
fn without_a_chain_there_is_nothing_to_watch() {
    let instance = instance_name("nobody");
    let ended = Ended::of(&["watch", "--instance", &instance], PATIENCE);
    assert_eq!(ended.code, Some(2));
    assert!(
        ended.sentence().contains("no chain runs in instance") && ended.sentence().contains("krait run"),
        "{ended:?}"
    );
}
