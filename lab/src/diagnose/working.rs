//! Which rows the search works on, so that very long measurements take little longer than long ones.
//!
//! Every row of few. Of many every second to tenth: still often enough for effects with a memory, whose reversals a lower rate
//! would lose. Of very many the beginning of each trial at that rate: where a trial begins its history is known.

use crate::Measurements;

/// All of so many rows, ...
const FEW: usize = 3000;
/// ... of more this and a tenth, ...
const PART: usize = 10;
/// ... and at most so many.
const MOST: usize = 30_000;

/// The working rows of these measurements without the excluded ones, which are in rising order.
pub(super) fn working_rows(data: &Measurements, excluded: &[usize]) -> Vec<usize> {
    let n = data.n_rows();
    let stride = n.div_ceil(FEW + n / PART).max(1);
    let share = (MOST as f64 * stride as f64 / n as f64).min(1.0);
    let starts: Vec<usize> = (0..n).filter(|row| data.starts_trial(*row)).collect();
    let ends = starts.iter().skip(1).copied().chain([n]);
    let of_trial = |(&start, end): (&usize, usize)| {
        let n_kept = ((end - start) as f64 * share).ceil() as usize;
        (start..start + n_kept).filter(move |row| row % stride == 0 || *row == start)
    };
    starts.iter().zip(ends).flat_map(of_trial).filter(|row| excluded.binary_search(row).is_err()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quantity;

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
            stem_angle_rad: None,
            temperature_c: None,
            sigma: None,
            extra: Vec::new(),
        }
    }

    #[test]
    fn few_rows_are_all_taken_but_for_the_excluded_ones() {
        let rows = working_rows(&trials(&[1000, 500]), &[3, 1400]);
        assert_eq!(rows.len(), 1498);
        assert!(!rows.contains(&3) && !rows.contains(&1400));
    }

    #[test]
    fn of_many_a_part_is_taken_evenly_to_the_end() {
        let rows = working_rows(&trials(&[90_000, 10_000]), &[]);
        assert!((12_000..=13_100).contains(&rows.len()) && rows.windows(2).all(|two| two[1] - two[0] <= 10));
        assert!(*rows.last().expect("a row") > 99_980);
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
}
