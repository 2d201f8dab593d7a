//! Decides about every shape: publish it, publish it with a warning, or refuse it.

use crate::clock_map::{Arrival, ClockMap};
use crate::counts::{Counts, ShapeFinding, ShapeRefusal};
use crate::line::{Header, Measured, Value};
use core::f64::consts::PI;
use krait_ipc::message::{MAX_JOINTS, Shape, Validity};
use krait_ipc::setting::{SettingError, check};
use krait_ipc::settings;

/// An exposure may lie this far ahead of its arrival: two readings of one clock never do, two clocks may, ns.
const AHEAD_NS: i64 = 1_000_000;
/// Standard deviations beyond this say nothing about a machine that turns half a turn, rad.
const LARGEST_SD_RAD: f64 = 1.0;

settings! {
    /// What the gate lets through. A key that is left out keeps its default.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct GateConfig in "shape" {
        /// A shape whose exposure is longer ago when it arrives is counted as late, and published, ms. 200 ms: `estimate` keeps a
        /// quarter of a second of encoders at 1 kHz.
        late_ms: f64 = 200.0, 1.0..=1e4;
        /// One that is older still is refused as stale, ms; at least `late_ms`.
        stale_ms: f64 = 1000.0, 1.0..=6e4;
        /// The fastest motion of the machine, rad/s. 5 rad/s: `resolve` allows 2.
        max_vel_rad_per_s: f64 = 5.0, 0.1..=100.0;
        /// How far two good shapes may differ besides, rad. 0.1 rad: twenty times a camera's noise.
        margin_rad: f64 = 0.1, 1e-3..=1.0;
    }
}

impl GateConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] names the first key that is outside its range.
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_ranges()?;
        check((Self::TABLE, "stale_ms"), self.stale_ms, (self.late_ms, 6e4), 1000)
    }
}

/// The gate between the lines of a program and the channel.
#[derive(Clone, Debug)]
pub struct ShapeGate {
    config: GateConfig,
    clock: Option<ClockMap>,
    sequence: u64,
    last_exposure_ns: Option<i64>,
    last_frame: Option<u64>,
    /// The newest shape that was not outlying.
    reference: Option<Shape>,
    counts: Counts,
}

/// What the gate made of a shape: a message, and what there is to say about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passed {
    /// The message.
    pub shape: Shape,
    /// What was found: each with its value and limit, ms, frames or rad.
    pub findings: [Option<(ShapeFinding, f64, f64)>; 3],
}

/// A refusal with the value that was wrong and its limit (NaN where there is none), in ms, frames or rad.
pub type ShapeRefused = (ShapeRefusal, f64, f64);

impl ShapeGate {
    /// A gate that waits for a header.
    pub fn new(config: GateConfig) -> Self {
        Self {
            config,
            clock: None,
            sequence: 0,
            last_exposure_ns: None,
            last_frame: None,
            reference: None,
            counts: Counts::default(),
        }
    }

    /// What became of every line so far.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Counts a line that never became a shape.
    pub fn refuse_line(&mut self, refusal: ShapeRefusal) {
        self.counts.lines += 1;
        self.counts.refuse(refusal);
    }

    /// A stream begins: its clock and its frames are new, what was published stays.
    pub fn begin(&mut self, header: &Header) {
        self.counts.lines += 1;
        self.counts.headers += 1;
        self.clock = Some(ClockMap::new(header));
        self.last_frame = None;
    }

    /// Decides about a shape that arrived.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn pass(&mut self, measured: &Measured, arrival: &Arrival) -> Result<Passed, ShapeRefused> {
        self.counts.lines += 1;
        let passed = self.decide(measured, arrival);
        match &passed {
            Ok(passed) => self.publish(measured, passed),
            Err((refusal, ..)) => self.counts.refuse(*refusal),
        }
        passed
    }

    fn decide(&mut self, measured: &Measured, arrival: &Arrival) -> Result<Passed, ShapeRefused> {
        let no_value = |refusal| (refusal, f64::NAN, f64::NAN);
        let clock = self.clock.as_mut().ok_or(no_value(ShapeRefusal::NoHeader))?;
        let offset_ns = clock.offset_ns(arrival, measured.sent_ns).ok_or(no_value(ShapeRefusal::NoClock))?;
        check_value(measured.value.as_ref())?;
        let exposure_ns = measured.exposure_ns.checked_add(offset_ns).ok_or(no_value(ShapeRefusal::OutOfRange))?;
        let now_ns = arrival.monotonic_ns;
        let age_ns = now_ns.checked_sub(exposure_ns).ok_or(no_value(ShapeRefusal::OutOfRange))?;
        let age_ms = age_ns as f64 * 1e-6;
        if age_ns < -AHEAD_NS {
            return Err((ShapeRefusal::Future, -age_ms, AHEAD_NS as f64 * 1e-6));
        }
        if age_ms > self.config.stale_ms || exposure_ns < 0 {
            return Err((ShapeRefusal::Stale, age_ms, self.config.stale_ms));
        }
        let exposure_ns = exposure_ns.min(now_ns);
        if let Some(last_ns) = self.last_exposure_ns.filter(|last_ns| exposure_ns <= *last_ns) {
            return Err((ShapeRefusal::OutOfOrder, (last_ns - exposure_ns) as f64 * 1e-6, 0.0));
        }
        if let (Some(last), Some(frame)) = (self.last_frame, measured.frame)
            && frame <= last
        {
            return Err((ShapeRefusal::OutOfOrder, (last - frame) as f64, 0.0));
        }
        let shape = message(self.sequence + 1, exposure_ns, now_ns, measured.value.as_ref());
        let late = (age_ms > self.config.late_ms).then_some((ShapeFinding::Late, age_ms, self.config.late_ms));
        let n_dropped = self.last_frame.zip(measured.frame).map_or(0, |(last, frame)| frame - last - 1);
        let dropped = (n_dropped > 0).then_some((ShapeFinding::Dropped, n_dropped as f64, 0.0));
        let (shape, doubt) = self.doubted(shape);
        Ok(Passed { shape, findings: [late, dropped, doubt] })
    }

    /// Marks a shape that the machine cannot have taken since the last good one.
    fn doubted(&self, shape: Shape) -> (Shape, Option<(ShapeFinding, f64, f64)>) {
        if shape.validity == Validity::Lost as u32 {
            return (shape, Some((ShapeFinding::Lost, f64::NAN, f64::NAN)));
        }
        let Some(reference) = &self.reference else { return (shape, None) };
        let dt_s = shape.sample_ns.saturating_sub(reference.sample_ns) as f64 * 1e-9;
        let limit_rad = self.config.margin_rad + self.config.max_vel_rad_per_s * dt_s;
        let distance_rad = distance_rad(&shape, reference);
        if distance_rad <= limit_rad {
            return (shape, None);
        }
        let shape = Shape { validity: Validity::Outlying as u32, ..shape };
        (shape, Some((ShapeFinding::Outlying, distance_rad, limit_rad)))
    }

    fn publish(&mut self, measured: &Measured, passed: &Passed) {
        self.sequence += 1;
        self.counts.published += 1;
        self.last_exposure_ns = Some(passed.shape.sample_ns);
        self.last_frame = measured.frame.or(self.last_frame);
        if passed.shape.validity == Validity::Valid as u32 {
            self.reference = Some(passed.shape);
        }
        for (finding, value, _) in passed.findings.into_iter().flatten() {
            match finding {
                ShapeFinding::Late => self.counts.late += 1,
                ShapeFinding::Dropped => self.counts.dropped += value as u64,
                ShapeFinding::Outlying => self.counts.outlying += 1,
                ShapeFinding::Lost => self.counts.lost_view += 1,
            }
        }
    }
}

/// Numbers must be finite, angles within half a turn, covariances positive.
fn check_value(value: Option<&Value>) -> Result<(), ShapeRefused> {
    let (angles, variances): (&[f64], &[f64]) = match value {
        None => return Ok(()),
        Some(Value::Bend { bend_rad, covariance_rad2 }) => {
            if let Some([xx, xy, yy]) = covariance_rad2
                && xy * xy > xx * yy
            {
                return Err((ShapeRefusal::OutOfRange, *xy, (xx * yy).sqrt()));
            }
            (bend_rad, covariance_rad2.as_ref().map_or(&[], |c| c))
        }
        Some(Value::Joints { n, positions_rad, variances_rad2 }) => {
            (positions_rad.get(..*n).unwrap_or(&[]), variances_rad2.as_ref().and_then(|v| v.get(..*n)).unwrap_or(&[]))
        }
    };
    if let Some(found) = angles.iter().chain(variances).find(|number| !number.is_finite()) {
        return Err((ShapeRefusal::NotFinite, *found, f64::MAX));
    }
    if let Some(found) = angles.iter().find(|angle| angle.abs() > PI) {
        return Err((ShapeRefusal::OutOfRange, *found, PI));
    }
    // The second of a bend's three is its covariance, which may be negative; the product above has bounded it.
    let is_bend = matches!(value, Some(Value::Bend { .. }));
    let largest = LARGEST_SD_RAD * LARGEST_SD_RAD;
    let mut own = variances.iter().enumerate().filter(|(k, _)| !(is_bend && *k == 1)).map(|(_, variance)| *variance);
    match own.find(|variance| !(*variance > 0.0 && *variance <= largest)) {
        Some(found) => Err((ShapeRefusal::OutOfRange, found, largest)),
        None => Ok(()),
    }
}

fn message(sequence: u64, sample_ns: i64, available_ns: i64, value: Option<&Value>) -> Shape {
    match value {
        None => Shape::lost(sequence, sample_ns, available_ns),
        Some(Value::Bend { bend_rad, covariance_rad2 }) => Shape {
            bend_covariance_rad2: covariance_rad2.unwrap_or([f64::NAN; 3]),
            ..Shape::of_bend(sequence, sample_ns, available_ns, *bend_rad)
        },
        Some(Value::Joints { n, positions_rad, variances_rad2 }) => {
            let mut joint_variances_rad2 = [f64::NAN; MAX_JOINTS];
            if let Some(variances_rad2) = variances_rad2 {
                joint_variances_rad2.iter_mut().zip(variances_rad2).take(*n).for_each(|(own, v)| *own = *v);
            }
            let positions_rad = positions_rad.get(..*n).unwrap_or(&[]);
            Shape { joint_variances_rad2, ..Shape::of_joints(sequence, sample_ns, available_ns, positions_rad) }
        }
    }
}

/// The largest distance of a component; infinite where one shows a bend and the other joints, or not as many.
fn distance_rad(one: &Shape, other: &Shape) -> f64 {
    match (one.valid_bend_rad(), other.valid_bend_rad(), one.valid_joints_rad(), other.valid_joints_rad()) {
        (Some(a), Some(b), ..) => (a[0] - b[0]).hypot(a[1] - b[1]),
        (_, _, Some(a), Some(b)) if a.len() == b.len() => {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        }
        _ => f64::INFINITY,
    }
}
