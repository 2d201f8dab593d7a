//! A bus's own thread at work, as in a chain: wishes every millisecond, every cycle that it hands over, and the processor time that the
//! kernel counts for it. Its lateness is that of a chain, with what krait does of a cycle (wishes, judge, record) in it.

use crate::verdict::PartVerdict;
use crate::world::{DriveMake, Drives, config};
use anyhow::{Context, bail};
use core::time::Duration;
use krait_drives::{BusDrive, cia402};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, DriveCycle};
use krait_slave::{Drive, Switching, lines};
use std::path::{Path, PathBuf};

/// Lateness that 999 of 1000 cycles must keep, us.
pub const LATE_US: f64 = 50.0;
/// Own work of a cycle of a serial bus, us.
pub const WORK_US: f64 = 100.0;
/// The same of CAN, where a virtual interface hands each frame to all who listen in the sender's own time: half a period.
const CAN_WORK_US: f64 = 500.0;
/// Speed of the motion, m/s.
pub const SPEED_M_PER_S: f64 = 0.01;
/// Ticks after which cycles are looked at: the motion turns round within them, and they are put away.
const LOOK_TICKS: usize = 1000;
/// Part of its rate that a bus may be off by.
const RATE_PART: f64 = 5e-4;

/// A slave in small before a bus's own thread, with every cycle that it hands over.
pub struct ThreadChain {
    pub drive: BusDrive,
    pub cycles: Vec<DriveCycle>,
    q_m: f64,
}

impl ThreadChain {
    /// Gives its drives power.
    pub fn powered(drive: BusDrive) -> anyhow::Result<Self> {
        let mut chain = Self { drive, cycles: Vec::new(), q_m: 0.0 };
        chain.power_up()?;
        Ok(chain)
    }

    /// Switches power on anew.
    pub fn power_up(&mut self) -> anyhow::Result<()> {
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
    pub fn go(&mut self, n: usize) -> anyhow::Result<()> {
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

    /// Judges at least so many cycles: all held, all answered, in time, and each with so little work, us.
    pub fn judge(&mut self, n: usize, period_ns: i64, most_work_us: f64) -> anyhow::Result<PartVerdict> {
        self.go(50)?;
        self.cycles.clear();
        let mut cycles: Vec<JudgedCycle> = Vec::with_capacity(n + n / 4 + LOOK_TICKS);
        let work = BusWork::begin()?;
        let n_ticks = n as i64 * period_ns / 1_000_000;
        for _ in 0..(n_ticks.unsigned_abs() as usize).div_ceil(LOOK_TICKS) {
            self.go(LOOK_TICKS)?;
            cycles.extend(self.cycles.drain(..).map(|cycle| JudgedCycle::of(&cycle)));
        }
        let worked_ns = work.ns()?;
        let mut verdict = PartVerdict::default();
        let failure = self.drive.failure().map_or("none".to_owned(), |failure| failure.to_string().replace(' ', "_"));
        verdict.check("failure", failure == "none", failure);
        let (Some(first), Some(last)) = (cycles.first(), cycles.last()) else { bail!("no cycles") };
        let n_cycles = cycles.len();
        let are_all = last.cycle - first.cycle + 1 == n_cycles as u64 && last.n_left_out == 0;
        verdict.check("cycles_none_lost", are_all && n_cycles >= n, n_cycles);
        let n_missing = cycles.iter().filter(|cycle| !cycle.is_whole).count();
        verdict.check("unanswered", n_missing == 0, format!("{n_missing}/{n_cycles}"));
        let hertz = (n_cycles - 1) as f64 * 1e9 / (last.sample_ns - first.sample_ns) as f64;
        let meant_hertz = 1e9 / period_ns as f64;
        verdict.check("hertz", (hertz / meant_hertz - 1.0).abs() < RATE_PART, format!("{hertz:.3}"));
        // One that is late by more than a quarter of a period moves those behind it; the others are due by the grid.
        let mut due_ns = first.sample_ns;
        let late = |cycle: &JudgedCycle| {
            let late_ns = cycle.sample_ns - due_ns;
            due_ns = period_ns + if late_ns > period_ns / 4 { cycle.sample_ns } else { due_ns };
            late_ns.abs()
        };
        let late = quantiles_us(cycles.iter().map(late).collect());
        verdict.check("late_p50_p999_max_us", late[1] < LATE_US, three(late));
        let took = quantiles_us(cycles.iter().map(|cycle| cycle.answered_ns - cycle.sample_ns).collect());
        verdict.check("took_p50_p999_max_us", took[2] < period_ns as f64 * 1e-3, three(took));
        let work_us = worked_ns as f64 * 1e-3 / n_cycles as f64;
        verdict.check("thread_work_us", work_us > 1.0 && work_us < most_work_us, format!("{work_us:.1}"));
        Ok(verdict)
    }
}

/// What is judged of a cycle: two minutes of whole ones would be a large part of the machine's memory.
struct JudgedCycle {
    cycle: u64,
    n_left_out: u64,
    sample_ns: i64,
    answered_ns: i64,
    is_whole: bool,
}

impl JudgedCycle {
    fn of(cycle: &DriveCycle) -> Self {
        let DriveCycle { cycle: number, n_left_out, sample_ns, answered_ns, .. } = *cycle;
        Self { cycle: number, n_left_out, sample_ns, answered_ns, is_whole: is_whole(cycle) }
    }
}

/// Whether all actuators have answered in a cycle.
pub fn is_whole(cycle: &DriveCycle) -> bool {
    cycle.actuators().iter().all(|own| own.has(ActuatorCycle::ANSWERED))
}

/// Median, p99.9 and largest, us.
pub fn quantiles_us(mut values_ns: Vec<i64>) -> [f64; 3] {
    values_ns.sort_unstable();
    let at = |part: f64| values_ns.get(((values_ns.len().max(1) - 1) as f64 * part) as usize).copied();
    [0.5, 0.999, 1.0].map(|part| at(part).map_or(f64::NAN, |value| value as f64 * 1e-3))
}

/// Three figures as one word.
pub fn three(values: [f64; 3]) -> String {
    format!("{:.1}/{:.1}/{:.1}", values[0], values[1], values[2])
}

/// Processor time of the bus's thread, as the kernel counts it.
struct BusWork {
    schedstat: PathBuf,
    begin_ns: i64,
}

impl BusWork {
    /// Counts from now.
    fn begin() -> anyhow::Result<Self> {
        let tasks = std::fs::read_dir("/proc/self/task").context("this process's threads")?.flatten();
        let is_bus = |task: &Path| std::fs::read_to_string(task.join("comm")).is_ok_and(|name| name.trim() == "drives");
        let task = tasks.map(|entry| entry.path()).find(|task| is_bus(task)).context("no thread is called `drives`")?;
        let mut work = Self { schedstat: task.join("schedstat"), begin_ns: 0 };
        work.begin_ns = work.ns()?;
        Ok(work)
    }

    /// What it has worked since, ns.
    fn ns(&self) -> anyhow::Result<i64> {
        let text = std::fs::read_to_string(&self.schedstat).context("the thread's processor time")?;
        let worked_ns: i64 = text.split_whitespace().next().context("no figure")?.parse().context("no number")?;
        Ok(worked_ns - self.begin_ns)
    }
}

/// CAN drives, at a period, ms.
pub fn can(kind: DriveMake, period_ms: f64, n: usize) -> anyhow::Result<PartVerdict> {
    let _drives = Drives::start(kind)?;
    let mut chain = ThreadChain::powered(cia402::open_drive(&config(period_ms), None)?)?;
    chain.judge(n, (period_ms * 1e6) as i64, CAN_WORK_US)
}
