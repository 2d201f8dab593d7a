//! Why drives refuse or fail: one sentence each, with what to do.

use core::fmt;

/// How a failure that was mended is left.
const AGAIN: &str = "then send `clear-fault` and `enable`";

/// Why a drive refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveError {
    /// Motion was asked for while the power was off.
    NotPowered,
    /// A position was NaN or infinite.
    NotFinite {
        /// Which, from 1.
        actuator: usize,
        /// What was asked for, m.
        found_m: f64,
    },
    /// A position was beyond the hard stops.
    OutOfTravel {
        /// Which, from 1.
        actuator: usize,
        /// What was asked for, m.
        found_m: f64,
        /// Distance of the hard stops from zero, m.
        limit_m: f64,
    },
    /// The hardware failed in a way of its own.
    Failed {
        /// The hardware's own words.
        what: &'static str,
    },
    /// An actuator does not answer any more.
    Lost {
        /// Which, from 1.
        actuator: usize,
        /// How long, ms.
        silent_ms: f64,
    },
    /// No actuator of several answers any more.
    AllLost {
        /// How long, ms.
        silent_ms: f64,
    },
    /// An actuator answers, but knows another goal than it was told.
    OtherGoal {
        /// Which, from 1.
        actuator: usize,
    },
    /// An actuator reports a failure.
    Tripped {
        /// Which, from 1.
        actuator: usize,
        /// Its own number.
        code: u32,
        /// What that means.
        meaning: &'static str,
    },
    /// Hardware has switched an actuator off, not this program.
    HardwareStop {
        /// Which, from 1.
        actuator: usize,
        /// Its own number; 0: it told none.
        code: u32,
    },
    /// An actuator has let go by itself.
    Limp {
        /// Which, from 1.
        actuator: usize,
    },
    /// An actuator started anew.
    Reset {
        /// Which, from 1.
        actuator: usize,
    },
    /// An encoder leapt.
    Jumped {
        /// Which, from 1.
        actuator: usize,
        /// How far, m.
        by_m: f64,
    },
    /// The bus has told nothing for too long. Which actuator is silent while it tells, the bus itself judges ([`DriveError::Lost`]).
    Stale {
        /// How old its newest word is, ms.
        age_ms: f64,
    },
    /// An actuator stands too far from the zero that was configured for it.
    FarFromZero {
        /// Which, from 1.
        actuator: usize,
        /// Where it stands, m.
        found_m: f64,
        /// Its travel, m.
        limit_m: f64,
    },
    /// The bus itself failed.
    Bus {
        /// What happened.
        what: &'static str,
    },
    /// Nobody told the bus for too long.
    Unled {
        /// How long, ms.
        silent_ms: f64,
        /// The limit, ms.
        limit_ms: f64,
    },
}

/// An actuator's own number as its manual has it: codes of CAN drives in hex, such as 2310h, those of servos, one byte, as they are.
struct Code(u32);

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(code) = *self;
        if code > 0xFF { write!(f, "{code:04X}h") } else { write!(f, "{code}") }
    }
}

/// A failure in words, which say what became of the power.
struct Said {
    error: DriveError,
    keeps_power: bool,
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let either = |kept: &'static str, taken: &'static str| if self.keeps_power { kept } else { taken };
        let others = either("the others hold", "power was taken from all");
        match self.error {
            DriveError::NotPowered => {
                f.write_str("the drives were told to move while their power is off; send `enable` first")
            }
            DriveError::NotFinite { actuator, found_m } => write!(
                f,
                "actuator {actuator} was told to go to {found_m} m, expected a finite position; the command was not executed"
            ),
            DriveError::OutOfTravel { actuator, found_m, limit_m } => write!(
                f,
                "actuator {actuator} was told to go to {found_m} m, expected at most {limit_m} m either way; the command was not executed"
            ),
            DriveError::Failed { what } => write!(f, "the drives failed: {what}; mend that, then send `enable`"),
            DriveError::Lost { actuator, silent_ms } => write!(
                f,
                "Drive {actuator} failed; {others}: it has not answered for {silent_ms:.1} ms; check its cable and power, {AGAIN}"
            ),
            DriveError::AllLost { silent_ms } => {
                let rest = either("hold where they were last told to be", "were told to give up their power");
                write!(
                    f,
                    "no drive answers any more, for {silent_ms:.1} ms; those that hear {rest}; check the supply and the cable of the bus, {AGAIN}"
                )
            }
            DriveError::OtherGoal { actuator } => write!(
                f,
                "Drive {actuator} failed; {others}: it answers, but knows another goal than it was told, so somebody else speaks on its bus, or goals are lost on their way; end other programs on that bus, check its cable, {AGAIN}"
            ),
            DriveError::Tripped { actuator, code, meaning } => {
                write!(
                    f,
                    "Drive {actuator} failed; {others}: it reports {meaning} (code {}); mend that, {AGAIN}",
                    Code(code)
                )
            }
            DriveError::HardwareStop { actuator, code } => {
                let powered = either("drives that have power hold", "power was taken from all");
                write!(
                    f,
                    "Drive {actuator} was switched off by hardware (code {}), as by an emergency stop, a safe-torque-off or an enable input; {powered}; release it, {AGAIN}",
                    Code(code)
                )
            }
            DriveError::Limp { actuator } => write!(
                f,
                "Drive {actuator} failed; {others}: it was overloaded and has let go of its line; take the load off, {AGAIN}"
            ),
            DriveError::Reset { actuator } => write!(
                f,
                "Drive {actuator} failed; {others}: it lost its power for a moment and started anew; check its supply, {AGAIN}"
            ),
            DriveError::Jumped { actuator, by_m } => write!(
                f,
                "Drive {actuator} failed; {others}: its encoder leapt by {by_m} m in one cycle; check its zero with `krait drives`, {AGAIN}"
            ),
            DriveError::Stale { age_ms } => {
                let drives = either("the drives hold", "power was taken from all");
                write!(
                    f,
                    "the newest readings of the drives are {age_ms:.1} ms old, so the thread of their bus does not keep up; {drives}; see `krait doctor`, {AGAIN}"
                )
            }
            DriveError::FarFromZero { actuator, found_m, limit_m } => write!(
                f,
                "drive {actuator} stands {found_m:.4} m from its zero, expected at most {limit_m} m either way; send `disable`, which takes its power, bring it back by hand and send `enable`, or set its zero with `krait drives --zero`"
            ),
            DriveError::Bus { what } => write!(
                f,
                "the bus of the drives failed: {what}; nothing more can be told to them; mend that, then send `clear-fault`, and where that does not help end this krait and start it again"
            ),
            DriveError::Unled { silent_ms, limit_ms } => {
                let rest = either("hold", "are without power");
                write!(
                    f,
                    "the slave was silent for {silent_ms:.1} ms, expected at most {limit_ms} ms, so the drives stopped by themselves and {rest}; see `krait doctor`, {AGAIN}"
                )
            }
        }
    }
}

/// As where a fault keeps the power.
impl fmt::Display for DriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Said { error: *self, keeps_power: true }.fmt(f)
    }
}

impl std::error::Error for DriveError {}

impl DriveError {
    /// The failure in words. Where a fault takes the power of all (`on_fault = "power_off"`), nobody holds, and that is said.
    pub fn sentence(&self, keeps_power: bool) -> String {
        Said { error: *self, keeps_power }.to_string()
    }

    /// The actuator that it is about, from 1; `None` where it is about all or none.
    pub fn actuator(&self) -> Option<usize> {
        match *self {
            Self::NotFinite { actuator, .. }
            | Self::OutOfTravel { actuator, .. }
            | Self::Lost { actuator, .. }
            | Self::OtherGoal { actuator }
            | Self::Tripped { actuator, .. }
            | Self::HardwareStop { actuator, .. }
            | Self::Limp { actuator }
            | Self::Reset { actuator }
            | Self::Jumped { actuator, .. }
            | Self::FarFromZero { actuator, .. } => Some(actuator),
            Self::NotPowered
            | Self::Failed { .. }
            | Self::AllLost { .. }
            | Self::Stale { .. }
            | Self::Bus { .. }
            | Self::Unled { .. } => None,
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
            DriveError::AllLost { silent_ms: 15.0 },
            DriveError::OtherGoal { actuator: 2 },
            DriveError::Tripped { actuator: 2, code: 4, meaning: "that it is too hot" },
            DriveError::HardwareStop { actuator: 2, code: 0 },
            DriveError::Limp { actuator: 2 },
            DriveError::Reset { actuator: 2 },
            DriveError::Jumped { actuator: 2, by_m: 0.01 },
            DriveError::Stale { age_ms: 80.0 },
            DriveError::Unled { silent_ms: 120.0, limit_ms: 100.0 },
        ] {
            assert!(failure.sentence(true).contains("hold") && failure.sentence(true) == failure.to_string());
            let without = failure.sentence(false);
            assert!(without.contains("power") && !without.contains("hold"), "{without}");
        }
    }

    #[test]
    fn codes_are_said_as_manuals_have_them() {
        for (code, words) in [
            (0x2310, "(code 2310h)"),
            (0xFF01, "(code FF01h)"),
            (0x1000, "(code 1000h)"),
            (4, "(code 4)"),
            (255, "(code 255)"),
        ] {
            let sentence = DriveError::Tripped { actuator: 2, code, meaning: "too much current" }.to_string();
            assert!(sentence.contains(words), "{sentence}");
        }
        for (code, words) in [(0x9000, "(code 9000h)"), (0, "(code 0)")] {
            let sentence = DriveError::HardwareStop { actuator: 2, code }.to_string();
            assert!(sentence.contains(words), "{sentence}");
        }
    }

    /// Words of the hardware are its own, whatever they are.
    #[test]
    fn what_became_of_the_power_changes_no_other_words() {
        let meaning = "that its brakes failed; the others hold: see its manual; the drives hold; drives that have power hold; end";
        for keeps_power in [true, false] {
            let sentence = DriveError::Tripped { actuator: 2, code: 4, meaning }.sentence(keeps_power);
            assert!(sentence.contains(meaning), "{sentence}");
        }
    }
}
