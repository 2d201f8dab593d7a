//! `on_fault = "power_off"`: whatever fails, all let go by one way, and nothing is told to move any more.

use super::*;

type Break = fn(&mut Bench);

/// What may fail, and whether it is known before anything is told in its cycle, so that power goes in that very cycle.
const FAILURES: [(&str, bool, Break); 5] = [
    ("silent", false, |bench| {
        bench.truth.lock().unwrap().is_silent[1] = true;
        bench.go(3);
    }),
    ("limp", false, |bench| {
        bench.truth.lock().unwrap().is_limp[1] = true;
        bench.go(1);
    }),
    ("gone", false, |bench| {
        bench.truth.lock().unwrap().is_gone = true;
        bench.go(1);
        bench.truth.lock().unwrap().is_gone = false;
    }),
    ("unled", true, |bench| {
        bench.now_ns += 60 * MS;
        bench.silent_step();
    }),
    ("unled, and a stop at once", true, |bench| {
        bench.wish.is_stopped = true;
        bench.now_ns += 60 * MS;
        bench.silent_step();
    }),
];

#[test]
fn whatever_fails_all_let_go_at_once_and_are_told_nowhere_to_go() {
    for (name, is_at_once, break_it) in FAILURES {
        let mut bench = Bench::with(DriveConfig { on_fault: OnFault::PowerOff, ..DriveConfig::default() });
        bench.go(20);
        let before = bench.truth.lock().unwrap().counts;
        break_it(&mut bench);
        let report = bench.report();
        assert!(report.failure.is_some() && report.phase == Phase::Off, "{name}: {report:?}");
        let counts = bench.truth.lock().unwrap().counts;
        if is_at_once {
            assert_eq!((counts, bench.truth.lock().unwrap().is_on), (before, false), "{name}: in the same cycle");
        }
        // The slave, which does not know yet, wishes for more, and then for a stop.
        bench.go(1);
        assert!(!bench.truth.lock().unwrap().is_on, "{name}: in the next cycle at the latest");
        bench.truth.lock().unwrap().is_silent[1] = false;
        bench.go(10);
        bench.wish.is_stopped = true;
        bench.go(10);
        let truth = bench.truth.lock().unwrap();
        assert_eq!((truth.counts, truth.is_on), (counts, false), "{name}: nothing moves and no power comes by itself");
    }
}
