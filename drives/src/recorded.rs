//! Drives made of a recording: the bus answers what it answered then, at the instants of then, through the same cycles and judge.
//!
//! Problem: what a slave did on real drives depends on which of its wishes each cycle found and when each answer was there.
//!
//! Intuition: a recorded cycle says the instant of the wish that it took and when it was over. So it is run before the slave's first
//! call after that wish, and what it reports is shown to the calls after its end; nothing waits, and time is an argument.
//!
//! Whether the slave had seen a failure that came at the very moment of a look is for the caller to say ([`RecordedDrive::show_failures`]).
//!
//! Failure: a cycle that is not in the recording is counted and passed over.

use crate::bus::{ActuatorBus, BusGone, Goals, Seen};
use crate::cycles::Cycles;
use crate::exchange::{Exchange, Report, Wish};
use crate::handover::{Told, seen_in, text};
use crate::repeated::Repeated;
use crate::{BusDrive, BusSetup};
use krait_ipc::message::{Actuators, DriveCycle};
use krait_slave::{Drive, DriveError, DriveReading, DriveTraits, Homing, Switching};
use std::collections::VecDeque;
use std::sync::Arc;

/// A failure that is older has been seen, whatever the caller says, ns.
const SEEN_NS: i64 = 5_000_000;

/// Recorded drives, as the slave's.
#[derive(Debug)]
pub struct RecordedDrive {
    /// The slave's side, which sees what has been reported until now.
    slave_side: BusDrive,
    cycles: Cycles<RecordedBus>,
    /// Between the cycles and this.
    exchange: Arc<Exchange>,
    recorded: VecDeque<DriveCycle>,
    /// Reports that the slave has yet to see.
    reports: VecDeque<Report>,
    repeated: Repeated,
    failures_until_ns: i64,
}

impl RecordedDrive {
    /// Drives as they were when their bus was opened: `opened` is the recorded cycle of number 0.
    pub fn new(setup: BusSetup, opened: &DriveCycle) -> Self {
        let (seen, at_ns) = (seen_in(opened), opened.answered_ns);
        let slave_side = BusDrive::without_thread(setup.clone(), &seen, at_ns);
        let exchange = Arc::new(Exchange::new(&Wish::default(), &Report::blank()));
        let bus = RecordedBus { n: setup.n(), cycle: *opened, told: Told::default() };
        let cycles = Cycles::new(bus, setup, Arc::clone(&exchange), seen, at_ns);
        // What was seen at the opening is no cycle of its own.
        exchange.cycles.pop::<DriveCycle>();
        let (recorded, reports, repeated) = (VecDeque::new(), VecDeque::new(), Repeated::default());
        let failures_until_ns = i64::MAX;
        Self { slave_side, cycles, exchange, recorded, reports, repeated, failures_until_ns }
    }

    /// The cycle that was recorded behind those before.
    pub fn push(&mut self, cycle: DriveCycle) {
        self.recorded.push_back(cycle);
    }

    /// How the cycles until now compare.
    pub fn repeated(&self) -> &Repeated {
        &self.repeated
    }

    /// Failures that were reported until an instant are shown to the next calls, later ones only when they are 5 ms old. Without a
    /// word of this kind a failure is shown like all else, from the instant of its report.
    pub fn show_failures(&mut self, until_ns: i64) {
        self.failures_until_ns = until_ns;
    }

    fn is_shown(&self, report: &Report, now_ns: i64) -> bool {
        let is_news = report.failure.is_some() && self.slave_side.is_sound(report.turn);
        let is_old = report.stamp_ns <= now_ns.saturating_sub(SEEN_NS);
        match self.failures_until_ns {
            until_ns if is_news && until_ns != i64::MAX => is_old || report.stamp_ns <= until_ns,
            _ => report.stamp_ns <= now_ns,
        }
    }

    /// Runs the cycles that the slave's wish of this instant comes too late for, and shows what was over by then.
    fn pass(&mut self, now_ns: i64) {
        while self.recorded.front().is_some_and(|recorded| recorded.wish_ns < now_ns)
            && let Some(recorded) = self.recorded.pop_front()
        {
            self.run(&recorded);
        }
        while self.reports.front().is_some_and(|report| self.is_shown(report, now_ns))
            && let Some(report) = self.reports.pop_front()
        {
            self.slave_side.show(&report);
        }
    }

    fn run(&mut self, recorded: &DriveCycle) {
        if let Some(wish) = self.slave_side.newest_wish() {
            self.exchange.wish.put(&wish);
        }
        let bus = self.cycles.bus_mut();
        (bus.cycle, bus.told) = (*recorded, Told::default());
        self.cycles.step(recorded.sample_ns, || recorded.answered_ns);
        self.reports.extend(self.exchange.report.get::<Report>());
        if let Some(again) = self.exchange.cycles.pop::<DriveCycle>() {
            self.repeated.compare(recorded, &again);
        }
    }
}

impl Drive for RecordedDrive {
    fn n_actuators(&self) -> usize {
        self.slave_side.n_actuators()
    }

    fn traits(&self) -> DriveTraits {
        self.slave_side.traits()
    }

    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        self.pass(stamp_ns);
        self.slave_side.write(stamp_ns, q_tilde_m)
    }

    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        self.pass(stamp_ns);
        self.slave_side.read(stamp_ns)
    }

    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        self.pass(stamp_ns);
        self.slave_side.home(stamp_ns)
    }

    fn set_power(&mut self, stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        self.pass(stamp_ns);
        self.slave_side.set_power(stamp_ns, on)
    }

    fn quick_stop(&mut self, stamp_ns: i64) {
        self.pass(stamp_ns);
        self.slave_side.quick_stop(stamp_ns);
    }

    fn stand(&mut self, stamp_ns: i64) {
        self.pass(stamp_ns);
        self.slave_side.stand(stamp_ns);
    }

    fn failure(&self) -> Option<DriveError> {
        self.slave_side.failure()
    }
}

/// A bus that answers what was recorded.
#[derive(Debug)]
struct RecordedBus {
    n: usize,
    /// The cycle that is being run.
    cycle: DriveCycle,
    told: Told,
}

impl RecordedBus {
    fn fails(&self, doing: u32) -> Result<(), BusGone> {
        if self.cycle.has(doing) { Err(BusGone { what: text(self.cycle.failure_text) }) } else { Ok(()) }
    }
}

impl ActuatorBus for RecordedBus {
    fn n_actuators(&self) -> usize {
        self.n
    }

    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone> {
        self.told.goals = Some(*goals);
        self.fails(DriveCycle::GONE_TELLING)
    }

    fn switch(&mut self, on: bool, goals: &Goals) -> Result<(), BusGone> {
        self.told.goals = on.then_some(*goals);
        self.fails(DriveCycle::GONE_TELLING)
    }

    /// Who understood the goal of then has understood the one of now: else other settings would look like silence.
    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone> {
        *seen = seen_in(&self.cycle);
        if let Some(goals) = self.told.goals
            && self.cycle.has(DriveCycle::TOLD)
        {
            for (k, own) in self.cycle.actuators().iter().enumerate() {
                if own.goal_counts == own.told_counts {
                    seen.goal_counts[k] = goals.counts[k];
                }
            }
        }
        self.fails(DriveCycle::GONE_ASKING)
    }

    fn come_back(&mut self) -> Result<(), BusGone> {
        self.fails(DriveCycle::GONE_TELLING)
    }
}
