//! The serial bus by the machine's counted instructions: emulated servos at 1 Mbaud behind an adapter that holds bytes for 1 ms, on a
//! pseudo-terminal of this kernel. What a busy host takes from a processor is no lateness here.

use crate::threads::{LATE_US, SPEED_M_PER_S, ThreadChain, WORK_US, is_whole, quantiles_us, three};
use crate::verdict::PartVerdict;
use anyhow::{Context, ensure};
use core::time::Duration;
use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_drives::{ActuatorBus, Goals, Seen, ServoBus, ServoMake, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, DriveCycle};
use krait_slave::{ActuatorConfig, Drive, DriveConfig, DriveKind, SlaveConfig};
use rustix::time::{ClockId, clock_gettime};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};

const ZERO: i32 = 2048;
const N: usize = 3;
/// 200 Hz.
const PERIOD_NS: i64 = 5_000_000;
/// Counts of a metre: a spool of 8 mm.
const COUNTS_PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
/// Cycles until a lost servo is known: three answers that are missing, and the one during which it happens.
const KNOWN_CYCLES: u64 = 4;
/// The braking ramp of 10 mm/s at 1 m/s2, and one for a wish that falls between two cycles.
const BRAKE_CYCLES: u64 = 3;

/// How a process of servos is told their kind.
const KINDS: [(&str, DriveKind); 2] = [("sts3215", DriveKind::Sts3215), ("xl330", DriveKind::Xl330)];

/// Emulated servos in a process of their own.
struct Servos {
    kind: DriveKind,
    child: Child,
    words: ChildStdin,
    port: PathBuf,
}

impl Servos {
    /// Starts some of a kind, below the bus's thread.
    fn start(kind: DriveKind) -> anyhow::Result<Self> {
        let (word, _) = KINDS.into_iter().find(|(_, own)| *own == kind).context("no servos")?;
        let mut child = Command::new("/bin/chrt")
            .args(["-f", "40", "/bin/krait-can-vm", "servos", word])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context("the servos' process")?;
        let words = child.stdin.take().context("its input")?;
        let mut port = String::new();
        BufReader::new(child.stdout.take().context("its output")?).read_line(&mut port)?;
        ensure!(!port.trim().is_empty(), "the servos have named no port");
        Ok(Self { kind, child, words, port: PathBuf::from(port.trim()) })
    }

    fn say(&mut self, word: &str) -> anyhow::Result<()> {
        writeln!(self.words, "{word}").context("the servos do not listen")
    }

    fn config(&self) -> SlaveConfig {
        let actuator = |id| ActuatorConfig { id, zero_count: Some(ZERO), ..ActuatorConfig::default() };
        let drive = DriveConfig {
            kind: self.kind,
            port: Some(self.port.clone()),
            actuator: (1..=N as u32).map(actuator).collect(),
            ..DriveConfig::default()
        };
        SlaveConfig { drive, ..SlaveConfig::default() }
    }
}

impl Drop for Servos {
    fn drop(&mut self) {
        if self.child.kill().is_ok() {
            drop(self.child.wait());
        }
    }
}

/// Three servos of a kind near their zero; a line of input unplugs the second or plugs it in again.
pub fn be_servos(word: &str) -> anyhow::Result<bool> {
    let kind = KINDS.into_iter().find(|(own, _)| *own == word).map(|(_, kind)| kind);
    let make = kind.and_then(ServoMake::of).context("expected a kind of servos")?;
    let mut wire = ServoWire::new((1..=N as u8).map(|id| Servo::of(make, id, f64::from(ZERO))).collect());
    wire.usb_latency = Duration::from_millis(1);
    let emulator = Emulator::start(wire).context("a pseudo-terminal")?;
    println!("{}", emulator.path().display());
    for line in std::io::stdin().lines() {
        let is_silent = line?.trim() == "unplug";
        if let Some(servo) = emulator.wire().servo(2) {
            servo.faults.is_silent = is_silent;
        }
    }
    Ok(true)
}

/// Time that this thread has worked, not waited, ns.
fn worked_ns() -> i64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// So many cycles of the bus's own code by a bare timer: what a cycle takes, and what it works.
pub fn rate(kind: DriveKind, n: usize) -> anyhow::Result<PartVerdict> {
    let servos = Servos::start(kind)?;
    let (mut bus, mut seen): (ServoBus, Seen) = ServoBus::open(&servos.config().drive)?;
    let mut goals = Goals { counts: [ZERO; 12], counts_per_s: [1000.0; 12] };
    bus.switch(true, &goals)?;
    bus.ask(&mut seen)?;
    let (mut late, mut work, mut took) = (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
    let (mut n_unanswered, mut farthest) = (0, 0);
    let mut due_ns = monotonic_ns() + PERIOD_NS;
    for k in 0..n {
        let left_ns = due_ns - monotonic_ns();
        std::thread::sleep(Duration::from_nanos(left_ns.max(0).unsigned_abs()));
        let (begin_ns, begin_work_ns) = (monotonic_ns(), worked_ns());
        late.push(begin_ns - due_ns);
        due_ns += PERIOD_NS;
        let way = 100.0 * (core::f64::consts::TAU * k as f64 * PERIOD_NS as f64 * 1e-9).sin();
        goals.counts[..N].fill(ZERO + way as i32);
        bus.tell(&goals)?;
        bus.ask(&mut seen)?;
        work.push(worked_ns() - begin_work_ns);
        took.push(monotonic_ns() - begin_ns);
        n_unanswered += usize::from(seen.has_answered[..N] != [true; N]);
        farthest = farthest.max(seen.counts[0].abs_diff(ZERO));
    }
    let mut verdict = PartVerdict::default();
    verdict.check("unanswered", n_unanswered == 0, format!("{n_unanswered}/{n}"));
    let (late, work, took) = (quantiles_us(late), quantiles_us(work), quantiles_us(took));
    verdict.check("late_p50_p999_max_us", late[1] < LATE_US, three(late));
    verdict.check("own_work_p50_p999_max_us", work[0] < WORK_US, three(work));
    verdict.check("took_p50_p999_max_us", took[2] < PERIOD_NS as f64 * 1e-3, three(took));
    verdict.check("moved_counts", farthest > 50, farthest);
    Ok(verdict)
}

/// The bus's own thread beside a slave's ticks: cycles are held and handed over one by one.
pub fn thread(kind: DriveKind, n: usize) -> anyhow::Result<PartVerdict> {
    let servos = Servos::start(kind)?;
    ThreadChain::powered(open_drive(&servos.config(), None)?)?.judge(n, PERIOD_NS, WORK_US)
}

/// One servo is unplugged in motion: the others brake as the recorded goals show, stay under power, and nothing resumes.
pub fn unplugged(kind: DriveKind) -> anyhow::Result<PartVerdict> {
    let mut servos = Servos::start(kind)?;
    let mut chain = ThreadChain::powered(open_drive(&servos.config(), None)?)?;
    chain.go(200)?;
    chain.cycles.clear();
    servos.say("unplug")?;
    chain.go(300)?;
    let mut verdict = PartVerdict::default();
    let cycles = &chain.cycles;
    let first = cycles.iter().find(|cycle| !is_whole(cycle)).context("no answer is missing")?;
    let known = cycles.iter().find(|cycle| cycle.failure != 0).context("nothing is known to have failed")?;
    let after = known.cycle - first.cycle + 1;
    verdict.check("known_after_cycles", after <= KNOWN_CYCLES && known.failure_actuator == 2, after);
    let goal = |cycle: &DriveCycle| cycle.actuators[0].told_counts;
    let steps: Vec<(u64, i32)> = cycles.windows(2).map(|two| (two[1].cycle, goal(&two[1]) - goal(&two[0]))).collect();
    let last_step = steps.iter().rev().find(|(_, step)| *step != 0).map_or(0, |(cycle, _)| *cycle);
    let stopped = last_step.saturating_sub(first.cycle) + 1;
    verdict.check("others_still_after_cycles", stopped <= KNOWN_CYCLES + BRAKE_CYCLES, stopped);
    // What a wish may go by in a period, a tick that falls between two cycles, and a count of rounding.
    let most = steps.iter().map(|(_, step)| step.abs()).max().unwrap_or(0);
    let allowed = (SPEED_M_PER_S * 6e-3 * COUNTS_PER_M).ceil() as i32 + 1;
    verdict.check("largest_step_counts", most > 0 && most <= allowed, most);
    let held = |cycle: &DriveCycle| [0, 2].iter().all(|k| cycle.actuators[*k].has(ActuatorCycle::POWERED));
    let last = cycles.last().context("no cycles")?;
    verdict.check("others_hold_under_power", held(last), held(last));
    let before = goal(last);
    servos.say("plug")?;
    chain.go(300)?;
    let last = chain.cycles.last().context("no cycles")?;
    verdict.check("nothing_resumes", goal(last) == before && is_whole(last), goal(last) - before);
    chain.drive.set_power(monotonic_ns(), false)?;
    std::thread::sleep(Duration::from_millis(50));
    chain.power_up()?;
    verdict.check("power_again", chain.drive.failure().is_none(), "yes");
    Ok(verdict)
}
