//! The error after each effect, down to the noise floor, with intervals.

use super::picture::{COLOURS, Floor, Picture, layout, plain, short};
use super::rows::Rows;
use crate::diagnose::{Diagnosis, FoundEffect};
use crate::fit::{Fit, Variable, fit, held_out_output_squares};
use crate::machine::MachineUnderTest;
use crate::prepare::prepare;
use crate::{Added, LabError, Measurements, Problem, Term};
use plotly::Bar;
use plotly::common::{ErrorData, ErrorType, Marker};

/// Folds of the held-out error, as in the diagnosis.
const FOLDS: usize = 6;
/// Two-sided 95 % of a normal variable.
const Z: f64 = 1.96;
const ITERATIONS: u32 = 10;
/// Stretches of time whose errors are compared where a list of effects does not hold all that was fitted.
const STRETCHES: usize = 24;

/// One bar: its name, the error, and half its 95 % interval where it is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    pub name: String,
    pub rms: f64,
    pub half_width: Option<f64>,
}

/// The waterfall of a diagnosis.
pub(super) fn of_diagnosis(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    diagnosis: &Diagnosis,
    rows: &Rows,
) -> Result<Vec<Picture>, LabError> {
    let found = if diagnosis.effects.is_empty() { &diagnosis.partial } else { &diagnosis.effects };
    let problem = prepare(machine, data)?.problem;
    let half_width = |n_effects: usize, rms: f64| match (&diagnosis.calibrated, n_effects) {
        (None, _) => half_width(&problem, diagnosis, found, n_effects),
        // Joints are fitted with their calibration and start states, which a list of effects does not hold.
        (Some(_), 0) => Ok(relative_half_width(rows, 0).map(|part| part * rms)),
        (Some(_), n) if n == found.len() && rows.models.len() == 2 => {
            Ok(relative_half_width(rows, 1).map(|part| part * rms))
        }
        (Some(_), _) => Ok(None),
    };
    let mut steps = vec![Step {
        name: if diagnosis.is_calibrated() { "model after calibration" } else { "model as given" }.to_owned(),
        rms: diagnosis.base_heldout_rms,
        half_width: half_width(0, diagnosis.base_heldout_rms)?,
    }];
    for (k, effect) in found.iter().enumerate() {
        steps.push(Step {
            name: format!("+ {}", effect.name),
            rms: effect.after,
            half_width: half_width(k + 1, effect.after)?,
        });
    }
    Ok(vec![picture(&steps, diagnosis.noise_floor, machine.error_unit().0)])
}

/// The waterfall of a model before and after, with intervals.
pub(super) fn of_added(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    added: &Added,
    what: &str,
) -> Result<Picture, LabError> {
    let problem = prepare(machine, data)?.problem;
    let interval = |terms: &[Term], variables: &[Variable]| {
        Ok::<_, LabError>(interval(&problem, &fit(&problem, terms, variables, 0, 1e-5)?))
    };
    let steps = [
        Step { name: "model before".to_owned(), rms: added.before, half_width: interval(machine.effects(), &[])? },
        Step { name: format!("+ {what}"), rms: added.after, half_width: interval(&added.terms, &added.variables)? },
    ];
    Ok(picture(&steps, added.noise_floor, machine.error_unit().0))
}

/// Half the interval of the held-out error with the first effects.
fn half_width(
    problem: &Problem,
    diagnosis: &Diagnosis,
    found: &[FoundEffect],
    n_effects: usize,
) -> Result<Option<f64>, LabError> {
    let base = problem.machine.effects().len();
    let effects: Vec<Term> = diagnosis.terms.iter().take(base + n_effects).cloned().collect();
    let mut variables = Vec::new();
    for (slot, effect) in found.iter().take(n_effects).enumerate() {
        for (k, parameter) in effect.parameters.iter().enumerate().filter(|(_, parameter)| parameter.is_free) {
            let size = if parameter.value == 0.0 { 1e-6 } else { parameter.value };
            variables.push(Variable::new(problem.machine, &effects, base + slot, k, size)?);
        }
    }
    // Effects before the last one have to find their values without those that follow.
    let iterations = if n_effects == found.len() { 0 } else { ITERATIONS };
    Ok(interval(problem, &fit(problem, &effects, &variables, iterations, 1e-5)?))
}

/// Half the 95 % interval of a fit's held-out error, from how much it differs between blocks of time.
fn interval(problem: &Problem, fitted: &Fit) -> Option<f64> {
    let squares = held_out_output_squares(problem, fitted, FOLDS);
    let rms = problem.rms_of_outputs(squares.iter().sum()) * problem.machine.error_unit().1;
    relative_of(&squares).map(|part| part * rms)
}

/// The same as a part of the error that a model leaves, from stretches of as many rows each.
fn relative_half_width(rows: &Rows, model: usize) -> Option<f64> {
    let size = rows.scored.len().div_ceil(STRETCHES).max(1);
    let stretches = rows.scored.chunks_exact(size);
    let squares: Vec<f64> = stretches.map(|own| own.iter().map(|&row| rows.square(model, row)).sum()).collect();
    relative_of(&squares)
}

/// Half the interval of the root mean square, as a part of it: d rms = rms / 2 * d (mean square) / (mean square).
fn relative_of(squares: &[f64]) -> Option<f64> {
    let n = squares.len() as f64;
    if squares.len() < 3 {
        return None;
    }
    let mean = squares.iter().sum::<f64>() / n;
    let variance = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean > 0.0).then(|| Z * 0.5 * (variance / n).sqrt() / mean)
}

/// Share of what the first step leaves above the floor that a later one explains.
pub(super) fn explained(first: f64, rms: f64, floor: Option<f64>) -> Option<f64> {
    let floor = floor?;
    let explainable = first * first - floor * floor;
    (explainable > 0.0).then(|| (first * first - rms * rms) / explainable)
}

/// Bars of steps, and the floor as a line.
pub(super) fn picture(steps: &[Step], floor: Option<f64>, unit: &str) -> Picture {
    let first = steps.first().map_or(0.0, |step| step.rms);
    let text = |step: &Step| match explained(first, step.rms, floor) {
        Some(share) => format!("{:.3} {}, {:.0} % explained", step.rms, plain(unit), 100.0 * share),
        None => format!("{:.3} {}", step.rms, plain(unit)),
    };
    let mut names: Vec<String> = Vec::new();
    for (k, step) in steps.iter().enumerate() {
        // Bars of one name would lie on each other.
        let number = if names.contains(&plain(&step.name)) { format!(" ({})", k + 1) } else { String::new() };
        names.push(plain(&format!("{}{number}", step.name)));
    }
    // Below the bars, where no whisker crosses it.
    for (name, step) in names.iter_mut().zip(steps) {
        *name = format!("{name}<br>{}", text(step));
    }
    let values: Vec<f64> = steps.iter().map(|step| short(step.rms)).collect();
    let whiskers: Vec<f64> = steps.iter().map(|step| short(step.half_width.unwrap_or(f64::NAN))).collect();
    let has_whiskers = whiskers.iter().any(|half| half.is_finite());
    let bars = Bar::new(names, values)
        .name(if has_whiskers { "error, rms; whiskers: 95 % interval" } else { "error, rms" })
        .marker(Marker::new().color(COLOURS[2]))
        .error_y(ErrorData::new(ErrorType::Data).array(whiskers));
    let sentence = "The fall of each bar is what its effect brings on data that it was not fitted to; where the last bar meets \
                    the line of the noise floor, nothing explainable is left (100 %).";
    let layout = Floor::new(floor, "noise floor", unit).on(layout("", &format!("error, rms ({unit})")));
    Picture::with_layout("Waterfall", sentence, layout, vec![bars])
}

#[cfg(test)]
mod tests {
    use super::{explained, relative_of};

    #[test]
    fn the_interval_of_an_error_is_that_of_its_blocks() {
        assert_eq!(relative_of(&[1.0, 1.0]), None);
        // Mean 2, standard deviation sqrt(4 / 3) of 4 blocks.
        let part = relative_of(&[1.0, 3.0, 1.0, 3.0]).unwrap_or_default();
        assert!((part - 1.96 * 0.25 * (1.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{part}");
    }

    #[test]
    fn all_that_is_above_the_floor_is_what_can_be_explained() {
        assert_eq!(explained(2.0, 1.0, Some(1.0)), Some(1.0));
        assert_eq!(explained(2.0, 2.0, Some(1.0)), Some(0.0));
        assert_eq!(explained(1.0, 1.0, Some(1.0)), None);
        assert_eq!(explained(2.0, 1.0, None), None);
    }
}
