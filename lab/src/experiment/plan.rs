//! Which moves, how often: what they tell of pairs that are not told apart yet, for each second.

use super::Separation;

/// Longest experiment, s: a hand that holds an instrument tires, and a machine warms up.
pub(super) const MOST_S: f64 = 240.0;
/// A move is repeated at most so often.
const MOST_REPEATS: usize = 4;
/// A move that tells less than this of every pair is noise.
const LEAST: f64 = 0.1;

/// Moves by their places, the one that tells most first. `told[k][pair]` is the least that move `k` adds to lambda of a pair: the
/// sum over moves is never more than what all of them tell together, because one set of values must suit all.
pub(super) fn picked(told: &[Vec<f64>], seconds: &[f64], enough: f64) -> Vec<usize> {
    let n_pairs = told.first().map_or(0, Vec::len);
    // A pair that all moves together would not tell does not steer.
    let most = |pair: usize| MOST_REPEATS as f64 * told.iter().map(|own| own[pair]).sum::<f64>();
    let mut lambda: Vec<f64> = (0..n_pairs).map(|pair| if most(pair) < enough { enough } else { 0.0 }).collect();
    let mut picked: Vec<usize> = Vec::new();
    let mut total_s = 0.0;
    while lambda.iter().any(|own| *own < enough) {
        let gain = |k: usize| -> f64 {
            let of = |(told, own): (&f64, &f64)| told.min((enough - own).max(0.0));
            told[k].iter().zip(&lambda).map(of).sum()
        };
        let fits = |k: &usize| {
            let repeats = picked.iter().filter(|own| *own == k).count();
            repeats < MOST_REPEATS && total_s + seconds[*k] <= MOST_S && gain(*k) > LEAST
        };
        let rate = |k: &usize| gain(*k) / seconds[*k];
        let best = (0..told.len()).filter(fits).max_by(|a, b| rate(a).total_cmp(&rate(b)));
        let Some(best) = best else { break };
        lambda.iter_mut().zip(&told[best]).for_each(|(own, told)| *own += told);
        total_s += seconds[best];
        picked.push(best);
    }
    if picked.is_empty() {
        // Nothing tells them apart: the motion that tells most is still the best.
        let sum = |k: &usize| told[*k].iter().sum::<f64>() / seconds[*k];
        picked.extend((0..told.len()).max_by(|a, b| sum(a).total_cmp(&sum(b))));
    }
    picked
}

/// Whether a shorter motion tells every pair apart that the longer one does; what neither tells does not count.
pub(super) fn does_as_well(shorter: &Separation, longer: &Separation) -> bool {
    shorter.pairs.iter().zip(&longer.pairs).all(|(shorter, longer)| shorter.is_told() || !longer.is_told())
}

#[cfg(test)]
mod tests {
    use super::super::Pair;
    use super::*;

    #[test]
    fn moves_are_taken_by_what_they_tell_for_each_second_until_every_pair_is_told_apart() {
        // The first tells nothing, the second much in a long time, the third less in a short one, the fourth alone tells of pair two.
        let told = [vec![0.0, 0.0], vec![12.0, 0.0], vec![6.0, 0.0], vec![0.0, 20.0]];
        let seconds = [1.0, 60.0, 10.0, 30.0];
        let mut order = picked(&told, &seconds, 10.0);
        order.sort_unstable();
        assert_eq!(order, [2, 2, 3]);
        // What no move tells is not tried for ever.
        assert_eq!(picked(&[vec![0.01], vec![0.02]], &[5.0, 5.0], 10.0), [1]);
        let weak = picked(&[vec![3.0]], &[50.0], 10.0);
        assert_eq!(weak.len(), 4);
    }
    #[test]
    fn a_shorter_motion_must_tell_what_the_longer_one_tells() {
        let of = |lambdas: [f64; 2]| Separation {
            seconds: 1.0,
            pairs: lambdas
                .map(|lambda_then| Pair {
                    truth: "a".to_owned(),
                    other: "b".to_owned(),
                    lambda_now: 0.0,
                    lambda_then,
                    part_then: 1.0,
                })
                .into(),
        };
        assert!(does_as_well(&of([11.0, 0.5]), &of([90.0, 2.1])));
        assert!(!does_as_well(&of([9.0, 2.1]), &of([90.0, 2.1])));
    }
}
