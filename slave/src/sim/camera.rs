//! The simulated camera: exposes on a fixed grid of instants, adds noise, hands frames over after its latency.

use super::noise::Noise;
use super::truth::CameraTruth;
use crate::drive::ShapeReading;

/// Frames that may be under way at once: more than the longest latency times the highest rate.
const N_FRAMES: usize = 64;

/// Exposes whenever an instant of its grid (multiples of the period on CLOCK_MONOTONIC) has passed.
#[derive(Clone, Debug)]
pub(crate) struct Camera {
    period_ns: i64,
    latency_ns: i64,
    sigma_rad: f64,
    plane_sin_cos: (f64, f64),
    noise: Noise,
    last_grid: Option<i64>,
    frames: [Option<ShapeReading>; N_FRAMES],
    n_exposed: usize,
    n_handed_over: usize,
}

impl Camera {
    pub(crate) fn new(truth: &CameraTruth) -> Self {
        Self {
            period_ns: (1e9 / truth.rate_hz) as i64,
            latency_ns: (truth.latency_s * 1e9) as i64,
            sigma_rad: truth.noise_rad,
            plane_sin_cos: truth.plane_offset_rad.sin_cos(),
            noise: Noise::new(truth.seed, 1),
            last_grid: None,
            frames: [None; N_FRAMES],
            n_exposed: 0,
            n_handed_over: 0,
        }
    }

    /// Tells the camera that the snake stood like this until `stamp_ns`. Exposes if an instant of the grid has passed
    /// since it was told last; of several that passed at once only the newest gives a frame.
    pub(crate) fn observe(&mut self, stamp_ns: i64, bend_rad: [f64; 2], q_tilde_m: [f64; 3]) {
        let grid = stamp_ns.div_euclid(self.period_ns);
        let seen = self.last_grid.replace(grid);
        if seen.is_none_or(|seen| grid <= seen) {
            return;
        }
        let (sin, cos) = self.plane_sin_cos;
        let noise = self.noise.pair();
        let frame = ShapeReading {
            exposure_ns: grid * self.period_ns,
            bend_rad: [
                cos * bend_rad[0] - sin * bend_rad[1] + self.sigma_rad * noise[0],
                sin * bend_rad[0] + cos * bend_rad[1] + self.sigma_rad * noise[1],
            ],
            sigma_bend_rad: self.sigma_rad,
            q_tilde_m,
        };
        self.frames[self.n_exposed % N_FRAMES] = Some(frame);
        self.n_exposed += 1;
        // A reader that never comes loses the oldest frames.
        self.n_handed_over = self.n_handed_over.max(self.n_exposed.saturating_sub(N_FRAMES));
    }

    /// The oldest frame that has become available.
    pub(crate) fn take(&mut self, stamp_ns: i64) -> Option<ShapeReading> {
        if self.n_handed_over == self.n_exposed {
            return None;
        }
        let frame = self.frames[self.n_handed_over % N_FRAMES]?;
        if stamp_ns < frame.exposure_ns.saturating_add(self.latency_ns) {
            return None;
        }
        self.n_handed_over += 1;
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn frames(truth: &CameraTruth) -> Vec<(i64, ShapeReading)> {
        let mut camera = Camera::new(truth);
        let mut frames = Vec::new();
        for ms in 0..1000 {
            camera.observe(ms * MS, [ms as f64, 0.0], [0.0; 3]);
            while let Some(frame) = camera.take(ms * MS) {
                frames.push((ms * MS, frame));
            }
        }
        frames
    }

    #[test]
    fn frames_come_at_the_rate_of_the_camera_and_show_the_snake_at_their_exposure() {
        let frames = frames(&CameraTruth { noise_rad: 0.0, ..CameraTruth::default() });
        assert_eq!(frames.len(), 59, "60 Hz for 999 ms, without the frame at zero");
        for pair in frames.windows(2) {
            assert_eq!(pair[1].1.exposure_ns - pair[0].1.exposure_ns, 16_666_666);
        }
        for (_, frame) in frames {
            let seen_ms = frame.bend_rad[0];
            assert!((seen_ms - frame.exposure_ns as f64 / 1e6).abs() <= 1.0, "{frame:?}");
        }
    }

    #[test]
    fn latency_delays_the_hand_over_and_not_the_exposure() {
        let truth = CameraTruth { latency_s: 0.1, noise_rad: 0.0, ..CameraTruth::default() };
        let frames = frames(&truth);
        assert_eq!(frames.len(), 53, "the last six are still under way");
        for (available_ns, frame) in frames {
            let age = available_ns - frame.exposure_ns;
            assert!((100 * MS..=101 * MS).contains(&age), "age {age}");
        }
    }

    #[test]
    fn a_turned_camera_turns_the_plane_and_keeps_the_bend() {
        let truth = CameraTruth { plane_offset_rad: 0.5, noise_rad: 0.0, ..CameraTruth::default() };
        let (_, frame) = frames(&truth)[10];
        assert!((frame.bend_rad[1].atan2(frame.bend_rad[0]) - 0.5).abs() < 1e-12);
    }
}
