//! How each fault of one servo, of the line, or of the whole bus ends for all, judged from the recorded cycles: three servos in motion, one wish a cycle.

mod whole_bus;

use crate::rig::{Rig, config, on_each_make, three};
use krait_drives::emulator::{Emulator, Faults, ServoWire};
use krait_drives::{ServoMake, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, DriveCycle};
use krait_slave::{Drive, SlaveConfig, lines};
use std::time::Duration;

/// Counts of a metre of the default spool.
const PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
/// Where the motion turns round, m.
const TURN_M: f64 = 5.4e-3;
/// The largest rate; the motion is half as fast, since two wishes may fall into a cycle, m/s.
const RATE_M_PER_S: f64 = 0.03;
/// So slow that braking takes some cycles, m/s2.
const DECELERATION_M_PER_S2: f64 = 0.1;

/// How often a motion is repeated in which a busy machine had no wish for one of the cycles before the failure.
const MOST_ATTEMPTS: usize = 12;

/// Servos in motion, and all that was recorded of it.
struct Motion {
    rig: Rig,
    cycles: Vec<DriveCycle>,
    period_s: f64,
    q_m: f64,
    sign: f64,
    /// When this program last read, ns.
    read_ns: i64,
    /// The longest time for which it did not, ns: longer than a cycle, and a cycle had no wish of its own.
    longest_pause_ns: i64,
}

impl Motion {
    fn begin(make: ServoMake, change: impl FnOnce(&mut SlaveConfig)) -> Self {
        let emulator = Emulator::start(three(make)).unwrap();
        let mut config = config(make, &emulator);
        config.limits.rate_m_per_s = RATE_M_PER_S;
        config.deceleration_m_per_s2 = DECELERATION_M_PER_S2;
        change(&mut config);
        let period_s = config.drive.period_ms * 1e-3;
        let mut rig = Rig { drive: open_drive(&config, None).unwrap(), emulator };
        rig.power_up();
        let mut motion = Self {
            rig,
            cycles: Vec::new(),
            period_s,
            q_m: 0.0,
            sign: 1.0,
            read_ns: monotonic_ns(),
            longest_pause_ns: 0,
        };
        motion.go(1);
        motion.begin_anew();
        motion
    }

    /// What was recorded until now is forgotten.
    fn begin_anew(&mut self) {
        self.cycles.clear();
        self.longest_pause_ns = 0;
    }

    /// Whether the machine stood still for half a cycle, as seen by this program or by the bus.
    fn stood_still(&self) -> bool {
        let late_ns = self.cycles.windows(2).map(|two| two[1].sample_ns - two[0].sample_ns);
        let period_ns = self.period_s * 1e9;
        let longest_ns = late_ns.max().map_or(0.0, |longest_ns| longest_ns as f64 - period_ns);
        (self.longest_pause_ns as f64).max(longest_ns) > 0.5 * period_ns
    }

    /// The cycle in which the failure was found out.
    fn failed(&self) -> usize {
        self.cycles.iter().position(|cycle| cycle.failure != 0).unwrap()
    }

    /// Whether each of the last cycles before the failure had a wish of its own: the speed that is braked is theirs. On a machine under load
    /// one may come late.
    fn had_every_wish(&self) -> bool {
        let failed = self.failed();
        self.steps(0)[failed.saturating_sub(3)..failed].iter().all(|step| *step != 0)
    }

    /// So many cycles more: a wish for each, which is refused once something has failed.
    fn go(&mut self, n: usize) {
        let end = self.cycles.len() + n;
        for _ in 0..20_000 {
            std::thread::sleep(Duration::from_millis(1));
            let now_ns = monotonic_ns();
            self.longest_pause_ns = self.longest_pause_ns.max(now_ns - self.read_ns);
            self.read_ns = now_ns;
            self.rig.drive.read(now_ns).unwrap();
            let before = self.cycles.len();
            self.cycles.extend(core::iter::from_fn(|| self.rig.drive.next_cycle()));
            if self.cycles.len() > before {
                let step_m = 0.5 * RATE_M_PER_S * self.period_s;
                if (self.q_m + self.sign * step_m).abs() > TURN_M {
                    self.sign = -self.sign;
                }
                self.q_m += self.sign * step_m;
                let written = self.rig.drive.write(monotonic_ns(), lines([self.q_m, -0.5 * self.q_m, -0.5 * self.q_m]));
                assert!(written.is_ok() || self.rig.drive.failure().is_some(), "{written:?}");
            }
            if self.cycles.len() >= end {
                return;
            }
        }
        panic!("no {n} cycles");
    }

    fn wire(&self) -> std::sync::MutexGuard<'_, ServoWire> {
        self.rig.emulator.wire()
    }

    /// Ways of the goal of an actuator from each cycle to the next, counts.
    fn steps(&self, k: usize) -> Vec<i32> {
        let goal = |cycle: &DriveCycle| cycle.actuators[k].told_counts;
        self.cycles.windows(2).map(|two| goal(&two[1]) - goal(&two[0])).collect()
    }
}

/// After the failure of the second: how many steps the others took to come to rest.
fn judge_stop(motion: &Motion, what: &str) -> usize {
    let failed = motion.failed();
    assert!(motion.cycles[failed..].iter().all(|cycle| cycle.failure == motion.cycles[failed].failure), "{what}");
    assert_eq!(motion.cycles[failed].failure_actuator, 2, "{what}");
    let [first, third] = [motion.steps(0), motion.steps(2)];
    let most = (RATE_M_PER_S * motion.period_s * PER_M).ceil() as i32;
    assert!(first.iter().chain(&third).all(|step| step.abs() <= most), "{what}: {first:?} {third:?}, at most {most}");
    // The goal of the cycle in which it was found out is the last that a wish has moved.
    let [begin, slower] = [f64::from(first[failed - 1]), DECELERATION_M_PER_S2 * motion.period_s.powi(2) * PER_M];
    for (n, (own, other)) in (1..).zip(first[failed..].iter().zip(&third[failed..])) {
        let expected = begin.signum() * (begin.abs() - f64::from(n) * slower).max(0.0);
        assert!((f64::from(*own) - expected).abs() <= 2.0, "{what}: {own} after {n} cycles, {expected} of {first:?}");
        assert!((f64::from(*other) + 0.5 * f64::from(*own)).abs() <= 2.0, "{what}: one factor, {own} and {other}");
    }
    let n_steps = first[failed..].iter().take_while(|step| **step != 0).count();
    let still = |steps: &[i32]| steps.len() >= 5 && steps.iter().all(|step| *step == 0);
    assert!(still(&first[failed + n_steps + 1..]) && still(&third[failed + n_steps + 1..]), "{what}: they stay");
    let holds = |cycle: &DriveCycle| [0, 2].iter().all(|k| cycle.actuators[*k].has(ActuatorCycle::POWERED));
    assert!(motion.cycles.iter().all(holds), "{what}: under power");
    n_steps
}

/// Three actuators in motion of which the second fails, comes back, and the slave goes on asking for motion.
fn failed_motion(make: ServoMake, what: &str, break_it: fn(&Emulator)) -> Motion {
    let mut motion = Motion::begin(make, |_| {});
    // Far from where it turns round; a leap is more than half a turn, and is known at once.
    motion.go(if what == "leap" { 6 } else { 3 });
    break_it(&motion.rig.emulator);
    while motion.rig.drive.failure().is_none() {
        assert!(motion.cycles.len() < 100, "{make:?} {what}: nothing has failed");
        motion.go(1);
    }
    motion.go(5);
    motion.wire().servos[1].faults = Faults::default();
    motion.go(8);
    motion
}

#[test]
fn whatever_fails_in_motion_the_recorded_goals_of_the_others_come_to_rest_by_one_factor_and_stay() {
    type Case = (&'static str, fn(&Emulator));
    let cases: [Case; 7] = [
        ("silent", |e| e.wire().servos[1].faults.is_silent = true),
        ("deaf", |e| e.wire().servos[1].faults.is_deaf = true),
        ("overload", |e| {
            let servo = &mut e.wire().servos[1];
            (servo.overload, servo.load) = (0.5, 0.6);
        }),
        ("brown-out", |e| e.wire().servos[1].brown_out()),
        ("heat", |e| e.wire().servos[1].faults.error = 4),
        ("supply", |e| e.wire().servos[1].faults.error = 1),
        ("leap", |e| e.wire().servos[1].place = 4094.0),
    ];
    on_each_make(|make| {
        let mut n_ramps = 0;
        for (what, break_it) in cases {
            println!("{make:?} {what}");
            let motion = (0..MOST_ATTEMPTS).map(|_| failed_motion(make, what, break_it)).find(Motion::had_every_wish);
            let motion =
                motion.unwrap_or_else(|| panic!("{make:?} {what}: this machine is too busy to send a wish each cycle"));
            n_ramps += usize::from(judge_stop(&motion, &format!("{make:?} {what}")) > 1);
        }
        assert!(n_ramps > 0, "{make:?}: nobody had anything to brake");
    });
}

/// What a fault of the line costs.
#[derive(Clone, Copy, PartialEq)]
enum Costs {
    Nothing,
    Answer,
    Goal,
}

#[test]
fn a_fault_of_the_line_in_motion_costs_readings_of_one_servo_and_the_goals_go_on() {
    type Row = (&'static str, fn(&mut ServoWire), Costs);
    let rows: [Row; 11] = [
        ("checksum", |w| w.servos[1].faults.bad_checksum = 1, Costs::Answer),
        ("cut short", |w| w.servos[1].faults.cut_short = 1, Costs::Answer),
        ("other id", |w| w.servos[1].faults.other_id = 1, Costs::Answer),
        ("wrong length", |w| w.servos[1].faults.wrong_length = 1, Costs::Answer),
        ("silent", |w| w.servos[1].faults.is_silent = true, Costs::Answer),
        ("later than the time-out", |w| w.servos[1].faults.late = Duration::from_millis(80), Costs::Answer),
        ("deaf", |w| w.servos[1].faults.is_deaf = true, Costs::Goal),
        ("stray byte", |w| w.servos[1].faults.stray_byte = 1, Costs::Nothing),
        (
            "two pieces",
            |w| (w.servos[1].faults.two_pieces, w.servos[1].faults.late) = (1, Duration::from_millis(3)),
            Costs::Nothing,
        ),
        ("late, but in time", |w| w.servos[1].faults.late = Duration::from_millis(10), Costs::Nothing),
        ("echo", |w| w.echoes = true, Costs::Nothing),
    ];
    on_each_make(|make| {
        // Long cycles: what is late by itself on a machine under load is in time here.
        let begin = || Motion::begin(make, |config| (config.drive.period_ms, config.drive.timeout_ms) = (60.0, 50.0));
        let mut motion = begin();
        for (what, set, costs) in rows {
            let what = format!("{make:?} {what}");
            // Where the machine stood still, goals and answers are missing that the line did not cost.
            let is_told = (0..10).any(|_| {
                break_line(&mut motion, set, costs, &what);
                if !motion.stood_still() {
                    return true;
                }
                println!("{what}: the machine stood still; once more");
                if motion.rig.drive.failure().is_some() {
                    motion = begin();
                }
                false
            });
            assert!(is_told, "{what}: the machine stood still ten times");
            judge_line(&motion, costs, &what);
        }
    });
}

/// One fault of the second servo's line until a cycle shows it, and three whole cycles.
fn break_line(motion: &mut Motion, set: fn(&mut ServoWire), costs: Costs, what: &str) {
    let is_seen = |cycle: &DriveCycle| match costs {
        Costs::Nothing => true,
        Costs::Answer => !has_answered(cycle, 1),
        Costs::Goal => cycle.actuators[1].goal_counts != cycle.actuators[1].told_counts,
    };
    motion.go(1);
    motion.begin_anew();
    set(&mut motion.wire());
    motion.go(1);
    while !motion.cycles.iter().any(is_seen) {
        assert!(motion.cycles.len() < 4, "{what}: nobody has noticed");
        motion.go(1);
    }
    {
        let mut wire = motion.wire();
        let Faults { stray_byte, two_pieces, .. } = wire.servos[1].faults;
        assert_eq!(stray_byte + two_pieces, 0, "{what}: it was sent");
        (wire.servos[1].faults, wire.echoes) = (Faults::default(), false);
    }
    motion.go(3);
}

fn judge_line(motion: &Motion, costs: Costs, what: &str) {
    let cycles = &motion.cycles;
    assert!(cycles.iter().all(|cycle| cycle.failure == 0), "{what}");
    // The wire is one: behind a servo that is late all are late.
    let others = |cycle: &DriveCycle| has_answered(cycle, 0) && has_answered(cycle, 2);
    assert!(what.contains("later") || cycles.iter().all(others), "{what}: the others go on");
    let n_missing = cycles.iter().filter(|cycle| !has_answered(cycle, 1)).count();
    assert!(n_missing <= 2 && (n_missing > 0) == (costs == Costs::Answer), "{what}: {n_missing} are missing");
    let last = cycles.last().unwrap();
    for k in 0..3 {
        let steps = motion.steps(k);
        assert!(steps.iter().filter(|step| **step != 0).count() + 1 >= steps.len(), "{what}: {k} {steps:?}");
        let own = last.actuators[k];
        assert!(has_answered(last, k) && own.goal_counts == own.told_counts, "{what}: whole again");
    }
}

fn has_answered(cycle: &DriveCycle, k: usize) -> bool {
    cycle.actuators[k].has(ActuatorCycle::ANSWERED)
}
