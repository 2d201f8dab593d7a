//! Emulated drives in a time of their own: cycles as the bus's thread does them, judged as there.

mod emergencies;
mod faults;
mod opening;
mod relaxing;
mod returning;
mod twelve;

use super::*;
use crate::BusSetup;
use crate::cycles::Cycles;
use crate::emulator::{CanBus, CanDrive, CanWire};
use crate::exchange::{Exchange, Phase, Report, Wish};
use core::sync::atomic::{AtomicI64, Ordering};
use krait_ipc::message::Actuators;
use krait_slave::{ActuatorConfig, ActuatorState, DriveConfig, DriveKind, SlaveConfig, lines};
use std::sync::Arc;

const MS: i64 = 1_000_000;
const ZERO: i32 = 100_000;
/// Counts of a metre: 4096 a turn, 2 mm lead.
const PER_M: f64 = 2_048_000.0;

/// Three drives near their zero and the configuration that goes with them.
pub(super) fn three() -> (CanBus, SlaveConfig) {
    several(3)
}

/// The same for so many; more than three need cycles of twice the length.
fn several(n: u8) -> (CanBus, SlaveConfig) {
    let bus = CanBus::new((1..=n).map(|id| CanDrive::new(id, f64::from(ZERO) + f64::from(id))).collect());
    let actuator = |id| ActuatorConfig {
        id,
        zero_count: Some(ZERO),
        lead_m: Some(0.002),
        vendor: Some(0x555),
        product: Some(1),
        efficiency: 0.8,
        ..ActuatorConfig::default()
    };
    let drive = DriveConfig {
        kind: DriveKind::Cia402,
        interface: Some("vcan0".to_owned()),
        period_ms: if n > 3 { 4.0 } else { 2.0 },
        timeout_ms: 1.5,
        heartbeat_ms: 10,
        gives_up_ms: 50,
        speed_counts_per_s: 200_000.0,
        actuator: (1..=u32::from(n)).map(actuator).collect(),
        ..DriveConfig::default()
    };
    (bus, SlaveConfig { drive, ..SlaveConfig::default() })
}

struct Bench {
    bus: CanBus,
    cycles: Cycles<Cia402<CanWire>>,
    exchange: Arc<Exchange>,
    clock: Arc<AtomicI64>,
    wish: Wish,
    period_ns: i64,
    /// Targets that the first three hold, after each cycle.
    targets: Vec<[i32; 3]>,
}

impl Bench {
    /// Opened, without power.
    fn new() -> Self {
        Self::of(3)
    }

    fn of(n: u8) -> Self {
        Self::with(several(n))
    }

    fn with((bus, config): (CanBus, SlaveConfig)) -> Self {
        emergencies::keep_log();
        let period_ns = (config.drive.period_ms * 1e6) as i64;
        let (wire, clock) = bus.own_time();
        let setup: BusSetup = open::setup(&config).unwrap_or_else(|error| panic!("{error}"));
        let (can, seen) = Cia402::open(&config, wire).unwrap_or_else(|error| panic!("{error}"));
        let exchange = Arc::new(Exchange::new(&Wish::default(), &Report::blank()));
        let cycles = Cycles::new(can, setup, Arc::clone(&exchange), seen, clock.load(Ordering::Relaxed));
        let wish = Wish { q_m: [f64::NAN; 12], ..Wish::default() };
        Self { bus, cycles, exchange, clock, wish, period_ns, targets: Vec::new() }
    }

    fn powered() -> Self {
        let mut bench = Self::new();
        bench.power_up();
        bench
    }

    /// Switches power anew; the cycles until all are enabled.
    fn power_up(&mut self) -> usize {
        self.wish = Wish { turn: self.wish.turn + 1, has_power: true, q_m: [f64::NAN; 12], ..Wish::default() };
        let n = (1..200).find(|_| {
            self.step();
            self.bus.lock().drives.iter().all(|drive| drive.state() == State::OperationEnabled)
        });
        // The last answers are seen a cycle later.
        self.steps(3);
        assert_eq!(self.report().phase, Phase::On, "{:?}", self.report());
        n.unwrap()
    }

    fn now_ns(&self) -> i64 {
        self.clock.load(Ordering::Relaxed)
    }

    /// A cycle with a sign of life of the slave.
    fn step(&mut self) -> Report {
        let due_ns = (self.now_ns() / self.period_ns + 1) * self.period_ns;
        self.clock.store(due_ns, Ordering::Relaxed);
        self.wish.stamp_ns = due_ns;
        self.exchange.wish.put(&self.wish);
        let clock = Arc::clone(&self.clock);
        self.cycles.step(due_ns, || clock.load(Ordering::Relaxed));
        self.clock.fetch_add(1, Ordering::Relaxed);
        let drives = self.bus.lock();
        self.targets.push(core::array::from_fn(|k| drives.drives[k].target()));
        drop(drives);
        self.report()
    }

    fn steps(&mut self, n: usize) {
        for _ in 0..n {
            self.step();
        }
    }

    fn report(&self) -> Report {
        self.exchange.report.get().unwrap()
    }

    /// So many cycles of motion at 20 mm/s in a plane.
    fn go(&mut self, n: usize) {
        for _ in 0..n {
            let before_m = if self.wish.is_somewhere() { self.wish.q_m[0] } else { 0.0 };
            let way_m = before_m + 0.02 * 2e-3;
            self.wish.q_m = lines([way_m, -0.5 * way_m, -0.5 * way_m]);
            self.step();
        }
    }

    fn states(&self) -> [State; 3] {
        let drives = self.bus.lock();
        core::array::from_fn(|k| drives.drives[k].state())
    }

    fn places(&self) -> [f64; 3] {
        let drives = self.bus.lock();
        core::array::from_fn(|k| drives.drives[k].place)
    }

    fn q_m(&self) -> Actuators {
        self.report().q_m
    }
}

#[test]
fn power_comes_in_six_cycles_and_moves_nothing_and_goes_in_three() {
    let mut bench = Bench::new();
    let before = bench.places();
    assert_eq!(bench.power_up(), 5, "the sixth answer says so");
    assert_eq!(bench.places(), before);
    assert_eq!(bench.report().state[..3], [ActuatorState::On; 3]);
    bench.wish = Wish { turn: 2, ..bench.wish };
    bench.wish.has_power = false;
    bench.steps(3);
    assert_eq!(bench.states(), [State::SwitchOnDisabled; 3]);
    assert!(bench.cycles.is_off());
    assert_eq!(bench.places(), before);
}

#[test]
fn targets_are_reached_one_sync_later_in_counts_and_metres_and_loads_come_from_the_torque() {
    let mut bench = Bench::powered();
    // Within the rate: 25 mm/s for a period of 2 ms.
    bench.wish.q_m = lines([0.5e-4, -0.25e-4, -0.25e-4]);
    bench.steps(2);
    let expected = [0.5e-4, -0.25e-4, -0.25e-4].map(|q_m: f64| ZERO + (q_m * PER_M).round() as i32);
    assert_eq!(bench.targets.last(), Some(&expected));
    for (k, expected) in expected.into_iter().enumerate() {
        assert_eq!(bench.places()[k].round() as i32, expected);
        assert!((bench.q_m()[k] - bench.wish.q_m[k]).abs() < 1.0 / PER_M);
    }
    // Rated torque 0.1 N m by object 6076; a screw of 2 mm lead; 10 per mille.
    bench.bus.lock().drives[0].permille_per_count = 10.0 / f64::from(expected[0]);
    bench.steps(2);
    let tau_n = bench.report().tau_n[0];
    let by_hand = 0.010 * 0.1 * core::f64::consts::TAU / 0.002 * 0.8;
    assert!((tau_n / by_hand - 1.0).abs() < 0.11, "{tau_n} N, expected {by_hand} N to a thousandth of the torque");
    assert_eq!(bench.report().failure, None);
}

#[test]
fn a_cycle_is_a_target_each_and_a_sync_and_now_and_then_a_heartbeat() {
    let mut bench = Bench::powered();
    let before = bench.bus.lock().n_frames;
    bench.steps(100);
    assert_eq!(bench.bus.lock().n_frames - before, 100 * 4 + 20, "10 ms are 5 cycles");
}
