//! The wire that emulated servos share: requests in, replies with the instants at which they reach the host.

use super::dynamixel;
use crate::emulator::{Coupling, Servo};
use crate::serial::{ALL, PING, Protocol, READ, SYNC_READ, SYNC_WRITE, ServoMake, WRITE};
use crate::sts3215::packet as one;
use crate::xl330::packet as two;
use crate::xl330::{REBOOT, packet::STATUS};
use core::time::Duration;

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
    protocol: Protocol,
    id: u8,
    instruction: u8,
    parameters: Vec<u8>,
    bytes: Vec<u8>,
}

/// Takes the next whole request, of either protocol, out of what the host has sent.
pub(crate) fn next_request(pending: &mut Vec<u8>) -> Option<Request> {
    loop {
        let begin = pending.windows(2).position(|pair| pair == [0xFF, 0xFF])?;
        pending.drain(..begin);
        // No servo has the id FD.
        let is_two = *pending.get(2)? == 0xFD;
        let n = if is_two {
            7 + usize::from(u16::from_le_bytes([*pending.get(5)?, *pending.get(6)?]))
        } else {
            4 + usize::from(*pending.get(3)?)
        };
        if pending.len() < n {
            return None;
        }
        let Some(request) = (if is_two { two_of(&pending[..n]) } else { one_of(&pending[..n]) }) else {
            pending.drain(..1);
            continue;
        };
        pending.drain(..n);
        return Some(request);
    }
}

fn one_of(bytes: &[u8]) -> Option<Request> {
    let n = bytes.len();
    let is_whole = n >= one::FRAME && one::checksum(&bytes[2..n - 1]) == bytes[n - 1];
    is_whole.then(|| Request {
        protocol: Protocol::One,
        id: bytes[2],
        instruction: bytes[4],
        parameters: bytes[5..n - 1].to_vec(),
        bytes: bytes.to_vec(),
    })
}

fn two_of(bytes: &[u8]) -> Option<Request> {
    let packet = two::packet(bytes)?;
    Some(Request {
        protocol: Protocol::Two,
        id: packet.id,
        instruction: packet.instruction,
        parameters: packet.parameters.into_owned(),
        bytes: bytes.to_vec(),
    })
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
        for servo in &mut self.servos {
            servo.step(at_ns);
            servo.hear(at_ns);
        }
        if let Some(coupling) = &self.coupling {
            let places: Vec<f64> = self.servos.iter().map(|servo| servo.place).collect();
            let loads = coupling.loads(&places);
            self.servos.iter_mut().zip(loads).for_each(|(servo, load)| servo.carry(load));
        }
        for (id, wanted) in self.execute(request) {
            self.reply(request.protocol, id, wanted, &mut at_ns, &mut pieces);
        }
        self.busy_until_ns = at_ns;
        pieces
    }

    /// Executes a request; who answers, with which registers.
    fn execute(&mut self, request: &Request) -> Vec<(u8, Wanted)> {
        let (p, protocol) = (&request.parameters, request.protocol);
        let width = protocol.address_bytes();
        let number =
            |at: usize| p.get(at..at + width).map(|bytes| bytes.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b)));
        let block = || Some((number(0)?, number(width)?));
        let rest = p.get(2 * width..).unwrap_or_default();
        match (request.instruction, request.id) {
            (PING, ALL) => {
                let own = self.servos.iter().filter(|servo| servo.make.protocol() == protocol);
                let mut ids: Vec<u8> = own.map(Servo::id).collect();
                ids.dedup();
                ids.into_iter().map(|id| (id, Wanted::Pong)).collect()
            }
            (PING, id) => vec![(id, Wanted::Pong)],
            (READ, id) => block().map(|(at, n)| (id, Wanted::Registers(at, n))).into_iter().collect(),
            (WRITE, id) if p.len() > width => {
                let address = number(0).unwrap_or_default();
                for servo in self.hearing(protocol, id) {
                    servo.write(address, &p[width..]);
                }
                vec![(id, Wanted::Nothing)]
            }
            (REBOOT, id) if protocol == Protocol::Two => {
                for servo in self.hearing(protocol, id) {
                    dynamixel::start_anew(servo);
                }
                vec![(id, Wanted::Nothing)]
            }
            (SYNC_READ, ALL) => match block() {
                Some((at, n)) => rest.iter().map(|id| (*id, Wanted::Registers(at, n))).collect(),
                None => Vec::new(),
            },
            (SYNC_WRITE, ALL) => {
                let Some((address, n)) = block() else { return Vec::new() };
                for item in rest.chunks_exact(n + 1) {
                    let hearing = self.hearing(protocol, item[0]).filter(|servo| !servo.faults.is_deaf);
                    hearing.for_each(|servo| servo.write(address, &item[1..]));
                }
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// Servos with an id that hear this protocol.
    fn hearing(&mut self, protocol: Protocol, id: u8) -> impl Iterator<Item = &mut Servo> {
        let hears =
            move |servo: &&mut Servo| servo.id() == id && servo.make.protocol() == protocol && !servo.faults.is_silent;
        self.servos.iter_mut().filter(hears)
    }

    /// The reply of all servos with an id; several speak at once, and their bytes collide.
    fn reply(&mut self, protocol: Protocol, id: u8, wanted: Wanted, at_ns: &mut i64, pieces: &mut Vec<Piece>) {
        let mut bytes: Option<Vec<u8>> = None;
        let (mut late_ns, mut gap_ns) = (0, None);
        for servo in self.hearing(protocol, id) {
            let own = reply_of(servo, wanted);
            bytes = Some(bytes.map_or(own.clone(), |other| collided(&other, &own)));
            late_ns = ns(servo.faults.late) + DELAY_UNIT_NS * i64::from(servo.registers[servo.table().return_delay]);
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

/// What a reply holds.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    Nothing,
    /// Who it is, where the protocol has that in the answer to a ping.
    Pong,
    /// Address and number.
    Registers(usize, usize),
}

fn reply_of(servo: &mut Servo, wanted: Wanted) -> Vec<u8> {
    let data = match (wanted, servo.make) {
        (Wanted::Nothing, _) | (Wanted::Pong, ServoMake::Sts3215) => Vec::new(),
        (Wanted::Pong, ServoMake::Xl330) => vec![servo.registers[0], servo.registers[1], servo.registers[6]],
        (Wanted::Registers(address, n), _) => servo.read(address, n),
    };
    let own_id = servo.id();
    let (faults, make) = (&mut servo.faults, servo.make);
    let id = if take(&mut faults.other_id) { own_id.wrapping_add(100) } else { own_id };
    let mut bytes = Vec::new();
    match make {
        ServoMake::Sts3215 => one::put(&mut bytes, id, faults.error, &[&data]),
        ServoMake::Xl330 => {
            let alert = if faults.error == 0 { 0 } else { 0x80 };
            two::put(&mut bytes, id, STATUS, &[&[alert], &data]);
        }
    }
    if take(&mut faults.bad_checksum) {
        let last = bytes.len() - 1;
        bytes[last] ^= 0x5A;
    }
    if take(&mut faults.wrong_length) {
        bytes[if make == ServoMake::Xl330 { 5 } else { 3 }] = 250;
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
