//! Are a snake's columns what their names say? Lines exchanged or negated, bends in another unit: said before any effect is named.

use crate::{LabError, Measurements, Problem, Quantity};
use rayon::prelude::*;

/// Errors this many times the noise are looked at, ...
const LARGE: f64 = 5.0;
/// ... and another arrangement of the columns is probable when it leaves less than this part of them.
const MUCH_LESS: f64 = 0.35;
/// Degrees in a radian.
const DEG_PER_RAD: f64 = 180.0 / core::f64::consts::PI;

/// Another arrangement of the columns: which column is each line's, the sign of all, and a factor on the measured bends.
struct Arrangement {
    lines: [usize; 3],
    sign: f64,
    factor: f64,
    what: &'static str,
}

const TRUE: [usize; 3] = [0, 1, 2];

/// What is tried, the likeliest first: of two that explain the same, one is said.
#[rustfmt::skip]
const ARRANGEMENTS: [Arrangement; 13] = [
    Arrangement { lines: [1, 0, 2], sign: 1.0, factor: 1.0, what: "q1 and q2 are probably exchanged" },
    Arrangement { lines: [0, 2, 1], sign: 1.0, factor: 1.0, what: "q2 and q3 are probably exchanged, or the camera's picture is mirrored" },
    Arrangement { lines: [2, 1, 0], sign: 1.0, factor: 1.0, what: "q1 and q3 are probably exchanged" },
    Arrangement { lines: TRUE, sign: -1.0, factor: 1.0, what: "q1, q2 and q3 are probably all negated (push is positive), or the bend's plane is turned by half a turn" },
    Arrangement { lines: [1, 2, 0], sign: 1.0, factor: 1.0, what: "the lines are probably numbered from another one: q2, q3, q1, or the bend's plane is turned by a third of a turn" },
    Arrangement { lines: [2, 0, 1], sign: 1.0, factor: 1.0, what: "the lines are probably numbered from another one: q3, q1, q2, or the bend's plane is turned by a third of a turn" },
    Arrangement { lines: [1, 0, 2], sign: -1.0, factor: 1.0, what: "q1 and q2 are probably exchanged and all three negated" },
    Arrangement { lines: [0, 2, 1], sign: -1.0, factor: 1.0, what: "q2 and q3 are probably exchanged and all three negated, or the camera's picture is mirrored the other way" },
    Arrangement { lines: [2, 1, 0], sign: -1.0, factor: 1.0, what: "q1 and q3 are probably exchanged and all three negated" },
    Arrangement { lines: [1, 2, 0], sign: -1.0, factor: 1.0, what: "the lines are probably numbered q2, q3, q1 and all three negated" },
    Arrangement { lines: [2, 0, 1], sign: -1.0, factor: 1.0, what: "the lines are probably numbered q3, q1, q2 and all three negated" },
    Arrangement { lines: TRUE, sign: 1.0, factor: 1.0 / DEG_PER_RAD, what: "the bends are probably in degrees where radians are expected" },
    Arrangement { lines: TRUE, sign: 1.0, factor: DEG_PER_RAD, what: "the bends are probably in radians where degrees are expected" },
];

/// What is probably wrong with the columns, a sentence; `None` where they are as good as any. `noise` is that of one output, if known.
///
/// # Errors
/// [`LabError::Chain`] where the model's own effects make no chain.
pub(super) fn check(problem: &Problem, noise: Option<f64>) -> Result<Option<String>, LabError> {
    let data = &problem.data;
    if data.quantity == Quantity::Segments || data.n_inputs != 3 || data.n_outputs != 2 {
        return Ok(None);
    }
    let rms = |own: &Arrangement, inputs: &Measurements| -> Result<f64, LabError> {
        let predicted = problem.machine.predict(problem.machine.effects(), inputs)?;
        let entries = data.outputs.iter().zip(&predicted).zip(&problem.weight).filter(|(_, weight)| **weight > 0.0);
        let (sum, n) = entries.fold((0.0, 0.0), |(sum, n), ((y, f), _)| (sum + (own.factor * y - f).powi(2), n + 1.0));
        // In the unit of the bends as they stand.
        Ok((2.0 * sum / f64::max(n, 1.0)).sqrt() / own.factor)
    };
    let given = Arrangement { lines: TRUE, sign: 1.0, factor: 1.0, what: "" };
    let before = rms(&given, data)?;
    if noise.is_some_and(|noise| before < LARGE * noise * 2f64.sqrt()) {
        return Ok(None);
    }
    let others: Vec<f64> =
        ARRANGEMENTS.par_iter().map(|own| rms(own, &arranged(data, own)).unwrap_or(f64::INFINITY)).collect();
    let best = others.iter().zip(&ARRANGEMENTS).min_by(|a, b| a.0.total_cmp(b.0));
    let (_, scale) = problem.machine.error_unit();
    Ok(best
        .filter(|(after, _)| **after < MUCH_LESS * before)
        .map(|(after, own)| format!("{}: {:.3} deg becomes {:.3} deg", own.what, before * scale, after * scale)))
}

fn arranged(data: &Measurements, own: &Arrangement) -> Measurements {
    let inputs = data.inputs.chunks(3).flat_map(|row| own.lines.map(|line| own.sign * row[line])).collect();
    Measurements { inputs, ..data.clone() }
}
