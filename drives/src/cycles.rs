//! The bus's side of a drive, cycle by cycle: takes the newest wish, tells the actuators, asks them, judges, reports.
//!
//! Problem: the slave ticks at 1 kHz and may die at any instant; a bus has a period of its own, and one of several
//! antagonists may fail while the others hold its share of the load.
//!
//! Intuition: each cycle sends the newest wish as it is; nothing is invented between two wishes, because it would pass the
//! slave's limiter. The bus and the slave keep times of their own, so that a cycle may find the way of two ticks, or of a whole
//! pause: what is more than the slave's rate allows in a period waits for the next cycles. Whatever fails, all brake to rest by
//! one common factor from where they are, and stay there under power. Only power that is switched anew ends that. Where one says
//! that it has let go, the others may give way ([`crate::relax`]).
//!
//! Failure: without a sign of life of the slave for `wish_ms` the same happens. Time is an argument.

mod report;

use crate::bus::{ActuatorBus, BusGone, Goals, Seen};
use crate::exchange::{Exchange, Phase, Wish};
use crate::handover::Told;
use crate::judge::{Finding, Judge};
use crate::relax::{Relaxing, suspect};
use crate::setup::BusSetup;
use krait_ipc::message::{Actuators, DriveCycle, MAX_ACTUATORS, largest};
use krait_slave::{DriveError, DriveMode, OnFault};
use std::sync::Arc;

/// Slowest speed that a goal is sent with, counts/s: enough to close the last counts.
const SLOWEST_COUNTS_PER_S: f64 = 50.0;
/// A motion at exactly the rate is within it, whatever its sums round to.
const ROUNDING: f64 = 1.0 + 1e-9;

/// A bus at work.
#[derive(Debug)]
pub(crate) struct Cycles<B> {
    bus: B,
    setup: BusSetup,
    exchange: Arc<Exchange>,
    judge: Judge,
    seen: Seen,
    wish: Wish,
    phase: Phase,
    failure: Option<DriveError>,
    /// Whether the bus was gone when it was last used: it must come back first.
    is_gone: bool,
    relaxing: Option<Relaxing>,
    /// Whether power was told to come, in this turn.
    has_switched: bool,
    /// Where the actuators were told to be, m, and how fast that moves, m/s.
    goal_m: Actuators,
    velocity_m_per_s: Actuators,
    /// Cycles since the wish last moved.
    n_unmoved: u32,
    /// When the newest cycle began, ns, its number, and what the bus was told in it.
    begun_ns: i64,
    n_cycles: u64,
    told: Told,
    /// Cycles that found no room on their way to the slave.
    n_left_out: u64,
}

impl<B: ActuatorBus> Cycles<B> {
    /// `seen` is what the bus has seen already.
    pub(crate) fn new(bus: B, setup: BusSetup, exchange: Arc<Exchange>, seen: Seen, now_ns: i64) -> Self {
        let judge = Judge::new(setup.n(), setup.lost_cycles, setup.leap_counts, now_ns);
        let mut cycles = Self {
            bus,
            setup,
            exchange,
            judge,
            seen,
            wish: Wish { q_m: [f64::NAN; MAX_ACTUATORS], ..Wish::default() },
            phase: Phase::Off,
            failure: None,
            is_gone: false,
            relaxing: None,
            has_switched: false,
            goal_m: [0.0; MAX_ACTUATORS],
            velocity_m_per_s: [0.0; MAX_ACTUATORS],
            n_unmoved: 0,
            begun_ns: now_ns,
            n_cycles: 0,
            told: Told::default(),
            n_left_out: 0,
        };
        cycles.rest_where_seen();
        let report = cycles.newest_report(now_ns);
        cycles.hand_over(&report);
        cycles
    }

    /// One cycle.
    pub(crate) fn step(&mut self, now_ns: i64, clock: impl Fn() -> i64) {
        (self.begun_ns, self.told) = (now_ns, Told::default());
        self.n_cycles += 1;
        if let Some(wish) = self.exchange.wish.get::<Wish>() {
            let is_new_turn = wish.turn != self.wish.turn;
            self.wish = wish;
            if is_new_turn {
                let mut back = Ok(());
                if self.is_gone {
                    back = self.bus.come_back();
                } else {
                    self.bus.look_again();
                }
                self.begin_turn();
                self.is_gone = false;
                if let Err(gone) = back {
                    return self.gone(gone, DriveCycle::GONE_TELLING, clock());
                }
            }
        }
        let told = match self.tell(now_ns) {
            Ok(told) => told,
            Err(gone) => return self.gone(gone, DriveCycle::GONE_TELLING, clock()),
        };
        self.told.goals = told;
        if let Err(gone) = self.bus.ask(&mut self.seen) {
            return self.gone(gone, DriveCycle::GONE_ASKING, clock());
        }
        let now_ns = clock();
        let told = told.filter(|_| self.phase != Phase::Switching);
        let told = told.map(|goals| goals.counts);
        if let Some(finding) = self.judge.look(&self.seen, told.as_ref(), self.judged_phase(), now_ns) {
            self.fail(self.in_metres(finding), now_ns);
        }
        self.report(now_ns);
    }

    /// The bus.
    pub(crate) fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Whether all actuators are known to be without power.
    pub(crate) fn is_off(&self) -> bool {
        self.phase == Phase::Off && !self.seen.is_powered.iter().take(self.setup.n()).any(|on| *on)
    }

    fn is_dry(&self) -> bool {
        self.setup.mode == DriveMode::Dry
    }

    /// What the actuators are expected to be in: a dry run leaves them without power.
    fn judged_phase(&self) -> Phase {
        if self.is_dry() { Phase::Off } else { self.phase }
    }

    /// Power is switched anew: nothing that was is held against anybody.
    fn begin_turn(&mut self) {
        (self.failure, self.relaxing) = (None, None);
        self.judge.begin(&self.seen);
        self.has_switched = false;
        self.rest_where_seen();
        self.phase = if self.wish.has_power { Phase::Switching } else { Phase::Off };
    }

    fn rest_where_seen(&mut self) {
        (self.velocity_m_per_s, self.n_unmoved) = ([0.0; MAX_ACTUATORS], 0);
        for (goal_m, (units, counts)) in self.goal_m.iter_mut().zip(self.setup.units.iter().zip(self.seen.counts)) {
            *goal_m = units.metres(counts);
        }
    }

    /// Sends what there is to send; the goals, where any were sent.
    fn tell(&mut self, now_ns: i64) -> Result<Option<Goals>, BusGone> {
        self.fail_if_unled(now_ns);
        match self.phase {
            Phase::Off => {
                // Off is wished for until it is seen: a servo that was switched by somebody else is none of ours.
                if self.wish.turn > 0 && !self.is_dry() && !self.is_off() {
                    self.bus.switch(false, &Goals::default())?;
                    self.told.power = Some(false);
                }
                Ok(None)
            }
            Phase::Switching if self.wish.is_stopped => self.follow(now_ns).map(Some),
            Phase::Switching if self.is_dry() => {
                self.phase = Phase::On;
                Ok(None)
            }
            Phase::Switching => {
                // Also who is under power already is told: somebody else may have switched it, without limits.
                let Seen { is_powered, is_unguarded, has_answered, .. } = &self.seen;
                let powered = (0..self.setup.n()).all(|k| is_powered[k] && !is_unguarded[k] && has_answered[k]);
                if powered && self.has_switched {
                    self.phase = Phase::On;
                    return self.tell(now_ns);
                }
                // Where they stand now, not where they once were told to go.
                self.rest_where_seen();
                let goals = self.goals();
                self.bus.switch(true, &goals)?;
                self.told.power = Some(true);
                self.has_switched = true;
                Ok(Some(goals))
            }
            Phase::On | Phase::Stopped if self.is_dry() => {
                if self.phase == Phase::On && self.wish.is_somewhere() {
                    self.approach_wish();
                }
                Ok(None)
            }
            Phase::On | Phase::Stopped => self.follow(now_ns).map(Some),
        }
    }

    /// A slave that is silent for too long is a failure like any other, before anything is told: what is told then is what a failure asks for.
    fn fail_if_unled(&mut self, now_ns: i64) {
        let silent_ns = now_ns.saturating_sub(self.wish.stamp_ns);
        if self.phase == Phase::On && !self.is_dry() && silent_ns > self.setup.wish_ns {
            let limit_ms = self.setup.wish_ns as f64 * 1e-6;
            self.fail(DriveError::Unled { silent_ms: silent_ns as f64 * 1e-6, limit_ms }, now_ns);
        }
    }

    /// Goes where the slave wants, or brakes.
    fn follow(&mut self, now_ns: i64) -> Result<Goals, BusGone> {
        if self.wish.is_stopped {
            self.phase = Phase::Stopped;
        }
        if self.phase == Phase::Stopped {
            let is_still = self.velocity_m_per_s.iter().all(|v| *v == 0.0);
            if is_still { self.relax(now_ns) } else { self.brake() }
        } else if self.wish.is_somewhere() {
            self.approach_wish();
        }
        let goals = self.goals();
        self.bus.tell(&goals)?;
        Ok(goals)
    }

    /// To the wish, as far as the slave's rate allows in a period, by one common factor. How fast that is, braking begins from.
    fn approach_wish(&mut self) {
        let (n, period_s) = (self.setup.n(), self.period_s());
        let way_m: Actuators = core::array::from_fn(|k| if k < n { self.wish.q_m[k] - self.goal_m[k] } else { 0.0 });
        if largest(way_m) == 0.0 {
            // Between two wishes of a motion, one cycle may find none; two in a row are a rest.
            self.n_unmoved = self.n_unmoved.saturating_add(1);
            if self.n_unmoved > 1 {
                self.velocity_m_per_s = [0.0; MAX_ACTUATORS];
            }
            return;
        }
        let part = self.part_within_rates(way_m, period_s);
        if part * ROUNDING >= 1.0 {
            self.goal_m = self.wish.q_m;
        } else {
            for (goal_m, way_m) in self.goal_m.iter_mut().zip(way_m) {
                *goal_m += way_m * part;
            }
        }
        let took_s = if self.n_unmoved == 1 { 2.0 * period_s } else { period_s };
        let part = self.part_within_rates(way_m, took_s).min(1.0);
        self.velocity_m_per_s = way_m.map(|way| way / took_s * part);
        self.n_unmoved = 0;
    }

    /// The part of a way that takes no actuator further in a time than its rate; more than 1 where there is room. The way is not nothing.
    fn part_within_rates(&self, way_m: Actuators, time_s: f64) -> f64 {
        let parts = way_m.iter().zip(self.setup.rates_m_per_s).map(|(way_m, rate)| rate * time_s / way_m.abs());
        parts.fold(f64::INFINITY, f64::min)
    }

    fn period_s(&self) -> f64 {
        self.setup.period_ns as f64 * 1e-9
    }

    /// All slower by one common factor, so that the direction of the motion stays.
    fn brake(&mut self) {
        let period_s = self.period_s();
        let fastest = largest(self.velocity_m_per_s);
        let lost_m_per_s = self.setup.deceleration_m_per_s2 * period_s;
        let part = if fastest > lost_m_per_s { 1.0 - lost_m_per_s / fastest } else { 0.0 };
        for k in 0..self.setup.n() {
            self.velocity_m_per_s[k] *= part;
            let travel_m = self.setup.units[k].travel_m;
            self.goal_m[k] = (self.goal_m[k] + self.velocity_m_per_s[k] * period_s).clamp(-travel_m, travel_m);
        }
    }

    /// The goals in counts, each with the speed that brings its actuator there within a period.
    fn goals(&self) -> Goals {
        let mut goals = Goals::default();
        let periods_per_s = 1e9 / self.setup.period_ns as f64;
        for (k, units) in self.setup.units.iter().enumerate() {
            goals.counts[k] = units.counts(self.goal_m[k]);
            let way = f64::from(goals.counts[k].abs_diff(self.seen.counts[k]));
            let speed = (way * periods_per_s).ceil();
            goals.counts_per_s[k] = speed.clamp(SLOWEST_COUNTS_PER_S, self.setup.speed_counts_per_s);
        }
        goals
    }

    /// Gives way where another has let go; a stop of anybody ends it.
    fn relax(&mut self, now_ns: i64) {
        let Some(relaxing) = self.relaxing.as_mut() else { return };
        let had_begun = relaxing.has_begun();
        let mut tau_n = [f64::NAN; MAX_ACTUATORS];
        for (k, units) in self.setup.units.iter().enumerate() {
            tau_n[k] = units.load_n(&self.seen, k);
        }
        let times = (self.setup.n(), now_ns, self.setup.period_ns);
        let goal_m = relaxing.step(self.goal_m, tau_n, &self.seen, times).filter(|_| !self.wish.stands);
        if !had_begun && relaxing.has_begun() {
            tracing::warn!("its line is limp: the others give way to their loads");
        }
        match goal_m {
            Some(goal_m) => {
                for (k, units) in self.setup.units.iter().enumerate() {
                    self.goal_m[k] = goal_m[k].clamp(-units.travel_m, units.travel_m);
                }
            }
            None => {
                if had_begun {
                    tracing::warn!("the others have given way and hold");
                }
                self.relaxing = None;
            }
        }
    }

    fn fail(&mut self, failure: DriveError, now_ns: i64) {
        if self.failure.is_some() {
            return;
        }
        self.failure = Some(failure);
        if self.phase != Phase::Off {
            let lets_go = self.setup.on_fault == OnFault::PowerOff;
            self.phase = if lets_go { Phase::Off } else { Phase::Stopped };
            let BusSetup { n_together, antagonists, relax, on_fault, .. } = self.setup;
            let limp = suspect(&failure, n_together).filter(|_| on_fault == OnFault::Relax);
            // One that is alone in its group has nobody who could give way.
            let limp = limp.filter(|limp| antagonists[*limp].contains(&true));
            self.relaxing = limp.map(|limp| Relaxing::new(relax, (limp, antagonists[limp]), now_ns));
        }
    }

    fn gone(&mut self, gone: BusGone, doing: u32, now_ns: i64) {
        (self.told.gone, self.is_gone) = (doing, true);
        self.seen.has_answered = [false; MAX_ACTUATORS];
        self.relaxing = None;
        self.fail(DriveError::Bus { what: gone.what }, now_ns);
        self.report(now_ns);
    }

    fn in_metres(&self, finding: Finding) -> DriveError {
        match finding {
            Finding::Known(error) => error,
            Finding::Leapt { actuator, counts } => {
                DriveError::Jumped { actuator, by_m: self.setup.units[actuator - 1].magnitude_m(counts as f64) }
            }
        }
    }

    /// What a dry run would have sent, counts.
    pub(crate) fn dry_counts(&self) -> Option<Vec<i32>> {
        (self.is_dry() && self.phase == Phase::On)
            .then(|| self.setup.units.iter().zip(self.goal_m).map(|(units, goal_m)| units.counts(goal_m)).collect())
    }
}

#[cfg(test)]
mod tests;
