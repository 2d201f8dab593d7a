//! Are the columns what their names say? Exchanged, in another order, negated or in another unit: said before any effect is named.

use super::signal::Number;
use crate::machine::{JointsLab, MachineUnderTest};
use crate::{LabError, Measurements};

/// A measured joint follows a command when this much of its variance is a straight line of it, ...
const FOLLOWS: f64 = 0.9;
/// ... and does not follow below this.
const DOES_NOT: f64 = 0.5;
/// Gains that only a wrong unit makes: radians and degrees, metres and millimetres.
const UNITS: [(f64, &str); 4] = [
    (180.0 / core::f64::consts::PI, "measured in degrees where the model says radians"),
    (core::f64::consts::PI / 180.0, "measured in radians where the model says degrees"),
    (1000.0, "measured in thousandths of the model's unit"),
    (0.001, "measured in thousands of the model's unit"),
];
const NEAR_A_UNIT: f64 = 0.15;

/// A straight line through a command and a measurement.
struct Line {
    gain: f64,
    share: f64,
}

/// What is odd about the columns, a sentence each.
#[derive(Debug, Default)]
pub(super) struct Hints {
    /// What makes every effect's name worthless until it is mended.
    pub wrong: Vec<String>,
    /// What a free gain takes up, and yet nobody may have meant.
    pub odd: Vec<String>,
    /// Measured columns in another order: the joint, from 0, whose measurement it is, and the one that it is called by.
    pub order: Vec<(usize, usize)>,
}

/// What is probably wrong with the columns.
///
/// # Errors
/// [`LabError::Chain`] where the model's own effects make no chain.
pub(super) fn check(machine: &JointsLab, data: &Measurements) -> Result<Hints, LabError> {
    let n = data.n_outputs;
    let [passed, added, _] = machine.parts(data)?;
    let x: Vec<f64> = passed.iter().zip(&added).map(|(p, a)| p + a).collect();
    let lines: Vec<Vec<Line>> = (0..n).map(|i| (0..n).map(|k| line(&x, &data.outputs, n, k, i)).collect()).collect();
    let mut hints = Hints::default();
    let follows = |i: usize| {
        let other = (0..n).max_by(|a, b| lines[i][*a].share.total_cmp(&lines[i][*b].share))?;
        (lines[i][i].share < DOES_NOT && lines[i][other].share > FOLLOWS).then_some(other)
    };
    let order: Vec<Option<usize>> = (0..n).map(follows).collect();
    for i in 0..n {
        match order[i] {
            Some(other) if other > i && order[other] == Some(i) => hints.wrong.push(exchanged(machine, data, &lines, i, other)),
            Some(other) if order[other] != Some(i) => hints.wrong.push(format!(
                "{} probably belongs to {}: it follows that command ({:.0} % of it is a straight line of it) and not its own ({:.0} %)",
                data.names.output(i),
                data.names.input(other),
                100.0 * lines[i][other].share,
                100.0 * lines[i][i].share
            )),
            Some(_) => {}
            None if lines[i][i].share >= FOLLOWS => gain(machine, data, i, lines[i][i].gain, &mut hints),
            None => {}
        }
    }
    let moved = order.iter().enumerate().filter_map(|(i, other)| other.map(|other| (other, i)));
    let (joints, called): (Vec<usize>, Vec<usize>) = moved.unzip();
    let mut sorted = joints.clone();
    sorted.sort_unstable();
    // Each joint has one column, and none is left over.
    if sorted == called {
        hints.order = joints.into_iter().zip(called).collect();
    }
    Ok(hints)
}

/// Two columns in each other's place.
fn exchanged(machine: &JointsLab, data: &Measurements, lines: &[Vec<Line>], i: usize, k: usize) -> String {
    let (unit, scale) = machine.error_unit();
    let spread = |share: f64| deviation(&data.outputs, data.n_outputs, i) * scale * (1.0 - share).max(0.0).sqrt();
    format!(
        "{} and {} are probably exchanged: {:.3} {unit} becomes {:.3} {unit}",
        data.names.output(i),
        data.names.output(k),
        spread(lines[i][i].share),
        spread(lines[i][k].share)
    )
}

/// What the gain of a column that follows its own command says of its unit and sign.
fn gain(machine: &JointsLab, data: &Measurements, i: usize, gain: f64, hints: &mut Hints) {
    let name = data.names.output(i);
    let of_a_unit = |ratio: f64| UNITS.iter().find(|(factor, _)| (ratio.abs() / factor - 1.0).abs() < NEAR_A_UNIT);
    match machine.gain_known(i) {
        Number::Held(0.0) => hints.wrong.push(format!(
            "{name} follows its command with a gain of {gain:.4}, and the model holds a gain of 0; leave `gain` out or correct it"
        )),
        Number::Held(held) => {
            if let Some((_, what)) = of_a_unit(gain / held) {
                hints.wrong.push(format!("{name} is probably {what}: its gain is {gain:.4} where the model holds {held}"));
            } else if gain / held < -0.3 {
                hints.wrong.push(format!(
                    "{name} is probably negated: its gain is {gain:.4} where the model holds {held}; correct the column or leave `gain` out"
                ));
            }
        }
        // A free gain takes up a wrong unit; then every length that the fit finds is in that unit.
        _ => {
            let own = machine.joints();
            if let Some((_, what)) = of_a_unit(gain).filter(|_| own.u_unit == own.y_unit) {
                hints.odd.push(format!(
                    "{name} may be {what}: its gain is {gain:.4} although both are in {}; check the unit in the file's header or the mapping",
                    own.y_unit
                ));
            }
        }
    }
}

fn line(x: &[f64], y: &[f64], n: usize, from: usize, to: usize) -> Line {
    let pairs = || {
        let rows = x.iter().skip(from).step_by(n).zip(y.iter().skip(to).step_by(n));
        rows.filter(|(_, y)| y.is_finite())
    };
    let count = pairs().count().max(1) as f64;
    let (mx, my) = pairs().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / count, b + y / count));
    let (xx, xy, yy) = pairs().fold((0.0, 0.0, 0.0), |(xx, xy, yy), (x, y)| {
        let (x, y) = (x - mx, y - my);
        (xx + x * x, xy + x * y, yy + y * y)
    });
    let is_still = xx <= 0.0 || yy <= 0.0;
    Line { gain: if is_still { 0.0 } else { xy / xx }, share: if is_still { 0.0 } else { xy * xy / (xx * yy) } }
}

fn deviation(y: &[f64], n: usize, k: usize) -> f64 {
    let own: Vec<f64> = y.iter().skip(k).step_by(n).copied().filter(|y| y.is_finite()).collect();
    let mean = own.iter().sum::<f64>() / own.len().max(1) as f64;
    (own.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / own.len().max(1) as f64).sqrt()
}
