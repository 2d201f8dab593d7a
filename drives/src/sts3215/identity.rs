//! Who a servo is, and whether it would do what it is told: read before anything else, changed by nobody here.

use super::packet::{READ, answers, put, word};
use super::{MODEL, Sts3215};
use crate::bus::BusGone;
use crate::error::OpenError;
use krait_ipc::clock::monotonic_ns;
use krait_slave::DriveConfig;
use std::path::Path;

/// Registers that are read: from the firmware to the mode.
const IDENTITY_BYTES: usize = 34;
/// Times that a question is asked before it counts as unanswered.
pub(crate) const TRIES: u32 = 4;
/// How a servo is asked who it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask {
    tries: u32,
    /// How long a second answer is waited for: adapters hold bytes for up to 16 ms.
    linger_ns: i64,
}

impl Ask {
    /// Before anything moves nobody is in a hurry.
    pub(crate) const PATIENT: Self = Self { tries: TRIES, linger_ns: 20_000_000 };
    /// While the slave waits for a sign of life: 12 servos must not take longer than its patience.
    pub(crate) const BRIEF: Self = Self { tries: 2, linger_ns: 0 };
    /// Where most ids are nobody's.
    pub(crate) const SCAN: Self = Self { tries: 2, ..Self::PATIENT };
}

/// What a servo says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Number on the bus.
    pub id: u8,
    /// Model number; 777: STS3215.
    pub model: u16,
    /// Firmware, major and minor.
    pub firmware: [u8; 2],
    /// Smallest and largest count that it goes to; both 0: any number of turns.
    pub angle_limits: [u16; 2],
    /// 0: goes to positions.
    pub mode: u8,
}

impl Identity {
    /// Whether it is a servo that krait knows how to move.
    pub fn is_known(&self) -> bool {
        self.model == MODEL
    }
}

/// What came back to a question for an identity.
enum Said {
    Nothing,
    One(Identity),
    /// So many answers, or bytes that are no answer.
    TooMuch(usize),
}

/// Asks one servo who it is.
fn ask(bus: &mut Sts3215, id: u8, linger_ns: i64) -> Result<Said, BusGone> {
    bus.bytes.clear();
    put(&mut bus.bytes, id, READ, &[&[0, IDENTITY_BYTES as u8]]);
    let until_ns = monotonic_ns() + bus.timeout_ns;
    if bus.question(until_ns, |received| answers(received, IDENTITY_BYTES).any(|answer| answer.id == id))? {
        let until_ns = monotonic_ns() + linger_ns;
        while monotonic_ns() < until_ns {
            bus.port.receive(&mut bus.received, until_ns)?;
        }
    }
    let mut found = answers(&bus.received, IDENTITY_BYTES).filter(|answer| answer.id == id);
    let first = found.next().map(|answer| Identity {
        id,
        model: word(answer.data, 3),
        firmware: [answer.data[0], answer.data[1]],
        angle_limits: [word(answer.data, 9), word(answer.data, 11)],
        mode: answer.data[33],
    });
    let n_more = found.count();
    // Bytes besides the question's own echo that are no answer.
    let is_noise = first.is_none() && bus.received.len() > bus.bytes.len();
    Ok(match first {
        Some(identity) if n_more == 0 => Said::One(identity),
        None if !is_noise => Said::Nothing,
        _ => Said::TooMuch(n_more + usize::from(first.is_some())),
    })
}

/// Who the servos of a configuration are.
pub(crate) fn of_all(
    bus: &mut Sts3215,
    config: &DriveConfig,
    port: &Path,
    how: Ask,
) -> Result<Vec<Identity>, OpenError> {
    let ids = bus.ids.clone();
    let mut found = Vec::new();
    for id in &ids {
        found.push(of_one(bus, *id, how)?);
    }
    if found.iter().all(Option::is_none) {
        let names: Vec<String> = ids.iter().map(u8::to_string).collect();
        let expected = format!("{} with the ids {}", ids.len(), names.join(", "));
        return Err(OpenError::NobodyAnswers { port: port.to_owned(), baud: config.baud, expected });
    }
    let mut identities = Vec::new();
    for (k, identity) in found.into_iter().enumerate() {
        identities.push(identity.ok_or(OpenError::NoAnswer { actuator: k + 1, id: ids[k] })?);
    }
    Ok(identities)
}

/// Noise spoils one answer, and one that is late comes twice; two servos with one id spoil all.
pub(crate) fn of_one(bus: &mut Sts3215, id: u8, how: Ask) -> Result<Option<Identity>, OpenError> {
    let mut spoilt = None;
    for _ in 0..how.tries {
        match ask(bus, id, how.linger_ns)? {
            Said::One(identity) => return Ok(Some(identity)),
            Said::Nothing => spoilt = None,
            Said::TooMuch(n) => spoilt = Some(n),
        }
        // What comes late must not be the answer to the next question.
        bus.recover()?;
    }
    spoilt.map_or(Ok(None), |n| Err(OpenError::SameId { id, n }))
}

/// Whether these servos are those of the configuration and would do what they are told.
pub(crate) fn check(identities: &[Identity], config: &DriveConfig) -> Result<(), OpenError> {
    for (k, (identity, actuator)) in identities.iter().zip(&config.actuator).enumerate() {
        let Identity { id, model, angle_limits: [low, high], mode, .. } = *identity;
        let number = k + 1;
        if model != MODEL {
            return Err(OpenError::Stranger { actuator: number, id, found: model, expected: MODEL });
        }
        let register = |register, name, found: u16, expected: &str| {
            Err(OpenError::Register {
                actuator: number,
                id,
                register,
                name,
                found: found.into(),
                expected: expected.to_owned(),
            })
        };
        if mode != 0 {
            return register(33, "mode", mode.into(), "0 (position)");
        }
        if low >= high {
            return register(
                11,
                "largest angle",
                high,
                "4095, with 0 in register 9: one turn, so that a count is a place",
            );
        }
        // Without a zero nothing moves, so nothing can pass the limits.
        let Some(zero) = actuator.zero_count else { continue };
        let stroke = crate::Units::new(actuator, number, super::COUNTS_PER_TURN)?.magnitude_counts(actuator.travel_m);
        let (lowest, highest) = (f64::from(zero) - stroke, f64::from(zero) + stroke);
        if f64::from(low) > lowest {
            return register(9, "smallest angle", low, &format!("at most {lowest:.0}, the end of the travel"));
        }
        if f64::from(high) < highest {
            return register(11, "largest angle", high, &format!("at least {highest:.0}, the end of the travel"));
        }
    }
    Ok(())
}
