//! The command line: subcommands, their options and their examples.

use clap::{Args, Parser, Subcommand, ValueEnum};
use krait_ipc::message::Compensation;
use std::path::PathBuf;

/// krait: a teleoperation bridge for snake-like surgical robots.
///
/// Without a subcommand it shows the whole chain at work: `krait demo`.
#[derive(Debug, Parser)]
#[command(name = "krait", version, propagate_version = true, subcommand_required = false)]
#[command(
    after_help = "Examples:\n  krait                                   the demo, under a minute\n  krait run --master hid                  drive the simulated snake with a SpaceMouse\n  krait run --compensation off            feel what the lines do to the motion\n  krait devices                           which hand controllers are there"
)]
pub struct Cli {
    /// Options of every subcommand.
    #[command(flatten)]
    pub common: Common,
    /// What to do; nothing means the demo.
    #[command(subcommand)]
    pub verb: Option<Verb>,
}

/// Options of every subcommand.
#[derive(Clone, Debug, Args)]
pub struct Common {
    /// Configuration file (TOML); without it the defaults count, which `krait config` prints.
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Name of the chain, so that several can run on one machine.
    #[arg(long, global = true, value_name = "NAME", default_value = "main")]
    pub instance: String,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// The main job on the simulated snake: the same recorded input three times (off, naive, estimated), and what it showed.
    #[command(
        after_help = "Examples:\n  krait demo\n  krait demo --json > demo.json\n  krait demo --seconds 24 --recording runs/today.mcap"
    )]
    Demo(DemoArgs),
    /// The chain until Ctrl-C: operator, bridge, actuators, recorder, each a process of its own.
    #[command(
        after_help = "Examples:\n  krait run\n  krait run --master hid --compensation estimated\n  krait run --master script --input path.csv --seconds 30\n  krait run --truth stiff.toml --recording runs/stiff.mcap\n  krait run --model better.toml"
    )]
    Run(RunArgs),
    /// The hand controllers on this machine, and what is missing to use them.
    #[command(after_help = "Example:\n  krait devices --json")]
    Devices(DevicesArgs),
    /// The paper's tables and figures again, beside the printed values, and its errors with the numbers that show them.
    #[command(
        after_help = "Examples:\n  krait paper\n  krait paper --out /tmp/paper\n  krait paper --json | jq .verdict"
    )]
    Paper(PaperArgs),
    /// Repeats every step of a recording: are setpoints and commands the same, bit for bit?
    #[command(after_help = "Example:\n  krait verify recordings/demo.mcap")]
    Verify(VerifyArgs),
    /// Prints or checks a model file.
    #[command(subcommand)]
    Model(ModelVerb),
    /// Prints the configuration that is in force, as TOML with every key.
    #[command(after_help = "Example:\n  krait config > krait.toml")]
    Config,
    /// One process of the chain (the supervisor starts these).
    #[command(flatten)]
    Process(Process),
}

impl Default for Verb {
    fn default() -> Self {
        Self::Demo(DemoArgs::default())
    }
}

/// Options of `krait demo`.
#[derive(Clone, Debug, Args)]
pub struct DemoArgs {
    /// Length of each of the three passes, s; the score counts from second 10 on.
    #[arg(long, default_value_t = DemoArgs::SECONDS)]
    pub seconds: f64,
    /// Where to write the recording; by default recordings/DATE-demo.mcap.
    #[arg(long, value_name = "FILE")]
    pub recording: Option<PathBuf>,
    /// Print the figures as JSON on standard output.
    #[arg(long)]
    pub json: bool,
    /// Truth of the simulated snake (TOML), with effects that the model lacks.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
}

impl DemoArgs {
    /// Three passes of this length, and their start and end, stay under a minute.
    const SECONDS: f64 = 17.0;
}

impl Default for DemoArgs {
    fn default() -> Self {
        Self { seconds: Self::SECONDS, recording: None, json: false, truth: None }
    }
}

/// Options of `krait run`.
#[derive(Clone, Debug, Args)]
pub struct RunArgs {
    /// Where the operator's motion comes from.
    #[arg(long, value_enum, default_value_t = MasterKind::Replay)]
    pub master: MasterKind,
    /// The report recording (replay) or the script to play; by default the shipped recording, over and over.
    #[arg(long, value_name = "FILE")]
    pub input: Option<PathBuf>,
    /// The drives.
    #[arg(long, value_enum, default_value_t = SlaveKind::Sim)]
    pub slave: SlaveKind,
    /// Truth of the simulated snake (TOML).
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// How q becomes q~.
    #[arg(long, value_parser = parse_compensation, value_name = "off|naive|estimated|model")]
    pub compensation: Option<Compensation>,
    /// Model file (TOML) whose chain of effects compensates; implies --compensation model.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Where to write the recording; by default recordings/DATE-run.mcap.
    #[arg(long, value_name = "FILE", conflicts_with = "no_recording")]
    pub recording: Option<PathBuf>,
    /// Do not record.
    #[arg(long)]
    pub no_recording: bool,
    /// End after this time, s; without it the chain runs until Ctrl-C.
    #[arg(long)]
    pub seconds: Option<f64>,
    /// Print the figures as JSON on standard output at the end.
    #[arg(long)]
    pub json: bool,
}

/// Where the operator's motion comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MasterKind {
    /// A hand controller on this machine.
    Hid,
    /// A recording of raw reports.
    Replay,
    /// A script of tip velocities (CSV).
    Script,
}

/// The drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SlaveKind {
    /// The simulated snake.
    Sim,
}

/// What to do with a model file.
#[derive(Clone, Debug, Subcommand)]
pub enum ModelVerb {
    /// Prints a model file with every value, its unit, range, default and source.
    #[command(
        after_help = "Examples:\n  krait model show better.toml\n  krait model show --defaults > every-effect.toml"
    )]
    Show(ModelShowArgs),
    /// Checks a model file; exit code 1 and one sentence with line and key where it is refused.
    #[command(after_help = "Examples:\n  krait model check better.toml\n  krait model check better.toml --json")]
    Check(ModelFileArgs),
}

/// Options of `krait model show`.
#[derive(Clone, Debug, Args)]
pub struct ModelShowArgs {
    /// The model file (TOML).
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

/// Options of `krait devices`.
#[derive(Clone, Debug, Args)]
pub struct DevicesArgs {
    /// Print the devices as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait paper`.
#[derive(Clone, Debug, Args)]
pub struct PaperArgs {
    /// Folder for the pictures (SVG) and the page (index.html); made if it is missing.
    #[arg(long, value_name = "DIR", default_value = "paper")]
    pub out: PathBuf,
    /// Truth of the simulated bench (TOML); by default that of the shipped snake under a camera of 1 deg.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Print the figures as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait verify`.
#[derive(Clone, Debug, Args)]
pub struct VerifyArgs {
    /// The recording.
    #[arg(value_name = "FILE")]
    pub recording: PathBuf,
    /// Print the verdict as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// The processes of the chain.
#[derive(Clone, Debug, Subcommand)]
pub enum Process {
    /// Reads the operator's device and publishes operator input.
    #[command(after_help = "Example:\n  krait master --source hid --record-reports hand.krr")]
    Master(MasterArgs),
    /// Turns operator input into a setpoint.
    Resolve,
    /// Turns the setpoint into actuator positions.
    Compensate,
    /// Learns the model's parameters from measured shape.
    Estimate,
    /// Writes the drives, reads the encoders.
    Slave,
    /// Writes every channel to an MCAP file.
    Record,
}

/// Options of `krait master`.
#[derive(Clone, Debug, Args)]
pub struct MasterArgs {
    /// Where the operator's motion comes from.
    #[arg(long = "source", value_enum, default_value_t = MasterKind::Replay)]
    pub kind: MasterKind,
    /// The report recording (replay) or the script to play.
    #[arg(long, value_name = "FILE")]
    pub input: Option<PathBuf>,
    /// Begin the recording or script anew when it ends.
    #[arg(long = "loop")]
    pub looped: bool,
    /// Also write every raw report to this file, to be replayed later.
    #[arg(long, value_name = "FILE")]
    pub record_reports: Option<PathBuf>,
}

fn parse_compensation(word: &str) -> Result<Compensation, String> {
    Compensation::ALL
        .into_iter()
        .find(|c| c.name() == word)
        .ok_or_else(|| format!("{word:?} is no compensation: expected off, naive, estimated or model"))
}
