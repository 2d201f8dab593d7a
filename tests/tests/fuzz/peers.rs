//! Readers of what answers while krait runs (servos, CAN drives, a browser), and of what a process is handed at its start.

use super::{Reader, file_in};
use core::time::Duration;
use krait_drives::cia402::{CanReading, Cia402, Frame, Wire, scan};
use krait_drives::emulator::{CanBus, CanDrive, CanWire};
use krait_drives::{ActuatorBus, BusGone, Goals, Seen, ServoBus, ServoMake};
use krait_master::GuidePlan;
use krait_slave::{ActuatorConfig, DriveConfig, DriveKind, SlaveConfig};
use krait_tests::{Console, Krait, TempFolder, instance_name, krait_program};
use rustix::process::Signal;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::cell::RefCell;
use std::fs;
use std::io::Write;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use tungstenite::Message;

const PATIENCE: Duration = Duration::from_secs(60);
const PLAN: &str = "view_roll_rad = 0.0\nspeed_m_per_s = 0.01\nrest_m = 5e-6\nsettle_s = 0.2\nmeasure_s = 0.4\npatience_s = 10.0\n\
[[leg]]\npose = 1\ntip_pos_in_base_m = [[0.0, 0.0, 0.026], [0.001, 0.0, 0.0259]]\n[[leg]]\npose = 0\ntip_pos_in_base_m = [[0.0, 0.0, 0.026]]\n";

/// The readers.
pub(super) fn readers(folder: &TempFolder) -> Vec<Reader<'_>> {
    vec![
        Reader {
            name: "plan",
            seeds: vec![PLAN.as_bytes().to_vec()],
            n_inputs: 500,
            read: Box::new(move |bytes| drop(GuidePlan::load(&file_in(folder, "fuzz.plan.toml", bytes)))),
        },
        Reader {
            name: "config",
            seeds: vec![
                b"[slave]\nwatchdog_ms = 40.0\n[slave.limits]\npull_n = 50.0\n[master]\nengage = \"hold:1\"\n".to_vec(),
                b"compensation = \"naive\"\n[resolve]\nmax_bend_rad = 1.0\n[[slave.drive.actuator]]\nid = 3\n".to_vec(),
            ],
            n_inputs: 20,
            read: Box::new(read_configuration),
        },
        servo_bus("servo", ServoMake::Sts3215, sts3215_answers()),
        servo_bus("dynamixel", ServoMake::Xl330, xl330_answers()),
        Reader {
            name: "can",
            seeds: vec![conversation(), Vec::new()],
            n_inputs: 500,
            read: Box::new(|bytes| converse(Tape::of(bytes), || ())),
        },
        page(folder),
    ]
}

/// A process of its own, as a user starts it, in little memory.
fn read_configuration(bytes: &[u8]) {
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -v 262144; exec \"$0\" config --config -"]).arg(krait_program());
    let mut child = shell.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it runs");
    let _it_may_have_refused_before = child.stdin.take().expect("piped").write_all(bytes);
    let ended = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stderr);
    let is_sound = ended.status.success() || ended.status.code() == Some(2) && said.starts_with("krait: ");
    assert!(is_sound && !said.contains("panicked"), "{ended:?}");
}

/// A serial port at whose other end every question is answered with the input.
fn servo_bus(name: &'static str, make: ServoMake, seeds: Vec<Vec<u8>>) -> Reader<'static> {
    let (host, path) = terminal();
    let answer = Arc::new(Mutex::new(Vec::new()));
    let theirs = Arc::clone(&answer);
    std::thread::spawn(move || {
        let mut question = [0; 512];
        while rustix::io::read(&host, &mut question).is_ok_and(|n| n > 0) {
            let bytes: Vec<u8> = theirs.lock().unwrap_or_else(PoisonError::into_inner).clone();
            // What the terminal cannot take at once would stop both ends.
            let _gone_at_the_end = rustix::io::write(&host, &bytes[..bytes.len().min(1024)]);
        }
    });
    let bus = ServoBus::to_read(make, &path, 1_000_000, vec![1, 2, 3], Duration::from_millis(2)).expect("a port");
    let (bus, seen) = (RefCell::new(bus), RefCell::new(Seen::default()));
    Reader {
        name,
        seeds,
        n_inputs: 100,
        read: Box::new(move |bytes| {
            bytes.clone_into(&mut answer.lock().unwrap_or_else(PoisonError::into_inner));
            let mut seen = seen.borrow_mut();
            bus.borrow_mut().ask(&mut seen).expect("the port is there, whatever is said on it");
            assert!(seen.current_a.iter().chain(&seen.supply_v).all(|value| value.is_finite()), "{seen:?}");
        }),
    }
}

/// A pseudo-terminal as plain as a serial port, and the path of its other end.
fn terminal() -> (OwnedFd, PathBuf) {
    let host = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a terminal");
    grantpt(&host).expect("mine");
    unlockpt(&host).expect("open");
    let mut settings = tcgetattr(&host).expect("settings");
    settings.make_raw();
    tcsetattr(&host, OptionalActions::Now, &settings).expect("raw");
    let name = ptsname(&host, Vec::new()).expect("a name");
    (host, PathBuf::from(name.to_string_lossy().into_owned()))
}

fn sts3215_answers() -> Vec<Vec<u8>> {
    let status = (1..=3).flat_map(|id| packet(id, &[1, 0, 0, 8, 0, 0, 0, 0, 232, 3, 0, 8, 0, 8, 0, 0])).collect();
    vec![status, packet(2, &[]), vec![0xFF; 40]]
}

/// Answers of one register, and of the 31 from the goal on.
fn xl330_answers() -> Vec<Vec<u8>> {
    let status = |id| [packet_2(id, &[1]), packet_2(id, &[0, 8, 0, 0].repeat(8)[..31])].concat();
    vec![(1..=3).flat_map(status).collect(), packet_2(2, &[0xFF, 0xFF, 0xFD]), [0xFF, 0xFF, 0xFD, 0].repeat(10)]
}

/// An answer of protocol 2 without an error.
fn packet_2(id: u8, data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u16 + 4).to_le_bytes();
    let mut bytes = [&[0xFF, 0xFF, 0xFD, 0, id], &length[..], &[0x55, 0], data].concat();
    let crc = bytes.iter().fold(0_u16, |sum, byte| {
        (0..8).fold(sum ^ u16::from(*byte) << 8, |sum, _| if sum & 0x8000 == 0 { sum << 1 } else { sum << 1 ^ 0x8005 })
    });
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// A servo's answer of 31 registers, of which the first are given.
fn packet(id: u8, first: &[u8]) -> Vec<u8> {
    let mut data = first.to_vec();
    data.resize(31, 0);
    let mut bytes = vec![0xFF, 0xFF, id, 33, 0];
    bytes.extend(data);
    let sum = bytes[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    bytes.push(!sum);
    bytes
}

/// Bytes of a tape for each time that the wire was asked: whether there was a frame, its number, its length, its bytes.
const TAPE_STEP: usize = 12;

/// A wire that says what stands on a tape, whatever it is told.
struct Tape {
    bytes: Vec<u8>,
    at: usize,
    now_ns: i64,
}

impl Tape {
    fn of(bytes: &[u8]) -> Self {
        Self { bytes: bytes.to_vec(), at: 0, now_ns: 1_000_000 }
    }
}

impl Wire for Tape {
    fn send(&mut self, _frame: &Frame) -> Result<(), BusGone> {
        Ok(())
    }

    fn receive(&mut self, until_ns: i64) -> Result<Option<Frame>, BusGone> {
        let step = self.bytes.get(self.at..self.at + TAPE_STEP);
        self.at += TAPE_STEP;
        self.now_ns += 1000;
        match step {
            Some([1, low, high, length, data @ ..]) => {
                let number = u16::from_le_bytes([*low, *high]);
                Ok(Some(Frame::new(number, &data[..usize::from(*length).min(data.len())])))
            }
            _ => {
                self.now_ns = self.now_ns.max(until_ns);
                Ok(None)
            }
        }
    }

    fn now_ns(&self) -> i64 {
        self.now_ns
    }
}

/// A wire of emulated drives that writes down what it hears.
struct Tapped {
    wire: CanWire,
    heard: Arc<Mutex<Vec<u8>>>,
}

impl Wire for Tapped {
    fn send(&mut self, frame: &Frame) -> Result<(), BusGone> {
        self.wire.send(frame)
    }

    fn receive(&mut self, until_ns: i64) -> Result<Option<Frame>, BusGone> {
        let frame = self.wire.receive(until_ns)?;
        let mut step = [0; TAPE_STEP];
        if let Some(frame) = &frame {
            let [low, high] = frame.id().to_le_bytes();
            step[..4].copy_from_slice(&[1, low, high, frame.data().len() as u8]);
            step[4..4 + frame.data().len()].copy_from_slice(frame.data());
        }
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).extend(step);
        Ok(frame)
    }

    fn now_ns(&self) -> i64 {
        self.wire.now_ns()
    }
}

/// What three sound drives say while they are opened, switched on and told to stay.
fn conversation() -> Vec<u8> {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let (wire, clock) = CanBus::new((1..=3).map(|id| CanDrive::new(id, 100_000.0)).collect()).own_time();
    converse(Tapped { wire, heard: Arc::clone(&heard) }, || {
        clock.fetch_add(2_000_000, Ordering::Relaxed);
    });
    let tape = heard.lock().unwrap_or_else(PoisonError::into_inner).clone();
    assert!(tape.len() > 200 * TAPE_STEP, "the drives were opened: {} steps", tape.len() / TAPE_STEP);
    tape
}

/// Three drives opened, switched on and told to stay, then looked at; `pass` lets a period go by.
fn converse(wire: impl Wire, pass: impl Fn()) {
    let actuator = |id| ActuatorConfig {
        id,
        zero_count: Some(100_000),
        lead_m: Some(0.002),
        vendor: Some(0x555),
        product: Some(1),
        efficiency: 0.8,
        ..ActuatorConfig::default()
    };
    let drive = DriveConfig {
        kind: DriveKind::Cia402,
        interface: Some("vcan0".to_owned()),
        period_ms: 2.0,
        timeout_ms: 1.5,
        heartbeat_ms: 10,
        gives_up_ms: 50,
        speed_counts_per_s: 200_000.0,
        actuator: (1..=3).map(actuator).collect(),
        ..DriveConfig::default()
    };
    let mut bus = match Cia402::open(&SlaveConfig { drive, ..SlaveConfig::default() }, wire) {
        Ok((bus, _)) => bus,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let (mut seen, goals) = (Seen::default(), Goals { counts: [100_000; 12], counts_per_s: [1.0; 12] });
    for cycle in 0..60 {
        pass();
        let told = if cycle < 30 { bus.switch(true, &goals) } else { bus.tell(&goals) };
        if told.and_then(|()| bus.ask(&mut seen)).is_err() {
            return;
        }
    }
}

/// The console of a recording's folder, to which the input is sent as an order, a file, a token, a message of a page and of a
/// viewer, and as it is.
fn page(folder: &TempFolder) -> Reader<'static> {
    let (recordings, lab, instance) = (folder.file("no-recordings"), folder.file("lab"), instance_name("fuzzed"));
    fs::create_dir_all(&recordings).expect("made");
    let started = ["console", "--instance", &instance, "--recordings", &recordings, "--lab", &lab, "--foxglove"];
    let target = RefCell::new(None);
    Reader {
        name: "page",
        seeds: vec![
            br#"{"verb":"add","model":"base.toml","data":"a.csv","effect":"backlash","out":"b.toml"}"#.to_vec(),
            br#"{"k":"wish","id":1,"wish":"enable","session":"0","at_ms":12.5}"#.to_vec(),
            br#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":1,"channelId":5}]}"#.to_vec(),
            br#"{"op":"unsubscribe","subscriptionIds":[0,1]}"#.to_vec(),
            br#"{"k":"pad","n":1,"held":true,"x":0.5,"y":-0.25,"session":"0","at_ms":12.5}"#.to_vec(),
            b"GET /recordings/a.mcap HTTP/1.1\r\nHost: 127.0.0.1\r\nCookie: a=b\r\nContent-Length: 3\r\n\r\nabc"
                .to_vec(),
        ],
        n_inputs: 40,
        read: Box::new({
            let started = started.map(str::to_owned);
            move |bytes| target.borrow_mut().get_or_insert_with(|| Target::start(&started)).hit(bytes)
        }),
    }
}

/// A console that runs, and a browser's cookie.
struct Target {
    krait: Option<Krait>,
    console: Console,
    cookie: String,
    /// The path for viewers, token included.
    viewers: String,
}

impl Target {
    fn start(arguments: &[String]) -> Self {
        let mut krait = Krait::start(arguments);
        let console = Console::of(&mut krait);
        let address = krait.line();
        let start = format!("Foxglove: ws://127.0.0.1:{}", console.port);
        let viewers = address.strip_prefix(&start).expect("an address on the same port").to_owned();
        Self { cookie: console.cookie(), krait: Some(krait), console, viewers }
    }

    fn hit(&self, bytes: &[u8]) {
        let (text, origin) = (String::from_utf8_lossy(bytes), self.console.origin());
        let headers = [("Origin", origin.as_str()), ("Cookie", &self.cookie)];
        self.console.send_bytes(bytes);
        for path in ["/lab/job", "/token", "/lab/data/fuzz.csv"] {
            let answer = self.console.request("POST", path, &headers, &text);
            assert!((200..500).contains(&answer.status), "{path}: {answer:?}");
        }
        let protocol = ("Sec-WebSocket-Protocol", "foxglove.websocket.v1");
        // Those that have gone may still count as there.
        let viewer = self.console.open(&self.viewers, &[protocol]).ok();
        for mut live in [Some(self.console.page()), viewer].into_iter().flatten() {
            // A message that is too long or no text ends the connection, which may be before it is sent.
            let _closed_early = live.send(Message::text(text.clone().into_owned()));
            let _closed_too = live.send(Message::binary(bytes.to_vec()));
        }
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        if let Some(krait) = self.krait.take()
            && !std::thread::panicking()
        {
            let status = fs::read_to_string(format!("/proc/{}/status", krait.pid())).expect("it runs");
            let most_kb = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("its memory");
            let most_kb: usize = most_kb.trim().trim_end_matches(" kB").parse().expect("a number");
            assert!(most_kb << 10 < super::MOST_BYTES, "the console took {most_kb} kB");
            krait.signal(Signal::INT);
            let ended = krait.end(PATIENCE);
            assert!(ended.code == Some(0) && !ended.stderr.contains("panicked"), "{ended:?}");
        }
    }
}

#[test]
fn a_scan_of_a_bus_on_which_anything_is_said_ends_and_names_each_drive_once() {
    let tape = conversation();
    for skipped in 0..200 {
        let said = &tape[skipped * TAPE_STEP..];
        if let Ok(found) = scan(&mut Tape::of(said), 4) {
            assert!(found.windows(2).all(|pair| pair[0].id < pair[1].id) && found.len() <= 4, "{found:?}");
        }
        drop(CanReading::of(&mut Tape::of(said), 1));
    }
}
