//! The simulated camera: exposes on a fixed grid of instants, adds noise, hands frames over after its latency.
//!
//! A camera whose clock is wrong stamps a frame that shows the past; it remembers what it needs of it.

use crate::gripper::SimulatedGripper;
use crate::noise::Noise;
use crate::shutter::Shutter;
use crate::truth::CameraTruth;
use krait_slave::{SeenShape, ShapeReading};
use std::collections::VecDeque;

/// Sights remembered for a wrong clock: the largest error, 0.4 s, at the shortest distance kept.
const N_SIGHTS: usize = 1024;
/// Shortest distance of two remembered sights; a later one replaces the one before.
const SIGHT_NS: i64 = 500_000;

/// Exposes whenever an instant of its grid (multiples of the period on CLOCK_MONOTONIC) has passed.
#[derive(Clone, Debug)]
pub(crate) struct Camera {
    shutter: Shutter<ShapeReading>,
    sigma_rad: f64,
    plane_sin_cos: (f64, f64),
    clock_error_ns: i64,
    /// Empty while the clock is right.
    sights: VecDeque<(i64, [f64; 2])>,
    noise: Noise,
}

impl Camera {
    pub(crate) fn new(truth: &CameraTruth, clock_error_s: f64) -> Self {
        Self {
            shutter: Shutter::new(truth.rate_hz, truth.latency_s),
            sigma_rad: truth.noise_rad,
            plane_sin_cos: truth.plane_offset_rad.sin_cos(),
            clock_error_ns: (clock_error_s * 1e9) as i64,
            sights: VecDeque::with_capacity(if clock_error_s > 0.0 { N_SIGHTS } else { 0 }),
            noise: Noise::new(truth.seed, 1),
        }
    }

    /// Tells the camera that the snake, and its gripper, stood like this until `stamp_ns`. Exposes if an instant of the grid has passed
    /// since it was told last; of several that passed at once only the newest gives a frame.
    pub(crate) fn observe(
        &mut self,
        stamp_ns: i64,
        bend_rad: [f64; 2],
        q_tilde_m: [f64; 3],
        gripper: Option<&mut SimulatedGripper>,
    ) {
        self.remember(stamp_ns, bend_rad);
        let Some(exposure_ns) = self.shutter.exposes(stamp_ns) else { return };
        let shown_rad = self.turned(self.past(exposure_ns).unwrap_or(bend_rad));
        let noise = self.noise.pair();
        let frame = ShapeReading {
            exposure_ns,
            seen: SeenShape::Bend([shown_rad[0] + self.sigma_rad * noise[0], shown_rad[1] + self.sigma_rad * noise[1]]),
            jaw_rad: gripper.map_or(f64::NAN, |gripper| gripper.seen_rad(self.sigma_rad)),
            sigma_rad: self.sigma_rad,
            q_tilde_m,
        };
        self.shutter.put(exposure_ns, frame);
    }

    /// What a noiseless frame with this stamp shows if the snake stands like this now, at the stamp.
    pub(crate) fn look(&mut self, stamp_ns: i64, bend_rad: [f64; 2]) -> [f64; 2] {
        self.remember(stamp_ns, bend_rad);
        self.turned(self.past(stamp_ns).unwrap_or(bend_rad))
    }

    /// The oldest frame that has become available.
    pub(crate) fn take(&mut self, stamp_ns: i64) -> Option<ShapeReading> {
        self.shutter.take(stamp_ns)
    }

    fn turned(&self, bend_rad: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.plane_sin_cos;
        [cos * bend_rad[0] - sin * bend_rad[1], sin * bend_rad[0] + cos * bend_rad[1]]
    }

    fn remember(&mut self, stamp_ns: i64, bend_rad: [f64; 2]) {
        if self.clock_error_ns == 0 {
            return;
        }
        let n = self.sights.len();
        // The newest but one decides, so that the newest is always there.
        if n >= 2 && self.sights.get(n - 2).is_some_and(|(before, _)| stamp_ns - before < SIGHT_NS)
            || self.sights.back().is_some_and(|(last, _)| *last >= stamp_ns)
        {
            self.sights.pop_back();
        }
        if self.sights.len() == N_SIGHTS {
            self.sights.pop_front();
        }
        self.sights.push_back((stamp_ns, bend_rad));
    }

    /// Where the snake stood by the camera's wrong clock, linear between what is remembered; nothing if the clock is right.
    fn past(&self, stamp_ns: i64) -> Option<[f64; 2]> {
        let wanted = stamp_ns.saturating_sub(self.clock_error_ns);
        let behind = self.sights.partition_point(|(stamp, _)| *stamp <= wanted);
        let Some(&(late, after)) = self.sights.get(behind) else { return self.sights.back().map(|sight| sight.1) };
        let Some(&(early, before)) = behind.checked_sub(1).and_then(|k| self.sights.get(k)) else { return Some(after) };
        let part = (wanted - early) as f64 / (late - early) as f64;
        Some(core::array::from_fn(|k| before[k] + part * (after[k] - before[k])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn bend_rad(frame: &ShapeReading) -> [f64; 2] {
        let SeenShape::Bend(bend_rad) = frame.seen else { panic!("{frame:?} is of no snake") };
        bend_rad
    }

    fn frames(truth: &CameraTruth) -> Vec<(i64, ShapeReading)> {
        let mut camera = Camera::new(truth, 0.0);
        let mut frames = Vec::new();
        for ms in 0..1000 {
            camera.observe(ms * MS, [ms as f64, 0.0], [0.0; 3], None);
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
            let seen_ms = bend_rad(&frame)[0];
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
        assert!((bend_rad(&frame)[1].atan2(bend_rad(&frame)[0]) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_wrong_clock_shows_the_past() {
        let mut camera = Camera::new(&CameraTruth { noise_rad: 0.0, ..CameraTruth::default() }, 0.05);
        let mut shown = Vec::new();
        for ms in 0..1000 {
            camera.observe(ms * MS, [ms as f64, 0.0], [0.0; 3], None);
            while let Some(frame) = camera.take(ms * MS) {
                shown.push(frame.exposure_ns as f64 / 1e6 - bend_rad(&frame)[0]);
            }
        }
        assert!(shown.iter().skip(4).all(|late_ms| (late_ms - 50.0).abs() < 1e-6), "{shown:?}");
        assert!((camera.look(1000 * MS, [1000.0, 0.0])[0] - 950.0).abs() < 1e-6);
    }
}
