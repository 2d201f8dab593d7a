//! `krait calibrate`: dialogues that take a real robot to a model file.
//!
//! A robot that krait does not drive is moved by hand: the dialogue says where to, and takes what its encoders read. `--truth`
//! puts the simulated snake in its place.

use crate::cli::Common;
use crate::cli_calibrate::{CalibrateVerb, Files, FrictionArgs, PhotoArgs, PlayArgs, PosesArgs};
use crate::commands::calibrate_lines::LinesAlone;
use crate::commands::drives::LedDrives;
use crate::commands::overwrite::{refuse_existing, write_whole};
use crate::commands::{calibrate_chain, today};
use crate::print;
use anyhow::Context;
use krait_calibrate::poses::{PoseGoal, PoseReached};
use krait_calibrate::{
    CalibrateError, CalibratedValue, ConeFriction, Dialogue, Reply, friction, photo, play, poses, written,
};
use krait_ipc::input;
use krait_ipc::message::{lines, three};
use krait_model::MachineParameters;
use krait_model::model_file::{FileEffect, Machine, ModelFile};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, DriveError};
use nalgebra::Vector3;
use std::io::{BufRead, Stdin, Stdout, Write, stdin, stdout};
use std::path::Path;
use std::process::ExitCode;

/// The user at the terminal.
pub(super) type Terminal = Dialogue<std::io::StdinLock<'static>, Stdout>;

/// What the fits of `poses` and `stem` know of a model; every other effect would be taken for one of these.
const KNOWN: [&str; 6] = ["stiffness-scale", "static-friction", "cone-friction", "backlash", DISTRIBUTED, INSIDE];
pub(super) const DISTRIBUTED: &str = "distributed-capstan";
const INSIDE: &str = "inside-extension";

/// Real drives are asked about always.
const PLAY_CONSENT: &str = "This homes the REAL drives of the configuration and moves one actuator after the other by up to 2 mm from zero; every line must be off the snake. Type yes to go on, anything else to leave it:";

/// Runs one procedure; exit code 1 if its values were not written.
pub fn run(common: &Common, verb: &CalibrateVerb) -> anyhow::Result<ExitCode> {
    match verb {
        CalibrateVerb::Friction(args) => friction(args),
        CalibrateVerb::Play(args) => play(common, args),
        CalibrateVerb::Photo(args) => photo(args),
        CalibrateVerb::Poses(args) => poses(common, args),
        CalibrateVerb::Stem(args) => super::calibrate_stem::run(args),
    }
}

fn terminal() -> Terminal {
    let input: Stdin = stdin();
    Dialogue::new(input.lock(), stdout())
}

fn friction(args: &FrictionArgs) -> anyhow::Result<ExitCode> {
    let model = &args.files.model;
    let settings = friction::FrictionSettings {
        phi_rad: LinesAlone::of(file_of(model)?.as_ref(), model, &["static-friction", "cone-friction"])?.phi_rad,
        weight_sd_g: args.weight_sd_g,
        scale_sd_g: args.scale_sd_g,
        free_zero: args.free_zero,
    };
    let mut dialogue = terminal();
    let found = friction::run(&mut dialogue, &args.files.csv, &settings)?;
    save(&mut dialogue, &args.files, &found.calibrated())
}

fn play(common: &Common, args: &PlayArgs) -> anyhow::Result<ExitCode> {
    let model = &args.files.model;
    let n_lines = LinesAlone::of(file_of(model)?.as_ref(), model, &["backlash"])?.n_lines;
    let settings = play::PlaySettings { dial_sd_m: args.dial_sd_um * 1e-6, n_lines };
    let mut dialogue = terminal();
    let found = if args.drives {
        if dialogue.ask(PLAY_CONSENT)?.as_deref() != Some("yes") {
            anyhow::bail!("nothing was moved, because a calibration moves drives only when it is told to; answer yes");
        }
        let drives = LedDrives::start(common)?;
        play::run(&mut dialogue, &args.files.csv, &settings, |_, line, to_m| {
            drives.go(line, to_m).map_err(|error| CalibrateError::Robot(format!("{error:#}")))
        })?
    } else {
        play::run(&mut dialogue, &args.files.csv, &settings, |dialogue, line, to_m| {
            let question =
                format!("move actuator {line} to {:.3} mm; its encoder then reads mm? [{:.3}]", to_m * 1e3, to_m * 1e3);
            Ok(by_hand(dialogue, &question, 1)?.map_or(to_m, |read| read[0] * 1e-3))
        })?
    };
    save(&mut dialogue, &args.files, &found.calibrated())
}

fn photo(args: &PhotoArgs) -> anyhow::Result<ExitCode> {
    if let Some(out) = &args.out {
        refuse_existing(out, "csv", args.force)?;
    }
    let photo::PhotoSession { bends, left_out } = photo::bends(&photo::read(&args.clicks)?, args.click_sd_px)?;
    let mut text = String::new();
    for bend in &bends {
        text += &format!("{}\n", bend.sentence());
    }
    for why in &left_out {
        text += &format!("left out: {why}\n");
    }
    if let Some(out) = &args.out {
        let table = photo::table(&bends);
        write_whole(out, table).with_context(|| format!("{} could not be written", out.display()))?;
        text += &format!("bends: {}\n", out.display());
    }
    print::out(&text)?;
    Ok(if left_out.is_empty() && bends.iter().all(photo::Bend::plausible) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn poses(common: &Common, args: &PosesArgs) -> anyhow::Result<ExitCode> {
    let file = file_of(&args.files.model)?;
    if let Some(file) = &file {
        only_known(file, &args.files.model)?;
    }
    let (mu, f_s_n) = friction_of(file.as_ref(), &args.files.model)?;
    let machine = machine(file.as_ref(), &args.files.model)?;
    let settings = poses::PoseSettings {
        machine,
        mu,
        f_s_n,
        cone: cone_of(file.as_ref()),
        inside_share: inside_share_of(file.as_ref()),
        sd_rad: args.sd_deg.to_radians(),
        plan: poses::PosePlan::new(args.front_deg(), args.largest_deg.unwrap_or(poses::PosePlan::FULL_DEG))?,
    };
    let eta = value_of(file.as_ref(), KNOWN[0], "eta").unwrap_or(1.0);
    let bends = args.bends.as_deref();
    let mut dialogue = terminal();
    dialogue.say(&with(&settings, &args.files.model))?;
    anyhow::ensure!(
        args.chain || !args.machine.names_a_chain(),
        "--slave and --shape are for a chain that moves the machine; add --chain, or leave them out"
    );
    if let Some(said) = poses::price(&settings)?.filter(|_| !args.chain) {
        dialogue.say(&said)?;
    }
    let found = match args.machine.truth() {
        _ if args.chain => calibrate_chain::poses(common, args, settings, eta, &mut dialogue)?,
        Some(file) => {
            let mut snake = SimulatedSnake::new(&Truth::load(file)?);
            snake.set_power(0, true)?;
            poses::run(&mut dialogue, &args.files.csv, bends, &settings, |dialogue, goal| {
                simulated(&mut snake, dialogue, &goal, args.front.is_some()).map(PoseReached::from)
            })?
        }
        None => poses::run(
            &mut dialogue,
            &args.files.csv,
            bends,
            &settings,
            |dialogue, PoseGoal { q_tilde_m: to_m, .. }| {
                let [a, b, c] = (to_m * 1e3).into();
                let question = format!(
                    "move the actuators to {a:.3} {b:.3} {c:.3} mm in one go; the encoders then read mm? [the same]"
                );
                let read = by_hand(dialogue, &question, 3)?;
                Ok(read.map_or(to_m, |read| Vector3::new(read[0], read[1], read[2]) * 1e-3).into())
            },
        )?,
    };
    save(&mut dialogue, &args.files, &found.calibrated())
}

/// What is taken from the model file.
fn with(settings: &poses::PoseSettings, model: &Path) -> String {
    let along = if settings.cone == ConeFriction::Lumped { "" } else { " along the cone" };
    let inside = match settings.inside_share {
        0.0 => String::new(),
        share => format!(" and extension inside the snake (share {share})"),
    };
    let and = if inside.is_empty() { " and" } else { "," };
    let poses::PoseSettings { mu, f_s_n, .. } = settings;
    format!("with mu {mu:.4}{along}{and} f_s {f_s_n:.3} N{inside} of {}", model.display())
}

/// Moves the simulated snake and shows its bend, and what a picture of the plane that it bends in shows of it.
fn simulated(
    snake: &mut SimulatedSnake,
    dialogue: &mut Terminal,
    goal: &PoseGoal,
    is_front: bool,
) -> Result<Vector3<f64>, CalibrateError> {
    let robot = |e: DriveError| CalibrateError::Robot(e.to_string());
    snake.write(0, lines(goal.q_tilde_m.into())).map_err(robot)?;
    let q_tilde_m = three(&snake.read(0).map_err(robot)?.q_tilde_m).into();
    let [x, y] = snake.bend_rad().map(f64::to_degrees);
    let picture = match goal.picture_deg {
        Some(plane_deg) if is_front => {
            let (sin, cos) = plane_deg.to_radians().sin_cos();
            format!(", {:.3} deg towards {plane_deg:.0} deg", x * cos + y * sin)
        }
        _ => String::new(),
    };
    dialogue.say(&format!("  (the simulated snake stands at {x:.3} {y:.3} deg{picture})"))?;
    Ok(q_tilde_m)
}

/// What the user reads after a motion by hand; `None` for "as told".
fn by_hand<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    question: &str,
    n: usize,
) -> Result<Option<Vec<f64>>, CalibrateError> {
    loop {
        match dialogue.numbers(question, (n, n), (-50.0, 50.0))? {
            Reply::Numbers(read) => return Ok(Some(read)),
            Reply::Empty => return Ok(None),
            // What is read next rests on where the actuators have been.
            Reply::Skip => dialogue.say("  a motion cannot be left out; s skips a reading, q stops")?,
            Reply::Quit => return Err(CalibrateError::Stopped),
        }
    }
}

fn text_of(model: &Path) -> anyhow::Result<Option<String>> {
    match input::text(model, input::CONFIG_BYTES) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("the model file {} could not be read", model.display())),
    }
}

fn file_of(model: &Path) -> anyhow::Result<Option<ModelFile>> {
    let Some(text) = text_of(model)? else { return Ok(None) };
    Ok(Some(ModelFile::parse(&text).with_context(|| format!("the model file {}", model.display()))?))
}

fn machine(file: Option<&ModelFile>, model: &Path) -> anyhow::Result<MachineParameters> {
    file.map_or_else(|| Ok(MachineParameters::default()), |file| snake_of(file, model))
}

/// Dimensions and material of the snake that a model file describes.
pub(super) fn snake_of(file: &ModelFile, model: &Path) -> anyhow::Result<MachineParameters> {
    match file.machine() {
        Machine::Snake(snake) => Ok(snake.parameters),
        Machine::Segments(_) => anyhow::bail!(
            "the model file {} is of segments, which bend each other's lines, expected one snake, which is all that this fit computes; \
             `krait calibrate friction` and `play` know segments, and `krait lab fit` finds the rest from a recording",
            model.display()
        ),
        other => {
            anyhow::bail!(
                "the model file {} is of kind {}, expected a snake; give another",
                model.display(),
                other.kind()
            )
        }
    }
}

/// An effect of a model file by its kind's name.
pub(super) fn effect_of<'f>(file: &'f ModelFile, name: &str) -> Option<&'f FileEffect> {
    file.effects().iter().find(|effect| effect.setting().kind().name() == name)
}

/// Refuses a model with effects that `poses` and `stem` do not compute: their values would be wrong, and look right.
pub(super) fn only_known(file: &ModelFile, model: &Path) -> anyhow::Result<()> {
    let mut names = file.effects().iter().map(|effect| effect.setting().kind().name());
    if let Some(name) = names.find(|name| !KNOWN.contains(name)) {
        anyhow::bail!(
            "the model file {} has the effect {name}, expected only {}, which is all that this fit computes; give a file without it, or \
             fit all values together with `krait lab fit`",
            model.display(),
            KNOWN.join(", ")
        );
    }
    Ok(())
}

/// A parameter of an effect of a model file.
fn value_of(file: Option<&ModelFile>, effect: &str, parameter: &str) -> Option<f64> {
    effect_of(file?, effect)?.setting().value(parameter)
}

/// Where a model has the friction of its cone.
pub(super) fn cone_of(file: Option<&ModelFile>) -> ConeFriction {
    value_of(file, DISTRIBUTED, "arc_share")
        .map_or(ConeFriction::Lumped, |arc_share| ConeFriction::Distributed { arc_share })
}

/// What share of its load a line carries inside the snake.
pub(super) fn inside_share_of(file: Option<&ModelFile>) -> f64 {
    value_of(file, INSIDE, "share").unwrap_or(0.0)
}

/// mu and f_s of a model file: they must be known before eta and the play are.
fn friction_of(file: Option<&ModelFile>, model: &Path) -> anyhow::Result<(f64, f64)> {
    let value = |effect: &str, parameter: &str| value_of(file, effect, parameter);
    let mu = value("cone-friction", "mu").or_else(|| value(DISTRIBUTED, "mu"));
    let found = (mu, value("static-friction", "f_s_n"));
    let (Some(mu), Some(f_s_n)) = found else {
        anyhow::bail!(
            "the model file {} has no friction (effects static-friction, cone-friction), expected both; run `krait calibrate friction` first",
            model.display()
        );
    };
    Ok((mu, f_s_n))
}

/// Asks, and writes the model file as a whole: a computer that stops leaves the old one or the new one.
fn save(dialogue: &mut Terminal, files: &Files, found: &[CalibratedValue]) -> anyhow::Result<ExitCode> {
    let model = &files.model;
    if !dialogue.yes(&format!("write to {}? [y/N]", model.display()))? {
        dialogue.say("not written; the readings are kept")?;
        return Ok(ExitCode::FAILURE);
    }
    let from = files.csv.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    replaced(model, &written(text_of(model)?.as_deref(), found, &from, &today())?)?;
    dialogue.say(&format!("written to {}", model.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes a model file as a whole.
pub(super) fn replaced(model: &Path, text: &str) -> anyhow::Result<()> {
    write_whole(model, text).with_context(|| format!("the model file {} could not be written", model.display()))
}
