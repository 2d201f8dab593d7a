//! Looks for servos on a port: who answers, at which bit rate, in which protocol. Only questions are sent.

use super::ServoMake;
use super::identity::{Ask, Identity, of_one};
use super::line::Line;
use super::protocol::{PING, Protocol};
use crate::error::OpenError;
use core::time::Duration;
use std::path::Path;

/// How long one answer is waited for: adapters hold bytes for up to 16 ms.
const ANSWER: Duration = Duration::from_millis(40);
/// How long all answers to a ping of everybody are waited for.
const PATIENCE_NS: i64 = 60_000_000;
/// With protocol 2 each id waits so much longer than the one before.
const SLOT_NS: i64 = 3_000_000;

/// A servo that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundServo {
    /// Bit rate at which it answers.
    pub baud: u32,
    /// Who it is.
    pub identity: Identity,
}

/// Looks at one port for servos with ids up to `last_id`, at one bit rate, or at all that servos of each make can be set to.
///
/// # Errors
/// [`OpenError`] where the port cannot be had, or two servos share an id.
pub fn scan(path: &Path, baud: Option<u32>, last_id: u8) -> Result<Vec<FoundServo>, OpenError> {
    let mut found = Vec::new();
    for make in ServoMake::ALL {
        let usual = make.bauds();
        for baud in baud.as_ref().map_or(usual, core::slice::from_ref) {
            found.extend(scan_for(make, path, *baud, last_id)?);
        }
    }
    Ok(found)
}

fn scan_for(make: ServoMake, path: &Path, baud: u32, last_id: u8) -> Result<Vec<FoundServo>, OpenError> {
    let mut line = Line::open(path, baud, make.protocol(), Vec::new(), ANSWER)?;
    let slots = if make.protocol() == Protocol::Two { i64::from(last_id) } else { 0 };
    let mut found = Vec::new();
    // A rate at which nobody says anything to a question for everybody needs no question for each.
    if !line.ask_anybody(PING, PATIENCE_NS + slots * SLOT_NS)? {
        return Ok(found);
    }
    for id in 0..=last_id {
        if let Some(data) = of_one(&mut line, make.who(), id, Ask::SCAN)? {
            found.push(FoundServo { baud, identity: Identity::of(make, id, &data) });
        }
    }
    Ok(found)
}
