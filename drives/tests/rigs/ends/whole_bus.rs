//! How what befalls the whole bus ends for all servos in motion: the adapter is unplugged, or the slave falls silent.

use super::{Motion, PER_M, RATE_M_PER_S};
use crate::rig::{on_each_make, three};
use krait_drives::emulator::Emulator;
use krait_ipc::message::{ActuatorCycle, DriveCycle};
use krait_slave::Drive;
use std::fs;
use std::os::unix::fs::symlink;
use std::time::Duration;

/// Kinds of failures, as they are recorded.
const BUS: u32 = 7;
const UNLED: u32 = 8;
const ALL_LOST: u32 = 11;
/// Phase of a bus that brakes or rests.
const STOPPED: u32 = 3;
/// How long the slave may be silent, ms.
const WISH_MS: i64 = 600;

/// Before anything failed all moved, by no more than the rate allows.
fn judge_motion(motion: &Motion, failed: usize, what: &str) {
    let most = (RATE_M_PER_S * motion.period_s * PER_M).ceil() as i32;
    for k in 0..3 {
        let steps = motion.steps(k);
        let before = &steps[..failed - 1];
        assert!(before.iter().all(|step| step.abs() <= most), "{what}: {k} {before:?}, at most {most}");
        assert!(before.iter().any(|step| *step != 0), "{what}: {k} {before:?}, in motion");
    }
}

#[test]
fn an_adapter_that_is_unplugged_in_motion_takes_no_goal_any_more_also_when_it_is_plugged_in_again() {
    on_each_make(|make| {
        let what = format!("{make:?}");
        let folder = std::env::temp_dir().join(format!("krait-unplugged-{make:?}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        // As a lasting name in /dev/serial/by-id is one.
        let link = folder.join("adapter");
        let mut motion = Motion::begin(make, |config| {
            symlink(config.drive.port.take().unwrap(), &link).unwrap();
            config.drive.port = Some(link.clone());
        });
        motion.go(4);
        let unplugged = core::mem::replace(&mut motion.rig.emulator, Emulator::start(three(make)).unwrap());
        drop(unplugged);
        while motion.rig.drive.failure().is_none() {
            assert!(motion.cycles.len() < 100, "{what}: nobody has noticed");
            motion.go(1);
        }
        motion.go(4);
        fs::remove_file(&link).unwrap();
        symlink(motion.rig.emulator.path(), &link).unwrap();
        // The slave goes on asking for motion.
        motion.go(8);
        let failed = motion.cycles.iter().position(|cycle| cycle.failure != 0).unwrap();
        judge_motion(&motion, failed, &what);
        for cycle in &motion.cycles[failed..] {
            assert_eq!((cycle.failure, cycle.failure_actuator, cycle.phase), (BUS, 0, STOPPED), "{what}");
            let is_gone = cycle.has(DriveCycle::GONE_TELLING) || cycle.has(DriveCycle::GONE_ASKING);
            assert!(is_gone && !cycle.has(DriveCycle::SWITCHED_ON), "{what}: {cycle:?}");
        }
        // In the cycle in which it is found out the goals may have gone out already; after that none do.
        assert!(motion.cycles[failed + 1..].iter().all(|cycle| !cycle.has(DriveCycle::TOLD)), "{what}");
        let failure = motion.rig.drive.failure().unwrap().to_string();
        assert!(failure.contains("its port is gone"), "{what}: {failure}");
        let wire = motion.wire().clone();
        assert_eq!(wire.n_requests, 0, "{what}: what is plugged in again is not even asked");
        fs::remove_dir_all(folder).unwrap();
    });
}

#[test]
fn a_bus_on_which_nobody_answers_any_more_in_motion_comes_to_rest_at_the_goals_by_its_ramp() {
    on_each_make(|make| {
        let what = format!("{make:?}");
        let mut motion = Motion::begin(make, |_| {});
        motion.go(4);
        motion.wire().servos.iter_mut().for_each(|servo| servo.faults.is_silent = true);
        while motion.rig.drive.failure().is_none() {
            assert!(motion.cycles.len() < 100, "{what}: nobody has noticed");
            motion.go(1);
        }
        motion.go(5);
        // Others that nobody can see may hear: their goals brake, and stay when all are back.
        motion.wire().servos.iter_mut().for_each(|servo| servo.faults.is_silent = false);
        motion.go(8);
        let failed = motion.failed();
        judge_motion(&motion, failed, &what);
        let failure = motion.rig.drive.failure().unwrap().to_string();
        assert!(failure.starts_with("no drive answers any more, for "), "{what}: {failure}");
        assert_eq!((motion.cycles[failed].failure, motion.cycles[failed].failure_actuator), (ALL_LOST, 0), "{what}");
        for k in 0..3 {
            let steps = &motion.steps(k)[failed - 1..];
            assert!(steps.windows(2).all(|two| two[1].abs() <= two[0].abs()), "{what}: slower and slower {steps:?}");
            assert!(steps[steps.len() - 5..].iter().all(|step| *step == 0), "{what}: they stay {steps:?}");
        }
        assert!(motion.cycles[failed..].iter().all(|cycle| cycle.failure == motion.cycles[failed].failure), "{what}");
        assert!(!motion.cycles[failed..].iter().any(|cycle| cycle.has(DriveCycle::SWITCHED_ON)), "{what}");
    });
}

#[test]
fn a_slave_that_is_silent_for_too_long_in_motion_leaves_all_at_its_last_wish_and_nothing_resumes_when_it_is_back() {
    on_each_make(|make| {
        let what = format!("{make:?}");
        let mut motion = Motion::begin(make, |config| config.drive.wish_ms = WISH_MS as f64);
        motion.go(4);
        // It says nothing at all; cycles wait to be fetched.
        std::thread::sleep(Duration::from_millis(2 * WISH_MS.unsigned_abs()));
        motion.cycles.extend(core::iter::from_fn(|| motion.rig.drive.next_cycle()));
        let newest = *motion.cycles.last().unwrap();
        let silent = motion.cycles.iter().position(|cycle| cycle.wish_ns == newest.wish_ns).unwrap();
        motion.go(8);
        let failed = motion.cycles.iter().position(|cycle| cycle.failure != 0).unwrap();
        judge_motion(&motion, failed, &what);
        assert!(failed > silent + 1, "{what}: {failed} {silent}");
        let goals = |cycle: &DriveCycle| [0, 1, 2].map(|k| cycle.actuators[k].told_counts);
        for (n, cycle) in motion.cycles.iter().enumerate().skip(silent) {
            // Between two wishes nothing is invented, and afterwards nothing is followed.
            assert_eq!(goals(cycle), goals(&motion.cycles[silent]), "{what}: cycle {n}, silent from {silent}");
            assert!((0..3).all(|k| cycle.actuators[k].has(ActuatorCycle::POWERED)), "{what}: under power");
            let silent_ns = cycle.sample_ns - newest.wish_ns;
            let is_too_long = silent_ns > WISH_MS * 1_000_000;
            assert_eq!(cycle.failure, if is_too_long { UNLED } else { 0 }, "{what}: after {silent_ns} ns");
            assert_eq!((cycle.phase == STOPPED, cycle.failure_actuator), (is_too_long, 0), "{what}");
        }
        let after = motion.cycles.last().unwrap();
        assert!(after.wish_ns > newest.wish_ns, "{what}: the slave is back");
        let wished = after.actuators[0].wish_q_m;
        assert!((wished - newest.actuators[0].wish_q_m).abs() < 1e-12, "{what}: and is refused");
        let failure = motion.rig.drive.failure().unwrap().to_string();
        assert!(failure.starts_with("the slave was silent for "), "{what}: {failure}");
    });
}
