//! A camera that was mounted anew for a recording: it sees every bend by the same angles otherwise than the first recording's did.

use crate::Measurements;

/// By how much a recording's camera sees every output larger, rad, one for each output; empty: not at all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraOffset(pub Vec<f64>);

impl CameraOffset {
    /// Largest angle that is believed, deg.
    pub const MOST_DEG: f64 = 90.0;

    /// Whether the camera stands where the first recording's stood.
    pub fn is_none(&self) -> bool {
        self.0.iter().all(|own| *own == 0.0)
    }

    /// Both together.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let n = self.0.len().max(other.0.len());
        let of = |own: &Self, k: usize| own.0.get(k).copied().unwrap_or_default();
        Self((0..n).map(|k| of(self, k) + of(other, k)).collect())
    }

    /// The angles as the option `--camera-offset` has them: degrees, with commas between.
    pub fn words(&self) -> String {
        let words: Vec<String> = self.0.iter().map(|own| format!("{:.4}", own.to_degrees())).collect();
        if words.is_empty() { "0".to_owned() } else { words.join(",") }
    }

    pub(crate) fn to_json(&self) -> serde_json::Value {
        serde_json::json!({ "offset_deg": self.0.iter().map(|rad| rad.to_degrees()).collect::<Vec<_>>() })
    }
}

impl core::str::FromStr for CameraOffset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            format!(
                "camera offset {text:?}: expected how much larger the recording's camera sees each bend, deg (at most {} either way), with \
                 commas between, as in 0.8,-0.3, or 0 for a camera that stands where the first one stood",
                Self::MOST_DEG
            )
        };
        let number = |text: &str| {
            let deg = text.trim().parse::<f64>().ok().filter(|deg| deg.abs() <= Self::MOST_DEG);
            deg.map(f64::to_radians).ok_or_else(expected)
        };
        let all: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
        Ok(if all == [0.0] { Self::default() } else { Self(all) })
    }
}

impl Measurements {
    /// The same as if every recording's camera stood where the first one's stood. `first_trials` has the first trial of each recording.
    #[must_use]
    pub fn by_cameras(&self, cameras: &[CameraOffset], first_trials: &[usize]) -> Self {
        let mut moved = self.clone();
        for row in 0..self.n_rows() {
            let of = first_trials.partition_point(|first| *first <= self.trial[row] as usize);
            let Some(camera) = of.checked_sub(1).and_then(|k| cameras.get(k)) else { continue };
            // What was not measured is NaN and stays so.
            let own = moved.outputs[row * self.n_outputs..][..self.n_outputs].iter_mut();
            own.zip(&camera.0).for_each(|(output, offset)| *output -= offset);
        }
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quantity;

    #[test]
    fn each_recording_is_moved_by_its_own_camera() {
        let bare = |n: usize| (vec![0.0; 2 * n], 2);
        let whole = Measurements::bare("made".to_owned(), Quantity::Snake, vec![0.0; 4], (vec![0.0; 12], 3), bare(4));
        let mut data = Measurements { trial: vec![0, 1, 2, 2], ..whole };
        data.outputs[6] = f64::NAN;
        let moved = data.by_cameras(&[CameraOffset::default(), CameraOffset(vec![0.5, -0.25])], &[0, 2]);
        assert_eq!(moved.outputs[..6], [0.0, 0.0, 0.0, 0.0, -0.5, 0.25]);
        assert!(moved.outputs[6].is_nan() && moved.outputs[7] == 0.25);
    }

    #[test]
    fn an_offset_is_read_as_it_is_written() {
        for own in [CameraOffset(vec![0.01, -0.02]), CameraOffset(vec![0.0, 0.1, 0.0, -0.1]), CameraOffset::default()] {
            let again: CameraOffset = own.words().parse().unwrap();
            assert_eq!(again.0.len(), own.0.len());
            assert!(again.0.iter().zip(&own.0).all(|(a, b)| (a - b).abs() < 1e-5));
        }
        for wrong in ["left", "nan,0", "91,0", "1,,2", ""] {
            let sentence = wrong.parse::<CameraOffset>().unwrap_err();
            assert!(sentence.contains("expected how much larger"), "{sentence}");
        }
    }
}
