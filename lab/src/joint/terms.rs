//! From a fit to the effects of a model file, with standard errors: amplitudes of columns become parameters.

use super::beside::varying_number;
use super::kind::Kind;
use super::refine::{Fit, slopes_by_value};
use super::signal::Signal;
use super::simulate::{Member, Run};
use super::solve::Design;
use crate::fit::standard_errors;
use crate::{Problem, Term};
use core::f64::consts::PI;
use krait_model::effects::{SLOPE, Varying};
use krait_model::joints::JointEffect;

/// A parameter of a found effect.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Value {
    pub name: &'static str,
    pub value: f64,
    pub se: f64,
    pub se_naive: f64,
    /// Of a slope: what depends on which column, and where the column must stand for the other values.
    pub by: Option<Varying>,
}

/// Gain and offset with their standard errors, and the parameters of each member in order.
#[derive(Clone, Debug)]
pub(super) struct Values {
    /// One of each recording.
    pub gains: Vec<(f64, f64)>,
    pub offsets: Vec<(f64, f64)>,
    pub members: Vec<Vec<Value>>,
}

/// A curve whose centre is further away than this, in half ranges, is a parabola.
const FAR: f64 = 20.0;

/// Physical values of a fit.
pub(super) fn values(signal: &Signal, fit: &Fit, problem: &Problem) -> Values {
    let run = Run::new(signal, &fit.members);
    let design = Design::new(signal, &run);
    let (middle, half) = (signal.low + 0.5 * signal.range, 0.5 * signal.range);
    // A curve with a centre takes a part of the gain and the offset with it.
    let mut shift = (0.0, 0.0);
    let mut at = 0;
    for member in &fit.members {
        if let (Kind::Curve, [c2, c3]) = (member.kind, amplitudes(fit, at, 2)) {
            let centre = -c2 / (3.0 * c3);
            if centre.abs() < FAR {
                shift = (
                    -3.0 * c3 * centre * centre / half,
                    c3 * centre.powi(3) + 3.0 * c3 * centre * centre * middle / half,
                );
            }
        }
        at += member.kind.n_linear();
    }
    let gain = fit.solution.gains[0] + shift.0;
    let errors = Errors::new(signal, fit, &design, problem, gain);
    let mut members = Vec::new();
    let mut at = 0;
    for (i, member) in fit.members.iter().enumerate() {
        let own = amplitudes(fit, at, member.kind.n_linear());
        let mut values =
            of_member(signal, member, own, gain, &|k| errors.of_value(i, k), &|k| errors.of_amplitude(at + k));
        values.extend(slope(signal, member, &values, errors.of_value(i, member.values.len())));
        members.push(values);
        at += member.kind.n_linear();
    }
    let own = |values: &[f64], from: usize, shift: f64| {
        values.iter().enumerate().map(|(r, v)| (v + shift, errors.of_machine(from + r))).collect()
    };
    Values {
        offsets: own(&fit.solution.offsets, 0, shift.1),
        gains: own(&fit.solution.gains, signal.n_recordings, shift.0),
        members,
    }
}

fn amplitudes(fit: &Fit, at: usize, n: usize) -> &[f64] {
    fit.solution.amplitudes.get(at..at + n).unwrap_or(&[])
}

/// Standard errors by what they belong to.
struct Errors {
    n_machine: usize,
    n_amplitudes: usize,
    places: Vec<(usize, usize)>,
    robust: Vec<f64>,
    naive: Vec<f64>,
    gain: f64,
}

impl Errors {
    /// Slopes by offsets, gains, amplitudes in units of the command, and the nonlinear values.
    fn new(signal: &Signal, fit: &Fit, design: &Design, problem: &Problem, gain: f64) -> Self {
        let n = signal.rows.len();
        let gain = if gain.abs() > 1e-12 { gain } else { 1.0 };
        let recording = |i: usize| signal.recording(signal.rows[i]);
        let in_commands = |i: usize| {
            let added: f64 = design.columns.iter().zip(&fit.solution.amplitudes).map(|(c, a)| c[i] * a / gain).sum();
            design.passed[i] + added
        };
        let mut slopes: Vec<Vec<f64>> = Vec::new();
        for r in 0..signal.n_recordings {
            slopes.push((0..n).map(|i| f64::from(u8::from(recording(i) == r))).collect());
        }
        for r in 0..signal.n_recordings {
            slopes.push((0..n).map(|i| if recording(i) == r { in_commands(i) } else { 0.0 }).collect());
        }
        slopes.extend(design.columns.iter().map(|column| column.iter().map(|x| x * gain).collect()));
        let mut places = Vec::new();
        for (i, k, slope) in slopes_by_value(signal, fit) {
            places.push((i, k));
            slopes.push(slope);
        }
        let (robust, naive) = standard_errors(problem, &slopes, &fit.solution.residual);
        Self { n_machine: 2 * signal.n_recordings, n_amplitudes: design.columns.len(), places, robust, naive, gain }
    }

    fn of_machine(&self, k: usize) -> f64 {
        self.robust[k]
    }

    /// Robust and naive, of an amplitude in units of the output.
    fn of_amplitude(&self, k: usize) -> (f64, f64) {
        let k = self.n_machine + k;
        (self.robust[k] * self.gain.abs(), self.naive[k] * self.gain.abs())
    }

    fn of_value(&self, member: usize, k: usize) -> (f64, f64) {
        let place = self.places.iter().position(|own| *own == (member, k));
        place.map_or((0.0, 0.0), |place| {
            let k = self.n_machine + self.n_amplitudes + place;
            (self.robust[k], self.naive[k])
        })
    }
}

/// How a number of a member depends on its column, in the units of both; `se` is of the relative slope.
fn slope(signal: &Signal, member: &Member, values: &[Value], (se, se_naive): (f64, f64)) -> Option<Value> {
    let varies = member.varies?;
    let column = &signal.columns[varies.column];
    let own = values.iter().find(|own| Some(own.name) == varying_number(member.kind))?;
    let unit = own.value / column.half;
    let by = Varying { parameter: own.name, column: column.name.clone(), at: column.middle };
    let (se, se_naive) = (se * unit.abs(), se_naive * unit.abs());
    Some(Value { name: SLOPE, value: varies.slope * unit, se, se_naive, by: Some(by) })
}

fn of_member(
    signal: &Signal,
    member: &Member,
    own: &[f64],
    gain: f64,
    of_value: &dyn Fn(usize) -> (f64, f64),
    of_amplitude: &dyn Fn(usize) -> (f64, f64),
) -> Vec<Value> {
    let half = 0.5 * signal.range;
    let middle = signal.low + half;
    let shape = |name, k: usize, factor: f64| {
        let (se, se_naive) = of_value(k);
        Value { name, value: member.values[k] * factor, se: se * factor, se_naive: se_naive * factor, by: None }
    };
    // An amplitude a of the output as a parameter a * factor.
    let amplitude = |name, k: usize, factor: f64| {
        let (se, se_naive) = of_amplitude(k);
        Value { name, value: own[k] * factor, se: se * factor.abs(), se_naive: se_naive * factor.abs(), by: None }
    };
    let fixed = |name, value| Value { name, value, se: 0.0, se_naive: 0.0, by: None };
    match member.kind {
        Kind::Latency => vec![shape("delay_s", 0, 1.0)],
        Kind::Lag => vec![shape("time_s", 0, 1.0)],
        Kind::SecondOrder => vec![shape("frequency_rad_per_s", 0, 1.0), shape("damping", 1, 1.0)],
        Kind::RateLimit => vec![shape("rate", 0, 1.0)],
        Kind::Backlash => vec![shape("half_width", 0, 1.0)],
        Kind::BoucWen => vec![amplitude("amplitude", 0, 1.0 / gain), shape("travel", 0, 1.0), shape("gamma", 1, 1.0)],
        Kind::Plays => vec![
            amplitude("weight1", 0, 1.0 / gain),
            shape("half_width1", 0, 1.0),
            amplitude("weight2", 1, 1.0 / gain),
            shape("half_width2", 0, 1.0 / 3.0),
        ],
        Kind::UnevenPlays => vec![
            shape("reach", 0, 1.0),
            shape("bend", 1, 1.0),
            fixed("centre", middle),
            amplitude("weight2", 1, 1.0 / gain),
            amplitude("weight4", 0, 1.0 / gain),
        ],
        Kind::LoadFriction => vec![amplitude("share", 0, 1.0 / gain), shape("friction", 0, 1.0)],
        Kind::DeadZone => vec![shape("half_width", 0, 1.0), shape("centre", 1, 1.0)],
        Kind::Saturation => vec![shape("limit", 0, 1.0)],
        Kind::Quadratic => vec![amplitude("quadratic", 0, 1.0 / (gain * half * half)), fixed("centre", middle)],
        Kind::Cubic => vec![amplitude("cubic", 0, 1.0 / (gain * half.powi(3))), fixed("centre", middle)],
        Kind::Curve => {
            let centre = -own[0] / (3.0 * own[1]);
            if centre.abs() < FAR {
                let (se, se_naive) = of_amplitude(0);
                let per = (half / (3.0 * own[1])).abs();
                vec![
                    amplitude("cubic", 1, 1.0 / (gain * half.powi(3))),
                    Value {
                        name: "centre",
                        value: middle + centre * half,
                        se: se * per,
                        se_naive: se_naive * per,
                        by: None,
                    },
                ]
            } else {
                vec![amplitude("quadratic", 0, 1.0 / (gain * half * half)), fixed("centre", middle)]
            }
        }
        Kind::Creep => vec![amplitude("a1", 0, 1.0 / gain), shape("t1_s", 0, 1.0)],
        Kind::Scale => vec![amplitude("scale", 0, 1.0 / gain)],
        Kind::Offset => vec![amplitude("offset", 0, 1.0)],
        Kind::LinearDrift => vec![amplitude("rate", 0, 1.0)],
        Kind::WarmUp => vec![amplitude("size", 0, 1.0), shape("rise_time_s", 0, 1.0)],
        Kind::Periodic => {
            let turned = if gain < 0.0 { PI } else { 0.0 };
            let phase = own[1].atan2(own[0]) + turned;
            let size = own[0].hypot(own[1]);
            let ((a, an), (b, bn)) = (of_amplitude(0), of_amplitude(1));
            let (se, se_naive) = (a.max(b), an.max(bn));
            vec![
                Value {
                    name: "amplitude",
                    value: size / gain.abs(),
                    se: se / gain.abs(),
                    se_naive: se_naive / gain.abs(),
                    by: None,
                },
                shape("period", 0, 1.0),
                Value { name: "phase_rad", value: phase, se: se / size, se_naive: se_naive / size, by: None },
            ]
        }
        Kind::Coupling(from) => vec![fixed("from", from as f64 + 1.0), amplitude("k", 0, 1.0 / gain)],
        Kind::Own(formula) => {
            let sizes = formula.amplitudes().enumerate().map(|(k, (_, name))| amplitude(name, k, 1.0));
            sizes.chain(formula.shapes().enumerate().map(|(k, (name, _))| shape(name, k, 1.0))).collect()
        }
        // A shape is no effect of a model file.
        _ => Vec::new(),
    }
}

/// The name of a found effect: a curve without an end in sight is a parabola.
pub(super) fn name(kind: Kind, values: &[Value]) -> &'static str {
    let is_parabola = values.iter().any(|own| own.name == "quadratic");
    if is_parabola { "quadratic" } else { kind.name() }
}

/// A found effect as an effect of a model file, of this joint.
pub(super) fn term(kind: Kind, joint: usize, values: &[Value]) -> Term {
    if let Kind::Own(own) = kind {
        return own.term(joint, |name| values.iter().find(|own| own.name == name).map(|own| own.value));
    }
    let name = name(kind, values);
    let definition = JointEffect::from_name(name).map(JointEffect::definition);
    let parameters = definition.map_or(&[] as &[_], |definition| definition.parameters);
    let value = |parameter: &krait_model::effects::ParameterSpec| {
        if parameter.name == "joint" {
            return joint as f64 + 1.0;
        }
        let own = values.iter().find(|own| own.name == parameter.name).map_or(parameter.default, |own| own.value);
        own.clamp(parameter.low, parameter.high)
    };
    let mut term = Term::new(name, parameters.iter().map(value).collect());
    if let Some(slope) = values.iter().find(|own| own.by.is_some()) {
        term.values.push(slope.value);
        term.varying.clone_from(&slope.by);
    }
    term
}
