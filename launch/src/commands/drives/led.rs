//! Single actuators that a calibration leads from place to place: [`Motion`] on a thread of its own, because the drives must be ticked while
//! somebody reads a dial.

use super::motion::{Motion, TICK};
use super::{alone, described, live};
use crate::cli::Common;
use crate::signals;
use anyhow::{Context, bail, ensure};
use krait_drives::open_drive;
use krait_slave::{Drive, SlaveConfig};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;

/// A step is over when the goal is there and the encoder has had so many ticks to follow.
const SETTLE_TICKS: u32 = 300;

/// Where an actuator shall go: which, counted from 0, and where, m from zero.
type Order = (usize, f64);

/// Actuators under power until this is dropped.
pub(in crate::commands) struct LedDrives {
    orders: Option<Sender<Order>>,
    read_m: Receiver<anyhow::Result<f64>>,
    thread: Option<JoinHandle<()>>,
    n: usize,
}

impl LedDrives {
    /// Power and zero, in an instance without a chain; nothing moves but for the search for zero.
    ///
    /// # Errors
    /// One sentence: the configuration describes no drives, a chain or another program has them, or they are not ready.
    pub(in crate::commands) fn start(common: &Common) -> anyhow::Result<Self> {
        let stop = signals::stop_flag()?;
        let config = described(common)?;
        live(&config, "measuring its play")?;
        let n = config.drive.actuator.len();
        let bus = alone(common, &stop)?;
        let (orders, ordered) = channel();
        let (answers, read_m) = mpsc::channel();
        let thread = std::thread::Builder::new().name("led-drives".to_owned()).spawn(move || {
            let _nobody_else = bus;
            let begun = begin(&config);
            let answered = answers.send(begun.as_ref().map(|_| 0.0).map_err(|error| anyhow::anyhow!("{error:#}")));
            if let (Ok(()), Ok(mut motion)) = (answered, begun) {
                serve(&mut motion, &ordered, &answers, &stop);
                if let Err(error) = motion.end() {
                    tracing::error!("the drives did not come to rest: {error:#}");
                }
            }
        });
        let thread = Some(thread.context("a thread for the drives could not be started")?);
        let led = Self { orders: Some(orders), read_m, thread, n };
        led.answer()?;
        Ok(led)
    }

    /// Moves one actuator, counted from 1, straight to a place, m from zero, and says what its encoder reads there.
    ///
    /// # Errors
    /// One sentence: there is no such actuator, the limiter did not let it go there, or the drives failed.
    pub(in crate::commands) fn go(&self, actuator: u32, to_m: f64) -> anyhow::Result<f64> {
        let k = (actuator as usize).wrapping_sub(1);
        ensure!(k < self.n, "actuator {actuator}: expected 1 to {}, the actuators of [slave.drive]", self.n);
        let sent = self.orders.as_ref().is_some_and(|orders| orders.send((k, to_m)).is_ok());
        ensure!(sent, "the drives are not moved any more; start the command again, nothing recorded is lost");
        self.answer()
    }

    fn answer(&self) -> anyhow::Result<f64> {
        self.read_m.recv().context("the drives are not moved any more; start the command again")?
    }
}

impl Drop for LedDrives {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            tracing::error!("the thread that moves the drives died");
        }
    }
}

fn begin(config: &SlaveConfig) -> anyhow::Result<Motion> {
    let drive = open_drive(config, None)?;
    drive.traits().check(config)?;
    Motion::begin(drive, config)
}

/// Until nobody orders any more, or it is stopped.
fn serve(motion: &mut Motion, ordered: &Receiver<Order>, answers: &Sender<anyhow::Result<f64>>, stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        let done = match ordered.recv_timeout(TICK) {
            Ok((k, to_m)) => go(motion, k, to_m),
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => match motion.keep() {
                Ok(_) => continue,
                Err(error) => Err(error),
            },
        };
        let has_failed = done.is_err();
        if answers.send(done).is_err() || has_failed {
            return;
        }
    }
}

fn go(motion: &mut Motion, k: usize, to_m: f64) -> anyhow::Result<f64> {
    // A stall while somebody typed ends the engagement; the answer that was typed asks for the next motion.
    motion.take_hold_again()?;
    let step = motion.step(k, to_m - motion.goal_m(k), SETTLE_TICKS)?;
    if let Some(why) = step.refused {
        bail!("actuator {} did not reach {:.3} mm: {why}", k + 1, to_m * 1e3);
    }
    Ok(step.state.measured_q_m[k])
}
