//! A camera that was mounted anew between recordings: where one recording's bends all lie by the same angles beside what the effects
//! leave of the first one's, that is no effect. It is found with the effects, and reported as calibration.
//!
//! What a column of the recordings explains (temperature, the stem's angle) is explained first: only what the effects leave is asked.

use super::answer::{Calibration, Diagnosis};
use super::rest::{ERRORS, LEAST_SHARE, MOST_STEPS, Rest, SMALL_STEP, badness, on_working_rows, variables};
use super::whole::DiagnoseOptions;
use crate::camera::CameraOffset;
use crate::fit::{fit, fit_to_end};
use crate::machine::MachineUnderTest;
use crate::stage::stage;
use crate::{LabError, Measurements, Problem, Quantity};

/// Searches for the angles.
const MOST_SEARCHES: usize = 3;

/// Where the cameras stand, with standard errors; zero where a camera stands as the first recording's.
struct Cameras {
    values: Vec<CameraOffset>,
    errors: Vec<Vec<f64>>,
}

/// A diagnosis as if all recordings had one camera, and where what it leaves shows another one, without its angles.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed.
pub(super) fn by_own_camera(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    by_one_camera: impl Fn(&Measurements) -> Result<Diagnosis, LabError>,
) -> Result<Diagnosis, LabError> {
    let firsts = options.first_trials();
    let mut last = by_one_camera(data)?;
    // Where a tracker measures the tip, its place is sought in each recording already.
    if firsts.len() < 2 || !data.tip_frames.is_empty() {
        return Ok(last);
    }
    let as_given_rms = last.as_given_rms;
    let (mut best, mut cameras) = (last.clone(), None);
    let mut values = vec![CameraOffset::default(); firsts.len()];
    for _ in 0..MOST_SEARCHES {
        stage("Each recording's camera");
        // Effects that imitate a camera draw it to where they suit best: those of the next search do not.
        let Some(found) = settled(machine, data, options, &last, &values)? else { break };
        last = by_one_camera(&data.by_cameras(&found.values, &firsts))?;
        values.clone_from(&found.values);
        if badness(&last, n_moved(&values))
            < badness(&best, cameras.as_ref().map_or(0, |own: &Cameras| n_moved(&own.values)))
        {
            (best, cameras) = (last.clone(), Some(found));
        }
    }
    let Some(cameras) = cameras else { return Ok(best) };
    best.calibration.extend(cameras.calibration(data, options));
    best.cautions.push(cameras.sentence(options));
    best.cameras = cameras.values;
    best.as_given_rms = as_given_rms;
    Ok(best)
}

fn n_moved(cameras: &[CameraOffset]) -> usize {
    cameras.iter().filter(|camera| !camera.is_none()).count()
}

/// The angles that go with the effects of a diagnosis by these angles; `None` where they are what they were.
fn settled(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
    diagnosis: &Diagnosis,
    before: &[CameraOffset],
) -> Result<Option<Cameras>, LabError> {
    let firsts = options.first_trials();
    let n_outputs = data.n_outputs;
    let was_none = before.iter().all(CameraOffset::is_none);
    let mut values = before.to_vec();
    let mut errors = vec![vec![0.0; n_outputs]; firsts.len()];
    let mut is_moved: Vec<bool> = before.iter().map(|own| !own.is_none()).collect();
    let mut terms = diagnosis.terms.clone();
    let mut has_moved = false;
    for n in 0..MOST_STEPS {
        let moved = data.by_cameras(&values, &firsts).by_clocks(&diagnosis.clocks, &firsts);
        let problem = on_working_rows(machine, &moved)?;
        let variables = variables(machine, &problem, options, diagnosis)?;
        let fitted = if n == 0 && was_none {
            fit(&problem, &terms, &variables, 0, 0.0)?
        } else {
            fit_to_end(&problem, &terms, &variables)?
        };
        terms = fitted.effects.clone();
        let rest = Rest::of(&fitted);
        let columns: Vec<Vec<Vec<f64>>> = (0..firsts.len()).map(|k| columns_of(&problem, &firsts, k)).collect();
        if n == 0 {
            is_moved.iter_mut().zip(told(&problem, &rest, &columns)).for_each(|(own, told)| *own |= told);
        }
        let free: Vec<usize> = (0..firsts.len()).filter(|k| is_moved[*k]).collect();
        if free.is_empty() {
            return Ok(None);
        }
        let of_free: Vec<&Vec<f64>> = free.iter().flat_map(|k| &columns[*k]).collect();
        let (step, _) = rest.solved(&of_free);
        let robust = rest.errors_of(&problem, &of_free);
        let mut largest = 0.0_f64;
        for (place, k) in free.iter().enumerate() {
            let own = place * n_outputs..(place + 1) * n_outputs;
            errors[*k] = robust[own.clone()].to_vec();
            values[*k] = values[*k].and(&CameraOffset(step.as_slice()[own.clone()].to_vec()));
            largest = own.map(|i| step[i].abs() / robust[i].max(1e-300)).fold(largest, f64::max);
        }
        if values.iter().flat_map(|own| &own.0).any(|angle| angle.to_degrees().abs() > CameraOffset::MOST_DEG) {
            return Ok(None);
        }
        has_moved |= largest >= SMALL_STEP;
        if largest < SMALL_STEP {
            break;
        }
    }
    Ok(has_moved.then_some(Cameras { values, errors }))
}

/// What a larger angle of a recording's camera changes of the residual, for each output.
fn columns_of(problem: &Problem, firsts: &[usize], recording: usize) -> Vec<Vec<f64>> {
    let data = &problem.data;
    let n = data.n_outputs;
    let last = firsts.get(recording + 1).copied().unwrap_or(usize::MAX);
    let own = |row: usize| (firsts[recording]..last).contains(&(data.trial[row] as usize));
    let column = |output: usize| {
        let entry = |k: usize| if k % n == output && own(k / n) { -1.0 } else { 0.0 };
        problem.laid_out((0..data.n_rows() * n).map(entry).collect())
    };
    (0..n).map(column).collect()
}

/// Which recordings' cameras stand elsewhere beyond doubt; the first is what the others are measured by.
fn told(problem: &Problem, rest: &Rest, columns: &[Vec<Vec<f64>>]) -> Vec<bool> {
    let all: Vec<&Vec<f64>> = columns.iter().skip(1).flatten().collect();
    let (step, gain) = rest.solved(&all);
    let errors = rest.errors_of(problem, &all);
    let left = rest.left();
    let n = columns.first().map_or(0, Vec::len);
    let is_told = |place: usize| {
        let own = place * n..(place + 1) * n;
        let others: Vec<&Vec<f64>> =
            all.iter().enumerate().filter(|(i, _)| !own.contains(i)).map(|(_, own)| *own).collect();
        let pays = gain - rest.solved(&others).1 > LEAST_SHARE * left;
        pays && own.clone().any(|i| step[i].abs() > ERRORS * errors[i])
    };
    core::iter::once(false).chain((0..columns.len().saturating_sub(1)).map(is_told)).collect()
}

impl Cameras {
    /// Recordings whose camera stands elsewhere: name, angles, standard errors.
    fn moved<'a>(&'a self, options: &'a DiagnoseOptions) -> impl Iterator<Item = (&'a str, &'a [f64], &'a [f64])> {
        let names = options.recordings.iter().map(|(name, _)| name.as_str());
        let all = names.zip(&self.values).zip(&self.errors);
        all.filter(|((_, own), _)| !own.is_none()).map(|((name, own), se)| (name, own.0.as_slice(), se.as_slice()))
    }

    fn calibration(&self, data: &Measurements, options: &DiagnoseOptions) -> Vec<Calibration> {
        let number = |recording: &str, k: usize, value: f64, se: f64| Calibration {
            name: name_of(data.quantity, k),
            joint: None,
            recording: Some(recording.to_owned()),
            value,
            se,
            unit: "rad".to_owned(),
            prior: None,
            is_held: false,
        };
        let of = |(name, values, errors): (&str, &[f64], &[f64])| {
            let each = values.iter().zip(errors).enumerate();
            each.map(|(k, (value, se))| number(name, k, *value, *se)).collect::<Vec<_>>()
        };
        self.moved(options).flat_map(of).collect()
    }

    /// What is said of them, in words.
    fn sentence(&self, options: &DiagnoseOptions) -> String {
        let first = options.recordings.first().map_or("", |(name, _)| name.as_str());
        let of = |(name, values, _): (&str, &[f64], &[f64])| {
            let degrees: Vec<String> = values.iter().map(|own| format!("{:+.2}", own.to_degrees())).collect();
            format!("{name} by {} deg", degrees.join(" and "))
        };
        format!(
            "the camera stood otherwise than in {first}: in {}; that is calibration and no effect; --camera-offset says it to the other \
             commands",
            self.moved(options).map(of).collect::<Vec<_>>().join(", in ")
        )
    }
}

/// `camera-offset-x` of a snake, `camera-offset-2-x` of a second segment.
fn name_of(quantity: Quantity, output: usize) -> String {
    let axis = if output.is_multiple_of(2) { "x" } else { "y" };
    match quantity {
        Quantity::Segments => format!("camera-offset-{}-{axis}", output / 2 + 1),
        _ => format!("camera-offset-{axis}"),
    }
}
