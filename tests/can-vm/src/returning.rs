//! The interface goes down under a chain that moves, and comes up again: the drives stop by themselves, nothing resumes, and only
//! `clear-fault` opens it anew.

use crate::monitor::Monitor;
use crate::program::{CONFIG, ZERO, configure, done, krait, until};
use crate::refusals::set;
use crate::verdict::PartVerdict;
use crate::world::{DriveMake, Drives, kill};
use core::time::Duration;
use krait_drives::cia402::{State, state};
use rustix::process::Signal;
use std::process::Stdio;

/// How often a state is asked for until it is there.
const ASKS: usize = 40;
/// So far drives may be from where they stood, counts of 0.1 um: power comes where they stand, to a count.
const STILL_COUNTS: u32 = 2;

/// What `krait state` says once that begins with a state, or last.
fn state_until(name: &str) -> anyhow::Result<String> {
    let mut said = String::new();
    for _ in 0..ASKS {
        said = done(&["state"])?;
        if said.starts_with(name) {
            break;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(said)
}

/// Notes whether a state is there and its text holds some words.
fn check_state(verdict: &mut PartVerdict, part: &'static str, name: &str, words: &str) -> anyhow::Result<()> {
    let said = state_until(name)?;
    let is_met = said.starts_with(name) && said.contains(words);
    verdict.check(part, is_met, if is_met { "yes".to_owned() } else { said.trim().replace([' ', '\n'], "_") });
    Ok(())
}

/// Down, up, `clear-fault`, `enable`.
pub fn all() -> anyhow::Result<PartVerdict> {
    configure()?;
    let _drives = Drives::start(DriveMake::Own)?;
    let mut verdict = PartVerdict::default();
    done(&["drives", "--zero", "--config", CONFIG])?;
    let mut monitor = Monitor::new()?;
    let mut chain = krait(&["run", "--engage", "--no-recording", "--config", CONFIG])
        .stdout(Stdio::null())
        .stderr(std::fs::File::create("/tmp/returning.log")?)
        .spawn()?;
    let is_far = |monitor: &Monitor| {
        state(monitor.status[0]) == State::OperationEnabled && monitor.counts[0].abs_diff(ZERO) > 5_000
    };
    let moves = until(&mut monitor, 30_000, is_far)?;
    verdict.check("chain_moves_the_drives", moves, monitor.counts[0] - ZERO);
    drop(monitor);

    set("down")?;
    check_state(&mut verdict, "down_is_a_fault", "FAULT", "The drives failed")?;
    // It cannot be opened while it is down, and that is said again.
    let asked = krait(&["state", "clear-fault"]).output()?;
    verdict.check("cleared_while_down", asked.status.code() == Some(0), format!("{:?}", asked.status.code()));
    check_state(&mut verdict, "down_is_said_again", "FAULT", "The drives failed")?;

    set("up")?;
    let mut monitor = Monitor::new()?;
    until(&mut monitor, 1000, |_| false)?;
    verdict.check("nothing_resumes_by_itself", monitor.syncs.is_empty(), monitor.syncs.len());
    check_state(&mut verdict, "up_is_still_a_fault", "FAULT", "The drives failed")?;

    done(&["state", "clear-fault"])?;
    check_state(&mut verdict, "cleared", "DISABLED", "")?;
    let is_off = |monitor: &Monitor| monitor.status.iter().all(|own| state(*own) == State::SwitchOnDisabled);
    let without_power = until(&mut monitor, 10_000, is_off)?;
    verdict.check("all_answer_without_power", without_power, format!("{:?}", monitor.status.map(state)));
    let at = monitor.counts;
    verdict.check("moved_before", at[0].abs_diff(ZERO) > 1_000, at[0] - ZERO);

    done(&["state", "enable"])?;
    let is_on = |monitor: &Monitor| monitor.status.iter().all(|own| state(*own) == State::OperationEnabled);
    let has_power = until(&mut monitor, 10_000, is_on)?;
    verdict.check("enabled_again", has_power, format!("{:?}", monitor.status.map(state)));
    check_state(&mut verdict, "enabled_and_homed", "ENABLED, homed", "not engaged")?;
    until(&mut monitor, 500, |_| false)?;
    let most = monitor.counts.iter().zip(at).map(|(now, at)| now.abs_diff(at)).max().unwrap_or(u32::MAX);
    verdict.check("stands_where_it_stood", most <= STILL_COUNTS, most);

    kill(&chain, Signal::INT)?;
    let ended = chain.wait()?;
    verdict.check("chain_ends", ended.code() == Some(0), format!("code_{:?}", ended.code()));
    let said = std::fs::read_to_string("/tmp/returning.log").unwrap_or_default();
    let n = said.matches("the slave is in FAULT: the bus of the drives failed: its CAN interface is down").count();
    verdict.check("down_is_named", n == 2, n);
    if !verdict.passed() {
        crate::tell(&said);
    }
    Ok(verdict)
}
