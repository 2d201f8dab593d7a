//! Cycles in a time of their own: what is told to the actuators when one of them fails in motion.

use super::*;
use crate::bus::{PerActuator, Trouble};
use crate::exchange::Report;
use crate::units::Units;
use krait_slave::{ActuatorConfig, ActuatorState, DriveConfig, DriveKind, SlaveConfig};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::sync::Mutex;

mod jitter;
mod lets_go;

const MS: i64 = 1_000_000;

/// Actuators that are where they were told to be, unless they are silent.
#[derive(Clone, Debug, Default)]
struct Ideal(Arc<Mutex<Truth>>);

#[derive(Debug, Default)]
struct Truth {
    is_on: bool,
    counts: PerActuator<i32>,
    is_silent: PerActuator<bool>,
    /// It answers, and was told another goal by somebody else.
    knows_other: PerActuator<bool>,
    is_gone: bool,
    /// How often it was to come back.
    n_reopened: u32,
    /// Overloaded: without torque.
    is_limp: PerActuator<bool>,
    current_a: PerActuator<f64>,
}

impl ActuatorBus for Ideal {
    fn n_actuators(&self) -> usize {
        3
    }
    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone> {
        let mut truth = self.0.lock().unwrap();
        if truth.is_on {
            truth.counts = goals.counts;
        }
        Ok(())
    }
    fn switch(&mut self, on: bool, _goals: &Goals) -> Result<(), BusGone> {
        self.0.lock().unwrap().is_on = on;
        Ok(())
    }
    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone> {
        let truth = self.0.lock().unwrap();
        if truth.is_gone {
            return Err(BusGone { what: crate::texts::PORT_GONE });
        }
        seen.has_answered = truth.is_silent.map(|silent| !silent);
        for k in (0..MAX_ACTUATORS).filter(|k| !truth.is_silent[*k]) {
            let other = i32::from(truth.knows_other[k]);
            (seen.counts[k], seen.goal_counts[k]) = (truth.counts[k], truth.counts[k] + other);
            (seen.is_powered[k], seen.current_a[k]) = (truth.is_on, truth.current_a[k]);
            seen.has_let_go[k] = truth.is_limp[k];
            seen.trouble[k] = if truth.is_limp[k] { Trouble::Limp } else { Trouble::None };
        }
        Ok(())
    }
    fn come_back(&mut self) -> Result<(), BusGone> {
        let mut truth = self.0.lock().unwrap();
        truth.n_reopened += 1;
        if truth.is_gone { Err(BusGone { what: crate::texts::PORT_STILL_GONE }) } else { Ok(()) }
    }
}

struct Bench {
    cycles: Cycles<Ideal>,
    truth: Arc<Mutex<Truth>>,
    exchange: Arc<Exchange>,
    wish: Wish,
    now_ns: i64,
    /// Goals after each cycle, m.
    goals: Vec<Actuators>,
}

impl Bench {
    /// Under power, at zero.
    fn new() -> Self {
        Self::with(DriveConfig::default())
    }

    fn with(drive: DriveConfig) -> Self {
        Self::of(Self::whole(drive))
    }

    fn whole(drive: DriveConfig) -> SlaveConfig {
        // A newton is an ampere.
        let groups = drive.actuator.iter().map(|actuator| actuator.group).collect();
        let groups: Vec<u32> = if drive.actuator.is_empty() { vec![1; 3] } else { groups };
        let actuator = |(k, group): (usize, &u32)| ActuatorConfig {
            id: k as u32 + 1,
            group: *group,
            zero_count: Some(500_000),
            spool_radius_m: 0.01,
            newton_metre_per_ampere: 0.01,
            ..Default::default()
        };
        let drive = DriveConfig {
            speed_counts_per_s: 20_000.0,
            wish_ms: 50.0,
            actuator: groups.iter().enumerate().map(actuator).collect(),
            ..drive
        };
        SlaveConfig { drive, ..SlaveConfig::default() }
    }

    /// Of actuators that are whole.
    fn of(config: SlaveConfig) -> Self {
        // A million counts a turn: rounding is no part of these tests.
        let units = |(k, actuator)| Units::new(actuator, k + 1, 1_000_000).unwrap();
        let units = config.drive.actuator.iter().enumerate().map(units).collect();
        let setup = BusSetup::new(&config, units, 500_000, 2 * MS).unwrap_or_else(|error| panic!("{error}"));
        let exchange = Arc::new(Exchange::new(&Wish::default(), &Report::blank()));
        let truth = Arc::new(Mutex::new(Truth { counts: [500_000; 12], ..Truth::default() }));
        let seen = Seen { counts: [500_000; 12], ..Seen::default() };
        let cycles = Cycles::new(Ideal(Arc::clone(&truth)), setup, Arc::clone(&exchange), seen, 0);
        let wish = Wish { turn: 1, has_power: true, q_m: [f64::NAN; 12], ..Wish::default() };
        let mut bench = Self { cycles, truth, exchange, wish, now_ns: 0, goals: Vec::new() };
        bench.step();
        bench.step();
        assert_eq!(bench.report().phase, Phase::On);
        bench
    }

    fn step(&mut self) -> Report {
        self.now_ns += 5 * MS;
        self.wish.stamp_ns = self.now_ns;
        self.silent_step()
    }

    /// A cycle without a sign of life of the slave.
    fn silent_step(&mut self) -> Report {
        self.exchange.wish.put(&self.wish);
        let now_ns = self.now_ns;
        self.cycles.step(now_ns, || now_ns);
        self.goals.push(self.cycles.goal_m);
        self.report()
    }

    fn report(&self) -> Report {
        self.exchange.report.get().unwrap()
    }

    /// So many cycles of motion at 20 mm/s in a plane.
    fn go(&mut self, n: usize) {
        for _ in 0..n {
            self.go_at(0.02);
        }
    }

    /// A cycle of motion at so many m/s in a plane.
    fn go_at(&mut self, m_per_s: f64) {
        let way_m = self.cycles.goal_m[0] + m_per_s * 5e-3;
        self.wish.q_m = krait_slave::lines([way_m, -0.5 * way_m, -0.5 * way_m]);
        self.step();
    }

    /// Velocity of the goals in the newest cycle, m/s.
    fn velocity(&self, k: usize) -> f64 {
        let [.., before, now] = &self.goals[..] else { panic!("two cycles") };
        (now[k] - before[k]) / 5e-3
    }
}

#[test]
fn one_that_is_lost_is_known_after_three_cycles_and_all_brake_by_one_factor_and_stay() {
    let mut bench = Bench::new();
    bench.go(20);
    bench.truth.lock().unwrap().is_silent[1] = true;
    bench.go(2);
    assert_eq!(bench.report().failure, None, "two missing answers mean nothing");
    bench.go(1);
    let report = bench.report();
    assert_eq!(report.failure, Some(DriveError::Lost { actuator: 2, silent_ms: 15.0 }));
    assert_eq!(report.state[..3], [ActuatorState::QuickStopped, ActuatorState::Lost, ActuatorState::QuickStopped]);
    let mut speed = bench.velocity(0);
    assert!((speed - 0.02).abs() < 1e-9);
    let mut n_cycles = 0;
    while speed > 0.0 {
        // The slave, which does not know yet, wishes for more.
        bench.go(1);
        let now = bench.velocity(0);
        assert!((speed - now - 5e-3).abs() < 1e-9 || now == 0.0, "1 m/s2: {speed} then {now}");
        assert!((bench.velocity(2) + 0.5 * now).abs() < 1e-9, "the direction stays");
        (speed, n_cycles) = (now, n_cycles + 1);
    }
    assert_eq!(n_cycles, 4, "20 mm/s at 1 m/s2 in periods of 5 ms");
    let rest = bench.cycles.goal_m;
    bench.truth.lock().unwrap().is_silent[1] = false;
    bench.go(20);
    assert_eq!(bench.cycles.goal_m, rest, "nothing resumes by itself, though it answers again");
    assert!(bench.truth.lock().unwrap().is_on, "under power");
}

#[test]
fn one_that_answers_and_knows_another_goal_is_not_called_silent() {
    let mut bench = Bench::new();
    bench.go(20);
    bench.truth.lock().unwrap().knows_other[1] = true;
    bench.go(2);
    assert_eq!(bench.report().failure, None, "two lost goals mean nothing");
    bench.go(1);
    let report = bench.report();
    assert_eq!(report.failure, Some(DriveError::OtherGoal { actuator: 2 }));
    assert_eq!(report.state[..3], [ActuatorState::QuickStopped, ActuatorState::Lost, ActuatorState::QuickStopped]);
    // Where one of the cycles was silent, it is silence: that says more of a cable.
    for silent in 0..3 {
        let mut bench = Bench::new();
        bench.go(20);
        for cycle in 0..3 {
            let mut truth = bench.truth.lock().unwrap();
            (truth.is_silent[1], truth.knows_other[1]) = (cycle == silent, cycle != silent);
            drop(truth);
            bench.go(1);
        }
        let failure = bench.report().failure;
        assert_eq!(failure, Some(DriveError::Lost { actuator: 2, silent_ms: 15.0 }), "silent in cycle {silent}");
    }
}

#[test]
fn a_hundred_random_drop_outs_never_ask_for_more_than_the_rate() {
    let mut random = ChaCha8Rng::seed_from_u64(16);
    let mut below = |n: u32| random.next_u32() % n;
    for k in 0..100 {
        let mut bench = Bench::new();
        let speeds: Vec<f64> = (0..3 + below(40)).map(|_| (f64::from(below(2001)) - 1000.0) * 2e-5).collect();
        for speed in speeds {
            bench.go_at(speed);
        }
        let lost = below(3) as usize;
        bench.truth.lock().unwrap().is_silent[lost] = true;
        // One that is back before it counts as lost, one that comes back later, one that stays away.
        let n_silent = 1 + below(12);
        let mut fastest = bench.velocity(0);
        for cycle in 0..14 {
            bench.truth.lock().unwrap().is_silent[lost] = cycle < n_silent;
            let is_known = bench.report().failure.is_some();
            bench.go_at((f64::from(below(2001)) - 1000.0) * 2e-5);
            assert!((0..3).all(|k| bench.velocity(k).abs() <= 0.02 * (1.0 + 1e-9)), "drop-out {k}");
            let now = bench.velocity(0);
            // From the failure on all only brake, whatever is wished for.
            let brakes = now == 0.0 || now * fastest > 0.0 && now.abs() < fastest.abs();
            assert!(!is_known || brakes, "drop-out {k}: {now} m/s after {fastest} m/s");
            fastest = now;
        }
        assert_eq!(bench.report().failure.is_some(), n_silent >= 3, "drop-out {k}");
        assert!(n_silent < 3 || bench.velocity(0) == 0.0, "drop-out {k}");
    }
}

#[test]
fn a_slave_that_is_silent_for_longer_than_its_limit_stops_the_drives_and_they_hold() {
    let mut bench = Bench::new();
    bench.go(20);
    let told = bench.cycles.goal_m;
    for _ in 0..9 {
        bench.now_ns += 5 * MS;
        assert_eq!(bench.silent_step().failure, None);
        assert_eq!(bench.cycles.goal_m, told, "the newest wish is held, nothing is invented");
    }
    bench.now_ns += 10 * MS;
    let failure = bench.silent_step().failure;
    assert_eq!(failure, Some(DriveError::Unled { silent_ms: 55.0, limit_ms: 50.0 }));
    bench.go(5);
    assert_eq!((bench.cycles.goal_m, bench.truth.lock().unwrap().is_on), (told, true));
}

#[test]
fn a_stop_that_the_slave_asks_for_brakes_from_where_the_goals_are_and_a_new_turn_begins_there() {
    let mut bench = Bench::new();
    bench.go(20);
    bench.wish.is_stopped = true;
    bench.go(6);
    assert_eq!((bench.velocity(0), bench.report().failure), (0.0, None));
    let rest = bench.cycles.goal_m;
    bench.wish = Wish { turn: 2, has_power: true, q_m: [f64::NAN; 12], ..Wish::default() };
    bench.step();
    assert_eq!(bench.report().phase, Phase::Switching, "the servos are told again, whatever they say");
    bench.step();
    assert_eq!(bench.report().phase, Phase::On);
    assert!((bench.cycles.goal_m[0] - rest[0]).abs() < 1e-7, "to a count");
    bench.go(1);
    assert!((bench.velocity(0) - 0.02).abs() < 1e-5);
}

#[test]
fn a_bus_that_is_gone_is_a_failure_and_every_actuator_is_lost() {
    let mut bench = Bench::new();
    bench.truth.lock().unwrap().is_gone = true;
    let report = bench.step();
    assert_eq!(report.failure, Some(DriveError::Bus { what: crate::texts::PORT_GONE }));
    assert_eq!(report.state[..3], [ActuatorState::Lost; 3]);
    // A new turn asks for it once, and says that it is still gone; what is back goes on from where it stands.
    let turn = |turn, has_power| Wish { turn, has_power, q_m: [f64::NAN; 12], ..Wish::default() };
    bench.wish = turn(2, false);
    let still = Some(DriveError::Bus { what: crate::texts::PORT_STILL_GONE });
    for _ in 0..5 {
        assert_eq!(bench.step().failure, still);
    }
    assert_eq!(bench.truth.lock().unwrap().n_reopened, 1);
    bench.truth.lock().unwrap().is_gone = false;
    assert_eq!(bench.step().failure, still, "nothing resumes by itself");
    bench.wish = turn(3, false);
    for _ in 0..3 {
        assert_eq!(bench.step().failure, None);
    }
    assert!(bench.cycles.is_off(), "the power goes, which nobody could take while the bus was gone");
    bench.wish = turn(4, true);
    bench.step();
    bench.step();
    assert_eq!((bench.report().phase, bench.truth.lock().unwrap().n_reopened), (Phase::On, 2));
}

/// The second lets go in motion while all lines pull with 5 N; so many cycles later. Where each began to give way, and the cycle of
/// the failure.
fn limp(relax_m: f64, relax_ms: f64, n_cycles: usize) -> (Bench, Actuators, usize) {
    let drive = DriveConfig { on_fault: OnFault::Relax, relax_m, relax_ms, ..DriveConfig::default() };
    let mut bench = Bench::with(drive);
    bench.truth.lock().unwrap().current_a = [-5.0; 12];
    bench.go(20);
    bench.truth.lock().unwrap().is_limp[1] = true;
    bench.go(1);
    assert_eq!(bench.report().failure, Some(DriveError::Limp { actuator: 2 }));
    let failed = bench.goals.len();
    let mut rest_m = bench.cycles.goal_m;
    for _ in 0..n_cycles {
        bench.step();
        let relaxes = bench.report().state[0] == ActuatorState::Relaxing;
        if !relaxes && bench.goals.len() < failed + 8 {
            rest_m = bench.cycles.goal_m;
        }
    }
    (bench, rest_m, failed)
}

#[test]
fn who_gives_way_to_a_limp_line_stays_within_its_way_its_speed_and_its_time() {
    // A load that never falls: the way is the bound.
    let (mut bench, rest_m, failed) = limp(0.8e-3, 10_000.0, 160);
    let end_m = bench.cycles.goal_m;
    for k in [0, 2] {
        assert!((end_m[k] - rest_m[k] - 0.8e-3).abs() < 1e-9, "{end_m:?} from {rest_m:?}");
    }
    assert_eq!(end_m[1], rest_m[1], "the limp one is told nothing else");
    assert_eq!(bench.report().state[0], ActuatorState::QuickStopped);
    let recorded: Vec<DriveCycle> = core::iter::from_fn(|| bench.exchange.cycles.pop()).collect();
    let relaxing = recorded.iter().filter(|cycle| cycle.actuators[0].state == ActuatorState::Relaxing as u32).count();
    assert!(relaxing > 50, "the record names it: {relaxing}");
    let steps = |bench: &Bench, from: usize| -> Vec<f64> {
        bench.goals[from..].windows(2).map(|pair| pair[1][0] - pair[0][0]).collect()
    };
    // Braked within five cycles; then never faster than 2 mm/s.
    assert!(steps(&bench, failed + 5).iter().all(|step| (0.0..=2e-3 * 5e-3 * (1.0 + 1e-9)).contains(step)));
    bench.go(40);
    assert_eq!(bench.cycles.goal_m, end_m, "what has ended does not begin again");

    // A time that is over before the way is: nothing moves in any cycle that begins after it.
    let (bench, rest_m, failed) = limp(0.8e-3, 150.0, 160);
    let way_m = bench.cycles.goal_m[0] - rest_m[0];
    assert!(way_m > 0.05e-3 && way_m < 0.4e-3, "{way_m}");
    let after = steps(&bench, failed + 150 / 5);
    assert!(after.len() > 100 && after.iter().all(|step| *step == 0.0), "{after:?}");

    // A load that turns round on the way is left where it is.
    let (mut bench, ..) = limp(0.8e-3, 10_000.0, 30);
    bench.truth.lock().unwrap().current_a = [5.0; 12];
    bench.step();
    let stopped_m = bench.cycles.goal_m;
    bench.go(40);
    let late_m = bench.cycles.goal_m;
    assert!((0..3).all(|k| (late_m[k] - stopped_m[k]).abs() < 1e-5), "{late_m:?} from {stopped_m:?}");
}

/// Six lines in motion by the first three, and one lets go: who went on for more than braking takes, and who was said to relax.
#[test]
fn of_two_groups_only_the_antagonists_of_a_limp_line_give_way_and_the_other_group_holds() {
    for (groups, limp, expected) in [
        ([1, 1, 1, 2, 2, 2], 1, vec![0, 2]),
        ([1, 1, 1, 2, 2, 2], 4, vec![3, 5]),
        ([1, 2, 1, 2, 1, 2], 0, vec![2, 4]),
        ([1; 6], 1, vec![0, 2, 3, 4, 5]),
        ([1, 1, 1, 2, 3, 3], 3, vec![]),
    ] {
        let actuator = groups.map(|group| ActuatorConfig { group, ..ActuatorConfig::default() }).to_vec();
        let (on_fault, relax_m, relax_ms) = (OnFault::Relax, 0.8e-3, 10_000.0);
        let mut bench = Bench::with(DriveConfig { on_fault, relax_m, relax_ms, actuator, ..DriveConfig::default() });
        bench.truth.lock().unwrap().current_a = [-5.0; 12];
        bench.go(20);
        bench.truth.lock().unwrap().is_limp[limp] = true;
        bench.go(1);
        assert_eq!(bench.report().failure, Some(DriveError::Limp { actuator: limp + 1 }));
        let failed_m = bench.cycles.goal_m;
        let mut relaxing = [false; 6];
        for _ in 0..160 {
            let state = bench.step().state;
            (0..6).for_each(|k| relaxing[k] |= state[k] == ActuatorState::Relaxing);
        }
        // Braking from 20 mm/s at 1 m/s2 takes 0.2 mm.
        let went = |k: &usize| (bench.cycles.goal_m[*k] - failed_m[*k]).abs() > 0.5e-3;
        assert_eq!((0..6).filter(went).collect::<Vec<_>>(), expected, "{groups:?}: {limp} is limp");
        assert_eq!((0..6).filter(|k| relaxing[*k]).collect::<Vec<_>>(), expected, "{groups:?}: {limp} is limp");
    }
}
