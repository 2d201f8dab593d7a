//! Moves one actuator step by step, each at a key press.

use super::motion::{LONGEST_MM, Motion, TICK};
use super::{alone, described, live};
use crate::cli::Common;
use crate::{print, signals};
use anyhow::ensure;
use krait_drives::open_drive;
use krait_slave::Drive;
use std::io::BufRead;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};

/// A step is over when the goal is there and the encoder has had so many ticks to follow.
const SETTLE_TICKS: u32 = 300;

/// Takes lines from standard input until its end or Ctrl-C; each is one step.
pub(super) fn run(common: &Common, actuator: usize, step_mm: f64) -> anyhow::Result<ExitCode> {
    ensure!(
        step_mm > 0.0 && step_mm <= LONGEST_MM,
        "--step-mm {step_mm}: expected more than 0 and at most {LONGEST_MM}; make several steps"
    );
    let stop = signals::stop_flag()?;
    let _bus = alone(common, &stop)?;
    let config = described(common)?;
    live(&config, "single steps")?;
    let n = config.drive.actuator.len();
    ensure!((1..=n).contains(&actuator), "--jog {actuator}: expected 1 to {n}, the actuators of [slave.drive]");
    let drive = open_drive(&config, None)?;
    drive.traits().check(&config)?;
    let mut motion = Motion::begin(drive, &config)?;
    print::out(&format!(
        "Actuator {actuator} is under power. Enter: one step of {step_mm} mm; - and Enter: back; Ctrl-D ends. What is pressed during a step does nothing.\n"
    ))?;
    let moved = serve(&mut motion, &lines(), actuator, step_mm * 1e-3, &stop);
    motion.end_after(moved)?;
    Ok(ExitCode::SUCCESS)
}

/// Lines of standard input, from a thread, because the drives must be ticked meanwhile.
fn lines() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().split(b'\n').map_while(Result::ok) {
            if sender.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                break;
            }
        }
    });
    receiver
}

fn serve(
    motion: &mut Motion,
    lines: &Receiver<String>,
    actuator: usize,
    step_m: f64,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    while !stop.load(Ordering::Relaxed) {
        match lines.recv_timeout(TICK) {
            Ok(line) => {
                if motion.take_hold_again()? {
                    forget_pressed(lines);
                    print::out(
                        "the drives had stopped, because this program stood still; they are engaged anew, and the next key is a step\n",
                    )?;
                    continue;
                }
                let way_m = match line.trim() {
                    "" => step_m,
                    "-" => -step_m,
                    other => {
                        print::out(&format!("{other:?} moves nothing; Enter is a step, - and Enter a step back\n"))?;
                        continue;
                    }
                };
                let step = motion.step(actuator - 1, way_m, SETTLE_TICKS)?;
                if let Some(why) = step.refused {
                    print::out(&format!("the step was not made as asked: {why}\n"))?;
                }
                let [told, read] =
                    [step.state.setpoint_q_m, step.state.measured_q_m].map(|q_m| shown_mm(q_m[actuator - 1]));
                // A key that is held repeats faster than steps are made: the motion would go on long after it was let go.
                forget_pressed(lines);
                print::out(&format!("told {told:.3} mm, reads {read:.3} mm from zero (push positive)\n"))?;
            }
            Err(RecvTimeoutError::Timeout) => drop(motion.keep()?),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
    Ok(())
}

/// What was pressed meanwhile was not pressed for what comes now.
fn forget_pressed(lines: &Receiver<String>) {
    while lines.try_recv().is_ok() {}
}

/// To a thousandth of a millimetre, and never "-0.000".
fn shown_mm(q_m: f64) -> f64 {
    (q_m * 1e6).round() * 1e-3 + 0.0
}
