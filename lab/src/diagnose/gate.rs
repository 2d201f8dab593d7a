//! What the data themselves cannot show, said before anything is fitted.

use crate::output_noise;
use crate::read::CUT_OFF_HZ;
use crate::{FEWEST_BLOCKS, Measurements, Problem, TipFrame, scored_time_s};

/// Sentences about what these data lack; `in_blocks`: also that the problem has few blocks.
pub(crate) fn cautions(problem: &Problem, n_outliers: usize, in_blocks: bool) -> Vec<String> {
    let data = &problem.data;
    let mut said = Vec::new();
    if in_blocks && problem.n_blocks < FEWEST_BLOCKS {
        said.push(format!(
            "{:.0} s of data make {} independent blocks, and a calibrated test needs {FEWEST_BLOCKS}: record {:.0} s at least, better minutes",
            scored_time_s(data),
            problem.n_blocks,
            problem.needed_s()
        ));
    }
    if let Some(cut_off_hz) = data.extra(CUT_OFF_HZ).and_then(<[f64]>::first) {
        said.push(format!(
            "angle, its derivatives and force are filtered alike below {cut_off_hz:.2} Hz; rows near a reversal and at rest do not count"
        ));
    }
    if data.n_held_rows > 0 {
        said.push(format!(
            "{} rows only repeat the measurement before them while the machine moves, as a camera slower than the file's rows does: \
             the first row of each frame counts",
            data.n_held_rows
        ));
    }
    said.extend(output_noise::caution(problem));
    said.extend(data.tip_frames.iter().map(TipFrame::sentence));
    if let Some(clock) = &data.clock {
        said.push(format!(
            "{}: the second log's times are shifted by {:+.4} s and its clock runs {:+.0} ppm beside the first, as the motion says \
             ({:.1} % a straight line of it); a delay of the camera cannot be told from its clock",
            data.source,
            clock.shift_s,
            -1e6 * clock.rate,
            100.0 * clock.share
        ));
    }
    let reversals = reversals(data);
    if reversals < 8 {
        let untold = match problem.machine.kind() {
            "force" => "friction shows only at reversals (8 or more): it cannot be told from the sensor's offset here",
            _ => {
                "hysteresis shows only at reversals (8 or more): it cannot be told from stiffness, offsets or latency here"
            }
        };
        said.push(format!("the inputs reverse {reversals} times, and {untold}"));
    }
    if n_outliers > 0 {
        let what = if n_outliers == 1 {
            "row stands out from its neighbours and was"
        } else {
            "rows stand out from their neighbours and were"
        };
        said.push(format!("{n_outliers} {what} left out"));
    }
    said
}

/// Changes of direction of all inputs together, small ones left out.
pub(crate) fn reversals(data: &Measurements) -> usize {
    let threshold = 0.02 * crate::noise::largest_range(data);
    let is_first = |row: usize| data.starts_trial(row);
    (0..data.n_inputs).map(|k| turns((0..data.n_rows()).map(|row| data.input(row)[k]), is_first, threshold)).sum()
}

/// How often values turn by more than a threshold; a trial begins anew.
pub(crate) fn turns(values: impl Iterator<Item = f64>, is_first: impl Fn(usize) -> bool, threshold: f64) -> usize {
    let (mut count, mut extreme, mut direction) = (0, f64::NAN, 0.0);
    for (row, own) in values.enumerate() {
        if is_first(row) || extreme.is_nan() {
            (extreme, direction) = (own, 0.0);
            continue;
        }
        let moved = own - extreme;
        if direction == 0.0 && moved.abs() > threshold {
            (extreme, direction) = (own, moved.signum());
        } else if moved * direction > 0.0 {
            extreme = own;
        } else if -moved * direction > threshold {
            count += 1;
            (extreme, direction) = (own, -direction);
        }
    }
    count
}
