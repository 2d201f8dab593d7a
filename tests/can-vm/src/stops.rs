//! One drive, or the master, fails in motion: the others must stop as the recorded targets show, and nothing may resume.

use crate::chain::{RigChain, SPEED_M_PER_S};
use crate::monitor::Monitor;
use crate::program::until;
use crate::verdict::PartVerdict;
use crate::world::{BROKEN, DriveMake, Drives, GIVES_UP_MS, INTERFACE, PER_M, kill};
use anyhow::Context;
use core::time::Duration;
use krait_drives::cia402::{CanPort, CanReading, State, state};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{Drive, DriveError};
use rustix::process::Signal;
use std::process::{Command, Stdio};

/// Cycles until a failure is known: three answers that are missing, and the one during which it happens.
const KNOWN_CYCLES: usize = 4;
/// Largest step of a target at the limit of 30 mm/s, counts in a millisecond of the bus's period.
const MOST_COUNTS_PER_MS: f64 = 300.0;
/// Cycles of the braking ramp: wishes come each ms beside the bus's own ms, so that a cycle may take two of them; 1 m/s2.
const BRAKE_CYCLES: usize = (2.0 * SPEED_M_PER_S * 1e3) as usize + 1;

/// Checks that the others came to rest in time and by steps within the rate.
fn check_stop(verdict: &mut PartVerdict, kind: DriveMake, chain: &RigChain, when_ns: i64) {
    let steps = chain.monitor.steps_since(when_ns);
    let stopped = steps.iter().rposition(|step| *step != 0).map_or(0, |last| last + 1);
    verdict.check("others_still_after_cycles", stopped <= KNOWN_CYCLES + BRAKE_CYCLES, stopped);
    let most = steps.iter().map(|step| step.abs()).max().unwrap_or(0);
    verdict.check("largest_step_counts", most > 0 && f64::from(most) <= MOST_COUNTS_PER_MS * kind.period_ms(), most);
    let states = [0, 2].map(|k| state(chain.monitor.status[k]));
    verdict.check("others", states == [State::OperationEnabled; 2], format!("{:?}/{:?}", states[0], states[1]));
}

/// Checks that all come under power again once the failure is mended, from where they stand.
fn check_power_again(verdict: &mut PartVerdict, chain: &mut RigChain) -> anyhow::Result<()> {
    chain.drive.set_power(monotonic_ns(), false)?;
    chain.rest(100)?;
    let ticks = chain.power_up()?;
    verdict.check("power_again_after_ms", chain.drive.failure().is_none(), ticks);
    Ok(())
}

/// A drive's processor hangs and goes on 100 ms later.
pub fn frozen(kind: DriveMake) -> anyhow::Result<PartVerdict> {
    let drives = Drives::start(kind)?;
    let mut chain = RigChain::powered(kind.period_ms())?;
    chain.go(100)?;
    let when_ns = drives.signal(BROKEN, Signal::STOP)?;
    let failure = chain.until_failure(50 * kind.period_ms() as usize)?;
    let known_ms = (monotonic_ns() - when_ns) as f64 * 1e-6;
    let mut verdict = PartVerdict::default();
    verdict.check("lost", matches!(failure, DriveError::Lost { actuator: 2, .. }), format!("after_{known_ms:.1}_ms"));
    chain.go(100)?;
    let before = chain.monitor.counts[BROKEN];
    drives.signal(BROKEN, Signal::CONT)?;
    chain.go(100)?;
    let ran_mm = f64::from(chain.monitor.counts[BROKEN].abs_diff(before)) / PER_M * 1e3;
    let most_mm = match kind {
        DriveMake::Own => 0.1,
        // The independent axis takes any speed at once, here its largest of 60 mm/s, and then stops by 2 m/s2: 0.9 mm.
        DriveMake::Independent => 0.95,
        // It goes through the targets of four long cycles that came before the others had stopped.
        DriveMake::Canopen => 0.6,
    };
    verdict.check("ran_after_waking_mm", ran_mm < most_mm, format!("{ran_mm:.3}"));
    let woken = state(chain.monitor.status[BROKEN]);
    verdict.check("woken_is_stopped", woken != State::OperationEnabled, format!("{woken:?}"));
    check_stop(&mut verdict, kind, &chain, when_ns);
    check_power_again(&mut verdict, &mut chain)?;
    Ok(verdict)
}

/// A drive loses its power and comes back.
pub fn power_loss(kind: DriveMake) -> anyhow::Result<PartVerdict> {
    let mut drives = Drives::start(kind)?;
    drives.prepare_spare()?;
    let mut chain = RigChain::powered(kind.period_ms())?;
    chain.go(100)?;
    let when_ns = drives.signal(BROKEN, Signal::KILL)?;
    let failure = chain.until_failure(50 * kind.period_ms() as usize)?;
    let mut verdict = PartVerdict::default();
    verdict.check("lost", matches!(failure, DriveError::Lost { actuator: 2, .. }), "yes");
    drives.power_back()?;
    let boots = chain.monitor.n_boots[BROKEN];
    for _ in 0..3000 {
        chain.go(1)?;
        if chain.monitor.n_boots[BROKEN] > boots {
            break;
        }
    }
    verdict.check("boot_up_heard", chain.monitor.n_boots[BROKEN] > boots, chain.monitor.n_boots[BROKEN]);
    chain.go(300 * kind.period_ms() as usize)?;
    let configured = state(chain.monitor.status[BROKEN]);
    verdict.check("back_without_power", configured == State::SwitchOnDisabled, format!("{configured:?}"));
    check_stop(&mut verdict, kind, &chain, when_ns);
    check_power_again(&mut verdict, &mut chain)?;
    Ok(verdict)
}

/// A drive trips, as after too much current.
pub fn trip(kind: DriveMake) -> anyhow::Result<PartVerdict> {
    let drives = Drives::start(kind)?;
    let mut chain = RigChain::powered(kind.period_ms())?;
    chain.go(100)?;
    let when_ns = drives.signal(BROKEN, Signal::USR1)?;
    let failure = chain.until_failure(50 * kind.period_ms() as usize)?;
    let known_ms = (monotonic_ns() - when_ns) as f64 * 1e-6;
    let mut verdict = PartVerdict::default();
    let is_told = matches!(failure, DriveError::Tripped { actuator: 2, .. });
    verdict.check("tripped", is_told, format!("after_{known_ms:.1}_ms"));
    let cried = chain.monitor.emergencies.iter().find(|(_, node, code)| (*node, *code) == (2, 0x2310));
    verdict.check("emergency_2310", cried.is_some(), cried.is_some());
    chain.go(100)?;
    check_stop(&mut verdict, kind, &chain, when_ns);
    let stays = state(chain.monitor.status[BROKEN]);
    verdict.check("stays_in_fault", stays == State::Fault, format!("{stays:?}"));
    check_power_again(&mut verdict, &mut chain)?;
    Ok(verdict)
}

/// A drive's axis jams.
pub fn jam(kind: DriveMake) -> anyhow::Result<PartVerdict> {
    let drives = Drives::start(kind)?;
    let mut chain = RigChain::powered(kind.period_ms())?;
    chain.go(100)?;
    let when_ns = drives.signal(BROKEN, Signal::USR2)?;
    let failure = chain.until_failure(200)?;
    let known_ms = (monotonic_ns() - when_ns) as f64 * 1e-6;
    chain.go(100)?;
    let mut verdict = PartVerdict::default();
    let is_told = matches!(failure, DriveError::Tripped { actuator: 2, code: 0x8611, .. });
    verdict.check("does_not_follow", is_told, format!("after_{known_ms:.1}_ms"));
    // It takes its time until the error is large enough; the others stop from when it is known.
    let known_ns = when_ns + (known_ms * 1e6) as i64 - 2_000_000;
    check_stop(&mut verdict, kind, &chain, known_ns);
    Ok(verdict)
}

/// The master is killed in motion: drives stop by their heartbeat consumer, and a new master takes them over.
pub fn master_killed(kind: DriveMake) -> anyhow::Result<PartVerdict> {
    let _drives = Drives::start(kind)?;
    let mut monitor = Monitor::new()?;
    let mut command = Command::new("/bin/krait-can-vm");
    let period_ms = kind.period_ms().to_string();
    let mut master = command
        .args(["master", &period_ms])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .context("the master")?;
    let is_moving = until(&mut monitor, 5000, |monitor| monitor.counts[0].unsigned_abs() > 10_000)?;
    kill(&master, Signal::KILL)?;
    let (killed_ns, at) = (monotonic_ns(), monitor.counts);
    master.wait()?;
    let mut verdict = PartVerdict::default();
    verdict.check("was_moving", is_moving, format!("{at:?}"));
    judge_left_alone(&mut verdict, &mut monitor, killed_ns, at)?;
    drop(monitor);
    let mut chain = RigChain::powered(kind.period_ms())?;
    chain.go(50)?;
    verdict.check("taken_over", chain.drive.failure().is_none(), "yes");
    Ok(verdict)
}

/// Whoever told the drives was killed at an instant, where they were then: each cries that it misses its master, stops under power, and
/// stays.
pub fn judge_left_alone(
    verdict: &mut PartVerdict,
    monitor: &mut Monitor,
    killed_ns: i64,
    at: [i32; 3],
) -> anyhow::Result<()> {
    let has_cried = |monitor: &Monitor, node: u8| {
        let is_it = |(heard_ns, id, code): &&(i64, u8, u16)| (*id, *code) == (node, 0x8130) && *heard_ns >= killed_ns;
        monitor.emergencies.iter().find(is_it).map(|(heard_ns, ..)| *heard_ns)
    };
    until(monitor, 500, |monitor| (1..=3).all(|node| has_cried(monitor, node).is_some()))?;
    for (name, node) in [("emergency_1_after_ms", 1), ("emergency_2_after_ms", 2), ("emergency_3_after_ms", 3)] {
        let after_ms = has_cried(monitor, node).map(|heard_ns| (heard_ns - killed_ns) as f64 * 1e-6);
        let is_in_time = after_ms.is_some_and(|ms| ms <= f64::from(GIVES_UP_MS) + 20.0);
        verdict.check(name, is_in_time, after_ms.map_or("never".to_owned(), |ms| format!("{ms:.1}")));
    }
    std::thread::sleep(Duration::from_millis(50));
    let read = || -> anyhow::Result<Vec<CanReading>> {
        let mut port = CanPort::open(INTERFACE)?;
        (1..=3).map(|id| CanReading::of(&mut port, id)?.context("no answer")).collect()
    };
    let first = read()?;
    std::thread::sleep(Duration::from_millis(100));
    let second = read()?;
    let is_stopped = first.iter().all(|reading| state(reading.status) == State::QuickStopActive);
    verdict.check("all_stopped_under_power", is_stopped, is_stopped);
    let is_still = first.iter().zip(&second).all(|(a, b)| a.counts == b.counts);
    verdict.check("all_still", is_still, is_still);
    let most = second.iter().zip(at).map(|(reading, at)| reading.counts.abs_diff(at)).max().unwrap_or(u32::MAX);
    let way_mm = f64::from(most) / PER_M * 1e3;
    verdict.check("way_after_kill_mm", way_mm < 0.5, format!("{way_mm:.3}"));
    Ok(())
}
