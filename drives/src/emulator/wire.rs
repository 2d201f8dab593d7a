//! The wire that emulated servos share: requests in, replies with the instants at which they reach the host.

use crate::emulator::{Coupling, Servo};
use crate::sts3215::packet::{ALL, FRAME, READ, SYNC_READ, SYNC_WRITE, WRITE, checksum, put};
use core::time::Duration;

const PING: u8 = 0x01;
/// Unit of a servo's return delay.
const DELAY_UNIT_NS: i64 = 2_000;

/// A bus with its servos.
#[derive(Clone, Debug)]
pub struct ServoWire {
    /// Bit rate of the servos; a host at another one gets no answer.
    pub baud: u32,
    /// How long the USB adapter holds received bytes.
    pub usb_latency: Duration,
    /// Whether the adapter hands the host's own bytes back.
    pub echoes: bool,
    /// Its servos.
    pub servos: Vec<Servo>,
    /// What their shafts pull at; none: each keeps the load that it was given.
    pub coupling: Option<Coupling>,
    /// Requests that were understood.
    pub n_requests: u64,
    busy_until_ns: i64,
}

/// Bytes for the host.
#[derive(Debug)]
pub(crate) struct Piece {
    pub due_ns: i64,
    pub bytes: Vec<u8>,
}

/// A request of the host.
#[derive(Debug)]
pub(crate) struct Request {
    id: u8,
    instruction: u8,
    parameters: Vec<u8>,
    bytes: Vec<u8>,
}

/// Takes the next whole request out of what the host has sent.
pub(crate) fn next_request(pending: &mut Vec<u8>) -> Option<Request> {
    loop {
        let begin = pending.windows(2).position(|pair| pair == [0xFF, 0xFF])?;
        pending.drain(..begin);
        let n = 4 + usize::from(*pending.get(3)?);
        if pending.len() < n {
            return None;
        }
        let is_whole = n >= FRAME && checksum(&pending[2..n - 1]) == pending[n - 1];
        if !is_whole {
            pending.drain(..1);
            continue;
        }
        let bytes: Vec<u8> = pending.drain(..n).collect();
        return Some(Request { id: bytes[2], instruction: bytes[4], parameters: bytes[5..n - 1].to_vec(), bytes });
    }
}

impl ServoWire {
    /// Sound servos at 1 Mbaud behind an adapter that holds nothing back.
    pub fn new(servos: Vec<Servo>) -> Self {
        let usb_latency = Duration::ZERO;
        Self { baud: 1_000_000, usb_latency, echoes: false, servos, coupling: None, n_requests: 0, busy_until_ns: 0 }
    }

    /// The servo with an id.
    pub fn servo(&mut self, id: u8) -> Option<&mut Servo> {
        self.servos.iter_mut().find(|servo| servo.id() == id)
    }

    fn time_of_ns(&self, n_bytes: usize) -> i64 {
        n_bytes as i64 * 10_000_000_000 / i64::from(self.baud)
    }

    /// What a request does, and what comes back.
    pub(crate) fn replies(&mut self, request: &Request, host_baud: u32, arrived_ns: i64) -> Vec<Piece> {
        let mut at_ns = self.busy_until_ns.max(arrived_ns) + self.time_of_ns(request.bytes.len());
        let mut pieces = Vec::new();
        if self.echoes {
            pieces.push(Piece { due_ns: at_ns + ns(self.usb_latency), bytes: request.bytes.clone() });
        }
        self.busy_until_ns = at_ns;
        if host_baud != self.baud {
            return pieces;
        }
        self.n_requests += 1;
        self.servos.iter_mut().for_each(|servo| servo.step(at_ns));
        if let Some(coupling) = &self.coupling {
            let places: Vec<f64> = self.servos.iter().map(|servo| servo.place).collect();
            let loads = coupling.loads(&places);
            self.servos.iter_mut().zip(loads).for_each(|(servo, load)| servo.carry(load));
        }
        for (id, registers) in self.execute(request) {
            self.reply(id, registers, &mut at_ns, &mut pieces);
        }
        self.busy_until_ns = at_ns;
        pieces
    }

    /// Executes a request; who answers, with which registers.
    fn execute(&mut self, request: &Request) -> Vec<(u8, Option<(usize, usize)>)> {
        let p = &request.parameters;
        let block = |at: usize| Some((usize::from(*p.get(at)?), usize::from(*p.get(at + 1)?)));
        match (request.instruction, request.id) {
            (PING, ALL) => {
                let mut ids: Vec<u8> = self.servos.iter().map(Servo::id).collect();
                ids.dedup();
                ids.into_iter().map(|id| (id, None)).collect()
            }
            (PING, id) => vec![(id, None)],
            (READ, id) => block(0).map(|block| (id, Some(block))).into_iter().collect(),
            (WRITE, id) if !p.is_empty() => {
                for servo in self.servos.iter_mut().filter(|servo| servo.id() == id && !servo.faults.is_silent) {
                    servo.write(usize::from(p[0]), &p[1..]);
                }
                vec![(id, None)]
            }
            (SYNC_READ, ALL) => match block(0) {
                Some(block) => p[2..].iter().map(|id| (*id, Some(block))).collect(),
                None => Vec::new(),
            },
            (SYNC_WRITE, ALL) => {
                let Some((address, n)) = block(0) else { return Vec::new() };
                for item in p[2..].chunks_exact(n + 1) {
                    let hears =
                        |servo: &&mut Servo| servo.id() == item[0] && !servo.faults.is_silent && !servo.faults.is_deaf;
                    self.servos.iter_mut().filter(hears).for_each(|servo| servo.write(address, &item[1..]));
                }
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// The reply of all servos with an id; several speak at once, and their bytes collide.
    fn reply(&mut self, id: u8, registers: Option<(usize, usize)>, at_ns: &mut i64, pieces: &mut Vec<Piece>) {
        let mut bytes: Option<Vec<u8>> = None;
        let (mut late_ns, mut gap_ns) = (0, None);
        for servo in self.servos.iter_mut().filter(|servo| servo.id() == id && !servo.faults.is_silent) {
            let own = reply_of(servo, registers);
            bytes = Some(bytes.map_or(own.clone(), |other| collided(&other, &own)));
            late_ns = ns(servo.faults.late) + DELAY_UNIT_NS * i64::from(servo.registers[7]);
            if take(&mut servo.faults.two_pieces) {
                (gap_ns, late_ns) = (Some(late_ns), 0);
            }
        }
        let Some(bytes) = bytes else { return };
        *at_ns += late_ns + self.time_of_ns(bytes.len());
        let due_ns = *at_ns + ns(self.usb_latency);
        match gap_ns {
            None => pieces.push(Piece { due_ns, bytes }),
            Some(gap_ns) => {
                let (first, second) = bytes.split_at(bytes.len() / 2);
                pieces.push(Piece { due_ns, bytes: first.to_vec() });
                *at_ns += gap_ns;
                pieces.push(Piece { due_ns: due_ns + gap_ns, bytes: second.to_vec() });
            }
        }
    }
}

fn reply_of(servo: &mut Servo, registers: Option<(usize, usize)>) -> Vec<u8> {
    let data = registers.map_or(&[][..], |(address, n)| {
        let end = (address + n).min(servo.registers.len());
        &servo.registers[address.min(end)..end]
    });
    let faults = &mut servo.faults;
    let own_id = servo.registers[5];
    let id = if take(&mut faults.other_id) { own_id.wrapping_add(100) } else { own_id };
    let mut bytes = Vec::new();
    put(&mut bytes, id, faults.error, &[data]);
    if take(&mut faults.bad_checksum) {
        let last = bytes.len() - 1;
        bytes[last] ^= 0x5A;
    }
    if take(&mut faults.wrong_length) {
        bytes[3] = 250;
    }
    if take(&mut faults.cut_short) {
        bytes.truncate(bytes.len() / 2);
    }
    if take(&mut faults.stray_byte) {
        bytes.insert(0, 0x00);
    }
    bytes
}

/// Two that speak at once, one of them a byte later: the wire is low where any of them pulls it down.
fn collided(one: &[u8], other: &[u8]) -> Vec<u8> {
    let n = one.len().max(other.len() + 1);
    (0..n)
        .map(|k| {
            let late = k.checked_sub(1).and_then(|k| other.get(k));
            one.get(k).copied().unwrap_or(0xFF) & late.copied().unwrap_or(0xFF)
        })
        .collect()
}

fn ns(time: Duration) -> i64 {
    time.as_nanos() as i64
}

fn take(n: &mut u32) -> bool {
    let any = *n > 0;
    *n = n.saturating_sub(1);
    any
}
