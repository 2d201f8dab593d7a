//! A bus of actuators as the slave's drive: the slave's step never waits for the bus, whose thread is another.

use crate::bus::{ActuatorBus, Seen};
use crate::cycles::Cycles;
use crate::exchange::{Exchange, Phase, Report, Wish};
use crate::setup::BusSetup;
use crate::texts::THREAD_ENDED;
use core::sync::atomic::Ordering;
use core::time::Duration;
use krait_ipc::Beside;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Actuators, DriveCycle, MAX_ACTUATORS};
use krait_slave::{Drive, DriveError, DriveReading, DriveTraits, Homing, Switching};
use std::sync::Arc;
use std::thread::JoinHandle;

/// Cycles that the thread goes on for at its end, until power is seen to be off.
const LAST_CYCLES: u32 = 20;
/// How often a dry run says what it would send, ns.
const DRY_LOG_NS: i64 = 1_000_000_000;

/// Actuators on a bus. Dropping it takes their power away and ends the thread.
#[derive(Debug)]
pub struct BusDrive {
    exchange: Arc<Exchange>,
    thread: Option<JoinHandle<()>>,
    traits: DriveTraits,
    setup: BusSetup,
    wish: Wish,
    report: Report,
    /// What the slave's side has found, in this turn.
    failure: Option<DriveError>,
}

impl BusDrive {
    /// Starts the thread of a bus that has been opened. `seen` is what all its actuators have said already; `beside` is how the
    /// thread runs where the slave's process has a core and a priority of its own.
    ///
    /// # Errors
    /// What the kernel says when it gives no thread.
    pub fn start<B: ActuatorBus>(bus: B, setup: BusSetup, seen: Seen, beside: Option<Beside>) -> std::io::Result<Self> {
        let mut drive = Self::without_thread(setup, &seen, monotonic_ns());
        let setup = drive.setup.clone();
        let exchange = Arc::clone(&drive.exchange);
        let cycles = Cycles::new(bus, setup, Arc::clone(&exchange), seen, monotonic_ns());
        let (theirs, period_ns) = (exchange, drive.setup.period_ns);
        let thread = std::thread::Builder::new().name("drives".to_owned()).spawn(move || {
            for refused in beside.map(|beside| beside.apply()).unwrap_or_default() {
                tracing::warn!("the thread of the drives: {refused}");
            }
            run(cycles, &theirs, period_ns);
        })?;
        drive.thread = Some(thread);
        Ok(drive)
    }

    /// The slave's side alone, of a bus that has seen this.
    pub(crate) fn without_thread(setup: BusSetup, seen: &Seen, now_ns: i64) -> Self {
        let mut report = Report::blank();
        report.stamp_ns = now_ns;
        for (k, units) in setup.units.iter().enumerate() {
            report.q_m[k] = units.metres(seen.counts[k]);
            report.tau_n[k] = units.load_n(seen, k);
            report.sampled_ns[k] = seen.sampled_ns[k];
        }
        let wish = Wish { stamp_ns: now_ns, q_m: [f64::NAN; MAX_ACTUATORS], ..Wish::default() };
        let exchange = Arc::new(Exchange::new(&wish, &report));
        Self { exchange, thread: None, traits: setup.traits(), setup, wish, report, failure: None }
    }

    /// What the slave wants now.
    pub(crate) fn newest_wish(&self) -> Option<Wish> {
        self.exchange.wish.get()
    }

    /// Whether this turn of the power is the newest, and nothing has failed in it as far as the slave knows.
    pub(crate) fn is_sound(&self, turn: u64) -> bool {
        turn == self.wish.turn && self.failure.is_none()
    }

    /// Lets the slave see a report.
    pub(crate) fn show(&self, report: &Report) {
        self.exchange.report.put(report);
    }

    fn send(&mut self, stamp_ns: i64) {
        self.wish.stamp_ns = stamp_ns;
        self.exchange.wish.put(&self.wish);
    }

    /// Power is switched anew, and what failed before is forgiven.
    fn begin_turn(&mut self, stamp_ns: i64, has_power: bool) {
        let turn = self.wish.turn + 1;
        self.wish = Wish { stamp_ns, turn, has_power, q_m: [f64::NAN; MAX_ACTUATORS], ..Wish::default() };
        self.failure = None;
        self.send(stamp_ns);
    }

    /// Takes the newest report, and notices when there has been none for too long. How old the reading of one actuator may be in a report
    /// that is new is bounded by the judge: one that is driven and silent for `lost_cycles` periods is lost. So no age is judged here but the
    /// report's, which is the thread's and no actuator's.
    fn look(&mut self, stamp_ns: i64) {
        if let Some(report) = self.exchange.report.get::<Report>() {
            self.report = report;
        }
        if self.failure.is_some() {
            return;
        }
        self.failure = self.report.failure.filter(|_| self.report.turn == self.wish.turn);
        let age_ns = stamp_ns.saturating_sub(self.report.stamp_ns);
        if age_ns > self.setup.wish_ns.max(self.setup.period_ns * i64::from(self.setup.lost_cycles)) {
            let is_over = self.thread.as_ref().is_some_and(JoinHandle::is_finished);
            let late = DriveError::Stale { age_ms: age_ns as f64 * 1e-6 };
            self.failure = self.failure.or(Some(if is_over { DriveError::Bus { what: THREAD_ENDED } } else { late }));
        }
    }

    fn check(&self, q_tilde_m: &Actuators) -> Result<(), DriveError> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        if self.report.phase != Phase::On || self.report.turn != self.wish.turn {
            return Err(DriveError::NotPowered);
        }
        for (k, (found_m, units)) in q_tilde_m.iter().copied().zip(&self.setup.units).enumerate() {
            if !found_m.is_finite() {
                return Err(DriveError::NotFinite { actuator: k + 1, found_m });
            }
            if found_m.abs() > units.travel_m {
                return Err(DriveError::OutOfTravel { actuator: k + 1, found_m, limit_m: units.travel_m });
            }
        }
        Ok(())
    }
}

impl Drive for BusDrive {
    fn n_actuators(&self) -> usize {
        self.setup.n()
    }

    fn traits(&self) -> DriveTraits {
        self.traits
    }

    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        self.look(stamp_ns);
        self.check(&q_tilde_m)?;
        self.wish.q_m = core::array::from_fn(|k| if k < self.setup.n() { q_tilde_m[k] } else { 0.0 });
        self.send(stamp_ns);
        Ok(())
    }

    /// Tells the bus too that the slave lives.
    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        self.look(stamp_ns);
        self.send(stamp_ns);
        let Report { q_m, tau_n, sampled_ns, state, has_emergency, .. } = self.report;
        Ok(DriveReading { q_tilde_m: q_m, tau_n, sampled_ns, state, has_emergency })
    }

    /// Encoders that are absolute within a turn have nothing to search: they must only stand within their travel.
    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        self.look(stamp_ns);
        for (k, (found_m, units)) in self.report.q_m.iter().copied().zip(&self.setup.units).enumerate() {
            if found_m.abs() > units.travel_m {
                return Err(DriveError::FarFromZero { actuator: k + 1, found_m, limit_m: units.travel_m });
            }
        }
        Ok(Homing::Done)
    }

    fn set_power(&mut self, stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        if !on {
            self.begin_turn(stamp_ns, false);
            return Ok(Switching::Done);
        }
        if !self.wish.has_power || self.wish.is_stopped {
            self.begin_turn(stamp_ns, true);
            return Ok(Switching::Busy);
        }
        self.look(stamp_ns);
        self.send(stamp_ns);
        match self.failure {
            Some(failure) => Err(failure),
            None if self.report.turn == self.wish.turn && self.report.phase == Phase::On => Ok(Switching::Done),
            None => Ok(Switching::Busy),
        }
    }

    fn quick_stop(&mut self, stamp_ns: i64) {
        self.wish.is_stopped = true;
        self.send(stamp_ns);
    }

    fn stand(&mut self, stamp_ns: i64) {
        self.wish.stands = true;
        self.quick_stop(stamp_ns);
    }

    fn failure(&self) -> Option<DriveError> {
        self.failure
    }

    fn has_bus(&self) -> bool {
        true
    }

    fn next_cycle(&mut self) -> Option<DriveCycle> {
        self.exchange.cycles.pop()
    }
}

impl Drop for BusDrive {
    fn drop(&mut self) {
        if self.wish.has_power {
            self.begin_turn(monotonic_ns(), false);
        }
        self.exchange.ends.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread of the drives has panicked");
        }
    }
}

/// A cycle that begins later than this part of a period is late: the next ones keep their distance from it.
const LATE_PART: i64 = 4;

/// When the next cycle begins, after one that was due and one that began then, ns. A little late, as timers are, it makes up for in the next,
/// so that the rate holds; a late one moves all that follow. Two cycles never follow each other in less than three quarters of a period:
/// each goes as far as the rate allows in a whole one.
fn next_due(due_ns: i64, begun_ns: i64, period_ns: i64) -> i64 {
    let is_late = begun_ns - due_ns > period_ns / LATE_PART;
    period_ns + if is_late { begun_ns } else { due_ns }
}

/// The thread: a cycle each period; one that takes longer than its period makes the next ones late, never double.
fn run<B: ActuatorBus>(mut cycles: Cycles<B>, exchange: &Exchange, period_ns: i64) {
    let mut due_ns = monotonic_ns();
    let mut dry = Dry::default();
    let mut n_left = LAST_CYCLES;
    while n_left > 0 {
        if exchange.ends.load(Ordering::Acquire) {
            n_left = if cycles.is_off() { 0 } else { n_left - 1 };
        }
        let now_ns = monotonic_ns();
        if now_ns < due_ns {
            std::thread::sleep(Duration::from_nanos((due_ns - now_ns).unsigned_abs()));
        }
        let now_ns = monotonic_ns();
        cycles.step(now_ns, monotonic_ns);
        dry.tell(&cycles, now_ns);
        due_ns = next_due(due_ns, now_ns, period_ns);
    }
}

/// Says what a dry run would have sent, whenever that has changed, once a second at most.
#[derive(Default)]
struct Dry {
    counts: Option<Vec<i32>>,
    due_ns: i64,
}

impl Dry {
    fn tell<B: ActuatorBus>(&mut self, cycles: &Cycles<B>, now_ns: i64) {
        if now_ns < self.due_ns {
            return;
        }
        self.due_ns = now_ns + DRY_LOG_NS;
        let counts = cycles.dry_counts();
        if counts != self.counts {
            if let Some(counts) = &counts {
                tracing::warn!(?counts, "dry run: the actuators would be told to go there");
            }
            self.counts = counts;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Units;
    use krait_slave::{ActuatorConfig, DriveConfig, SlaveConfig};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    #[test]
    fn cycles_keep_their_rate_where_timers_are_a_little_late_and_never_double_after_a_late_one() {
        const PERIOD_NS: i64 = 2_000_000;
        let mut random = ChaCha8Rng::seed_from_u64(17);
        let mut below = |n: i64| i64::from(random.next_u32()) % n;
        // A cycle that is due begins a little late, and one in twenty by up to ten periods; some take longer than a period.
        let (mut due_ns, mut free_ns, mut begun) = (0, 0, Vec::new());
        for _ in 0..10_000 {
            let late_ns = if below(20) == 0 { below(10 * PERIOD_NS) } else { below(PERIOD_NS / 10) };
            let begun_ns = due_ns.max(free_ns) + late_ns;
            free_ns = begun_ns + if below(20) == 0 { below(3 * PERIOD_NS) } else { below(PERIOD_NS / 2) };
            due_ns = next_due(due_ns, begun_ns, PERIOD_NS);
            begun.push(begun_ns);
        }
        let closest_ns = begun.windows(2).map(|two| two[1] - two[0]).min().unwrap();
        assert!(closest_ns >= PERIOD_NS - PERIOD_NS / LATE_PART, "{closest_ns} ns");

        let (mut due_ns, mut last_ns) = (0, 0);
        for _ in 0..10_000 {
            last_ns = due_ns + below(PERIOD_NS / LATE_PART);
            due_ns = next_due(due_ns, last_ns, PERIOD_NS);
        }
        assert_eq!(due_ns, 10_000 * PERIOD_NS, "the rate holds");
        assert!(last_ns < due_ns);
    }

    #[test]
    fn a_bus_that_says_nothing_for_too_long_is_named_and_no_drive_is() {
        let actuator = ActuatorConfig { id: 1, zero_count: Some(2048), ..ActuatorConfig::default() };
        let units = vec![Units::new(&actuator, 1, 4096).unwrap()];
        let drive = DriveConfig { wish_ms: 100.0, actuator: vec![actuator], ..DriveConfig::default() };
        let setup = BusSetup::new(&SlaveConfig { drive, ..SlaveConfig::default() }, units, 2048, 1_000_000).unwrap();
        let mut drive = BusDrive::without_thread(setup, &Seen::default(), 0);
        drive.read(100_000_000).unwrap();
        assert_eq!(drive.failure(), None);
        drive.read(101_000_000).unwrap();
        let failure = drive.failure().unwrap();
        assert_eq!((failure, failure.actuator()), (DriveError::Stale { age_ms: 101.0 }, None));
        assert!(failure.to_string().starts_with("the newest readings of the drives are 101.0 ms old"), "{failure}");
    }
}
