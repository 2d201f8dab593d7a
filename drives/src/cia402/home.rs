//! Tells drives that their zero is where they stand: homing by method 37, which moves nothing, under power for a moment.

use super::node::{Node, Order};
use super::open::{interface, setup};
use super::port::CanPort;
use super::scan::set;
use super::states::{homing, is_failed};
use super::steps::{HOME_OFFSET, HOMING_METHOD, METHOD_HERE, MODE, MODE_CSP, MODE_HOMING};
use super::wire::Wire;
use super::{Cia402, sdo};
use crate::bus::{ActuatorBus, Seen};
use crate::error::OpenError;
use core::sync::atomic::{AtomicBool, Ordering};
use krait_slave::{DriveMode, SlaveConfig};

/// How long each part may take, ns.
const PATIENCE_NS: i64 = 5_000_000_000;
/// How far what a drive reads afterwards may be from its zero, counts.
const NEAR_COUNTS: u32 = 50;

/// Makes `zero_count` of each drive with an incremental encoder what it reads where it stands now; the power is off again afterwards.
/// Those that keep their count get none, whatever `zero_count` they have. Gives what all read then. Where `stop` is set meanwhile, power goes
/// at once.
///
/// # Errors
/// [`OpenError`]; in a dry run before the bus is touched.
pub fn home_here(config: &SlaveConfig, stop: &AtomicBool) -> Result<Seen, OpenError> {
    may_have_power(config)?;
    let mut config = config.clone();
    zeros(&config)?;
    // A zero of before, or none, must keep nobody from a new one.
    let kept = config.drive.actuator.iter_mut().filter(|actuator| actuator.is_absolute);
    kept.for_each(|actuator| actuator.zero_count = Some(0));
    setup(&config)?;
    let (mut bus, mut seen) = Cia402::open(&config, CanPort::open(interface(&config.drive)?)?)?;
    bus.home(&config, &mut seen, stop)?;
    Ok(seen)
}

/// A dry run gives no power, not for a moment either.
fn may_have_power(config: &SlaveConfig) -> Result<(), OpenError> {
    match config.drive.mode {
        DriveMode::Live => Ok(()),
        DriveMode::Dry => Err(OpenError::HomesDry),
    }
}

/// Which drives are told their zero, and that.
fn zeros(config: &SlaveConfig) -> Result<Vec<(usize, i32)>, OpenError> {
    let told = config.drive.actuator.iter().enumerate().filter(|(_, actuator)| !actuator.is_absolute);
    told.map(|(k, own)| Ok((k, own.zero_count.ok_or(OpenError::ZeroNotChosen { actuator: k + 1 })?))).collect()
}

impl<W: Wire> Cia402<W> {
    /// Homes the drives that forget their count where they stand; the others stand by without power.
    pub(crate) fn home(&mut self, config: &SlaveConfig, seen: &mut Seen, stop: &AtomicBool) -> Result<(), OpenError> {
        may_have_power(config)?;
        let zeros = zeros(config)?;
        for (k, zero) in &zeros {
            self.set(*k, HOMING_METHOD, METHOD_HERE, 1)?;
            self.set(*k, HOME_OFFSET, zero.cast_unsigned(), 4)?;
            self.set(*k, MODE, MODE_HOMING, 1)?;
        }
        let stand_by = |bus: &mut Self, is_so: bool| {
            let nodes = bus.nodes.iter_mut().zip(&config.drive.actuator);
            nodes.for_each(|(node, actuator)| node.stands_by = is_so && actuator.is_absolute);
        };
        stand_by(self, true);
        let homed = self.home_all(config, seen, stop);
        // Whatever became of it, nobody stays under power.
        let off = self.until(config, seen, Order::Off, None, |_, has_power| !has_power);
        stand_by(self, false);
        for (k, _) in &zeros {
            self.set(*k, MODE, MODE_CSP, 1)?;
        }
        homed.and(off)?;
        for (k, zero) in zeros {
            let found = seen.counts[k];
            if found.abs_diff(zero) > NEAR_COUNTS {
                return Err(OpenError::OtherZero { actuator: k + 1, id: self.nodes[k].id, found, expected: zero });
            }
        }
        Ok(())
    }

    fn home_all(&mut self, config: &SlaveConfig, seen: &mut Seen, stop: &AtomicBool) -> Result<(), OpenError> {
        self.until(config, seen, Order::Switch, Some(stop), |_, has_power| has_power)?;
        self.until(config, seen, Order::Home, Some(stop), |status, _| homing(status) == Some(true))
    }

    /// Cycles of one order until something holds of each drive's status word and of whether it has power, or a stop is asked for.
    fn until(
        &mut self,
        config: &SlaveConfig,
        seen: &mut Seen,
        order: Order,
        stop: Option<&AtomicBool>,
        is_done: impl Fn(u16, bool) -> bool,
    ) -> Result<(), OpenError> {
        let end_ns = self.wire.now_ns() + PATIENCE_NS;
        loop {
            if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                return Err(OpenError::HomingEnded);
            }
            let now_ns = self.wire.now_ns();
            let mut goals = self.goals;
            goals.counts = seen.counts;
            match order {
                Order::Switch => self.switch(true, &goals)?,
                Order::Off => self.switch(false, &goals)?,
                Order::Ask | Order::Follow | Order::Home => (self.order, self.goals) = (order, goals),
            }
            self.ask(seen)?;
            let mut all = self.nodes.iter().zip(&seen.is_powered);
            let is_late = |node: &Node, has_power| !node.stands_by && !is_done(node.status, has_power);
            let Some(late) = all.position(|(node, has_power)| is_late(node, *has_power)) else { return Ok(()) };
            let has_failed = |node: &Node| homing(node.status) == Some(false) || is_failed(node.status);
            let failed = self.nodes.iter().position(|node| order == Order::Home && !node.stands_by && has_failed(node));
            if failed.is_some() || now_ns > end_ns {
                let actuator = failed.unwrap_or(late);
                let (id, status) = (self.nodes[actuator].id, self.nodes[actuator].status);
                return Err(OpenError::NotHomed { actuator: actuator + 1, id, status });
            }
            self.pass(now_ns + (config.drive.period_ms * 1e6) as i64)?;
        }
    }

    fn set(&mut self, k: usize, place: sdo::Place, value: u32, n_bytes: u8) -> Result<(), OpenError> {
        let id = self.nodes[k].id;
        self.beat_if_due(self.wire.now_ns())?;
        match set(&mut self.wire, id, place, value, n_bytes)? {
            Some(sdo::Reply::Written | sdo::Reply::Value(_)) => Ok(()),
            None => Err(OpenError::NoAnswer { actuator: k + 1, id }),
            Some(sdo::Reply::Aborted(code)) => Err(OpenError::Object {
                actuator: k + 1,
                id,
                index: place.0,
                sub: place.1,
                code,
                meaning: sdo::meaning(code),
                advice: "it cannot be homed where it stands; use its maker's tool",
            }),
        }
    }
}
