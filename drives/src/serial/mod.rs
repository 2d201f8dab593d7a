//! Servos on one serial port, whoever made them: one half-duplex wire, goals and readings of all in two packets a cycle.
//!
//! Problem: the wire is one, nobody acknowledges a goal, an answer that comes late looks like the answer to the next question,
//! and a servo that has let go or has lost its power goes on accepting goals.
//!
//! Intuition: one block of registers, read each cycle, holds all that tells: whether the servo is under power, which goal it
//! has understood, where it is, what it complains of. An answer that knows another goal than the newest is an old one or
//! says that the goal was lost; both are a missing answer. What a make's registers are is in `sts3215` and `xl330`.
//!
//! Failure: whatever is left of a cycle that failed is received and thrown away before the next question.

mod data;
mod identity;
mod line;
mod port;
mod protocol;
mod scan;

pub(crate) use data::Data;
pub use identity::Identity;
pub(crate) use identity::{Ask, RangeEnd, check_range, refused, settings};
pub(crate) use line::{Line, exchange_ns};
pub use port::ports;
pub(crate) use protocol::{ALL, Answer, Block, PING, Protocol, READ, SYNC_READ, SYNC_WRITE, WRITE, word};
pub use scan::{FoundServo, scan};

use crate::bus::{ActuatorBus, BusGone, Goals, Seen};
use crate::error::OpenError;
use crate::sts3215::Sts3215;
use crate::texts::{OTHER_SERVOS, PORT_STILL_GONE};
use crate::xl330::Xl330;
use crate::{BusDrive, BusSetup, Units, sts3215, xl330};
use core::fmt::Debug;
use core::time::Duration;
use krait_ipc::Beside;
use krait_ipc::message::MAX_ACTUATORS;
use krait_slave::{DriveConfig, DriveKind, SlaveConfig};
use std::path::Path;

/// How long an answer is waited for while the bus is being opened.
const OPEN_PATIENCE: Duration = Duration::from_millis(150);
/// Times that a question is asked then before it counts as unanswered.
const OPEN_TRIES: u32 = 4;

/// Makes of servos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoMake {
    /// Feetech STS3215.
    Sts3215,
    /// ROBOTIS Dynamixel XL330.
    Xl330,
}

impl ServoMake {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Sts3215, Self::Xl330];
    /// Counts of a turn, of both.
    pub const COUNTS_PER_TURN: i32 = 4096;

    /// The make that a configuration is of; none: its drives are no serial servos.
    pub fn of(kind: DriveKind) -> Option<Self> {
        match kind {
            DriveKind::Sts3215 => Some(Self::Sts3215),
            DriveKind::Xl330 => Some(Self::Xl330),
            DriveKind::Sim | DriveKind::Cia402 => None,
        }
    }

    /// Model numbers that krait knows how to move, with their names.
    pub fn models(self) -> &'static [(u16, &'static str)] {
        match self {
            Self::Sts3215 => &sts3215::MODELS,
            Self::Xl330 => &xl330::MODELS,
        }
    }

    /// Step of the present current, A.
    pub fn current_step_a(self) -> f64 {
        match self {
            Self::Sts3215 => sts3215::CURRENT_STEP_A,
            Self::Xl330 => xl330::CURRENT_STEP_A,
        }
    }

    pub(crate) fn protocol(self) -> Protocol {
        match self {
            Self::Sts3215 => Protocol::One,
            Self::Xl330 => Protocol::Two,
        }
    }

    /// Bit rates that these servos can be set to, the usual one first.
    fn bauds(self) -> &'static [u32] {
        match self {
            Self::Sts3215 => &sts3215::BAUDS,
            Self::Xl330 => &xl330::BAUDS,
        }
    }

    /// Registers that say who a servo is.
    fn who(self) -> Block {
        match self {
            Self::Sts3215 => sts3215::WHO,
            Self::Xl330 => xl330::WHO,
        }
    }

    fn servos(self) -> Box<dyn Servos> {
        match self {
            Self::Sts3215 => Box::new(Sts3215::default()),
            Self::Xl330 => Box::new(Xl330::default()),
        }
    }

    /// Bytes of a goal, and of what is read, in a cycle.
    fn cycle_bytes(self) -> (usize, usize) {
        match self {
            Self::Sts3215 => (sts3215::GOAL_BYTES, sts3215::STATUS.n),
            Self::Xl330 => (xl330::GOAL_BYTES, xl330::STATUS.n),
        }
    }
}

/// What servos of a make are told and asked, and what their answers mean.
pub(crate) trait Servos: Debug + Send {
    /// Checks who answered, `who` as the make's block says, and what they are set to; learns what is needed later. Nothing moves.
    fn identify(&mut self, line: &mut Line, who: &[Vec<u8>], config: &DriveConfig, how: Ask) -> Result<(), OpenError>;

    /// As [`ActuatorBus::tell`].
    fn tell(&mut self, line: &mut Line, goals: &Goals) -> Result<(), BusGone>;

    /// As [`ActuatorBus::switch`].
    fn switch(&mut self, line: &mut Line, on: bool, goals: &Goals) -> Result<(), BusGone>;

    /// As [`ActuatorBus::ask`]; nobody has answered yet.
    fn ask(&mut self, line: &mut Line, seen: &mut Seen) -> Result<(), BusGone>;

    /// As [`ActuatorBus::look_again`].
    fn look_again(&mut self) {}
}

/// Servos on one serial port.
#[derive(Debug)]
pub struct ServoBus {
    line: Line,
    make: ServoMake,
    servos: Box<dyn Servos>,
    /// What is moved; none: the servos are only read.
    config: Option<DriveConfig>,
}

impl ServoBus {
    /// Opens a port to read servos, at most 12, whoever they are.
    ///
    /// # Errors
    /// [`OpenError`] where the port cannot be had.
    pub fn to_read(
        make: ServoMake,
        path: &Path,
        baud: u32,
        ids: Vec<u8>,
        timeout: Duration,
    ) -> Result<Self, OpenError> {
        let line = Line::open(path, baud, make.protocol(), ids, timeout)?;
        Ok(Self { line, make, servos: make.servos(), config: None })
    }

    /// Opens the port of a configuration, finds its servos and checks who they are. Nothing moves, and nothing is changed that a
    /// servo keeps without power.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(config: &DriveConfig) -> Result<(Self, Seen), OpenError> {
        let path = config.port.as_deref().ok_or(OpenError::NoBus)?;
        let make = ServoMake::of(config.kind).ok_or(OpenError::NoBus)?;
        let ids = config.actuator.iter().map(|actuator| actuator.id as u8).collect();
        // Nobody is in a hurry before anything moves.
        let mut bus = Self::to_read(make, path, config.baud, ids, OPEN_PATIENCE)?;
        bus.identify(path, config, Ask::PATIENT)?;
        let mut seen = Seen::default();
        for _ in 0..OPEN_TRIES {
            bus.ask(&mut seen)?;
            if seen.has_answered.iter().take(bus.line.ids.len()).all(|answered| *answered) {
                bus.line.timeout_ns = (config.timeout_ms * 1e6) as i64;
                bus.config = Some(config.clone());
                return Ok((bus, seen));
            }
        }
        let silent = seen.has_answered.iter().position(|answered| !answered).unwrap_or(0);
        Err(OpenError::NoAnswer { actuator: silent + 1, id: bus.line.ids[silent] })
    }

    fn identify(&mut self, path: &Path, config: &DriveConfig, how: Ask) -> Result<(), OpenError> {
        let who = identity::of_all(&mut self.line, self.make.who(), config, path, how)?;
        for (k, data) in who.iter().enumerate() {
            let Identity { id, model, .. } = Identity::of(self.make, self.line.ids[k], data);
            if !self.make.models().iter().any(|(known, _)| *known == model) {
                return Err(OpenError::Stranger { actuator: k + 1, id, found: model, expected: self.make.models() });
            }
        }
        self.servos.identify(&mut self.line, &who, config, how)
    }
}

/// Servos as the slave's drive; nothing moves yet. `beside`: as for [`BusDrive::start`].
///
/// # Errors
/// [`OpenError`].
pub(crate) fn open_drive(config: &SlaveConfig, beside: Option<Beside>) -> Result<BusDrive, OpenError> {
    let setup = setup(config)?;
    let (bus, seen) = ServoBus::open(&config.drive)?;
    BusDrive::start(bus, setup, seen, beside).map_err(OpenError::Thread)
}

/// Units, period and limits of a configuration.
pub(crate) fn setup(config: &SlaveConfig) -> Result<BusSetup, OpenError> {
    let drive = &config.drive;
    let make = ServoMake::of(drive.kind).ok_or(OpenError::NoBus)?;
    let mut units = Vec::new();
    for (k, actuator) in drive.actuator.iter().enumerate() {
        units.push(Units::new(actuator, k + 1, ServoMake::COUNTS_PER_TURN)?);
    }
    let exchange_ns = exchange_ns(make.protocol(), drive.actuator.len(), make.cycle_bytes(), drive.baud);
    BusSetup::new(config, units, ServoMake::COUNTS_PER_TURN / 2, exchange_ns)
}

impl ActuatorBus for ServoBus {
    fn n_actuators(&self) -> usize {
        self.line.ids.len()
    }

    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone> {
        self.servos.tell(&mut self.line, goals)
    }

    fn switch(&mut self, on: bool, goals: &Goals) -> Result<(), BusGone> {
        self.servos.switch(&mut self.line, on, goals)
    }

    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone> {
        seen.has_answered = [false; MAX_ACTUATORS];
        self.servos.ask(&mut self.line, seen)
    }

    fn come_back(&mut self) -> Result<(), BusGone> {
        let Some(config) = self.config.clone() else { return Ok(()) };
        let still_gone = BusGone { what: PORT_STILL_GONE };
        let path = config.port.as_deref().ok_or(still_gone)?;
        self.line.reopen(path).map_err(|error| {
            tracing::debug!("{error}");
            still_gone
        })?;
        self.identify(path, &config, Ask::BRIEF).map_err(|error| {
            tracing::warn!("{error}");
            BusGone { what: OTHER_SERVOS }
        })
    }

    fn look_again(&mut self) {
        self.servos.look_again();
    }
}
