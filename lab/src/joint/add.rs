//! Adding an effect to joints, fitted together with gain and offset; the model's own effects are held here, and `crate::add` fits theirs again.

use super::answer;
use super::beside::settle;
use super::decide::{candidates, fast_noise, problem};
use super::floor::{Floor, floor};
use super::gate::{Blocks, held_out};
use super::kind::Kind;
use super::numbers::{excluded, names_and_trials};
use super::refine::{Fit, Loss, refine};
use super::search::Search;
use super::signal::Signal;
use super::simulate::Varies;
use super::starts::settled;
use super::still::moves;
use super::terms::{self, Value, term};
use crate::add::Added;
use crate::fit::{Uncertainty, Variable};
use crate::machine::{JointsLab, MachineUnderTest};
use crate::stage::stage;
use crate::{AddOptions, LabError, Measurements, Term};

/// Rows of the loss.
const MOST_ROWS: usize = 10_000;

/// The effect on the joint that it names, or on every joint; `None` for an effect that is not searched for by itself.
///
/// # Errors
/// [`LabError`] where the model's own effects make no chain.
pub(crate) fn add(machine: &JointsLab, data: &Measurements, options: &AddOptions) -> Result<Option<Added>, LabError> {
    let (machine, _) = &settled(machine, data, &options.recordings)?;
    let wanted = &options.term;
    let (names, first_trials) = names_and_trials(&options.recordings);
    let excluded = excluded(machine, data)?;
    let only = wanted.values.first().map_or(0, |joint| joint.round() as usize);
    let mut terms = machine.effects().to_vec();
    let (mut variables, mut robust, mut naive) = (Vec::new(), Vec::new(), Vec::new());
    let (mut before, mut after) = (0.0, 0.0);
    let mut floors = Vec::new();
    let mut calibration = Vec::new();
    let mut is_known = false;
    stage("Fitting the effect");
    for joint in 0..data.n_outputs {
        let signal = Signal::new(machine, data, joint, &excluded, MOST_ROWS, &first_trials)?;
        let signal = if wanted.varying.is_some() { signal.with_columns(data) } else { signal };
        let weight = vec![1.0; signal.rows.len()];
        let loss = Loss { weight: &weight, noise: fast_noise(&signal) };
        let own = candidates(&signal).into_iter().filter(|kind| is_wanted(*kind, wanted)).collect();
        let search = Search::new(&signal, loss, own);
        let is_in_scope = (only == 0 || only == joint + 1) && moves(data, joint, &options.recordings);
        let fitted: Option<Fit> = search
            .candidates
            .iter()
            .filter(|_| is_in_scope)
            .filter_map(|kind| search.extend(search.base(), *kind))
            .map(|fit| search.deepen(&fit))
            .map(|fit| with_column(&search, fit, wanted))
            .min_by(|a, b| a.square().total_cmp(&b.square()));
        is_known |= fitted.is_some();
        let fit = fitted.unwrap_or_else(|| search.base().clone());
        let times = super::search::n_effective(&fit);
        let blocks = Blocks::new(&signal, times);
        let errors = [search.base(), &fit].map(|fit| held_out(&signal, fit, loss, &blocks, 3).mean_square);
        (before, after) = (before + errors[0], after + errors[1]);
        let problem = problem(machine, data, &signal, times);
        floors.push(floor(&signal, &problem, &fit, errors[1].min(errors[0]).sqrt()));
        let values = terms::values(&signal, &fit, &problem);
        for (member, values) in fit.members.iter().zip(&values.members) {
            terms.push(term(member.kind, joint, values));
            for (variable, value) in fitted_variables(machine, &terms, values)? {
                variables.push(variable);
                robust.push(value.se);
                naive.push(value.se_naive);
            }
        }
        calibration.extend(answer::of_machine(machine, joint, &values, &names));
    }
    let (_, scale) = machine.error_unit();
    let floor = of_all(&floors);
    Ok(is_known.then(|| Added {
        terms,
        variables,
        uncertainty: Uncertainty { robust, naive },
        before: before.sqrt() * scale,
        after: after.sqrt() * scale,
        noise_floor: floor.map(|(sigma, _)| sigma * scale),
        floor_relative_error: floor.map_or(0.0, |(_, error)| error),
        calibration,
        joint_numbers: Vec::new(),
    }))
}

/// The length of all joints' floors together, with its relative standard error; `None` where one of them is not known.
fn of_all(floors: &[Floor]) -> Option<(f64, f64)> {
    let squares: Vec<f64> = floors.iter().map(|own| own.sigma.map(|sigma| sigma * sigma)).collect::<Option<_>>()?;
    let sum: f64 = squares.iter().sum();
    let spread = squares.iter().zip(floors).map(|(square, own)| (square * own.relative_error).powi(2)).sum::<f64>();
    Some((sum.sqrt(), if sum > 0.0 { spread.sqrt() / sum } else { 0.0 }))
}

/// The fit with a number that depends on the column that was asked for.
fn with_column(search: &Search, fit: Fit, wanted: &Term) -> Fit {
    let Some(varying) = &wanted.varying else { return fit };
    let Some(column) = search.signal.columns.iter().position(|own| own.name == varying.column) else { return fit };
    let mut members = fit.members.clone();
    members.iter_mut().for_each(|own| own.varies = Some(Varies { column, slope: 0.0 }));
    settle(search, refine(search.signal, &members, search.loss, 15, 1e-6, true))
}

fn is_wanted(kind: Kind, wanted: &Term) -> bool {
    let from = || wanted.values.get(1).map_or(0, |from| from.round() as usize);
    match kind {
        Kind::Coupling(k) => wanted.name == kind.name() && (from() == k + 1 || from() == 0),
        Kind::Curve => false,
        _ => wanted.name == kind.name(),
    }
}

/// The variables of the last effect's fitted values.
pub(super) fn fitted_variables<'v>(
    machine: &JointsLab,
    terms: &[Term],
    values: &'v [Value],
) -> Result<Vec<(Variable, &'v Value)>, LabError> {
    let place = terms.len() - 1;
    let parameters = machine.parameters(&terms[place])?;
    let fitted = values.iter().filter(|value| value.se > 0.0);
    let one = |value: &'v Value| {
        let k = parameters.iter().position(|own| own.name == value.name)?;
        Some(Variable::new(machine, terms, place, k, value.value).map(|variable| (variable, value)))
    };
    fitted.filter_map(one).collect()
}
