//! The command line of `krait model`.

use clap::{Args, Subcommand};
use krait_lab::read::Mapping;
use std::path::PathBuf;

/// What to do with a model file.
#[derive(Clone, Debug, Subcommand)]
pub enum ModelVerb {
    /// Prints a model file with every value, its unit, range, default and source; without a file the one that `krait run` takes.
    #[command(
        after_help = "Examples:\n  krait model show\n  krait model show better.toml\n  krait model show naive\n  krait model show --defaults > every-effect.toml"
    )]
    Show(ModelShowArgs),
    /// Checks a model file; exit code 1 and one sentence with line and key where it is refused.
    #[command(after_help = "Examples:\n  krait model check better.toml\n  krait model check better.toml --json")]
    Check(ModelFileArgs),
    /// Writes what a chain has learnt while it moved, as its recording holds it, into a model file.
    #[command(after_help = "Example:\n  krait model save-learnt recordings/run.mcap --out learnt.toml")]
    SaveLearnt(SaveLearntArgs),
    /// Turns a table of setpoints into a table of commands, for a controller that krait does not drive.
    #[command(
        after_help = "Examples:\n  krait model compensate better.toml --in setpoints.csv --out commands.csv\n  krait model compensate docs/joints/wrist.toml --in wrist.csv --out commands.csv\n\nColumns of a snake: time_s, bend_x_rad, bend_y_rad (or _deg); of segments: time_s, bend1_rad, plane1_rad, bend2_rad ... (or _deg); of joints: time_s, y1_<unit>, y2_<unit> ... in the model's unit or any other of the same quantity. Stamps since 1970 are counted from the first row"
    )]
    Compensate(CompensateArgs),
    /// Lets a chain that runs go on with another model file of the same machine; it holds still until the operator takes hold anew.
    ///
    /// The recording ends and another one begins beside it (run-model2.mcap), so that each can be verified.
    #[command(
        after_help = "Examples:\n  krait model exchange better.toml\n  krait model exchange better.toml --instance left-arm --json"
    )]
    Exchange(ExchangeArgs),
}

/// Options of `krait model exchange`.
#[derive(Clone, Debug, Args)]
pub struct ExchangeArgs {
    /// The model file (TOML).
    #[arg(value_name = "FILE")]
    pub model: PathBuf,
    /// Print what was done as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait model compensate`.
#[derive(Clone, Debug, Args)]
pub struct CompensateArgs {
    /// The model file (TOML), or the name of a built-in one: off, naive, estimated.
    #[arg(value_name = "MODEL")]
    pub model: PathBuf,
    /// The table of setpoints: a time and a position in each row; CSV in any dialect, Parquet or a MATLAB file of level 5.
    #[arg(long = "in", value_name = "FILE")]
    pub setpoints: PathBuf,
    /// The file's own name and unit for a column, again for each: y1_rad=Jaw:deg.
    #[arg(long = "map", value_name = "COLUMN=NAME[:UNIT]")]
    pub map: Vec<Mapping>,
    /// The new table: time, setpoints and commands.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite a file that is already there.
    #[arg(long)]
    pub force: bool,
    /// Print what was written as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait model save-learnt`.
#[derive(Clone, Debug, Args)]
pub struct SaveLearntArgs {
    /// The recording; the last chain in it counts.
    #[arg(value_name = "RECORDING")]
    pub recording: PathBuf,
    /// The new model file.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite a file that is already there.
    #[arg(long)]
    pub force: bool,
    /// Print what was saved as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait model show`.
#[derive(Clone, Debug, Args)]
pub struct ModelShowArgs {
    /// The model file (TOML), or the name of a built-in one: off, naive, estimated. By default the one that `krait run` takes.
    pub file: Option<PathBuf>,
    /// Print every effect that there is with its defaults instead.
    #[arg(long, conflicts_with_all = ["file", "json"])]
    pub defaults: bool,
    /// Print the model as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait model check`.
#[derive(Clone, Debug, Args)]
pub struct ModelFileArgs {
    /// The model file (TOML).
    pub file: PathBuf,
    /// Print the outcome as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}
