//! The glance in a terminal: what it says, and that its keys stop, pause and mark a chain that runs on without it. And a hand's:
//! its axes live, and their calibration.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::message::{DeviceState, Health, OperatingState, OperatorInput, Phase, SlaveState};
use krait_ipc::{Bus, Process, Reason, clock, health_channel};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{
    ChainScene, ChainSender, Ended, Krait, TempFolder, instance_name, is_moving, krait_program, processes_of, wait_for,
    wait_for_motion, wait_until,
};
use rustix::fs::{CWD, Mode, mkfifoat};
use rustix::process::Signal;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
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
        Self::sized(instance, 0, 0)
    }

    /// In a terminal of so many rows and columns; of 0 it does not say how many it has.
    fn sized(instance: &str, ws_row: u16, ws_col: u16) -> Self {
        let ours =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a terminal can be had");
        grantpt(&ours).expect("granted");
        unlockpt(&ours).expect("unlocked");
        tcsetwinsize(&ours, Winsize { ws_row, ws_col, ws_xpixel: 0, ws_ypixel: 0 }).expect("a size");
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

    /// The pictures so far, each as its lines.
    fn pictures(&self) -> Vec<Vec<String>> {
        let screen = self.screen();
        let whole = screen.split("\x1b[H").skip(1).filter_map(|picture| picture.split_once("\x1b[J"));
        whole.map(|(picture, _)| picture.split("\r\n").map(|line| line.replace("\x1b[K", "")).collect()).collect()
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

/// Fewer rows than the glance has lines, and fewer columns: what matters stays, reasons that there is no room for are counted, and the
/// terminal has no line to scroll for. One that grows shows all again.
#[test]
fn a_low_terminal_shows_state_reason_and_error_and_never_scrolls() {
    let instance = instance_name("low");
    let sender = ChainSender::start(&instance);
    let reasons = [Reason::DriveFault, Reason::FollowingError, Reason::LoadUnknown, Reason::SamplesLost];
    let flags = SlaveState::failed_drive_flags(2) | SlaveState::OTHERS_HOLD;
    let scene = ChainScene::of(OperatingState::Fault, flags, &reasons);
    sender.say(scene.driven(OperatorInput::OPERATOR_PRESENT, DeviceState::Live, Phase::Holding));
    for (rows, columns) in [(3, 60), (5, 80), (1, 40)] {
        let mut watched = Watched::sized(&instance, rows, columns);
        let first = |lines: &Vec<String>| lines.first().is_some_and(|line| line.starts_with("FAULT       Drive 2"));
        let all_there = |lines: &Vec<String>| {
            let begins = |text: &str| lines.iter().any(|line| line.starts_with(text));
            first(lines) && (rows < 3 || begins("bend        ") && begins("FAULT       The drives"))
        };
        assert!(
            wait_until(PATIENCE, || watched.pictures().iter().any(all_there)),
            "{rows} rows: {:?}",
            watched.pictures().last()
        );
        let counted = watched.pictures().into_iter().rfind(all_there).expect("seen").concat();
        let said = match rows {
            1 => "(4 reasons)",
            3 => "(and 3 more)",
            _ => "(and 1 more)",
        };
        assert!(counted.contains(said), "{rows} rows: {counted}");
        for lines in watched.pictures() {
            assert!(lines.len() <= usize::from(rows), "{rows} rows: {lines:?}");
            assert!(lines.iter().all(|line| line.chars().count() < usize::from(columns)), "{columns}: {lines:?}");
        }
        let grown = Winsize { ws_row: 40, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&watched.keyboard, grown).expect("a size");
        watched.shows("q: end the watch");
        watched.shows(&format!("krait watch: {instance}"));
        watched.press("q");
        assert!(wait_until(PATIENCE, || watched.child.try_wait().expect("watched").is_some()), "it ends");
    }
    late_and_lost_samples_are_counted(&instance, &sender, scene);
}

/// Of the commands that the state answers, those beyond the budget are late, each once; lost are those that each process says it has lost.
fn late_and_lost_samples_are_counted(instance: &str, sender: &ChainSender, mut scene: ChainScene) {
    let mut watched = Watched::sized(instance, 40, 100);
    watched.shows("latency     p50 -, p99 -, worst - us; 0 late, 0 lost");
    for (command_sequence, whole_ns, counted) in [
        (1, 200_000, "; 0 late, 0 lost"),
        (2, 5_000_000_000, "; 1 late, 0 lost"),
        (3, 4_000_000_000, "; 2 late, 0 lost"),
    ] {
        let state = scene.state.as_mut().expect("a state");
        state.command_sequence = command_sequence;
        (state.stamps.device_ns, state.stamps.drive_written_ns) = (1_000_000_000, 1_000_000_000 + whole_ns);
        sender.say(scene);
        watched.shows(counted);
    }
    let bus = Bus::open(instance, "test").expect("bus");
    let mut healths = [Process::Resolve, Process::Compensate]
        .map(|process| bus.writer_on::<Health>(&health_channel(process)).expect("the writer"));
    for (writer, n_lost, counted) in [(0, 7, "; 2 late, 7 lost"), (1, 5, "; 2 late, 12 lost")] {
        let health = Health { sequence: 1, sample_ns: clock::monotonic_ns(), n_lost, ..Health::default() };
        healths[writer].send(&health).expect("sent");
        watched.shows(counted);
    }
    watched.press("q");
    assert!(wait_until(PATIENCE, || watched.child.try_wait().expect("watched").is_some()), "it ends");
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

/// Events as the kernel writes them into a node: time, kind, code, value.
fn events(of: &[(u16, u16, i32)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (kind, code, value) in of.iter().chain([&(0, 0, 0)]) {
        bytes.extend([0; 16]);
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(code.to_ne_bytes());
        bytes.extend(value.to_ne_bytes());
    }
    bytes
}

/// A stick whose node is a pipe, with `krait devices --calibrate` reading it.
fn calibrating(folder: &TempFolder, name: &str) -> (Krait, File) {
    let (node, base) = (folder.file(name), folder.file("base.toml"));
    let text = "name = \"Stick\"\nid = \"046d:c2ff\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\n[[axis]]\nof = \"z\"\nfrom = \"ABS_RZ\"\nsign = \"-\"\n";
    std::fs::write(&base, text).expect("written");
    mkfifoat(CWD, &node, Mode::RUSR | Mode::WUSR).expect("made");
    let out = format!("{node}.toml");
    let mut krait =
        Krait::start(&["devices", "--calibrate", &out, "--node", &node, "--profile", &base, "--seconds", "4"]);
    let mut stick = File::options().write(true).open(&node).expect("krait reads it");
    stick.write_all(&events(&[(3, 0, 502), (3, 5, 128)])).expect("written");
    assert!(krait.line().starts_with("Leave it alone"));
    (krait, stick)
}

#[test]
fn a_stick_is_calibrated_into_a_profile_that_shows_its_deflection_and_an_axis_that_was_not_moved_is_named() {
    let folder = TempFolder::new("calibrate");
    let (mut krait, mut stick) = calibrating(&folder, "stick");
    let (mut half, mut half_moved) = calibrating(&folder, "half");
    for (krait, stick) in [(&mut krait, &mut stick), (&mut half, &mut half_moved)] {
        assert!(krait.line().starts_with("Move every axis"));
        stick
            .write_all(&events(&[(3, 0, 20), (1, 0x121, 1), (3, 0, 1001), (1, 0x120, 1), (3, 0, 506)]))
            .expect("written");
    }
    stick.write_all(&events(&[(3, 5, 0), (3, 5, 255), (3, 5, 128)])).expect("written");
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(ended.stdout.contains("ABS_X: 20 to 1001, rest 504, noise 4"), "{}", ended.stdout);
    let refused = half.end(PATIENCE);
    assert!(refused.code == Some(1) || refused.code == Some(2), "{}", refused.stderr);
    assert!(refused.sentence().contains("ABS_RZ was never moved; nothing is written"), "{}", refused.stderr);
    assert!(!Path::new(&folder.file("half.toml")).exists());

    let profile = folder.file("stick.toml");
    let written = std::fs::read_to_string(&profile).expect("a profile");
    assert!(written.contains("from = \"BTN_THUMB\"") && written.contains("sign = \"-\""), "{written}");
    let again = Ended::of(&["devices", "--calibrate", &profile, "--node", &folder.file("half")], PATIENCE);
    assert!(again.sentence().contains("--force"), "{}", again.stderr);
    assert_eq!(std::fs::read_to_string(&profile).expect("a profile"), written, "not overwritten");
    // What the chain makes of it: half of the way from the end of the noise, and a full deflection the other way.
    let told = folder.file("told");
    std::fs::write(&told, events(&[(3, 0, 755), (3, 5, 255), (1, 0x121, 1)])).expect("written");
    let live = Ended::of(&["devices", "--live", "--node", &told, "--profile", &profile], PATIENCE);
    let last = live.stdout.lines().last().expect("a line");
    assert_eq!(last, "ABS_X   755 = x  +50 %  ABS_RZ   255 = z -100 %  buttons BTN_THUMB", "{}", live.stderr);
    for no_input in ["/dev/null", "/tmp"] {
        let refused = Ended::of(&["devices", "--live", "--node", no_input], PATIENCE);
        assert!(refused.sentence().contains("it is no input device"), "{}{}", refused.stdout, refused.stderr);
    }
    let run =
        ["run", "--master", "hid", "--profile", &profile, "--no-recording", "--instance", &instance_name("stick")];
    let absent = Ended::of(&run, PATIENCE);
    assert!(absent.sentence().contains("looked for 046d:c2ff (Stick)"), "the chain reads it: {}", absent.stderr);
}

#[test]
fn a_mouse_and_a_keyboard_are_shown_with_their_deflection_and_have_nothing_to_be_calibrated() {
    let folder = TempFolder::new("mouse");
    for (name, told, line) in [
        ("mouse", &[(2, 0, 16), (2, 0, -3), (1, 0x110, 1)][..], "REL_X   +13 = x   +0 %  buttons BTN_LEFT"),
        (
            "keyboard",
            &[(1, 106, 1), (1, 106, 2), (1, 108, 1), (1, 103, 1)],
            "KEY_RIGHT/KEY_LEFT = x  +50 %  KEY_DOWN/KEY_UP = z   +0 %  KEY_PAGEDOWN/KEY_PAGEUP = y   +0 %  KEY_E/KEY_Q = rz   +0 %  buttons KEY_RIGHT KEY_DOWN KEY_UP",
        ),
    ] {
        let file = folder.file(name);
        std::fs::write(&file, events(told)).expect("written");
        let live = Ended::of(&["devices", "--live", "--node", &file, "--profile", name], PATIENCE);
        assert_eq!(live.stdout.lines().last(), Some(line), "{}", live.stderr);
        let out = folder.file("out.toml");
        let refused = Ended::of(&["devices", "--calibrate", &out, "--node", &file, "--profile", name], PATIENCE);
        assert!(refused.sentence().contains("have neither rest nor range"), "{}", refused.stderr);
        assert!(!Path::new(&out).exists());
    }
}
