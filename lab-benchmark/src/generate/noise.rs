//! Noise of a camera, in several colours, each with the standard deviation that is asked for.

use super::random::{Purpose, Random};

/// A kind of noise; sigma is the standard deviation of each component of the bend vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoiseKind {
    /// Independent from row to row.
    White,
    /// Half of the variance white, half with this correlation time, s (Ornstein-Uhlenbeck).
    Coloured(f64),
    /// Rounded to steps that make three quarters of the variance.
    Quantised,
    /// White, and one row in a hundred has ten times as much.
    Outliers,
    /// White, smaller near the straight pose and larger at large bends.
    Heteroscedastic,
    /// Half of the variance white, half wandering over a minute.
    Drift,
}

/// Correlation time of a wandering camera, s.
const WANDER_S: f64 = 60.0;

impl NoiseKind {
    /// Its name on the command line and in answers.
    pub fn name(self) -> String {
        match self {
            Self::White => "white".to_owned(),
            Self::Coloured(time_s) => format!("ou:{time_s}"),
            Self::Quantised => "quantised".to_owned(),
            Self::Outliers => "outliers".to_owned(),
            Self::Heteroscedastic => "heteroscedastic".to_owned(),
            Self::Drift => "drift".to_owned(),
        }
    }

    /// The kind of that name; `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        if let Some(time) = name.strip_prefix("ou:") {
            let time_s: f64 = time.parse().ok()?;
            return (time_s > 0.0 && time_s <= 1e4).then_some(Self::Coloured(time_s));
        }
        [Self::White, Self::Quantised, Self::Outliers, Self::Heteroscedastic, Self::Drift]
            .into_iter()
            .find(|noise| noise.name() == name)
    }

    /// Adds it to shapes, rad.
    pub(crate) fn add_to(self, seen_rad: &mut [[f64; 2]], sigma_rad: f64, period_s: f64, seed: u64) {
        let mut random = Random::new(seed, Purpose::Noise);
        let share = 0.5_f64.sqrt();
        let decay = match self {
            Self::Coloured(time_s) => (-period_s / time_s).exp(),
            _ => (-period_s / WANDER_S).exp(),
        };
        let mut slow = [random.normal(), random.normal()];
        for seen in seen_rad {
            let bend = seen[0].hypot(seen[1]);
            // One row's error is one failure of the picture: both components are out together.
            let is_out = self == Self::Outliers && random.between(0.0, 1.0) < 0.01;
            for (value, slow) in seen.iter_mut().zip(&mut slow) {
                let white = random.normal();
                *value = match self {
                    Self::White => *value + sigma_rad * white,
                    Self::Coloured(_) | Self::Drift => {
                        *slow = decay * *slow + (1.0 - decay * decay).sqrt() * random.normal();
                        *value + sigma_rad * share * (white + *slow)
                    }
                    Self::Quantised => {
                        let step = sigma_rad * 3.0;
                        ((*value + 0.5 * sigma_rad * white) / step).round() * step
                    }
                    Self::Outliers => *value + sigma_rad * white * if is_out { 10.0 } else { 1.0 },
                    Self::Heteroscedastic => *value + sigma_rad * (0.4 + bend) * white,
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_about_the_deviation_that_was_asked_for_and_comes_back_by_its_name() {
        let kinds = [
            NoiseKind::White,
            NoiseKind::Coloured(0.5),
            NoiseKind::Quantised,
            NoiseKind::Heteroscedastic,
            NoiseKind::Drift,
        ];
        for noise in kinds {
            let clean: Vec<[f64; 2]> = (0..60_000).map(|k| [0.6 * (f64::from(k) * 1e-3).sin(), 0.4]).collect();
            let mut noisy = clean.clone();
            noise.add_to(&mut noisy, 0.01, 0.02, 7);
            let square: f64 = noisy.iter().zip(&clean).map(|(a, b)| (a[0] - b[0]).powi(2)).sum();
            let sd = (square / 60_000.0).sqrt();
            assert!((sd / 0.01 - 1.0).abs() < 0.15, "{noise:?}: {sd}");
            assert_eq!(NoiseKind::from_name(&noise.name()), Some(noise));
        }
        assert_eq!(NoiseKind::from_name("ou:-1"), None);
        assert_eq!(NoiseKind::from_name("pink"), None);
    }

    #[test]
    fn coloured_noise_is_alike_within_its_time_and_white_noise_is_not() {
        let alike = |noise: NoiseKind| {
            let mut noisy = vec![[0.0; 2]; 60_000];
            noise.add_to(&mut noisy, 1.0, 0.02, 3);
            noisy.iter().zip(noisy.iter().skip(5)).map(|(a, b)| a[0] * b[0]).sum::<f64>() / 60_000.0
        };
        assert!((alike(NoiseKind::Coloured(0.5)) - 0.5 * (-0.2_f64).exp()).abs() < 0.05);
        assert!(alike(NoiseKind::White).abs() < 0.02);
    }
}
