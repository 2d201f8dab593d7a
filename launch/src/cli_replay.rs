//! The command line of `krait replay` and `krait compare`.

use crate::in_force::Compensation;
use clap::{Args, ValueEnum};
use krait_ipc::Process;
use std::path::PathBuf;

/// Options of `krait replay`.
#[derive(Clone, Debug, Args)]
pub struct ReplayArgs {
    /// A recording (.mcap), or a trajectory (.csv: time_s and bend_x_rad,bend_y_rad | theta_l_rad,delta_rad | tip_x_m,tip_y_m; of joints time_s,q1_rad,q2_rad and so on).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Which of the chains that ran in the recording, from 1.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub pass: u64,
    /// How many times as fast as it was recorded, or `max`: as fast as the processes go.
    #[arg(long, default_value = "1", value_parser = parse_speed, value_name = "N|max", allow_negative_numbers = true)]
    pub speed: Speed,
    /// One sample for each line on standard input.
    #[arg(long, conflicts_with = "speed")]
    pub step: bool,
    /// Begin here, s after the first sample.
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub from: f64,
    /// End here, s after the first sample.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// Play it so often.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub loops: u64,
    /// Run this stage with other settings than the recording's: those of --config. --model, --compensation and --truth say by
    /// themselves which stage they are for.
    #[arg(long, value_parser = parse_replaced, value_name = "resolve|compensate|estimate|slave")]
    pub replace: Vec<Process>,
    /// Model file (TOML) for `compensate` in place of the recorded one.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Built-in model for `compensate` in place of the recorded one.
    #[arg(long, value_enum, value_name = "NAME")]
    pub compensation: Option<Compensation>,
    /// Truth of the simulated snake (TOML) for `slave` in place of the recorded one.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// The drives. `recorded`: those of the recording, which answer as they did; the slave alone is run again on them, each step at its
    /// recorded instant, and whatever it wants of them otherwise is counted.
    #[arg(long, value_enum, default_value_t = ReplaySlave::Sim)]
    pub slave: ReplaySlave,
    /// On the machine's clock, as for real drives, and not in the recording's own time.
    #[arg(long, conflicts_with = "step")]
    pub real_time: bool,
    /// Let the replay engage on the machine's clock, where the drives may be real; without it --real-time moves nothing. In the
    /// recording's own time only the simulated snake listens, and the replay engages by itself.
    #[arg(long)]
    pub engage: bool,
    /// Where to write the new recording; by default recordings/DATE-replay.mcap.
    #[arg(long, value_name = "FILE", conflicts_with = "no_recording")]
    pub recording: Option<PathBuf>,
    /// Do not record.
    #[arg(long)]
    pub no_recording: bool,
    /// Print the figures as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// The drives of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ReplaySlave {
    /// Simulated drives.
    Sim,
    /// The Feetech STS3215 servos that the configuration describes (docs/drives.md).
    Sts3215,
    /// The ROBOTIS Dynamixel XL330 servos that the configuration describes (docs/drives.md).
    Xl330,
    /// The CANopen drives of the profile CiA 402 that the configuration describes (docs/drives.md).
    Cia402,
    /// What real drives answered when they were recorded (docs/drives.md).
    Recorded,
}

/// Options of `krait compare`.
#[derive(Clone, Debug, Args)]
pub struct CompareArgs {
    /// One recording.
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// The other.
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// Which of the chains that ran in A, from 1.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub pass_a: u64,
    /// Which of the chains that ran in B, from 1.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub pass_b: u64,
    /// Folder for the pictures (SVG); made if it is missing.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the comparison as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// How fast a replay goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speed {
    /// So many times as fast as it was recorded.
    Times(f64),
    /// As fast as the processes go.
    Max,
}

fn parse_replaced(word: &str) -> Result<Process, String> {
    let processes = [Process::Resolve, Process::Compensate, Process::Estimate, Process::Slave];
    let named = processes.into_iter().find(|process| process.name() == word);
    named.ok_or_else(|| format!("{word:?} cannot be replaced: expected resolve, compensate, estimate or slave"))
}

fn parse_speed(word: &str) -> Result<Speed, String> {
    if word == "max" {
        return Ok(Speed::Max);
    }
    let times = word.parse().ok().filter(|times| (0.01..=1000.0).contains(times));
    times.map(Speed::Times).ok_or_else(|| format!("{word:?} is no speed: expected 0.01 to 1000, or max"))
}
