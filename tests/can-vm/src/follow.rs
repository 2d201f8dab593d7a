//! Cyclic motion: every SYNC must be answered by all, in time, and targets must be reached.

use crate::verdict::PartVerdict;
use crate::world::{DriveMake, Drives, INTERFACE, PER_M, config};
use anyhow::bail;
use core::f64::consts::TAU;
use core::time::Duration;
use krait_drives::cia402::{CanPort, Cia402};
use krait_drives::{ActuatorBus, Goals, Seen, Trouble};
use krait_ipc::clock::monotonic_ns;

/// Lateness that 999 of 1000 cycles must keep, us.
const LATE_US: f64 = 50.0;
/// Cycles that power may take.
const POWER_CYCLES: usize = 100;

/// A steady clock for cycles.
struct Pace {
    due_ns: i64,
    period_ns: i64,
}

impl Pace {
    /// Waits for the next cycle as the bus's thread does; how late it begins, us.
    fn wait(&mut self) -> f64 {
        self.due_ns += self.period_ns;
        let left_ns = self.due_ns - monotonic_ns();
        if left_ns > 0 {
            std::thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
        }
        (monotonic_ns() - self.due_ns) as f64 * 1e-3
    }
}

/// So many cycles of a push-pull motion of 3 mm at 1 Hz.
pub fn csp(kind: DriveMake, period_ms: f64, n: usize) -> anyhow::Result<PartVerdict> {
    let _drives = Drives::start(kind)?;
    let (mut bus, mut seen) = Cia402::open(&config(period_ms), CanPort::open(INTERFACE)?)?;
    let period_ns = (period_ms * 1e6) as i64;
    let mut pace = Pace { due_ns: monotonic_ns(), period_ns };
    let power_cycles = power(&mut bus, &mut seen, &mut pace)?;
    let start = seen.counts;
    let (mut late, mut answer) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let (mut sent, mut read) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let (mut n_unanswered, mut n_troubles) = (0, 0);
    for k in 0..n {
        let time_s = k as f64 * period_ms * 1e-3;
        let goals = goals(start, time_s);
        late.push(pace.wait());
        let begin_ns = monotonic_ns();
        bus.tell(&goals)?;
        bus.ask(&mut seen)?;
        answer.push((monotonic_ns() - begin_ns) as f64 * 1e-3);
        n_unanswered += usize::from(seen.has_answered[..3] != [true; 3]);
        n_troubles += usize::from(seen.trouble[..3] != [Trouble::None; 3]);
        sent.push([goals.counts[0], goals.counts[1], goals.counts[2]]);
        read.push([seen.counts[0], seen.counts[1], seen.counts[2]]);
    }
    off(&mut bus, &mut seen, &mut pace)?;
    let (lag, error) = (0..5).map(|lag| (lag, error(&sent, &read, lag))).min_by_key(|pair| pair.1).unwrap_or((9, 0));
    let moved = read.iter().map(|counts| counts[0].abs_diff(start[0])).max().unwrap_or(0);
    let mut verdict = PartVerdict::default();
    verdict.check("cycles_to_power", power_cycles <= POWER_CYCLES, power_cycles);
    verdict.check("unanswered", n_unanswered == 0, format!("{n_unanswered}/{n}"));
    verdict.check("troubles", n_troubles == 0, n_troubles);
    let (late, answer) = (quantiles(late), quantiles(answer));
    verdict.check("late_p50_p999_max_us", late[1] < LATE_US, format!("{:.1}/{:.1}/{:.1}", late[0], late[1], late[2]));
    let text = format!("{:.0}/{:.0}/{:.0}", answer[0], answer[1], answer[2]);
    verdict.check("answered_p50_p999_max_us", answer[2] < period_ms * 1e3, text);
    verdict.check("reached_after_cycles", lag <= 2, lag);
    verdict.check("off_by_counts", error <= 100, error);
    verdict.check("moved_counts", moved > 20_000, moved);
    Ok(verdict)
}

fn goals(start: [i32; 12], time_s: f64) -> Goals {
    let mut goals = Goals { counts: start, counts_per_s: [1.0; 12] };
    for k in 0..3 {
        let phase = k as f64 * TAU / 3.0;
        let way_m = 3e-3 * ((TAU * time_s + phase).sin() - phase.sin()) * (time_s / 0.3).min(1.0);
        goals.counts[k] += (way_m * PER_M) as i32;
    }
    goals
}

fn power(bus: &mut Cia402<CanPort>, seen: &mut Seen, pace: &mut Pace) -> anyhow::Result<usize> {
    for n in 1..=POWER_CYCLES {
        pace.wait();
        bus.switch(true, &Goals { counts: seen.counts, counts_per_s: [1.0; 12] })?;
        bus.ask(seen)?;
        if seen.has_answered[..3] == [true; 3] && seen.is_powered[..3] == [true; 3] {
            return Ok(n);
        }
    }
    bail!("no power after {POWER_CYCLES} cycles: {:?}", seen.is_powered)
}

fn off(bus: &mut Cia402<CanPort>, seen: &mut Seen, pace: &mut Pace) -> anyhow::Result<()> {
    for _ in 0..POWER_CYCLES {
        pace.wait();
        bus.switch(false, &Goals::default())?;
        bus.ask(seen)?;
        if seen.is_powered[..3] == [false; 3] {
            return Ok(());
        }
    }
    bail!("still under power: {:?}", seen.is_powered)
}

/// Largest difference between what was told so many cycles before and what was read, counts.
fn error(sent: &[[i32; 3]], read: &[[i32; 3]], lag: usize) -> u32 {
    let pairs = sent.iter().zip(read.iter().skip(lag));
    pairs.flat_map(|(sent, read)| (0..3).map(|k| sent[k].abs_diff(read[k]))).max().unwrap_or(u32::MAX)
}

/// Median, p99.9 and largest.
fn quantiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [0.5, 0.999, 1.0].map(|part| values.get(((values.len() - 1) as f64 * part) as usize).copied().unwrap_or(f64::NAN))
}
