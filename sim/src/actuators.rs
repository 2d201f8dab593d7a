//! What the actuators of every simulated machine have in common: power, hard stops, the search for zero, encoder steps.

use crate::noise::Noise;
use crate::truth::DriveTruth;
use krait_slave::{ActuatorState, Actuators, DriveError, DriveReading, DriveTraits, OnFault};

/// Longest time that one step of the search for zero accounts for: a search that was not continued does not jump.
const MAX_HOME_STEP_NS: i64 = 5_000_000;
/// They are told and asked at 1 kHz.
const PERIOD_NS: i64 = 1_000_000;

/// Actuators that exist only in numbers. They start without power.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedActuators {
    truth: DriveTruth,
    /// Whether they are under power.
    pub powered: bool,
}

impl SimulatedActuators {
    pub(crate) fn new(truth: &DriveTruth) -> Self {
        Self { truth: truth.clone(), powered: false }
    }

    /// What they can do: any speed at once, and they hold without power.
    pub(crate) fn traits(&self, n_actuators: usize) -> DriveTraits {
        DriveTraits {
            n_actuators,
            n_together: n_actuators,
            jaw_m_per_rad: None,
            period_ns: PERIOD_NS,
            travel_m: core::array::from_fn(|k| if k < n_actuators { self.truth.travel_m } else { 0.0 }),
            rate_m_per_s: core::array::from_fn(|k| if k < n_actuators { f64::INFINITY } else { 0.0 }),
            delay_ns: 0,
            measures_load: true,
            homes_in_place: false,
            on_fault: OnFault::PowerOff,
        }
    }

    /// A reading of positions, m, and loads, N.
    pub(crate) fn reading(&self, n: usize, stamp_ns: i64, measured: (Actuators, Actuators)) -> DriveReading {
        let state = if self.powered { ActuatorState::On } else { ActuatorState::Off };
        DriveReading::at_once(n, stamp_ns, measured, state)
    }

    /// Refuses places that cannot be gone to: without power, not finite, beyond the hard stops.
    pub(crate) fn check(&self, place_m: &[f64]) -> Result<(), DriveError> {
        if !self.powered {
            return Err(DriveError::NotPowered);
        }
        let limit_m = self.truth.travel_m;
        for (idx, found_m) in place_m.iter().copied().enumerate() {
            let actuator = idx + 1;
            if !found_m.is_finite() {
                return Err(DriveError::NotFinite { actuator, found_m });
            }
            if found_m.abs() > limit_m {
                return Err(DriveError::OutOfTravel { actuator, found_m, limit_m });
            }
        }
        Ok(())
    }

    /// Which part of the way from zero is left after the search went on for a time; 0: it has arrived. One part for all, so
    /// that a snake straightens in its plane.
    pub(crate) fn home_part(&self, from_m: &[f64], elapsed_ns: i64) -> f64 {
        let elapsed_ns = elapsed_ns.clamp(0, MAX_HOME_STEP_NS);
        let farthest_m = from_m.iter().fold(0.0_f64, |m, q| m.max(q.abs()));
        let step_m = self.truth.home_speed_m_per_s * elapsed_ns as f64 * 1e-9;
        if farthest_m <= step_m { 0.0 } else { 1.0 - step_m / farthest_m }
    }

    /// What an encoder shows of a place, m.
    pub(crate) fn shown_m(&self, place_m: f64, noise: &mut Noise) -> f64 {
        let noise = if self.truth.encoder_noise_m > 0.0 { noise.pair()[0] } else { 0.0 };
        self.quantised(place_m + self.truth.encoder_noise_m * noise)
    }

    /// Standard deviation of the encoders, m.
    pub(crate) fn encoder_noise_m(&self) -> f64 {
        self.truth.encoder_noise_m
    }

    /// A position in the encoders' steps, m.
    pub(crate) fn quantised(&self, position_m: f64) -> f64 {
        let step_m = self.truth.encoder_resolution_m;
        if step_m > 0.0 { (position_m / step_m).round() * step_m } else { position_m }
    }
}
