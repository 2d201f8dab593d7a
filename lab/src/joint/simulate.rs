//! A list of effects run over a signal: the position that is passed on, effect by effect, and the columns that amplitudes scale.

use super::kind::{Kind, WAVES};
use super::signal::Signal;
use core::f64::consts::{PI, TAU};
use krait_model::joints::{REACHES, bouc_wen, lag_step, load_play, play, second_order_ramp, second_order_step};
use std::sync::Arc;

/// One effect with the values of its nonlinear parameters, and where its memory starts in each trial, -1 to 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Member {
    pub kind: Kind,
    pub values: Vec<f64>,
    pub starts: Vec<f64>,
    /// How one of its numbers depends on a column.
    pub varies: Option<Varies>,
}

/// A number of a member that is its value times 1 + slope z, where z runs from -1 to 1 over the range of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Varies {
    /// Place of the column.
    pub column: usize,
    pub slope: f64,
}

impl Member {
    pub fn new(signal: &Signal, kind: Kind, values: &[f64], start: f64) -> Self {
        let starts = if kind.has_start() { vec![start; signal.n_trials] } else { Vec::new() };
        Self { kind, values: values.to_vec(), starts, varies: None }
    }

    /// What the number that depends on a column is multiplied by in a row.
    fn factor(&self, s: &Signal, row: usize) -> f64 {
        self.varies.map_or(1.0, |own| 1.0 + own.slope * s.columns[own.column].values[row])
    }

    /// Whether it says that the measurements come ahead of the motion, which is calibration and no effect.
    pub fn is_ahead(&self) -> bool {
        self.kind == Kind::Latency && self.values[0] < 0.0
    }
}

/// What a list makes of a signal.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// The position in front of each member, and behind the last one, all rows.
    pub passed: Vec<Arc<Vec<f64>>>,
    /// Columns of each member, rows of the loss.
    pub columns: Vec<Vec<Vec<f64>>>,
}

impl Run {
    pub fn new(signal: &Signal, members: &[Member]) -> Self {
        let mut run = Self { passed: vec![signal.base.clone()], columns: Vec::new() };
        run.redo(signal, members, 0);
        run
    }

    /// Runs again from a member on; those before it are as they were.
    pub fn redo(&mut self, signal: &Signal, members: &[Member], from: usize) {
        self.passed.truncate(from + 1);
        self.columns.truncate(from);
        for member in &members[from..] {
            let before = self.passed[self.passed.len() - 1].clone();
            if member.kind.carries() {
                self.passed.push(Arc::new(pass(signal, member, &before)));
                self.columns.push(Vec::new());
            } else {
                self.columns.push(columns(signal, member, &before));
                self.passed.push(before);
            }
        }
    }

    /// The position behind every member, rows of the loss.
    pub fn passed_on_rows(&self, signal: &Signal) -> Vec<f64> {
        let last = &self.passed[self.passed.len() - 1];
        signal.rows.iter().map(|&row| last[row] + signal.base_added[row]).collect()
    }
}

/// A factor that depends on the step, computed anew only where the step changes.
struct Cached<T> {
    step_s: f64,
    value: T,
}

impl<T: Copy> Cached<T> {
    fn get(&mut self, step_s: f64, compute: impl Fn(f64) -> T) -> T {
        if step_s != self.step_s {
            (self.step_s, self.value) = (step_s, compute(step_s));
        }
        self.value
    }
}

/// The position behind an effect that changes it.
fn pass(s: &Signal, member: &Member, x: &[f64]) -> Vec<f64> {
    let values = &member.values;
    match member.kind {
        Kind::Latency => delayed(s, x, values[0]),
        Kind::Lag if member.varies.is_some() => with_row(s, x, |last, k| {
            let (time_s, dt) = (values[0] * member.factor(s, k), s.step_s[k]);
            lag_step(last, x[k - 1], x[k], time_s, dt, (-dt / time_s).exp())
        }),
        Kind::Lag => lagged(s, x, values[0]),
        Kind::RateLimit => with_memory(s, x, |last, x, dt| last + (x - last).clamp(-values[0] * dt, values[0] * dt)),
        Kind::SecondOrder => {
            let mut cached = Cached { step_s: f64::NAN, value: [0.0; 4] };
            let mut here = [0.0; 2];
            (0..x.len())
                .map(|k| {
                    if s.fresh[k] {
                        here = [x[k], 0.0];
                    } else {
                        let matrix = cached.get(s.step_s[k], |dt| second_order_step(values[0], values[1], dt));
                        let ramp = [x[k - 1], x[k]];
                        here = second_order_ramp(here, ramp, [values[0], values[1]], s.step_s[k], matrix);
                    }
                    here[0]
                })
                .collect()
        }
        Kind::Backlash => played(s, x, |k| values[0] * member.factor(s, k), &member.starts),
        Kind::DeadZone | Kind::Saturation => {
            let here = |(k, x): (usize, &f64)| {
                let limit = values[0] * member.factor(s, k);
                if member.kind == Kind::DeadZone {
                    x - (x - values[1]).clamp(-limit, limit)
                } else {
                    x.clamp(-limit, limit)
                }
            };
            x.iter().enumerate().map(here).collect()
        }
        _ => x.to_vec(),
    }
}

/// The columns of an effect that adds, rows of the loss.
pub(super) fn columns(s: &Signal, member: &Member, x: &[f64]) -> Vec<Vec<f64>> {
    let mut all = steady_columns(s, member, x);
    if member.varies.is_some() {
        let scale = |column: &mut Vec<f64>| {
            column.iter_mut().zip(&s.rows).for_each(|(value, &row)| *value *= member.factor(s, row));
        };
        all.iter_mut().for_each(scale);
    }
    all
}

/// The same with amplitudes that depend on nothing.
fn steady_columns(s: &Signal, member: &Member, x: &[f64]) -> Vec<Vec<f64>> {
    let values = &member.values;
    let on_rows = |of: &dyn Fn(usize) -> f64| -> Vec<f64> { s.rows.iter().map(|&row| of(row)).collect() };
    let middle = s.low + 0.5 * s.range;
    // Positions from -1 to 1 where the command is within its range.
    let unit = |row: usize| (x[row] - middle) / (0.5 * s.range);
    match member.kind {
        Kind::Coupling(from) => vec![on_rows(&|row| s.inputs[from][row])],
        Kind::Periodic => waves(s, |row| TAU * x[row] / values[0]),
        Kind::BoucWen => {
            let (mut z, mut last) = (0.0, 0.0);
            let all: Vec<f64> = (0..x.len())
                .map(|k| {
                    z = if s.fresh[k] {
                        member.starts[s.trial[k]]
                    } else {
                        bouc_wen(z, x[k] - last, values[0], values[1])
                    };
                    last = x[k];
                    z
                })
                .collect();
            vec![on_rows(&|row| -all[row])]
        }
        Kind::Plays => {
            let [wide, narrow] = [1.0, 1.0 / 3.0].map(|part| played(s, x, |_| part * values[0], &member.starts));
            vec![on_rows(&|row| wide[row] - x[row]), on_rows(&|row| narrow[row] - x[row])]
        }
        Kind::UnevenPlays => {
            let bent: Vec<f64> = x.iter().map(|x| x + values[1] * (x - middle).powi(2)).collect();
            let [wide, narrow] = [1.0, REACHES[1]].map(|part| played(s, &bent, |_| part * values[0], &member.starts));
            vec![on_rows(&|row| wide[row] - bent[row]), on_rows(&|row| narrow[row] - bent[row])]
        }
        Kind::LoadFriction => {
            let p = with_memory(s, x, |last, x, _| load_play(last, x, values[0]));
            vec![on_rows(&|row| p[row] - x[row])]
        }
        Kind::Quadratic => vec![on_rows(&|row| unit(row).powi(2))],
        Kind::Cubic => vec![on_rows(&|row| unit(row).powi(3))],
        Kind::Curve => vec![on_rows(&|row| unit(row).powi(2)), on_rows(&|row| unit(row).powi(3))],
        Kind::Creep => {
            let slow = lagged(s, x, values[0]);
            vec![on_rows(&|row| -slow[row])]
        }
        Kind::Scale => vec![on_rows(&|row| x[row])],
        Kind::Offset => vec![vec![1.0; s.rows.len()]],
        Kind::LinearDrift => vec![on_rows(&|row| s.trial_s[row])],
        Kind::WarmUp => vec![on_rows(&|row| 1.0 - (-s.trial_s[row] / values[0]).exp())],
        Kind::Kink => vec![on_rows(&|row| (x[row] - values[0]).max(0.0))],
        Kind::Drag => vec![on_rows(&|row| {
            let speed = speed(s, x, row) / s.fast;
            speed.signum() * speed.abs().powf(values[0])
        })],
        Kind::Jump => vec![on_rows(&|row| if row as f64 >= values[0] * s.n() as f64 { 1.0 } else { 0.0 })],
        Kind::Wander => {
            let wave = |n: usize| on_rows(&|row| (PI * n as f64 * row as f64 / s.n() as f64).cos());
            (1..=WAVES).map(wave).collect()
        }
        Kind::Rhythm => waves(s, |row| TAU * values[0] * s.time_s[row]),
        Kind::Own(own) => (0..member.kind.n_linear()).map(|k| s.formula(own, x, k, values)).collect(),
        Kind::Fading => vec![on_rows(&|row| unit(row) * row as f64 / s.n() as f64)],
        Kind::Product(k) => vec![on_rows(&|row| unit(row) * s.inputs[k][row])],
        Kind::OtherSquare(k) => vec![on_rows(&|row| s.inputs[k][row].powi(2))],
        Kind::OtherPlay(k) => {
            let other = &s.inputs[k];
            let p = played(s, other, |_| values[0], &vec![0.0; s.n_trials]);
            vec![on_rows(&|row| p[row] - other[row])]
        }
        _ => Vec::new(),
    }
}

/// Sine and cosine of an angle, rad, on the rows of the loss.
fn waves(s: &Signal, angle_rad: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
    let (sines, cosines) = s.rows.iter().map(|&row| angle_rad(row).sin_cos()).unzip();
    vec![sines, cosines]
}

fn with_memory(s: &Signal, x: &[f64], step: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
    with_row(s, x, |last, k| step(last, x[k], s.step_s[k]))
}

/// The same where a step needs the row's number.
fn with_row(s: &Signal, x: &[f64], step: impl Fn(f64, usize) -> f64) -> Vec<f64> {
    let mut last = 0.0;
    (0..x.len())
        .map(|k| {
            last = if s.fresh[k] { x[k] } else { step(last, k) };
            last
        })
        .collect()
}

/// Central difference over a few rows.
fn speed(s: &Signal, x: &[f64], row: usize) -> f64 {
    let within = |other: usize| s.trial[other] == s.trial[row];
    let before = (1..=2).map_while(|k| row.checked_sub(k).filter(|own| within(*own))).last().unwrap_or(row);
    let after = (1..=2).map(|k| row + k).take_while(|own| *own < x.len() && within(*own)).last().unwrap_or(row);
    let seconds = s.time_s[after] - s.time_s[before];
    if seconds > 0.0 { (x[after] - x[before]) / seconds } else { 0.0 }
}

fn lagged(s: &Signal, x: &[f64], time_s: f64) -> Vec<f64> {
    let mut cached = Cached { step_s: f64::NAN, value: 0.0 };
    let mut last = 0.0;
    (0..x.len())
        .map(|k| {
            let dt = s.step_s[k];
            let decay = cached.get(dt, |dt| (-dt / time_s).exp());
            last = if s.fresh[k] { x[k] } else { lag_step(last, x[k - 1], x[k], time_s, dt, decay) };
            last
        })
        .collect()
}

fn played(s: &Signal, x: &[f64], half_width: impl Fn(usize) -> f64, starts: &[f64]) -> Vec<f64> {
    let mut p = 0.0;
    (0..x.len())
        .map(|k| {
            let half_width = half_width(k);
            if s.fresh[k] {
                p = x[k] + starts[s.trial[k]] * half_width;
            }
            p = play(p, x[k], half_width);
            p
        })
        .collect()
}

/// The position of `delay_s` ago, or ahead where it is negative; at a trial's ends the first and last one.
fn delayed(s: &Signal, x: &[f64], delay_s: f64) -> Vec<f64> {
    let n = x.len();
    let (mut first, mut at) = (0, 0);
    let mut end = 0;
    (0..n)
        .map(|k| {
            if s.fresh[k] {
                (first, at) = (k, k);
                end = (k + 1..n).find(|row| s.fresh[*row]).unwrap_or(n);
            }
            let then = s.time_s[k] - delay_s;
            if then <= s.time_s[first] {
                return x[first];
            }
            while at + 1 < end && s.time_s[at + 1] <= then {
                at += 1;
            }
            if at + 1 >= end {
                return x[end - 1];
            }
            let step = s.time_s[at + 1] - s.time_s[at];
            let part = if step > 0.0 { (then - s.time_s[at]) / step } else { 1.0 };
            x[at] + (x[at + 1] - x[at]) * part
        })
        .collect()
}
