//! The serial bus in time, on emulated servos at 1 Mbaud behind an adapter that holds bytes for 1 ms: cycles held and answers missing
//! are counted beside what a bare timer and raw packets on a terminal of the same kind come to in the same run, and the time that a cycle
//! itself takes is a ratio to that of the raw packets. Figures in absolute time are printed, for docs/bench, and asserted nowhere.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, reason = "a panic is how a test fails")]

mod rig;

use krait_drives::emulator::Emulator;
use krait_drives::{ActuatorBus, Goals, Seen, ServoBus, ServoMake, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, DriveCycle};
use krait_slave::{Drive, SlaveConfig, lines};
use rig::{Rig, config, three};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::io::{read, write};
use rustix::termios::{QueueSelector, tcflush, tcgetattr, tcsetattr};
use rustix::time::{ClockId, clock_gettime};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::Mutex;
use std::time::Duration;

const PERIOD_MS: f64 = 5.0;
const TIMEOUT_MS: f64 = 4.0;
/// Bytes that come back: a header of six and 31 registers, three times.
const ANSWER_BYTES: usize = 3 * (6 + 31);

/// Both need the machine's cores.
static ALONE: Mutex<()> = Mutex::new(());

fn slow_adapter() -> Emulator {
    let mut wire = three(ServoMake::Sts3215);
    wire.usb_latency = Duration::from_millis(1);
    Emulator::start(wire).unwrap()
}

fn in_time(emulator: &Emulator) -> SlaveConfig {
    let mut config = config(ServoMake::Sts3215, emulator);
    (config.drive.period_ms, config.drive.timeout_ms, config.drive.lost_cycles) = (PERIOD_MS, TIMEOUT_MS, 20);
    config
}

/// Time that this thread has worked, not waited, ns.
fn worked_ns() -> i64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// The packets of a cycle, without anything that knows what is in them.
struct Raw {
    port: OwnedFd,
    tell: Vec<u8>,
    ask: Vec<u8>,
}

impl Raw {
    fn open(path: &Path) -> Self {
        let port = open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK, Mode::empty()).unwrap();
        let mut settings = tcgetattr(&port).unwrap();
        settings.make_raw();
        settings.set_speed(1_000_000).unwrap();
        tcsetattr(&port, rustix::termios::OptionalActions::Now, &settings).unwrap();
        let packet = |body: &[u8]| {
            let sum = body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
            [&[0xFF, 0xFF], body, &[!sum]].concat()
        };
        // Everybody (254): set (0x83) acceleration, goal, time and speed from register 41; read (0x82) 31 registers from 40.
        let goals: Vec<u8> = (1..=3).flat_map(|id| [id, 0, 0, 8, 0, 0, 100, 0]).collect();
        let tell = packet(&[&[254, 28, 0x83, 41, 7], &goals[..]].concat());
        let ask = packet(&[254, 7, 0x82, 40, 31, 1, 2, 3]);
        Self { port, tell, ask }
    }

    /// A cycle; whether all answers came in time.
    fn cycle(&self) -> bool {
        write(&self.port, &self.tell).unwrap();
        tcflush(&self.port, QueueSelector::IFlush).unwrap();
        write(&self.port, &self.ask).unwrap();
        let until_ns = monotonic_ns() + (TIMEOUT_MS * 1e6) as i64;
        let (mut buffer, mut n) = ([0; 512], 0);
        while n < ANSWER_BYTES {
            let left_ns = (until_ns - monotonic_ns()).max(0);
            let left = Timespec { tv_sec: 0, tv_nsec: left_ns };
            if poll(&mut [PollFd::new(&self.port, PollFlags::IN)], Some(&left)).unwrap() == 0 {
                // What is late is thrown away.
                std::thread::sleep(Duration::from_millis(4));
                return false;
            }
            n += read(&self.port, &mut buffer).unwrap();
        }
        true
    }
}

#[test]
fn a_cycle_takes_few_times_the_work_of_its_raw_packets() {
    let _alone = ALONE.lock();
    let (own, other) = (slow_adapter(), slow_adapter());
    let (mut bus, mut seen): (ServoBus, Seen) = ServoBus::open(&in_time(&own).drive).unwrap();
    let raw = Raw::open(other.path());
    let goals = Goals { counts: [2048; 12], counts_per_s: [100.0; 12] };
    let mut own_ns = Vec::new();
    let mut raw_ns = Vec::new();
    for _ in 0..400 {
        let begin_ns = worked_ns();
        bus.tell(&goals).unwrap();
        bus.ask(&mut seen).unwrap();
        // A cycle whose answers were late has done something else.
        if seen.has_answered[..3] == [true; 3] {
            own_ns.push(worked_ns() - begin_ns);
        }
        let begin_ns = worked_ns();
        if raw.cycle() {
            raw_ns.push(worked_ns() - begin_ns);
        }
    }
    let median = |ns: &mut Vec<i64>| {
        assert!(ns.len() >= 50, "of 400 cycles only {} had all answers", ns.len());
        ns.sort_unstable();
        ns[ns.len() / 2] as f64 * 1e-3
    };
    let (own_us, raw_us) = (median(&mut own_ns), median(&mut raw_ns));
    println!("own work of a cycle {own_us:.1} us, of its raw packets {raw_us:.1} us, ratio {:.2}", own_us / raw_us);
    assert!(own_us < MOST_TIMES * raw_us, "{own_us} us, its raw packets alone {raw_us} us");
}

/// Work of a cycle, as a multiple of the raw packets'.
const MOST_TIMES: f64 = 2.0;

/// So long a bare timer runs and raw packets go, each with this period; how many periods, and how many answers were late.
fn bare(seconds: f64, raw: &Raw) -> (u64, u64) {
    let (end_ns, period_ns) = (monotonic_ns() + (seconds * 1e9) as i64, (PERIOD_MS * 1e6) as i64);
    let (mut n, mut n_late, mut due_ns) = (0, 0, monotonic_ns());
    while monotonic_ns() < end_ns {
        let left_ns = due_ns - monotonic_ns();
        if left_ns > 0 {
            std::thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
        }
        let now_ns = monotonic_ns();
        n_late += u64::from(!raw.cycle());
        n += 1;
        due_ns = (due_ns + period_ns).max(now_ns);
    }
    (n, n_late)
}

#[test]
fn two_hundred_cycles_a_second_are_held_and_none_is_lost() {
    let _alone = ALONE.lock();
    let seconds: f64 = std::env::var("SERIAL_SECONDS").map_or(6.0, |seconds| seconds.parse().unwrap());
    let (own, other) = (slow_adapter(), slow_adapter());
    let raw = Raw::open(other.path());
    let mut rig = Rig { drive: open_drive(&in_time(&own), None).unwrap(), emulator: own };
    rig.power_up();
    let beside = std::thread::spawn(move || bare(seconds, &raw));
    let mut cycles: Vec<DriveCycle> = Vec::new();
    while core::iter::from_fn(|| rig.drive.next_cycle()).next().is_some() {}
    let begin_ns = monotonic_ns();
    while !beside.is_finished() {
        std::thread::sleep(Duration::from_millis(1));
        let t_s = (monotonic_ns() - begin_ns) as f64 * 1e-9;
        let way_m = 1e-3 * (2.0 * t_s).sin();
        rig.drive.write(monotonic_ns(), lines([way_m, -0.5 * way_m, -0.5 * way_m])).unwrap();
        cycles.extend(core::iter::from_fn(|| rig.drive.next_cycle()));
    }
    let (n_bare, n_bare_late) = beside.join().unwrap();
    assert_eq!(rig.drive.failure(), None);
    // Lost: not recorded, or recorded twice.
    let (first, last) = (cycles.first().unwrap(), cycles.last().unwrap());
    assert_eq!(last.cycle - first.cycle + 1, cycles.len() as u64, "cycles follow each other");
    assert_eq!(last.n_left_out, 0, "every cycle found room on its way");
    let n = cycles.len() as u64;
    let is_whole = |cycle: &&DriveCycle| cycle.actuators().iter().all(|own| own.has(ActuatorCycle::ANSWERED));
    let n_missing = n - cycles.iter().filter(is_whole).count() as u64;
    let late_ms = |cycle: &DriveCycle| (cycle.answered_ns - cycle.sample_ns) as f64 * 1e-6;
    let mut took_ms: Vec<f64> = cycles.iter().map(late_ms).collect();
    took_ms.sort_unstable_by(f64::total_cmp);
    println!(
        "{n} cycles in {seconds} s, a bare timer with raw packets {n_bare}; answers missing in {n_missing} cycles, of the raw packets in \
         {n_bare_late}; a cycle took {:.2} ms in the middle, {:.2} ms at most",
        took_ms[took_ms.len() / 2],
        took_ms[took_ms.len() - 1]
    );
    assert!(n as f64 >= 0.95 * n_bare as f64, "{n} cycles, a bare timer {n_bare}");
    assert!(n_bare as f64 <= 1.05 * seconds * 1e3 / PERIOD_MS, "none is doubled: {n_bare}");
    // What a machine under load takes from raw packets it takes from these, and one in a hundred more.
    assert!(
        n_missing <= 2 * n_bare_late + n / 100,
        "missing in {n_missing} of {n} cycles, of raw packets {n_bare_late}"
    );
}
