//! The command line of the model lab: `krait lab ...`.

use crate::cli_lab_data::{BenchmarkArgs, CheckArgs, GenerateArgs, QuizArgs};
use clap::{Args, Subcommand};
use krait_lab::read::{ColumnMap, Mapping, ReadError};
use krait_lab::{CameraOffset, ClockOffset, Session};
use std::path::PathBuf;

/// The lab's subcommands.
#[derive(Debug, Subcommand)]
pub enum LabVerb {
    /// Looks at a file of any machine (CSV, Parquet, MATLAB, ROS 2 bag) and proposes which column is what, and a model file to begin with.
    #[command(
        after_help = "Examples:\n  krait lab init run.csv\n  krait lab init bag.mcap\n  krait lab init theirs.csv --map 'u1_deg=Motor A' --map 'y1_deg=Jaw'\n\nIt writes run.map.toml and run.model.toml beside the data and prints the next command. Columns may be separated by commas, semicolons or tabs, fractions begin with a point or a comma, units stand at the end of a name or in brackets, and times are in s, ms, us or ns, also since 1970."
    )]
    Init(InitArgs),
    /// How far are model and measurements apart, in which part, and where is it worst?
    #[command(
        after_help = "Examples:\n  krait lab compare --model base.toml --data run.csv\n  krait lab compare --model base.toml --data recordings/run.mcap --json | jq .error_deg\n  krait lab compare --model base.toml --data theirs.csv --map time_s=t --map bend_x_rad=cam.x:deg --map bend_y_rad=cam.y:deg"
    )]
    Compare(LabCompareArgs),
    /// Which physical effect is missing from the model? Ranks all of them, or says that none is, or that none explains it.
    #[command(
        after_help = "Examples:\n  krait lab diagnose --model base.toml --data run.csv --report why.html\n  krait lab diagnose --model base.toml --data recordings/run.mcap --json | jq .verdict"
    )]
    Diagnose(DiagnoseArgs),
    /// Adds an effect to a model, fits it, and shows the error before and after on data that it was not fitted to.
    #[command(
        after_help = "Examples:\n  krait lab add backlash --model base.toml --data run.csv --out better.toml\n  krait lab add creep --free a1,t1_s,a2 --set t2_s=90 --model base.toml --data run.csv --out better.toml\n  krait lab add formula --name shelf --hook eps --formula \"a * tanh(q_i / b)\" --param a=1e-5:m --param b=1e-3:m --model base.toml --data run.csv --out better.toml\n\nA formula may use +, -, *, /, ^, parentheses, sin, cos, tan, exp, ln, sqrt, abs, tanh, and the variables that `krait model show --defaults` lists for each hook; it can do nothing but arithmetic."
    )]
    Add(Box<AddArgs>),
    /// Fits parameters of the effects that a model already has.
    #[command(
        after_help = "Example:\n  krait lab fit --free stiffness-scale.eta --model better.toml --data run.csv --out best.toml\n  krait lab fit --free machine.r_m --model base.toml --data run.csv --out calibrated.toml"
    )]
    Fit(FitArgs),
    /// The error after each effect that was added to a model.
    #[command(after_help = "Example:\n  krait lab history better.toml")]
    History(HistoryArgs),
    /// Makes data with a hidden effect from the simulated snake or segments, and the answer in a file of its own.
    #[command(
        after_help = "Examples:\n  krait lab generate --kind backlash --size 2 --out data.csv\n  krait lab generate --kind stiffness+creep --size 2,1.5 --trajectory teleop --noise ou:0.5 --out data.csv\n  krait lab generate --seed 4711 --out riddle.csv      the seed picks what is hidden\n  krait lab generate --segments 2 --kind backlash-2 --out two.csv\n  krait lab generate --list\n\nThen: krait lab diagnose --model base.toml --data data.csv"
    )]
    Generate(GenerateArgs),
    /// A riddle for learners: data with one hidden effect, four names to choose from, and the answer sealed.
    #[command(
        after_help = "Examples:\n  krait lab quiz --out riddle.csv\n  krait lab quiz --level hard --seed 7 --out riddle.csv\n  krait lab check --data riddle.csv --guess backlash"
    )]
    Quiz(QuizArgs),
    /// Judges a guess at what is hidden in data of `krait lab quiz` or `krait lab generate`; exit code 1 where it is wrong.
    #[command(
        after_help = "Examples:\n  krait lab check --data riddle.csv --guess backlash\n  krait lab check --data riddle.csv --give-up"
    )]
    Check(CheckArgs),
    /// How good is the lab? Diagnoses a grid of generated data and scores the answers; goes on where it was ended.
    #[command(
        after_help = "Examples:\n  krait lab benchmark --out benchmark\n  krait lab benchmark --rounds 20 --seed 7 --out benchmark-7 --json > figures.json\n  krait lab benchmark --machine joints --groups several,pair --no-baselines --out lists\n  krait lab benchmark --machine segments --groups none,single,pair --out segments"
    )]
    Benchmark(BenchmarkArgs),
}

/// Options of `krait lab init`.
#[derive(Clone, Debug, Args)]
pub struct InitArgs {
    /// Measurements: CSV, Parquet, a MATLAB file of level 5, or a ROS 2 bag (MCAP).
    pub data: PathBuf,
    /// What a column is, where its name does not tell or tells wrongly, again for each: y1_deg=Jaw; none=NAME takes a column out.
    #[arg(long = "map", value_name = "COLUMN=NAME[:UNIT]")]
    pub map: Vec<Mapping>,
    /// Where to write the mapping; by default beside the data as NAME.map.toml.
    #[arg(long, value_name = "FILE")]
    pub map_out: Option<PathBuf>,
    /// Where to write the model; by default beside the data as NAME.model.toml.
    #[arg(long, value_name = "FILE")]
    pub model_out: Option<PathBuf>,
    /// Overwrite files that are already there.
    #[arg(long)]
    pub force: bool,
    /// Print the proposal as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// A model and measurements.
#[derive(Clone, Debug, Args)]
pub struct LabFiles {
    /// Model file (TOML).
    #[arg(long, value_name = "FILE")]
    pub model: PathBuf,
    /// Measurements: CSV, Parquet, MATLAB level 5, a ROS 2 bag or a recording of krait (MCAP), or a folder of them; again for each recording of the same machine.
    #[arg(long, required = true, value_name = "FILE")]
    pub data: Vec<PathBuf>,
    /// A second log with what was measured, by a clock of its own, beside the commands in the one file of --data: both are joined where
    /// the motion says. Columns are named and mapped as in one file.
    #[arg(long, value_name = "FILE")]
    pub with: Option<PathBuf>,
    /// How far the measurements come ahead of the encoders, s, as a diagnosis of a snake finds it, and after a comma by how many parts per
    /// million their clock is apart; once, or again for each recording.
    #[arg(long, value_name = "SECONDS[,PPM]", allow_hyphen_values = true)]
    pub clock: Vec<ClockOffset>,
    /// How much larger a recording's camera sees each bend than the first recording's, deg with commas between, as a diagnosis of several
    /// recordings finds it; again for each recording, 0 for the first.
    #[arg(long, value_name = "DEG[,DEG]", allow_hyphen_values = true)]
    pub camera_offset: Vec<CameraOffset>,
    /// The file's own name and unit for a column of the lab, again for each: bend_x_rad=cam.x:deg.
    #[arg(long = "map", value_name = "COLUMN=NAME[:UNIT]")]
    pub map: Vec<Mapping>,
    /// A file of such mappings, as `krait lab init` writes it; --map comes before it.
    #[arg(long, value_name = "FILE")]
    pub map_file: Option<PathBuf>,
}

impl LabFiles {
    /// Model and measurements, read and checked together.
    ///
    /// # Errors
    /// What the lab refuses, one sentence.
    pub fn session(&self) -> anyhow::Result<Session> {
        let session = Session::open_with(&self.model, &self.data, self.with.as_deref(), &self.column_map()?)?;
        Ok(session.by_cameras(&self.camera_offset)?.by_clocks(&self.clock)?)
    }

    /// The mappings together.
    ///
    /// # Errors
    /// What a mapping file is refused for.
    pub fn column_map(&self) -> Result<ColumnMap, ReadError> {
        let said: ColumnMap = self.map.iter().cloned().collect();
        let file = self.map_file.as_deref().map(ColumnMap::from_file).transpose()?;
        Ok(file.unwrap_or_default().overridden(said))
    }
}

/// Options of `krait lab compare`.
#[derive(Clone, Debug, Args)]
pub struct LabCompareArgs {
    /// Model and data.
    #[command(flatten)]
    pub files: LabFiles,
    /// Write a page with pictures (HTML, one file, works without a network).
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Print the answer as JSON on standard output.
    #[arg(long)]
    pub json: bool,
    /// Put the residual over time and over the position into the JSON (`curves`).
    #[arg(long, requires = "json")]
    pub curves: bool,
}

/// Options of `krait lab diagnose`.
#[derive(Clone, Debug, Args)]
pub struct DiagnoseArgs {
    /// Model and data.
    #[command(flatten)]
    pub files: LabFiles,
    /// A number of the model's own that is not held: EFFECT.PARAMETER or machine.KEY, again for each. Of several effects of one kind EFFECT
    /// means all, and with a joint's number the one on that joint: backlash-2.half_width.
    #[arg(long, value_name = "EFFECT.PARAMETER", value_parser = effect_parameter)]
    pub free: Vec<(String, String)>,
    /// A model file of the same machine whose formulas take part beside the library's effects.
    #[arg(long, value_name = "FILE")]
    pub effects: Option<PathBuf>,
    /// At most so many effects are sought together.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=5))]
    pub max_effects: u8,
    /// Diagnose once more without the last recording, the last trial, or the last fifth of the only one, and say the error there: no
    /// choice has seen it. It takes as long again.
    #[arg(long)]
    pub locked: bool,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Write a page with pictures (HTML, one file, works without a network).
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Write the motion that would tell look-alikes apart, and say what it would decide: of a snake a script for
    /// `krait run --engage --master script --input FILE.csv`, of joints their commands over time.
    #[arg(long, value_name = "FILE.csv")]
    pub experiment: Option<PathBuf>,
    /// Print the answer as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait lab add`.
#[derive(Clone, Debug, Args)]
pub struct AddArgs {
    /// The effect's name, `formula`, or the name of a formula in the file of --effects.
    pub effect: String,
    /// Model and data.
    #[command(flatten)]
    pub files: LabFiles,
    /// A model file of the same machine: where it has a formula of this name, that is added, from its values or those of --set.
    #[arg(long, value_name = "FILE")]
    pub effects: Option<PathBuf>,
    /// Where to write the model with the effect.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite files that are already there.
    #[arg(long)]
    pub force: bool,
    /// Parameters that the fit frees, by commas; by default those that the catalogue frees, for a formula all. With a point,
    /// EFFECT.PARAMETER or machine.KEY: a number of the model's own that is fitted again. Of several effects of one kind EFFECT means all,
    /// and with a joint's number the one on that joint: backlash-2.half_width.
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    pub free: Vec<String>,
    /// A parameter's value where the fit starts, and where it stays unless it is free: NAME=VALUE, again for each.
    #[arg(long, value_name = "NAME=VALUE", value_parser = name_value)]
    pub set: Vec<(String, f64)>,
    /// Of joints: a number of the effect depends on a column of the data: PARAMETER=COLUMN, such as half_width=sheath_deg.
    #[arg(long, value_name = "PARAMETER=COLUMN", value_parser = name_text)]
    pub by: Option<(String, String)>,
    /// Of joints: a name in the formula stands for a column of the data: NAME=COLUMN, again for each.
    #[arg(long, value_name = "NAME=COLUMN", value_parser = name_text)]
    pub column: Vec<(String, String)>,
    /// A formula's name.
    #[arg(long, default_value = "formula")]
    pub name: String,
    /// Where a formula's value is added: eps, tau, geo, meas or enc; of segments meas, of joints joint, of kind force force.
    #[arg(long, value_name = "HOOK")]
    pub hook: Option<String>,
    /// The formula.
    #[arg(long, value_name = "EXPRESSION")]
    pub formula: Option<String>,
    /// A formula's parameter: NAME=VALUE:UNIT, again for each.
    #[arg(long, value_name = "NAME=VALUE[:UNIT]", value_parser = formula_parameter)]
    pub param: Vec<(String, f64, String)>,
    /// Write a page with pictures (HTML, one file, works without a network).
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Print the answer as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait lab fit`.
#[derive(Clone, Debug, Args)]
pub struct FitArgs {
    /// Model and data.
    #[command(flatten)]
    pub files: LabFiles,
    /// Where to write the model with the fitted values.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite files that are already there.
    #[arg(long)]
    pub force: bool,
    /// What is fitted: EFFECT.PARAMETER or machine.KEY, again for each; with them what the model file leaves "free". Without any, what was
    /// fitted to these data before.
    #[arg(long, value_name = "EFFECT.PARAMETER", value_parser = effect_parameter)]
    pub free: Vec<(String, String)>,
    /// Write a page with pictures (HTML, one file, works without a network).
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Print the answer as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of `krait lab history`.
#[derive(Clone, Debug, Args)]
pub struct HistoryArgs {
    /// Model file (TOML).
    pub model: PathBuf,
    /// Write a page with pictures (HTML, one file, works without a network).
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    /// Print the history as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

pub(crate) fn effect_parameter(text: &str) -> Result<(String, String), String> {
    let (effect, parameter) = text
        .rsplit_once('.')
        .ok_or_else(|| format!("{text:?} is not EFFECT.PARAMETER, such as stiffness-scale.eta"))?;
    Ok((effect.to_owned(), parameter.to_owned()))
}

/// The same back as text.
pub(crate) fn dotted(names: &[(String, String)]) -> Vec<String> {
    names.iter().map(|(effect, parameter)| format!("{effect}.{parameter}")).collect()
}

fn name_value(text: &str) -> Result<(String, f64), String> {
    let wrong = || format!("{text:?} is not NAME=VALUE, such as half_width_m=1e-4");
    let (name, value) = text.split_once('=').ok_or_else(wrong)?;
    let value: f64 = value.parse().map_err(|_e| wrong())?;
    if value.is_finite() { Ok((name.to_owned(), value)) } else { Err(wrong()) }
}

fn name_text(text: &str) -> Result<(String, String), String> {
    let both = text.split_once('=').filter(|(name, column)| !name.is_empty() && !column.is_empty());
    let (name, column) = both.ok_or_else(|| format!("{text:?} is not NAME=COLUMN, such as half_width=sheath_deg"))?;
    Ok((name.to_owned(), column.to_owned()))
}

fn formula_parameter(text: &str) -> Result<(String, f64, String), String> {
    let (left, unit) = text.split_once(':').unwrap_or((text, "1"));
    let (name, value) = name_value(left)?;
    Ok((name, value, unit.to_owned()))
}
