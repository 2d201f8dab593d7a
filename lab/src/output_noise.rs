//! Outputs that are not equally noisy: a camera sees less across its depth than along it, and segments may have a camera each.
//!
//! What changes from row to row is compared output by output. Where one is clearly noisier than another, each counts by its own noise:
//! squares of a likelihood are in units of the noise.

use crate::noise::{bounds, four_neighbours, median};
use crate::{Problem, Quantity};

/// Outputs whose noise differs by less are taken for alike: one number for all loses less than a sixth of what the data tell.
const ALIKE: f64 = 1.5;
/// What both halves of a record say of an output agrees up to this ratio, and so do second and third differences of noise that is white.
const AGREE: f64 = 1.25;
/// Fewer differences than this in a half tell nothing.
const FEWEST: usize = 100;
/// Median of the magnitude of a normal variable, in standard deviations.
const MEDIAN_OF_NORMAL: f64 = 0.674_49;

/// By how much each output counts: the mean noise by its own, 1 where all are alike or the data do not tell. The mean is that of the
/// squares, so that an error at the floor is as long as without these factors.
pub(crate) fn output_factors(problem: &Problem, residual: &[f64]) -> Vec<f64> {
    let data = &problem.data;
    let alike = vec![1.0; data.n_outputs];
    // A tracker's frame turns its axes into those of the tip.
    if !matches!(data.quantity, Quantity::Snake | Quantity::Segments) || !data.tip_frames.is_empty() {
        return alike;
    }
    let rows: Vec<usize> = (0..data.n_rows()).filter(|row| problem.weight[row * data.n_outputs] > 0.0).collect();
    let halves = rows.split_at(rows.len() / 2);
    let [Some(first), Some(second)] = [halves.0, halves.1].map(|rows| factors(problem, residual, rows)) else {
        return alike;
    };
    let ratio = |a: f64, b: f64| f64::max(a / b, b / a);
    let agree = first.iter().zip(&second).all(|(a, b)| ratio(*a, *b) < AGREE);
    let both: Vec<f64> = first.iter().zip(&second).map(|(a, b)| (a * b).sqrt()).collect();
    let (low, high) = bounds(both.iter().copied());
    if agree && high > ALIKE * low { both } else { alike }
}

/// The same by some of the scored rows alone; `None` where they do not tell.
fn factors(problem: &Problem, residual: &[f64], rows: &[usize]) -> Option<Vec<f64>> {
    let n = problem.data.n_outputs;
    let neighbours: Vec<&[usize]> = four_neighbours(&problem.data, rows)?.collect();
    let sigma = |k: usize| {
        // Standard deviation of white noise by the middle of such differences, which corners of a motion do not move.
        let by = |of: &[f64]| {
            let difference =
                |w: &&[usize]| w.iter().zip(of).map(|(row, part)| part * residual[row * n + k]).sum::<f64>();
            let scale = MEDIAN_OF_NORMAL * of.iter().map(|part| part * part).sum::<f64>().sqrt();
            median(neighbours.iter().map(|w| difference(w).abs()).collect()).map(|middle| middle / scale)
        };
        let (third, second) = (by(&[-1.0, 3.0, -3.0, 1.0])?, by(&[1.0, -2.0, 1.0])?);
        (third > 0.0 && second < AGREE * third).then_some(third)
    };
    let all = (neighbours.len() >= FEWEST).then(|| (0..n).map(sigma).collect::<Option<Vec<f64>>>())??;
    let mean = (all.iter().map(|own| own * own).sum::<f64>() / n as f64).sqrt();
    Some(all.iter().map(|own| mean / own).collect())
}

/// Which outputs are how noisy, in a sentence; `None` where all are alike.
pub(crate) fn caution(problem: &Problem) -> Option<String> {
    let factors = problem.output_factors();
    let (low, high) = bounds(factors.iter().copied());
    if high <= low {
        return None;
    }
    let all = problem.data.output_names();
    let names = |at: f64| {
        let own = all.iter().zip(factors).filter(|(_, own)| **own == at);
        own.map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
    };
    Some(format!(
        "{} changes {:.1} times as much from row to row as {}: each output counts by its own noise, in errors as well",
        names(low),
        high / low,
        names(high)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measurements;
    use crate::machine::SnakeLab;
    use krait_model::model_file::ModelFile;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    /// Factors of 40 s at 50 Hz whose two outputs are made from the row's number and a number near a normal one's.
    fn of(output: impl Fn(f64, &mut dyn FnMut() -> f64) -> [f64; 2]) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut noise = || (0..12).map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX) - 0.5).sum::<f64>();
        let n = 2000;
        let time_s: Vec<f64> = (0..n).map(|k| f64::from(k) * 0.02).collect();
        let outputs: Vec<f64> = (0..n).flat_map(|k| output(f64::from(k), &mut noise)).collect();
        let data = Measurements::bare(String::new(), Quantity::Snake, time_s, (vec![0.0; 6000], 3), (outputs, 2));
        let model = ModelFile::parse("format = 1\n[machine]\nkind = \"snake\"\n").expect("a model");
        let snake = SnakeLab::new(&model).expect("a snake");
        let problem = Problem::new(&snake, data, &[], 2.0);
        output_factors(&problem, &problem.data.outputs)
    }

    #[test]
    fn an_output_that_is_noisier_counts_less_and_an_error_at_the_floor_stays_as_long() {
        let [x, y] = of(|k, noise| [(0.01 * k).sin() + noise(), 4.0 * noise()])[..] else { panic!("two outputs") };
        assert!((x / y / 4.0 - 1.0).abs() < 0.1, "{x} {y}");
        assert!((x.powi(-2) + y.powi(-2) - 2.0).abs() < 0.01, "{x} {y}");
    }

    #[test]
    fn outputs_count_alike_where_noise_is_alike_or_is_no_noise() {
        assert_eq!(of(|_, noise| [noise(), 1.2 * noise()]), [1.0, 1.0], "alike");
        assert_eq!(of(|k, noise| [noise(), (0.8 * k).sin() * 20.0 + noise()]), [1.0, 1.0], "a motion in one of them");
        assert_eq!(of(|k, noise| [noise(), noise() * if k < 1000.0 { 1.0 } else { 6.0 }]), [1.0, 1.0], "of one half");
        assert_eq!(of(|k, noise| [noise(), (k / 40.0).floor()]), [1.0, 1.0], "steps that hardly ever change");
    }
}
