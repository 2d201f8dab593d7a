//! Why drives refuse or fail: one sentence each, with what to do.

/// Why a drive refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// Motion was asked for while the power was off.
    #[error("the drives were told to move while their power is off; send `enable` first")]
    NotPowered,
    /// A position was NaN or infinite.
    #[error(
        "actuator {actuator} was told to go to {found_m} m, expected a finite position; the command was not executed"
    )]
    NotFinite {
        /// Which, from 1.
        actuator: usize,
        /// What was asked for, m.
        found_m: f64,
    },
    /// A position was beyond the hard stops.
    #[error(
        "actuator {actuator} was told to go to {found_m} m, expected at most {limit_m} m either way; the command was not executed"
    )]
    OutOfTravel {
        /// Which, from 1.
        actuator: usize,
        /// What was asked for, m.
        found_m: f64,
        /// Distance of the hard stops from zero, m.
        limit_m: f64,
    },
    /// The hardware failed in a way of its own.
    #[error("the drives failed: {what}; mend that, then send `enable`")]
    Failed {
        /// The hardware's own words.
        what: &'static str,
    },
    /// An actuator does not answer any more.
    #[error(
        "Drive {actuator} failed; the others hold: it has not answered for {silent_ms:.1} ms; check its cable and power, then send `clear-fault` and `enable`"
    )]
    Lost {
        /// Which, from 1.
        actuator: usize,
        /// How long, ms.
        silent_ms: f64,
    },
    /// An actuator reports a failure.
    #[error(
        "Drive {actuator} failed; the others hold: it reports {meaning} (code {code}); mend that, then send `clear-fault` and `enable`"
    )]
    Tripped {
        /// Which, from 1.
        actuator: usize,
        /// Its own number.
        code: u32,
        /// What that means.
        meaning: &'static str,
    },
    /// Hardware has switched an actuator off, not this program.
    #[error(
        "Drive {actuator} was switched off by hardware (code {code}), as by an emergency stop, a safe-torque-off or an enable input; drives that have power hold; release it, then send `clear-fault` and `enable`"
    )]
    HardwareStop {
        /// Which, from 1.
        actuator: usize,
        /// Its own number; 0: it told none.
        code: u32,
    },
    /// An actuator has let go by itself.
    #[error(
        "Drive {actuator} failed; the others hold: it was overloaded and has let go of its line; take the load off, then send `clear-fault` and `enable`"
    )]
    Limp {
        /// Which, from 1.
        actuator: usize,
    },
    /// An actuator started anew.
    #[error(
        "Drive {actuator} failed; the others hold: it lost its power for a moment and started anew; check its supply, then send `clear-fault` and `enable`"
    )]
    Reset {
        /// Which, from 1.
        actuator: usize,
    },
    /// An encoder leapt.
    #[error(
        "Drive {actuator} failed; the others hold: its encoder leapt by {by_m} m in one cycle; check its zero with `krait drives`, then send `clear-fault` and `enable`"
    )]
    Jumped {
        /// Which, from 1.
        actuator: usize,
        /// How far, m.
        by_m: f64,
    },
    /// A reading is too old to go by.
    #[error(
        "the newest reading of drive {actuator} is {age_ms:.1} ms old, so its bus does not keep up; the drives hold; see `krait doctor`, then send `clear-fault` and `enable`"
    )]
    Stale {
        /// Which, from 1.
        actuator: usize,
        /// How old, ms.
        age_ms: f64,
    },
    /// An actuator stands too far from the zero that was configured for it.
    #[error(
        "drive {actuator} stands {found_m:.4} m from its zero, expected at most {limit_m} m either way; send `disable`, which takes its power, bring it back by hand and send `enable`, or set its zero with `krait drives --zero`"
    )]
    FarFromZero {
        /// Which, from 1.
        actuator: usize,
        /// Where it stands, m.
        found_m: f64,
        /// Its travel, m.
        limit_m: f64,
    },
    /// The bus itself failed.
    #[error(
        "the bus of the drives failed: {what}; nothing more can be told to them; mend that, then send `clear-fault`, and where that does not help end this krait and start it again"
    )]
    Bus {
        /// What happened.
        what: &'static str,
    },
    /// Nobody told the bus for too long.
    #[error(
        "the slave was silent for {silent_ms:.1} ms, expected at most {limit_ms} ms, so the drives stopped by themselves and hold; see `krait doctor`, then send `clear-fault` and `enable`"
    )]
    Unled {
        /// How long, ms.
        silent_ms: f64,
        /// The limit, ms.
        limit_ms: f64,
    },
}

/// What is true of the others where a fault takes the power of all (`on_fault = "power_off"`), in place of what is true elsewhere.
const WITHOUT_POWER: [(&str, &str); 4] = [
    ("failed; the others hold:", "failed; power was taken from all:"),
    ("; drives that have power hold;", "; power was taken from all;"),
    ("does not keep up; the drives hold;", "does not keep up; power was taken from all;"),
    ("stopped by themselves and hold;", "stopped by themselves and are without power;"),
];

impl DriveError {
    /// The failure in words. Where a fault keeps the power these are its own; elsewhere nothing holds, and that is said.
    pub fn sentence(&self, keeps_power: bool) -> String {
        let words = self.to_string();
        if keeps_power {
            return words;
        }
        WITHOUT_POWER.into_iter().fold(words, |words, (holds, without)| words.replace(holds, without))
    }

    /// The actuator that it is about, from 1; `None` where it is about all or none.
    pub fn actuator(&self) -> Option<usize> {
        match *self {
            Self::NotFinite { actuator, .. }
            | Self::OutOfTravel { actuator, .. }
            | Self::Lost { actuator, .. }
            | Self::Tripped { actuator, .. }
            | Self::HardwareStop { actuator, .. }
            | Self::Limp { actuator }
            | Self::Reset { actuator }
            | Self::Jumped { actuator, .. }
            | Self::Stale { actuator, .. }
            | Self::FarFromZero { actuator, .. } => Some(actuator),
            Self::NotPowered | Self::Failed { .. } | Self::Bus { .. } | Self::Unled { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_a_fault_takes_the_power_no_sentence_says_that_anybody_holds() {
        for failure in [
            DriveError::Lost { actuator: 2, silent_ms: 15.0 },
            DriveError::Tripped { actuator: 2, code: 4, meaning: "that it is too hot" },
            DriveError::HardwareStop { actuator: 2, code: 0 },
            DriveError::Limp { actuator: 2 },
            DriveError::Reset { actuator: 2 },
            DriveError::Jumped { actuator: 2, by_m: 0.01 },
            DriveError::Stale { actuator: 2, age_ms: 80.0 },
            DriveError::Unled { silent_ms: 120.0, limit_ms: 100.0 },
        ] {
            assert!(failure.sentence(true).contains("hold") && failure.sentence(true) == failure.to_string());
            let without = failure.sentence(false);
            assert!(without.contains("power") && !without.contains("hold"), "{without}");
        }
    }
}
