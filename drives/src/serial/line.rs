//! One half-duplex wire with its servos: questions, answers, and quiet after whatever went wrong.

use super::port::Port;
use super::protocol::{ALL, Answer, Block, Protocol, READ, SYNC_READ, SYNC_WRITE};
use crate::bus::BusGone;
use crate::error::OpenError;
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use std::path::Path;

/// Silence after which nothing more comes of an old answer.
const QUIET_NS: i64 = 500_000;
/// A USB adapter holds received bytes for so long, at best, ns.
const USB_NS: i64 = 1_000_000;

/// A serial port with servos of one protocol.
#[derive(Debug)]
pub(crate) struct Line {
    port: Port,
    pub(super) protocol: Protocol,
    baud: u32,
    pub(crate) ids: Vec<u8>,
    pub(crate) timeout_ns: i64,
    /// The newest question, its parameters, and what was received since. All three are used again and again: a cycle allocates nothing.
    bytes: Vec<u8>,
    parts: Vec<u8>,
    received: Vec<u8>,
}

/// What came back to a question for one servo's registers.
pub(super) enum Said {
    Nothing,
    One(Vec<u8>),
    /// So many answers, or bytes that are no answer.
    TooMuch(usize),
}

impl Line {
    pub(super) fn open(
        path: &Path,
        baud: u32,
        protocol: Protocol,
        ids: Vec<u8>,
        timeout: Duration,
    ) -> Result<Self, OpenError> {
        Ok(Self {
            port: Port::open(path, baud)?,
            protocol,
            baud,
            ids,
            timeout_ns: timeout.as_nanos() as i64,
            bytes: Vec::with_capacity(512),
            parts: Vec::with_capacity(512),
            received: Vec::with_capacity(1024),
        })
    }

    pub(super) fn reopen(&mut self, path: &Path) -> Result<(), OpenError> {
        self.port.reopen(path, self.baud)
    }

    /// Sets the same registers of all servos; nobody answers.
    pub(crate) fn set<const N: usize>(&mut self, address: u8, value: impl Fn(usize) -> [u8; N]) -> Result<(), BusGone> {
        self.set_of(|_| true, address, value)
    }

    /// Sets the same registers of some servos; nobody answers.
    pub(crate) fn set_of<const N: usize>(
        &mut self,
        which: impl Fn(usize) -> bool,
        address: u8,
        value: impl Fn(usize) -> [u8; N],
    ) -> Result<(), BusGone> {
        self.parts.clear();
        for (k, id) in self.ids.iter().enumerate().filter(|(k, _)| which(*k)) {
            self.parts.push(*id);
            self.parts.extend(value(k));
        }
        self.bytes.clear();
        self.protocol.put_about(&mut self.bytes, ALL, SYNC_WRITE, Block { address, n: N }, &self.parts);
        self.port.send(&self.bytes)
    }

    /// Tells one servo something without parameters; whether anything came back in time.
    pub(crate) fn tell_one(&mut self, id: u8, instruction: u8) -> Result<bool, BusGone> {
        self.bytes.clear();
        self.protocol.put(&mut self.bytes, id, instruction, &[]);
        let (protocol, until_ns) = (self.protocol, monotonic_ns() + self.timeout_ns);
        self.question(until_ns, |received| protocol.answers(received, 0).any(|answer| answer.id == id))
    }

    /// Asks all servos for the same registers; whether all have answered in time. [`Line::answers`] has what they said.
    pub(crate) fn ask_all(&mut self, block: Block) -> Result<bool, BusGone> {
        self.ask_all_for(block, self.timeout_ns)
    }

    /// The same with so much patience, ns.
    pub(super) fn ask_all_for(&mut self, block: Block, patience_ns: i64) -> Result<bool, BusGone> {
        // Lent for the question, and given back whatever comes of it.
        let (ids, protocol) = (core::mem::take(&mut self.ids), self.protocol);
        self.bytes.clear();
        protocol.put_about(&mut self.bytes, ALL, SYNC_READ, block, &ids);
        let asked = self.question(monotonic_ns() + patience_ns, |received| {
            ids.iter().all(|id| protocol.answers(received, block.n).any(|answer| answer.id == *id))
        });
        self.ids = ids;
        asked
    }

    /// Every whole answer to the newest question for so many registers, with the place of its servo.
    pub(crate) fn answers(&self, n: usize) -> impl Iterator<Item = (usize, Answer<'_>)> {
        self.protocol.answers(&self.received, n).filter_map(|answer| {
            let k = self.ids.iter().position(|id| *id == answer.id)?;
            Some((k, answer))
        })
    }

    /// Asks one servo for registers; then a second answer is waited for.
    pub(super) fn ask_one(&mut self, id: u8, block: Block, linger_ns: i64) -> Result<Said, BusGone> {
        let protocol = self.protocol;
        self.bytes.clear();
        protocol.put_about(&mut self.bytes, id, READ, block, &[]);
        let until_ns = monotonic_ns() + self.timeout_ns;
        if self.question(until_ns, |received| protocol.answers(received, block.n).any(|answer| answer.id == id))? {
            let until_ns = monotonic_ns() + linger_ns;
            while monotonic_ns() < until_ns {
                self.port.receive(&mut self.received, until_ns)?;
            }
        }
        let mut found = protocol.answers(&self.received, block.n).filter(|answer| answer.id == id);
        let first = found.next().map(|answer| answer.data.to_vec());
        let n_more = found.count();
        // Bytes besides the question's own echo that are no answer.
        let is_noise = first.is_none() && self.received.len() > self.bytes.len();
        Ok(match first {
            Some(data) if n_more == 0 => Said::One(data),
            None if !is_noise => Said::Nothing,
            first => Said::TooMuch(n_more + usize::from(first.is_some())),
        })
    }

    /// Sends a question without parameters to everybody; whether anything but its own echo came back within a time.
    pub(super) fn ask_anybody(&mut self, instruction: u8, patience_ns: i64) -> Result<bool, BusGone> {
        self.bytes.clear();
        self.protocol.put(&mut self.bytes, ALL, instruction, &[]);
        let sent = self.bytes.clone();
        let is_more = |received: &[u8]| received.len() > sent.len() || !sent.starts_with(received);
        // With protocol 2 each has a time of its own to answer in, and none must speak into the next question.
        let waits_for_all = self.protocol == Protocol::Two;
        self.question(monotonic_ns() + patience_ns, |received| !waits_for_all && is_more(received))?;
        let any = is_more(&self.received);
        self.recover()?;
        Ok(any)
    }

    /// Sends a question and receives until `enough` says so of all that was received, or time is over.
    fn question(&mut self, until_ns: i64, enough: impl Fn(&[u8]) -> bool) -> Result<bool, BusGone> {
        self.port.forget()?;
        self.received.clear();
        self.port.send(&self.bytes)?;
        while !enough(&self.received) {
            if !self.port.receive(&mut self.received, until_ns)? && monotonic_ns() >= until_ns {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Silence: receives and throws away until nothing comes any more.
    pub(crate) fn recover(&mut self) -> Result<(), BusGone> {
        let until_ns = monotonic_ns() + self.timeout_ns;
        self.received.clear();
        while monotonic_ns() < until_ns && self.port.receive(&mut self.received, monotonic_ns() + QUIET_NS)? {
            self.received.clear();
        }
        self.port.forget()
    }

    /// Time of so many bytes, ns.
    pub(super) fn time_ns(&self, n_bytes: usize) -> i64 {
        wire_ns(n_bytes, self.baud)
    }
}

/// Time of so many bytes on the wire, ns.
fn wire_ns(n_bytes: usize, baud: u32) -> i64 {
    n_bytes as i64 * 10_000_000_000 / i64::from(baud)
}

/// Time of one cycle of so many servos without return delay, on the wire and in the adapter, ns: a value of `told` bytes is set,
/// and one of `asked` bytes read, of each.
pub(crate) fn exchange_ns(protocol: Protocol, n: usize, (told, asked): (usize, usize), baud: u32) -> i64 {
    let question = protocol.question_bytes() + 2 * protocol.address_bytes();
    let bytes = (question + (1 + told) * n) + (question + n) + n * (protocol.answer_bytes() + asked);
    wire_ns(bytes, baud) + USB_NS
}
