//! The command line of `krait experiment`.

use crate::cli_guide::GuideArgs;
use crate::cli_machine::MachineArgs;
use crate::in_force::Compensation;
use clap::{Args, Subcommand, ValueEnum};
use krait_paper::experiment::{ApproachSide, Before};
use std::path::PathBuf;

/// The experiments.
#[derive(Clone, Debug, Subcommand)]
pub enum ExperimentVerb {
    /// Fig. 10: bends in the plane delta = 0, up and back.
    #[command(
        after_help = "Examples:\n  krait experiment fig10 --engage\n  krait experiment fig10 --engage --step 5 --compensation naive --compensation estimated\n  krait experiment fig10 --config robot.toml --to 60 --shape external\n  krait experiment fig10 --from recordings/experiment.mcap"
    )]
    Fig10(Fig10Args),
    /// Fig. 11: one bend in every plane, turning without a return and each plane from straight.
    #[command(
        after_help = "Examples:\n  krait experiment fig11 --engage\n  krait experiment fig11 --engage --bend 60 --protocol turn --step 10\n  krait experiment fig11 --from recordings/experiment.mcap"
    )]
    Fig11(Fig11Args),
    /// Fig. 12: single poses, each from straight.
    #[command(
        after_help = "Examples:\n  krait experiment poses --engage\n  krait experiment poses --engage --poses mine.csv --model better.toml\n  krait experiment poses --from recordings/experiment.mcap"
    )]
    Poses(ExperimentPosesArgs),
}

/// Options of `krait experiment fig10`.
#[derive(Clone, Debug, Args)]
pub struct Fig10Args {
    /// Spacing of the bends, deg.
    #[arg(long, value_name = "DEG", default_value_t = 10.0)]
    pub step: f64,
    /// Largest bend, deg.
    #[arg(long, value_name = "DEG", default_value_t = 80.0)]
    pub to: f64,
    /// What every experiment has.
    #[command(flatten)]
    pub run: ExperimentArgs,
}

/// Options of `krait experiment fig11`.
#[derive(Clone, Debug, Args)]
pub struct Fig11Args {
    /// The bend, deg.
    #[arg(long, value_name = "DEG", default_value_t = 30.0)]
    pub bend: f64,
    /// How the planes are reached.
    #[arg(long, value_enum, value_name = "WHICH", default_value_t = TurnProtocol::Both)]
    pub protocol: TurnProtocol,
    /// Spacing of the planes, deg.
    #[arg(long, value_name = "DEG", default_value_t = 30.0)]
    pub step: f64,
    /// What every experiment has.
    #[command(flatten)]
    pub run: ExperimentArgs,
}

/// How the planes of Fig. 11 are reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TurnProtocol {
    /// Bent at delta = 0, then turned once without a return.
    Turn,
    /// Each plane bent from straight.
    FromStraight,
    /// First the one, then the other.
    Both,
}

/// Options of `krait experiment poses`.
#[derive(Clone, Debug, Args)]
pub struct ExperimentPosesArgs {
    /// List of poses (CSV with the columns bend_deg,delta_deg); by default those of `krait paper`'s Fig. 12 up to 80 deg.
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// What every experiment has.
    #[command(flatten)]
    pub run: ExperimentArgs,
}

/// Options of every experiment.
#[derive(Clone, Debug, Args)]
pub struct ExperimentArgs {
    /// A built-in model to run with, a pass each (`krait model show NAME`); may be given several times. By default all three.
    #[arg(long, value_enum, value_name = "NAME")]
    pub compensation: Vec<Compensation>,
    /// A model file (TOML) to run with, after the built-in ones that are named.
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Move without asking. Real drives are asked about always.
    #[arg(long)]
    pub engage: bool,
    /// Draw again from the recording of an experiment; nothing moves.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["compensation", "model", "engage", "recording", "truth", "slave", "shape"])]
    pub from: Option<PathBuf>,
    /// From which side play is taken up whenever the snake sets out from straight.
    #[arg(long, value_enum, value_name = "SIDE", default_value_t = SideChoice::Below)]
    pub side: SideChoice,
    /// Bend by which it is, deg.
    #[arg(long, value_name = "DEG", default_value_t = 20.0)]
    pub take_up_deg: f64,
    /// How often a model that learns is led through three planes to learn from, before the first pose.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub learning_rounds: u32,
    /// How it is led.
    #[command(flatten)]
    pub guide: GuideArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
    /// Where to write the recording; by default recordings/DATE-experiment.mcap.
    #[arg(long, value_name = "FILE")]
    pub recording: Option<PathBuf>,
    /// Folder for the pictures, the page (index.html) and the table of poses (poses.csv); made if it is missing.
    #[arg(long, value_name = "DIR", default_value = "experiment-pages")]
    pub out: PathBuf,
    /// Print the outcome as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

impl ExperimentArgs {
    /// What comes before the poses.
    pub fn before(&self) -> Before {
        Before { side: self.side.into(), take_up_deg: self.take_up_deg, n_learning_rounds: self.learning_rounds }
    }
}

/// From which side play is taken up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SideChoice {
    /// The snake bends the other way first and comes up through straight: every line already moves as it will.
    Below,
    /// It bends this way first and comes back to straight: every line turns round there.
    Above,
    /// Not at all: it sets out as homing left it.
    None,
}

impl From<SideChoice> for ApproachSide {
    fn from(choice: SideChoice) -> Self {
        match choice {
            SideChoice::Below => Self::Below,
            SideChoice::Above => Self::Above,
            SideChoice::None => Self::None,
        }
    }
}
