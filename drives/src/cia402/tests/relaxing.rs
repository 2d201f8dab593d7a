//! `on_fault = "relax"` on CAN: three drives bend a simulated snake on cables and feel it, and one of them lets go of its line.

use super::*;
use crate::emulator::Coupling;
use krait_sim::{CableSnake, Truth};
use krait_slave::{DriveError, OnFault};

/// Load of a line at the rated torque, N: 0.1 N m on a screw of 2 mm a turn, of which 0.8 arrive.
const RATED_N: f64 = 0.1 * core::f64::consts::TAU / 0.002 * 0.8;
const RELAX_M: f64 = 0.4e-3;
const PERIOD_S: f64 = 2e-3;
/// Half of `relax_ms`: whoever gives way has done so.
const N_CYCLES: usize = 250;

/// What became of the drives.
#[derive(Debug)]
struct After {
    failure: DriveError,
    /// Whether the first was ever called Relaxing.
    relaxes: bool,
    /// How far each has gone, m, and by how much its load has grown, N.
    way_m: [f64; 3],
    growth_n: [f64; 3],
}

/// Under power, at rest; then this happens to the second, and after so many cycles everybody asks for a stop.
fn after(on_fault: OnFault, act: fn(&mut CanDrive, &mut Vec<Frame>), stop_after: usize) -> After {
    let (bus, mut config) = several(3);
    let mut snake = CableSnake::new(Truth::default());
    bus.lock().coupling = Some(Coupling::new(move |places| {
        let q_m = core::array::from_fn(|k| (places[k] - f64::from(ZERO)) / PER_M);
        snake.loads_n(q_m).map(|load_n| load_n / RATED_N).to_vec()
    }));
    (config.drive.on_fault, config.drive.relax_m, config.drive.relax_n) = (on_fault, RELAX_M, 1.0);
    let mut bench = Bench::with((bus, config));
    bench.power_up();
    bench.steps(3);
    let (from, from_n) = (bench.places(), bench.loads_n());
    bench.bus.lock().with(1, act);
    let mut relaxes = false;
    for k in 0..N_CYCLES {
        bench.wish.stands = k >= stop_after;
        let before = bench.places();
        relaxes |= bench.step().state[0] == ActuatorState::Relaxing;
        let step_m = core::array::from_fn::<f64, 3, _>(|k| (bench.places()[k] - before[k]).abs() / PER_M);
        assert!(step_m.iter().all(|step_m| *step_m <= 2e-3 * PERIOD_S + 1.0 / PER_M), "2 mm/s at most: {step_m:?} m");
    }
    let failure = bench.report().failure.unwrap();
    let places = bench.places();
    assert_eq!((bench.states()[0], bench.states()[2]), (State::OperationEnabled, State::OperationEnabled));
    // What has ended does not begin again.
    bench.steps(2 * N_CYCLES);
    assert_eq!(bench.places(), places, "{failure}");
    assert!(bench.report().state[0] == ActuatorState::QuickStopped && bench.report().failure == Some(failure));
    let loads_n = bench.loads_n();
    After {
        failure,
        relaxes,
        way_m: core::array::from_fn(|k| (places[k] - from[k]) / PER_M),
        growth_n: core::array::from_fn(|k| loads_n[k] - from_n[k]),
    }
}

impl Bench {
    /// Size of the load of each line, N.
    fn loads_n(&self) -> [f64; 3] {
        let drives = self.bus.lock();
        core::array::from_fn(|k| drives.drives[k].load.abs() * RATED_N)
    }
}

fn trips(drive: &mut CanDrive, out: &mut Vec<Frame>) {
    drive.trip(0x2310, out);
}

#[test]
fn where_a_drive_has_let_go_the_others_give_way_by_their_loads_within_the_bound() {
    let press: fn(&mut CanDrive, &mut Vec<Frame>) = |drive, out| drive.press_emergency_stop(None, out);
    let starts_anew: fn(&mut CanDrive, &mut Vec<Frame>) = |drive, out| drive.power_loss(out);
    for act in [trips, press, starts_anew] {
        let after = after(OnFault::Relax, act, usize::MAX);
        assert!(after.relaxes && after.failure.to_string().contains('2'), "{after:?}");
        for k in [0, 2] {
            assert!(after.growth_n[k] < -1.0, "{after:?}");
            assert!(after.way_m[k] > 0.05e-3 && after.way_m[k] <= RELAX_M + 1.0 / PER_M, "{after:?}");
        }
        assert_eq!(after.way_m[1], 0.0, "one without power is told nothing that moves it: {after:?}");
    }
}

#[test]
fn nothing_gives_way_without_the_word_relax_nor_for_silence() {
    let silent: fn(&mut CanDrive, &mut Vec<Frame>) = |drive, _| drive.faults.is_silent = true;
    for (on_fault, act) in [(OnFault::Hold, trips as fn(&mut _, &mut _)), (OnFault::Relax, silent)] {
        let after = after(on_fault, act, usize::MAX);
        assert!(!after.relaxes && [0, 2].iter().all(|k| after.way_m[*k] == 0.0), "{after:?}");
    }
}

#[test]
fn a_stop_ends_it_where_it_is() {
    let whole = after(OnFault::Relax, trips, usize::MAX);
    let stopped = after(OnFault::Relax, trips, 20);
    assert!(stopped.relaxes, "{stopped:?}");
    assert!([0, 2].iter().all(|k| stopped.way_m[*k] > 0.0 && stopped.way_m[*k] < 0.5 * whole.way_m[*k]), "{stopped:?}");
}
