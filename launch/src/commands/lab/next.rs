//! The command that comes next, ready to be typed, at the end of every answer of the lab.

use super::add::{free_name, has_formula, has_joint_number};
use super::shell::{data_words, quoted, shell};
use crate::cli_lab::{DiagnoseArgs, LabFiles, dotted};
use krait_bridge::LiveModel;
use krait_lab::Session;
use krait_lab::diagnose::{DependsOn, Diagnosis, FormulaTerm, FoundEffect, ParameterVariation, Verdict};
use krait_lab::init::columns;
use krait_lab::read::Mapping;
use krait_model::effects::FormulaText;
use krait_model::model_file::{Known, Machine, ModelFile};
use std::path::{Path, PathBuf};

/// What comes after a diagnosis.
pub fn after_diagnosis(args: &DiagnoseArgs, diagnosis: &Diagnosis, session: &Session) -> String {
    let model = &args.files.model;
    // Nothing else is worth doing until the columns are right.
    let in_order = (!diagnosis.order.is_empty()).then(|| in_order(args, &diagnosis.order, session)).flatten();
    if let Some(next) = in_order {
        return next;
    }
    if diagnosis.effects.is_empty() && !diagnosis.proposals.is_empty() && !diagnosis.is_of_columns() {
        return formula(args, &diagnosis.proposals, session);
    }
    match diagnosis.verdict {
        // No motion shows more of a joint whose measurement does not follow.
        Verdict::Unknown if diagnosis.next_experiment.is_none() => String::new(),
        Verdict::Missing | Verdict::Partly if !diagnosis.effects.is_empty() => additions(args, diagnosis, session),
        Verdict::None if !args.free.is_empty() => {
            let free: String = dotted(&args.free).iter().map(|name| format!("--free {} ", quoted(name))).collect();
            said("", vec![words("fit", &args.files, model, &format!("{free}--out {}", shell(&better(model, &[]))))])
        }
        Verdict::None if has_joint_number(&session.file, |own| matches!(own, Known::Absent | Known::Free)) => {
            let free = "--free machine.gain --free machine.offset";
            said("", vec![words("fit", &args.files, model, &format!("{free} --out {}", shell(&better(model, &[]))))])
        }
        Verdict::None if session.file.first_open().is_some() => {
            said("", vec![words("fit", &args.files, model, &format!("--out {}", shell(&better(model, &[]))))])
        }
        Verdict::None if LiveModel::of(&session.file).is_ok() => {
            said("", vec![format!("krait run --engage --model {}", shell(model))])
        }
        // Nothing runs such a model, a force's or one of columns.
        Verdict::None => said("in pictures: ", vec![words("compare", &args.files, model, "--report fit.html")]),
        Verdict::TooShort | Verdict::Unknown
            if args.experiment.is_none() && has_motions(&session.file) && !diagnosis.is_of_columns() =>
        {
            said(
                "a motion that would show more: ",
                vec![words("diagnose", &args.files, model, "--experiment next.csv")],
            )
        }
        Verdict::Missing | Verdict::Partly | Verdict::Unknown if args.report.is_none() => {
            said("the rest in pictures: ", vec![words("diagnose", &args.files, model, "--report why.html")])
        }
        _ => String::new(),
    }
}

/// What comes after a fit: whether something is left.
pub fn after_fit(files: &LabFiles, out: &Path) -> String {
    said("", vec![words("diagnose", files, out, "")])
}

/// The same diagnosis of columns in the order that was found; `None` where no mapping says it.
fn in_order(args: &DiagnoseArgs, order: &[(usize, usize)], session: &Session) -> Option<String> {
    let column = if matches!(session.file.machine(), Machine::Joints(_)) { 'y' } else { 'q' };
    let map = args.files.column_map().ok()?;
    let names: Vec<String> = columns(args.files.data.first()?).ok()?.into_iter().map(|own| own.name).collect();
    let mut files = args.files.clone();
    for (whose, called) in order {
        let [to, from] = [whose, called].map(|own| format!("{column}{}", own + 1));
        files.map.retain(|own| !own.is_of(&to));
        files.map.push(Mapping::of_column(&from, &map, &names)?.moved(&from, &to)?);
    }
    Some(said("with the columns in order: ", vec![words("diagnose", &files, &files.model, "")]))
}

/// One command for each effect, each on the model that the one before wrote.
fn additions(args: &DiagnoseArgs, diagnosis: &Diagnosis, session: &Session) -> String {
    let free: String = dotted(&args.free).iter().map(|name| format!(" --free {}", quoted(name))).collect();
    let mut model = args.files.model.clone();
    let (mut written, mut named) = (Vec::new(), Vec::<String>::new());
    let mut commands = Vec::new();
    for effect in diagnosis.in_chain_order() {
        let out = better(&model, &written);
        let verb = match diagnosis.term_of(effect).and_then(|term| Some((term, term.formula.as_ref()?))) {
            Some((term, text)) => {
                // Found on two joints, it is two formulas.
                let name = free_name(&text.name, |own| {
                    named.iter().any(|name| name == own) || has_formula(&session.file, own)
                });
                named.push(name.clone());
                format!("{}{free}", own_formula(&name, text, &term.values))
            }
            None => {
                let set = effect.joint.map_or(String::new(), |joint| format!(" --set joint={joint}"));
                format!("add {}{set}{}{}{free}", effect.name, centre(effect), by(&diagnosis.variations, effect))
            }
        };
        commands.push(words(&verb, &args.files, &model, &format!("--out {}", shell(&out))));
        written.push(out.clone());
        model = out;
    }
    said("", commands)
}

/// A formula that was offered and found, with the values that were found.
fn own_formula(name: &str, text: &FormulaText, values: &[f64]) -> String {
    let params =
        text.parameters.iter().zip(values).map(|(own, value)| format!("{}={value:.4e}:{}", own.name, own.unit));
    let params: String = params.map(|own| format!(" --param {}", quoted(&own))).collect();
    let columns = text.columns.iter().map(|own| format!("{}={}", own.name, own.column));
    let columns: String = columns.map(|own| format!(" --column {}", quoted(&own))).collect();
    let (name, hook) = (quoted(name), text.hook.word());
    format!("add formula --name {name} --hook {hook} --formula {}{params}{columns}", quoted(&text.text))
}

/// A curve with a centre that was fitted: by itself the command leaves it in the middle of the motion.
fn centre(effect: &FoundEffect) -> String {
    let centre = effect.parameters.iter().find(|own| own.name == "centre" && own.is_free && effect.name == "cubic");
    centre.map_or(String::new(), |own| format!(" --free cubic,centre --set centre={:.4}", own.value))
}

/// How the command names the column that a number of an effect depends on.
fn by(variations: &[ParameterVariation], effect: &FoundEffect) -> String {
    let is_of =
        |own: &&ParameterVariation| own.is_in_answer && own.effect == effect.name && Some(own.joint) == effect.joint;
    let words = |own: &ParameterVariation| match &own.on {
        DependsOn::Column { name, .. } => Some(format!(" --by {}", quoted(&format!("{}={name}", own.parameter)))),
        DependsOn::Recording(_) => None,
    };
    variations.iter().find(is_of).and_then(words).unwrap_or_default()
}

/// The terms for the rest as one formula, whose gains the fit finds again.
fn formula(args: &DiagnoseArgs, terms: &[FormulaTerm], session: &Session) -> String {
    let names: Vec<char> = ('a'..='z').take(terms.len()).collect();
    let sum: Vec<String> = terms.iter().zip(&names).map(|(own, name)| format!("{name} * {}", own.term)).collect();
    let n_joints = session.data.n_inputs;
    // A formula stands on every joint: a factor that is 1 on one of them and 0 on the others.
    let of_joint = terms.first().filter(|_| n_joints > 1);
    let text = of_joint
        .map_or(sum.join(" + "), |own| format!("max(1 - abs(joint - {}), 0) * ({})", own.joint, sum.join(" + ")));
    let params = terms.iter().zip(&names).map(|(own, name)| quoted(&format!("{name}={:.4e}:{}", own.gain, own.unit)));
    let params: String = params.map(|param| format!(" --param {param}")).collect();
    let mut columns: Vec<String> = Vec::new();
    for (name, column) in terms.iter().filter_map(|own| own.column.as_ref()) {
        let words = format!(" --column {}", quoted(&format!("{name}={column}")));
        if !columns.contains(&words) {
            columns.push(words);
        }
    }
    let name = free_name("rest", |own| has_formula(&session.file, own));
    let verb =
        format!("add formula --name {name} --hook joint --formula {}{params}{}", quoted(&text), columns.concat());
    let model = &args.files.model;
    said("", vec![words(&verb, &args.files, model, &format!("--out {}", shell(&better(model, &[]))))])
}

fn words(verb: &str, files: &LabFiles, model: &Path, rest: &str) -> String {
    format!("krait lab {verb} --model {} {} {rest}", shell(model), data_words(files)).trim_end().to_owned()
}

fn said(what: &str, commands: Vec<String>) -> String {
    let behind: String = commands.iter().skip(1).map(|command| format!("then: {command}\n")).collect();
    commands.first().map_or(String::new(), |first| format!("Next: {what}{first}\n{behind}"))
}

/// A name for a better model that no file has yet, and none of those that are written first: `jaw.better.toml`, `jaw.better2.toml`.
fn better(model: &Path, written: &[PathBuf]) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let plain = stem.trim_end_matches(|c: char| c.is_ascii_digit()).strip_suffix(".better");
    let plain = plain.unwrap_or(&stem);
    let name = |n: usize| match n {
        1 => format!("{plain}.better.toml"),
        n => format!("{plain}.better{n}.toml"),
    };
    let taken = |path: &PathBuf| written.contains(path) || path.exists();
    (1..)
        .map(|n| model.with_file_name(name(n)))
        .find(|path| !taken(path))
        .unwrap_or_else(|| model.with_file_name(name(1)))
}

/// Whether the lab makes motions for a machine of this kind.
fn has_motions(file: &ModelFile) -> bool {
    matches!(file.machine(), Machine::Snake(_) | Machine::Joints(_))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_better_model_never_takes_a_name_that_is_there() {
        let at = |name: &str| PathBuf::from(format!("/nowhere/{name}"));
        assert_eq!(better(&at("jaw.model.toml"), &[]), at("jaw.model.better.toml"));
        assert_eq!(better(&at("jaw.toml"), &[at("jaw.better.toml")]), at("jaw.better2.toml"));
        assert_eq!(better(&at("jaw.better.toml"), &[at("jaw.better.toml")]), at("jaw.better2.toml"));
        assert_eq!(better(&at("jaw7.toml"), &[]), at("jaw7.better.toml"));
        let here = std::env::temp_dir().join(format!("krait-next-{}.better.toml", std::process::id()));
        std::fs::write(&here, "").unwrap();
        let model = std::env::temp_dir().join(format!("krait-next-{}.toml", std::process::id()));
        assert_eq!(better(&model, &[]), here.with_file_name(format!("krait-next-{}.better2.toml", std::process::id())));
        std::fs::remove_file(here).unwrap();
    }
}
