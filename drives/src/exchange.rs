//! What the slave's step and the bus's thread tell each other.

use crate::bus::PerActuator;
use crate::handover::{CycleRing, text, text_number};
use crate::newest::{AsWords, Newest};
use core::sync::atomic::AtomicBool;
use krait_ipc::message::{Actuators, MAX_ACTUATORS};
use krait_slave::{ActuatorState, DriveError};

/// Both places, the cycles that wait to be recorded, and the wish to end.
#[derive(Debug)]
pub(crate) struct Exchange {
    pub wish: Newest<{ Wish::N }>,
    pub report: Newest<{ Report::N }>,
    pub cycles: CycleRing,
    pub ends: AtomicBool,
}

/// What the slave wants.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Wish {
    /// When the slave gave its last sign of life, ns.
    pub stamp_ns: i64,
    /// Counted up whenever power is switched anew, which forgives what failed before.
    pub turn: u64,
    pub has_power: bool,
    pub is_stopped: bool,
    /// Nothing moves any more, also not what a failure may move.
    pub stands: bool,
    /// Where the actuators shall be, m.
    pub q_m: Actuators,
}

/// How far the bus is with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Phase {
    /// Without power.
    #[default]
    Off = 0,
    /// Power is coming.
    Switching = 1,
    /// Going where the slave wants.
    On = 2,
    /// Braking, or at rest under power until power is switched anew.
    Stopped = 3,
}

/// What the bus says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Report {
    /// When its newest cycle ended, ns.
    pub stamp_ns: i64,
    /// The turn of the wish that it works on.
    pub turn: u64,
    pub phase: Phase,
    pub failure: Option<DriveError>,
    pub q_m: Actuators,
    pub tau_n: Actuators,
    pub sampled_ns: PerActuator<i64>,
    pub state: PerActuator<ActuatorState>,
    /// Whether any has sent an emergency that stands.
    pub has_emergency: bool,
}

impl Wish {
    const N: usize = 5 + MAX_ACTUATORS;

    /// Whether the slave has said where the actuators shall be, since power was switched.
    pub(crate) fn is_somewhere(&self) -> bool {
        self.q_m.iter().all(|q_m| q_m.is_finite())
    }
}

impl AsWords<{ Wish::N }> for Wish {
    fn to_words(&self) -> [u64; Wish::N] {
        let mut words = [0; Wish::N];
        words[0] = self.stamp_ns.cast_unsigned();
        words[1] = self.turn;
        words[2] = u64::from(self.has_power);
        words[3] = u64::from(self.is_stopped);
        words[4] = u64::from(self.stands);
        put(&mut words[5..], self.q_m.map(f64::to_bits));
        words
    }

    fn from_words(words: &[u64; Wish::N]) -> Self {
        Self {
            stamp_ns: words[0].cast_signed(),
            turn: words[1],
            has_power: words[2] == 1,
            is_stopped: words[3] == 1,
            stands: words[4] == 1,
            q_m: core::array::from_fn(|k| f64::from_bits(words[5 + k])),
        }
    }
}

impl Exchange {
    pub(crate) fn new(wish: &Wish, report: &Report) -> Self {
        let (wish, report) = (Newest::new(wish), Newest::new(report));
        Self { wish, report, cycles: CycleRing::new(), ends: AtomicBool::new(false) }
    }
}

impl Report {
    const N: usize = 9 + 4 * MAX_ACTUATORS;

    /// Before anything is known.
    pub(crate) fn blank() -> Self {
        Self {
            stamp_ns: 0,
            turn: 0,
            phase: Phase::Off,
            failure: None,
            q_m: [0.0; MAX_ACTUATORS],
            tau_n: [0.0; MAX_ACTUATORS],
            sampled_ns: [0; MAX_ACTUATORS],
            state: [ActuatorState::Off; MAX_ACTUATORS],
            has_emergency: false,
        }
    }

    /// Kind of the failure, its actuator, and the place of its text, as they are recorded; zeros without one.
    pub(crate) fn failure_numbers(&self) -> [u32; 3] {
        let [kind, actuator, _, _, text] = failure_words(self.failure);
        [kind as u32, actuator as u32, text as u32]
    }
}

impl AsWords<{ Report::N }> for Report {
    fn to_words(&self) -> [u64; Report::N] {
        let mut words = [0; Report::N];
        words[0] = self.stamp_ns.cast_unsigned();
        words[1] = self.turn;
        words[2] = self.phase as u64;
        put(&mut words[3..], failure_words(self.failure));
        put(&mut words[8..], self.q_m.map(f64::to_bits));
        put(&mut words[8 + MAX_ACTUATORS..], self.tau_n.map(f64::to_bits));
        put(&mut words[8 + 2 * MAX_ACTUATORS..], self.sampled_ns.map(i64::cast_unsigned));
        put(&mut words[8 + 3 * MAX_ACTUATORS..], self.state.map(|state| state as u64));
        words[8 + 4 * MAX_ACTUATORS] = u64::from(self.has_emergency);
        words
    }

    fn from_words(words: &[u64; Report::N]) -> Self {
        let numbers = |from: usize| core::array::from_fn(|k| f64::from_bits(words[from + k]));
        Self {
            stamp_ns: words[0].cast_signed(),
            turn: words[1],
            phase: match words[2] {
                1 => Phase::Switching,
                2 => Phase::On,
                3 => Phase::Stopped,
                _ => Phase::Off,
            },
            failure: failure(&words[3..8]),
            q_m: numbers(8),
            tau_n: numbers(8 + MAX_ACTUATORS),
            sampled_ns: core::array::from_fn(|k| words[8 + 2 * MAX_ACTUATORS + k].cast_signed()),
            state: core::array::from_fn(|k| state(words[8 + 3 * MAX_ACTUATORS + k])),
            has_emergency: words[8 + 4 * MAX_ACTUATORS] == 1,
        }
    }
}

fn put<const N: usize>(place: &mut [u64], words: [u64; N]) {
    place[..N].copy_from_slice(&words);
}

fn state(word: u64) -> ActuatorState {
    use ActuatorState::{Faulted, Limp, Lost, Off, On, QuickStopped, Relaxing, Switching};
    [Off, Switching, On, QuickStopped, Limp, Faulted, Lost, Relaxing]
        .into_iter()
        .find(|s| *s as u64 == word)
        .unwrap_or(Lost)
}

/// A failure as kind, actuator, two numbers and the place of its text in [`TEXTS`].
fn failure_words(failure: Option<DriveError>) -> [u64; 5] {
    let text = |what: &'static str| u64::from(text_number(what));
    match failure {
        Some(DriveError::Lost { actuator, silent_ms }) => [1, actuator as u64, silent_ms.to_bits(), 0, 0],
        Some(DriveError::Tripped { actuator, code, meaning }) => {
            [2, actuator as u64, u64::from(code), 0, text(meaning)]
        }
        Some(DriveError::Limp { actuator }) => [3, actuator as u64, 0, 0, 0],
        Some(DriveError::Reset { actuator }) => [4, actuator as u64, 0, 0, 0],
        Some(DriveError::Jumped { actuator, by_m }) => [5, actuator as u64, by_m.to_bits(), 0, 0],
        Some(DriveError::Stale { age_ms }) => [6, 0, age_ms.to_bits(), 0, 0],
        Some(DriveError::Bus { what }) => [7, 0, 0, 0, text(what)],
        Some(DriveError::Unled { silent_ms, limit_ms }) => [8, 0, silent_ms.to_bits(), limit_ms.to_bits(), 0],
        Some(DriveError::HardwareStop { actuator, code }) => [9, actuator as u64, u64::from(code), 0, 0],
        Some(DriveError::OtherGoal { actuator }) => [10, actuator as u64, 0, 0, 0],
        Some(DriveError::AllLost { silent_ms }) => [11, 0, silent_ms.to_bits(), 0, 0],
        None => [0; 5],
        // The bus has no other failures.
        Some(_) => [7, 0, 0, 0, 0],
    }
}

fn failure(words: &[u64]) -> Option<DriveError> {
    let actuator = words[1] as usize;
    let (first, second) = (f64::from_bits(words[2]), f64::from_bits(words[3]));
    let text = text(words[4] as u32);
    Some(match words[0] {
        1 => DriveError::Lost { actuator, silent_ms: first },
        2 => DriveError::Tripped { actuator, code: words[2] as u32, meaning: text },
        3 => DriveError::Limp { actuator },
        4 => DriveError::Reset { actuator },
        5 => DriveError::Jumped { actuator, by_m: first },
        6 => DriveError::Stale { age_ms: first },
        7 => DriveError::Bus { what: text },
        8 => DriveError::Unled { silent_ms: first, limit_ms: second },
        9 => DriveError::HardwareStop { actuator, code: words[2] as u32 },
        10 => DriveError::OtherGoal { actuator },
        11 => DriveError::AllLost { silent_ms: first },
        _ => return None,
    })
}

/// Every text that a failure of a bus may carry. Recordings name them by their place: new ones come last.
pub(crate) const TEXTS: [&str; 28] = [
    "of a kind that is not known",
    crate::texts::PORT_GONE,
    crate::texts::PORT_BLOCKED,
    crate::texts::THREAD_ENDED,
    crate::texts::VOLTAGE,
    crate::texts::SENSOR,
    crate::texts::HEAT,
    crate::texts::CURRENT,
    crate::texts::SEVERAL,
    crate::texts::NOT_POWERED,
    crate::texts::CAN_GONE,
    crate::texts::CAN_DOWN,
    crate::texts::BUS_OFF,
    crate::texts::CAN_BLOCKED,
    crate::texts::SECOND_MASTER,
    crate::texts::OUT_OF_STEP,
    crate::texts::QUICK_STOPPED,
    crate::texts::FOLLOWING,
    crate::texts::LEFT,
    crate::texts::COMMUNICATION,
    crate::texts::OF_ITS_OWN,
    crate::texts::PORT_STILL_GONE,
    crate::texts::OTHER_SERVOS,
    crate::texts::CAN_STILL_GONE,
    crate::texts::CAN_IN_USE,
    crate::texts::OTHER_DRIVES,
    crate::texts::ELECTRICAL,
    crate::texts::OVERLOAD,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_handed_over_comes_out_as_it_went_in() {
        let q_m = [1.5e-3; MAX_ACTUATORS];
        let wish = Wish { stamp_ns: -3, turn: 7, has_power: true, is_stopped: false, stands: true, q_m };
        assert_eq!(Wish::from_words(&wish.to_words()), wish);
        let mut failures = vec![
            None,
            Some(DriveError::Lost { actuator: 2, silent_ms: 15.5 }),
            Some(DriveError::OtherGoal { actuator: 5 }),
            Some(DriveError::AllLost { silent_ms: 15.0 }),
            Some(DriveError::Limp { actuator: 12 }),
            Some(DriveError::Reset { actuator: 1 }),
            Some(DriveError::Jumped { actuator: 3, by_m: -0.02 }),
            Some(DriveError::Stale { age_ms: 80.0 }),
            Some(DriveError::Unled { silent_ms: 51.0, limit_ms: 50.0 }),
            Some(DriveError::HardwareStop { actuator: 2, code: 0x9000 }),
        ];
        failures.extend(TEXTS.map(|meaning| Some(DriveError::Tripped { actuator: 4, code: 37, meaning })));
        failures.extend(TEXTS.map(|what| Some(DriveError::Bus { what })));
        for failure in failures {
            for phase in [Phase::Off, Phase::Switching, Phase::On, Phase::Stopped] {
                let report = Report {
                    stamp_ns: 5,
                    turn: 6,
                    phase,
                    failure,
                    q_m: core::array::from_fn(|k| k as f64),
                    tau_n: core::array::from_fn(|k| -(k as f64)),
                    sampled_ns: core::array::from_fn(|k| -(k as i64)),
                    state: core::array::from_fn(|k| state(k as u64 % 8)),
                    has_emergency: phase == Phase::On,
                };
                assert_eq!(Report::from_words(&report.to_words()), report);
            }
        }
    }
}
