//! Are a snake's columns what their names say? Lines exchanged or negated, a mirrored camera, a wrong unit: said before any effect
//! is named. Each is what another order, sign or unit would make of the model's prediction.

use crate::machine::Machine;
use crate::{LabError, Measurements};

/// Rows that are looked at.
const ROWS: usize = 1500;
/// An error above this share of the shapes' own size is no physics, ...
const NONSENSE: f64 = 0.5;
/// ... if another reading of the columns leaves less than this part of it.
const MUCH_BETTER: f64 = 0.35;
/// Orders of the three lines, with what they are called.
const ORDERS: [([usize; 3], &str); 6] = [
    ([0, 1, 2], ""),
    ([1, 0, 2], "q1 and q2 are probably exchanged"),
    ([2, 1, 0], "q1 and q3 are probably exchanged"),
    ([0, 2, 1], "q2 and q3 are probably exchanged"),
    ([1, 2, 0], "the lines are probably in another order (q1 is the second, q2 the third)"),
    ([2, 0, 1], "the lines are probably in another order (q1 is the third, q2 the first)"),
];
/// Units of the lines, and of the shape, by which a column can be wrong.
const UNITS: [(f64, &str); 3] = [
    (1.0, ""),
    (1e-3, "q is probably in thousandths of the unit that its header says"),
    (1e3, "q is probably in thousands of the unit that its header says"),
];
/// What a camera can do to the shape: signs of both components, and whether they are exchanged.
const VIEWS: [([f64; 2], bool, &str); 6] = [
    ([1.0, 1.0], false, ""),
    ([1.0, -1.0], false, "the camera's picture is probably mirrored (bend_y has the other sign)"),
    ([-1.0, 1.0], false, "the camera's picture is probably mirrored (bend_x has the other sign)"),
    ([1.0, 1.0], true, "bend_x and bend_y are probably exchanged"),
    ([DEG, DEG], false, "the shape is probably in degrees where its header says radians"),
    ([1.0 / DEG, 1.0 / DEG], false, "the shape is probably in radians where its header says degrees"),
];
const DEG: f64 = 180.0 / core::f64::consts::PI;

/// What is probably wrong with the columns, a sentence; `None` where they are as they should be, or nothing explains them.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(super) fn check(machine: &dyn Machine, data: &Measurements) -> Result<Option<String>, LabError> {
    if data.n_inputs != 3 || data.n_outputs != 2 {
        return Ok(None);
    }
    let stride = data.n_rows().div_ceil(ROWS).max(1);
    let few = data.select(&(0..data.n_rows()).step_by(stride).collect::<Vec<_>>());
    let given = machine.predict(machine.effects(), &few)?;
    let size = rms(few.outputs.iter().copied());
    let before = error(&few, &given, VIEWS[0].0, false);
    if !(before > NONSENSE * size.max(rms(given.iter().copied()))) {
        return Ok(None);
    }
    let mut best: Option<(f64, String)> = None;
    for (order, of_order) in ORDERS {
        for sign in [1.0, -1.0] {
            for (unit, of_unit) in UNITS {
                let mut other = few.clone();
                for (own, q) in few.inputs.chunks(3).zip(other.inputs.chunks_mut(3)) {
                    (0..3).for_each(|k| q[k] = sign * unit * own[order[k]]);
                }
                // A reading that the machine cannot follow is not the right one.
                let Ok(predicted) = machine.predict(machine.effects(), &other) else { continue };
                for (signs, is_turned, of_view) in VIEWS {
                    let of_sign = if sign < 0.0 { "q is probably negated" } else { "" };
                    let said = [of_order, of_sign, of_unit, of_view].map(str::to_owned);
                    let said: Vec<String> = said.into_iter().filter(|own| !own.is_empty()).collect();
                    // Two mistakes at once are believed less than one that explains as much.
                    let left = error(&few, &predicted, signs, is_turned) * (1.0 + 0.1 * said.len() as f64);
                    if !said.is_empty() && best.as_ref().is_none_or(|(least, _)| left < *least) {
                        best = Some((left, said.join(" and ")));
                    }
                }
            }
        }
    }
    let (unit, scale) = machine.error_unit();
    Ok(best
        .filter(|(left, _)| *left < MUCH_BETTER * before)
        .map(|(left, said)| format!("{said}: {:.3} {unit} becomes {:.3} {unit}", before * scale, left * scale)))
}

/// Length of the error, root mean square over rows, of shapes read with these signs.
fn error(data: &Measurements, predicted: &[f64], signs: [f64; 2], is_turned: bool) -> f64 {
    let rows = data.outputs.chunks(2).zip(predicted.chunks(2)).filter(|(seen, _)| seen[0].is_finite());
    let (sum, n) = rows.fold((0.0, 0.0), |(sum, n), (seen, own)| {
        let seen = if is_turned { [seen[1], seen[0]] } else { [seen[0], seen[1]] };
        let square: f64 = (0..2).map(|k| (seen[k] / signs[k] - own[k]).powi(2)).sum();
        (sum + square, n + 1.0)
    });
    (sum / f64::max(n, 1.0)).sqrt()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (2.0 * sum / f64::max(n, 1.0)).sqrt()
}
