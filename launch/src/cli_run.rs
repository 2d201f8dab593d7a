//! Options of `krait run`.

use crate::cli::{EngageKind, MasterKind};
use crate::cli_console::FoxgloveArgs;
use crate::cli_machine::MachineArgs;
use crate::in_force::Compensation;
use clap::Args;
use krait_master::BesideConfig;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Options of `krait run`.
#[derive(Clone, Debug, Args)]
pub struct RunArgs {
    /// Where the operator's motion comes from.
    #[arg(long, value_enum, default_value_t = MasterKind::Replay)]
    pub master: MasterKind,
    /// The report recording (replay) or the script to play; by default the shipped recording, over and over.
    #[arg(long, value_name = "FILE")]
    pub input: Option<PathBuf>,
    /// Profile of a joystick, gamepad, pedal, mouse or keyboard (docs/hands.md), for `--master hid`.
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// The device that --profile is of, as in /dev/input/by-id/...-event-mouse; without it that which the profile names.
    #[arg(long, value_name = "NODE", requires = "profile")]
    pub node: Option<PathBuf>,
    /// Profile of a device beside that one, such as a pedal, whose buttons and axes join its (docs/hands.md), and its node if the profile does
    /// not name it; up to three times. Takes the place of [[master.beside]].
    #[arg(long, value_name = "FILE[=NODE]")]
    pub beside: Vec<BesideConfig>,
    /// The address of this machine on which poses are awaited, for `--master pose`.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub listen: Option<SocketAddr>,
    /// Let the recording or script engage; without it nothing moves. `again`: also after whatever has ended an engagement,
    /// which only simulated drives allow.
    #[arg(long, value_enum, value_name = "once|again", num_args = 0..=1, require_equals = true, default_missing_value = "once")]
    pub engage: Option<EngageKind>,
    #[command(flatten)]
    pub machine: MachineArgs,
    /// The built-in model to run with (`krait model show NAME`). Beside a --model of kind segments: those without their effects, with
    /// lines taken for rigid (off) or elastic ones alone (naive).
    #[arg(long, value_enum, value_name = "NAME")]
    pub compensation: Option<Compensation>,
    /// The model file (TOML) to run with: the machine, its effects, and what is learnt.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Where to write the recording; by default recordings/DATE-run.mcap.
    #[arg(long, value_name = "FILE", conflicts_with = "no_recording")]
    pub recording: Option<PathBuf>,
    /// Begin a new file of the recording whenever one has this many megabytes.
    #[arg(long, value_name = "MB", conflicts_with = "no_recording")]
    pub rotate_mb: Option<u64>,
    /// Begin a new file of the recording whenever one is this old, s.
    #[arg(long, value_name = "SECONDS", conflicts_with = "no_recording")]
    pub rotate_s: Option<u64>,
    /// Do not record.
    #[arg(long)]
    pub no_recording: bool,
    /// End after this time, s; without it the chain runs until Ctrl-C.
    #[arg(long, value_parser = seconds, allow_negative_numbers = true)]
    pub seconds: Option<f64>,
    /// Exit code 1 if the latency budget was not kept.
    #[arg(long)]
    pub check_budget: bool,
    /// Serve the page of this chain too, and print its address; `--master browser` does so by itself.
    #[arg(long)]
    pub console: bool,
    #[command(flatten)]
    pub viewers: FoxgloveArgs,
    /// Print the figures as JSON on standard output at the end.
    #[arg(long)]
    pub json: bool,
}

/// A time in seconds that comes to an end.
fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| value.is_finite() && *value >= 0.0);
    value.ok_or_else(|| "expected a number of seconds, 0 or more".to_owned())
}
