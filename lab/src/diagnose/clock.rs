//! The camera's clock: where what the effects leave follows the speed of the motion as if the measurements came ahead of it, or ever
//! earlier or later, the clock is what is wrong and no effect. It is found with the effects, and reported as calibration.
//!
//! A measurement of shift a shows f(t + a): to first order it leaves a df/dt. Measurements that come late are no matter of this: the
//! effect `latency` has them.

use super::answer::{Calibration, Diagnosis};
use super::rest::{ERRORS, LEAST_SHARE, MOST_STEPS, Rest, SMALL_STEP, badness, on_working_rows, variables};
use super::whole::DiagnoseOptions;
use crate::clock::ClockOffset;
use crate::fit::{Fit, fit, fit_to_end};
use crate::machine::MachineUnderTest;
use crate::stage::stage;
use crate::{LabError, Measurements, Problem};

/// Searches for a clock.
const MOST_SEARCHES: usize = 4;
/// Speeds are differences over at least this time: encoders have noise.
const SPEED_OVER_S: f64 = 0.04;

/// What the clocks of the recordings are, each with its standard errors; of two numbers for each recording, shift and rate.
pub(crate) struct Clocks {
    pub values: Vec<ClockOffset>,
    pub errors: Vec<[f64; 2]>,
    /// Which of the numbers are other than zero.
    pub is_free: Vec<[bool; 2]>,
}

/// A diagnosis by one clock for all, and where what it leaves shows another one, by that.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(super) fn by_own_clock(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    by_one_clock: impl Fn(&Measurements) -> Result<Diagnosis, LabError>,
) -> Result<Diagnosis, LabError> {
    let firsts = options.first_trials();
    let mut last = by_one_clock(data)?;
    let as_given_rms = last.as_given_rms;
    let (mut best, mut clocks) = (last.clone(), None);
    let mut values = vec![ClockOffset::default(); firsts.len()];
    for _ in 0..MOST_SEARCHES {
        stage("The camera's clock");
        // Effects that imitate a clock draw it to where they suit best: those of the next search do not.
        let Some(found) = settled(machine, data, options, &last, &values)? else { break };
        last = by_one_clock(&data.by_clocks(&found.values, &firsts))?;
        values.clone_from(&found.values);
        if badness(&last, 0) < badness(&best, 0) {
            (best, clocks) = (last.clone(), Some(found));
        }
    }
    let Some(clocks) = clocks else { return Ok(best) };
    clocks.told_in(&mut best, options);
    best.as_given_rms = as_given_rms;
    Ok(best)
}

/// The clock of a part of one recording by a diagnosis that has not seen it; `None` where it is that of the commands.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(super) fn clock_of_part(
    machine: &dyn MachineUnderTest,
    part: &Measurements,
    options: &DiagnoseOptions,
    diagnosis: &Diagnosis,
) -> Result<Option<ClockOffset>, LabError> {
    let found = settled(machine, part, options, diagnosis, &[ClockOffset::default()])?;
    Ok(found.and_then(|own| own.values.first().copied()))
}

/// The clocks that go with the effects of a diagnosis by these clocks; `None` where they are what they were.
fn settled(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    diagnosis: &Diagnosis,
    before: &[ClockOffset],
) -> Result<Option<Clocks>, LabError> {
    let firsts = options.first_trials();
    let was_none = before.iter().all(ClockOffset::is_none);
    let mut values = before.to_vec();
    let mut errors = vec![[0.0; 2]; firsts.len()];
    let mut is_free: Vec<[bool; 2]> = before.iter().map(|own| [own.shift_s != 0.0, own.rate != 0.0]).collect();
    let mut terms = diagnosis.terms.clone();
    let mut has_moved = false;
    for n in 0..MOST_STEPS {
        let moved = data.by_clocks(&values, &firsts);
        let problem = on_working_rows(machine, &moved)?;
        let variables = variables(machine, &problem, options, diagnosis)?;
        let fitted = if n == 0 && was_none {
            fit(&problem, &terms, &variables, 0, 0.0)?
        } else {
            fit_to_end(&problem, &terms, &variables)?
        };
        terms = fitted.effects.clone();
        let step = Step::new(&problem, &fitted, &firsts)?;
        if n == 0 {
            let told = step.told();
            is_free.iter_mut().zip(&told).for_each(|(own, told)| (0..2).for_each(|k| own[k] |= told[k]));
            if is_free.iter().all(|own| !own[0] && !own[1]) {
                return Ok(None);
            }
        }
        let (steps, own_errors) = step.of(&is_free, &problem);
        errors = own_errors;
        let mut largest = 0.0_f64;
        for ((own, [shift_s, rate]), [shift_error, rate_error]) in values.iter_mut().zip(&steps).zip(&errors) {
            let most = |value: f64, most: f64| value.clamp(-most, most);
            *own = ClockOffset {
                shift_s: most(own.shift_s + shift_s, ClockOffset::MOST_S).max(0.0),
                rate: most(own.rate + rate, ClockOffset::MOST_RATE),
            };
            let size = |step: f64, error: f64| if error > 0.0 { step.abs() / error } else { 0.0 };
            largest = largest.max(size(*shift_s, *shift_error)).max(size(*rate, *rate_error));
        }
        has_moved |= largest >= SMALL_STEP;
        if largest < SMALL_STEP {
            break;
        }
    }
    let found = Clocks { values, errors, is_free };
    Ok((has_moved && !found.are_one()).then_some(found))
}

/// What a fit leaves of the measurements beside the speed of what it predicts.
struct Step {
    /// Speed, and speed times the time from the recording's middle, of each recording, laid out as residuals are.
    columns: Vec<Vec<f64>>,
    /// Speed of one size along the motion: what is lost of the way and not of time.
    directions: Vec<Vec<f64>>,
    rest: Rest,
    /// Standard errors of shift and rate of each recording, all free.
    errors: Vec<[f64; 2]>,
}

impl Step {
    fn new(problem: &Problem, fitted: &Fit, firsts: &[usize]) -> Result<Self, LabError> {
        let data = &problem.data;
        let predicted = problem.machine.predict(&fitted.effects, data)?;
        let n = data.n_outputs;
        let speeds = speeds(&data.time_s, &data.trial, &predicted);
        let (mut columns, mut directions) = (Vec::new(), Vec::new());
        for k in 0..firsts.len() {
            let own = data.trials_of(k, firsts);
            let middle_s = data.middle_s(own.clone());
            let of_rows = |value: &dyn Fn(usize, f64) -> f64| {
                let entry = |(k, v): (usize, &f64)| {
                    let row = k / n;
                    if own.contains(&(data.trial[row] as usize)) { value(row, *v) } else { 0.0 }
                };
                problem.laid_out(speeds.iter().enumerate().map(entry).collect())
            };
            columns.push(of_rows(&|_, v| -v));
            columns.push(of_rows(&|row, v| -v * (data.time_s[row] - middle_s)));
            let length = |row: usize| speeds[row * n..][..n].iter().map(|v| v * v).sum::<f64>().sqrt();
            directions.push(of_rows(&|row, v| if length(row) > 0.0 { -v / length(row) } else { 0.0 }));
        }
        let mut own = Self { columns, directions, rest: Rest::of(fitted), errors: Vec::new() };
        let all: Vec<&Vec<f64>> = own.columns.iter().collect();
        let robust = own.rest.errors_of(problem, &all);
        own.errors = (0..firsts.len()).map(|k| [robust[2 * k], robust[2 * k + 1]]).collect();
        Ok(own)
    }

    /// Which numbers are beyond doubt: measurements that come ahead, and clocks of another rate.
    fn told(&self) -> Vec<[bool; 2]> {
        let left = self.rest.left();
        let told = |k: usize| {
            let (shift, rate) = (&self.columns[2 * k], &self.columns[2 * k + 1]);
            let (step, both) = self.rest.solved(&[shift, rate]);
            let [shift_error, rate_error] = self.errors[k];
            let alone = |column: &Vec<f64>| self.rest.solved(&[column]).1;
            let (by_shift, by_rate) = (alone(shift), alone(rate));
            let pays = |gain: f64| gain > LEAST_SHARE * left;
            // What holds a part of the way in both directions is play of the model, and not its clock.
            let is_time = by_shift > alone(&self.directions[k]);
            let is_ahead = step[0] > ERRORS * shift_error && pays(both - by_rate) && is_time;
            [is_ahead, step[1].abs() > ERRORS * rate_error && pays(both - by_shift)]
        };
        (0..self.errors.len()).map(told).collect()
    }

    /// Steps and standard errors of the numbers that are free; zero for the others.
    fn of(&self, is_free: &[[bool; 2]], problem: &Problem) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
        let places: Vec<usize> = (0..self.columns.len()).filter(|k| is_free[k / 2][k % 2]).collect();
        let columns: Vec<&Vec<f64>> = places.iter().map(|k| &self.columns[*k]).collect();
        let (step, _) = self.rest.solved(&columns);
        let robust = self.rest.errors_of(problem, &columns);
        let mut steps = vec![[0.0; 2]; is_free.len()];
        let mut errors = steps.clone();
        for (n, place) in places.into_iter().enumerate() {
            steps[place / 2][place % 2] = step[n];
            errors[place / 2][place % 2] = robust[n];
        }
        (steps, errors)
    }
}

/// Speed of each of the values that every row has, from the rows of its trial before and behind it that are far enough apart; 0 where there
/// are none.
pub(crate) fn speeds<T: PartialEq>(time_s: &[f64], trial: &[T], values: &[f64]) -> Vec<f64> {
    let n_rows = time_s.len();
    let n = values.len() / n_rows.max(1);
    let mut speeds = vec![0.0; values.len()];
    for row in 0..n_rows {
        let is_near = |other: &usize| trial[*other] == trial[row];
        let is_far = |other: &usize| 2.0 * (time_s[*other] - time_s[row]).abs() >= SPEED_OVER_S;
        let first = (0..row).rev().take_while(is_near).find(is_far).unwrap_or(row);
        let last = (row + 1..n_rows).take_while(is_near).find(is_far).unwrap_or(row);
        let seconds = time_s[last] - time_s[first];
        if seconds > 0.0 {
            for k in 0..n {
                speeds[row * n + k] = (values[last * n + k] - values[first * n + k]) / seconds;
            }
        }
    }
    speeds
}

impl Clocks {
    /// Whether all are the clock of the commands.
    pub(crate) fn are_one(&self) -> bool {
        self.values.iter().all(ClockOffset::is_none)
    }

    /// Puts them into the answer of a diagnosis by them.
    pub(crate) fn told_in(self, answer: &mut Diagnosis, options: &DiagnoseOptions) {
        let names: Vec<Option<String>> = match options.recordings.len() {
            0 => vec![None],
            _ => options.recordings.iter().map(|(name, _)| Some(name.clone())).collect(),
        };
        answer.calibration.extend(self.calibration(&names));
        answer.cautions.push(self.sentence(&names));
        answer.clocks = self.values;
    }

    /// Shift and rate as numbers of the calibration: a delay below zero where the measurements come ahead.
    fn calibration(&self, names: &[Option<String>]) -> Vec<Calibration> {
        let mut all = Vec::new();
        for ((own, error), (free, name)) in self.values.iter().zip(&self.errors).zip(self.is_free.iter().zip(names)) {
            let numbers =
                [("delay", -own.shift_s, error[0], "s"), ("clock-rate", 1e6 * own.rate, 1e6 * error[1], "ppm")];
            for ((name_of_number, value, se, unit), _) in numbers.into_iter().zip(free).filter(|(_, free)| **free) {
                all.push(Calibration {
                    name: name_of_number.to_owned(),
                    joint: None,
                    recording: name.clone(),
                    value,
                    se,
                    unit: unit.to_owned(),
                    prior: None,
                    is_held: false,
                });
            }
        }
        all
    }

    /// What is said of them, in words.
    fn sentence(&self, names: &[Option<String>]) -> String {
        let own = |((clock, free), name): ((&ClockOffset, &[bool; 2]), &Option<String>)| {
            let of = name.as_ref().map_or("the measurements".to_owned(), |name| format!("the measurements of {name}"));
            let shift = free[0].then(|| format!("come {:.1} ms ahead of the motion", 1e3 * clock.shift_s));
            let rate = free[1].then(|| format!("have a clock {:.0} ppm apart", 1e6 * clock.rate));
            let words: Vec<String> = shift.into_iter().chain(rate).collect();
            (!words.is_empty()).then(|| format!("{of} {}", words.join(" and ")))
        };
        let all: Vec<String> = self.values.iter().zip(&self.is_free).zip(names).filter_map(own).collect();
        format!("{}: that is calibration and no effect; --clock says it to the other commands", all.join("; "))
    }
}
