//! What three lines share: it pushes no shape, so no camera can show its error; encoders and loads tell what there was of it.

use crate::{Measurements, Quantity};

/// What all three lines of a snake have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonMode {
    /// Mean of the three encoders, root mean square over rows, m: what was commanded along no shape.
    pub encoder_rms_m: f64,
    /// Largest magnitude of that mean, m.
    pub encoder_max_m: f64,
    /// Mean of the three loads at the actuators, root mean square over rows, N; `None` where loads were not measured.
    pub load_rms_n: Option<f64>,
    /// Largest magnitude of that mean, N.
    pub load_max_n: Option<f64>,
}

impl CommonMode {
    pub(super) fn of(data: &Measurements) -> Option<Self> {
        if data.quantity != Quantity::Snake {
            return None;
        }
        let (encoder_rms_m, encoder_max_m) = of_mean(&data.inputs)?;
        let load = data.loads_n.as_ref().and_then(|loads| of_mean(loads));
        Some(Self { encoder_rms_m, encoder_max_m, load_rms_n: load.map(|l| l.0), load_max_n: load.map(|l| l.1) })
    }
}

/// Root mean square and largest magnitude of the mean of each three.
fn of_mean(values: &[f64]) -> Option<(f64, f64)> {
    let means = values.chunks_exact(3).map(|three| three.iter().sum::<f64>() / 3.0).filter(|mean| mean.is_finite());
    let (n, sum, max) =
        means.fold((0_u64, 0.0, 0.0_f64), |(n, sum, max), mean| (n + 1, sum + mean * mean, max.max(mean.abs())));
    (n > 0).then(|| ((sum / n as f64).sqrt(), max))
}
