//! Autocorrelation of the residual, with the band that noise of the same memory would stay in.

use super::picture::{Picture, line};
use super::rows::Rows;

/// Longest lag, s.
const LONGEST_S: f64 = 20.0;
/// Points of a curve.
const N_LAGS: usize = 120;

/// The picture of all models.
pub(super) fn picture(rows: &Rows) -> Picture {
    let title = "Autocorrelation";
    let Some(step_s) = step_s(rows) else {
        return Picture::none(title, "Too few rows for an autocorrelation.");
    };
    let n = rows.scored.len();
    let longest = ((LONGEST_S / step_s) as usize).min(n / 4);
    let stride = longest.div_ceil(N_LAGS).max(1);
    let lags: Vec<usize> = (0..=longest).step_by(stride).collect();
    let time_s: Vec<f64> = lags.iter().map(|lag| *lag as f64 * step_s).collect();
    let mut traces: Vec<Box<dyn plotly::Trace>> = Vec::new();
    for (m, (model, _)) in rows.models.iter().enumerate() {
        let own = autocorrelation(rows, m, &lags);
        if m + 1 == rows.models.len() {
            let band = bartlett(&own, stride, n);
            traces.push(line("band, 95 %", 0, time_s.clone(), band.clone()));
            traces.push(line("band, 95 %, below", 0, time_s.clone(), band.iter().map(|b| -b).collect()));
        }
        traces.push(line(model, m + 1, time_s.clone(), own));
    }
    let sentence = "White noise drops to zero at once; a curve that stays above the band (Bartlett's, for the last model's own \
                    memory) means that errors of neighbouring rows are alike: an effect is missing, or the noise is slow.";
    Picture::new(title, sentence, "lag (s)", "autocorrelation (1)", traces)
}

/// Median time between scored rows.
fn step_s(rows: &Rows) -> Option<f64> {
    let mut steps: Vec<f64> = rows.scored.windows(2).map(|w| rows.data.time_s[w[1]] - rows.data.time_s[w[0]]).collect();
    steps.retain(|step| *step > 0.0);
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().filter(|_| rows.scored.len() >= 40)
}

/// Autocorrelation of the residual vectors without their mean.
fn autocorrelation(rows: &Rows, model: usize, lags: &[usize]) -> Vec<f64> {
    let width = rows.data.n_outputs;
    let n = rows.scored.len();
    let mut columns: Vec<Vec<f64>> = (0..width)
        .map(|k| rows.scored.iter().map(|&row| rows.measured(row, k) - rows.predicted(model, row, k)).collect())
        .collect();
    for column in &mut columns {
        let mean = column.iter().sum::<f64>() / n as f64;
        column.iter_mut().for_each(|r| *r -= mean);
    }
    let covariance = |lag: usize| -> f64 {
        columns.iter().map(|c| c.iter().zip(c.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>()).sum()
    };
    let variance = covariance(0).max(f64::MIN_POSITIVE);
    lags.iter().map(|&lag| covariance(lag) / variance).collect()
}

/// 1.96 sqrt((1 + 2 sum of squares at smaller lags) / n).
fn bartlett(correlation: &[f64], stride: usize, n: usize) -> Vec<f64> {
    let mut sum = 0.0;
    let mut band = Vec::with_capacity(correlation.len());
    for (k, r) in correlation.iter().enumerate() {
        band.push(1.96 * ((1.0 + 2.0 * sum) / n as f64).sqrt());
        // Lags between those that are drawn count as this one; lag zero is the one in the sum's place.
        sum += if k == 0 { 0.0 } else { r * r * stride as f64 };
    }
    band
}

#[cfg(test)]
mod tests {
    use super::bartlett;

    #[test]
    fn the_band_of_white_noise_is_that_of_its_number_and_memory_widens_it() {
        let white = bartlett(&[1.0, 0.0, 0.0], 1, 400);
        assert!(white.iter().all(|b| (b - 1.96 / 20.0).abs() < 1e-12));
        let slow = bartlett(&[1.0, 0.5, 0.5], 1, 400);
        assert!((slow[2] - 1.96 * (1.5_f64 / 400.0).sqrt()).abs() < 1e-12);
    }
}
