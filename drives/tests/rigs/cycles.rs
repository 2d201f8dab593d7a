//! Every cycle of the bus reaches the slave, and drives made of the record repeat a slave's run, also where one fails.

use crate::rig::{config, on_each_make, three};
use krait_drives::emulator::Emulator;
use krait_drives::{RecordedDrive, Repeated, ServoMake, open_drive, setup_of};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{ActuatorCycle, Command, DriveCycle, Phase, Transition};
use krait_ipc::{Reason, Reasons};
use krait_slave::{Drive, SlaveConfig, SlaveCore, lines};
use std::time::Duration;

/// A step of the slave: its command, where it has one, its instant, and when it was over.
type Step = (Option<Command>, i64, i64);

/// A slave's run on servos of which the second falls silent, all cycles of it, and its steps.
struct Run {
    config: SlaveConfig,
    cycles: Vec<DriveCycle>,
    enabled_ns: i64,
    steps: Vec<Step>,
    setpoints: Vec<[f64; 12]>,
}

fn run(make: ServoMake) -> Run {
    let emulator = Emulator::start(three(make)).unwrap();
    let mut config = config(make, &emulator);
    (config.limits.following_error_m, config.limits.pull_n, config.limits.push_n) =
        (5e-3, f64::INFINITY, f64::INFINITY);
    let drive = open_drive(&config, None).unwrap();
    let mut core = SlaveCore::new(drive, &config);
    let enabled_ns = monotonic_ns();
    core.transition(Transition::Enable, enabled_ns).unwrap();
    let mut run = Run { config, cycles: Vec::new(), enabled_ns, steps: Vec::new(), setpoints: Vec::new() };
    let mut begin_m = [0.0; 12];
    for k in 1..=2000_u64 {
        std::thread::sleep(Duration::from_millis(1));
        let now_ns = monotonic_ns();
        let command = (!core.is_busy() && k > 300).then(|| command(k, now_ns, begin_m));
        if let Some(command) = &command {
            core.on_command(command, now_ns);
        }
        core.on_tick(now_ns);
        let over_ns = monotonic_ns();
        let state = core.report(over_ns);
        if k < 320 {
            begin_m = state.setpoint_q_m;
        }
        run.steps.push((command, now_ns, over_ns));
        run.setpoints.push(state.setpoint_q_m);
        run.cycles.extend(core::iter::from_fn(|| core.drive_mut().next_cycle()));
        if k == 1500 {
            emulator.wire().servos[1].faults.is_silent = true;
        }
    }
    assert!(core.drive_error().is_some_and(|error| error.to_string().starts_with("Drive 2 failed")));
    run
}

fn command(k: u64, now_ns: i64, begin_m: [f64; 12]) -> Command {
    let way_m = 1e-6 * (k - 300) as f64;
    let mut command = Command { sequence: k, sample_ns: now_ns, n_actuators: 3, model_hash: 1, ..Command::default() };
    command.q_tilde_m = core::array::from_fn(|i| begin_m[i] + lines([way_m, -0.5 * way_m, -0.5 * way_m])[i]);
    command.phase = Phase::Following as u32;
    if k < 320 {
        (command.q_tilde_m, command.phase) = (begin_m, Phase::Holding as u32);
        let is_absent = k < 310;
        command.reasons = if is_absent { Reasons::NONE.with(Reason::OperatorAbsent) } else { Reasons::NONE }.bits();
    }
    command
}

/// The same steps on drives made of these cycles; the setpoint after each.
fn again(run: &Run, cycles: &[DriveCycle], config: &SlaveConfig) -> (Repeated, Vec<[f64; 12]>) {
    let mut drive = RecordedDrive::new(setup_of(config).unwrap(), &cycles[0]);
    cycles[1..].iter().for_each(|cycle| drive.push(*cycle));
    let mut core = SlaveCore::new(drive, config);
    core.transition(Transition::Enable, run.enabled_ns).unwrap();
    let step = |(command, now_ns, over_ns): &Step| {
        if let Some(command) = command {
            core.on_command(command, *now_ns);
        }
        core.on_tick(*now_ns);
        core.report(*over_ns).setpoint_q_m
    };
    let setpoints = run.steps.iter().map(step).collect();
    (core.drive().repeated().clone(), setpoints)
}

#[test]
fn the_cycles_are_complete_name_the_failure_and_repeat_the_run() {
    on_each_make(|make| {
        let run = run(make);
        let numbers: Vec<u64> = run.cycles.iter().map(|cycle| cycle.cycle).collect();
        assert_eq!(numbers, (0..run.cycles.len() as u64).collect::<Vec<_>>(), "the opening and each cycle once");
        assert!(
            run.cycles.len() > 40 && run.cycles.iter().all(|cycle| cycle.n_left_out == 0 && cycle.n_actuators == 3)
        );
        // Instants: a cycle begins, is measured, and is over before the next begins.
        for pair in run.cycles[1..].windows(2) {
            assert!(pair[0].sample_ns < pair[0].answered_ns && pair[0].answered_ns <= pair[1].sample_ns);
            let sampled_ns = pair[0].actuators[0].sampled_ns;
            assert!((pair[0].sample_ns..=pair[0].answered_ns).contains(&sampled_ns));
        }
        let silent = |cycle: &DriveCycle| !cycle.actuators[1].has(ActuatorCycle::ANSWERED);
        let first = run.cycles[1..].iter().position(silent).unwrap() + 1;
        let failed = run.cycles.iter().position(|cycle| cycle.failure != 0).unwrap();
        assert_eq!((run.cycles[failed].failure, run.cycles[failed].failure_actuator), (1, 2), "silent, the second");
        assert!(failed >= first + 2 && run.cycles[failed].actuators[1].state == 6);
        assert!(run.cycles[failed..].iter().all(|cycle| cycle.failure == 1), "a failure stays");
        let followed = run.cycles.iter().filter(|cycle| cycle.phase == 2 && cycle.has(DriveCycle::TOLD)).count();
        assert!(followed > 10, "{followed}");

        let (repeated, setpoints) = again(&run, &run.cycles, &run.config);
        assert!(repeated.is_identical(), "{repeated:?}");
        // The last ones may have found the newest wish of all, after which no step comes.
        assert!(repeated.n_cycles + 2 >= run.cycles.len() as u64 - 1, "{repeated:?}");
        assert_eq!(setpoints, run.setpoints);

        // Other settings are other wishes, and that is counted; so is a cycle that is not there.
        let mut slower = run.config.clone();
        slower.limits.rate_m_per_s = 5e-4;
        let (other, _) = again(&run, &run.cycles, &slower);
        assert!(other.n_wishes_differ > 10 && other.n_goals_differ > 0, "{other:?}");
        assert!(other.first.is_some_and(|first| first.field.contains("wish_q_m")));
        let mut gap = run.cycles.clone();
        gap.remove(20);
        assert_eq!(again(&run, &gap, &run.config).0.n_missing, 1);
    });
}

#[test]
fn a_slave_that_fetches_nothing_holds_up_nobody_and_what_is_left_out_is_counted() {
    let make = ServoMake::Sts3215;
    let emulator = Emulator::start(three(make)).unwrap();
    let mut config = config(make, &emulator);
    (config.drive.period_ms, config.drive.timeout_ms) = (5.0, 4.5);
    let mut drive = open_drive(&config, None).unwrap();
    std::thread::sleep(Duration::from_millis(1800));
    // While these are fetched there is room for the next.
    let waiting: Vec<DriveCycle> = core::iter::from_fn(|| drive.next_cycle()).take(256).collect();
    assert_eq!((waiting.len(), waiting[255].cycle, waiting[255].n_left_out), (256, 255, 0));
    let next = (0..2000).find_map(|_| {
        std::thread::sleep(Duration::from_millis(1));
        drive.next_cycle()
    });
    let next = next.unwrap();
    assert!(next.n_left_out > 0 && next.cycle == 256 + next.n_left_out, "{} {}", next.cycle, next.n_left_out);
}
