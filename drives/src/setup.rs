//! What a bus drive needs to know besides its hardware, from the configuration.

use crate::OpenError;
use crate::bus::PerActuator;
use crate::units::Units;
use krait_slave::{Actuators, DriveMode, DriveTraits, OnFault, RelaxLimits, SlaveConfig};

/// Everything that is fixed while a drive runs.
#[derive(Clone, Debug, PartialEq)]
pub struct BusSetup {
    pub(crate) units: Vec<Units>,
    /// More than any encoder can go between two answers, counts.
    pub(crate) leap_counts: i32,
    pub(crate) period_ns: i64,
    /// Time on the wire of one cycle, ns.
    pub(crate) exchange_ns: i64,
    pub(crate) lost_cycles: u32,
    pub(crate) wish_ns: i64,
    /// Fastest that the slave lets each actuator go.
    pub(crate) rates_m_per_s: Actuators,
    pub(crate) deceleration_m_per_s2: f64,
    pub(crate) speed_counts_per_s: f64,
    pub(crate) mode: DriveMode,
    pub(crate) on_fault: OnFault,
    pub(crate) relax: RelaxLimits,
    /// Of each actuator, who holds against it and gives way where it has let go.
    pub(crate) antagonists: PerActuator<PerActuator<bool>>,
    /// How many, from the first, hold each other; one behind them is a gripper's.
    pub(crate) n_together: usize,
    pub(crate) jaw_m_per_rad: Option<f64>,
}

impl BusSetup {
    /// The setup of a checked configuration with the units of its actuators; an encoder that goes by more than `leap_counts`
    /// between two answers has leapt; a cycle takes `exchange_ns`.
    ///
    /// # Errors
    /// [`OpenError`] where a zero is missing or the period is too short.
    pub fn new(config: &SlaveConfig, units: Vec<Units>, leap_counts: i32, exchange_ns: i64) -> Result<Self, OpenError> {
        let drive = &config.drive;
        let period_ns = (drive.period_ms * 1e6) as i64;
        if exchange_ns > period_ns {
            return Err(OpenError::PeriodTooShort {
                period_ms: drive.period_ms,
                n: drive.actuator.len(),
                baud: drive.baud,
                exchange_ms: exchange_ns as f64 * 1e-6,
            });
        }
        if let Some(k) = drive.actuator.iter().position(|actuator| actuator.zero_count.is_none()) {
            return Err(OpenError::ZeroNeverSet { actuator: k + 1 });
        }
        if drive.on_fault == OnFault::Relax && !units.iter().all(Units::measures_load) {
            return Err(OpenError::RelaxesBlindly);
        }
        Ok(Self {
            units,
            leap_counts,
            period_ns,
            exchange_ns,
            lost_cycles: drive.lost_cycles,
            wish_ns: (drive.wish_ms * 1e6) as i64,
            rates_m_per_s: config.rates_m_per_s(),
            deceleration_m_per_s2: config.deceleration_m_per_s2,
            speed_counts_per_s: drive.speed_counts_per_s,
            mode: drive.mode,
            on_fault: drive.on_fault,
            relax: RelaxLimits::of_fault(config),
            antagonists: core::array::from_fn(|k| drive.antagonists(k)),
            n_together: drive.n_together(),
            jaw_m_per_rad: drive.jaw_m_per_rad(),
        })
    }

    pub(crate) fn n(&self) -> usize {
        self.units.len()
    }

    /// What these drives can do.
    pub(crate) fn traits(&self) -> DriveTraits {
        let per_actuator = |of: &dyn Fn(&Units) -> f64| core::array::from_fn(|k| self.units.get(k).map_or(0.0, of));
        DriveTraits {
            n_actuators: self.n(),
            n_together: self.n_together,
            jaw_m_per_rad: self.jaw_m_per_rad,
            period_ns: self.period_ns,
            travel_m: per_actuator(&|units| units.travel_m),
            rate_m_per_s: per_actuator(&|units| units.magnitude_m(self.speed_counts_per_s)),
            // A wish waits for the next cycle, the way takes one, and what was read then is shown until the one after.
            delay_ns: 2 * self.period_ns + self.exchange_ns,
            // A search in a chain would move a machine that nobody stands beside: a slave that is started again homes too.
            homes_in_place: true,
            measures_load: self.units.iter().all(|units| units.measures_load()),
            on_fault: self.on_fault,
        }
    }
}
