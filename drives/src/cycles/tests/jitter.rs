//! A bus and a slave whose times run apart: nothing passes the slave's rate, also not where braking begins.

use super::*;

/// The slave's tick, and the bus's period in these tests.
const TICK_NS: i64 = MS;
const PERIOD_NS: i64 = 5 * MS;

/// A slave that goes at its full rate, in ticks of its own, beside the bench's bus.
struct Apart {
    bench: Bench,
    rate_m_per_s: f64,
    ticked_ns: i64,
    way_m: f64,
}

impl Apart {
    fn new() -> Self {
        let bench = Bench::new();
        let (rate_m_per_s, ticked_ns) = (SlaveConfig::default().limits.rate_m_per_s, bench.now_ns);
        Self { bench, rate_m_per_s, ticked_ns, way_m: 0.0 }
    }

    /// A cycle that begins so much later than the one before, and finds the wish of the newest tick; the step of each goal, m.
    fn cycle(&mut self, after_ns: i64, direction: f64) -> Actuators {
        self.bench.now_ns += after_ns;
        while self.ticked_ns + TICK_NS <= self.bench.now_ns {
            self.ticked_ns += TICK_NS;
            self.way_m += direction * self.rate_m_per_s * TICK_NS as f64 * 1e-9;
        }
        self.bench.wish.q_m = krait_slave::lines([self.way_m, -0.5 * self.way_m, -0.5 * self.way_m]);
        self.bench.wish.stamp_ns = self.ticked_ns;
        self.bench.silent_step();
        let [.., before, now] = &self.bench.goals[..] else { panic!("two cycles") };
        core::array::from_fn(|k| now[k] - before[k])
    }

    fn most_m(&self) -> f64 {
        self.rate_m_per_s * PERIOD_NS as f64 * 1e-9 * ROUNDING
    }
}

#[test]
fn a_hundred_drop_outs_at_full_rate_beside_a_bus_that_jitters_and_pauses_stay_within_the_rate() {
    let mut random = ChaCha8Rng::seed_from_u64(61);
    let mut below = |n: u32| i64::from(random.next_u32() % n);
    for k in 0..100 {
        let mut apart = Apart::new();
        // Up to a tick early or late, and now and then 20 ms of wishes in one cycle.
        let after_ns = |below: &mut dyn FnMut(u32) -> i64| {
            PERIOD_NS + (below(2001) - 1000) * 1000 + if below(10) == 0 { 3 * PERIOD_NS } else { 0 }
        };
        // Short enough to end within the travel.
        for _ in 0..5 + below(10) {
            let step_m = apart.cycle(after_ns(&mut below), 1.0);
            assert!(largest(step_m) <= apart.most_m(), "drop-out {k}: {step_m:?} m");
        }
        apart.bench.truth.lock().unwrap().is_silent[below(3) as usize] = true;
        while apart.bench.report().failure.is_none() {
            let step_m = apart.cycle(after_ns(&mut below), 1.0);
            assert!(largest(step_m) <= apart.most_m(), "drop-out {k}: {step_m:?} m");
        }
        let (known_m, mut last_m) = (apart.bench.cycles.goal_m[0], apart.most_m());
        for _ in 0..20 {
            let step_m = apart.cycle(after_ns(&mut below), 1.0)[0];
            assert!((0.0..=last_m).contains(&step_m), "drop-out {k}: {step_m} m after {last_m} m");
            last_m = step_m;
        }
        assert_eq!(last_m, 0.0, "drop-out {k}");
        let way_m = apart.bench.cycles.goal_m[0] - known_m;
        let most_m = apart.rate_m_per_s.powi(2) / (2.0 * apart.bench.cycles.setup.deceleration_m_per_s2);
        assert!(way_m <= most_m, "drop-out {k}: {way_m} m to rest, {most_m} m at the rate's own deceleration");
        // The slowest that such cycles look is three ticks in one.
        assert!(way_m >= 0.2 * most_m, "drop-out {k}: {way_m} m to rest: a motion that stopped at once");
    }
}

#[test]
fn what_a_pause_of_the_bus_left_behind_is_caught_up_at_the_rate_once_the_wishes_rest() {
    let mut apart = Apart::new();
    for _ in 0..10 {
        apart.cycle(PERIOD_NS, 1.0);
    }
    apart.cycle(4 * PERIOD_NS, 1.0);
    let behind_m = apart.way_m - apart.bench.cycles.goal_m[0];
    assert!((behind_m - 3.0 * apart.most_m()).abs() < 1e-8, "{behind_m} m behind");
    let steps_m: Vec<f64> = (0..6).map(|_| apart.cycle(PERIOD_NS, 0.0)[0]).collect();
    assert!(steps_m[..3].iter().all(|step_m| (step_m - apart.most_m()).abs() < 1e-8), "{steps_m:?}");
    assert_eq!((&steps_m[3..], apart.bench.cycles.goal_m[0]), (&[0.0; 3][..], apart.way_m));
}

#[test]
fn a_cycle_that_finds_no_new_wish_in_the_middle_of_a_motion_does_not_stop_it_at_once() {
    let mut apart = Apart::new();
    for _ in 0..10 {
        apart.cycle(PERIOD_NS, 1.0);
    }
    // The slave is late by one period, and an actuator says in that very cycle that it has let go.
    apart.bench.truth.lock().unwrap().is_limp[1] = true;
    apart.ticked_ns += PERIOD_NS;
    assert_eq!(apart.cycle(PERIOD_NS, 1.0)[0], 0.0);
    assert!(apart.bench.report().failure.is_some());
    let lost_m_per_s = apart.bench.cycles.setup.deceleration_m_per_s2 * PERIOD_NS as f64 * 1e-9;
    let brakes_m = (apart.rate_m_per_s - lost_m_per_s) * PERIOD_NS as f64 * 1e-9;
    assert!((apart.cycle(PERIOD_NS, 1.0)[0] - brakes_m).abs() < 1e-9);
    // Two such cycles are a rest: from there nothing moves.
    let mut apart = Apart::new();
    for _ in 0..10 {
        apart.cycle(PERIOD_NS, 1.0);
    }
    apart.ticked_ns += 2 * PERIOD_NS;
    apart.cycle(PERIOD_NS, 1.0);
    apart.bench.truth.lock().unwrap().is_limp[1] = true;
    apart.cycle(PERIOD_NS, 1.0);
    assert!(apart.bench.report().failure.is_some());
    assert_eq!(apart.cycle(PERIOD_NS, 1.0)[0], 0.0);
}

#[test]
fn an_actuator_with_a_rate_of_its_own_goes_no_further_in_a_cycle_and_all_brake_by_one_factor_from_there() {
    let mut own = Bench::whole(DriveConfig { kind: DriveKind::Sts3215, ..DriveConfig::default() });
    own.drive.actuator[1].rate_m_per_s = Some(4e-3);
    let mut apart = Apart { bench: Bench::of(own), ..Apart::new() };
    apart.ticked_ns = apart.bench.now_ns;
    for _ in 0..10 {
        let step_m = apart.cycle(PERIOD_NS, 1.0);
        assert!(step_m[1].abs() <= 4e-3 * PERIOD_NS as f64 * 1e-9 * ROUNDING, "{step_m:?} m");
        assert!((step_m[0] + 2.0 * step_m[1]).abs() < 1e-12, "the direction stays: {step_m:?} m");
    }
    apart.bench.truth.lock().unwrap().is_limp[2] = true;
    apart.cycle(PERIOD_NS, 1.0);
    assert!(apart.bench.report().failure.is_some());
    // The first is the fastest, at 8 mm/s: it loses 5 mm/s a period, and the second the same part of its own 4.
    let step_m = apart.cycle(PERIOD_NS, 1.0);
    assert!((step_m[0] - 3e-3 * 5e-3).abs() < 1e-9 && (step_m[1] + 1.5e-3 * 5e-3).abs() < 1e-9, "{step_m:?} m");
    assert_eq!(apart.cycle(PERIOD_NS, 1.0), [0.0; MAX_ACTUATORS]);
}
