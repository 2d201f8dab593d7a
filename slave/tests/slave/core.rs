//! The slave without its process: what it executes, refuses, shortens, and how it stops by itself.

mod limits;
mod power;
mod probes;
mod refused;
mod stops;

use krait_ipc::message::{Command, HopStamps, OperatingState, Phase, SlaveState, StateCommand, Transition};
use krait_ipc::{Reason, Reasons};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{
    ActuatorConfig, ActuatorState, Actuators, Drive, DriveConfig, DriveError, DriveKind, DriveReading, DriveTraits,
    Homing, OnFault, SlaveConfig, SlaveCore, Switching, TransitionRefused, lines,
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
    /// Whether a drive has sent an emergency that stands.
    has_emergency: bool,
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
        let mut reading = DriveReading::at_once(self.n_actuators(), stamp_ns, (self.q_m, self.tau_n), state);
        reading.has_emergency = self.has_emergency;
        Ok(reading)
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
            homes_in_place: false,
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
        Self::of(drive, &SlaveConfig::default())
    }

    fn of(drive: Mock, config: &SlaveConfig) -> Self {
        let mut bench = Self { core: SlaveCore::new(drive, config), now_ns: MS, sequence: 0 };
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
