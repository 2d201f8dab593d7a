//! How well the snake followed: the measured shape against the setpoint of its instant of exposure.

use krait_ipc::message::{Phase, Setpoint, Shape};
use std::collections::VecDeque;

/// Setpoints kept for pairing: a camera's latency is far below a second, ns.
const KEPT_NS: i64 = 1_000_000_000;

/// Root mean square, 95th percentile and largest of a set of magnitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Spread {
    /// How many.
    pub n: usize,
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// The spread of some values' magnitudes; zero for none.
    pub fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut sizes: Vec<f64> = values.map(f64::abs).collect();
        sizes.sort_by(f64::total_cmp);
        let n = sizes.len();
        let Some(max) = sizes.last().copied() else { return Self::default() };
        let rms = (sizes.iter().map(|size| size * size).sum::<f64>() / n as f64).sqrt();
        Self { n, rms, p95: sizes[(n - 1) * 95 / 100], max }
    }
}

/// Pairs shapes with setpoints as they come; from the first setpoint that follows an operator on, every pair counts.
#[derive(Clone, Debug, Default)]
pub struct Tracking {
    setpoints: VecDeque<(i64, [f64; 2])>,
    first_motion_ns: Option<i64>,
    errors: Vec<(i64, f64)>,
}

impl Tracking {
    /// Takes a setpoint; they come in order.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        if setpoint.phase() == Some(Phase::Following) {
            self.first_motion_ns.get_or_insert(setpoint.sample_ns);
        }
        self.setpoints.push_back((setpoint.sample_ns, setpoint.bend_rad));
        while self.setpoints.front().is_some_and(|(ns, _)| *ns < setpoint.sample_ns.saturating_sub(KEPT_NS)) {
            self.setpoints.pop_front();
        }
    }

    /// Takes a shape, after the setpoints of its instant of exposure.
    pub fn shape(&mut self, shape: &Shape) {
        let is_seen = shape.bend_rad.iter().all(|bend| bend.is_finite());
        if !is_seen || self.first_motion_ns.is_none_or(|first_ns| shape.sample_ns < first_ns) {
            return;
        }
        let after = self.setpoints.partition_point(|(ns, _)| *ns <= shape.sample_ns);
        if let Some((_, wanted)) = after.checked_sub(1).and_then(|idx| self.setpoints.get(idx)) {
            let error_rad = (shape.bend_rad[0] - wanted[0]).hypot(shape.bend_rad[1] - wanted[1]);
            self.errors.push((shape.sample_ns, error_rad));
        }
    }

    /// Instant of the first setpoint that follows an operator, ns.
    pub fn first_motion_ns(&self) -> Option<i64> {
        self.first_motion_ns
    }

    /// Instant of exposure, ns, and length of the difference of the bend vectors, rad, of every pair.
    pub fn errors(&self) -> &[(i64, f64)] {
        &self.errors
    }

    /// Spread of the error from some time after the first motion on, deg.
    pub fn error_deg(&self, from_s: f64) -> Spread {
        let from_ns = self.first_motion_ns.unwrap_or(0).saturating_add((from_s * 1e9) as i64);
        Spread::of(self.errors.iter().filter(|(ns, _)| *ns >= from_ns).map(|(_, rad)| rad.to_degrees()))
    }
}
