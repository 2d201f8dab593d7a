//! Why drives could not be opened: one sentence each, with what to do. Nothing has moved.

use std::io;
use std::path::PathBuf;

/// Drives could not be opened; nothing has moved.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// No such port.
    #[error("no serial port {}; {there}", .port.display())]
    NoSuchPort {
        /// The port.
        port: PathBuf,
        /// What is there instead.
        there: String,
    },
    /// The port belongs to others.
    #[error(
        "the serial port {} may not be opened: it belongs to the group {group}; join it with `sudo usermod -aG {group} $USER` and log in anew",
        .port.display()
    )]
    NoPermission {
        /// The port.
        port: PathBuf,
        /// Its group.
        group: String,
    },
    /// Somebody else has the port.
    #[error("the serial port {} is in use by another program, such as a chain that runs; end that first", .port.display())]
    InUse {
        /// The port.
        port: PathBuf,
    },
    /// The path is no serial port.
    #[error("{} is no serial port; name one, `krait drives` lists those that are there", .port.display())]
    NotSerial {
        /// The path.
        port: PathBuf,
    },
    /// Whatever else the kernel says.
    #[error("the serial port {}: {source}", .port.display())]
    Io {
        /// The port.
        port: PathBuf,
        /// What the kernel says.
        source: io::Error,
    },
    /// Nobody answers at all.
    #[error(
        "no servo answers on {} at {baud} baud, expected {expected}; check power and cable, and the rate: `krait drives` looks at all of them",
        .port.display()
    )]
    NobodyAnswers {
        /// The port.
        port: PathBuf,
        /// Bit rate.
        baud: u32,
        /// Who should.
        expected: String,
    },
    /// One does not answer.
    #[error(
        "actuator {actuator} (id {id}) does not answer, while others do; check its cable and its id, `krait drives` shows who is there"
    )]
    NoAnswer {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
    },
    /// Two answer at once.
    #[error(
        "two servos seem to have the id {id}: its question was answered {n} times, or unintelligibly; give each its own id, one servo on the bus at a time"
    )]
    SameId {
        /// The number.
        id: u8,
        /// Answers.
        n: usize,
    },
    /// Another kind of device.
    #[error(
        "actuator {actuator} (id {id}) is a stranger: its model number is {found}, expected {expected} (STS3215); it is not moved, correct the id"
    )]
    Stranger {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// What it says.
        found: u16,
        /// What a known one says.
        expected: u16,
    },
    /// A register has a value with which the servo would not do what it is told.
    #[error(
        "actuator {actuator} (id {id}): register {register} ({name}) is {found}, expected {expected}; set it with the maker's tool"
    )]
    Register {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// Address.
        register: u8,
        /// What it is.
        name: &'static str,
        /// Its value.
        found: i32,
        /// What it should be.
        expected: String,
    },
    /// The configuration has no zero.
    #[error(
        "actuator {actuator} has no zero_count; bring its line or joint to zero and find it with `krait drives --zero`"
    )]
    ZeroNeverSet {
        /// Which, from 1.
        actuator: usize,
    },
    /// Travel comes too near to the end of the encoder's turn.
    #[error(
        "actuator {actuator}: travel_m {travel_m} is {counts} counts either side of zero_count {zero_count}, which comes too near to where the encoder begins anew (0 and {last_count}); turn the spool on its shaft so that zero is near the middle, or lower travel_m"
    )]
    Wraps {
        /// Which, from 1.
        actuator: usize,
        /// The travel, m.
        travel_m: f64,
        /// The same in counts.
        counts: i64,
        /// Where zero is.
        zero_count: i64,
        /// The last count of a turn.
        last_count: i32,
    },
    /// A cycle takes longer than its period.
    #[error(
        "[slave.drive] period_ms = {period_ms}: {n} servos at {baud} baud need {exchange_ms:.1} ms; raise it, or the bit rate"
    )]
    PeriodTooShort {
        /// The period, ms.
        period_ms: f64,
        /// Servos.
        n: usize,
        /// Bit rate.
        baud: u32,
        /// What a cycle takes, ms.
        exchange_ms: f64,
    },
    /// The configuration names no bus.
    #[error("[slave.drive] describes no bus: kind is \"sim\" or port is missing; see docs/drives.md")]
    NoBus,
    /// The bus failed while it was being opened.
    #[error("the bus of the drives failed while it was being opened: {0}")]
    Gone(#[from] crate::BusGone),
    /// No thread.
    #[error("the kernel gives no thread for the bus of the drives: {0}")]
    Thread(io::Error),
}
