//! The command line of `krait calibrate`.

use crate::cli_guide::GuideArgs;
use crate::cli_lab::LabFiles;
use crate::cli_machine::MachineArgs;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// The procedures.
#[derive(Clone, Debug, Subcommand)]
pub enum CalibrateVerb {
    /// Friction of the cone (mu, f_s) by hanging weights: a dialogue.
    #[command(after_help = "Example:\n  krait calibrate friction --csv friction.csv --model robot.toml")]
    Friction(FrictionArgs),
    /// Play by a dial indicator on the actuators' outputs, lines unloaded: a dialogue.
    #[command(
        after_help = "Examples:\n  krait calibrate play --csv play.csv --model robot.toml --dial-sd-um 10\n  krait calibrate play --csv play.csv --model robot.toml --drives --config robot-chain.toml"
    )]
    Play(PlayArgs),
    /// Bends from clicked points of photographs before graph paper: a table in, a table out.
    ///
    /// Columns of the clicks: image,view,kind,x_mm,z_mm,u_px,v_px; view is front, side or mirror, kind is corner (with its
    /// place on the paper), base or end (two edges each).
    /// A picture that cannot be used is named and left out.
    #[command(
        after_help = "Example:\n  krait calibrate photo clicks.csv --out bends.csv\n  krait calibrate poses --csv poses.csv --model robot.toml --bends bends.csv"
    )]
    Photo(PhotoArgs),
    /// eta and the play from guided poses whose bend is measured: a dialogue.
    #[command(
        after_help = "Examples:\n  krait calibrate poses --csv poses.csv --model robot.toml --sd-deg 0.5\n  krait calibrate poses --csv poses.csv --model robot.toml --bends bends.csv\n  krait calibrate poses --csv poses.csv --model robot.toml --front 0,60,120 --largest-deg 60\n  krait calibrate poses --csv try.csv --model try.toml --truth stiff.toml\n  krait calibrate poses --csv poses.csv --model robot.toml --chain --config robot-chain.toml --shape external"
    )]
    Poses(PosesArgs),
    /// The stem's angle phi with eta, play and f_s, from recorded encoders, load cells and bends of both directions.
    ///
    /// Columns as for `krait lab`: q1_m to q3_m, tau1_n to tau3_n, bend_x_rad and bend_y_rad or what they are called in the file.
    /// The model file gives the dimensions, mu (krait calibrate friction) and where phi begins.
    #[command(
        after_help = "Examples:\n  krait calibrate stem --model robot.toml --data slow.csv --out calibrated.toml\n  krait calibrate stem --model robot.toml --data recordings/slow.mcap --cell-sd-n 0.2 --bend-sd-deg 0.5"
    )]
    Stem(StemArgs),
}

/// Where readings and values go.
#[derive(Clone, Debug, Args)]
pub struct Files {
    /// Table of readings; a command that was stopped goes on from it.
    #[arg(long, value_name = "FILE")]
    pub csv: PathBuf,
    /// Model file that takes the values; made if it is missing.
    #[arg(long, value_name = "FILE", default_value = "model.toml")]
    pub model: PathBuf,
}

/// Options of `krait calibrate friction`.
#[derive(Clone, Debug, Args)]
pub struct FrictionArgs {
    #[command(flatten)]
    pub files: Files,
    /// Standard deviation of the scale, g.
    #[arg(long, value_name = "G", default_value_t = 25.0)]
    pub scale_sd_g: f64,
    /// Standard deviation of a weight, g.
    #[arg(long, value_name = "G", default_value_t = 1.0)]
    pub weight_sd_g: f64,
    /// Fit the scale's zero as well.
    #[arg(long)]
    pub free_zero: bool,
}

/// Options of `krait calibrate play`.
#[derive(Clone, Debug, Args)]
pub struct PlayArgs {
    #[command(flatten)]
    pub files: Files,
    /// Standard deviation of the dial, um.
    #[arg(long, value_name = "UM", default_value_t = 10.0)]
    pub dial_sd_um: f64,
    /// Have the drives of the configuration (`--config`) moved by this command, actuator by actuator, through the slave's own limiter and
    /// watchdog, instead of by you. It asks first; every line must be off the snake.
    #[arg(long)]
    pub drives: bool,
}

/// Options of `krait calibrate photo`.
#[derive(Clone, Debug, Args)]
pub struct PhotoArgs {
    /// Table of clicked points.
    #[arg(value_name = "CLICKS")]
    pub clicks: PathBuf,
    /// Table of bends; printed only if it is not given.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Overwrite that table if it is already there.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Standard deviation of a clicked edge in each coordinate, px.
    #[arg(long, value_name = "PX", default_value_t = 0.5)]
    pub click_sd_px: f64,
}

/// Options of `krait calibrate poses`.
#[derive(Clone, Debug, Args)]
pub struct PosesArgs {
    #[command(flatten)]
    pub files: Files,
    /// Standard deviation of each component of a measured bend vector, deg.
    #[arg(long, value_name = "DEG", default_value_t = 1.0)]
    pub sd_deg: f64,
    /// Table of bends that `krait calibrate photo --out` writes: each pose then takes the name of its pictures, and the bend and its
    /// standard errors from the table. At the first run there is none yet; the same command again, behind `photo`, fits.
    #[arg(long, value_name = "FILE", conflicts_with = "sd_deg")]
    pub bends: Option<PathBuf>,
    /// One camera sees the bend from one side: in each of these planes (0 to less than 180 deg, one that every line moves in; 0 if none is
    /// given) and the one across from it the same bends are gone through, with the robot or the camera turned so that the picture shows the
    /// plane, and of each bend its component in the picture is taken. The check is in the first plane.
    #[arg(long, value_name = "DEG,...", num_args = 0..=1, value_delimiter = ',', default_missing_value = "0")]
    pub front: Option<Vec<f64>>,
    /// The largest bend of the plan, deg, 76 at most: beyond the largest that is measured, so that every line turns. By default 76, and with
    /// --chain what the chain's limits allow.
    #[arg(long, value_name = "DEG")]
    pub largest_deg: Option<f64>,
    /// Have the machine of the configuration (`--config`; simulated drives without one) moved from pose to pose by a chain of krait's own
    /// processes, instead of by you; the bend is then read from the chain's shape channel. It asks first. With `--truth` alone, without
    /// this, you practise on a simulated snake: it moves, shows its bend, and you type what you see.
    #[arg(long)]
    pub chain: bool,
    /// Type the bends of a chain that moves the machine.
    #[arg(long, requires = "chain")]
    pub typed: bool,
    /// Move without asking. Real drives are asked about always.
    #[arg(long, requires = "chain")]
    pub engage: bool,
    /// Record the chain into this file; it is not recorded without.
    #[arg(long, value_name = "FILE", requires = "chain")]
    pub recording: Option<PathBuf>,
    #[command(flatten)]
    pub guide: GuideArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
}

impl PosesArgs {
    /// Planes of pictures from one side, deg; none if both components of a bend are seen.
    pub fn front_deg(&self) -> &[f64] {
        self.front.as_deref().unwrap_or_default()
    }
}

/// Options of `krait calibrate stem`.
#[derive(Clone, Debug, Args)]
pub struct StemArgs {
    /// Model and data.
    #[command(flatten)]
    pub files: LabFiles,
    /// Model file with the values; printed only if it is not given.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Overwrite that file if it is already there.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Standard deviation of a load cell, N.
    #[arg(long, value_name = "N", default_value_t = 0.1)]
    pub cell_sd_n: f64,
    /// Standard deviation of each component of a measured bend vector, deg; for rows that do not state their own.
    #[arg(long, value_name = "DEG", default_value_t = 1.0)]
    pub bend_sd_deg: f64,
    /// Standard deviation of an encoder, with all that moves it alike while a reading lasts, um.
    #[arg(long, value_name = "UM", default_value_t = 5.0)]
    pub encoder_sd_um: f64,
}
