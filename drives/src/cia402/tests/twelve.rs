//! As many drives as there may be: all come under power and follow, and one that falls silent is known and stops the others.

use super::*;
use krait_slave::DriveError;

const N: usize = 12;

/// So many cycles of motion at 20 mm/s, each second one the other way; the ways of all targets in each of them.
fn go(bench: &mut Bench, n: usize) -> Vec<[i32; N]> {
    let targets = |bench: &Bench| -> [i32; N] {
        let drives = bench.bus.lock();
        core::array::from_fn(|k| drives.drives[k].target())
    };
    let mut steps = Vec::new();
    for _ in 0..n {
        let before = targets(bench);
        let way_m = 0.02 * 4e-3 + if bench.wish.is_somewhere() { bench.wish.q_m[0] } else { 0.0 };
        bench.wish.q_m = core::array::from_fn(|k| if k % 2 == 0 { way_m } else { -way_m });
        bench.step();
        let now = targets(bench);
        steps.push(core::array::from_fn(|k| now[k] - before[k]));
    }
    steps
}

#[test]
fn twelve_come_under_power_follow_and_all_others_stop_when_one_falls_silent() {
    let mut bench = Bench::of(N as u8);
    let places = |bench: &Bench| bench.bus.lock().drives.iter().map(|drive| drive.place).collect::<Vec<_>>();
    let before = places(&bench);
    assert_eq!(
        (bench.power_up(), places(&bench)),
        (5, before),
        "as three: the sixth answer says so, and nothing moves"
    );
    assert_eq!(bench.report().state, [ActuatorState::On; N]);
    go(&mut bench, 20);
    assert_eq!(bench.report().failure, None);
    let full = (0.02 * 4e-3 * PER_M).round() as i32;
    let steps = go(&mut bench, 1)[0];
    assert!((0..N).all(|k| (steps[k] - if k % 2 == 0 { full } else { -full }).abs() <= 1), "{steps:?}");

    bench.bus.lock().drives[7].faults.is_silent = true;
    go(&mut bench, 2);
    assert_eq!(bench.report().failure, None, "two missing answers mean nothing");
    go(&mut bench, 1);
    assert!(matches!(bench.report().failure, Some(DriveError::Lost { actuator: 8, .. })), "{:?}", bench.report());
    let steps = go(&mut bench, 12);
    for pair in steps.windows(2) {
        let slower = |k: usize| pair[1][k].abs() <= pair[0][k].abs() + 1;
        assert!((0..N).filter(|k| *k != 7).all(slower), "{pair:?}");
    }
    // 20 mm/s at 1 m/s2: five cycles of 4 ms.
    let rest = &steps[6..];
    assert!((0..N).filter(|k| *k != 7).all(|k| rest.iter().all(|step| step[k] == 0)), "{rest:?}");
    let drives = bench.bus.lock();
    let others = (0..N).filter(|k| *k != 7);
    assert!(others.into_iter().all(|k| drives.drives[k].state() == State::OperationEnabled), "under power");
    assert_eq!(drives.drives[7].state(), State::QuickStopActive);
}
