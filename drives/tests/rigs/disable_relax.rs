//! A disable of loaded lines on the real back-ends: the slave's own core gives way through the bus's thread before power goes. Emulated
//! servos and emulated CAN drives bend a simulated snake on cables and feel it.

use core::time::Duration;
use krait_drives::emulator::{CanBus, Coupling, Emulator, Servo};
use krait_drives::{BusDrive, ServoMake, cia402, open_drive};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Command, OperatingState, Phase, SlaveState, StateCommand, Transition};
use krait_ipc::{Reason, Reasons};
use krait_sim::{CableSnake, Truth};
use krait_slave::{OnDisable, SlaveConfig, SlaveCore, lines};

/// Largest load of an actuator, N.
const LARGEST_N: f64 = 200.0;
const DIRECTION: [f64; 3] = [-1.0, 0.5, 0.5];
/// How far the first line is pulled, m, and how far in a tick.
const BENT_M: f64 = 1e-3;
const STEP_M: f64 = 5e-6;
const RELAX_N: f64 = 2.0;

/// A snake behind actuators of so many counts a metre.
fn snake(zero: f64, per_m: f64) -> Coupling {
    let mut snake = CableSnake::new(Truth::default());
    Coupling::new(move |places| {
        let q_m = core::array::from_fn(|k| (places[k] - zero) / per_m);
        snake.loads_n(q_m).map(|load_n| load_n / LARGEST_N).to_vec()
    })
}

/// The bus behind a drive, to see what became of it.
enum Behind {
    Servos(Emulator),
    Can(CanBus),
}

impl Behind {
    /// Largest load of a line, N, and how many actuators have torque.
    fn load_n_and_powered(&self) -> (f64, usize) {
        let largest = |loads: Vec<f64>| loads.into_iter().fold(0.0, |most: f64, load| most.max(load.abs())) * LARGEST_N;
        match self {
            Self::Servos(emulator) => {
                let wire = emulator.wire();
                let loads = wire.servos.iter().map(|servo| servo.load).collect();
                (largest(loads), wire.servos.iter().filter(|servo| servo.is_powered()).count())
            }
            Self::Can(bus) => {
                let drives = &bus.lock().drives;
                let powered = drives.iter().filter(|drive| drive.state() == cia402::State::OperationEnabled);
                (largest(drives.iter().map(|drive| drive.load).collect()), powered.count())
            }
        }
    }
}

fn servos(make: ServoMake, change: impl Fn(&mut SlaveConfig)) -> (SlaveConfig, BusDrive, Behind) {
    const PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
    let mut wire = crate::rig::three(make);
    wire.coupling = Some(snake(f64::from(crate::rig::ZERO), PER_M));
    let emulator = Emulator::start(wire).unwrap();
    let mut config = crate::rig::config(make, &emulator);
    for actuator in &mut config.drive.actuator {
        actuator.newton_metre_per_ampere = crate::rig::newton_metre_per_ampere(make, LARGEST_N);
    }
    prepare(&mut config, change);
    let drive = open_drive(&config, None).unwrap();
    assert!(emulator.wire().servos.iter().all(|servo: &Servo| !servo.is_powered()));
    (config, drive, Behind::Servos(emulator))
}

fn can(change: impl Fn(&mut SlaveConfig)) -> (SlaveConfig, BusDrive, Behind) {
    let bus = crate::can_rig::three();
    bus.lock().coupling = Some(snake(f64::from(crate::can_rig::ZERO), crate::can_rig::PER_M));
    let mut config = crate::can_rig::config();
    for actuator in &mut config.drive.actuator {
        // The screw's lead, without loss: a force of LARGEST_N at the rated torque.
        (actuator.rated_torque_nm, actuator.efficiency) = (LARGEST_N * 0.002 / core::f64::consts::TAU, 1.0);
    }
    prepare(&mut config, change);
    let drive = cia402::open_drive_on(bus.wire(), &config, None).unwrap();
    (config, drive, Behind::Can(bus))
}

fn prepare(config: &mut SlaveConfig, change: impl Fn(&mut SlaveConfig)) {
    // Readings are a bus period late.
    config.limits.following_error_m = 3e-3;
    (config.drive.relax_n, config.drive.disable_relax_ms) = (RELAX_N, 10_000.0);
    // Patience for a loaded machine.
    config.drive.lost_cycles = 20;
    change(config);
}

/// The slave's core on such a drive, by the machine's clock.
struct Bench {
    core: SlaveCore<BusDrive>,
    behind: Behind,
    sequence: u64,
    state: SlaveState,
}

impl Bench {
    /// Enabled, homed, engaged and bent.
    fn bent((config, drive, behind): (SlaveConfig, BusDrive, Behind)) -> Self {
        let core = SlaveCore::new(drive, &config);
        let mut bench = Self { core, behind, sequence: 0, state: SlaveState::default() };
        bench.core.transition(Transition::Enable, monotonic_ns()).unwrap();
        bench.until("ready", |bench| {
            bench.tick();
            bench.state.is_ready()
        });
        bench.until("bent", |bench| {
            bench.pull();
            bench.state.is_engaged() && bench.state.setpoint_q_m[0] <= -BENT_M
        });
        // What passes by is not at rest: a machine that held the last command up has it braked later.
        bench.until("at rest where it was told to be", |bench| {
            let before_m = bench.state.setpoint_q_m;
            bench.tick();
            let stands = bench.state.setpoint_q_m == before_m && !bench.state.is_engaged();
            stands && (bench.state.measured_q_m[0] + BENT_M).abs() < 50e-6
        });
        bench
    }

    fn until(&mut self, what: &str, done: impl Fn(&mut Self) -> bool) {
        let is_done = (0..60_000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            done(self)
        });
        assert!(is_done, "not {what}: {:?}, {:?}", self.state, self.core.drive_error());
    }

    fn tick(&mut self) {
        self.core.on_tick(monotonic_ns());
        self.state = self.core.report(monotonic_ns());
    }

    /// A step of pulling on; a machine that held this up has ended the engagement, and then it takes hold anew.
    fn pull(&mut self) {
        self.tick();
        let at_m = -self.state.setpoint_q_m[0];
        let is_engaged = self.state.is_engaged();
        let reasons = if is_engaged || self.sequence % 2 == 1 { 0 } else { 1 << Reason::OperatorAbsent as u32 };
        let way_m = if is_engaged { (at_m + STEP_M).min(BENT_M) } else { at_m };
        self.sequence += 1;
        let q_tilde_m = lines(DIRECTION.map(|d| d * way_m));
        let now_ns = monotonic_ns();
        let command = Command {
            sequence: self.sequence,
            sample_ns: now_ns,
            q_uncompensated_m: q_tilde_m,
            q_tilde_m,
            n_actuators: 3,
            model_hash: 1,
            phase: if is_engaged { Phase::Following } else { Phase::Holding } as u32,
            reasons,
            ..Command::default()
        };
        self.core.on_command(&command, now_ns);
        self.state = self.core.report(monotonic_ns());
    }

    /// Asks the power off; every state until it has gone, and the load behind each.
    fn disable(&mut self) -> Vec<(SlaveState, f64)> {
        let now_ns = monotonic_ns();
        let command =
            StateCommand { sequence: 1, sample_ns: now_ns, transition: Transition::Disable as u32, sender_pid: 1 };
        self.core.on_state_command(&command, now_ns).unwrap();
        self.state = self.core.report(now_ns);
        let mut states = vec![(self.state, self.behind.load_n_and_powered().0)];
        for _ in 0..60_000 {
            std::thread::sleep(Duration::from_millis(1));
            self.tick();
            let (load_n, n_powered) = self.behind.load_n_and_powered();
            if self.state.operating() == Some(OperatingState::Disabled) && n_powered == 0 {
                return states;
            }
            if self.state.is_letting_go() {
                assert_eq!(n_powered, 3, "under power while it gives way: {:?}", self.core.drive_error());
            }
            states.push((self.state, load_n));
        }
        panic!("power never went: {:?}", self.state);
    }
}

/// A drive of one of the back-ends, with a configuration that was changed.
type Open = fn(&dyn Fn(&mut SlaveConfig)) -> (SlaveConfig, BusDrive, Behind);

const BACK_ENDS: [(&str, Open); 3] = [
    ("sts3215", |change| servos(ServoMake::Sts3215, change)),
    ("xl330", |change| servos(ServoMake::Xl330, change)),
    ("cia402", |change| can(change)),
];

#[test]
fn loaded_lines_are_relaxed_through_the_bus_before_power_goes() {
    for (name, open) in BACK_ENDS {
        let mut bench = Bench::bent(open(&|_| {}));
        let (bent_n, _) = bench.behind.load_n_and_powered();
        assert!(bent_n > 4.0 * RELAX_N, "{name}: {bent_n} N");
        let states = bench.disable();
        let relaxing: Vec<&(SlaveState, f64)> = states.iter().filter(|(state, _)| state.is_letting_go()).collect();
        assert!(relaxing.len() > 10, "{name}: {} states", relaxing.len());
        let named = |state: &SlaveState| Reasons::from_bits(state.reasons).contains(Reason::Relaxing);
        assert!(relaxing.iter().all(|(state, _)| named(state)), "{name}");
        let (last, _) = states[states.len() - 1];
        // A bus is a cycle behind, and a measurement a step of the current.
        let (left_n, _) = bench.behind.load_n_and_powered();
        assert!(left_n < 1.25 * RELAX_N, "{name}: {bent_n} to {left_n} N");
        let way_m = |k: usize| last.setpoint_q_m[k] - states[0].0.setpoint_q_m[k];
        assert!(way_m(0) > 0.2e-3 && (0..3).all(|k| way_m(k) > -20e-6), "{name}: each gives way to its own line");
        for pair in relaxing.windows(2) {
            let since_s = (pair[1].0.setpoint_ns - pair[0].0.setpoint_ns) as f64 * 1e-9;
            let step_m = (0..3).map(|k| (pair[1].0.setpoint_q_m[k] - pair[0].0.setpoint_q_m[k]).abs());
            assert!(step_m.fold(0.0, f64::max) <= 2e-3 * since_s + 1e-9, "{name}: never faster than 2 mm/s");
        }
        assert_eq!(bench.core.drive_error(), None, "{name}");
    }
}

#[test]
fn the_way_bounds_it_and_power_off_or_a_stop_leave_the_load() {
    for (name, open) in BACK_ENDS {
        let mut bench = Bench::bent(open(&|config| config.drive.disable_relax_m = 0.2e-3));
        let states = bench.disable();
        let ways_m = (0..3).map(|k| (bench.state.setpoint_q_m[k] - states[0].0.setpoint_q_m[k]).abs());
        let way_m = ways_m.fold(0.0, f64::max);
        // The motion may not have ended when the power was asked off.
        assert!((0.15e-3..=0.2e-3 + STEP_M).contains(&way_m), "{name}: {way_m}");
        let (left_n, _) = bench.behind.load_n_and_powered();
        assert!(left_n > RELAX_N, "{name}: the way is what ended it, at {left_n} N");

        let mut bench = Bench::bent(open(&|config| config.drive.on_disable = OnDisable::PowerOff));
        let before = bench.state;
        let states = bench.disable();
        assert!(states.iter().all(|(state, _)| !state.is_letting_go()), "{name}");
        assert_eq!(bench.state.setpoint_q_m, before.setpoint_q_m, "{name}");
        assert!(states[states.len() - 1].1 > 4.0 * RELAX_N, "{name}: power went under load");
    }
}
