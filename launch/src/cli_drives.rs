//! The command line of `krait drives`.

use clap::{Args, ValueEnum};
use krait_drives::ServoMake;
use std::path::PathBuf;

/// Options of `krait drives`.
#[derive(Clone, Debug, Args)]
pub struct DrivesArgs {
    /// Look at this serial port only; by default at every USB serial adapter, or at that of --config.
    #[arg(long, value_name = "PORT")]
    pub port: Option<PathBuf>,
    /// Look at this CAN interface only; by default at all, or at that of --config. With --emulate: drives live on it.
    #[arg(long, value_name = "INTERFACE", conflicts_with = "port")]
    pub interface: Option<String>,
    /// Look at this bit rate only; by default at all that these servos can be set to.
    #[arg(long, value_name = "RATE")]
    pub baud: Option<u32>,
    /// Largest number on the bus that is asked for.
    #[arg(long, value_name = "ID", default_value_t = 20, value_parser = clap::value_parser!(u8).range(0..=252))]
    pub last_id: u8,
    /// Show positions, loads and temperatures anew twice a second, until Ctrl-C.
    #[arg(long, conflicts_with_all = ["zero", "jog", "emulate"])]
    pub watch: bool,
    /// Find the count of each configured actuator, which is its zero_count where lines or joints are now. Drives on CAN whose
    /// encoders forget get their zero_count there (CiA 402, method 37): under power for a moment, without motion. Servos with `homing`
    /// go to their mechanical stop first, after a yes that is typed.
    #[arg(long, group = "finds", conflicts_with_all = ["jog", "emulate"])]
    pub zero: bool,
    /// Move one configured actuator, numbered from 1: each line on standard input is one step, `-` goes back.
    #[arg(long, value_name = "ACTUATOR", conflicts_with = "emulate")]
    pub jog: Option<usize>,
    /// Find which way each configured actuator pulls, by moves of at most 0.5 mm either way against the tension of the lines, and
    /// compare it with its `sign`.
    #[arg(long, group = "finds", conflicts_with_all = ["zero", "jog", "watch", "emulate"])]
    pub calibrate: bool,
    /// With --zero or --calibrate: write the configuration with the zeros or signs that were found, all else of its text as it was.
    #[arg(long, value_name = "FILE", requires = "finds")]
    pub out: Option<PathBuf>,
    /// Overwrite that file.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Length of a step, mm; at most 0.1.
    #[arg(long, value_name = "MM", default_value_t = 0.1, requires = "jog")]
    pub step_mm: f64,
    /// Plug in an emulated bus of so many servos, or drives with --interface, to try krait without hardware; until Ctrl-C.
    #[arg(long, value_name = "SERVOS", conflicts_with_all = ["port", "baud"], value_parser = clap::value_parser!(u8).range(1..=12))]
    pub emulate: Option<u8>,
    /// Which servos are emulated.
    #[arg(long, value_name = "MAKE", value_enum, default_value_t = EmulatedServo::Sts3215, requires = "emulate", conflicts_with = "interface")]
    pub servo: EmulatedServo,
    /// Print what was found as JSON on standard output; with --watch one document after the other.
    #[arg(long, conflicts_with_all = ["jog", "emulate"])]
    pub json: bool,
}

/// Servos that can be emulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EmulatedServo {
    /// Feetech STS3215.
    Sts3215,
    /// ROBOTIS Dynamixel XL330-M288.
    Xl330,
}

impl EmulatedServo {
    /// The same as the drives say it.
    pub fn make(self) -> ServoMake {
        match self {
            Self::Sts3215 => ServoMake::Sts3215,
            Self::Xl330 => ServoMake::Xl330,
        }
    }
}
