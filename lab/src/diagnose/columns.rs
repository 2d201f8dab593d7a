//! Are the columns of a snake or of segments what their names say? Lines exchanged or negated, bends of another segment or in another
//! unit: said before any effect is named.

use crate::{LabError, Measurements, Problem, Quantity};
use core::f64::consts::PI;
use rayon::prelude::*;

/// Errors this many times the noise are looked at, ...
const LARGE: f64 = 5.0;
/// ... and another arrangement of the columns is probable when it leaves less than this part of them.
const MUCH_LESS: f64 = 0.35;
pub(super) const DEG_PER_RAD: f64 = 180.0 / PI;

/// Another arrangement of the columns.
struct Arrangement {
    /// Which column is each line's, and the sign of all.
    lines: Vec<usize>,
    sign: f64,
    /// Which column is each output's, with its factor.
    outputs: Vec<(usize, f64)>,
    what: String,
}

/// Arrangements of a snake's three lines and their sign, the likeliest first: of two that explain the same, one is said.
#[rustfmt::skip]
const OF_LINES: [([usize; 3], f64, &str); 11] = [
    ([1, 0, 2], 1.0, "q1 and q2 are probably exchanged"),
    ([0, 2, 1], 1.0, "q2 and q3 are probably exchanged, or the camera's picture is mirrored"),
    ([2, 1, 0], 1.0, "q1 and q3 are probably exchanged"),
    ([0, 1, 2], -1.0, "q1, q2 and q3 are probably all negated (push is positive), or the bend's plane is turned by half a turn"),
    ([1, 2, 0], 1.0, "the lines are probably numbered from another one: q2, q3, q1, or the bend's plane is turned by a third of a turn"),
    ([2, 0, 1], 1.0, "the lines are probably numbered from another one: q3, q1, q2, or the bend's plane is turned by a third of a turn"),
    ([1, 0, 2], -1.0, "q1 and q2 are probably exchanged and all three negated"),
    ([0, 2, 1], -1.0, "q2 and q3 are probably exchanged and all three negated, or the camera's picture is mirrored the other way"),
    ([2, 1, 0], -1.0, "q1 and q3 are probably exchanged and all three negated"),
    ([1, 2, 0], -1.0, "the lines are probably numbered q2, q3, q1 and all three negated"),
    ([2, 0, 1], -1.0, "the lines are probably numbered q3, q1, q2 and all three negated"),
];

/// What is probably wrong with the columns.
#[derive(Clone, Debug)]
pub(super) struct Hint {
    /// In a sentence.
    pub said: String,
    /// Lines that stand in another column, where that is all that can be meant: the line, from 0, and the one that it is called by.
    pub order: Vec<(usize, usize)>,
}

impl Hint {
    /// One of which nothing more is known than its sentence.
    pub fn of(said: String) -> Self {
        Self { said, order: Vec::new() }
    }
}

/// What is probably wrong with the columns; `None` where they are as good as any. `noise` is that of one output, if known.
///
/// # Errors
/// [`LabError::Chain`] where the model's own effects make no chain.
pub(super) fn check(problem: &Problem, noise: Option<f64>) -> Result<Option<Hint>, LabError> {
    let data = &problem.data;
    let of_machine = match (data.quantity, data.n_inputs, data.n_outputs) {
        (Quantity::Snake, 3, 2) => of_snake,
        (Quantity::Segments, ..) => of_segments,
        _ => return Ok(None),
    };
    let given = Arrangement::given(data);
    let rms = |own: &Arrangement| -> Result<f64, LabError> {
        let predicted = problem.machine.predict(problem.machine.effects(), &own.inputs(data))?;
        let width = data.n_outputs;
        let (mut sum, mut n) = (0.0, 0.0);
        for (k, f) in predicted.iter().enumerate().filter(|(k, _)| problem.weight[*k] > 0.0) {
            let (column, factor) = own.outputs[k % width];
            // In the unit of the bends as they stand.
            sum += (data.outputs[k - k % width + column] - f / factor).powi(2);
            n += 1.0;
        }
        Ok((width as f64 * sum / f64::max(n, 1.0)).sqrt())
    };
    let before = rms(&given)?;
    if noise.is_some_and(|noise| before < LARGE * noise * (data.n_outputs as f64).sqrt()) {
        return Ok(None);
    }
    let mut others = of_machine(&given);
    others.extend(of_units(&given));
    let after: Vec<f64> = others.par_iter().map(|own| rms(own).unwrap_or(f64::INFINITY)).collect();
    let best = after.iter().zip(&others).min_by(|a, b| a.0.total_cmp(b.0));
    let (_, scale) = problem.machine.error_unit();
    Ok(best.filter(|(after, _)| **after < MUCH_LESS * before).map(|(after, own)| Hint {
        said: format!("{}: {:.3} deg becomes {:.3} deg", own.what, before * scale, after * scale),
        order: own.order(&given),
    }))
}

fn of_snake(given: &Arrangement) -> Vec<Arrangement> {
    let own = |(lines, sign, what): &([usize; 3], f64, &str)| Arrangement {
        lines: lines.to_vec(),
        sign: *sign,
        ..given.called(what)
    };
    OF_LINES.iter().map(own).collect()
}

/// Any two lines exchanged, all of them negated, the pictures of any two segments exchanged, or all pictures mirrored or turned by half.
fn of_segments(given: &Arrangement) -> Vec<Arrangement> {
    let (n_lines, n_segments) = (given.lines.len(), given.outputs.len() / 2);
    let pairs = |n: usize| (0..n).flat_map(move |b| (0..b).map(move |a| (a, b)));
    let lines = pairs(n_lines).map(|(a, b)| {
        let mut own = given.called(&format!("q{} and q{} are probably exchanged", a + 1, b + 1));
        own.lines.swap(a, b);
        own
    });
    let pictures = pairs(n_segments).map(|(a, b)| {
        let mut own = given.called(&format!("the bends of segments {} and {} are probably exchanged", a + 1, b + 1));
        own.outputs.swap(2 * a, 2 * b);
        own.outputs.swap(2 * a + 1, 2 * b + 1);
        own
    });
    let negated = given
        .called("all lines are probably negated (push is positive), or the bends' planes are turned by half a turn");
    let mut mirrored = given.called("the camera's picture is probably mirrored");
    mirrored.outputs.iter_mut().skip(1).step_by(2).for_each(|(_, factor)| *factor = -1.0);
    let whole = [Arrangement { sign: -1.0, ..negated }, mirrored];
    lines.chain(pictures).chain(whole).collect()
}

fn of_units(given: &Arrangement) -> [Arrangement; 2] {
    [("degrees where radians", DEG_PER_RAD.recip()), ("radians where degrees", DEG_PER_RAD)].map(|(units, factor)| {
        let mut own = given.called(&format!("the bends are probably in {units} are expected"));
        own.outputs.iter_mut().for_each(|output| output.1 = factor);
        own
    })
}

impl Arrangement {
    /// The columns as they stand.
    fn given(data: &Measurements) -> Self {
        let outputs = (0..data.n_outputs).map(|k| (k, 1.0)).collect();
        Self { lines: (0..data.n_inputs).collect(), sign: 1.0, outputs, what: String::new() }
    }

    fn called(&self, what: &str) -> Self {
        Self { lines: self.lines.clone(), sign: self.sign, outputs: self.outputs.clone(), what: what.to_owned() }
    }

    /// Lines that stand in another column, if nothing else would explain as much.
    fn order(&self, given: &Self) -> Vec<(usize, usize)> {
        if self.sign != given.sign || self.outputs != given.outputs || self.what.contains(", or ") {
            return Vec::new();
        }
        self.lines.iter().copied().enumerate().filter(|(line, called)| line != called).collect()
    }

    fn inputs(&self, data: &Measurements) -> Measurements {
        let row = |row: &[f64]| self.lines.iter().map(|line| self.sign * row[*line]).collect::<Vec<_>>();
        Measurements { inputs: data.inputs.chunks(data.n_inputs).flat_map(row).collect(), ..data.clone() }
    }
}
