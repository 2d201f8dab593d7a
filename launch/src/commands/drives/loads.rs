//! In which unit each actuator's load is known, and the least change of it that says something.

use krait_drives::{ServoMake, Units};
use krait_slave::SlaveConfig;

/// A change by fewer steps of a measured load is none.
const STEPS: f64 = 3.0;
/// Step of object 6077, part of the rated torque.
const TORQUE_STEP: f64 = 1e-3;

/// The unit of a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LoadUnit {
    /// As a person reads it.
    pub(super) name: &'static str,
    /// Least change that says something, in this unit.
    pub(super) least: f64,
}

impl LoadUnit {
    /// Whether it is a force.
    pub(super) fn is_newton(&self) -> bool {
        self.name == "N"
    }
}

/// The configuration in which every servo tells its load: in newtons where its torque per current is configured, else its current,
/// which says the same of directions.
///
/// # Errors
/// Units that do not fit ([`Units::new`], [`Units::endless`]).
pub(super) fn measured(config: &SlaveConfig) -> anyhow::Result<(SlaveConfig, Vec<LoadUnit>)> {
    let (mut config, mut units) = (config.clone(), Vec::new());
    for (k, actuator) in config.drive.actuator.iter_mut().enumerate() {
        let Some(make) = ServoMake::of(config.drive.kind) else {
            // A drive that says its rated torque itself is judged by its noise alone.
            let newtons = Units::endless(actuator, k + 1)?.newton_per_newton_metre.abs();
            units.push(LoadUnit { name: "N", least: STEPS * TORQUE_STEP * actuator.rated_torque_nm * newtons });
            continue;
        };
        let newton_per_ampere = |actuator: &_| {
            Units::new(actuator, k + 1, ServoMake::COUNTS_PER_TURN).map(|units| units.newton_per_ampere.abs())
        };
        let is_known = actuator.newton_metre_per_ampere > 0.0;
        if !is_known {
            actuator.newton_metre_per_ampere = 1.0;
            actuator.newton_metre_per_ampere = 1.0 / newton_per_ampere(actuator)?;
        }
        let least = STEPS * make.current_step_a() * newton_per_ampere(actuator)?;
        units.push(LoadUnit { name: if is_known { "N" } else { "A" }, least });
    }
    Ok((config, units))
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_slave::{ActuatorConfig, DriveKind};

    #[test]
    fn loads_without_a_torque_per_current_are_currents_and_with_one_newtons() {
        let mut config = SlaveConfig::default();
        config.drive.kind = DriveKind::Sts3215;
        let servo = |newton_metre_per_ampere| ActuatorConfig {
            newton_metre_per_ampere,
            gear: 2.0,
            ..ActuatorConfig::default()
        };
        config.drive.actuator = vec![servo(0.0), servo(0.7)];
        let (known, units) = measured(&config).unwrap();
        let per_ampere = |k: usize| {
            Units::new(&known.drive.actuator[k], k + 1, ServoMake::COUNTS_PER_TURN).unwrap().newton_per_ampere
        };
        assert!((per_ampere(0) - 1.0).abs() < 1e-12 && units[0].name == "A");
        assert!((units[0].least - 3.0 * 6.5e-3).abs() < 1e-12);
        // 0.7 N m/A times 2 on 8 mm are 175 N/A.
        assert!((per_ampere(1) - 175.0).abs() < 1e-9 && units[1].name == "N");
        assert!((units[1].least - 175.0 * 3.0 * 6.5e-3).abs() < 1e-9);
        assert!(units[1].is_newton() && !units[0].is_newton());
    }
}
