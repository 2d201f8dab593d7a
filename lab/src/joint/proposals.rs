//! Formulas for what the effects leave of a joint: a few terms of a dictionary, each with its gain and what it takes away.
//!
//! One term after another is chosen that takes most on blocks it was not fitted to, beside gain, offset and everything else that the fit
//! can do; a term must pay for its number. The gains are those of all chosen terms together.

use super::refine::{Fit, tangents};
use super::search::n_effective;
use super::signal::Signal;
use crate::Measurements;
use crate::Problem;
use crate::diagnose::FormulaTerm;
use crate::diagnose::screen::{block_moments, orthonormal, remove, total};
use crate::diagnose::structure::held_out_share;
use crate::fit::{dot, inverse, standard_errors};
use crate::machine::JointsLab;
use krait_model::effects::is_free_word;

/// Terms at most.
const MOST: usize = 3;
/// A term takes at least this share of what is left, on blocks that it was not fitted to, ...
const LEAST: f64 = 0.1;
/// ... and pays this for its number, in units of ln N.
const PRICE: f64 = 2.0;
/// Places of a bend in the characteristic.
const PLACES: usize = 9;

/// One term: how it is written, the unit of its gain, and its value in every row of the loss.
struct Entry {
    text: String,
    /// The name in it that stands for a column, and the column.
    beside: Option<(String, String)>,
    unit: String,
    column: Vec<f64>,
}

/// What the rest of a joint looks like, the term that takes most first; empty where none pays.
pub(super) fn proposals(
    machine: &JointsLab,
    data: &Measurements,
    problem: &Problem,
    signal: &Signal,
    fit: &Fit,
) -> Vec<FormulaTerm> {
    let entries = dictionary(machine, data, signal);
    let mut residual = fit.solution.residual.clone();
    let basis = orthonormal(&tangents(signal, fit));
    let times = n_effective(fit);
    let mut chosen: Vec<(usize, f64)> = Vec::new();
    let mut taken = basis.clone();
    while chosen.len() < MOST {
        let best = entries.iter().enumerate().filter(|(k, _)| chosen.iter().all(|(own, _)| own != k));
        let best = best.filter_map(|(k, entry)| {
            let column = beside(&taken, entry);
            // What the fit can make itself is no proposal.
            let is_new = dot(&column, &column) >= 1e-6 * dot(&entry.column, &entry.column);
            let share = || held_out_share(problem, &block_moments(problem, &[column], &residual), &residual);
            is_new.then(|| (k, share()))
        });
        let Some((k, share)) = best.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if share < LEAST || -times * (1.0 - share).max(1e-12).ln() < PRICE * times.ln() {
            break;
        }
        chosen.push((k, share));
        let direction = orthonormal(&[beside(&taken, &entries[k])]);
        remove(&direction, &mut residual);
        taken.extend(direction);
    }
    let columns: Vec<Vec<f64>> = chosen.iter().map(|(k, _)| beside(&basis, &entries[*k])).collect();
    let (score, gram) = total(&block_moments(problem, &columns, &fit.solution.residual));
    let gains = inverse(&gram) * score;
    let (errors, _) = standard_errors(problem, &columns, &residual);
    let proposal = |(n, (k, share)): (usize, &(usize, f64))| FormulaTerm {
        joint: signal.joint + 1,
        term: entries[*k].text.clone(),
        column: entries[*k].beside.clone(),
        gain: gains[n],
        se: errors[n],
        unit: entries[*k].unit.clone(),
        share: *share,
    };
    chosen.iter().enumerate().map(proposal).collect()
}

/// A column's name as a formula can write it.
fn identifier(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect();
    let plain = plain.split('_').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("_");
    if is_free_word(&plain) { plain } else { format!("column_{plain}") }
}

/// A term's column without what these orthonormal directions make of it.
fn beside(directions: &[Vec<f64>], entry: &Entry) -> Vec<f64> {
    let mut column = entry.column.clone();
    remove(directions, &mut column);
    column
}

/// Terms of what a formula of joints can see, and what no effect of the library makes.
fn dictionary(machine: &JointsLab, data: &Measurements, signal: &Signal) -> Vec<Entry> {
    let (u_unit, y_unit) = (&machine.joints().u_unit, &machine.joints().y_unit);
    let command = &signal.inputs[signal.joint];
    // Sign of the last change, 0 before the first, as a formula's `motion_i`.
    let mut motion = vec![0.0; signal.n()];
    for row in 1..signal.n() {
        let change = command[row] - command[row - 1];
        motion[row] = match signal.fresh[row] {
            true => 0.0,
            false if change == 0.0 => motion[row - 1],
            false => change.signum(),
        };
    }
    let entry = |text: &str, unit: String, value: &dyn Fn(usize) -> f64| Entry {
        text: text.to_owned(),
        beside: None,
        unit,
        column: signal.rows.iter().map(|&row| value(row)).collect(),
    };
    let per = |unit: &str| if unit == y_unit { "1".to_owned() } else { format!("{y_unit}/{unit}") };
    let mut all = vec![
        entry("motion_i", y_unit.clone(), &|row| motion[row]),
        entry("motion_i * u_i", per(u_unit), &|row| motion[row] * command[row]),
        entry("motion_i * abs(u_i)", per(u_unit), &|row| motion[row] * command[row].abs()),
        entry("abs(u_i)", per(u_unit), &|row| command[row].abs()),
        entry("sqrt(abs(u_i))", format!("{y_unit}/{u_unit}^0.5"), &|row| command[row].abs().sqrt()),
        entry("time_s * u_i", format!("{}/s", per(u_unit)), &|row| signal.time_s[row] * command[row]),
        entry("time_s^2", format!("{y_unit}/s^2"), &|row| signal.time_s[row].powi(2)),
    ];
    if u_unit == "rad" {
        all.push(entry("sin(u_i)", y_unit.clone(), &|row| command[row].sin()));
        all.push(entry("cos(u_i)", y_unit.clone(), &|row| command[row].cos()));
    }
    for column in signal.columns.iter().filter(|own| own.name != "temperature_c") {
        let name = identifier(&column.name);
        let value = |row: usize| column.middle + column.half * column.values[row];
        let of = |text: String, unit: String, value: &dyn Fn(usize) -> f64| Entry {
            beside: Some((name.clone(), column.name.clone())),
            ..entry(&text, unit, value)
        };
        all.extend([
            of(name.clone(), format!("{y_unit} per {}", column.name), &value),
            of(format!("{name} * u_i"), format!("{} per {}", per(u_unit), column.name), &|row| {
                value(row) * command[row]
            }),
            of(format!("motion_i * {name}"), format!("{y_unit} per {}", column.name), &|row| motion[row] * value(row)),
        ]);
    }
    if let Some(temperature_c) = data.temperature_c.as_ref().filter(|own| own.len() == signal.n()) {
        all.push(entry("temperature_c", format!("{y_unit}/K"), &|row| temperature_c[row]));
        all.push(entry("temperature_c * u_i", format!("{}/K", per(u_unit)), &|row| temperature_c[row] * command[row]));
    }
    for place in 1..=PLACES {
        let at = signal.low + signal.range * place as f64 / (PLACES + 1) as f64;
        // As many digits as the place deserves.
        let digits = (3.0 - signal.range.log10().floor()).clamp(0.0, 12.0) as usize;
        let at: f64 = format!("{at:.digits$}").parse().unwrap_or(at);
        let text = if at < 0.0 { format!("max(u_i + {}, 0)", -at) } else { format!("max(u_i - {at}, 0)") };
        all.push(entry(&text, per(u_unit), &|row| (command[row] - at).max(0.0)));
    }
    all
}
