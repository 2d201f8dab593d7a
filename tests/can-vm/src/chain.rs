//! A slave in small: wishes every millisecond through krait's bus drive, with the bus watched beside it.

use crate::monitor::Monitor;
use crate::world::config;
use anyhow::{Context, bail};
use core::time::Duration;
use krait_drives::{BusDrive, cia402};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{Drive, DriveError, Switching, lines};

/// Speed of the motion, m/s.
pub const SPEED_M_PER_S: f64 = 0.01;
const TICK_NS: i64 = 1_000_000;

/// The drive and its watch.
pub struct RigChain {
    pub drive: BusDrive,
    pub monitor: Monitor,
    q_m: f64,
    due_ns: i64,
}

impl RigChain {
    /// Opens the drives with a bus period, ms, and gives them power.
    pub fn powered(period_ms: f64) -> anyhow::Result<Self> {
        let drive = cia402::open_drive(&config(period_ms), None)?;
        let mut chain = Self { drive, monitor: Monitor::new()?, q_m: 0.0, due_ns: monotonic_ns() };
        chain.power_up()?;
        Ok(chain)
    }

    /// Switches power on anew; ticks that took.
    pub fn power_up(&mut self) -> anyhow::Result<usize> {
        for n in 1..3000 {
            self.wait()?;
            if self.drive.set_power(monotonic_ns(), true)? == Switching::Done {
                self.q_m = self.drive.read(monotonic_ns())?.q_tilde_m[0];
                return Ok(n);
            }
        }
        bail!("no power after 3 s")
    }

    /// Waits for the next tick, and takes what was on the bus.
    pub fn wait(&mut self) -> anyhow::Result<()> {
        self.due_ns = (self.due_ns + TICK_NS).max(monotonic_ns() - TICK_NS);
        let left_ns = self.due_ns - monotonic_ns();
        if left_ns > 0 {
            std::thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
        }
        self.monitor.drain()
    }

    /// So many ticks of motion in a plane; once something has failed the wishes go on and are refused.
    pub fn go(&mut self, n: usize) -> anyhow::Result<()> {
        for _ in 0..n {
            self.wait()?;
            self.q_m += SPEED_M_PER_S * 1e-3;
            let wish = lines([self.q_m, -0.5 * self.q_m, -0.5 * self.q_m]);
            let written = self.drive.write(monotonic_ns(), wish);
            self.drive.read(monotonic_ns())?;
            if let Err(error) = written
                && self.drive.failure().is_none()
            {
                return Err(error.into());
            }
        }
        Ok(())
    }

    /// So many ticks without a wish.
    pub fn rest(&mut self, n: usize) -> anyhow::Result<()> {
        for _ in 0..n {
            self.wait()?;
            self.drive.read(monotonic_ns())?;
        }
        Ok(())
    }

    /// Goes on until something has failed.
    pub fn until_failure(&mut self, most: usize) -> anyhow::Result<DriveError> {
        for _ in 0..most {
            if let Some(failure) = self.drive.failure() {
                return Ok(failure);
            }
            self.go(1)?;
        }
        self.drive.failure().context("nothing has failed")
    }
}

/// Drives the drives to and fro until it is killed.
pub fn be_master(period_ms: f64) -> anyhow::Result<bool> {
    let mut chain = RigChain::powered(period_ms)?;
    chain.go(450)?;
    bail!("nobody has killed it")
}
