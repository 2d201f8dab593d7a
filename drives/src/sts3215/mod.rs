//! Feetech STS3215 serial servos: raw registers over one half-duplex wire, goals and readings of all in two packets a cycle.
//!
//! Problem: the wire is one, nobody acknowledges a goal, an answer that comes late looks like the answer to the next question,
//! and a servo that has let go or has lost its power goes on accepting goals.
//!
//! Intuition: one block of registers, read each cycle, holds all that tells: whether the servo is under power, which goal it
//! has understood, where it is, what it complains of. An answer that knows another goal than the newest is an old one or
//! says that the goal was lost; both are a missing answer.
//!
//! Failure: whatever is left of a cycle that failed is received and thrown away before the next question.
//!
//! Source: the maker's memory table of the STS3215 (registers, units) and communication protocol manual.

mod identity;
pub(crate) mod packet;
mod port;
mod scan;

pub use identity::Identity;
pub use port::ports;
pub use scan::{BAUDS, FoundServo, scan};

use crate::bus::{ActuatorBus, BusGone, Goals, PerActuator, Seen, Trouble};
use crate::error::OpenError;
use crate::texts::{CURRENT, HEAT, OTHER_SERVOS, PORT_STILL_GONE, SENSOR, SEVERAL, VOLTAGE};
use crate::{BusDrive, BusSetup, Units};
use core::time::Duration;
use krait_ipc::Beside;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::MAX_ACTUATORS;
use krait_slave::{DriveConfig, SlaveConfig};
use packet::{ALL, Answer, FRAME, SYNC_READ, SYNC_WRITE, answers, put, signed, word};
use port::Port;
use std::path::Path;

/// Counts of a turn.
pub const COUNTS_PER_TURN: i32 = 4096;
/// Model number of an STS3215.
pub const MODEL: u16 = 777;
/// Power of the motor: 0 off, 1 on.
pub(crate) const TORQUE_ENABLE: u8 = 40;
/// Acceleration (1 byte), goal, time and speed (2 bytes each).
pub(crate) const GOAL: u8 = 41;
/// Largest torque, per mille of the servo's own; forgotten without power.
pub(crate) const TORQUE_LIMIT: u8 = 48;
/// What is read each cycle: from torque enable to present current.
pub(crate) const STATUS: u8 = TORQUE_ENABLE;
/// So many registers.
pub(crate) const STATUS_BYTES: usize = 31;
/// A USB adapter holds received bytes for so long, at best, ns.
const USB_NS: i64 = 1_000_000;
/// Silence after which nothing more comes of an old answer.
const QUIET_NS: i64 = 500_000;
/// How long an answer is waited for while the bus is being opened.
const OPEN_PATIENCE: Duration = Duration::from_millis(150);
/// Step of the present current, A.
pub const CURRENT_STEP_A: f64 = 6.5e-3;

/// Servos on one serial port.
#[derive(Debug)]
pub struct Sts3215 {
    port: Port,
    ids: Vec<u8>,
    timeout_ns: i64,
    torque_limits: PerActuator<u16>,
    bytes: Vec<u8>,
    received: Vec<u8>,
    /// What is moved; none: the servos are only read.
    config: Option<DriveConfig>,
}

impl Sts3215 {
    /// Opens a port to read servos, at most 12, whoever they are.
    ///
    /// # Errors
    /// [`OpenError`] where the port cannot be had.
    pub fn to_read(path: &Path, baud: u32, ids: Vec<u8>, timeout: Duration) -> Result<Self, OpenError> {
        Ok(Self {
            port: Port::open(path, baud)?,
            ids,
            timeout_ns: timeout.as_nanos() as i64,
            torque_limits: [0; MAX_ACTUATORS],
            bytes: Vec::with_capacity(512),
            received: Vec::with_capacity(1024),
            config: None,
        })
    }

    /// Opens the port of a configuration, finds its servos and checks who they are. Nothing moves, and nothing is changed.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(config: &DriveConfig) -> Result<(Self, Seen), OpenError> {
        let path = config.port.as_deref().ok_or(OpenError::NoBus)?;
        let ids = config.actuator.iter().map(|actuator| actuator.id as u8).collect();
        // Nobody is in a hurry before anything moves.
        let mut bus = Self::to_read(path, config.baud, ids, OPEN_PATIENCE)?;
        bus.torque_limits = core::array::from_fn(|k| {
            config.actuator.get(k).map_or(0, |actuator| (actuator.torque_limit * 1000.0).round() as u16)
        });
        let identities = identity::of_all(&mut bus, config, path, identity::Ask::PATIENT)?;
        identity::check(&identities, config)?;
        let mut seen = Seen::default();
        for _ in 0..identity::TRIES {
            bus.ask(&mut seen)?;
            if seen.has_answered.iter().take(bus.ids.len()).all(|answered| *answered) {
                bus.timeout_ns = (config.timeout_ms * 1e6) as i64;
                bus.config = Some(config.clone());
                return Ok((bus, seen));
            }
        }
        let silent = seen.has_answered.iter().position(|answered| !answered).unwrap_or(0);
        Err(OpenError::NoAnswer { actuator: silent + 1, id: bus.ids[silent] })
    }

    /// Sets the same registers of all servos; nobody answers.
    fn sync_write<const N: usize>(&mut self, address: u8, value: impl Fn(usize) -> [u8; N]) -> Result<(), BusGone> {
        let mut parts = Vec::with_capacity(self.ids.len() * (N + 1));
        for (k, id) in self.ids.iter().enumerate() {
            parts.push(*id);
            parts.extend(value(k));
        }
        self.bytes.clear();
        put(&mut self.bytes, ALL, SYNC_WRITE, &[&[address, N as u8], &parts]);
        self.port.send(&self.bytes)
    }

    /// Sends a question and receives until `enough` says so of all that was received, or time is over.
    fn question(&mut self, until_ns: i64, enough: impl Fn(&[u8]) -> bool) -> Result<bool, BusGone> {
        self.port.forget()?;
        self.received.clear();
        self.port.send(&self.bytes)?;
        while !enough(&self.received) {
            if !self.port.receive(&mut self.received, until_ns)? && monotonic_ns() >= until_ns {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Silence: receives and throws away until nothing comes any more.
    fn recover(&mut self) -> Result<(), BusGone> {
        let until_ns = monotonic_ns() + self.timeout_ns;
        let mut rest = Vec::new();
        while monotonic_ns() < until_ns && self.port.receive(&mut rest, monotonic_ns() + QUIET_NS)? {}
        self.port.forget()
    }

    fn take(&self, seen: &mut Seen) {
        let now_ns = monotonic_ns();
        for answer in answers(&self.received, STATUS_BYTES) {
            if let Some(k) = self.ids.iter().position(|id| *id == answer.id) {
                take_status(k, &answer, now_ns, seen);
            }
        }
    }
}

/// Servos as the slave's drive; nothing moves yet. `beside`: as for [`BusDrive::start`].
///
/// # Errors
/// [`OpenError`].
pub fn open_drive(config: &SlaveConfig, beside: Option<Beside>) -> Result<BusDrive, OpenError> {
    let setup = setup(config)?;
    let (bus, seen) = Sts3215::open(&config.drive)?;
    BusDrive::start(bus, setup, seen, beside).map_err(OpenError::Thread)
}

/// Units, period and limits of a configuration.
pub(crate) fn setup(config: &SlaveConfig) -> Result<BusSetup, OpenError> {
    let drive = &config.drive;
    let mut units = Vec::new();
    for (k, actuator) in drive.actuator.iter().enumerate() {
        units.push(Units::new(actuator, k + 1, COUNTS_PER_TURN)?);
    }
    BusSetup::new(config, units, COUNTS_PER_TURN / 2, exchange_ns(drive.actuator.len(), drive.baud))
}

/// Time of one cycle of so many servos without return delay, on the wire and in the adapter, ns.
fn exchange_ns(n: usize, baud: u32) -> i64 {
    let bytes = (FRAME + 2 + 8 * n) + (FRAME + 2 + n) + n * (FRAME + STATUS_BYTES);
    bytes as i64 * 10_000_000_000 / i64::from(baud) + USB_NS
}

impl ActuatorBus for Sts3215 {
    fn n_actuators(&self) -> usize {
        self.ids.len()
    }

    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone> {
        self.sync_write(GOAL, |k| goal_bytes(goals, k))
    }

    /// The goal before the power, so that nothing leaps when it comes; the torque limit, which a servo without power forgets.
    fn switch(&mut self, on: bool, goals: &Goals) -> Result<(), BusGone> {
        if on {
            let limits = self.torque_limits;
            self.sync_write(TORQUE_LIMIT, |k| limits[k].to_le_bytes())?;
            self.tell(goals)?;
        }
        self.sync_write(TORQUE_ENABLE, |_| [u8::from(on)])
    }

    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone> {
        self.bytes.clear();
        let ids = self.ids.clone();
        put(&mut self.bytes, ALL, SYNC_READ, &[&[STATUS, STATUS_BYTES as u8], &ids]);
        let until_ns = monotonic_ns() + self.timeout_ns;
        let enough = self.question(until_ns, |received| {
            ids.iter().all(|id| answers(received, STATUS_BYTES).any(|answer| answer.id == *id))
        })?;
        seen.has_answered = [false; MAX_ACTUATORS];
        self.take(seen);
        if enough { Ok(()) } else { self.recover() }
    }

    fn come_back(&mut self) -> Result<(), BusGone> {
        let Some(config) = self.config.clone() else { return Ok(()) };
        let still_gone = BusGone { what: PORT_STILL_GONE };
        let path = config.port.as_deref().ok_or(still_gone)?;
        self.port.reopen(path, config.baud).map_err(|error| {
            tracing::debug!("{error}");
            still_gone
        })?;
        let found = identity::of_all(self, &config, path, identity::Ask::BRIEF);
        let fits = found.and_then(|identities| identity::check(&identities, &config));
        fits.map_err(|error| {
            tracing::warn!("{error}");
            BusGone { what: OTHER_SERVOS }
        })
    }
}

/// Acceleration 0 is the largest; the slave's gate has limited it.
fn goal_bytes(goals: &Goals, k: usize) -> [u8; 7] {
    let [low, high] = (goals.counts[k].clamp(0, COUNTS_PER_TURN - 1) as u16).to_le_bytes();
    // Speed 0 would be the largest speed.
    let [slow, fast] = (goals.counts_per_s[k].clamp(1.0, 32_767.0) as u16).to_le_bytes();
    [0, low, high, 0, 0, slow, fast]
}

fn take_status(k: usize, answer: &Answer, now_ns: i64, seen: &mut Seen) {
    let at = |register: u8| usize::from(register - STATUS);
    let register = |address: u8| word(answer.data, at(address));
    let (load, current) = (signed(register(60), 10), signed(register(69), 15));
    seen.has_answered[k] = true;
    seen.sampled_ns[k] = now_ns;
    seen.is_powered[k] = answer.data[at(TORQUE_ENABLE)] == 1;
    seen.goal_counts[k] = signed(register(42), 15);
    seen.counts[k] = signed(register(56), 15);
    // Some firmwares give the current without its direction; the duty has it always.
    let direction = if load < 0 { -1.0 } else { 1.0 };
    seen.current_a[k] = f64::from(current.abs()) * CURRENT_STEP_A * direction;
    seen.supply_v[k] = f64::from(answer.data[at(62)]) * 0.1;
    seen.temperature_celsius[k] = f64::from(answer.data[at(63)]);
    seen.trouble[k] = trouble(answer.error);
    seen.has_let_go[k] = !seen.is_powered[k];
}

/// What the error byte of an answer means.
pub(crate) fn trouble(error: u8) -> Trouble {
    if error >> 5 & 1 == 1 {
        return Trouble::Limp;
    }
    let meaning = match error {
        0 => return Trouble::None,
        0x01 => VOLTAGE,
        0x02 => SENSOR,
        0x04 => HEAT,
        0x08 => CURRENT,
        _ => SEVERAL,
    };
    Trouble::Tripped { code: error.into(), meaning }
}
