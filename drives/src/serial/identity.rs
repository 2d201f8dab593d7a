//! Who a servo is, and what it is set to: read before anything else, changed by nobody here.

use super::line::{Line, Said};
use super::protocol::{Block, word};
use super::{OPEN_TRIES, ServoMake};
use crate::Units;
use crate::error::OpenError;
use krait_slave::{ActuatorConfig, DriveConfig};
use std::path::Path;

/// How a servo is asked who it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ask {
    pub(super) tries: u32,
    /// How long a second answer is waited for: adapters hold bytes for up to 16 ms.
    linger_ns: i64,
}

impl Ask {
    /// Before anything moves nobody is in a hurry.
    pub(crate) const PATIENT: Self = Self { tries: OPEN_TRIES, linger_ns: 20_000_000 };
    /// While the slave waits for a sign of life: 12 servos must not take longer than its patience.
    pub(crate) const BRIEF: Self = Self { tries: 2, linger_ns: 0 };
    /// Where most ids are nobody's.
    pub(crate) const SCAN: Self = Self { tries: 2, ..Self::PATIENT };
}

/// What a servo says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// What it is asked as.
    pub make: ServoMake,
    /// Number on the bus.
    pub id: u8,
    /// Model number.
    pub model: u16,
    /// Firmware, as its maker writes it.
    pub firmware: String,
}

impl Identity {
    pub(super) fn of(make: ServoMake, id: u8, data: &[u8]) -> Self {
        let (model, firmware) = match make {
            ServoMake::Sts3215 => (word(data, 3), format!("{}.{}", data[0], data[1])),
            ServoMake::Xl330 => (word(data, 0), data[6].to_string()),
        };
        Self { make, id, model, firmware }
    }

    /// Whether it is a servo that krait knows how to move.
    pub fn is_known(&self) -> bool {
        self.name().is_some()
    }

    /// Its name; none: a stranger.
    pub fn name(&self) -> Option<&'static str> {
        let known = self.make.models().iter().find(|(model, _)| *model == self.model);
        known.map(|(_, name)| *name)
    }
}

/// What the servos of a configuration say of themselves.
pub(super) fn of_all(
    line: &mut Line,
    who: Block,
    config: &DriveConfig,
    port: &Path,
    how: Ask,
) -> Result<Vec<Vec<u8>>, OpenError> {
    let ids = line.ids.clone();
    let mut found = Vec::new();
    for id in &ids {
        found.push(of_one(line, who, *id, how)?);
    }
    if found.iter().all(Option::is_none) {
        let names: Vec<String> = ids.iter().map(u8::to_string).collect();
        let expected = format!("{} with the ids {}", ids.len(), names.join(", "));
        return Err(OpenError::NobodyAnswers { port: port.to_owned(), baud: config.baud, expected });
    }
    let mut said = Vec::new();
    for (k, data) in found.into_iter().enumerate() {
        said.push(data.ok_or(OpenError::NoAnswer { actuator: k + 1, id: ids[k] })?);
    }
    Ok(said)
}

/// Noise spoils one answer, and one that is late comes twice; two servos with one id spoil all.
pub(super) fn of_one(line: &mut Line, who: Block, id: u8, how: Ask) -> Result<Option<Vec<u8>>, OpenError> {
    let mut spoilt = None;
    for _ in 0..how.tries {
        match line.ask_one(id, who, how.linger_ns)? {
            Said::One(data) => return Ok(Some(data)),
            Said::Nothing => spoilt = None,
            Said::TooMuch(n) => spoilt = Some(n),
        }
        // What comes late must not be the answer to the next question.
        line.recover()?;
    }
    spoilt.map_or(Ok(None), |n| Err(OpenError::SameId { what: "servo", id, n }))
}

/// The same registers of all servos, who are known to be there.
pub(crate) fn settings(line: &mut Line, block: Block, how: Ask) -> Result<Vec<Vec<u8>>, OpenError> {
    let mut found: Vec<Option<Vec<u8>>> = vec![None; line.ids.len()];
    let bytes = line.ids.len() * (line.protocol.answer_bytes() + block.n);
    let patience_ns = line.timeout_ns + line.time_ns(bytes);
    for _ in 0..how.tries {
        let is_whole = line.ask_all_for(block, patience_ns)?;
        for (k, answer) in line.answers(block.n) {
            found[k] = Some(answer.data.to_vec());
        }
        if !is_whole {
            line.recover()?;
        }
        if found.iter().all(Option::is_some) {
            break;
        }
    }
    let ids = &line.ids;
    let all = found.into_iter().enumerate();
    all.map(|(k, data)| data.ok_or(OpenError::NoAnswer { actuator: k + 1, id: ids[k] })).collect()
}

/// An end of the range in which a servo itself lets goals be.
pub(crate) struct RangeEnd {
    pub register: u8,
    pub name: &'static str,
    pub counts: i32,
}

/// Refuses a servo whose range is less than its travel. Without a zero nothing moves, so nothing can pass it.
pub(crate) fn check_range(
    place: (usize, u8),
    actuator: &ActuatorConfig,
    [low, high]: [RangeEnd; 2],
) -> Result<(), OpenError> {
    let Some(zero) = actuator.zero_count else { return Ok(()) };
    let stroke = Units::new(actuator, place.0 + 1, ServoMake::COUNTS_PER_TURN)?.magnitude_counts(actuator.travel_m);
    let (lowest, highest) = (f64::from(zero) - stroke, f64::from(zero) + stroke);
    if f64::from(low.counts) > lowest {
        let expected = format!("at most {lowest:.0}, the end of the travel");
        return refused(place, low.register, low.name, low.counts, &expected);
    }
    if f64::from(high.counts) < highest {
        let expected = format!("at least {highest:.0}, the end of the travel");
        return refused(place, high.register, high.name, high.counts, &expected);
    }
    Ok(())
}

/// The refusal of a servo whose register has a value with which it would not do what it is told.
pub(crate) fn refused<T>(
    (k, id): (usize, u8),
    register: u8,
    name: &'static str,
    found: i32,
    expected: &str,
) -> Result<T, OpenError> {
    Err(OpenError::Register { actuator: k + 1, id, register, name, found, expected: expected.to_owned() })
}
