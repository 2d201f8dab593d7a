//! Simulated segments as a drive: their plant, encoders, line loads and the camera that measures the bend of each.

use crate::actuators::SimulatedActuators;
use crate::noise::Noise;
use crate::segments::SimulatedSegments;
use crate::segments_truth::{MAX_SEGMENTS, SegmentsTruth, SegmentsTruthError};
use crate::shutter::Shutter;
use krait_ipc::message::{Actuators, MAX_ACTUATORS, MAX_JOINTS};
use krait_slave::{Drive, DriveError, DriveReading, DriveTraits, Homing, SeenShape, ShapeReading, Switching};

/// The bend vectors of all segments must find room where a message carries joints.
const _: () = assert!(2 * MAX_SEGMENTS <= MAX_JOINTS);

/// Segments that exist only in numbers, with a drive for each line. They start straight, unloaded, without power.
#[derive(Clone, Debug)]
pub struct SegmentDrives {
    plant: SimulatedSegments,
    shutter: Shutter<ShapeReading>,
    camera_noise: Noise,
    camera_noise_rad: f64,
    plane_sin_cos: (f64, f64),
    actuators: SimulatedActuators,
    encoder_noise: Noise,
    /// When they were last looked at.
    stamp_ns: i64,
    /// Where the actuators were told to go: the segments are moved when they are next looked at, so that solving their equilibrium is
    /// no part of a command's latency.
    target_m: Option<Actuators>,
}

impl SegmentDrives {
    /// The straight segments of a truth.
    ///
    /// # Errors
    /// [`SegmentsTruthError`] for a truth that cannot be.
    pub fn new(truth: &SegmentsTruth) -> Result<Self, SegmentsTruthError> {
        Ok(Self {
            plant: SimulatedSegments::new(truth)?,
            shutter: Shutter::new(truth.camera.rate_hz, truth.camera.latency_s),
            camera_noise: Noise::new(truth.camera.seed, 1),
            camera_noise_rad: truth.camera.noise_rad,
            plane_sin_cos: truth.camera.plane_offset_rad.sin_cos(),
            actuators: SimulatedActuators::new(&truth.drive),
            encoder_noise: Noise::new(truth.camera.seed, 2),
            stamp_ns: i64::MIN,
            target_m: None,
        })
    }

    /// The true bend vectors, rad, one after the other, as they stand after the last look; zeros behind the last.
    pub fn bends_rad(&self) -> [f64; 2 * MAX_SEGMENTS] {
        core::array::from_fn(|k| self.plant.bend_rad(k / 2)[k % 2])
    }

    /// Equilibria that did not converge; 0 unless the truth is extreme.
    pub fn n_unsolved(&self) -> u64 {
        self.plant.n_unsolved()
    }

    fn n(&self) -> usize {
        self.plant.n_lines()
    }

    /// Moves the segments where the actuators were told to go.
    fn settle(&mut self) {
        if let Some(place_m) = self.target_m.take() {
            self.plant.move_to(&place_m[..self.n()]);
        }
    }

    /// The camera sees the segments as they stood until now.
    fn observe(&mut self, stamp_ns: i64) {
        self.settle();
        self.stamp_ns = self.stamp_ns.max(stamp_ns);
        let Some(exposure_ns) = self.shutter.exposes(self.stamp_ns) else { return };
        let mut seen_rad = [0.0; MAX_JOINTS];
        let (sin, cos) = self.plane_sin_cos;
        for segment in 0..self.plant.n_segments() {
            let ([x, y], noise) = (self.plant.bend_rad(segment), self.camera_noise.pair());
            seen_rad[2 * segment] = cos * x - sin * y + self.camera_noise_rad * noise[0];
            seen_rad[2 * segment + 1] = sin * x + cos * y + self.camera_noise_rad * noise[1];
        }
        let frame = ShapeReading {
            exposure_ns,
            seen: SeenShape::Joints(seen_rad, 2 * self.plant.n_segments()),
            jaw_rad: f64::NAN,
            sigma_rad: self.camera_noise_rad,
            q_tilde_m: [f64::NAN; 3],
        };
        self.shutter.put(exposure_ns, frame);
    }

    fn place_m(&self) -> Actuators {
        let mut place_m = [0.0; MAX_ACTUATORS];
        place_m[..self.n()].copy_from_slice(self.plant.q_tilde_m());
        place_m
    }
}

impl Drive for SegmentDrives {
    fn n_actuators(&self) -> usize {
        self.n()
    }

    fn traits(&self) -> DriveTraits {
        self.actuators.traits(self.n())
    }

    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        self.actuators.check(&q_tilde_m[..self.n()])?;
        self.observe(stamp_ns);
        self.target_m = Some(q_tilde_m);
        Ok(())
    }

    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        self.settle();
        let (mut q_tilde_m, mut tau_n) = (self.place_m(), [0.0; MAX_ACTUATORS]);
        for (own, load_n) in tau_n.iter_mut().zip(self.plant.actuator_loads_n()) {
            *own = load_n;
        }
        for q_m in q_tilde_m.iter_mut().take(self.plant.n_lines()) {
            *q_m = self.actuators.shown_m(*q_m, &mut self.encoder_noise);
        }
        Ok(self.actuators.reading(self.n(), stamp_ns, (q_tilde_m, tau_n)))
    }

    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        self.settle();
        let from_m = self.place_m();
        self.actuators.check(&from_m[..self.n()])?;
        let elapsed_ns = stamp_ns.saturating_sub(self.stamp_ns);
        self.observe(stamp_ns);
        let part = self.actuators.home_part(&from_m, elapsed_ns);
        self.target_m = Some(from_m.map(|q| q * part));
        self.settle();
        Ok(if part == 0.0 { Homing::Done } else { Homing::Busy })
    }

    fn set_power(&mut self, _stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        self.actuators.powered = on;
        Ok(Switching::Done)
    }

    /// Simulated actuators have no motion of their own: they stand where they were last told to be.
    fn quick_stop(&mut self, _stamp_ns: i64) {}

    fn has_camera(&self) -> bool {
        true
    }

    fn shape(&mut self, stamp_ns: i64) -> Option<ShapeReading> {
        self.observe(stamp_ns);
        self.shutter.take(stamp_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SegmentTruth, SegmentsOfModel};

    const MS: i64 = 1_000_000;

    fn two() -> SegmentsOfModel {
        let segment = |azimuths_deg: [f64; 3]| SegmentTruth {
            azimuths_rad: azimuths_deg.map(f64::to_radians).to_vec(),
            ..SegmentTruth::default()
        };
        let phi_rad = SegmentsTruth::default().phi_rad;
        SegmentsOfModel { segments: vec![segment([0.0, 120.0, 240.0]), segment([60.0, 180.0, 300.0])], phi_rad }
    }

    #[test]
    fn writes_without_power_beyond_the_stops_or_not_finite_are_refused_and_move_nothing() {
        let mut drives = SegmentDrives::new(&SegmentsTruth::of(&two())).unwrap();
        let mut wanted = [0.0; MAX_ACTUATORS];
        assert_eq!(drives.write(0, wanted), Err(DriveError::NotPowered));
        drives.set_power(0, true).unwrap();
        wanted[5] = 9e-3;
        let refused = DriveError::OutOfTravel { actuator: 6, found_m: 9e-3, limit_m: 8e-3 };
        assert_eq!(drives.write(MS, wanted), Err(refused));
        wanted[5] = f64::NAN;
        assert!(matches!(drives.write(MS, wanted), Err(DriveError::NotFinite { actuator: 6, .. })));
        assert_eq!(drives.read(MS).unwrap().q_tilde_m, [0.0; MAX_ACTUATORS]);
    }

    #[test]
    fn the_camera_sees_every_segment_and_homing_straightens_all() {
        let mut drives = SegmentDrives::new(&SegmentsTruth::of(&two())).unwrap();
        drives.set_power(0, true).unwrap();
        let (mut n, mut newest) = (0, None);
        for k in 1..=1000 {
            let part = (k as f64 / 500.0).min(1.0);
            let wanted = [-2e-3, 1e-3, 1e-3, 0.5e-3, 1e-3, -1.5e-3].map(|q_m| q_m * part);
            drives.write(k * MS, core::array::from_fn(|i| wanted.get(i).copied().unwrap_or(0.0))).unwrap();
            while let Some(frame) = drives.shape(k * MS) {
                (n, newest) = (n + 1, Some(frame));
            }
        }
        assert!((59..=60).contains(&n), "{n} in a second");
        let SeenShape::Joints(seen, 4) = newest.unwrap().seen else { panic!("two bend vectors") };
        let truth = drives.bends_rad();
        assert!(truth[0].hypot(truth[1]) > 0.1 && truth[2].hypot(truth[3]) > 0.1, "{truth:?}");
        assert!(seen.iter().zip(truth).all(|(seen, is)| (seen - is).abs() < 0.03), "{seen:?} for {truth:?}");
        let loads_n = drives.read(1000 * MS).unwrap().tau_n;
        assert!(loads_n[..6].iter().all(|load| load.abs() > 0.1) && loads_n[6..] == [0.0; 6], "{loads_n:?}");
        let n_busy = (1001..2000).take_while(|k| drives.home(k * MS).unwrap() == Homing::Busy).count();
        assert!((398..=400).contains(&n_busy), "2 mm at 5 mm/s in steps of 1 ms: {n_busy}");
        assert_eq!(drives.read(2000 * MS).unwrap().q_tilde_m, [0.0; MAX_ACTUATORS]);
        assert_eq!(drives.n_unsolved(), 0);
    }

    #[test]
    fn the_shipped_file_names_every_key_with_its_default_and_bad_ones_are_refused_in_one_sentence() {
        let own = two();
        let truth = SegmentsTruth::parse(include_str!("../truth/two.toml"), "two.toml", &own).unwrap();
        let shipped: Vec<[f64; 3]> =
            truth.segment.iter().map(|own| core::array::from_fn(|k| own.azimuths_rad[k])).collect();
        for (found, expected) in shipped.iter().flatten().zip(own.segments.iter().flat_map(|own| &own.azimuths_rad)) {
            assert!((found - expected).abs() < 1e-9, "{shipped:?}");
        }
        let mut usual = SegmentsTruth::of(&own);
        usual.segment.clone_from(&truth.segment);
        usual.segment.iter_mut().for_each(|own| own.machine = Default::default());
        assert_eq!(truth, usual);
        assert_eq!(SegmentsTruth::parse("", "empty.toml", &own).unwrap(), SegmentsTruth::of(&own));
        for (text, words) in [
            ("[effects]\nlode_scale = 1.0", "load_scale"),
            ("[effects]\nmu = -1.0", "effects.mu is -1, expected 0 to 1"),
            ("[camera]\nrate_hz = inf", "camera.rate_hz"),
            ("[[segment]]\nazimuths_rad = [0.0, 2.0, 4.0]", "segments of [3] lines, expected [3, 3]"),
        ] {
            let sentence = SegmentsTruth::parse(text, "t.toml", &own).unwrap_err().to_string();
            assert!(sentence.contains(words) && sentence.contains("t.toml") && !sentence.contains('\n'), "{sentence}");
        }
    }
}
