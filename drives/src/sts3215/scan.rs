//! Looks for servos on a port: who answers, at which bit rate. Only questions are sent.

use super::Sts3215;
use super::identity::{Ask, Identity, of_one};
use super::packet::{ALL, put};
use crate::bus::BusGone;
use crate::error::OpenError;
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use std::path::Path;

/// Bit rates that these servos can be set to, the usual one first.
pub const BAUDS: [u32; 8] = [1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400];
/// Asks who is there, without registers.
const PING: u8 = 0x01;
/// How long one answer is waited for: adapters hold bytes for up to 16 ms.
const ANSWER: Duration = Duration::from_millis(40);
/// How long all answers to a ping of everybody are waited for.
const PATIENCE_NS: i64 = 60_000_000;

/// A servo that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundServo {
    /// Bit rate at which it answers.
    pub baud: u32,
    /// Who it is.
    pub identity: Identity,
}

/// Looks at one port with some bit rates for servos with ids up to `last_id`.
///
/// # Errors
/// [`OpenError`] where the port cannot be had, or two servos share an id.
pub fn scan(path: &Path, bauds: &[u32], last_id: u8) -> Result<Vec<FoundServo>, OpenError> {
    let mut found = Vec::new();
    for &baud in bauds {
        let mut bus = Sts3215::to_read(path, baud, Vec::new(), ANSWER)?;
        // A rate at which nobody says anything to a question for everybody needs no question for each.
        if !anybody_there(&mut bus)? {
            continue;
        }
        for id in 0..=last_id {
            if let Some(identity) = of_one(&mut bus, id, Ask::SCAN)? {
                found.push(FoundServo { baud, identity });
            }
        }
    }
    Ok(found)
}

/// Whether anything but the question's own echo comes back when everybody is asked; answers of several may collide.
fn anybody_there(bus: &mut Sts3215) -> Result<bool, BusGone> {
    bus.bytes.clear();
    put(&mut bus.bytes, ALL, PING, &[]);
    let sent = bus.bytes.clone();
    let any = bus.question(monotonic_ns() + PATIENCE_NS, |received| {
        received.len() > sent.len() || !sent.starts_with(received)
    })?;
    bus.recover()?;
    Ok(any)
}
