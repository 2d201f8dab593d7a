//! What a recording shows: tracking error of each pass, latency of each hop, samples lost.
//!
//! Everything here is computed from the recording alone, so that anyone with the file gets the same figures.

use hdrhistogram::Histogram;
use krait_ipc::message::{Command, Compensation, HopStamps, ModelUpdate, Phase, Setpoint, Shape, SlaveState};
use krait_model::ChangeKind;
use serde::Serialize;

/// The score counts from this long after the operator's first motion: the estimator has seen a few reversals by then.
pub const SCORED_FROM_S: f64 = 10.0;
/// Below this bend the bending plane is too ill-defined for its error to mean anything, rad.
const PLANE_FROM_BEND_RAD: f64 = 15.0 * core::f64::consts::PI / 180.0;
/// Longest latency that the histograms hold, ns (10 s).
const LONGEST_NS: u64 = 10_000_000_000;

/// Root mean square, 95th percentile and largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Root mean square.
    pub rms: f64,
    /// 95th percentile of the absolute values.
    pub p95: f64,
    /// Largest absolute value.
    pub max: f64,
}

impl Spread {
    /// The spread of some values; zero for none.
    pub fn of(values: &[f64]) -> Self {
        let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let Some(max) = sizes.last().copied() else { return Self::default() };
        let rms = (sizes.iter().map(|s| s * s).sum::<f64>() / sizes.len() as f64).sqrt();
        Self { rms, p95: sizes[(sizes.len() - 1) * 95 / 100], max }
    }
}

/// Largest bend commanded and reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PeakBend {
    /// Of the setpoint, deg.
    pub commanded: f64,
    /// Of the measured shape, deg.
    pub reached: f64,
}

/// What one pass showed.
#[derive(Clone, Debug, Serialize)]
pub struct PassReport {
    /// off, naive or estimated.
    pub compensation: &'static str,
    /// Length of the difference between the measured and the commanded bend vector, deg.
    pub error_deg: Spread,
    /// Difference of the bend angles alone, deg.
    pub bend_error_deg: Spread,
    /// Difference of the bending planes, where the bend is at least 15 deg, deg.
    pub plane_error_deg: Spread,
    /// Largest bend over the whole pass.
    pub peak_bend_deg: PeakBend,
    /// Shapes that the score rests on.
    pub scored_shapes: usize,
    /// The score counts from this long after the operator's first motion, s.
    pub scored_from_s: f64,
    /// Load scale at the end of the pass.
    pub eta: f64,
    /// Backlash half-width at the end of the pass, mm.
    pub lambda_mm: f64,
    /// Whether the watch for changes had learnt what is normal before the pass ended.
    pub watched_for_changes: bool,
    /// Changes of the machine that were seen.
    pub changes: Vec<ChangeReport>,
}

/// A change that the estimator saw: the model no longer explained the measured shape as it did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChangeReport {
    /// Exposure of the shape that showed it, after the pass's first setpoint, s.
    pub at_s: f64,
    /// What it looks like.
    pub looks_like: &'static str,
}

/// Quantiles of a latency, microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Largest.
    pub max: f64,
}

/// Latency of one hop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HopReport {
    /// Where the sample left.
    pub from: &'static str,
    /// Where it arrived.
    pub to: &'static str,
    /// Quantiles, microseconds.
    #[serde(flatten)]
    pub quantiles: Quantiles,
}

/// Latency of the whole chain.
#[derive(Clone, Debug, Serialize)]
pub struct LatencyReport {
    /// Device stamp to drive written.
    pub end_to_end: Quantiles,
    /// Each hop: from the moment that one stage had published to the moment that the next had.
    pub hops: Vec<HopReport>,
}

/// One stretch of a recording in which one chain ran.
#[derive(Debug, Default)]
pub struct PassLog {
    setpoints: Vec<(i64, [f64; 2], bool)>,
    shapes: Vec<(i64, [f64; 2])>,
    last_command: Option<Command>,
    changes: Vec<(i64, u32)>,
    watched: bool,
}

impl PassLog {
    /// Takes a setpoint.
    pub fn setpoint(&mut self, setpoint: &Setpoint) {
        let following = setpoint.phase() == Some(Phase::Following);
        self.setpoints.push((setpoint.sample_ns, setpoint.bend_rad, following));
    }

    /// Takes a measured shape.
    pub fn shape(&mut self, shape: &Shape) {
        if shape.bend_rad.iter().all(|b| b.is_finite()) {
            self.shapes.push((shape.sample_ns, shape.bend_rad));
        }
    }

    /// Takes a command.
    pub fn command(&mut self, command: &Command) {
        self.last_command = Some(*command);
    }

    /// Takes a model update.
    pub fn update(&mut self, update: &ModelUpdate) {
        self.watched |= update.is_watching == 1;
        if update.changed_ns != 0 && self.changes.last().is_none_or(|(ns, _)| *ns != update.changed_ns) {
            self.changes.push((update.changed_ns, update.change_kind));
        }
    }

    fn change_reports(&self) -> Vec<ChangeReport> {
        let start_ns = self.setpoints.first().map_or(0, |(ns, ..)| *ns);
        let report = |&(ns, kind): &(i64, u32)| ChangeReport {
            at_s: (ns - start_ns) as f64 * 1e-9,
            looks_like: ChangeKind::from_number(kind)
                .map_or("of a kind that this program does not know", ChangeKind::sentence),
        };
        self.changes.iter().map(report).collect()
    }

    /// What the pass showed.
    pub fn report(&self, compensation: Compensation) -> PassReport {
        let errors = self.errors_rad();
        let spread = |pick: fn(&ShapeError) -> Option<f64>| {
            Spread::of(&errors.iter().filter_map(pick).map(f64::to_degrees).collect::<Vec<_>>())
        };
        let peak = |bends: &mut dyn Iterator<Item = [f64; 2]>| bends.map(length).fold(0.0, f64::max).to_degrees();
        PassReport {
            compensation: compensation.name(),
            error_deg: spread(|e| Some(e.vector_rad)),
            bend_error_deg: spread(|e| Some(e.bend_rad)),
            plane_error_deg: spread(|e| e.plane_rad),
            peak_bend_deg: PeakBend {
                commanded: peak(&mut self.setpoints.iter().map(|(_, bend, _)| *bend)),
                reached: peak(&mut self.shapes.iter().map(|(_, bend)| *bend)),
            },
            scored_shapes: errors.len(),
            scored_from_s: SCORED_FROM_S,
            eta: self.last_command.map_or(f64::NAN, |c| c.eta),
            lambda_mm: self.last_command.map_or(f64::NAN, |c| c.lambda_m * 1e3),
            watched_for_changes: self.watched,
            changes: self.change_reports(),
        }
    }

    /// The error of every shape from [`SCORED_FROM_S`] after the first motion on.
    fn errors_rad(&self) -> Vec<ShapeError> {
        let Some(first_ns) = self.setpoints.iter().find(|(.., following)| *following).map(|(ns, ..)| *ns) else {
            return Vec::new();
        };
        let from_ns = first_ns + (SCORED_FROM_S * 1e9) as i64;
        let scored = self.shapes.iter().filter(|(ns, _)| *ns >= from_ns);
        scored.filter_map(|(ns, measured)| Some(ShapeError::between(*measured, self.setpoint_at(*ns)?))).collect()
    }

    /// The newest setpoint at an instant.
    fn setpoint_at(&self, sample_ns: i64) -> Option<[f64; 2]> {
        let after = self.setpoints.partition_point(|(ns, ..)| *ns <= sample_ns);
        self.setpoints.get(after.checked_sub(1)?).map(|(_, bend, _)| *bend)
    }
}

struct ShapeError {
    vector_rad: f64,
    bend_rad: f64,
    plane_rad: Option<f64>,
}

impl ShapeError {
    fn between(measured: [f64; 2], commanded: [f64; 2]) -> Self {
        let [mx, my] = measured;
        let [cx, cy] = commanded;
        let plane_rad =
            (length(commanded) >= PLANE_FROM_BEND_RAD).then(|| (cx * my - cy * mx).atan2(cx * mx + cy * my));
        Self { vector_rad: length([mx - cx, my - cy]), bend_rad: length(measured) - length(commanded), plane_rad }
    }
}

fn length(bend: [f64; 2]) -> f64 {
    bend[0].hypot(bend[1])
}

/// Histograms of every hop, filled from the slave's states.
pub struct LatencyLog {
    end_to_end: Histogram<u64>,
    hops: Vec<Histogram<u64>>,
    last_command: u64,
}

impl LatencyLog {
    /// Empty histograms.
    ///
    /// # Errors
    /// Never with these bounds; the histogram library checks them.
    pub fn new() -> anyhow::Result<Self> {
        let empty = || Histogram::new_with_bounds(1, LONGEST_NS, 3);
        let hops = HopStamps::HOPS.iter().map(|_| empty()).collect::<Result<_, _>>()?;
        Ok(Self { end_to_end: empty()?, hops, last_command: 0 })
    }

    /// Takes a slave state; each command counts once. Returns whether this one counted.
    pub fn state(&mut self, state: &SlaveState) -> bool {
        let stamps = &state.stamps;
        if state.command_sequence == self.last_command || stamps.drive_written_ns == 0 || stamps.device_ns == 0 {
            return false;
        }
        self.last_command = state.command_sequence;
        enter(&mut self.end_to_end, stamps.end_to_end_ns());
        for (hop, histogram) in self.hops.iter_mut().enumerate() {
            enter(histogram, stamps.hop_ns(hop));
        }
        true
    }

    /// Commands that have counted.
    pub fn n_samples(&self) -> u64 {
        self.end_to_end.len()
    }

    /// The quantiles.
    pub fn report(&self) -> LatencyReport {
        let hops = self.hops.iter().zip(HopStamps::HOPS).map(|(histogram, (from, to))| HopReport {
            from,
            to,
            quantiles: quantiles(histogram),
        });
        LatencyReport { end_to_end: quantiles(&self.end_to_end), hops: hops.collect() }
    }
}

fn enter(histogram: &mut Histogram<u64>, latency_ns: i64) {
    histogram.saturating_record(u64::try_from(latency_ns).unwrap_or(0).clamp(1, LONGEST_NS));
}

fn quantiles(histogram: &Histogram<u64>) -> Quantiles {
    let at = |q: f64| histogram.value_at_quantile(q) as f64 * 1e-3;
    Quantiles { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: histogram.max() as f64 * 1e-3 }
}

/// What to try next, for somebody who has just seen the demo.
pub fn next_thing_to_try(recording: &str) -> String {
    format!(
        "drive it yourself with `krait run --master hid` (without a device: `krait run`), feel the lines with \
         `krait run --compensation off`, or open {recording} in Foxglove, Lichtblick, PlotJuggler or Rerun"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_the_length_of_the_difference_of_the_bend_vectors() {
        let error = ShapeError::between([0.0, 0.5], [0.5, 0.0]);
        assert!((error.vector_rad - 0.5f64.hypot(0.5)).abs() < 1e-15);
        assert_eq!(error.bend_rad, 0.0);
        assert!((error.plane_rad.expect("far from straight") - core::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!(ShapeError::between([0.1, 0.0], [0.1, 0.1]).plane_rad.is_none(), "too straight to have a plane");
    }

    #[test]
    fn a_spread_knows_its_rms_its_95_percent_and_its_maximum() {
        let values: Vec<f64> = (1..=100).map(|n| -f64::from(n)).collect();
        let spread = Spread::of(&values);
        assert_eq!((spread.p95, spread.max), (95.0, 100.0));
        assert!((spread.rms - 58.17).abs() < 0.01, "{}", spread.rms);
    }

    #[test]
    fn a_command_counts_once_however_many_states_repeat_it() {
        let mut log = LatencyLog::new().expect("histograms");
        let mut state = SlaveState {
            sequence: 1,
            sample_ns: 0,
            stamps: HopStamps { device_ns: 1000, drive_written_ns: 251_000, ..HopStamps::default() },
            command_sequence: 7,
            operating_state: 1,
            flags: 7,
            setpoint_q_m: [0.0; 3],
            setpoint_bend_rad: [0.0; 2],
            measured_q_m: [0.0; 3],
            measured_tau_n: [0.0; 3],
            reasons: 0,
            n_commands: 0,
            n_refused: 0,
        };
        log.state(&state);
        log.state(&state);
        state.command_sequence = 8;
        log.state(&state);
        assert_eq!(log.end_to_end.len(), 2);
        assert!((log.report().end_to_end.p50 - 250.0).abs() < 1.0);
    }
}
