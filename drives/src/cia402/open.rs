//! Finds the drives of a configuration, checks who they are and configures them; nothing moves, nobody gets power.

use super::frame::bits;
use super::node::{Node, Order, Refusal};
use super::port::CanPort;
use super::scan::value;
use super::states::is_failed;
use super::steps::{DEVICE_TYPE, ERROR_CODE, ERROR_REGISTER, PRODUCT, VENDOR, steps};
use super::wire::Wire;
use super::{Cia402, emergencies, sdo};
use crate::bus::{ActuatorBus, Goals, Seen};
use crate::error::OpenError;
use crate::{BusDrive, BusSetup, Units};
use krait_ipc::Beside;
use krait_slave::{DriveConfig, SlaveConfig};

/// How long is listened for another master before anything is sent, ns.
pub(crate) const LISTEN_NS: i64 = 60_000_000;
/// How long is received at once while drives are configured, ns.
const GLANCE_NS: i64 = 2_000_000;
/// Answers that nobody asked for until two drives seem to have one number; one may be late by itself.
const STRAYS: u32 = 3;
/// Cycles in which all must answer once.
const CYCLES: u32 = 25;

/// Drives on the interface of a configuration as the slave's drive; nothing moves yet. `beside`: as for [`BusDrive::start`].
///
/// # Errors
/// [`OpenError`].
pub fn open_drive(config: &SlaveConfig, beside: Option<Beside>) -> Result<BusDrive, OpenError> {
    // What is wrong with the configuration is said before the bus is touched.
    setup(config)?;
    open_drive_on(CanPort::open(interface(&config.drive)?)?, config, beside)
}

/// The same on any wire.
///
/// # Errors
/// [`OpenError`].
pub fn open_drive_on<W: Wire>(wire: W, config: &SlaveConfig, beside: Option<Beside>) -> Result<BusDrive, OpenError> {
    let mut setup = setup(config)?;
    let (bus, seen) = Cia402::open(config, wire)?;
    for (units, node) in setup.units.iter_mut().zip(&bus.nodes) {
        if node.rated_torque_nm == 0.0 {
            units.newton_per_newton_metre = f64::NAN;
        }
    }
    BusDrive::start(bus, setup, seen, beside).map_err(OpenError::Thread)
}

pub(crate) fn interface(drive: &DriveConfig) -> Result<&str, OpenError> {
    drive.interface.as_deref().ok_or(OpenError::NoBus)
}

/// Units, period and limits of a configuration.
pub(crate) fn setup(config: &SlaveConfig) -> Result<BusSetup, OpenError> {
    let drive = &config.drive;
    let mut units = Vec::new();
    for (k, actuator) in drive.actuator.iter().enumerate() {
        units.push(Units::endless(actuator, k + 1)?);
    }
    // No motor does in a cycle more than twice what it can in all that may be missing.
    let missing_s = f64::from(drive.lost_cycles) * drive.period_ms * 1e-3;
    let leap_counts = (2.0 * drive.speed_counts_per_s * missing_s).max(64.0) as i32;
    BusSetup::new(config, units, leap_counts, exchange_ns(drive))
}

/// A cycle on the wire: target and answer of each drive, SYNC and a heartbeat, at the worst bit stuffing.
fn exchange_ns(drive: &DriveConfig) -> i64 {
    let n = drive.actuator.len() as i64;
    (n * (bits(6) + bits(8)) + bits(0) + bits(1)) * 1_000_000_000 / i64::from(drive.baud)
}

impl<W: Wire> Cia402<W> {
    /// Opens the drives of a checked configuration on a wire.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(config: &SlaveConfig, wire: W) -> Result<(Self, Seen), OpenError> {
        let mut bus = Self::on(config, wire)?;
        bus.listen()?;
        bus.configure()?;
        bus.check(&config.drive)?;
        let mut seen = Seen::default();
        for _ in 0..CYCLES {
            let due_ns = bus.wire.now_ns() + (config.drive.period_ms * 1e6) as i64;
            bus.ask(&mut seen)?;
            if seen.has_answered.iter().take(bus.nodes.len()).all(|answered| *answered) {
                bus.name_failed()?;
                return Ok((bus, seen));
            }
            bus.pass(due_ns)?;
        }
        let silent = seen.has_answered.iter().position(|answered| !answered).unwrap_or(0);
        Err(OpenError::NoCycle { actuator: silent + 1, id: bus.nodes[silent].id })
    }

    /// Names who had failed before: the first enable resets that, and then nobody could tell why.
    fn name_failed(&mut self) -> Result<(), OpenError> {
        for k in 0..self.nodes.len() {
            if !is_failed(self.nodes[k].status) {
                continue;
            }
            let id = self.nodes[k].id;
            let [code, register] = [self.value(id, ERROR_CODE)?, self.value(id, ERROR_REGISTER)?];
            tracing::warn!("{}", emergencies::found_failed(k + 1, id, code, register));
        }
        Ok(())
    }

    /// An object's value; none: the drive lacks it, or does not answer.
    fn value(&mut self, id: u8, place: sdo::Place) -> Result<Option<u32>, OpenError> {
        self.beat_if_due(self.wire.now_ns())?;
        value(&mut self.wire, id, place)
    }

    fn on(config: &SlaveConfig, wire: W) -> Result<Self, OpenError> {
        let drive = &config.drive;
        let (rates_m_per_s, mut nodes) = (config.rates_m_per_s(), Vec::new());
        for (k, actuator) in drive.actuator.iter().enumerate() {
            let units = Units::endless(actuator, k + 1)?;
            nodes.push(Node::new(
                actuator.id as u8,
                steps(config, actuator, &units, rates_m_per_s[k])?,
                actuator.rated_torque_nm,
            ));
        }
        Ok(Self {
            cycled_ns: wire.now_ns(),
            wire,
            nodes,
            goals: Goals::default(),
            order: Order::Ask,
            told: Order::Ask,
            n_tried: 0,
            timeout_ns: (drive.timeout_ms * 1e6) as i64,
            lost_cycles: drive.lost_cycles,
            heartbeat_ns: i64::from(drive.heartbeat_ms) * 1_000_000,
            beat_due_ns: i64::MIN,
            gives_up_ns: i64::from(drive.gives_up_ms) * 1_000_000,
            other_master: None,
            is_wire_gone: false,
        })
    }

    /// Receives until an instant.
    pub(crate) fn pass(&mut self, until_ns: i64) -> Result<(), OpenError> {
        while let Some(frame) = self.wire.receive(until_ns)? {
            self.take(&frame);
            if self.wire.now_ns() >= until_ns {
                break;
            }
        }
        self.other_master.map_or(Ok(()), |what| Err(OpenError::SecondMaster { what }))
    }

    /// Nobody else may be master here.
    fn listen(&mut self) -> Result<(), OpenError> {
        self.pass(self.wire.now_ns() + LISTEN_NS)
    }

    /// Goes through the steps of all drives at once.
    fn configure(&mut self) -> Result<(), OpenError> {
        loop {
            let now_ns = self.wire.now_ns();
            // Who stops by itself without this program must hear of it from the moment that it listens.
            self.beat_if_due(now_ns)?;
            for node in &mut self.nodes {
                if let Some(frame) = node.advance(now_ns) {
                    self.wire.send(&frame)?;
                }
            }
            if self.nodes.iter().all(|node| node.is_configured() || node.refusal.is_some()) {
                return self.pass(now_ns + 5 * GLANCE_NS);
            }
            if let Some(frame) = self.wire.receive(now_ns + GLANCE_NS)? {
                self.take(&frame);
                self.drain()?;
            }
            self.pass(i64::MIN)?;
        }
    }

    /// Whether all drives are those of the configuration and do what they must.
    fn check(&self, drive: &DriveConfig) -> Result<(), OpenError> {
        let is_silent = |node: &Node| node.refusal == Some(Refusal::Silent);
        if self.nodes.iter().all(is_silent) {
            let ids: Vec<String> = self.nodes.iter().map(|node| node.id.to_string()).collect();
            return Err(OpenError::NobodyOnCan {
                interface: interface(drive)?.to_owned(),
                expected: format!("{} with the ids {}", ids.len(), ids.join(", ")),
            });
        }
        for (k, node) in self.nodes.iter().enumerate() {
            if node.n_stray >= STRAYS {
                return Err(OpenError::SameId { what: "drive", id: node.id, n: node.n_stray as usize });
            }
            if let Some(refusal) = node.refusal {
                return Err(refused(k + 1, node.id, refusal));
            }
        }
        Ok(())
    }
}

pub(super) fn refused(actuator: usize, id: u8, refusal: Refusal) -> OpenError {
    match refusal {
        Refusal::Silent => OpenError::NoAnswer { actuator, id },
        Refusal::Differs { place: DEVICE_TYPE, found, .. } => OpenError::NoDrive { actuator, id, profile: found },
        Refusal::Differs { place, found, expected } if [VENDOR, PRODUCT].contains(&place) => {
            let what = if place == VENDOR { "vendor" } else { "product" };
            OpenError::OtherDrive { actuator, id, what, found, expected }
        }
        Refusal::Differs { .. } => OpenError::NoCyclicPosition { actuator, id },
        Refusal::TooSlow { most_per_min, least_per_min } => {
            OpenError::TooSlow { actuator, id, most_per_min, least_per_min }
        }
        Refusal::Aborted { place: (index, sub), code } => {
            let advice = if (index, sub) == super::steps::MAX_TORQUE {
                "set torque_limit = 1.0 to do without a limit of torque in the drive"
            } else {
                "it needs this object of CiA 301 and CiA 402; see its manual"
            };
            OpenError::Object { actuator, id, index, sub, code, meaning: sdo::meaning(code), advice }
        }
    }
}
