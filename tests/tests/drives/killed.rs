//! The slave is killed in motion: its servos end at their last goal, and the slave that comes back moves nothing by itself.

use super::*;
use krait_drives::emulator::ToldGoal;
use krait_tests::{kill_until_back, samples_in};
use rustix::process::{Pid, kill_process};

/// Of the configuration.
const PERIOD_NS: i64 = 20_000_000;
/// Its rate of 10 mm/s, on a spool of 8 mm.
const RATE_COUNTS_PER_S: f64 = 0.01 * 4096.0 / (core::f64::consts::TAU * 0.008);
/// Way after which a servo counts as moved, counts.
const MOVED: i32 = 10;

/// When it was told, the last goal was at most a period of travel away, and so much longer as the bus was late itself. The slave ticks
/// once a millisecond, and a goal is a whole count. The newest goal is the first.
fn check_last(told: [ToldGoal; 3]) {
    let [last, before, earlier] = told;
    let periods_ns = [last.at_ns - before.at_ns, last.at_ns - earlier.at_ns];
    // One that came early found the servo still on the way to the goal before.
    let period_ns = periods_ns[usize::from(periods_ns[0] < PERIOD_NS)].max(PERIOD_NS);
    let travel = RATE_COUNTS_PER_S * (period_ns as f64 * 1e-9 + 2e-3) + 1.0;
    assert!((last.place - f64::from(last.goal)).abs() <= travel, "{told:?}: more than {travel} counts");
}

#[test]
fn a_slave_that_is_killed_in_motion_leaves_the_servos_at_their_last_goal() {
    killed_in_motion(ServoMake::Sts3215);
}

#[test]
#[ignore = "what another test does, with the other make; .ci/run runs it"]
fn a_slave_that_is_killed_in_motion_leaves_the_xl330_servos_at_their_last_goal() {
    killed_in_motion(ServoMake::Xl330);
}

fn killed_in_motion(make: ServoMake) {
    let (instance, folder, emulator) = (instance_name("killed"), TempFolder::new("killed"), emulator(make));
    let krait = in_motion(&instance, &configuration(make, &folder, &emulator, ""), &folder.file("run.mcap"), &emulator);
    let slave = || pid_of(&instance, "slave");
    let pid = Pid::from_raw(slave().expect("a slave").cast_signed()).expect("a process id");
    // The supervisor is stopped first, so that no second slave touches the bus.
    krait.signal(Signal::STOP);
    kill_process(pid, Signal::KILL).expect("the slave lives");
    std::thread::sleep(Duration::from_millis(300));
    let goals: Vec<i32> = emulator.wire().servos.iter().map(Servo::goal).collect();
    let n_requests = emulator.wire().n_requests;
    std::thread::sleep(Duration::from_millis(300));
    let wire = emulator.wire().clone();
    assert_eq!(wire.n_requests, n_requests, "nobody speaks any more");
    for (servo, goal) in wire.servos.iter().zip(&goals) {
        assert!(servo.is_powered() && servo.goal() == *goal && servo.told[0].goal == *goal && *goal > 0);
        check_last(servo.told);
    }
    let moving = wire.servos.iter().filter(|servo| servo.told[0].place.round() != f64::from(servo.goal()));
    assert!(moving.count() > 0, "killed in motion: {:?}", wire.servos);
    // Who looks now finds each at its last goal; a look tells nothing.
    let port = emulator.path().display().to_string();
    let found = Ended::of(&["drives", "--port", &port, "--last-id", "3", "--json"], PATIENCE).json();
    for (servo, goal) in found.as_array().expect("servos").iter().zip(&goals) {
        assert_eq!((&servo["reading"]["counts"], &servo["reading"]["is_powered"]), (&(*goal).into(), &true.into()));
    }
    let told = |wire: &ServoWire| wire.servos.iter().map(|servo| servo.n_goals).collect::<Vec<_>>();
    assert_eq!(told(&emulator.wire()), told(&wire), "nothing was told");
    krait.signal(Signal::CONT);
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
}

#[test]
fn a_slave_that_comes_back_holds_the_servos_at_their_last_goal_until_the_operator_takes_hold_anew() {
    killed_and_back(ServoMake::Sts3215);
}

#[test]
#[ignore = "what another test does, with the other make; .ci/run runs it"]
fn a_slave_that_comes_back_holds_the_xl330_servos_at_their_last_goal_until_the_operator_takes_hold_anew() {
    killed_and_back(ServoMake::Xl330);
}

/// A hand that goes to and fro for seven and a half seconds, lets go for half a second, and so on.
fn restless_hand(folder: &TempFolder) -> String {
    let mut text = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present\n0,0,0,0,0\n".to_owned();
    for hold in 0..20 {
        let begin_s = 0.5 + 8.0 * f64::from(hold);
        for stroke in 0..5 {
            let (at_s, speed) = (begin_s + 1.5 * f64::from(stroke), if stroke % 2 == 0 { 0.012 } else { -0.012 });
            text += &format!("{at_s},{speed},0,0,1\n{},{speed},0,0,1\n", at_s + 1.49);
        }
        text += &format!("{},0,0,0,0\n", begin_s + 7.5);
    }
    let path = folder.file("hand.csv");
    std::fs::write(&path, text).expect("written");
    path
}

/// When the slave that came back had the bus open, when it said first that the operator had engaged, CLOCK_MONOTONIC, ns, and how many
/// inputs between the two asked for motion.
fn came_back(recording: &str) -> (i64, i64, usize) {
    let samples = samples_in(recording);
    let mut newest = 0;
    let opened_ns = samples.iter().find_map(|sample| match sample {
        Sample::DriveCycle(cycle) => (core::mem::replace(&mut newest, cycle.cycle) > cycle.cycle)
            .then(|| cycle.sample_ns - cycle.cycle as i64 * PERIOD_NS),
        _ => None,
    });
    let opened_ns = opened_ns.expect("a second slave has opened the bus");
    let engaged_ns = samples.iter().find_map(|sample| match sample {
        Sample::State(state) => (state.sample_ns > opened_ns && state.is_engaged()).then_some(state.sample_ns),
        _ => None,
    });
    let engaged_ns = engaged_ns.expect("the operator took hold anew");
    let asks = |sample: &&Sample| match sample {
        Sample::Input(input) => {
            (opened_ns..engaged_ns).contains(&input.sample_ns) && input.tip_vel_in_view_m_per_s != [0.0; 3]
        }
        _ => false,
    };
    (opened_ns, engaged_ns, samples.iter().filter(asks).count())
}

/// The supervisor lives and starts the slave again, while the hand is held all the time; judged by every goal that the servos were told.
fn killed_and_back(make: ServoMake) {
    let (instance, folder, emulator) = (instance_name("back"), TempFolder::new("back"), emulator(make));
    emulator.wire().servos.iter_mut().for_each(|servo| servo.all_told = Some(Vec::new()));
    let (config, hand) = (configuration(make, &folder, &emulator, ""), restless_hand(&folder));
    let recording = folder.file("run.mcap");
    let run = ["run", "--engage", "--instance", &instance, "--config", &config, "--recording", &recording];
    let krait = Krait::start(&[&run[..], &["--master", "script", "--input", &hand]].concat());
    assert!(wait_until(PATIENCE, || farthest(&emulator) > 20.0), "the servos move: {:?}", emulator.wire().servos);
    kill_until_back(&instance, "slave", || {});
    let goals = || emulator.wire().servos.iter().map(Servo::goal).collect::<Vec<_>>();
    let held = goals();
    let moves_again = || goals().iter().zip(&held).any(|(goal, held)| goal.abs_diff(*held) > MOVED.unsigned_abs());
    assert!(wait_until(PATIENCE, moves_again), "it moves again: {:?}", goals());
    assert!(emulator.wire().servos.iter().all(Servo::is_powered), "under power all the time");
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(1), "a loss is no success: {}", ended.stderr);

    let (opened_ns, engaged_ns, n_asks) = came_back(&recording);
    assert!(n_asks > 0, "the hand asked for motion all the time");
    let servos = emulator.wire().servos.clone();
    let all = servos.iter().map(|servo| servo.all_told.clone().expect("kept")).collect::<Vec<_>>();
    let mut was_moving = false;
    for (told, held) in all.iter().zip(&held) {
        let before: Vec<&ToldGoal> = told.iter().filter(|told| told.at_ns < opened_ns).collect();
        let [.., earlier, second, last] = before[..] else { panic!("three goals of the slave that was killed") };
        check_last([*last, *second, *earlier]);
        was_moving |= last.goal != second.goal;
        assert_eq!(last.goal, *held, "nobody told another goal before the bus was open again");
        // The slave that came back takes them over where they stand.
        let after = told.iter().filter(|told| (opened_ns..engaged_ns).contains(&told.at_ns));
        let after: Vec<&ToldGoal> = after.collect();
        assert!(after.len() > 3, "it holds them: {after:?}");
        for told in after {
            let way = [f64::from(told.goal), told.place].map(|at| (at - f64::from(last.goal)).abs());
            assert!(way.iter().all(|way| *way <= 1.0), "{told:?} after {last:?}");
        }
    }
    assert!(was_moving, "killed in motion: {all:?}");
}
