//! The command line: subcommands, their options and their examples.

use crate::cli_bench::{BenchArgs, FaultArgs, YardstickVerb};
use crate::cli_calibrate::CalibrateVerb;
use crate::cli_console::{ConsoleArgs, WatchArgs};
use crate::cli_devices::DevicesArgs;
use crate::cli_drives::DrivesArgs;
use crate::cli_experiment::ExperimentVerb;
use crate::cli_lab::LabVerb;
use crate::cli_model::ModelVerb;
use crate::cli_process::ProcessVerb;
use crate::cli_replay::{CompareArgs, ReplayArgs};
use crate::cli_run::RunArgs;
use clap::{Args, Parser, Subcommand, ValueEnum};
use krait_slave::DriveKind;
use std::path::PathBuf;

/// krait: a teleoperation bridge for snake-like surgical robots.
///
/// Without a subcommand it shows the whole chain at work: `krait demo`.
#[derive(Debug, Parser)]
#[command(name = "krait", version, propagate_version = true, subcommand_required = false)]
#[command(
    after_help = "Examples:\n  krait                                   the demo, under a minute\n  krait run --master hid                  drive the simulated snake with a SpaceMouse\n  krait run --engage --compensation off   feel what the lines do to the motion\n  krait devices                           which hand controllers are there"
)]
pub struct Cli {
    /// Options of every subcommand.
    #[command(flatten)]
    pub common: Common,
    /// What to do; nothing means the demo.
    #[command(subcommand)]
    pub verb: Option<Verb>,
}

/// The chain that is meant where none is named.
pub const DEFAULT_INSTANCE: &str = "main";

/// Options of every subcommand.
#[derive(Clone, Debug, Args)]
pub struct Common {
    /// Configuration file (TOML); without it the defaults count, which `krait config` prints.
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Name of the chain, so that several can run on one machine.
    #[arg(long, global = true, value_name = "NAME", default_value = DEFAULT_INSTANCE)]
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
        after_help = "Examples:\n  krait run --engage\n  krait run --master hid --compensation estimated\n  krait run --master browser\n  krait run --master pose --listen 127.0.0.1:5005\n  krait run --engage --master script --input path.csv --seconds 30\n  krait run --engage --truth stiff.toml --recording runs/stiff.mcap\n  krait run --engage --model better.toml\n  krait run --engage --rotate-mb 500 --rotate-s 3600"
    )]
    Run(RunArgs),
    /// The hand controllers on this machine, and what is missing to use them.
    #[command(
        after_help = "Examples:\n  krait devices\n  krait devices --profile my-pedal.toml\n  krait devices --profile mouse --node /dev/input/event4\n  krait devices --write-udev 70-krait.rules\n  krait devices --live --node /dev/input/event5\n  krait devices --calibrate my-stick.toml --node /dev/input/event5\n  krait devices --json"
    )]
    Devices(DevicesArgs),
    /// The actuators on this machine's serial buses; their zeros, single steps, directions, and an emulated bus to try krait without any.
    #[command(
        after_help = "Examples:\n  krait drives\n  krait drives --watch\n  krait drives --zero --config krait.toml --out zeroed.toml\n  krait drives --jog 1 --config krait.toml\n  krait drives --calibrate --config krait.toml --out calibrated.toml\n  krait drives --emulate 3"
    )]
    Drives(DrivesArgs),
    /// The paper's tables and figures again, beside the printed values, and its errors with the numbers that show them.
    #[command(
        after_help = "Examples:\n  krait paper\n  krait paper --out /tmp/paper\n  krait paper --json | jq .verdict"
    )]
    Paper(PaperArgs),
    /// The paper's experiments on a chain of real processes, simulated snake or robot, and its figures from the recording.
    #[command(subcommand)]
    Experiment(ExperimentVerb),
    /// Sends a recording's input through freshly started processes: are setpoints and commands the same, bit for bit?
    ///
    /// Exit code 0: identical; 1: the first difference is shown with sample, field, both values, process and versions;
    /// 2: the recording cannot be repeated.
    #[command(
        after_help = "Examples:\n  krait verify recordings/demo.mcap\n  krait verify recordings/demo.mcap --json"
    )]
    Verify(VerifyArgs),
    /// Plays a recording, or a trajectory from a table, through the real processes to the simulated snake or a drive.
    ///
    /// Into the simulated snake the recording's own time passes, at any speed, and the result is the same at every speed.
    /// With --real-time the machine's clock counts, as it does for every drive that is not simulated: approach to the start,
    /// ease-in, and all of the slave's own limits. Lines on standard input: `pause`, `resume`, `stop`; with --step an empty
    /// line is the next sample. Ctrl-C comes to rest and ends.
    #[command(
        after_help = "Examples:\n  krait replay recordings/demo.mcap --pass 3 --speed max\n  krait replay run.mcap --model better.toml --speed max\n  krait replay run.mcap --from 5 --to 12 --loops 3 --speed 4\n  krait replay run.mcap --step\n  krait replay circle.csv --real-time --engage --speed 0.5\n\nWhile it runs it takes the lines pause, resume and stop on standard input; Ctrl-C is a stop: it comes to rest, ends its recording and exits with 0."
    )]
    Replay(ReplayArgs),
    /// Lays two recordings side by side: tracking error, latency of each hop, states and faults.
    #[command(
        after_help = "Examples:\n  krait compare before.mcap after.mcap\n  krait compare demo.mcap demo.mcap --pass-a 1 --pass-b 3 --out compare\n  krait compare run.mcap replay.mcap --json"
    )]
    Compare(CompareArgs),
    /// Stops the snake of a chain that runs, at once and from anywhere; it stays paused until it is told to go on.
    ///
    /// Exit code 0: the actuators stand still; 1: nobody has acknowledged the stop; 2: no chain runs.
    #[command(after_help = "Examples:\n  krait stop\n  krait stop --instance left-arm")]
    Stop,
    /// Shows the operating state of a chain that runs and what keeps the snake from moving, or asks for another state.
    #[command(
        after_help = "Examples:\n  krait state\n  krait state --json\n  krait state pause\n  krait state resume\n  krait state home --instance left-arm\n  krait state --scale 0.5\n  krait state --lock translation"
    )]
    State(StateArgs),
    /// The page of a chain that runs, or of a recording: the snake, its latency, the lab; in a browser on this machine.
    #[command(
        after_help = "Examples:\n  krait console\n  krait console recordings/demo.mcap\n  krait console --instance left-arm --port 8080\n\nOpen the address that it prints. It listens on this machine only. From elsewhere an SSH tunnel of both its ports, the page's and the stop's, is the way:\n  krait console --port 8080 --stop-port 8081\n  ssh -L 8080:127.0.0.1:8080 -L 8081:localhost:8081 HOST"
    )]
    Console(ConsoleArgs),
    /// The same glance in a terminal of 80 columns: state, error, plane, latency, losses, recording, marks.
    ///
    /// Keys: s or space stops the snake, p pauses it, m sets a mark at that instant, q ends the watch and nothing else.
    /// Where it does not write to a terminal it says the same once a second.
    #[command(after_help = "Examples:\n  krait watch\n  krait watch --instance left-arm\n  krait watch --once")]
    Watch(WatchArgs),
    /// Publishes measured shapes of another program, which come line by line on standard input (docs/shapes.md).
    ///
    /// The chain must leave the channel to it: `krait run --shape external`. What is stale, late, out of order, missing,
    /// outlying or malformed is counted and named; motion is not affected.
    #[command(
        after_help = "Examples:\n  my-vision-program | krait shape\n  my-vision-program | krait shape --instance left-arm --json"
    )]
    Shape(ShapeArgs),
    /// Sets a mark in the recording of a chain that runs: a word about this instant.
    #[command(after_help = "Examples:\n  krait mark vessel touched\n  krait mark \"2nd try\" --instance left-arm")]
    Mark(MarkArgs),
    /// Makes a whole recording of what a killed recorder or a damaged disk has left, and says what was saved.
    #[command(
        after_help = "Examples:\n  krait recover recordings/run.mcap\n  krait recover broken.mcap --out saved.mcap --json"
    )]
    Recover(RecoverArgs),
    /// A recording's measurements as a table: encoders, loads and the camera's shape, a row per encoder sample.
    #[command(
        after_help = "Examples:\n  krait export recordings/demo.mcap --out demo.csv\n  krait export recordings/demo.mcap --format parquet --out demo.parquet --json"
    )]
    Export(ExportArgs),
    /// From a real robot to a model file: friction, play, photographs, guided poses, each a dialogue that can be taken up again.
    #[command(subcommand)]
    Calibrate(CalibrateVerb),
    /// The model lab: compares a model with measurements, names the missing effect, adds it.
    #[command(subcommand)]
    Lab(LabVerb),
    /// Prints or checks a model file.
    #[command(subcommand)]
    Model(ModelVerb),
    /// Latency of the chain beside the floor of this machine and beside other ways to pass a message, in one run.
    #[command(
        after_help = "Examples:\n  krait bench\n  krait bench --seconds 60 --rounds 20 --out runs/quiet\n  krait bench --chains floor-futex,krait --rate 8000 --json\n  krait bench --growth --rounds 3\n  krait bench --priority 80 --cores 2,3 --wait polling"
    )]
    Bench(BenchArgs),
    /// What this machine lacks for a punctual chain, what that means, how to mend it, and how late it wakes a process.
    #[command(after_help = "Examples:\n  krait doctor\n  krait doctor --seconds 60\n  krait doctor --seconds 0 --json")]
    Doctor(DoctorArgs),
    /// Breaks simulated chains on purpose, one fault each, and says whether each ends as it must.
    ///
    /// Each fault has a chain of its own, in instances that nobody else has; no chain that runs is touched. The table says
    /// for each fault what must become of the snake and what did, the largest step of the drive command as a part of what
    /// the time since the write before allows (at most 1), how long it took to rest, and what names the fault.
    /// Exit code 0: every fault ends as it must; 1: one does not; 2: the faults could not be tried.
    #[command(
        after_help = "Examples:\n  krait fault --all\n  krait fault burst killed-slave\n  krait fault killed-resolve stalled-slave --repeat 100\n  krait fault --all --json"
    )]
    Fault(FaultArgs),
    /// Parts of `krait bench` and `krait fault` that are processes of their own.
    #[command(subcommand, hide = true)]
    Yardstick(YardstickVerb),
    /// Prints the configuration that is in force, as TOML with every key.
    #[command(after_help = "Example:\n  krait config > krait.toml")]
    Config,
    /// One process of the chain (the supervisor starts these).
    #[command(flatten)]
    Process(ProcessVerb),
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

/// Where the operator's motion comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MasterKind {
    /// A hand controller on this machine.
    Hid,
    /// A recording of raw reports.
    Replay,
    /// A script of tip velocities (CSV).
    Script,
    /// The drive pad of the console's page: pointer, touch, keyboard or gamepad; simulated drives only.
    Browser,
    /// A program that sends poses of a hand by UDP (docs/pose.md).
    Pose,
    /// The guide of `krait experiment`.
    #[value(hide = true)]
    Guide,
}

/// How often a recording or script engages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EngageKind {
    /// Where it says that the operator takes hold.
    Once,
    /// And after every stall, fault or restart, as a person would.
    Again,
}

impl EngageKind {
    /// The word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Once => "once",
            Self::Again => "again",
        }
    }
}

/// Who measures the shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShapeKind {
    /// The drive's own camera, where it has one.
    Camera,
    /// Another program, through `krait shape`.
    External,
}

/// The drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SlaveKind {
    /// Simulated drives.
    Sim,
    /// The Feetech STS3215 servos that the configuration describes (docs/drives.md).
    Sts3215,
    /// The ROBOTIS Dynamixel XL330 servos that the configuration describes (docs/drives.md).
    Xl330,
    /// The CANopen drives of the profile CiA 402 that the configuration describes (docs/drives.md).
    Cia402,
}

impl SlaveKind {
    /// The same as the configuration says it.
    pub fn kind(self) -> DriveKind {
        match self {
            Self::Sim => DriveKind::Sim,
            Self::Sts3215 => DriveKind::Sts3215,
            Self::Xl330 => DriveKind::Xl330,
            Self::Cia402 => DriveKind::Cia402,
        }
    }
}

/// Options of `krait doctor`.
#[derive(Clone, Debug, Args)]
pub struct DoctorArgs {
    /// How long to measure the lateness of wake-ups, s; 0: not at all.
    #[arg(long, default_value_t = 10.0)]
    pub seconds: f64,
    /// Print the findings as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait paper`.
#[derive(Clone, Debug, Args)]
pub struct PaperArgs {
    /// Folder for the pictures (SVG) and the page (index.html); made if it is missing.
    #[arg(long, value_name = "DIR", default_value = "paper-pages")]
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

/// Options of `krait state`.
#[derive(Clone, Debug, Args)]
pub struct StateArgs {
    /// What to ask the chain's supervisor for; nothing: only show the state.
    #[arg(value_enum)]
    pub ask: Option<Ask>,
    /// How fast the tip goes for a motion of the hand, as a part of the configured speed, 0.01 to 1; the snake stays where it is.
    #[arg(long, value_name = "PART")]
    pub scale: Option<f64>,
    /// Take no translation, or no rotation, from the hand any more.
    #[arg(long, value_enum, value_name = "WHAT")]
    pub lock: Option<Lock>,
    /// Take it again.
    #[arg(long, value_enum, value_name = "WHAT")]
    pub unlock: Option<Lock>,
    /// Print the state as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// What of the hand's motion can be locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lock {
    /// Motion of the tip along a line; all that a snake of three lines can do.
    Translation,
    /// Turning of the tip.
    Rotation,
}

/// What can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Ask {
    /// Power on: DISABLED or FAULT to ENABLED.
    Enable,
    /// Power off.
    Disable,
    /// Power on, no motion: ENABLED to PAUSED.
    Pause,
    /// PAUSED to ENABLED; the operator must engage anew.
    Resume,
    /// Let the actuators find their zero.
    Home,
    /// Let them forget their zero.
    Unhome,
    /// FAULT to DISABLED, once the drives answer again.
    ClearFault,
}

/// Options of `krait shape`.
#[derive(Clone, Debug, Args)]
pub struct ShapeArgs {
    /// Print what became of the lines as JSON on standard output at the end.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait mark`.
#[derive(Clone, Debug, Args)]
pub struct MarkArgs {
    /// The words, 1 to 240 bytes.
    #[arg(value_name = "TEXT", required = true)]
    pub text: Vec<String>,
}

/// Options of `krait recover`.
#[derive(Clone, Debug, Args)]
pub struct RecoverArgs {
    /// The recording; it is only read.
    #[arg(value_name = "FILE")]
    pub recording: PathBuf,
    /// The new file; by default FILE with the ending `.recovered.mcap`. An existing file is never overwritten.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print what was saved as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait export`.
#[derive(Clone, Debug, Args)]
pub struct ExportArgs {
    /// The recording.
    #[arg(value_name = "FILE")]
    pub recording: PathBuf,
    /// How the table is written.
    #[arg(long, value_enum, default_value_t = ExportFormat::Csv)]
    pub format: ExportFormat,
    /// The table; an existing file is never overwritten.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Only the gripper's jaw, as one joint that `krait lab` reads: the wire u1_m, the jaw y1_rad, the wire's load tau1_n.
    #[arg(long)]
    pub jaw: bool,
    /// Print what was exported as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// How a table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// Comma-separated values with a header.
    Csv,
    /// Apache Parquet, for data tools.
    Parquet,
}
