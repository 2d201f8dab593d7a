//! Moves one actuator step by step, through the slave's own limiter, gate and watchdog, in an instance without a chain.

use super::{alone, described};
use crate::cli::Common;
use crate::{print, signals};
use anyhow::{Context, bail, ensure};
use core::time::Duration;
use krait_drives::{BusDrive, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Actuators, Command, MAX_ACTUATORS, OperatingState, Phase, SlaveState, Transition};
use krait_ipc::{Reason, Reasons};
use krait_slave::{Drive, SlaveCore};
use std::io::BufRead;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};

/// Longest step, mm.
const LONGEST_MM: f64 = 0.1;
/// Speed of a step, m/s; less where the limiter allows less.
const SPEED_M_PER_S: f64 = 2e-3;
const TICK: Duration = Duration::from_millis(1);
const TICK_S: f64 = 1e-3;
/// A step is over when the goal is there and the encoder has had so many ticks to follow.
const SETTLE_TICKS: u32 = 300;
/// Power and zero take less.
const PATIENCE_TICKS: u32 = 10_000;

/// Takes lines from standard input until its end or Ctrl-C; each is one step.
pub(super) fn run(common: &Common, actuator: usize, step_mm: f64) -> anyhow::Result<ExitCode> {
    ensure!(
        step_mm > 0.0 && step_mm <= LONGEST_MM,
        "--step-mm {step_mm}: expected more than 0 and at most {LONGEST_MM}; make several steps"
    );
    let stop = signals::stop_flag()?;
    let _bus = alone(common, &stop)?;
    let config = described(common)?;
    let n = config.drive.actuator.len();
    ensure!((1..=n).contains(&actuator), "--jog {actuator}: expected 1 to {n}, the actuators of [slave.drive]");
    let drive = open_drive(&config, None)?;
    drive.traits().check(&config.limits)?;
    let rate_m_per_s = SPEED_M_PER_S.min(0.5 * config.limits.rate_m_per_s);
    let mut jog =
        Jog { core: SlaveCore::new(drive, &config), sequence: 0, goal_m: [0.0; MAX_ACTUATORS], n, rate_m_per_s };
    jog.begin()?;
    print::out(&format!(
        "Actuator {actuator} is under power. Enter: one step of {step_mm} mm; - and Enter: back; Ctrl-D ends.\n"
    ))?;
    let lines = lines();
    let moved = jog.serve(&lines, actuator, step_mm * 1e-3, &stop);
    let ended = jog.end();
    moved.and(ended)?;
    Ok(ExitCode::SUCCESS)
}

/// Lines of standard input, from a thread, because the drives must be ticked meanwhile.
fn lines() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    receiver
}

struct Jog {
    core: SlaveCore<BusDrive>,
    sequence: u64,
    goal_m: Actuators,
    n: usize,
    rate_m_per_s: f64,
}

impl Jog {
    /// Power, zero, and the operator at the setpoint.
    fn begin(&mut self) -> anyhow::Result<()> {
        self.core.transition(Transition::Enable, monotonic_ns())?;
        let mut has_homed = false;
        for _ in 0..PATIENCE_TICKS {
            let state = self.tick()?;
            if self.core.is_busy() {
                continue;
            }
            if state.is_ready() {
                self.goal_m = state.setpoint_q_m;
                // The operator lets go, then takes hold.
                for reasons in [Reasons::NONE.with(Reason::OperatorAbsent), Reasons::NONE] {
                    self.command(Phase::Holding, reasons)?;
                }
                return Ok(());
            }
            if !core::mem::replace(&mut has_homed, true) {
                self.core.transition(Transition::Home, monotonic_ns())?;
            }
        }
        bail!("the drives were not ready after 10 s")
    }

    fn serve(
        &mut self,
        lines: &Receiver<String>,
        actuator: usize,
        step_m: f64,
        stop: &AtomicBool,
    ) -> anyhow::Result<()> {
        while !stop.load(Ordering::Relaxed) {
            match lines.recv_timeout(TICK) {
                Ok(line) => {
                    let way_m = if line.trim() == "-" { -step_m } else { step_m };
                    let state = self.step(actuator - 1, way_m)?;
                    let (told, read) = (state.setpoint_q_m[actuator - 1] * 1e3, state.measured_q_m[actuator - 1] * 1e3);
                    print::out(&format!("told {told:.3} mm, reads {read:.3} mm from zero (push positive)\n"))?;
                }
                Err(RecvTimeoutError::Timeout) => drop(self.command(Phase::Following, Reasons::NONE)?),
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
        }
        Ok(())
    }

    /// One step, at its own speed, until the encoder has had time to follow.
    fn step(&mut self, k: usize, way_m: f64) -> anyhow::Result<SlaveState> {
        let end_m = self.goal_m[k] + way_m;
        let n_ticks = (way_m.abs() / (self.rate_m_per_s * TICK_S)).ceil().max(1.0);
        for _ in 0..n_ticks as u32 {
            self.goal_m[k] += way_m / n_ticks;
            self.command(Phase::Following, Reasons::NONE)?;
            std::thread::sleep(TICK);
        }
        self.goal_m[k] = end_m;
        let mut state = self.command(Phase::Following, Reasons::NONE)?;
        for _ in 0..SETTLE_TICKS {
            std::thread::sleep(TICK);
            state = self.command(Phase::Following, Reasons::NONE)?;
        }
        if (state.setpoint_q_m[k] - end_m).abs() > 1e-9 {
            // The limiter has its reasons; the next step begins where it has stopped.
            let reasons: Vec<_> = Reasons::from_bits(state.reasons).iter().map(Reason::sentence).collect();
            self.goal_m = state.setpoint_q_m;
            print::out(&format!("the step was not made as asked: {}\n", reasons.join("; ")))?;
        }
        Ok(state)
    }

    fn tick(&mut self) -> anyhow::Result<SlaveState> {
        std::thread::sleep(TICK);
        let now_ns = monotonic_ns();
        self.core.on_tick(now_ns);
        self.look(now_ns)
    }

    fn command(&mut self, phase: Phase, reasons: Reasons) -> anyhow::Result<SlaveState> {
        self.sequence += 1;
        let now_ns = monotonic_ns();
        let command = Command {
            sequence: self.sequence,
            sample_ns: now_ns,
            setpoint_sequence: self.sequence,
            input_sequence: self.sequence,
            q_tilde_m: self.goal_m,
            q_uncompensated_m: self.goal_m,
            n_actuators: self.n as u32,
            phase: phase as u32,
            reasons: reasons.bits(),
            ..Command::default()
        };
        self.core.on_command(&command, now_ns);
        self.core.on_tick(now_ns);
        self.look(now_ns)
    }

    /// Reads the drives; a fault ends it.
    fn look(&mut self, now_ns: i64) -> anyhow::Result<SlaveState> {
        let state = self.core.report(now_ns);
        if state.operating() == Some(OperatingState::Fault) {
            let error = self.core.drive_error().context("the drives are in FAULT")?;
            return Err(error.into());
        }
        Ok(state)
    }

    /// Comes to rest and takes the power away.
    fn end(&mut self) -> anyhow::Result<()> {
        self.core.hold();
        for _ in 0..PATIENCE_TICKS {
            if self.core.is_still() {
                break;
            }
            std::thread::sleep(TICK);
            self.core.on_tick(monotonic_ns());
        }
        self.core.transition(Transition::Disable, monotonic_ns())?;
        Ok(())
    }
}
