//! What pages say in words and tables.

use super::html::{escape, table};
use super::paragraph;
use super::{sketch, verdict};
use crate::compare::Comparison;
use crate::diagnose::{Diagnosis, FoundEffect, capital, of_what};
use crate::machine::MachineUnderTest;
use crate::measurements::Names;
use crate::{Added, parameters_called};
use krait_model::effects::explanation;
use krait_model::model_file::HistoryEntry;

/// Places that a page lists.
const MOST_PLACES: usize = 40;

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// The verdict in plain words, in those of the model's effects, and what to be careful about.
pub(super) fn verdict(diagnosis: &Diagnosis, names: &Names) -> String {
    let mut text = format!("<p class=\"verdict\">{}</p>\n", escape(&verdict::plain(diagnosis, names)));
    text += &paragraph(&capital(&diagnosis.sentence));
    for caution in &diagnosis.cautions {
        text += &format!("<p class=\"caution\">Caution: {}</p>\n", escape(&capital(caution)));
    }
    text
}

/// Confidence, figures and what to do next.
pub(super) fn summary(diagnosis: &Diagnosis, unit: &str) -> String {
    let mut text = "<h2>In numbers</h2>\n".to_owned();
    for effect in &diagnosis.effects {
        let sure = format!(
            "Confidence: {} came out best in {:.0} % of 500 resamplings of these data.",
            either(&effect.class),
            100.0 * effect.probability
        );
        text += &paragraph(&sure);
    }
    for own in &diagnosis.variations {
        text += &paragraph(&format!("{}.", capital(&own.sentence)));
    }
    let given = format!("{:.4} {unit}", diagnosis.as_given_rms);
    let given = diagnosis.is_calibrated().then_some(("error before calibration, rms".to_owned(), given));
    let of = if diagnosis.is_calibrated() { "after calibration" } else { "as given" };
    let rows = [
        (format!("error of the model {of}, rms"), format!("{:.4} {unit}", diagnosis.base_heldout_rms)),
        (
            "error with the effects, on data not fitted to".to_owned(),
            format!("{:.4} {unit}", diagnosis.final_heldout_rms),
        ),
        (
            format!("noise floor ({})", diagnosis.floor_source),
            diagnosis.noise_floor.map_or("unknown".to_owned(), |floor| format!("{floor:.4} {unit}")),
        ),
    ];
    let counts = ["rows", "rows with a measurement", "rows left out as outliers", "blocks of time"];
    let counts = counts.into_iter().zip(&diagnosis.rows).map(|(name, n)| (name.to_owned(), n.to_string()));
    let rows: Vec<Vec<String>> =
        given.into_iter().chain(rows).chain(counts).map(|(name, value)| vec![name, value]).collect();
    text += &table(&["what", "value"], &rows);
    text += "<h2>Next experiment</h2>\n";
    let next = diagnosis.next_experiment.as_ref();
    text + &paragraph(next.map_or("None is needed to decide between effects.", |next| next.instruction.as_str()))
}

fn either(class: &[String]) -> String {
    match class {
        [one] => one.clone(),
        several => format!("one of {{{}}}", several.join(", ")),
    }
}

/// The effects and their parameters.
pub(super) fn found(found: &[FoundEffect], names: &Names, unit: &str, is_partial: bool) -> String {
    if found.is_empty() {
        return String::new();
    }
    let heading = if is_partial { "What helps, but does not explain" } else { "Missing effects" };
    let effect = |own: &FoundEffect| {
        let numbers = [own.before, own.after].map(|rms| format!("{rms:.4}"));
        let [before, after] = numbers;
        vec![label(own, names), before, after, format!("{:.2}", own.probability)]
    };
    let rows: Vec<Vec<String>> = found.iter().map(effect).collect();
    let before = format!("error before ({unit})");
    let mut text = format!("<h2>{heading}</h2>\n");
    for (effect, own) in found.iter().filter_map(|own| Some((own, explanation(&own.name)?))) {
        text +=
            &format!("<h3>{}: {}</h3>\n", escape(&label(effect, names)), escape(&effect.title().unwrap_or_default()));
        text += &paragraph(&own.what);
        text += &effect.sketch.as_ref().map_or(String::new(), sketch::svg);
        text += &paragraph(&format!("To check on the machine: {}", own.check));
    }
    text += &table(&["effect", &before, "after", "probability"], &rows);
    let mut rows = Vec::new();
    for effect in found {
        for own in effect.parameters.iter().filter(|own| own.is_free) {
            rows.push(vec![
                format!("{}.{}", label(effect, names), own.name),
                format!("{:.5e}", own.value),
                format!("{:.1e}", own.se),
                format!("{:.1e}", own.se_naive),
                own.unit.clone(),
                if own.on_bound { "on its bound".to_owned() } else { String::new() },
            ]);
        }
    }
    text + &table(&["parameter", "value", "standard error", "(if rows were independent)", "unit", ""], &rows)
}

/// An effect and its joint.
fn label(effect: &FoundEffect, names: &Names) -> String {
    effect.joint.map_or(effect.name.clone(), |joint| format!("{}, {}", effect.name, names.joint(joint)))
}

/// Which effects these data cannot tell from those that were found.
pub(super) fn look_alikes(found: &[FoundEffect]) -> String {
    let mut text = "<h2>What cannot be told apart</h2>\n".to_owned();
    let several: Vec<&FoundEffect> = found.iter().filter(|effect| effect.class.len() > 1).collect();
    for effect in &several {
        let others = effect.class.iter().skip(1).cloned().collect::<Vec<_>>().join(", ");
        text += &paragraph(&format!("On these data {} would do as well as {}.", others, effect.name));
    }
    if several.is_empty() {
        text += &paragraph(if found.is_empty() {
            "No effect was found."
        } else {
            "Nothing: no other effect does as well."
        });
    }
    text
}

/// Every candidate, and why it was chosen or not.
pub(super) fn candidates(diagnosis: &Diagnosis, unit: &str) -> String {
    let row = |own: &crate::diagnose::CandidateAnswer| {
        vec![
            own.name.to_owned(),
            own.class.to_owned(),
            optional(own.heldout_rms, 4),
            format!("{:.2}", own.probability),
            format!("{:.3}", own.p_value),
            own.state.clone(),
        ]
    };
    let rows: Vec<Vec<String>> = diagnosis.candidates.iter().map(row).collect();
    let error = format!("error with it alone ({unit})");
    let mut text = "<h2>All candidates</h2>\n".to_owned();
    text += &paragraph(
        "Each effect added to the model by itself, the best first; p is the probability that chance makes a signature as strong \
         as this one's somewhere among all candidates.",
    );
    if let Some(of) = diagnosis.candidates_error_is_of() {
        text += &paragraph(&capital(of));
    }
    text + &table(&["effect", "looks like", &error, "probability", "p", "why"], &rows)
}

/// What is left, by what it depends on.
pub(super) fn remaining(diagnosis: &Diagnosis) -> String {
    let rest = &diagnosis.remaining;
    let said = match (rest.structured, rest.looks_like) {
        (true, Some(what)) => format!("What is left has structure; it depends most on {what}."),
        (true, None) => "What is left has structure.".to_owned(),
        (false, _) => "What is left shows no structure that noise does not make, or too little to matter.".to_owned(),
    };
    let whole = of_what(diagnosis.noise_floor.is_some());
    let said = format!("{said} Of {whole}, {:.1} % is left.", 100.0 * rest.unexplained);
    let group = |own: &crate::diagnose::GroupShare| {
        vec![own.name.to_owned(), format!("{:.2}", 100.0 * own.share), format!("{:.3}", own.p_value)]
    };
    let rows: Vec<Vec<String>> = rest.structure.groups.iter().map(group).collect();
    let mut text = "<h2>What is left</h2>\n".to_owned();
    text += &paragraph(&said);
    text + &table(&["depends on", "share of the rest's variance, on blocks not fitted to (%)", "p"], &rows)
}

/// How far the model is off, beside the noise, and where most.
pub(super) fn compared(found: &Comparison) -> String {
    let (unit, rms) = (&found.unit, found.error.rms);
    let beside = match found.noise_floor {
        Some(floor) => format!("; noise of the measurement alone makes {floor:.3} {unit}"),
        None => "; how much of that is noise of the measurement is not known".to_owned(),
    };
    let text = format!("The model is off by {rms:.3} {unit} in the mean{beside}. {}", found.worst);
    format!("<p class=\"verdict\">{}</p>\n", escape(&text))
}

/// The figures of a comparison.
pub(super) fn comparison(found: &Comparison) -> String {
    let unit = &found.unit;
    let mut text = "<h2>In numbers</h2>\n".to_owned();
    let mut rows = vec![vec![
        "length of the error".to_owned(),
        format!("{:.4}", found.error.rms),
        format!("{:.4}", found.error.p95),
        format!("{:.4}", found.error.max),
    ]];
    if let Some(parts) = &found.parts {
        for (name, own) in [("in-plane", parts.bend), ("out-of-plane", parts.plane)] {
            let numbers = [own.rms, own.p95, own.max].map(|value| format!("{value:.4}"));
            rows.push([vec![name.to_owned()], numbers.to_vec()].concat());
        }
    }
    for (k, rms) in found.output_rms.iter().enumerate() {
        rows.push(vec![format!("output {}", k + 1), format!("{rms:.4}"), "-".to_owned(), "-".to_owned()]);
    }
    text += &table(&["error", &format!("rms ({unit})"), "95 %", "largest"], &rows);
    if let Some(position_m) = found.position_rms_m {
        text += &paragraph(&format!("Position of the tip: {:.3} mm rms.", 1e3 * position_m));
    }
    let floor = found.noise_floor.map_or("unknown".to_owned(), |floor| format!("{floor:.4} {unit}"));
    text += &paragraph(&format!("Noise of the measurement: {floor} rms ({}).", found.noise_source));
    text + &paragraph(&format!("{} rows, {} of them with a measurement.", found.n_rows, found.n_scored))
}

/// Errors by circumstances.
pub(super) fn places(found: &Comparison) -> String {
    let row = |own: &crate::compare::Bin| {
        vec![
            own.by.clone(),
            own.bin.clone(),
            format!("{:.3}", own.rms),
            optional(own.mean, 3),
            optional(own.plane_mean, 3),
            own.n_rows.to_string(),
        ]
    };
    let rows: Vec<Vec<String>> = found.bins.iter().take(MOST_PLACES).map(row).collect();
    let rms = format!("rms ({})", found.unit);
    let head = ["by", "where", &rms, "mean (in-plane)", "mean (out-of-plane)", "rows"];
    format!("<h2>Where, in numbers</h2>\n{}", table(&head, &rows))
}

/// What an added effect brings.
pub(super) fn added(added: &Added, what: &str, unit: &str) -> String {
    let said = format!(
        "{what}: error {:.4} {unit} before, {:.4} {unit} after on data that it was not fitted to; noise floor {}.",
        added.before,
        added.after,
        added.noise_floor.map_or("unknown".to_owned(), |floor| format!("{floor:.4} {unit}"))
    );
    format!("<p class=\"verdict\">{}</p>\n", escape(&said))
}

/// The fitted parameters of an added effect.
pub(super) fn fitted(added: &Added, machine: &dyn MachineUnderTest) -> String {
    let mut rows = Vec::new();
    for (k, (own, name)) in added.variables.iter().zip(parameters_called(added, machine)).enumerate() {
        let se = added.uncertainty.robust.get(k).map_or("-".to_owned(), |se| format!("{se:.1e}"));
        let bound = if own.bound(&added.terms).is_some() { "on its bound" } else { "" };
        let value = format!("{:.5e}", own.value(&added.terms));
        rows.push(vec![name, value, se, own.unit.clone(), bound.to_owned()]);
    }
    table(&["parameter", "value", "standard error", "unit", ""], &rows)
}

/// What all effects of a history bring together.
pub(super) fn grown(first: &HistoryEntry, last: &HistoryEntry) -> String {
    let unit = &last.unit;
    let (before, after) = (first.heldout_rms.before, last.heldout_rms.after);
    let floor = last.heldout_rms.noise_floor.map_or("unknown".to_owned(), |floor| format!("{floor:.4} {unit}"));
    let text = format!(
        "Error {before:.4} {} before the first effect was added, {after:.4} {unit} after the last; noise floor {floor}.",
        first.unit
    );
    format!("<p class=\"verdict\">{}</p>\n", escape(&text))
}

/// A model's history.
pub(super) fn history(history: &[HistoryEntry]) -> String {
    let row = |own: &HistoryEntry| {
        let rms = own.heldout_rms;
        vec![
            own.effect.clone(),
            format!("{:.4}", rms.before),
            format!("{:.4}", rms.after),
            optional(rms.noise_floor, 4),
            own.data.clone(),
            own.data_sha256.chars().take(16).collect(),
            own.date.clone().unwrap_or_default(),
        ]
    };
    let rows: Vec<Vec<String>> = history.iter().map(row).collect();
    table(
        &[
            "effect",
            &format!("error before ({})", history.first().map_or("deg", |own| own.unit.as_str())),
            "after",
            "noise floor",
            "data",
            "SHA-256 of the data, first 16 digits",
            "day",
        ],
        &rows,
    )
}
