//! `krait lab diagnose`: which effect is missing, in a table or as JSON.

use super::init::cut;
use super::next::after_diagnosis;
use super::{page, stages};
use crate::cli_lab::DiagnoseArgs;
use crate::commands::overwrite::{refuse_foreign, write_whole};
use crate::print;
use anyhow::{Context, bail};
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, FormulaTerm, FoundEffect, LoadCell, capital, diagnose};
use krait_lab::experiment::{BEGINS, Experiment, Separation, experiment};
use krait_lab::report::diagnosis_page;
use krait_lab::{CameraOffset, ClockOffset, Names, Offered, Session, drawn_away, offered, open_model};
use krait_model::effects::explanation;
use krait_model::model_file::Machine;
use krait_report::Table;
use std::path::Path;
use std::process::ExitCode;

/// Candidates that the table shows.
const SHOWN: usize = 12;

/// Diagnoses; finding that something is missing is no failure.
pub fn run(args: &DiagnoseArgs) -> anyhow::Result<ExitCode> {
    page::refuse_place(args.report.as_deref())?;
    refuse_foreign(args.experiment.as_deref(), "csv", BEGINS)?;
    stages::tell();
    let mut session = args.files.session()?;
    let options = DiagnoseOptions {
        seed: args.seed,
        max_effects: usize::from(args.max_effects),
        free: args.free.clone(),
        recordings: session.recordings.clone(),
        offered: formulas(args, &session)?,
        is_locked: args.locked,
    };
    let mut diagnosis = diagnose(session.machine.as_ref(), &session.data, &options)?;
    diagnosis.cautions.extend(drawn_away(&session.file, &diagnosis.calibration));
    // Pictures and the commands that come next are of the measurements where their camera and clock were found to have them.
    let mut args = args.clone();
    if !diagnosis.cameras.is_empty() {
        session = session.by_cameras(&diagnosis.cameras)?;
        args.files.camera_offset = of_both(&args.files.camera_offset, &diagnosis.cameras);
    }
    if !diagnosis.clocks.is_empty() {
        session = session.by_clocks(&diagnosis.clocks)?;
        args.files.clock = together(&args.files.clock, &diagnosis.clocks);
    }
    let args = &args;
    if let Some(path) = &args.experiment {
        write_experiment(path, &session, &mut diagnosis)?;
    }
    if let Some(path) = &args.report {
        page::write(path, |origin| diagnosis_page(session.machine.as_ref(), &session.data, &diagnosis, origin))?;
    }
    if args.json {
        print::json(&diagnosis.to_json())?;
    } else {
        print::out(&text(args, &diagnosis, &session))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The formulas that are offered.
fn formulas(args: &DiagnoseArgs, session: &Session) -> anyhow::Result<Vec<Offered>> {
    let Some(path) = &args.effects else { return Ok(Vec::new()) };
    Ok(offered(path, &open_model(path)?, session.file.machine())?)
}

/// The clocks of the options with those that were found beside them.
fn together(said: &[ClockOffset], found: &[ClockOffset]) -> Vec<ClockOffset> {
    let said = |k: usize| said.get(k).or(said.first()).copied().unwrap_or_default();
    found.iter().enumerate().map(|(k, own)| said(k).and(*own)).collect()
}

/// The cameras of the options with those that were found beside them.
fn of_both(said: &[CameraOffset], found: &[CameraOffset]) -> Vec<CameraOffset> {
    let said = |k: usize| said.get(k).cloned().unwrap_or_default();
    found.iter().enumerate().map(|(k, own)| said(k).and(own)).collect()
}

/// Writes the motion, and tells the diagnosis what playing it would decide.
fn write_experiment(path: &Path, session: &Session, diagnosis: &mut Diagnosis) -> anyhow::Result<()> {
    let (machine, data) = (session.machine.as_ref(), &session.data);
    let motion = experiment(machine, session.file.machine(), data, diagnosis, &session.recordings)?;
    let Some(motion) = motion else {
        let why = match session.file.machine() {
            Machine::Force(_) => "motions are made for snakes and joints, and the model is of kind force",
            Machine::Segments(_) => "motions are made for snakes and joints, and the model is of kind segments",
            _ => "the joint stood still in these data, so that its range is not known; record it in motion",
        };
        bail!("--experiment {}: {why}; leave it out", path.display())
    };
    write_whole(path, &motion.script).with_context(|| {
        format!("the experiment {} could not be written; check that its directory exists", path.display())
    })?;
    if let Some(next) = &mut diagnosis.next_experiment {
        next.motion = Some(motion);
    }
    Ok(())
}

/// The motion in words, and what it would decide.
fn expected(motion: &Experiment) -> String {
    let what = if motion.separation.is_some() { "for the look-alikes" } else { "that shows most" };
    let mut text = format!("A motion {what}, {:.0} s from rest to rest:\n", motion.seconds);
    motion.moves.iter().for_each(|own| text += &print::paragraph(&format!("- {own}")));
    let Some(separation) = &motion.separation else { return text };
    let mut table = Table::new(&["if it is", "against", "lambda now", "after it", ""]);
    for pair in &separation.pairs {
        let number = |value: f64| format!("{value:.1}");
        let told = match (pair.is_told(), pair.is_beyond_chance()) {
            (true, _) => "told apart",
            (false, true) => "too small a difference",
            (false, false) => "not told apart",
        };
        table.row(vec![
            pair.truth.clone(),
            pair.other.clone(),
            number(pair.lambda_now),
            number(pair.lambda_then),
            told.to_owned(),
        ]);
    }
    text += &format!(
        "{}{table}",
        print::lines(&format!(
            "Expected from it (lambda: likelihood ratio against the wrong one; {:.0} and more tells them apart)",
            Separation::ENOUGH
        ))
    );
    let left: Vec<String> = separation.left_alike().iter().map(|(a, b)| format!("{a} from {b}")).collect();
    if !left.is_empty() {
        text += &print::paragraph(&format!(
            "It will not tell {}: no motion within what these data show of the machine was found that does. What stands under Next \
             experiment may need another sensor or a part by itself.",
            left.join(", nor ")
        ));
    }
    text
}

fn text(args: &DiagnoseArgs, diagnosis: &Diagnosis, session: &Session) -> String {
    let (unit, names) = (session.machine.error_unit().0, &session.data.names);
    let mut text = print::lines(&capital(&diagnosis.sentence));
    diagnosis.cautions.iter().for_each(|caution| text += &print::paragraph(&format!("Caution: {caution}.")));
    let floor = diagnosis.noise_floor.map_or("unknown".to_owned(), |floor| format!("{floor:.4} {unit}"));
    let is_open = diagnosis.is_calibrated();
    let given = if is_open { "after calibration" } else { "with the model as given" };
    text.push('\n');
    text += &print::lines(&format!(
        "Error, root mean square of its length: {:.4} {unit} {given}, {:.4} {unit} with the effects; noise floor {floor} ({})",
        diagnosis.base_heldout_rms,
        diagnosis.final_heldout_rms,
        diagnosis.floor_source.trim_start_matches("unknown: ")
    ));
    text += &print::lines(&locked(args, diagnosis, unit));
    if is_open {
        text += &format!("  before calibration {:.4} {unit}\n", diagnosis.as_given_rms);
    }
    if let Some(share) = diagnosis.explained_share.filter(|_| is_open) {
        text += &format!("  the effects explain {:.0} % of what there was to explain\n", 100.0 * share);
    }
    if let Some(rms) = diagnosis.model_free_rms {
        text += &print::lines(&format!(
            "  a fit without a model (trees on position, speed, earlier way and time) leaves {rms:.4} {unit}: a hint at how much can be \
             explained, no bound"
        ));
    }
    if is_open {
        text += &format!("\nCalibration\n{}", calibration(diagnosis, names));
    }
    if let Some(loads) = &diagnosis.loads {
        text += &format!("\nLoad cells, in one likelihood with the shape\n{}", load_cells(loads));
    }
    let found = if diagnosis.effects.is_empty() { &diagnosis.partial } else { &diagnosis.effects };
    if !found.is_empty() {
        text += if diagnosis.effects.is_empty() {
            "\nHypotheses: these help, but do not explain:\n"
        } else {
            "\nMissing:\n"
        };
        text += &effects(found, unit, names).to_string();
        for own in found.iter().filter(|own| own.class.len() > 1) {
            let others = own.class[1..].join(", ");
            text += &print::paragraph(&format!("{} cannot be told from {others}.", label(own, names)));
        }
        text += &format!("{}\n", parameters(found, names));
        let mut told: Vec<&str> = found.iter().map(|own| own.name.as_str()).collect();
        told.sort_unstable();
        told.dedup();
        text += &told.into_iter().map(|name| in_words(name, found, names)).collect::<String>();
    }
    for own in &diagnosis.variations {
        text += &print::paragraph(&capital(&own.sentence));
    }
    if !diagnosis.proposals.is_empty() {
        text += &format!("\nFormulas for the rest\n{}", proposals(&diagnosis.proposals, names));
    }
    let of = diagnosis.candidates_error_is_of().map(capital);
    let of = of.map_or(String::new(), |of| print::paragraph(&of));
    text += &format!("\nCandidates, each added alone ({SHOWN} best)\n{of}{}\n", candidates(diagnosis, unit));
    if let Some(next) = &diagnosis.next_experiment {
        text += &print::lines(&format!("Next experiment: {}", next.instruction));
        text += &next.motion.as_ref().map_or(String::new(), expected);
    }
    text + &after_diagnosis(args, diagnosis, session)
}

/// The error on what no choice has seen, or what the other errors are worth.
fn locked(args: &DiagnoseArgs, diagnosis: &Diagnosis, unit: &str) -> String {
    let Some(own) = &diagnosis.locked else {
        return match args.locked {
            true => "  used in selection: the data are too short for a part that no choice sees".to_owned(),
            false => "  used in selection: effects were chosen with the same rows; --locked keeps a last part from every choice".to_owned(),
        };
    };
    let (part, effects) = (own.part.word(), own.effects.join(", "));
    let with = if effects.is_empty() { "no further effect".to_owned() } else { effects };
    format!(
        "  locked: on {} rows of the {part}, which no choice has seen, {:.4} {unit}, without the effects {:.4} {unit}; the diagnosis of the \
         rest says {} ({with})",
        own.n_rows,
        own.rms,
        own.base_rms,
        own.verdict.word()
    )
}

/// What an effect is, how large wherever it was found, and what to check on the machine.
fn in_words(name: &str, found: &[FoundEffect], names: &Names) -> String {
    let Some(own) = explanation(name) else { return String::new() };
    let titled = |effect: &FoundEffect| effect.title().map(|title| format!("{}: {title}", label(effect, names)));
    let titles: Vec<String> = found.iter().filter(|effect| effect.name == name).filter_map(titled).collect();
    print::paragraph(&format!("{}. {} To check on the machine: {}", titles.join("; "), own.what, own.check))
}

/// What every fit found beside the effects.
fn calibration(diagnosis: &Diagnosis, names: &Names) -> Table {
    let mut table = Table::new(&["number", "of", "value", "standard error", "unit", "beside the file's"]);
    for own in diagnosis.calibration.iter().filter(|own| !own.is_held) {
        let drawn = own.prior.map_or(String::new(), |(value, se)| {
            format!("{:+.1} se from {}", (own.value - value) / se, five_digits(value))
        });
        table.row(vec![
            own.recording.as_ref().map_or(own.name.clone(), |recording| format!("{} of {recording}", own.name)),
            own.joint.map_or("model".to_owned(), |joint| names.joint(joint)),
            five_digits(own.value),
            format!("{:.1e}", own.se),
            own.unit.clone(),
            drawn,
        ]);
    }
    table
}

/// A number with five digits behind the point, or in scientific notation where these say little.
pub(super) fn five_digits(value: f64) -> String {
    if value == 0.0 || (0.1..1e5).contains(&value.abs()) { format!("{value:.5}") } else { format!("{value:.4e}") }
}

/// What the cells read, and what is left of it.
fn load_cells(loads: &[LoadCell]) -> Table {
    let mut table = Table::new(&["cell", "gain", "offset N", "left as given N", "with the effects N", "noise N"]);
    for own in loads {
        let offset = match own.offset_n[..] {
            [only] => format!("{only:+.2}"),
            _ => format!("{} trials", own.offset_n.len()),
        };
        let newtons = |value: f64| format!("{value:.3}");
        let (before, after, noise) = (newtons(own.before_n), newtons(own.after_n), newtons(own.noise_n));
        table.row(vec![format!("tau{}_n", own.line), format!("{:.4}", own.gain), offset, before, after, noise]);
    }
    table
}

fn label(effect: &FoundEffect, names: &Names) -> String {
    effect.joint.map_or(effect.name.clone(), |joint| format!("{}, {}", effect.name, names.joint(joint)))
}

fn effects(found: &[FoundEffect], unit: &str, names: &Names) -> Table {
    let mut table = Table::new(&["effect", &format!("before ({unit})"), "after", "probability"]);
    for effect in found {
        table.row(vec![
            label(effect, names),
            format!("{:.4}", effect.before),
            format!("{:.4}", effect.after),
            format!("{:.2}", effect.probability),
        ]);
    }
    table
}

fn parameters(found: &[FoundEffect], names: &Names) -> Table {
    let mut table = Table::new(&["parameter", "value", "standard error", "unit", ""]);
    for effect in found {
        for own in effect.parameters.iter().filter(|own| own.is_free) {
            table.row(vec![
                format!("{}.{}", label(effect, names), own.name),
                format!("{:.5e}", own.value),
                format!("{:.1e}", own.se),
                own.unit.clone(),
                if own.on_bound { "on its bound".to_owned() } else { String::new() },
            ]);
        }
    }
    table
}

fn proposals(all: &[FormulaTerm], names: &Names) -> Table {
    let mut table = Table::new(&["term", "of", "gain", "standard error", "unit", "takes of what is left"]);
    for own in all {
        table.row(vec![
            own.term.clone(),
            names.joint(own.joint),
            format!("{:.4e}", own.gain),
            format!("{:.1e}", own.se),
            own.unit.clone(),
            format!("{:.0} %", 100.0 * own.share),
        ]);
    }
    table
}

/// Letters of an effect's name in the table, so that a line has 80.
const NAME: usize = 29;

fn candidates(diagnosis: &Diagnosis, unit: &str) -> Table {
    let mut table = Table::new(&["effect", &format!("error ({unit})"), "sure", "p", "state"]);
    for own in diagnosis.candidates.iter().take(SHOWN) {
        table.row(vec![
            cut(own.name, NAME),
            own.heldout_rms.map_or("-".to_owned(), |rms| format!("{rms:.4}")),
            format!("{:.2}", own.probability),
            format!("{:.3}", own.p_value),
            own.state.replace("cannot be told from", "like"),
        ]);
    }
    table
}
