//! Are the columns what their names say? Exchanged, negated or in another unit: said before any effect is named.

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

/// What is probably wrong with the columns, a sentence each.
///
/// # Errors
/// [`LabError::Chain`] where the model's own effects make no chain.
pub(super) fn check(machine: &JointsLab, data: &Measurements) -> Result<Vec<String>, LabError> {
    let n = data.n_outputs;
    let [passed, added, _] = machine.parts(data)?;
    let x: Vec<f64> = passed.iter().zip(&added).map(|(p, a)| p + a).collect();
    let lines: Vec<Vec<Line>> = (0..n).map(|i| (0..n).map(|k| line(&x, &data.outputs, n, k, i)).collect()).collect();
    let (unit, scale) = machine.error_unit();
    let mut said = Vec::new();
    for i in 0..n {
        let own = &lines[i][i];
        let exchanged = (i + 1..n).find(|&k| {
            let crossed = lines[i][k].share > FOLLOWS && lines[k][i].share > FOLLOWS;
            crossed && own.share < DOES_NOT && lines[k][k].share < DOES_NOT
        });
        if let Some(k) = exchanged {
            let spread = |share: f64| deviation(&data.outputs, n, i) * scale * (1.0 - share).max(0.0).sqrt();
            said.push(format!(
                "{} and {} are probably exchanged: {:.3} {unit} becomes {:.3} {unit}",
                data.names.output(i),
                data.names.output(k),
                spread(own.share),
                spread(lines[i][k].share)
            ));
            continue;
        }
        if own.share < FOLLOWS {
            continue;
        }
        let Number::Held(held) = machine.gain_known(i) else { continue };
        let ratio = own.gain / held;
        let a_unit = UNITS.iter().find(|(factor, _)| (ratio.abs() / factor - 1.0).abs() < NEAR_A_UNIT);
        if let Some((_, what)) = a_unit {
            said.push(format!(
                "{} is probably {what}: its gain is {:.4} where the model holds {held}",
                data.names.output(i),
                own.gain
            ));
        } else if ratio < -0.3 {
            said.push(format!(
                "{} is probably negated: its gain is {:.4} where the model holds {held}; correct the column or leave `gain` out",
                data.names.output(i),
                own.gain
            ));
        }
    }
    Ok(said)
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
