//! The serial bus by the machine's counted instructions: emulated servos at 1 Mbaud behind an adapter that holds bytes for 1 ms, on a
//! pseudo-terminal of this kernel. What a busy host takes from a processor is no lateness here.

use crate::verdict::PartVerdict;
use anyhow::{Context, bail, ensure};
use core::time::Duration;
use krait_drives::emulator::{Emulator, Servo, ServoWire};
use krait_drives::{ActuatorBus, Goals, Seen, ServoBus, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, DriveCycle};
use krait_slave::{ActuatorConfig, Drive, DriveConfig, DriveKind, SlaveConfig, Switching, lines};
use rustix::time::{ClockId, clock_gettime};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};

const ZERO: i32 = 2048;
const N: usize = 3;
/// 200 Hz.
const PERIOD_NS: i64 = 5_000_000;
/// Lateness that 999 of 1000 cycles must keep, us.
const LATE_US: f64 = 50.0;
/// Own work of a cycle, us.
const WORK_US: f64 = 100.0;
/// Speed of the motion in which a servo is lost, m/s.
const SPEED_M_PER_S: f64 = 0.01;
/// Counts of a metre: a spool of 8 mm.
const COUNTS_PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
/// Cycles until a lost servo is known: three answers that are missing, and the one during which it happens.
const KNOWN_CYCLES: u64 = 4;
/// The braking ramp of 10 mm/s at 1 m/s2, and one for a wish that falls between two cycles.
const BRAKE_CYCLES: u64 = 3;

/// Emulated servos in a process of their own.
struct Servos {
    child: Child,
    words: ChildStdin,
    port: PathBuf,
}

impl Servos {
    /// Starts them, below the bus's thread.
    fn start() -> anyhow::Result<Self> {
        let mut child = Command::new("/bin/chrt")
            .args(["-f", "40", "/bin/krait-can-vm", "servos"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context("the servos' process")?;
        let words = child.stdin.take().context("its input")?;
        let mut port = String::new();
        BufReader::new(child.stdout.take().context("its output")?).read_line(&mut port)?;
        ensure!(!port.trim().is_empty(), "the servos have named no port");
        Ok(Self { child, words, port: PathBuf::from(port.trim()) })
    }

    fn say(&mut self, word: &str) -> anyhow::Result<()> {
        writeln!(self.words, "{word}").context("the servos do not listen")
    }

    fn config(&self) -> SlaveConfig {
        let actuator = |id| ActuatorConfig { id, zero_count: Some(ZERO), ..ActuatorConfig::default() };
        let drive = DriveConfig {
            kind: DriveKind::Sts3215,
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

/// Three servos near their zero; a line of input unplugs the second or plugs it in again.
pub fn be_servos() -> anyhow::Result<bool> {
    let mut wire = ServoWire::new((1..=N as u8).map(|id| Servo::new(id, f64::from(ZERO))).collect());
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

/// Median, p99.9 and largest, us.
fn quantiles_us(mut values_ns: Vec<i64>) -> [f64; 3] {
    values_ns.sort_unstable();
    let at = |part: f64| values_ns.get(((values_ns.len().max(1) - 1) as f64 * part) as usize).copied();
    [0.5, 0.999, 1.0].map(|part| at(part).map_or(f64::NAN, |value| value as f64 * 1e-3))
}

fn three(values: [f64; 3]) -> String {
    format!("{:.1}/{:.1}/{:.1}", values[0], values[1], values[2])
}

/// So many cycles of the bus's own code by a bare timer: what a cycle takes, and what it works.
pub fn rate(n: usize) -> anyhow::Result<PartVerdict> {
    let servos = Servos::start()?;
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

/// A slave in small before the bus's own thread, with every cycle that it hands over.
struct SerialChain {
    drive: krait_drives::BusDrive,
    cycles: Vec<DriveCycle>,
    q_m: f64,
}

impl SerialChain {
    fn powered(servos: &Servos) -> anyhow::Result<Self> {
        let mut chain = Self { drive: open_drive(&servos.config(), None)?, cycles: Vec::new(), q_m: 0.0 };
        chain.power_up()?;
        Ok(chain)
    }

    fn power_up(&mut self) -> anyhow::Result<()> {
        for _ in 0..3000 {
            std::thread::sleep(Duration::from_millis(1));
            if self.drive.set_power(monotonic_ns(), true)? == Switching::Done {
                self.q_m = self.drive.read(monotonic_ns())?.q_tilde_m[0];
                return Ok(());
            }
        }
        bail!("no power after 3 s")
    }

    /// So many ticks of motion that turns round every half second; once something has failed the wishes go on and are refused.
    fn go(&mut self, n: usize) -> anyhow::Result<()> {
        for k in 0..n {
            std::thread::sleep(Duration::from_millis(1));
            let way = if (k / 500) % 2 == 0 { SPEED_M_PER_S } else { -SPEED_M_PER_S };
            self.q_m = (self.q_m + way * 1e-3).clamp(-5e-3, 5e-3);
            let written = self.drive.write(monotonic_ns(), lines([self.q_m, -0.5 * self.q_m, -0.5 * self.q_m]));
            self.drive.read(monotonic_ns())?;
            self.cycles.extend(core::iter::from_fn(|| self.drive.next_cycle()));
            if let Err(error) = written
                && self.drive.failure().is_none()
            {
                return Err(error.into());
            }
        }
        Ok(())
    }
}

fn is_whole(cycle: &DriveCycle) -> bool {
    cycle.actuators().iter().all(|own| own.has(ActuatorCycle::ANSWERED))
}

/// The bus's own thread beside a slave's ticks: cycles are held and handed over one by one.
pub fn thread(n: usize) -> anyhow::Result<PartVerdict> {
    let servos = Servos::start()?;
    let mut chain = SerialChain::powered(&servos)?;
    chain.go(50)?;
    chain.cycles.clear();
    chain.go(5 * n)?;
    let mut verdict = PartVerdict::default();
    let failure = chain.drive.failure().map_or("none".to_owned(), |failure| failure.to_string().replace(' ', "_"));
    verdict.check("failure", failure == "none", failure);
    let (Some(first), Some(last)) = (chain.cycles.first(), chain.cycles.last()) else { bail!("no cycles") };
    let n_cycles = chain.cycles.len() as u64;
    verdict.check("cycles_none_lost", last.cycle - first.cycle + 1 == n_cycles && last.n_left_out == 0, n_cycles);
    let n_missing = chain.cycles.iter().filter(|cycle| !is_whole(cycle)).count();
    verdict.check("unanswered", n_missing == 0, n_missing);
    let hertz = (n_cycles - 1) as f64 * 1e9 / (last.sample_ns - first.sample_ns) as f64;
    verdict.check("hertz", (199.9..200.1).contains(&hertz), format!("{hertz:.3}"));
    let late = |cycle: &DriveCycle| {
        let due_ns = first.sample_ns + (cycle.cycle - first.cycle) as i64 * PERIOD_NS;
        (cycle.sample_ns - due_ns).abs()
    };
    let late = quantiles_us(chain.cycles.iter().map(late).collect());
    verdict.check("late_p50_p999_max_us", late[1] < LATE_US, three(late));
    let took = quantiles_us(chain.cycles.iter().map(|cycle| cycle.answered_ns - cycle.sample_ns).collect());
    verdict.check("took_p50_p999_max_us", took[2] < PERIOD_NS as f64 * 1e-3, three(took));
    Ok(verdict)
}

/// One servo is unplugged in motion: the others brake as the recorded goals show, stay under power, and nothing resumes.
pub fn unplugged() -> anyhow::Result<PartVerdict> {
    let mut servos = Servos::start()?;
    let mut chain = SerialChain::powered(&servos)?;
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
