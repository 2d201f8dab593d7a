//! The thread of a serial bus must not touch the heap once it goes, whatever the servos do: a counting allocator is read in that thread, before
//! each question, so that all between two of them counts: wish, goals, packets, answers, judgement, record.

use crate::allocations::{allocations_of, allocations_so_far};
use crate::rig::{ZERO, config, on_each_make, three};
use krait_drives::emulator::{Emulator, Faults};
use krait_drives::{ActuatorBus, BusDrive, BusGone, Goals, Seen, ServoBus, ServoMake, setup_of};
use krait_ipc::clock::monotonic_ns;
use krait_slave::{Drive, Homing, Switching, lines};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// What the thread has allocated up to its newest question, and how many questions it has asked.
#[derive(Debug, Default)]
struct Counts {
    n_allocations: AtomicU64,
    n_asked: AtomicU64,
}

/// A bus that is watched in the thread that uses it.
struct Watched {
    bus: ServoBus,
    counts: Arc<Counts>,
}

impl ActuatorBus for Watched {
    fn n_actuators(&self) -> usize {
        self.bus.n_actuators()
    }

    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone> {
        self.bus.tell(goals)
    }

    fn switch(&mut self, on: bool, goals: &Goals) -> Result<(), BusGone> {
        self.bus.switch(on, goals)
    }

    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone> {
        self.counts.n_allocations.store(allocations_so_far(), Ordering::Relaxed);
        self.counts.n_asked.fetch_add(1, Ordering::Release);
        self.bus.ask(seen)
    }

    fn look_again(&mut self) {
        self.bus.look_again();
    }
}

/// A drive on such a bus.
struct Bench {
    emulator: Emulator,
    drive: BusDrive,
    counts: Arc<Counts>,
    q_m: f64,
}

impl Bench {
    fn new(make: ServoMake) -> Self {
        let emulator = Emulator::start(three(make)).unwrap();
        let config = config(make, &emulator);
        let (bus, seen) = ServoBus::open(&config.drive).unwrap();
        let counts = Arc::new(Counts::default());
        let bus = Watched { bus, counts: Arc::clone(&counts) };
        let drive = BusDrive::start(bus, setup_of(&config).unwrap(), seen, None).unwrap();
        Self { emulator, drive, counts, q_m: 0.0 }
    }

    fn power_up(&mut self) {
        let powered = (0..5000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            self.drive.set_power(monotonic_ns(), true).unwrap() == Switching::Done
        });
        assert!(powered && self.drive.home(monotonic_ns()) == Ok(Homing::Done));
    }

    /// Ticks of the slave, with slow motion where it may be, for so many cycles; what the thread has allocated from the first to the last.
    fn allocated_in(&mut self, n_cycles: u64) -> u64 {
        let asked = |counts: &Counts| counts.n_asked.load(Ordering::Acquire);
        let (begun, before) = (asked(&self.counts), self.counts.n_allocations.load(Ordering::Relaxed));
        for _ in 0..20_000 {
            if asked(&self.counts) >= begun + n_cycles {
                return self.counts.n_allocations.load(Ordering::Relaxed) - before;
            }
            std::thread::sleep(Duration::from_millis(1));
            self.q_m += 1e-6;
            // Refused where something has failed; the drives hold then.
            let _refused = self.drive.write(monotonic_ns(), lines([self.q_m, -0.5 * self.q_m, -0.5 * self.q_m]));
            self.drive.read(monotonic_ns()).unwrap();
            while self.drive.next_cycle().is_some() {}
        }
        panic!("the thread asked {} times and then no more", asked(&self.counts) - begun);
    }
}

#[test]
fn the_thread_of_a_serial_bus_allocates_nothing_in_motion_nor_when_answers_are_spoilt_or_a_servo_fails() {
    on_each_make(|make| {
        let mut bench = Bench::new(make);
        // The first cycles are the thread's own beginning.
        bench.allocated_in(3);
        assert_eq!(bench.allocated_in(5), 0, "without power");
        bench.power_up();
        assert_eq!(bench.allocated_in(40), 0, "in motion");
        let places: Vec<f64> = bench.emulator.wire().servos.iter().map(|servo| servo.place).collect();
        assert!((places[0] - f64::from(ZERO)).abs() > 3.0, "in motion: {places:?}");
        let spoilt = Faults { bad_checksum: 1, ..Faults::default() };
        bench.emulator.wire().servos[1].faults = spoilt;
        assert_eq!(bench.allocated_in(4), 0, "with an answer that is spoilt");
        bench.emulator.wire().servos[1].faults.is_silent = true;
        assert_eq!(bench.allocated_in(12), 0, "with a servo that is silent");
        let failure = bench.drive.failure().map(|failure| failure.to_string()).unwrap_or_default();
        assert!(failure.starts_with("Drive 2 failed"), "{failure}");
        bench.emulator.wire().servos[1].faults = Faults::default();
        bench.drive.set_power(monotonic_ns(), false).unwrap();
        assert_eq!(bench.allocated_in(8), 0, "while the power goes");
    });
}

#[test]
fn an_answer_with_a_header_in_it_is_taken_apart_without_the_heap() {
    let emulator = Emulator::start(three(ServoMake::Xl330)).unwrap();
    let mut drive = config(ServoMake::Xl330, &emulator).drive;
    drive.timeout_ms = 300.0;
    let (mut bus, mut seen) = ServoBus::open(&drive).unwrap();
    bus.ask(&mut seen).unwrap();
    // A current of -1.4 mA, which reads -1, and then a place that begins with FD: FF FF FD, which protocol 2.0 stuffs.
    {
        let mut wire = emulator.wire();
        (wire.servos[1].load, wire.servos[1].place) = (-1.4 / 1470.0, 2045.0);
    }
    let n = allocations_of(|| bus.ask(&mut seen).unwrap());
    assert_eq!((seen.has_answered[1], seen.counts[1]), (true, 0x07FD));
    assert!((seen.current_a[1] + 1e-3).abs() < 1e-6, "{} A", seen.current_a[1]);
    assert_eq!(n, 0);
}
