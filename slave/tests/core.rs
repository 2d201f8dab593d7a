//! The slave without its process: what it executes, refuses, shortens, and how it stops by itself.
#![allow(clippy::unwrap_used, clippy::panic)] // Helpers of tests fail as tests do.

use krait_ipc::message::{Command, HopStamps, OperatingState, Phase, SlaveState, StateCommand, Transition};
use krait_ipc::{Reason, Reasons};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{
    ActuatorState, Actuators, Drive, DriveError, DriveReading, DriveTraits, Homing, OnFault, SlaveConfig, SlaveCore,
    Switching, TransitionRefused, lines,
};

const MS: i64 = 1_000_000;
const DIRECTION: Actuators = lines([-1.0, 0.5, 0.5]);

/// A drive whose encoders and loads can be set, and which can fail.
#[derive(Default)]
struct Mock {
    q_m: Actuators,
    tau_n: Actuators,
    /// Actuators beyond three.
    n_more: usize,
    /// Whether the last one is a gripper's wire.
    has_gripper: bool,
    is_frozen: bool,
    is_dead: bool,
    powered: bool,
    /// Calls of `set_power` that say Busy before one says Done.
    n_busy: u32,
    /// Whether a fault leaves the power on.
    holds: bool,
    failure: Option<DriveError>,
    n_quick_stops: u32,
}

impl Drive for Mock {
    fn n_actuators(&self) -> usize {
        3 + self.n_more
    }
    fn write(&mut self, _stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        if self.is_dead {
            return Err(DriveError::Failed { what: "cable pulled" });
        }
        if !self.is_frozen {
            self.q_m = q_tilde_m;
        }
        Ok(())
    }
    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        let state = if self.powered { ActuatorState::On } else { ActuatorState::Off };
        Ok(DriveReading::at_once(self.n_actuators(), stamp_ns, (self.q_m, self.tau_n), state))
    }
    fn home(&mut self, _stamp_ns: i64) -> Result<Homing, DriveError> {
        Ok(Homing::Done)
    }
    fn traits(&self) -> DriveTraits {
        DriveTraits {
            n_actuators: self.n_actuators(),
            n_together: self.n_actuators() - usize::from(self.has_gripper),
            jaw_m_per_rad: None,
            period_ns: MS,
            travel_m: [0.02; 12],
            rate_m_per_s: [f64::INFINITY; 12],
            delay_ns: 0,
            measures_load: true,
            on_fault: if self.holds { OnFault::Hold } else { OnFault::PowerOff },
        }
    }
    fn set_power(&mut self, _stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        if on && self.n_busy > 0 {
            self.n_busy -= 1;
            return Ok(Switching::Busy);
        }
        self.powered = on;
        Ok(Switching::Done)
    }
    fn quick_stop(&mut self, _stamp_ns: i64) {
        self.n_quick_stops += 1;
    }
    fn failure(&self) -> Option<DriveError> {
        self.failure
    }
}

/// What is done to a command before it is sent.
type Change = fn(&mut Command);

/// A slave with its clock and the numbers of its commands.
struct Bench {
    core: SlaveCore<Mock>,
    now_ns: i64,
    sequence: u64,
}

impl Bench {
    fn ready() -> Self {
        Self::with(Mock::default())
    }

    fn with(drive: Mock) -> Self {
        let mut bench = Self { core: SlaveCore::new(drive, &SlaveConfig::default()), now_ns: MS, sequence: 0 };
        bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
        bench.tick();
        bench.engage();
        bench
    }

    /// The operator lets go and takes hold anew, at the setpoint.
    fn engage(&mut self) -> SlaveState {
        self.now_ns += MS;
        let q_m = self.core.report(self.now_ns).setpoint_q_m;
        for reasons in [Reasons::NONE.with(Reason::OperatorAbsent), Reasons::NONE] {
            let mut command = self.command(q_m);
            (command.phase, command.reasons) = (Phase::Holding as u32, reasons.bits());
            self.take(&command);
        }
        self.core.report(self.now_ns)
    }

    fn tick(&mut self) -> SlaveState {
        self.now_ns += MS;
        self.core.on_tick(self.now_ns);
        self.core.report(self.now_ns)
    }

    fn command(&mut self, q_tilde_m: Actuators) -> Command {
        self.sequence += 1;
        Command {
            sequence: self.sequence,
            sample_ns: self.now_ns,
            stamps: HopStamps::default(),
            setpoint_sequence: 0,
            state_sequence: 0,
            model_update_sequence: 0,
            bend_rad: [0.1, 0.2],
            q_uncompensated_m: q_tilde_m,
            q_tilde_m,
            n_actuators: self.core.drive().n_actuators() as u32,
            model_hash: 1,
            learnt: [f64::NAN; 8],
            n_learnt: 0,
            phase: Phase::Following as u32,
            reasons: 0,
            ..Command::default()
        }
    }

    fn take(&mut self, command: &Command) -> SlaveState {
        self.core.on_command(command, self.now_ns);
        self.core.report(self.now_ns)
    }

    /// A command one millisecond later.
    fn go(&mut self, way_m: f64) -> SlaveState {
        self.now_ns += MS;
        let command = self.command(DIRECTION.map(|d| d * way_m));
        self.take(&command)
    }

    /// Up to a place at a speed that no limit minds.
    fn ramp(&mut self, from_m: f64, to_m: f64) -> SlaveState {
        let n = ((to_m - from_m).abs() / 10e-6).ceil() as i32;
        let mut state = self.go(from_m);
        for k in 1..=n {
            state = self.go(from_m + (to_m - from_m) * f64::from(k) / f64::from(n));
        }
        state
    }
}

fn has(state: &SlaveState, reason: Reason) -> bool {
    Reasons::from_bits(state.reasons).contains(reason)
}

fn follows(state: &SlaveState) -> bool {
    state.flags & SlaveState::FOLLOWING != 0
}

#[test]
fn a_ramp_is_followed_exactly_and_echoed_with_its_stamps() {
    let mut bench = Bench::ready();
    let state = bench.ramp(0.0, 1e-3);
    assert_eq!(state.setpoint_q_m, DIRECTION.map(|d| d * 1e-3));
    assert_eq!(state.measured_q_m, state.setpoint_q_m);
    assert_eq!((state.setpoint_bend_rad, state.command_sequence), ([0.1, 0.2], bench.sequence));
    assert_eq!((state.stamps.slave_begun_ns, state.stamps.drive_written_ns), (bench.now_ns, bench.now_ns));
    assert!(follows(&state) && state.reasons == 0 && state.n_refused == 0);
}

#[test]
fn nothing_moves_unless_enabled_homed_and_following() {
    let mut bench = Bench { core: SlaveCore::new(Mock::default(), &SlaveConfig::default()), now_ns: MS, sequence: 0 };
    let state = bench.go(20e-6);
    assert!(has(&state, Reason::SlaveNotEnabled) && has(&state, Reason::SlaveNotHomed));
    assert_eq!(state.setpoint_q_m, [0.0; 12]);

    let config = SlaveConfig { home_on_start: false, ..SlaveConfig::default() };
    let mut bench = Bench { core: SlaveCore::new(Mock::default(), &config), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, MS).unwrap();
    let state = bench.go(20e-6);
    assert!(has(&state, Reason::SlaveNotHomed) && state.setpoint_q_m == [0.0; 12]);

    let mut bench = Bench::ready();
    let mut command = bench.command(DIRECTION.map(|d| d * 20e-6));
    command.phase = Phase::Holding as u32;
    let state = bench.take(&command);
    assert!(!follows(&state) && state.setpoint_q_m == [0.0; 12] && state.n_refused == 0);
    bench.core.transition(Transition::Pause, bench.now_ns).unwrap();
    let state = bench.go(20e-6);
    assert!(has(&state, Reason::SlaveNotEnabled) && state.setpoint_q_m == [0.0; 12]);
}

#[test]
fn commands_that_are_wrong_are_refused_counted_and_named() {
    type Spoil = fn(&mut Command);
    let cases: [(Spoil, Reason); 9] = [
        (|c| c.q_tilde_m[1] = f64::NAN, Reason::NotFinite),
        (|c| c.q_tilde_m[2] = f64::NEG_INFINITY, Reason::NotFinite),
        (|c| c.bend_rad[0] = f64::INFINITY, Reason::NotFinite),
        (|c| c.phase = 7, Reason::OutOfRange),
        (|c| c.reasons = 1 << 63, Reason::OutOfRange),
        (|c| c.sample_ns -= 51 * MS, Reason::CommandStale),
        (|c| c.sample_ns += 51 * MS, Reason::OutOfRange),
        (|c| c.sequence -= 1, Reason::OutOfOrder),
        (|c| c.sample_ns -= 2 * MS, Reason::OutOfOrder),
    ];
    for (spoil, reason) in cases {
        let mut bench = Bench::ready();
        let before = bench.ramp(0.0, 30e-6);
        bench.now_ns += MS;
        let mut command = bench.command(before.setpoint_q_m);
        spoil(&mut command);
        let state = bench.take(&command);
        assert!(has(&state, reason), "{reason:?}: {state:?}");
        assert!(!follows(&state));
        assert_eq!((state.n_refused, state.n_commands, state.command_sequence), (1, 7, 6), "{reason:?}");
        let state = bench.go(30e-6);
        if reason == Reason::CommandStale {
            assert!(!follows(&state) && has(&state, Reason::ChainStalled), "a stall ends the engagement: {state:?}");
        } else {
            assert!(follows(&state) && state.reasons == 0, "the next good one is followed: {state:?}");
        }
    }
}

#[test]
fn the_first_command_after_every_kind_of_hold_must_begin_at_the_setpoint() {
    let holds: [fn(&mut Bench); 4] = [
        |b| {
            for _ in 0..60 {
                b.tick();
            }
        },
        |b| {
            b.core.transition(Transition::Pause, b.now_ns).unwrap();
            b.tick();
            b.core.transition(Transition::Resume, b.now_ns).unwrap();
        },
        |b| {
            b.core.transition(Transition::Disable, b.now_ns).unwrap();
            b.core.transition(Transition::Enable, b.now_ns).unwrap();
        },
        |b| {
            let mut command = b.command(lines([0.0; 3]));
            command.phase = Phase::Holding as u32;
            b.take(&command);
        },
    ];
    for hold in holds {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 1e-3);
        hold(&mut bench);
        let at_rest = (0..20).map(|_| bench.tick()).last().unwrap();
        if !at_rest.is_engaged() {
            assert!(bench.engage().is_engaged());
        }
        let state = bench.go(1.3e-3);
        assert!(has(&state, Reason::StepLimit), "a start 0.3 mm away is refused");
        assert_eq!(state.setpoint_q_m, at_rest.setpoint_q_m);
        let state = bench.go(-at_rest.setpoint_q_m[0]);
        assert!(follows(&state), "a start at the setpoint is followed: {state:?}");
    }
}

#[test]
fn twelve_actuators_of_eight_joints_pass_the_same_gate_and_the_twelfth_counts_like_the_first() {
    let mut bench = Bench::with(Mock { n_more: 9, ..Mock::default() });
    let joints_rad: [f64; 8] = core::array::from_fn(|k| 0.1 * k as f64);
    let all = |way_m: f64| core::array::from_fn(|k| way_m * (1.0 - k as f64 / 24.0));
    let go = |bench: &mut Bench, way_m: f64, change: Change| {
        bench.now_ns += MS;
        let mut command = bench.command(all(way_m));
        (command.joints_rad, command.n_joints, command.bend_rad) = (joints_rad, 8, [f64::NAN; 2]);
        change(&mut command);
        bench.take(&command)
    };
    let state = (1..=50).map(|k| go(&mut bench, f64::from(k) * 10e-6, |_| {})).last().unwrap();
    assert!(follows(&state) && state.setpoint_q_m == all(0.5e-3), "{state:?}");
    assert_eq!((state.n_actuators, state.n_joints, state.setpoint_joints_rad), (12, 8, joints_rad));
    let state = go(&mut bench, 0.6e-3, |_| {});
    let moved = |k: usize| state.setpoint_q_m[k] - all(0.5e-3)[k];
    assert!(
        (moved(0) - 30e-6).abs() < 1e-12 && (moved(11) / moved(0) - 13.0 / 24.0).abs() < 1e-9,
        "one factor for all"
    );
    let spoilt: [(Change, Reason); 5] = [
        (|c| c.q_tilde_m[11] = f64::NAN, Reason::NotFinite),
        (|c| c.joints_rad[7] = f64::INFINITY, Reason::NotFinite),
        (|c| c.n_actuators = 3, Reason::OutOfRange),
        (|c| c.n_actuators = 0, Reason::OutOfRange),
        (|c| c.n_joints = 9, Reason::OutOfRange),
    ];
    for (spoil, reason) in spoilt {
        let before = bench.core.report(bench.now_ns).n_refused;
        let state = go(&mut bench, 0.5e-3, spoil);
        assert!(has(&state, reason) && state.n_refused == before + 1, "{reason:?}: {state:?}");
    }
    bench.core.drive_mut().tau_n[11] = -61.0;
    bench.now_ns += 100 * MS;
    bench.tick();
    bench.engage();
    let at = bench.core.report(bench.now_ns).setpoint_q_m;
    bench.now_ns += MS;
    let mut command = bench.command(at.map(|q| q - 10e-6));
    (command.joints_rad, command.n_joints) = (joints_rad, 8);
    let state = bench.take(&command);
    assert!(has(&state, Reason::ForceLimit), "the twelfth actuator pulls too hard: {state:?}");
}

#[test]
fn a_jump_while_following_is_refused_and_a_fast_motion_is_shortened_in_its_direction() {
    let mut bench = Bench::ready();
    let before = bench.ramp(0.0, 0.5e-3);
    let state = bench.go(1.1e-3);
    assert!(has(&state, Reason::StepLimit) && !follows(&state));
    assert_eq!(bench.core.findings(bench.now_ns).note_of(Reason::StepLimit).unwrap().limit, 0.5e-3);
    // What the slave still does is brake from 10 mm/s.
    assert!((state.setpoint_q_m[0] - before.setpoint_q_m[0]).abs() < 10.1e-6);
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.5e-3);
    let state = bench.go(0.65e-3);
    assert!(has(&state, Reason::ActuatorRateLimit) && !follows(&state), "0.12 mm behind is not following");
    let moved: Vec<f64> = (0..3).map(|i| state.setpoint_q_m[i] - DIRECTION[i] * 0.5e-3).collect();
    assert!((moved[0] + 30e-6).abs() < 1e-12, "30 mm/s for 1 ms, moved {moved:?}");
    assert!((moved[1] + 0.5 * moved[0]).abs() < 1e-12 && (moved[2] + 0.5 * moved[0]).abs() < 1e-12);
}

#[test]
fn the_end_of_the_stroke_stops_all_lines_and_the_way_back_is_free() {
    let mut bench = Bench::ready();
    let state = bench.ramp(0.0, 5.6e-3);
    assert!(has(&state, Reason::StrokeLimit));
    let expected = DIRECTION.map(|d| d * 5.5e-3);
    for (found, expected) in state.setpoint_q_m.into_iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12, "{:?}", state.setpoint_q_m);
    }
    let state = bench.go(5.49e-3);
    assert!(follows(&state) && state.reasons == 0);
}

#[test]
fn a_load_beyond_its_limit_forbids_more_of_it_and_allows_less() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 1e-3);
    bench.core.drive_mut().tau_n = lines([-61.0, 20.0, 20.0]);
    bench.tick();
    bench.go(1e-3);
    let before = bench.go(1e-3);
    let state = bench.go(1.01e-3);
    assert!(has(&state, Reason::ForceLimit) && state.setpoint_q_m == before.setpoint_q_m);
    let state = bench.go(0.99e-3);
    assert!(follows(&state) && !has(&state, Reason::ForceLimit));
}

#[test]
fn when_commands_stop_the_slave_brakes_steadily_rests_within_its_time_and_says_stale() {
    let mut bench = Bench::ready();
    let mut before = bench.ramp(0.0, 1e-3);
    let mut speed = 10e-3;
    let mut rested_after = 0;
    for ms in 1..=60 {
        let state = bench.tick();
        let new_speed = (state.setpoint_q_m[0] - before.setpoint_q_m[0]).abs() / 1e-3;
        // The first tick comes within the grace of a late command and moves nothing; the next one makes up for it.
        if ms > 3 {
            assert!(new_speed <= speed + 1e-9, "{ms} ms: it never speeds up");
            assert!(speed - new_speed <= 1.05e-3, "{ms} ms: at most 1 m/s2, {speed} to {new_speed}");
        }
        if new_speed > 0.0 {
            rested_after = ms;
        }
        assert_eq!(has(&state, Reason::CommandStale), ms > 50, "{ms} ms");
        (speed, before) = (new_speed, state);
    }
    assert!(rested_after > 5 && rested_after < 15, "rest after {rested_after} ms");
    let state = bench.go(-before.setpoint_q_m[0]);
    assert!(!follows(&state) && has(&state, Reason::ChainStalled), "not without the operator");
    bench.engage();
    let state = bench.go(-before.setpoint_q_m[0]);
    assert!(follows(&state) && state.reasons == 0, "it resumes from the setpoint: {state:?}");
}

#[test]
fn commands_that_are_all_refused_count_as_none_and_end_in_the_same_rest() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 1e-3);
    let mut states = Vec::new();
    for _ in 0..60 {
        states.push(bench.go(f64::NAN));
    }
    let last = states.last().unwrap();
    assert!(has(last, Reason::CommandStale) && has(last, Reason::NotFinite));
    assert!(states.windows(2).skip(15).all(|pair| pair[0].setpoint_q_m == pair[1].setpoint_q_m), "at rest");
    assert!(!bench.core.is_following());
}

#[test]
fn drives_that_fail_or_do_not_follow_are_a_fault_that_only_a_retry_leaves() {
    let mut bench = Bench::ready();
    bench.ramp(0.0, 0.1e-3);
    bench.core.drive_mut().is_dead = true;
    let state = bench.go(0.11e-3);
    assert_eq!(state.operating(), Some(OperatingState::Fault));
    assert!(has(&state, Reason::FollowingError) && !bench.core.drive().powered);
    assert_eq!(bench.core.drive_error(), Some(DriveError::Failed { what: "cable pulled" }));
    bench.core.drive_mut().is_dead = false;
    assert_eq!(bench.tick().operating(), Some(OperatingState::Fault), "it does not come back by itself");
    bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
    assert!(bench.tick().is_ready());
    bench.engage();

    bench.core.drive_mut().is_frozen = true;
    let state = bench.ramp(0.1e-3, 0.5e-3);
    assert_eq!(state.operating(), Some(OperatingState::Fault));
    assert!(bench.core.findings(bench.now_ns).note_of(Reason::FollowingError).unwrap().value > 0.3e-3);
}

#[test]
fn an_unknown_state_command_is_answered_and_changes_nothing() {
    let mut bench = Bench::ready();
    let command = StateCommand { sequence: 1, sample_ns: 0, transition: 99, sender_pid: 1 };
    let before = bench.core.report(bench.now_ns);
    let refused = bench.core.on_state_command(&command, bench.now_ns).unwrap_err();
    assert_eq!(refused, TransitionRefused::Unknown { found: 99 });
    let heard = SlaveState { state_command_sequence: 1, flags: before.flags | SlaveState::COMMAND_REFUSED, ..before };
    assert_eq!(bench.core.report(bench.now_ns), SlaveState { sequence: before.sequence + 1, ..heard });
}

#[test]
fn homing_a_bent_snake_is_busy_moves_nothing_else_and_ends_at_zero() {
    let mut core = SlaveCore::new(SimulatedSnake::new(&Truth::default()), &SlaveConfig::default());
    let mut now_ns = MS;
    core.transition(Transition::Enable, now_ns).unwrap();
    core.drive_mut().write(now_ns, lines([0.2e-3, -0.1e-3, -0.1e-3])).unwrap();
    let mut n_busy = 0;
    loop {
        now_ns += MS;
        core.on_tick(now_ns);
        let state = core.report(now_ns);
        if state.is_ready() {
            break;
        }
        assert_eq!(state.flags & SlaveState::IS_BUSY, SlaveState::IS_BUSY);
        n_busy += 1;
        assert!(n_busy < 100, "it ends");
    }
    assert!(n_busy > 30, "0.2 mm at 5 mm/s, {n_busy} ms");
    assert_eq!(core.report(now_ns).setpoint_q_m, [0.0; 12]);
}

/// Each finding of the probe that showed it, on the slave alone.
mod probes {
    use super::*;

    /// How far a line moved between two states.
    fn moved_m(before: &SlaveState, after: &SlaveState) -> f64 {
        (0..3).map(|i| (after.setpoint_q_m[i] - before.setpoint_q_m[i]).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_burst_of_late_commands_is_held_and_moves_no_faster_than_time() {
        let mut bench = Bench::ready();
        let before = bench.ramp(0.0, 1e-3);
        // A stage stood still for 45 ms, and now sends what came meanwhile, a microsecond apart.
        let begun_ns = bench.now_ns;
        bench.now_ns += 45 * MS;
        let (mut last, mut last_ns) = (before, begun_ns);
        for k in 1..=45 {
            bench.now_ns += 1000;
            let mut command = bench.command(DIRECTION.map(|d| d * (1e-3 + f64::from(k) * 20e-6)));
            command.sample_ns = begun_ns + i64::from(k) * MS;
            let state = bench.take(&command);
            let allowed_m = 30e-3 * ((bench.now_ns - last_ns).min(MS) as f64 * 1e-9) + 1e-6;
            assert!(moved_m(&last, &state) <= allowed_m, "command {k}: {} m", moved_m(&last, &state));
            assert!(has(&state, Reason::CommandLate) || k > 35, "command {k} is late: {state:?}");
            (last, last_ns) = (state, bench.now_ns);
        }
        assert!(moved_m(&before, &last) < 32e-6, "{} m in all", moved_m(&before, &last));
    }

    #[test]
    fn a_stall_ends_the_engagement_and_names_its_length() {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 0.5e-3);
        for _ in 0..60 {
            bench.tick();
        }
        let way_m = -bench.core.report(bench.now_ns).setpoint_q_m[0];
        let state = bench.go(way_m);
        assert!(!state.is_engaged() && has(&state, Reason::NotEngaged) && has(&state, Reason::ChainStalled));
        let note = bench.core.findings(bench.now_ns).note_of(Reason::ChainStalled).unwrap();
        assert!(note.value > 50.0 && note.value < 52.0 && note.limit == 50.0, "{note:?}");
    }

    #[test]
    fn a_load_that_is_not_measured_is_refused_where_one_is_limited() {
        let mut bench = Bench::ready();
        let before = bench.ramp(0.0, 0.5e-3);
        bench.core.drive_mut().tau_n = lines([f64::NAN, 1.0, 1.0]);
        bench.core.report(bench.now_ns);
        let state = bench.go(0.51e-3);
        assert!(has(&state, Reason::LoadUnknown) && !state.is_engaged() && !follows(&state));
        assert!(moved_m(&before, &state) < 10e-6, "it brakes");
        assert!(!bench.engage().is_engaged(), "and nobody can engage");

        let mut config = SlaveConfig::default();
        (config.limits.pull_n, config.limits.push_n) = (f64::INFINITY, f64::INFINITY);
        config.check().unwrap();
        let drive = Mock { tau_n: lines([f64::NAN; 3]), ..Mock::default() };
        let mut bench = Bench { core: SlaveCore::new(drive, &config), now_ns: MS, sequence: 0 };
        bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
        bench.tick();
        assert!(bench.engage().is_engaged(), "without a limit nobody asks for loads");
    }

    #[test]
    fn each_condition_that_is_missing_is_named_with_its_value_and_limit() {
        type Spoil = fn(&mut Bench, &mut Command);
        /// Late, and not so old that it is not believed at all.
        const LATE_NS: i64 = 30 * MS;
        let conditions: [(Reason, Spoil); 3] = [
            (Reason::CommandLate, |b, c| c.sample_ns = b.now_ns - LATE_NS),
            (Reason::StepLimit, |_, c| c.q_tilde_m[0] += 3e-4),
            (Reason::LoadUnknown, |b, _| b.core.drive_mut().tau_n = lines([1.0, f64::NAN, 1.0])),
        ];
        for (reason, spoil) in conditions {
            let mut bench = Bench::ready();
            bench.ramp(0.0, 0.2e-3);
            bench.core.transition(Transition::Pause, bench.now_ns).unwrap();
            bench.core.transition(Transition::Resume, bench.now_ns).unwrap();
            // Samples never go back in time, late ones neither.
            for _ in 0..100 {
                bench.tick();
            }
            let q_m = bench.tick().setpoint_q_m;
            for reasons in [1 << Reason::OperatorAbsent as u32, 0] {
                bench.now_ns += MS;
                let mut command = bench.command(q_m);
                (command.phase, command.reasons) = (Phase::Holding as u32, reasons);
                spoil(&mut bench, &mut command);
                bench.core.report(bench.now_ns);
                bench.take(&command);
            }
            let state = bench.core.report(bench.now_ns);
            assert!(!state.is_engaged() && has(&state, reason), "{reason:?}: {state:?}");
            let note = bench.core.findings(bench.now_ns).note_of(reason).unwrap();
            let is_beyond =
                if reason == Reason::LoadUnknown { note.value < note.limit } else { note.value > note.limit };
            assert!(is_beyond && note.limit > 0.0, "{reason:?}: {note:?}");
            assert!(!reason.unit().is_empty(), "{reason:?}");
        }
    }

    #[test]
    fn an_operator_who_was_never_seen_absent_moves_nothing() {
        let mut bench =
            Bench { core: SlaveCore::new(Mock::default(), &SlaveConfig::default()), now_ns: MS, sequence: 0 };
        bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
        bench.tick();
        for k in 0..200 {
            let state = bench.go(f64::from(k) * 10e-6);
            assert!(!state.is_engaged() && state.setpoint_q_m == [0.0; 12], "{state:?}");
        }
    }

    #[test]
    fn whatever_could_surprise_asks_for_a_new_engagement() {
        type Event = fn(&mut Bench);
        type Spoil = fn(&mut Command);
        let spoilt = |bench: &mut Bench, spoil: Spoil| {
            bench.now_ns += MS;
            let q_m = bench.core.report(bench.now_ns).setpoint_q_m;
            let mut command = bench.command(q_m);
            (command.setpoint_sequence, command.input_sequence) = (50, 50);
            spoil(&mut command);
            bench.take(&command);
        };
        let commands: [(Spoil, Reason); 11] = [
            (|c| c.input_sequence = 1, Reason::StageRestarted),
            (|c| c.setpoint_sequence = 1, Reason::StageRestarted),
            (|c| c.sequence = 1, Reason::StageRestarted),
            (|c| c.model_hash = 2, Reason::ModelExchanged),
            (|c| c.reasons = 1 << Reason::DeviceLost as u32, Reason::DeviceLost),
            (|c| c.reasons = 1 << Reason::HandJumped as u32, Reason::HandJumped),
            (|c| c.reasons = 1 << Reason::InputStale as u32, Reason::InputStale),
            (|c| c.reasons = 1 << Reason::SetpointStale as u32, Reason::SetpointStale),
            (|c| c.reasons = 1 << Reason::StateStale as u32, Reason::StateStale),
            (|c| c.reasons = 1 << Reason::MismatchTrip as u32, Reason::MismatchTrip),
            (|c| c.reasons = 1 << Reason::FormulaFault as u32, Reason::FormulaFault),
        ];
        for (spoil, reason) in commands {
            let mut bench = Bench::ready();
            bench.ramp(0.0, 0.2e-3);
            spoilt(&mut bench, |_| ());
            assert!(bench.core.is_engaged());
            spoilt(&mut bench, spoil);
            let state = bench.core.report(bench.now_ns);
            assert!(!state.is_engaged() && has(&state, reason), "{reason:?}: {state:?}");
        }
        let events: [Event; 5] = [
            |b| b.core.on_new_writer(),
            |b| b.core.stop(b.now_ns),
            |b| b.core.transition(Transition::Pause, b.now_ns).unwrap(),
            |b| b.core.transition(Transition::Home, b.now_ns).unwrap(),
            |b| b.core.transition(Transition::Disable, b.now_ns).unwrap(),
        ];
        for event in events {
            let mut bench = Bench::ready();
            bench.ramp(0.0, 0.2e-3);
            event(&mut bench);
            assert!(!bench.core.is_engaged());
        }
    }

    #[test]
    fn a_stop_wins_over_what_was_asked_for_before_it() {
        let mut bench = Bench::ready();
        bench.ramp(0.0, 0.2e-3);
        let ask = |transition: Transition, sample_ns: i64| StateCommand {
            sequence: 1,
            sample_ns,
            transition: transition as u32,
            sender_pid: 1,
        };
        bench.core.stop(bench.now_ns);
        let state = bench.tick();
        assert_eq!((state.operating(), state.desired()), (Some(OperatingState::Paused), Some(OperatingState::Paused)));
        let refused = bench.core.on_state_command(&ask(Transition::Resume, bench.now_ns - 5 * MS), bench.now_ns);
        assert_eq!(refused, Err(TransitionRefused::BeforeStop { transition: Transition::Resume }));
        bench.core.on_state_command(&ask(Transition::Resume, bench.now_ns), bench.now_ns).unwrap();
        let state = bench.tick();
        assert!(state.is_ready() && !state.is_engaged() && state.n_stops == 1);
    }
}

#[test]
fn power_that_takes_time_is_waited_for_tick_by_tick_and_nothing_moves_before() {
    let drive = Mock { n_busy: 6, q_m: DIRECTION.map(|d| d * 1e-3), ..Mock::default() };
    let mut bench = Bench { core: SlaveCore::new(drive, &SlaveConfig::default()), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, MS).unwrap();
    for _ in 0..5 {
        let state = bench.tick();
        assert!(state.flags & SlaveState::IS_BUSY != 0 && state.flags & SlaveState::IS_HOMED == 0);
        assert!(!bench.core.drive().powered && !follows(&bench.go(1e-3)));
    }
    bench.tick();
    assert!(bench.core.drive().powered);
    let state = bench.tick();
    assert!(state.flags & SlaveState::IS_BUSY == 0 && state.flags & SlaveState::IS_HOMED != 0, "homed after power");
    assert_eq!(state.setpoint_q_m, DIRECTION.map(|d| d * 1e-3), "the setpoint is where the encoders say");

    let drive = Mock { n_busy: u32::MAX, ..Mock::default() };
    let mut bench = Bench { core: SlaveCore::new(drive, &SlaveConfig::default()), now_ns: MS, sequence: 0 };
    bench.core.transition(Transition::Enable, MS).unwrap();
    let n_ticks = (0..6000).take_while(|_| bench.tick().operating() == Some(OperatingState::Enabled)).count();
    assert_eq!(n_ticks, 5000, "power that does not come in 5 s is a fault");
}

#[test]
fn a_state_says_that_hardware_took_the_power_until_the_fault_is_cleared_and_never_that_what_is_off_holds() {
    let stop = DriveError::HardwareStop { actuator: 3, code: 0x9000 };
    for holds in [true, false] {
        let mut bench = Bench::with(Mock { holds, ..Mock::default() });
        bench.ramp(0.0, 1e-3);
        assert_eq!(bench.tick().failed_drive(), None);
        bench.core.drive_mut().failure = Some(stop);
        for state in [bench.tick(), bench.tick()] {
            assert!(state.operating() == Some(OperatingState::Fault) && state.is_hardware_stopped(), "{state:?}");
            assert_eq!(state.failed_drive(), Some(3));
            assert_eq!(state.flags & SlaveState::OTHERS_HOLD != 0, holds, "{state:?}");
            let sentence = bench.core.failure_sentence().unwrap();
            assert_eq!((sentence.contains("hold"), sentence.contains("power was taken from all")), (holds, !holds));
        }
        bench.core.drive_mut().failure = None;
        bench.core.transition(Transition::ClearFault, bench.now_ns).unwrap();
        let state = bench.tick();
        assert!(!state.is_hardware_stopped() && state.failed_drive().is_none(), "{state:?}");
    }
}

#[test]
fn drives_that_hold_on_a_fault_keep_their_power_and_go_on_only_when_enabled_anew() {
    let mut bench = Bench::with(Mock { holds: true, ..Mock::default() });
    bench.ramp(0.0, 1e-3);
    let failure = DriveError::Lost { actuator: 2, silent_ms: 15.0 };
    bench.core.drive_mut().failure = Some(failure);
    let state = bench.tick();
    assert_eq!((state.operating(), bench.core.drive_error()), (Some(OperatingState::Fault), Some(failure)));
    assert!(failure.to_string().starts_with("Drive 2 failed; the others hold"), "{failure}");
    assert!(bench.core.drive().powered && bench.core.drive().n_quick_stops == 1, "under power, told to stop once");
    assert_eq!(state.failed_drive(), Some(2), "the state names it");
    assert!(state.flags & SlaveState::OTHERS_HOLD != 0 && !state.is_hardware_stopped());
    bench.core.drive_mut().failure = None;
    let state = bench.go(1e-3);
    assert!(!follows(&state) && state.operating() == Some(OperatingState::Fault), "nothing resumes by itself");
    assert!(state.flags & SlaveState::IS_HOMED == 0, "a fault forgets the zero");
    bench.core.transition(Transition::ClearFault, bench.now_ns).unwrap();
    assert!(!bench.core.drive().powered);
    bench.core.transition(Transition::Enable, bench.now_ns).unwrap();
    assert!(bench.tick().flags & SlaveState::IS_HOMED != 0);
}
