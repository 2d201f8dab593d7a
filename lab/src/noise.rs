//! The measurement's own noise: what no model could explain, estimated without any.
//!
//! Three numbers, because none is right alone: differences between neighbouring rows see only what changes from row to row; rest
//! of the machine shows slow noise as well, as far as rests are long; visits to the same place show everything that does not
//! repeat, which includes hysteresis with another history.

use crate::fit::dot;
use crate::read::scatter_behind_filter;
use crate::{Measurements, Problem};

/// Standard deviations of one output's noise, in the outputs' unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NoiseFloor {
    /// From third differences: the white part.
    pub differences: Option<f64>,
    /// Its relative standard error; zero where it is not known.
    pub differences_relative_se: f64,
    /// From pairs of rows a second or more apart while the machine rests.
    pub rest: Option<f64>,
    /// Its relative standard error; zero where it is not known.
    pub rest_relative_se: f64,
    /// Time at rest that `rest` is made of, s.
    pub rest_time_s: f64,
    /// From visits to the same inputs in the same direction at other times: an upper bound.
    pub visits: Option<f64>,
    /// Pairs of visits.
    pub n_visits: usize,
}

/// How a floor was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FloorSource {
    /// Rests and differences agree: white noise.
    White,
    /// Rests are noisier than differences: slow noise.
    Rest,
    /// Differences only; slow noise would be missed.
    Differences,
}

impl FloorSource {
    /// A few words for tables.
    pub fn label(self) -> &'static str {
        match self {
            Self::White => "white: rests and differences agree",
            Self::Rest => "slow noise, from rests",
            Self::Differences => "optimistic: from differences only, no rests",
        }
    }
}

/// Rests shorter than this tell nothing about slow noise.
const SHORTEST_REST_S: f64 = 1.5;
/// Pairs of rows in a rest are at least this far apart.
const PAIR_GAP_S: f64 = 1.0;
/// Differences of forces between the few rows that a filter leaves are not noise alone where they are so much more than the noise that is
/// new in every row: the rows are so far apart that what no effect explains looks new in each, as slow noise does.
const TOO_MUCH: f64 = 5.0;
/// A floor below this part of another is no matter of chance.
const CLEARLY_BELOW: f64 = 0.85;
/// Rests and differences agree up to this ratio.
const AGREE: f64 = 1.06;
/// At the floor is an error up to this ratio of a floor that is known exactly.
const AT_FLOOR: f64 = 1.04;
/// A residual of a shorter memory, in rows, has none.
pub(crate) const NO_MEMORY: f64 = 1.6;
/// Squares of differences of white noise are not independent: 1 + 2 sum rho^2, where rho is -15/20, 6/20 and -1/20 over one to three rows
/// for third differences, and -1/2 over the gap for pairs.
const SHARED_BY_DIFFERENCES: f64 = 2.31;
const SHARED_BY_PAIRS: f64 = 1.5;
/// Rests are cut into pieces of this length, whose scatter says how well their noise is known, whatever its memory.
const PIECE_S: f64 = 2.0 * PAIR_GAP_S;

/// Relative standard error of a standard deviation from so many independent values.
pub(crate) fn relative_error(n_independent: f64) -> f64 {
    (0.5 / n_independent.max(2.0)).sqrt()
}

/// Largest ratio of a floor that is still the floor.
pub(crate) fn at_floor(relative_error: f64) -> f64 {
    AT_FLOOR + 2.0 * relative_error
}

impl NoiseFloor {
    /// Estimates from residuals of any model that follows the motion roughly (weighted, row after row).
    pub fn new(problem: &Problem, residual: &[f64]) -> Self {
        let behind_filter = scatter_behind_filter(&problem.data);
        let is_noise = |sigma: f64| behind_filter.is_none_or(|noise| sigma < TOO_MUCH * noise);
        let differences = by_differences(problem, residual).filter(|(sigma, _)| is_noise(*sigma));
        let (rest, rest_time_s) = at_rest(problem, residual);
        let (visits, n_visits) = on_visits(problem, residual);
        Self {
            differences: differences.map(|(sigma, _)| sigma),
            differences_relative_se: differences.map_or(0.0, |(_, n)| relative_error(n as f64 / SHARED_BY_DIFFERENCES)),
            rest: rest.map(|(sigma, _)| sigma),
            rest_relative_se: rest.map_or(0.0, |(_, error)| error),
            rest_time_s,
            visits,
            n_visits,
        }
    }

    /// One output's standard deviation, and where it comes from; `None` if the data do not tell.
    pub fn sigma(&self) -> Option<(f64, FloorSource)> {
        match (self.differences, self.rest) {
            (Some(fast), Some(rest)) if rest > AGREE * fast => Some((rest, FloorSource::Rest)),
            (Some(fast), Some(_)) => Some((fast, FloorSource::White)),
            (Some(fast), None) => Some((fast, FloorSource::Differences)),
            (None, rest) => rest.map(|rest| (rest, FloorSource::Rest)),
        }
    }

    /// Relative standard error of [`Self::sigma`]; zero where that is not known.
    pub fn relative_error(&self) -> f64 {
        match self.sigma() {
            Some((_, FloorSource::Rest)) => self.rest_relative_se,
            Some((_, FloorSource::White | FloorSource::Differences)) => self.differences_relative_se,
            None => 0.0,
        }
    }

    /// Whether its standard deviation is clearly smaller than another's, or the only one that is known.
    pub(crate) fn is_below(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|floor| floor.sigma().map(|(sigma, _)| sigma));
        own.is_some_and(|own| other.is_none_or(|other| own < CLEARLY_BELOW * other))
    }
}

/// Third differences of neighbouring rows, largest values left out: sigma^2 = mean (D^3 r)^2 / 20; and of how many.
pub(crate) fn by_differences(problem: &Problem, residual: &[f64]) -> Option<(f64, usize)> {
    let data = &problem.data;
    let width = data.n_outputs;
    let rows: Vec<usize> = (0..data.n_rows()).filter(|row| problem.weight[row * width] > 0.0).collect();
    let mut squares = Vec::new();
    for w in four_neighbours(data, &rows)? {
        for k in 0..width {
            let r = |i: usize| residual[w[i] * width + k];
            squares.push((r(3) - 3.0 * r(2) + 3.0 * r(1) - r(0)).powi(2) / 20.0);
        }
    }
    // Squares of a normal variable beyond 30 times their median do not come from noise but from corners of the motion.
    let middle = median(squares.clone())?;
    squares.retain(|s| *s <= 30.0 * middle.max(f64::MIN_POSITIVE));
    if squares.len() < 100 {
        return None;
    }
    Some(((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), squares.len()))
}

/// Every four of these rows that follow each other in one trial, without a gap; `None` of fewer than two rows.
pub(crate) fn four_neighbours<'a>(
    data: &'a Measurements,
    rows: &'a [usize],
) -> Option<impl Iterator<Item = &'a [usize]> + Clone> {
    let step_s = median(rows.windows(2).map(|w| data.time_s[w[1]] - data.time_s[w[0]]).collect())?;
    let are_near = move |w: &&[usize]| {
        data.trial[w[0]] == data.trial[w[3]] && data.time_s[w[3]] - data.time_s[w[0]] <= 4.5 * step_s
    };
    Some(rows.windows(4).filter(are_near))
}

/// Half the mean square of differences a second or more apart in rests, as a standard deviation with its relative standard error; and
/// the time at rest.
fn at_rest(problem: &Problem, residual: &[f64]) -> (Option<(f64, f64)>, f64) {
    let data = &problem.data;
    let width = data.n_outputs;
    let mut pieces: Vec<Piece> = Vec::new();
    let mut total_s = 0.0;
    for (first, end) in rests(data, SHORTEST_REST_S) {
        let rows: Vec<usize> = (first..end).filter(|row| problem.weight[row * width] > 0.0).collect();
        total_s += data.time_s[end - 1] - data.time_s[first];
        let mut later = 0;
        let mut last = None;
        for (i, &row) in rows.iter().enumerate() {
            later = later.max(i);
            while later < rows.len() && data.time_s[rows[later]] - data.time_s[row] < PAIR_GAP_S {
                later += 1;
            }
            let Some(&other) = rows.get(later) else { break };
            let number = ((data.time_s[row] - data.time_s[first]) / PIECE_S) as usize;
            if last != Some(number) {
                pieces.push(Piece::default());
                last = Some(number);
            }
            let Some(own) = pieces.last_mut() else { break };
            for k in 0..width {
                own.sum += 0.5 * (residual[other * width + k] - residual[row * width + k]).powi(2);
                own.n_pairs += 1.0;
            }
        }
    }
    (of_pieces(&pieces), total_s)
}

/// Half the squared differences of the pairs that begin in one piece of a rest.
#[derive(Default)]
struct Piece {
    sum: f64,
    n_pairs: f64,
}

/// Standard deviation of all pieces together, with its relative standard error from their scatter; `None` of few pairs.
fn of_pieces(pieces: &[Piece]) -> Option<(f64, f64)> {
    let [sum, n_pairs] = pieces.iter().fold([0.0, 0.0], |[s, n], own| [s + own.sum, n + own.n_pairs]);
    if n_pairs < 200.0 {
        return None;
    }
    let (mean, n) = (sum / n_pairs, pieces.len() as f64);
    let scatter: f64 = pieces.iter().map(|own| (own.sum - mean * own.n_pairs).powi(2)).sum();
    // Of a mean square; that of its root is half of it.
    let of_square = (scatter * n / (n - 1.0).max(1.0)).sqrt() / sum.max(f64::MIN_POSITIVE);
    // A piece says as much as one value at least, and no more than its pairs do.
    let error = (0.5 * of_square).min(relative_error(n)).max(relative_error(n_pairs / SHARED_BY_PAIRS));
    Some((mean.sqrt(), error))
}

/// First row and end of each stretch in which no input moves.
pub fn rests(data: &Measurements, shortest_s: f64) -> Vec<(usize, usize)> {
    let still = 1e-3 * largest_range(data);
    let mut found = Vec::new();
    let mut first = 0;
    for row in 1..=data.n_rows() {
        let goes_on = row < data.n_rows()
            && !data.starts_trial(row)
            && data.input(row).iter().zip(data.input(first)).all(|(a, b)| (a - b).abs() <= still);
        if !goes_on {
            if data.time_s[row - 1] - data.time_s[first] >= shortest_s {
                found.push((first, row));
            }
            first = row;
        }
    }
    found
}

/// The least and the largest of values; infinite the wrong way round where there are none.
pub(crate) fn bounds(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// Movement relative to the magnitude that is rounding and not motion.
const STILL: f64 = 1e-9;

/// Whether values between these bounds do not move, or there are none.
pub(crate) fn is_still((low, high): (f64, f64)) -> bool {
    low > high || high - low <= STILL * high.abs().max(low.abs())
}

/// Largest range of any input.
pub fn largest_range(data: &Measurements) -> f64 {
    let range = |k: usize| {
        let (low, high) = bounds(data.inputs.iter().skip(k).step_by(data.n_inputs.max(1)).copied());
        high - low
    };
    (0..data.n_inputs).map(range).fold(0.0, f64::max)
}

/// Half the mean square of residual differences between visits of the same inputs in the same direction, 10 s or more apart.
fn on_visits(problem: &Problem, residual: &[f64]) -> (Option<f64>, usize) {
    let data = &problem.data;
    let width = data.n_outputs;
    let near = 0.01 * largest_range(data);
    let scored: Vec<usize> = (1..data.n_rows()).filter(|row| problem.weight[row * width] > 0.0).collect();
    let stride = scored.len().div_ceil(MOST_VISITS).max(1);
    let mut rows: Vec<usize> = scored.into_iter().step_by(stride).collect();
    rows.sort_by(|a, b| data.input(*a)[0].total_cmp(&data.input(*b)[0]));
    let direction = |row: usize| -> Vec<i8> {
        let step = data.input(row).iter().zip(data.input(row - 1)).map(|(a, b)| a - b);
        step.map(|d| if d.abs() < 1e-4 * near { 0 } else { d.signum() as i8 }).collect()
    };
    let (mut sum, mut n_pairs) = (0.0, 0usize);
    for (i, &a) in rows.iter().enumerate() {
        for &b in rows[i + 1..].iter().take_while(|&&b| data.input(b)[0] - data.input(a)[0] <= near).take(200) {
            let same = data.input(a).iter().zip(data.input(b)).all(|(x, y)| (x - y).abs() <= near);
            if same && (data.time_s[a] - data.time_s[b]).abs() > 10.0 && direction(a) == direction(b) {
                n_pairs += 1;
                sum +=
                    (0..width).map(|k| 0.5 * (residual[a * width + k] - residual[b * width + k]).powi(2)).sum::<f64>();
            }
        }
    }
    let sigma = (sum / (n_pairs * width).max(1) as f64).sqrt();
    ((n_pairs >= 30).then_some(sigma), n_pairs)
}

const MOST_VISITS: usize = 4000;

/// 1 + 2 sum rho over lags in rows: how many rows of a residual tell as much as one row of white noise, 1 or more.
pub fn autocorrelation_time(residual: &[f64], width: usize) -> f64 {
    1.0 + 2.0 * autocorrelation(residual, width).iter().skip(1).sum::<f64>()
}

/// rho at lags 0, 1, 2 ... in rows, up to the first pair of lags whose sum is not positive (Geyer's initial positive sequence).
pub fn autocorrelation(residual: &[f64], width: usize) -> Vec<f64> {
    core::iter::once(1.0).chain(pairs_of_lags(residual, width).flatten()).collect()
}

/// Whether a row of a residual says anything about the next ones.
pub(crate) fn remembers(residual: &[f64], width: usize) -> bool {
    let mut memory = 1.0;
    pairs_of_lags(residual, width).any(|[odd, even]| {
        memory += 2.0 * (odd + even);
        memory >= NO_MEMORY
    })
}

/// rho at lags 1 and 2, 3 and 4 ..., as far as their sums are positive.
fn pairs_of_lags(residual: &[f64], width: usize) -> impl Iterator<Item = [f64; 2]> {
    let width = width.max(1);
    let at = move |lag: usize| dot(residual, residual.get(lag * width..).unwrap_or(&[]));
    let whole = at(0).max(f64::MIN_POSITIVE);
    let lags = (1..(residual.len() / width / 4).min(MOST_LAGS)).step_by(2);
    lags.map(move |lag| [at(lag) / whole, at(lag + 1) / whole]).take_while(|[odd, even]| odd + even > 0.0)
}

const MOST_LAGS: usize = 2000;

pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let (_, own, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_autocorrelation_time_of_white_noise_is_one_and_that_of_a_slow_walk_is_its_own() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let white: Vec<f64> = (0..20_000).map(|_| uniform()).collect();
        assert!((autocorrelation_time(&white, 1) - 1.0).abs() < 0.3);
        let mut last = 0.0;
        let slow: Vec<f64> = (0..20_000)
            .map(|_| {
                last = 0.9 * last + uniform();
                last
            })
            .collect();
        // (1 + 0.9) / (1 - 0.9) = 19.
        assert!((autocorrelation_time(&slow, 1) / 19.0 - 1.0).abs() < 0.4, "{}", autocorrelation_time(&slow, 1));
    }
}
