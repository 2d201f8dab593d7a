//! The real `krait` program on the interface: finds the drives, sets their zero, watches them, makes single steps, runs a chain,
//! loses its slave.

use crate::monitor::Monitor;
use crate::single_steps;
use crate::stops::judge_left_alone;
use crate::verdict::PartVerdict;
use crate::world::{DriveMake, Drives, INTERFACE, kill};
use anyhow::{Context, ensure};
use core::time::Duration;
use krait_drives::cia402::{State, state};
use krait_ipc::clock::monotonic_ns;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::process::{Child, Command, ExitStatus, Output, Stdio};

pub const CONFIG: &str = "/tmp/can.toml";
pub const TURNED: &str = "/tmp/turned.toml";
/// What a krait beside the chain says.
const OTHER: &str = "/tmp/other.log";
const RECORDING: &str = "/tmp/program.mcap";
pub const ZERO: i32 = 1_000_000;
/// Largest step of a target in a cycle of 2 ms at the configured 20 mm/s, counts, and one for what arrives late by a tick.
const MOST_COUNTS: i32 = 600;
/// Step of a target in a cycle from which on the drives count as in motion, counts: 1 mm/s.
const MOVING_COUNTS: i32 = 20;
/// What was on its way when the slave was killed has arrived by then, ns.
const LATE_NS: i64 = 5_000_000;

/// A program of time sharing, as a user starts it.
pub fn krait(arguments: &[&str]) -> Command {
    let mut command = Command::new("/bin/chrt");
    command.args(["-o", "0", "/bin/krait"]).args(arguments).stdin(Stdio::null());
    command
}

pub fn done(arguments: &[&str]) -> anyhow::Result<String> {
    let Output { status, stdout, stderr } = krait(arguments).output().context("krait")?;
    let (stdout, stderr) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    ensure!(status.success(), "krait {}: {stdout} {stderr}", arguments.join(" "));
    Ok(stdout.into_owned())
}

/// Three drives whose encoders forget, with room for a virtual machine's hiccups.
pub fn configure() -> anyhow::Result<()> {
    let mut text = format!(
        "[slave.limits]\nrate_m_per_s = 0.02\nfollowing_error_m = 0.002\npull_n = inf\npush_n = inf\n[slave.drive]\nkind = \"cia402\"\n\
         interface = \"{INTERFACE}\"\nperiod_ms = 2.0\ntimeout_ms = 1.8\nspeed_counts_per_s = 600000.0\n"
    );
    for id in 1..=3 {
        text += &format!(
            "[[slave.drive.actuator]]\nid = {id}\nvendor = 0x555\nproduct = 1\nzero_count = {ZERO}\nlead_m = 0.002\ncounts_per_turn = 20000\n"
        );
    }
    std::fs::write(CONFIG, text).context(CONFIG)
}

/// Waits for something on the bus.
pub fn until(monitor: &mut Monitor, ms: u32, is_met: impl Fn(&Monitor) -> bool) -> anyhow::Result<bool> {
    for _ in 0..ms {
        std::thread::sleep(Duration::from_millis(1));
        monitor.drain()?;
        if is_met(monitor) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The slave's process of a chain.
fn slave() -> anyhow::Result<Pid> {
    for entry in std::fs::read_dir("/proc")?.flatten() {
        let words = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
        let is_slave = words.split(|byte| *byte == 0).any(|word| word == b"slave") && words.starts_with(b"/bin/krait");
        if let (true, Ok(number)) = (is_slave, entry.file_name().to_string_lossy().parse()) {
            return Pid::from_raw(number).context("a process's number");
        }
    }
    anyhow::bail!("the chain has no slave")
}

/// The end of a program, with the bus watched meanwhile: what nobody takes is lost, and the newest is what counts.
fn end(program: &mut Child, monitor: &mut Monitor) -> anyhow::Result<ExitStatus> {
    loop {
        std::thread::sleep(Duration::from_millis(1));
        monitor.drain()?;
        if let Some(ended) = program.try_wait()? {
            return Ok(ended);
        }
    }
}

/// Who would move the drives beside the chain, from another instance, is refused in one sentence, and the chain goes on.
fn judge_others(verdict: &mut PartVerdict, monitor: &mut Monitor) -> anyhow::Result<()> {
    for (name, words) in [
        ("jog_beside_the_chain", &["--jog", "1"][..]),
        ("zero_beside_the_chain", &["--zero"]),
        ("calibrate_beside_the_chain", &["--calibrate"]),
    ] {
        (monitor.n_strange, monitor.n_unpowered) = (0, 0);
        monitor.syncs.clear();
        monitor.emergencies.clear();
        // Of the idle class: this machine has one processor, and a real one has another for it.
        let mut other = Command::new("/bin/chrt")
            .args(["-i", "0", "/bin/krait", "drives", "--config", CONFIG, "--instance", "other"])
            .args(words)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(OTHER)?)
            .spawn()
            .context("another krait")?;
        let ended = end(&mut other, monitor)?;
        let said = std::fs::read_to_string(OTHER).context(OTHER)?;
        let is_refused = ended.code() == Some(2) && said.lines().count() == 1;
        let is_named = said.contains(&format!("the CAN interface {INTERFACE} is in use by another program"));
        let (before, n_syncs) = (monitor.counts, monitor.syncs.len());
        let goes_on = until(monitor, 1000, |monitor| {
            monitor.counts[0].abs_diff(before[0]) > 1_000 && monitor.syncs.len() > n_syncs + 50
        })?;
        // What only somebody else would have sent, and drives that lost their power or cried.
        let disturbed = (monitor.n_strange, monitor.n_unpowered, monitor.emergencies.len());
        let is_met = is_refused && is_named && goes_on && disturbed == (0, 0, 0);
        let figure = format!("{:?},{}_syncs,{disturbed:?}", ended.code(), monitor.syncs.len());
        verdict.check(name, is_met, if is_named { figure } else { format!("{figure},{said:?}") }.replace(' ', "_"));
    }
    Ok(())
}

/// The slave is killed in motion. The supervisor is stopped first, so that no second slave touches the bus before the drives have been
/// judged; then it goes on, and nothing moves by itself.
fn judge_killed(verdict: &mut PartVerdict, monitor: &mut Monitor, chain: &Child) -> anyhow::Result<()> {
    let slave = slave()?;
    kill(chain, Signal::STOP)?;
    let newest_step = |monitor: &Monitor| monitor.steps_since(0).last().map_or(0, |step| step.abs());
    let is_moving = until(monitor, 5000, |monitor| newest_step(monitor) >= MOVING_COUNTS)?;
    verdict.check("killed_in_motion_counts", is_moving, newest_step(monitor));
    kill_process(slave, Signal::KILL)?;
    let killed_ns = monotonic_ns();
    monitor.drain()?;
    let at = monitor.counts;
    let judged = judge_left_alone(verdict, monitor, killed_ns, at).and_then(|()| monitor.drain());
    kill(chain, Signal::CONT)?;
    judged?;
    let n_later = monitor.syncs.iter().filter(|(heard_ns, _)| *heard_ns > killed_ns + LATE_NS).count();
    verdict.check("nobody_speaks", n_later == 0, n_later);
    // A new slave holds them where they are; the operator would have to engage again.
    until(monitor, 3000, |_| false)?;
    monitor.syncs.clear();
    let at = monitor.counts;
    until(monitor, 1000, |_| false)?;
    let is_still = monitor.counts == at;
    verdict.check("new_slave_and_nothing_moves_again", is_still, format!("{:?}", state(monitor.status[0])));
    Ok(())
}

/// The slave of the recording is run again on drives that answer what they answered then.
fn judge_again(verdict: &mut PartVerdict) -> anyhow::Result<()> {
    let Output { stdout, stderr, .. } =
        krait(&["replay", RECORDING, "--slave", "recorded", "--json"]).output().context("krait")?;
    let said: Value = serde_json::from_slice(&stdout).with_context(|| String::from_utf8_lossy(&stderr).into_owned())?;
    let number = |key: &str| said[key].as_u64().with_context(|| format!("no {key}: {said}"));
    let n_cycles = number("cycles")?;
    verdict.check("recorded_cycles", n_cycles > 500, n_cycles);
    let n_missing = number("cycles_missing")?;
    verdict.check("cycles_missing", n_missing == 0, n_missing);
    // An instant that no state tells, or an answer at the very moment of a look, may come out otherwise for a cycle.
    let few = 2 + n_cycles / 100;
    for key in ["wishes_differ", "goals_differ", "judged_otherwise"] {
        let n = number(key)?;
        verdict.check(key, n <= few, n);
    }
    std::fs::remove_file(RECORDING).context(RECORDING)
}

/// All that a user does with it.
pub fn all() -> anyhow::Result<PartVerdict> {
    configure()?;
    let _drives = Drives::start(DriveMake::Own)?;
    let mut verdict = PartVerdict::default();
    let found = done(&["drives", "--interface", INTERFACE, "--last-id", "5", "--json"])?;
    let n = found.matches("\"is_known\"").count();
    verdict.check("found", n == 3 && found.contains("switch on disabled"), n);
    let zero = done(&["drives", "--zero", "--config", CONFIG])?;
    let found = done(&["drives", "--config", CONFIG, "--last-id", "5", "--json"])?;
    let n = found.matches(&format!("{ZERO},")).count();
    verdict.check("zeroed", zero.contains("read their zero_count") && n == 3, n);
    single_steps::judge(&mut verdict)?;

    let mut monitor = Monitor::new()?;
    let mut chain = krait(&["run", "--engage", "--recording", RECORDING, "--config", CONFIG])
        .stdout(Stdio::null())
        .stderr(std::fs::File::create("/tmp/chain.log")?)
        .spawn()?;
    let is_far = |monitor: &Monitor| {
        state(monitor.status[0]) == State::OperationEnabled && monitor.counts[0].abs_diff(ZERO) > 5_000
    };
    let moves = until(&mut monitor, 30_000, is_far)?;
    verdict.check("chain_moves_the_drives", moves, monitor.counts[0] - ZERO);
    monitor.syncs.clear();
    until(&mut monitor, 1000, |_| false)?;
    let most = monitor.steps_since(0).iter().map(|step| step.abs()).max().unwrap_or(0);
    verdict.check("largest_step_counts", most > 0 && most <= MOST_COUNTS, most);

    judge_others(&mut verdict, &mut monitor)?;
    judge_killed(&mut verdict, &mut monitor, &chain)?;
    kill(&chain, Signal::INT)?;
    let ended = end(&mut chain, &mut monitor)?;
    let said = std::fs::read_to_string("/tmp/chain.log").unwrap_or_default();
    // Its slave was killed: it ran, and a process was lost on the way.
    verdict.check("chain_ends", ended.code() == Some(1), format!("code_{:?}", ended.code()));
    let status = done(&["drives", "--config", CONFIG, "--last-id", "5", "--json"])?;
    let n_off = status.matches("switch on disabled").count();
    judge_again(&mut verdict)?;
    verdict.check("off_at_the_end", n_off == 3 && state(monitor.status[0]) != State::OperationEnabled, n_off);
    if !verdict.passed() {
        crate::tell(&said);
    }
    Ok(verdict)
}

/// Emulated drives of one program bend a simulated snake and feel it, so that `--calibrate` finds their directions.
pub fn calibrate() -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    let mut monitor = Monitor::new()?;
    let mut emulated = krait(&["drives", "--emulate", "3", "--interface", INTERFACE])
        .stdout(std::fs::File::create(CONFIG)?)
        .spawn()
        .context("emulated drives")?;
    let has_begun = until(&mut monitor, 10_000, |monitor| monitor.n_boots.iter().all(|n| *n > 0))?;
    verdict.check("emulated", has_begun, has_begun);
    done(&["drives", "--zero", "--config", CONFIG])?;
    let found = done(&["drives", "--calibrate", "--config", CONFIG])?;
    let n_right = found.matches(" right").count();
    verdict.check("directions_right", n_right == 3, n_right);
    let turned = std::fs::read_to_string(CONFIG)?.replacen("id = 2\n", "id = 2\nsign = -1\n", 1);
    std::fs::write(TURNED, turned).context(TURNED)?;
    let found = krait(&["drives", "--calibrate", "--config", TURNED]).output().context("krait")?;
    let found = String::from_utf8_lossy(&found.stdout).into_owned();
    let (n_right, n_reversed) = (found.matches(" right").count(), found.matches(" reversed").count());
    verdict.check("one_reversed", (n_right, n_reversed) == (2, 1), format!("{n_right},{n_reversed}"));
    kill(&emulated, Signal::INT)?;
    emulated.wait()?;
    if !verdict.passed() {
        crate::tell(&found);
    }
    Ok(verdict)
}
