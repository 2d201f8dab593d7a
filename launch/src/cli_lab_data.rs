//! The command line of generated data: `krait lab generate` and `krait lab benchmark`.

use clap::Args;
use krait_lab_benchmark::benchmark::Group;
use krait_lab_benchmark::generate::{Difficulty, Motion, NoiseKind};
use std::path::PathBuf;

/// Options of `krait lab generate`.
#[derive(Clone, Debug, Args)]
pub struct GenerateArgs {
    /// Of so many snakes in series, 2 or 3, instead of one snake.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=3))]
    pub segments: Option<u8>,
    /// What is hidden: a kind, two joined by `+`, or none; without it the seed picks one. --list shows all.
    #[arg(long, value_name = "NAME[+NAME]")]
    pub kind: Option<String>,
    /// How large: root mean square of what the effect changes in the picture, in units of the noise's length sqrt(2) sigma,
    /// of n segments sqrt(2 n) sigma; one for all, or one for each by commas.
    #[arg(long, value_delimiter = ',', default_value = "2", value_name = "X[,X]")]
    pub size: Vec<f64>,
    /// white, ou:T (half white, half with a correlation time of T s), quantised, outliers, heteroscedastic or drift.
    #[arg(long, default_value = "white", value_parser = noise)]
    pub noise: NoiseKind,
    /// Standard deviation of each component of the bend vector, degrees.
    #[arg(long, default_value_t = 0.3, value_name = "DEG")]
    pub sigma_deg: f64,
    /// Record the loads at the actuators too (tau1_n and so on, one for each line), with white noise of this standard deviation, N.
    #[arg(long, value_name = "N")]
    pub load_sigma_n: Option<f64>,
    /// rich, teleop, ramp, triangle, multisine or staircase.
    #[arg(long, default_value = "rich", value_parser = motion)]
    pub trajectory: Motion,
    /// Length, s.
    #[arg(long, default_value_t = 200.0)]
    pub seconds: f64,
    /// Rows per second, Hz.
    #[arg(long, default_value_t = 50.0, value_name = "HZ")]
    pub rate: f64,
    /// The camera sees every so many rows; the rows between hold encoders alone.
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub every: u16,
    /// Everything that is drawn follows from it; without it, from the clock, and the answer tells it.
    #[arg(long)]
    pub seed: Option<u64>,
    /// The plant's dimensions and modulus are off by up to this part, 0 to 0.1.
    #[arg(long, default_value_t = 0.0, value_name = "PART", conflicts_with = "segments")]
    pub perturb: f64,
    /// Where to write the data (CSV); base.toml and the hashes go beside it.
    #[arg(long, value_name = "FILE", required_unless_present = "list")]
    pub out: Option<PathBuf>,
    /// Overwrite files that are already there.
    #[arg(long)]
    pub force: bool,
    /// Where to write the sealed answer (JSON); by default beside the data as NAME.answer.json.
    #[arg(long, value_name = "FILE")]
    pub answer: Option<PathBuf>,
    /// Also write the plant that made the data, for `krait run --truth`; it gives the answer away.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Print every kind that can be hidden, and make nothing.
    #[arg(long)]
    pub list: bool,
    /// Print what was written as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait lab quiz`.
#[derive(Clone, Debug, Args)]
pub struct QuizArgs {
    /// Where to write the data (CSV); base.toml, the sealed answer and the hashes go beside it.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// easy, medium or hard: the hidden effect is four times the noise, twice, or as large.
    #[arg(long, default_value = "easy", value_parser = difficulty)]
    pub level: Difficulty,
    /// On simulated segments in series instead of the snake: 2 (also if no number is given) or 3; the effect may be of all or of one,
    /// and where it cannot be as large as the level says it is as large as it can be.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "2", value_parser = clap::value_parser!(u8).range(2..=3))]
    pub segments: Option<u8>,
    /// The riddle of this number; without it, one from the clock.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Where to write the sealed answer (JSON); by default beside the data as NAME.answer.json.
    #[arg(long, value_name = "FILE")]
    pub answer: Option<PathBuf>,
    /// Overwrite files that are already there.
    #[arg(long)]
    pub force: bool,
    /// Print what was written as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait lab check`.
#[derive(Clone, Debug, Args)]
pub struct CheckArgs {
    /// Data of `krait lab quiz` or `krait lab generate` (CSV); the hashes lie beside it.
    #[arg(long, value_name = "FILE")]
    pub data: PathBuf,
    /// What is hidden: the name of an effect, several joined by `+`.
    #[arg(long, value_name = "NAME[+NAME]", required_unless_present = "give_up")]
    pub guess: Option<String>,
    /// Tell the answer.
    #[arg(long)]
    pub give_up: bool,
    /// The sealed answer, if it is not beside the data.
    #[arg(long, value_name = "FILE")]
    pub answer: Option<PathBuf>,
    /// Print the judgement as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// A machine of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BenchmarkMachine {
    /// The simulated snake.
    Snake,
    /// Two simulated joints.
    Joints,
    /// One simulated joint with its torque.
    Force,
    /// Two or three simulated snakes in series.
    Segments,
}

/// Options of `krait lab benchmark`.
#[derive(Clone, Debug, Args)]
pub struct BenchmarkArgs {
    /// Where results.jsonl and report.html go; results that are there already are kept and not computed again.
    #[arg(long, value_name = "DIR", default_value = "benchmark")]
    pub out: PathBuf,
    /// Whose data: the simulated snake's, two simulated joints', a joint's with its torque, or those of two and three segments.
    #[arg(long, value_enum, default_value_t = BenchmarkMachine::Snake)]
    pub machine: BenchmarkMachine,
    /// Rounds of the grid, some hundred sets of data each.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub rounds: u16,
    /// Only sets of these groups: none, single, pair, several, outside, beside, off-base, poor; the other sets stay as they are.
    #[arg(long, value_name = "GROUP,...", value_delimiter = ',', value_parser = group)]
    pub groups: Vec<Group>,
    /// Everything that is drawn follows from it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Length of each set of data, s.
    #[arg(long, default_value_t = 200.0)]
    pub seconds: f64,
    /// Leave the baselines out; they take about as long as the diagnoses.
    #[arg(long)]
    pub no_baselines: bool,
    /// Print the figures as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

fn noise(text: &str) -> Result<NoiseKind, String> {
    NoiseKind::from_name(text)
        .ok_or_else(|| format!("{text:?} is none of white, ou:T, quantised, outliers, heteroscedastic, drift"))
}

fn group(text: &str) -> Result<Group, String> {
    let words = Group::ALL.map(Group::word).join(", ");
    Group::from_word(text).ok_or_else(|| format!("{text:?} is none of {words}"))
}

fn motion(text: &str) -> Result<Motion, String> {
    let names = Motion::ALL.map(Motion::name).join(", ");
    Motion::ALL.into_iter().find(|motion| motion.name() == text).ok_or_else(|| format!("{text:?} is none of {names}"))
}

fn difficulty(text: &str) -> Result<Difficulty, String> {
    let names = Difficulty::ALL.map(Difficulty::name).join(", ");
    Difficulty::ALL.into_iter().find(|own| own.name() == text).ok_or_else(|| format!("{text:?} is none of {names}"))
}
