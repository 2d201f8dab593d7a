//! One emulated servo: its registers, the motion behind them, and what is wrong with it.

use crate::sts3215::packet::signed;
use crate::sts3215::{COUNTS_PER_TURN, MODEL};
use core::time::Duration;

/// Registers of a servo.
const N_REGISTERS: usize = 256;
// Registers by the maker's names.
const TORQUE: usize = 40;
const GOAL: usize = 42;
const SPEED: usize = 46;
const LIMIT: usize = 48;
const POSITION: usize = 56;
const LOAD: usize = 60;
const SUPPLY: usize = 62;
const HEAT: usize = 63;
const CURRENT: usize = 69;
/// Largest speed, counts/s: 60 degrees in 0.222 s at 7.4 V.
const MOST_COUNTS_PER_S: f64 = 3075.0;
/// At a stop it presses with this part of its largest for each count that its goal lies behind.
const PRESSED_PER_COUNT: f64 = 0.02;
/// Bit of the error byte: overload.
const OVERLOAD: u8 = 1 << 5;

/// What is wrong with a servo; by default nothing. A number counts the replies that are still spoilt.
#[derive(Clone, Copy, Debug, Default)]
pub struct Faults {
    /// A wrong checksum.
    pub bad_checksum: u32,
    /// Half of the bytes.
    pub cut_short: u32,
    /// A stray byte before it, as a half-duplex line gives when it turns round.
    pub stray_byte: u32,
    /// It comes in two pieces, `late` apart.
    pub two_pieces: u32,
    /// It claims to be from another servo.
    pub other_id: u32,
    /// It announces more bytes than come.
    pub wrong_length: u32,
    /// Nothing comes: unplugged.
    pub is_silent: bool,
    /// Every reply comes so much later.
    pub late: Duration,
    /// It does not hear goals: `SYNC WRITE` is lost on its way.
    pub is_deaf: bool,
    /// Its encoder reads what it read.
    pub is_stuck: bool,
    /// Error byte of every reply: bit 0 supply, 1 encoder, 2 heat, 3 current, 5 overload.
    pub error: u8,
}

/// A goal that a servo was told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToldGoal {
    /// When, CLOCK_MONOTONIC, nanoseconds.
    pub at_ns: i64,
    /// Where the shaft was then, counts.
    pub place: f64,
    /// The goal, counts.
    pub goal: i32,
}

/// A servo.
#[derive(Clone, Debug)]
pub struct Servo {
    /// Its registers, as of the newest step.
    pub registers: [u8; N_REGISTERS],
    /// What is wrong with it.
    pub faults: Faults,
    /// True angle of the shaft, counts, any number of turns.
    pub place: f64,
    /// With what it pulls at its line, part of its largest, in the direction in which that drives the encoder; beyond `overload` it
    /// lets go.
    pub load: f64,
    /// Load beyond which it lets go.
    pub overload: f64,
    /// Mechanical stops: the shaft goes no further down and up than these, counts, and presses against them.
    pub stops: [f64; 2],
    /// Number of goals that it was told.
    pub n_goals: u64,
    /// The newest of them, and the two before.
    pub told: [ToldGoal; 3],
    /// What it presses with against a stop, as `load`.
    pressed: f64,
    stepped_ns: Option<i64>,
}

impl Servo {
    /// A sound servo at a place, as it comes from the maker but for its id.
    pub fn new(id: u8, place: f64) -> Self {
        let mut registers = [0; N_REGISTERS];
        registers[0..2].copy_from_slice(&[3, 10]);
        registers[3..5].copy_from_slice(&MODEL.to_le_bytes());
        registers[5] = id;
        registers[8] = 1;
        registers[11..13].copy_from_slice(&4095_u16.to_le_bytes());
        registers[16..18].copy_from_slice(&1000_u16.to_le_bytes());
        registers[LIMIT..LIMIT + 2].copy_from_slice(&1000_u16.to_le_bytes());
        (registers[SUPPLY], registers[HEAT]) = (74, 31);
        let mut servo = Self {
            registers,
            faults: Faults::default(),
            place,
            load: 0.0,
            overload: f64::INFINITY,
            stops: [f64::NEG_INFINITY, f64::INFINITY],
            n_goals: 0,
            told: [ToldGoal::default(); 3],
            pressed: 0.0,
            stepped_ns: None,
        };
        servo.show();
        servo
    }

    /// Its number on the bus.
    pub fn id(&self) -> u8 {
        self.registers[5]
    }

    /// The goal that it holds, counts.
    pub fn goal(&self) -> i32 {
        signed(self.word(GOAL), 15)
    }

    /// Whether it is under power.
    pub fn is_powered(&self) -> bool {
        self.registers[TORQUE] == 1
    }

    /// Its supply goes and comes back: no power, no goal, and the turns are forgotten, which one turn never shows.
    pub fn brown_out(&mut self) {
        self.registers[TORQUE..POSITION].fill(0);
        let most = [self.registers[16], self.registers[17]];
        self.registers[LIMIT..LIMIT + 2].copy_from_slice(&most);
    }

    pub(crate) fn write(&mut self, address: usize, data: &[u8]) {
        let end = (address + data.len()).min(N_REGISTERS);
        if address >= end {
            return;
        }
        self.registers[address..end].copy_from_slice(&data[..end - address]);
        if (address..end).contains(&GOAL) {
            self.n_goals += 1;
            let newest = ToldGoal { at_ns: self.stepped_ns.unwrap_or(0), place: self.place, goal: self.goal() };
            self.told = [newest, self.told[0], self.told[1]];
        }
        if (address..end).contains(&TORQUE) && self.registers[TORQUE] == 1 {
            // Power that is switched on again forgives the overload.
            self.faults.error &= !OVERLOAD;
        }
    }

    /// Lets time pass up to an instant.
    pub(crate) fn step(&mut self, now_ns: i64) {
        let before_ns = self.stepped_ns.unwrap_or(now_ns);
        let elapsed_s = now_ns.saturating_sub(before_ns).max(0) as f64 * 1e-9;
        self.stepped_ns = Some(before_ns.max(now_ns));
        if self.is_powered() && (self.load + self.pressed).abs() > self.overload {
            self.registers[TORQUE] = 0;
            self.faults.error |= OVERLOAD;
        }
        self.pressed = 0.0;
        if self.is_powered() {
            let wanted = f64::from(self.word(SPEED));
            let speed = if wanted > 0.0 { wanted.min(MOST_COUNTS_PER_S) } else { MOST_COUNTS_PER_S };
            // In one turn the goal is the nearest place with that count.
            let turns = (self.place / f64::from(COUNTS_PER_TURN)).floor() * f64::from(COUNTS_PER_TURN);
            let way = f64::from(self.goal()) + turns - self.place;
            let [low, high] = self.stops;
            self.place = (self.place + way.clamp(-speed * elapsed_s, speed * elapsed_s)).clamp(low, high);
            if self.place <= low || self.place >= high {
                let most = f64::from(self.word(LIMIT)) * 1e-3;
                let left = f64::from(self.goal()) + turns - self.place;
                self.pressed = (left * PRESSED_PER_COUNT).clamp(-most, most);
            }
        }
        self.show();
    }

    /// The line pulls at it from now on.
    pub(crate) fn carry(&mut self, load: f64) {
        self.load = load;
        self.show();
    }

    fn show(&mut self) {
        let position = if self.faults.is_stuck {
            self.word(POSITION)
        } else {
            self.place.round().rem_euclid(f64::from(COUNTS_PER_TURN)) as u16
        };
        let whole = self.load + self.pressed;
        let load = (whole.abs() * 1000.0).min(1000.0) as u16 | if whole < 0.0 { 1 << 10 } else { 0 };
        let current = (whole.abs() * 400.0) as u16;
        for (address, value) in [(POSITION, position), (LOAD, load), (CURRENT, current)] {
            self.registers[address..address + 2].copy_from_slice(&value.to_le_bytes());
        }
    }

    fn word(&self, address: usize) -> u16 {
        u16::from_le_bytes([self.registers[address], self.registers[address + 1]])
    }
}
