//! Why drives could not be opened: one sentence each, with what to do. Nothing has moved.

use std::io;
use std::path::PathBuf;

/// Drives could not be opened; nothing has moved.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Lines shall give way to loads that nobody measures.
    #[error(
        "[slave.drive] on_fault = \"relax\": these drives do not measure loads, which tell how far to give way; set newton_metre_per_ampere, or on_fault = \"hold\""
    )]
    RelaxesBlindly,
    /// No such port.
    #[error("no serial port {}; {there}", .port.display())]
    NoSuchPort {
        /// The port.
        port: PathBuf,
        /// What is there instead.
        there: String,
    },
    /// The port belongs to others.
    #[error("the serial port {} may not be opened: {advice}", .port.display())]
    NoPermission {
        /// The port.
        port: PathBuf,
        /// Whose it is, and which group or rule would open it.
        advice: String,
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
        "two {what}s seem to have the id {id}: its question was answered {n} times, or unintelligibly; give each its own id, one {what} on the bus at a time"
    )]
    SameId {
        /// "servo" or "drive".
        what: &'static str,
        /// The number.
        id: u8,
        /// Answers.
        n: usize,
    },
    /// Another kind of device.
    #[error(
        "actuator {actuator} (id {id}) is a stranger: its model number is {found}, expected {}; it is not moved, correct the id",
        models(expected)
    )]
    Stranger {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// What it says.
        found: u16,
        /// What known ones say, and their names.
        expected: &'static [(u16, &'static str)],
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
    /// Indirect registers that stay as they are.
    #[error(
        "actuator {actuator} (id {id}) keeps other indirect addresses (registers 168 to 199) than it is told; another program has set them, or its firmware is old: take its power away for a moment, or update it with the maker's tool"
    )]
    NoPointers {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
    },
    /// The count that a drive shall be told as its zero was not chosen.
    #[error(
        "actuator {actuator} has no zero_count, the count that its drive is to read at zero: an incremental encoder has none by itself; choose one far from 0, such as 1000000, and run `krait drives --zero` again"
    )]
    ZeroNotChosen {
        /// Which, from 1.
        actuator: usize,
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
    /// No such interface.
    #[error(
        "no CAN interface {interface:?}, {there}; plug its adapter in, or make a virtual one: `sudo ip link add vcan0 type vcan`, `sudo ip link set vcan0 up`"
    )]
    NoSuchInterface {
        /// The interface.
        interface: String,
        /// What is there instead.
        there: String,
    },
    /// An interface of another kind.
    #[error("{interface} is no CAN interface; name one, `krait drives` lists those that are there")]
    NotCan {
        /// The interface.
        interface: String,
    },
    /// The interface is not switched on.
    #[error(
        "the CAN interface {interface} is down; `sudo ip link set {interface} up type can bitrate 1000000`, at the bit rate of the drives (a virtual one: `sudo ip link set {interface} up`)"
    )]
    InterfaceDown {
        /// The interface.
        interface: String,
    },
    /// The controller has left the bus.
    #[error(
        "the CAN interface {interface} is bus-off: its controller has left the bus after too many errors, expected one that is active; check bit rate, termination and cable, then `sudo ip link set {interface} down` and up again"
    )]
    InterfaceBusOff {
        /// The interface.
        interface: String,
    },
    /// Somebody else on this machine has the interface.
    #[error("the CAN interface {interface} is in use by another program, such as a chain that runs; end that first")]
    InterfaceInUse {
        /// The interface.
        interface: String,
    },
    /// The kernel has no CAN.
    #[error("the kernel has no CAN sockets; `sudo modprobe can-raw`, or use a kernel that has them")]
    NoCan,
    /// Whatever else the kernel says.
    #[error("the CAN interface {interface}: {source}")]
    Can {
        /// The interface.
        interface: String,
        /// What the kernel says.
        source: io::Error,
    },
    /// Another master.
    #[error(
        "another master is on the CAN bus: it sends {what}, expected silence but for drives; end it (a chain, a tool of the maker, a controller), one master drives them"
    )]
    SecondMaster {
        /// What it did.
        what: &'static str,
    },
    /// Nobody answers at all.
    #[error(
        "no drive answers on {interface}, expected {expected}; check power, cable, termination and the bit rate of the interface (`ip -details link show {interface}`)"
    )]
    NobodyOnCan {
        /// The interface.
        interface: String,
        /// Who should.
        expected: String,
    },
    /// Answers questions and no SYNC.
    #[error(
        "actuator {actuator} (id {id}) answers questions but not SYNC; raise [slave.drive] period_ms and timeout_ms, or see its manual for synchronous PDOs"
    )]
    NoCycle {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
    },
    /// A device of another kind.
    #[error(
        "actuator {actuator} (id {id}) is a stranger: its device profile is {profile}, expected 402 (a drive); it is not moved, correct the id"
    )]
    NoDrive {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// What it says.
        profile: u32,
    },
    /// Another drive.
    #[error(
        "actuator {actuator} (id {id}) is a stranger: its {what} is {found:#010X}, expected {expected:#010X}; it is not moved, correct the id or {what}, `krait drives` shows who is there"
    )]
    OtherDrive {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// Which number of its identity.
        what: &'static str,
        /// What it says.
        found: u32,
        /// What the configuration says.
        expected: u32,
    },
    /// A drive without the mode that is used.
    #[error(
        "actuator {actuator} (id {id}) has no cyclic synchronous position mode (bit 7 of its object 6502); krait cannot move it"
    )]
    NoCyclicPosition {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
    },
    /// A drive that limits its own speed to less than it is asked for.
    #[error(
        "actuator {actuator} (id {id}) limits its motor to {most_per_min} turns/min (object 6080), expected at least {least_per_min}, which its rate_m_per_s needs by counts_per_turn, gear and lead_m or spool_radius_m; raise that limit with its maker's tool, or lower rate_m_per_s"
    )]
    TooSlow {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// Its own limit, turns a minute.
        most_per_min: u32,
        /// What is needed, turns a minute.
        least_per_min: u32,
    },
    /// A drive refuses what it is told before it has power.
    #[error(
        "actuator {actuator} (id {id}) refuses object {index:04X}:{sub:02X} (abort code {code:#010X}: {meaning}); {advice}"
    )]
    Object {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// Index.
        index: u16,
        /// Sub-index.
        sub: u8,
        /// Abort code.
        code: u32,
        /// What that means.
        meaning: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// The period cannot be told to drives.
    #[error(
        "[slave.drive] period_ms = {period_ms}: drives are told it in object 60C2, expected a whole number of ms up to 255, or of tenths up to 25.5, or of hundredths up to 2.55"
    )]
    BusPeriod {
        /// The period, ms.
        period_ms: f64,
    },
    /// A zero that an encoder shows after it lost its power.
    #[error(
        "actuator {actuator}: zero_count {zero_count} is within {counts} counts of 0, which is what an incremental encoder reads after it lost its power, so that nobody could tell; choose one beyond, such as {better}, and run `krait drives --zero`, or set is_absolute = true if its encoder keeps its count"
    )]
    ZeroLikePowerOn {
        /// Which, from 1.
        actuator: usize,
        /// The zero.
        zero_count: i32,
        /// How near.
        counts: i64,
        /// One that is beyond.
        better: i64,
    },
    /// Travel comes too near to the end of the counts.
    #[error(
        "actuator {actuator}: travel_m {travel_m} is {counts} counts either side of zero_count {zero_count}, which is more than a drive can count; check counts_per_turn, gear and lead_m or spool_radius_m"
    )]
    BeyondCounts {
        /// Which, from 1.
        actuator: usize,
        /// The travel, m.
        travel_m: f64,
        /// The same in counts.
        counts: i64,
        /// Where zero is.
        zero_count: i32,
    },
    /// Homing needs power, and a dry run gives none.
    #[error(
        "[slave.drive] mode = \"dry\": drives with is_absolute = false are told their zero under power for a moment, and a dry run gives none; set it to \"live\" for `krait drives --zero`"
    )]
    HomesDry,
    /// Somebody ended it.
    #[error(
        "homing was ended before it was done; the drives have no power, and some may read their zero_count already: begin anew with `krait drives --zero`"
    )]
    HomingEnded,
    /// Homing failed.
    #[error(
        "actuator {actuator} (id {id}) was not homed where it stands (method 37), its status word is {status:#06X}; see its manual for homing without motion"
    )]
    NotHomed {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// Its status word.
        status: u16,
    },
    /// Homing had another effect.
    #[error(
        "actuator {actuator} (id {id}) reads {found} after homing, expected its zero_count {expected}: it does not heed object 607C; set zero_count to what it reads"
    )]
    OtherZero {
        /// Which, from 1.
        actuator: usize,
        /// Its number on the bus.
        id: u8,
        /// What it reads, counts.
        found: i32,
        /// What it should.
        expected: i32,
    },
    /// The configuration names no bus.
    #[error("[slave.drive] describes no bus: kind is \"sim\", or port or interface is missing; see docs/drives.md")]
    NoBus,
    /// The bus failed while it was being opened.
    #[error("the bus of the drives failed while it was being opened: {0}")]
    Gone(#[from] crate::BusGone),
    /// No thread.
    #[error("the kernel gives no thread for the bus of the drives: {0}")]
    Thread(io::Error),
}

/// Known model numbers with their names, as a sentence has them.
fn models(known: &[(u16, &str)]) -> String {
    known.iter().map(|(model, name)| format!("{model} ({name})")).collect::<Vec<_>>().join(" or ")
}
