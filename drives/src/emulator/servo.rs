//! One emulated servo: its registers, the motion behind them, and what is wrong with it.

use super::dynamixel;
use super::registers::{Register, Registers};
use crate::serial::ServoMake;
use core::time::Duration;

/// Registers of a servo.
pub(super) const N_REGISTERS: usize = 256;
/// Bit of the error: overload.
pub(super) const OVERLOAD: u8 = 1 << 5;
/// At a stop it presses with this part of its largest for each count that its goal lies behind.
const PRESSED_PER_COUNT: f64 = 0.02;

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
    /// It does not take what it is told for this register, as where the word is spoilt on its way.
    pub refuses: Option<u8>,
    /// Its encoder reads what it read.
    pub is_stuck: bool,
    /// Error of an STS3215 in every reply, bit 0 supply, 1 encoder, 2 heat, 3 current, 5 overload; hardware error of an XL330, bit 0
    /// supply, 2 heat, 3 encoder, 4 electrical shock, 5 overload.
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
    /// All of them from the first on, where somebody wants them kept.
    pub all_told: Option<Vec<ToldGoal>>,
    /// What it presses with against a stop, as `load`.
    pub(super) pressed: f64,
    pub(super) make: ServoMake,
    pub(super) stepped_ns: Option<i64>,
    /// When it was last told anything, ns.
    pub(super) heard_ns: i64,
}

impl Servo {
    /// A sound STS3215 at a place, as it comes from the maker but for its id.
    pub fn new(id: u8, place: f64) -> Self {
        Self::of(ServoMake::Sts3215, id, place)
    }

    /// A sound servo of a make at a place, as it comes from the maker but for its id; an XL330 answers without delay.
    pub fn of(make: ServoMake, id: u8, place: f64) -> Self {
        let mut servo = Self {
            registers: [0; N_REGISTERS],
            faults: Faults::default(),
            place,
            load: 0.0,
            overload: f64::INFINITY,
            stops: [f64::NEG_INFINITY, f64::INFINITY],
            n_goals: 0,
            told: [ToldGoal::default(); 3],
            all_told: None,
            pressed: 0.0,
            make,
            stepped_ns: None,
            heard_ns: 0,
        };
        servo.fill_in(id);
        servo.show();
        servo
    }

    /// Its number on the bus.
    pub fn id(&self) -> u8 {
        self.registers[self.table().id]
    }

    /// Makes a stranger of it.
    pub fn set_model(&mut self, model: u16) {
        let at = self.table().model;
        self.registers[at..at + 2].copy_from_slice(&model.to_le_bytes());
    }

    /// The goal that it holds, counts.
    pub fn goal(&self) -> i32 {
        self.get(self.table().goal)
    }

    /// Whether it is under power.
    pub fn is_powered(&self) -> bool {
        self.registers[self.table().torque] == 1
    }

    /// Its supply goes and comes back: no power, no goal, and the turns are forgotten, which one turn never shows.
    pub fn brown_out(&mut self) {
        match self.make {
            ServoMake::Sts3215 => {
                self.registers[40..56].fill(0);
                let most = [self.registers[16], self.registers[17]];
                self.registers[48..50].copy_from_slice(&most);
            }
            ServoMake::Xl330 => {
                dynamixel::start_anew(self);
                self.show();
            }
        }
    }

    /// The registers that a host reads at an address.
    pub(super) fn read(&self, address: usize, n: usize) -> Vec<u8> {
        let end = (address + n).min(N_REGISTERS);
        (address.min(end)..end).map(|at| self.registers[self.behind(at)]).collect()
    }

    /// Writes what a host wants written, where that may be.
    pub(super) fn write(&mut self, address: usize, data: &[u8]) {
        let end = (address + data.len()).min(N_REGISTERS);
        let is_refused = self.faults.refuses.is_some_and(|at| (address..end).contains(&usize::from(at)));
        if is_refused || address >= end || (self.make == ServoMake::Xl330 && !dynamixel::may_write(self, address, data))
        {
            return;
        }
        for (at, byte) in (address..end).zip(data) {
            self.registers[self.behind(at)] = *byte;
        }
        let Registers { goal, torque, .. } = *self.table();
        if (address..end).contains(&goal.at) {
            self.n_goals += 1;
            let newest = ToldGoal { at_ns: self.stepped_ns.unwrap_or(0), place: self.place, goal: self.goal() };
            self.told = [newest, self.told[0], self.told[1]];
            self.all_told.iter_mut().for_each(|all| all.push(newest));
        }
        if (address..end).contains(&torque) && self.is_powered() && self.make == ServoMake::Sts3215 {
            // Power that is switched on again forgives the overload.
            self.faults.error &= !OVERLOAD;
        }
    }

    /// Something was said on the wire.
    pub(super) fn hear(&mut self, now_ns: i64) {
        self.heard_ns = now_ns;
    }

    /// Lets time pass up to an instant.
    pub(super) fn step(&mut self, now_ns: i64) {
        let before_ns = self.stepped_ns.unwrap_or(now_ns);
        self.stepped_ns = Some(before_ns.max(now_ns));
        if self.is_powered() && self.whole_load().abs() > self.overload {
            self.registers[self.table().torque] = 0;
            self.faults.error |= OVERLOAD;
        }
        // A watchdog that ran out between two requests stopped the motor then.
        let gives_up_ns = dynamixel::gives_up_ns(self).unwrap_or(i64::MAX);
        self.run((gives_up_ns.min(now_ns) - before_ns).max(0) as f64 * 1e-9);
        if now_ns > gives_up_ns {
            dynamixel::give_up(self);
        }
        if self.make == ServoMake::Xl330 {
            dynamixel::shut_down(self);
        }
        self.show();
    }

    /// Runs towards its goal for a time.
    fn run(&mut self, elapsed_s: f64) {
        self.pressed = 0.0;
        if !self.is_powered() {
            return;
        }
        let Registers { speed, speed_step, most_counts_per_s, .. } = *self.table();
        let wanted = f64::from(self.get(speed)) * speed_step;
        let speed = if wanted > 0.0 { wanted.min(most_counts_per_s) } else { most_counts_per_s };
        // In one turn the goal is the nearest place with that count.
        let counts_per_turn = f64::from(ServoMake::COUNTS_PER_TURN);
        let turns = (self.place / counts_per_turn).floor() * counts_per_turn;
        let way = f64::from(self.goal()) + turns - self.place;
        let [low, high] = self.stops;
        self.place = (self.place + way.clamp(-speed * elapsed_s, speed * elapsed_s)).clamp(low, high);
        if self.place <= low || self.place >= high {
            let most = self.most_load();
            let left = f64::from(self.goal()) + turns - self.place;
            self.pressed = (left * PRESSED_PER_COUNT).clamp(-most, most);
        }
    }

    /// What it carries and what it presses with.
    pub(super) fn whole_load(&self) -> f64 {
        self.load + self.pressed
    }

    /// The part of its largest torque that it may use.
    fn most_load(&self) -> f64 {
        match self.make {
            ServoMake::Sts3215 => f64::from(self.get(Register { at: 48, n: 2 })) * 1e-3,
            ServoMake::Xl330 => dynamixel::most_load(self),
        }
    }

    /// The line pulls at it from now on.
    pub(super) fn carry(&mut self, load: f64) {
        self.load = load;
        self.show();
    }

    fn show(&mut self) {
        let position = if self.faults.is_stuck {
            self.get(self.table().position)
        } else {
            self.place.round().rem_euclid(f64::from(ServoMake::COUNTS_PER_TURN)) as i32
        };
        self.set(self.table().position, position);
        match self.make {
            ServoMake::Sts3215 => {
                let whole = self.whole_load();
                let load = (whole.abs() * 1000.0).min(1000.0) as i32 | if whole < 0.0 { 1 << 10 } else { 0 };
                self.set(Register { at: 60, n: 2 }, load);
                self.set(Register { at: 69, n: 2 }, (whole.abs() * 400.0) as i32);
            }
            ServoMake::Xl330 => dynamixel::show(self),
        }
    }

    pub(super) fn table(&self) -> &'static Registers {
        Registers::of(self.make)
    }

    /// Where a register really is.
    fn behind(&self, at: usize) -> usize {
        match self.make {
            ServoMake::Sts3215 => at,
            ServoMake::Xl330 => dynamixel::behind(self, at),
        }
    }

    /// A number in its registers, without a sign.
    pub(super) fn get(&self, Register { at, n }: Register) -> i32 {
        let bytes = &self.registers[at..at + n];
        bytes.iter().rev().fold(0, |number: i32, byte| number << 8 | i32::from(*byte))
    }

    pub(super) fn set(&mut self, Register { at, n }: Register, number: i32) {
        self.registers[at..at + n].copy_from_slice(&number.to_le_bytes()[..n]);
    }

    fn fill_in(&mut self, id: u8) {
        match self.make {
            ServoMake::Sts3215 => {
                self.registers[0..2].copy_from_slice(&[3, 10]);
                self.registers[8] = 1;
                self.registers[11..13].copy_from_slice(&4095_u16.to_le_bytes());
                self.registers[16..18].copy_from_slice(&1000_u16.to_le_bytes());
                self.registers[48..50].copy_from_slice(&1000_u16.to_le_bytes());
                (self.registers[62], self.registers[63]) = (74, 31);
            }
            ServoMake::Xl330 => dynamixel::fill_in(self),
        }
        self.set_model(self.make.models()[0].0);
        self.registers[self.table().id] = id;
    }
}
