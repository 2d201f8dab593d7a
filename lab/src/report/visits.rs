//! Means in bins with their error bars: rows in a row in one bin are one visit, and visits, not rows, are independent.

/// A bin of fewer rows than this makes no point.
const FEWEST: usize = 8;

/// Bins that are filled in the order of time.
pub(super) struct Visits {
    /// Sum and number of rows of each visit, bin by bin.
    bins: Vec<Vec<(f64, usize)>>,
    last: Option<usize>,
}

/// Points of a curve; all lists are as long.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Points {
    pub x: Vec<f64>,
    pub mean: Vec<f64>,
    /// Twice the standard error; NaN of a bin that was visited once.
    pub whisker: Vec<f64>,
}

impl Visits {
    pub(super) fn new(n_bins: usize) -> Self {
        Self { bins: vec![Vec::new(); n_bins], last: None }
    }

    /// The next row: its bin, `None` where it counts in none, and its value.
    pub(super) fn add(&mut self, bin: Option<usize>, value: f64) {
        let bin = bin.filter(|_| value.is_finite());
        if let Some(own) = bin.and_then(|bin| self.bins.get_mut(bin)) {
            match own.last_mut().filter(|_| self.last == bin) {
                Some(visit) => *visit = (visit.0 + value, visit.1 + 1),
                None => own.push((value, 1)),
            }
        }
        self.last = bin;
    }

    /// Mean of every bin of rows enough; `at` is its place.
    pub(super) fn points(&self, at: impl Fn(usize) -> f64) -> Points {
        let mut points = Points::default();
        for (k, own) in self.bins.iter().enumerate() {
            let total: usize = own.iter().map(|(_, n)| n).sum();
            if total < FEWEST {
                continue;
            }
            let n = own.len() as f64;
            let mean = own.iter().map(|(sum, _)| sum).sum::<f64>() / total as f64;
            // Visits count by their rows, so that a long one weighs as much in the error as in the mean.
            let spread: f64 = own.iter().map(|(sum, rows)| (sum - mean * *rows as f64).powi(2)).sum();
            let error = if own.len() < 2 { f64::NAN } else { (spread * n / (n - 1.0)).sqrt() / total as f64 };
            points.x.push(at(k));
            points.mean.push(mean);
            points.whisker.push(2.0 * error);
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_mean_is_that_of_its_visits() {
        let mut visits = Visits::new(3);
        for _ in 0..10 {
            for value in [1.0, 3.0] {
                (0..5).for_each(|_| visits.add(Some(1), value));
                visits.add(None, 0.0);
            }
        }
        (0..20).for_each(|_| visits.add(Some(2), 7.0));
        (0..3).for_each(|_| visits.add(Some(0), 7.0));
        let points = visits.points(|k| k as f64);
        assert_eq!((points.x, points.mean), (vec![1.0, 2.0], vec![2.0, 7.0]), "three rows are no point");
        // 20 visits, 1 off each: 2 sqrt(1 / 19); a hundred rows by themselves would make it half as large.
        assert!((points.whisker[0] - 2.0 / 19.0_f64.sqrt()).abs() < 1e-12 && points.whisker[1].is_nan());
    }
}
