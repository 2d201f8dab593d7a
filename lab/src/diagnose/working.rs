//! Which rows the search works on, so that very long measurements take little longer than long ones.
//!
//! Chosen among rows with a measurement, never by row number: a camera may be slower than the encoders, and its frames may fall
//! between any stride. Every frame of few; of many every second to tenth, still often enough for effects with a memory. Rows
//! without a measurement are history: every so many are kept, and those at which an input turns, because hysteresis and the loads
//! remember just where that was. Of very many rows the beginning of each trial is taken: where a trial begins its history is
//! known. Joints are fitted so fast that more can be taken: sections of all of a record, at a rate at which no command bends.

use crate::Measurements;

/// All of so many rows, ...
const FEW: usize = 3000;
/// ... of more this and a tenth, ...
const PART: usize = 10;
/// ... and at most so many.
const MOST: usize = 30_000;
/// Sections of records that are longer, and rows of history between them.
const SECTIONS: usize = 12;
const HISTORY: usize = 10_000;
/// A straight line that is off by no more than this part of what an input moves loses nothing.
const SMOOTH: f64 = 2e-4;
/// Effects are tried on at most so many of them; three in ten of these are all rows of 200 s at 50 Hz.
const MOST_TRIED: usize = 6000;

/// The working rows of these measurements without the excluded ones, which are in rising order.
pub(crate) fn working_rows(data: &Measurements, excluded: &[usize]) -> Vec<usize> {
    rows_at(data, excluded, usize::MAX)
}

/// Working rows of joints, between which no command bends: of many measurements sections at that rate, evenly to the end. Between sections,
/// and in the first tenth of each, rows are history that nobody measured: what a model remembers settles there.
pub(crate) fn sections(data: &Measurements, excluded: &[usize]) -> Measurements {
    let (n, stride) = (data.n_rows(), smooth_stride(data));
    if n / stride <= MOST {
        return data.select(&rows_at(data, excluded, stride));
    }
    let (period, length) = (n.div_ceil(SECTIONS), MOST * stride / SECTIONS);
    let turns = turns(data, MOST);
    let is_kept = |row: usize| {
        let (place, is_first) = (row % period, data.starts_trial(row));
        let stride = if place < length { stride } else { n.div_ceil(HISTORY) };
        is_first || place % stride == 0 || turns.binary_search(&row).is_ok()
    };
    let rows: Vec<usize> = (0..n).filter(|row| is_kept(*row) && excluded.binary_search(row).is_err()).collect();
    let mut work = data.select(&rows);
    for (k, row) in rows.iter().enumerate() {
        let place = row % period;
        if place >= length || (*row >= period && place < length / 10) {
            work.outputs[k * data.n_outputs..][..data.n_outputs].fill(f64::NAN);
        }
    }
    work
}

fn rows_at(data: &Measurements, excluded: &[usize], most_stride: usize) -> Vec<usize> {
    let n = data.n_rows();
    let is_frame: Vec<bool> = (0..n).map(|row| data.is_scored(row)).collect();
    let n_frames = is_frame.iter().filter(|own| **own).count();
    let [frame_stride, history_stride] = [n_frames, n - n_frames].map(|n| stride(n).min(most_stride));
    let expected = n_frames / frame_stride + (n - n_frames) / history_stride;
    let share = (MOST as f64 / expected.max(1) as f64).min(1.0);
    let turns = turns(data, expected.min(MOST));
    let starts: Vec<usize> = (0..n).filter(|row| data.starts_trial(*row)).collect();
    let mut kept = Vec::with_capacity(expected.min(MOST) + starts.len());
    for (k, &start) in starts.iter().enumerate() {
        let end = starts.get(k + 1).copied().unwrap_or(n);
        let last = start + ((end - start) as f64 * share).ceil() as usize;
        let (mut n_frames, mut n_others) = (0, 0);
        for (row, &is_frame) in is_frame.iter().enumerate().take(last.min(end)).skip(start) {
            let (count, stride) =
                if is_frame { (&mut n_frames, frame_stride) } else { (&mut n_others, history_stride) };
            if *count % stride == 0 || row == start || turns.binary_search(&row).is_ok() {
                kept.push(row);
            }
            *count += 1;
        }
    }
    kept.retain(|row| excluded.binary_search(row).is_err());
    kept
}

/// The part of the working rows on which effects are tried, as places in these measurements of them: the beginning of each trial;
/// `None` where they are few enough for all to be taken. What comes close there is compared on all working rows.
pub(super) fn tried_rows(work: &Measurements) -> Option<Vec<usize>> {
    let n = work.n_rows();
    if n <= MOST_TRIED {
        return None;
    }
    let starts: Vec<usize> = (0..n).filter(|row| work.starts_trial(*row)).collect();
    let ends = starts.iter().skip(1).copied().chain([n]);
    let part = |(&start, end): (&usize, usize)| start..start + ((end - start) * MOST_TRIED).div_ceil(n);
    Some(starts.iter().zip(ends).flat_map(part).collect())
}

/// The rows at which an input turns, in rising order; none where there are more than `most`: readings that tremble turn everywhere.
fn turns(data: &Measurements, most: usize) -> Vec<usize> {
    let mut turns = Vec::new();
    let mut way = vec![0.0; data.n_inputs];
    for row in 1..data.n_rows() {
        if data.starts_trial(row) {
            way.fill(0.0);
            continue;
        }
        let steps = data.input(row).iter().zip(data.input(row - 1)).map(|(now, before)| now - before);
        let mut is_turn = false;
        for (way, step) in way.iter_mut().zip(steps).filter(|(_, step)| *step != 0.0 && step.is_finite()) {
            is_turn |= *way * step < 0.0;
            *way = step;
        }
        if is_turn {
            turns.push(row - 1);
        }
        if turns.len() > most {
            return Vec::new();
        }
    }
    turns
}

/// The longest stride between whose rows every input is a straight line, as far as it matters.
fn smooth_stride(data: &Measurements) -> usize {
    (2..=PART).take_while(|stride| (0..data.n_inputs).all(|k| bend(data, k, *stride) < SMOOTH)).last().unwrap_or(1)
}

/// How far an input is in the middle of a stride from the straight line between its ends: root mean square as a part of its own.
fn bend(data: &Measurements, input: usize, stride: usize) -> f64 {
    let at = |row: usize| data.input(row)[input];
    let n = data.n_rows();
    let mean = (0..n).map(at).sum::<f64>() / n.max(1) as f64;
    let whole = (0..n).map(|row| (at(row) - mean).powi(2)).sum::<f64>() / n.max(1) as f64;
    let middles = (stride / 2..n.saturating_sub(stride - stride / 2)).filter_map(|row| {
        let (from, to) = (row - stride / 2, row - stride / 2 + stride);
        let part = (stride / 2) as f64 / stride as f64;
        let line = at(from) + part * (at(to) - at(from));
        (data.trial[from] == data.trial[to]).then(|| (at(row) - line).powi(2))
    });
    let (sum, count) = middles.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
    if whole > 0.0 && count > 0.0 { (sum / count / whole).sqrt() } else { 0.0 }
}

/// Every how many of so many rows.
fn stride(n: usize) -> usize {
    n.div_ceil(FEW + n / PART).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LoadUse, Quantity};

    fn trials(lengths: &[usize]) -> Measurements {
        let n = lengths.iter().sum();
        Measurements {
            source: String::new(),
            sha256: String::new(),
            quantity: Quantity::Joints,
            time_s: (0..n).map(|k| k as f64 * 0.01).collect(),
            inputs: vec![0.0; n],
            n_inputs: 1,
            outputs: vec![0.0; n],
            n_outputs: 1,
            trial: (0..).zip(lengths).flat_map(|(trial, length)| vec![trial; *length]).collect(),
            loads_n: None,
            load_use: LoadUse::UNCALIBRATED,
            stem_angle_rad: None,
            temperature_c: None,
            sigma: None,
            extra: Vec::new(),
            names: crate::Names::default(),
            n_held_rows: 0,
            clock: None,
            tip_frames: Vec::new(),
        }
    }

    #[test]
    fn few_rows_are_all_taken_but_for_the_excluded_ones() {
        let rows = working_rows(&trials(&[1000, 500]), &[3, 1400]);
        assert_eq!(rows.len(), 1498);
        assert!(!rows.contains(&3) && !rows.contains(&1400));
    }

    #[test]
    fn effects_are_tried_on_the_beginning_of_each_trial_of_many_rows() {
        assert_eq!(tried_rows(&trials(&[4000, 2000])), None, "few are all taken");
        let rows = tried_rows(&trials(&[10_000, 20_000])).expect("a part");
        let expected: Vec<usize> = (0..2000).chain(10_000..14_000).collect();
        assert_eq!(rows, expected);
    }

    #[test]
    fn of_many_a_part_is_taken_evenly_to_the_end() {
        let rows = working_rows(&trials(&[90_000, 10_000]), &[]);
        assert!((12_000..=13_100).contains(&rows.len()) && rows.windows(2).all(|two| two[1] - two[0] <= 10));
        assert!(*rows.last().expect("a row") > 99_980);
    }

    #[test]
    fn rows_between_which_a_command_bends_are_not_left_out() {
        let mut data = trials(&[100_000]);
        let mut taken = |hz: f64| {
            (0..100_000).for_each(|row| data.inputs[row] = (core::f64::consts::TAU * hz * data.time_s[row]).sin());
            sections(&data, &[])
        };
        // Rows of 10 ms: of 1 Hz a straight line over two of them is off by 1/2000, of 0.02 Hz one over ten by no more than that.
        let slow = taken(0.02);
        assert!(slow.n_rows() < 13_000 && *slow.time_s.last().expect("a row") > 999.8, "{}", slow.n_rows());
        assert!((0..slow.n_rows()).all(|row| slow.is_scored(row)));
        let fast = taken(1.0);
        let scored: Vec<f64> =
            (0..fast.n_rows()).filter(|row| fast.is_scored(*row)).map(|row| fast.time_s[row]).collect();
        assert!((0.8 * MOST as f64..MOST as f64).contains(&(scored.len() as f64)), "{}", scored.len());
        let n_gaps = scored.windows(2).filter(|two| two[1] - two[0] > 0.015).count();
        assert_eq!(n_gaps, SECTIONS - 1, "every row of a section");
        assert!(scored.last().expect("a row") > &940.0);
        // Every tenth row between them, and the two turns of each second.
        assert!(fast.n_rows() > MOST + 7000 + 1300, "{}", fast.n_rows());
    }

    #[test]
    fn of_very_many_every_trial_s_beginning_is_taken_at_a_rate_that_keeps_reversals() {
        let lengths = [500_000, 300_000, 200_000];
        let rows = working_rows(&trials(&lengths), &[]);
        assert!((MOST - 10..=MOST + 10).contains(&rows.len()), "{}", rows.len());
        let mut start = 0;
        for length in lengths {
            let own: Vec<usize> = rows.iter().copied().filter(|row| (start..start + length).contains(row)).collect();
            assert_eq!(own.first(), Some(&start));
            assert!(own.windows(2).all(|two| two[1] - two[0] <= 10) && own.len() > length / 40);
            start += length;
        }
    }

    /// Encoders in every row, a camera in every so many, from an odd row on.
    fn slow_camera(n: usize, every: usize) -> Measurements {
        let mut data = trials(&[n]);
        (0..n).filter(|row| row % every != 1).for_each(|row| data.outputs[row] = f64::NAN);
        data
    }

    #[test]
    fn no_frame_of_a_camera_slower_than_the_encoders_is_lost() {
        // 120 s: encoders at 100 Hz, camera at 20 Hz.
        let data = slow_camera(12_000, 5);
        let frames = working_rows(&data, &[]).into_iter().filter(|row| data.is_scored(*row)).count();
        assert_eq!(frames, 2400, "every frame of few");
    }

    #[test]
    fn of_a_recording_at_a_kilohertz_as_many_frames_are_taken_as_of_the_camera_alone() {
        // 200 s: encoders at 1 kHz, camera at 62.5 Hz beside any stride.
        let data = slow_camera(200_000, 16);
        let rows = working_rows(&data, &[]);
        let frames: Vec<usize> = rows.iter().copied().filter(|row| data.is_scored(*row)).collect();
        let alone = working_rows(&trials(&[12_500]), &[]);
        assert_eq!(frames.len(), alone.len());
        assert!(*frames.last().expect("a frame") > 199_900 && rows.len() <= MOST + 10);
        assert!(rows.windows(2).all(|two| two[1] - two[0] <= 10), "history between frames is kept");
    }
}
