//! Power off where lines are loaded: how far, how fast and how long the drives of a simulated snake give way first, and what comes in
//! between.

mod groups;

use krait_ipc::message::{Command, OperatingState, Phase, SlaveState, StateCommand, Transition};
use krait_ipc::{Reason, Reasons};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{
    Actuators, Drive, DriveError, DriveReading, DriveTraits, Homing, OnDisable, OnFault, SlaveConfig, SlaveCore,
    Switching, TransitionRefused, lines,
};

const MS: i64 = 1_000_000;
const DIRECTION: Actuators = lines([-1.0, 0.5, 0.5]);
/// The rate of giving way and a tick, m, and rounding.
const STEP_M: f64 = 2e-6 * (1.0 + 1e-6);

/// A simulated snake whose drives can be spoilt, and which tells when power went.
struct Drives {
    snake: SimulatedSnake,
    /// The load of the second line is not measured.
    is_blind: bool,
    /// They do not go where they are told.
    is_stuck: bool,
    failure: Option<DriveError>,
    is_on: bool,
    keeps_power: bool,
}

impl Drive for Drives {
    fn n_actuators(&self) -> usize {
        3
    }
    fn traits(&self) -> DriveTraits {
        let on_fault = if self.keeps_power { OnFault::Hold } else { OnFault::PowerOff };
        DriveTraits { on_fault, ..self.snake.traits() }
    }
    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        if self.is_stuck { Ok(()) } else { self.snake.write(stamp_ns, q_tilde_m) }
    }
    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        let mut reading = self.snake.read(stamp_ns)?;
        if self.is_blind {
            reading.tau_n[1] = f64::NAN;
        }
        Ok(reading)
    }
    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        self.snake.home(stamp_ns)
    }
    fn set_power(&mut self, stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        self.is_on = on;
        self.snake.set_power(stamp_ns, on)
    }
    fn quick_stop(&mut self, stamp_ns: i64) {
        self.snake.quick_stop(stamp_ns);
    }
    fn failure(&self) -> Option<DriveError> {
        self.failure
    }
}

/// A slave in motion, its clock and its newest state.
struct Bench {
    core: SlaveCore<Drives>,
    now_ns: i64,
    sequence: u64,
    state: SlaveState,
}

impl Bench {
    /// Enabled, engaged, and bent by so much of a line's way at 10 mm/s.
    fn bent(config: &SlaveConfig, keeps_power: bool, way_m: f64) -> Self {
        let drives = Drives {
            snake: SimulatedSnake::new(&Truth::default()),
            is_blind: false,
            is_stuck: false,
            failure: None,
            is_on: false,
            keeps_power,
        };
        let core = SlaveCore::new(drives, config);
        let mut bench = Self { core, now_ns: MS, sequence: 0, state: SlaveState::default() };
        bench.core.transition(Transition::Enable, MS).unwrap();
        bench.tick();
        for reasons in [1 << Reason::OperatorAbsent as u32, 0] {
            bench.command(0.0, Phase::Holding, reasons);
        }
        let n = (way_m / 10e-6) as u32;
        for k in 0..=n {
            bench.command(f64::from(k) * 10e-6, Phase::Following, 0);
        }
        assert!(bench.state.is_engaged() && bench.is(OperatingState::Enabled), "{:?}", bench.state);
        bench
    }

    fn tick(&mut self) {
        self.now_ns += MS;
        self.core.on_tick(self.now_ns);
        self.state = self.core.report(self.now_ns);
    }

    fn command(&mut self, way_m: f64, phase: Phase, reasons: u64) {
        self.now_ns += MS;
        self.sequence += 1;
        let q_tilde_m = DIRECTION.map(|d| d * way_m);
        let command = Command {
            sequence: self.sequence,
            sample_ns: self.now_ns,
            q_uncompensated_m: q_tilde_m,
            q_tilde_m,
            n_actuators: 3,
            model_hash: 1,
            phase: phase as u32,
            reasons,
            ..Command::default()
        };
        self.core.on_command(&command, self.now_ns);
        self.state = self.core.report(self.now_ns);
    }

    fn ask(&mut self, transition: Transition) -> Result<(), TransitionRefused> {
        let command =
            StateCommand { sequence: 1, sample_ns: self.now_ns, transition: transition as u32, sender_pid: 1 };
        let result = self.core.on_state_command(&command, self.now_ns);
        self.state = self.core.report(self.now_ns);
        result
    }

    /// Ticks until the power has gone, with the operator's commands going on as they were; every state of that time.
    fn until_off(&mut self) -> Vec<SlaveState> {
        let mut states = vec![self.state];
        for _ in 0..20_000 {
            if !self.core.drive().is_on {
                return states;
            }
            self.command(1e-3, Phase::Following, 0);
            self.core.on_tick(self.now_ns);
            self.state = self.core.report(self.now_ns);
            states.push(self.state);
        }
        panic!("power never went: {:?}", self.state);
    }

    fn is(&self, state: OperatingState) -> bool {
        self.state.operating() == Some(state)
    }

    fn has(&self, reason: Reason) -> bool {
        Reasons::from_bits(self.state.reasons).contains(reason)
    }
}

fn largest_n(state: &SlaveState) -> f64 {
    state.measured_tau_n.iter().fold(0.0, |largest: f64, tau| largest.max(tau.abs()))
}

fn way_m(from: &SlaveState, to: &SlaveState) -> f64 {
    (0..3).map(|k| (to.setpoint_q_m[k] - from.setpoint_q_m[k]).abs()).fold(0.0, f64::max)
}

fn steps_m(states: &[SlaveState]) -> impl Iterator<Item = f64> {
    states.windows(2).map(|pair| way_m(&pair[0], &pair[1]))
}

/// From the first state that stands, and how long the power lasted, ms.
fn at_rest(states: &[SlaveState]) -> (SlaveState, i64) {
    // The braking of 10 mm/s ends when no step is longer than one of giving way.
    let braked = steps_m(states).rposition_from(|step| step > STEP_M);
    let lasted_ms = (states[states.len() - 1].sample_ns - states[0].sample_ns) / MS;
    (states[braked.map_or(0, |at| at + 1)], lasted_ms)
}

trait LastAt: Iterator<Item = f64> + Sized {
    /// Place of the last item for which something holds.
    fn rposition_from(self, holds: impl Fn(f64) -> bool) -> Option<usize> {
        self.enumerate().filter(|(_, item)| holds(*item)).map(|(at, _)| at).last()
    }
}
impl<I: Iterator<Item = f64>> LastAt for I {}

#[test]
fn a_disable_brakes_relaxes_the_lines_within_way_speed_and_time_and_then_takes_power() {
    let mut config = SlaveConfig::default();
    (config.drive.disable_relax_m, config.drive.disable_relax_ms) = (1e-3, 1000.0);
    let mut bench = Bench::bent(&config, false, 2e-3);
    bench.ask(Transition::Disable).unwrap();
    assert!(bench.state.is_letting_go() && bench.core.drive().is_on && !bench.state.is_engaged());
    assert!(bench.has(Reason::Relaxing) && bench.has(Reason::SlaveNotEnabled));
    let note = bench.core.findings(bench.now_ns).note_of(Reason::Relaxing).unwrap();
    assert_eq!((note.value, note.limit), (largest_n(&bench.state), 2.0));
    let states = bench.until_off();
    let (rest, lasted_ms) = at_rest(&states);
    let last = states[states.len() - 1];
    assert!(bench.is(OperatingState::Disabled) && bench.state.desired() == bench.state.operating());
    assert!(!bench.has(Reason::Relaxing) && !bench.core.is_letting_go());
    // At 1 mm a line still has load: the way is the bound, and 1 mm at 2 mm/s takes half a second.
    assert!((0.9e-3..=1e-3 + 1e-9).contains(&way_m(&rest, &last)), "{}", way_m(&rest, &last));
    assert!((500..=1000).contains(&lasted_ms), "{lasted_ms} ms");
    assert!(largest_n(&last) < 0.75 * largest_n(&rest), "{} of {}", largest_n(&last), largest_n(&rest));
    // Load falls all the way; braking from 10 mm/s is as hard as any other, then 2 mm/s.
    let braking_m = steps_m(&states).take(40).fold(0.0, f64::max);
    assert!(braking_m <= 10e-6 && steps_m(&states).skip(40).all(|step| step <= STEP_M), "{braking_m}");
    assert!(states.iter().all(|state| state.flags & (SlaveState::FOLLOWING | SlaveState::IS_BUSY) == 0));
}

/// Nobody need set anything: from the bend limit the snake of the paper goes back to loads that are let be.
#[test]
fn by_default_a_snake_at_its_bend_limit_loses_its_load_before_its_power() {
    let config = SlaveConfig::default();
    // 80 deg of bend.
    let at_limit_m = 5.0e-3;
    let mut bench = Bench::bent(&config, false, at_limit_m);
    let bent_n = largest_n(&bench.state);
    bench.ask(Transition::Disable).unwrap();
    let states = bench.until_off();
    let (rest, lasted_ms) = at_rest(&states);
    let (way_m, left_n) = (way_m(&rest, &bench.state), largest_n(&states[states.len() - 1]));
    assert!(bent_n > 10.0 * config.drive.relax_n && left_n <= 1.01 * config.drive.relax_n, "{bent_n} to {left_n} N");
    assert!(way_m < 0.95 * config.drive.disable_relax_m, "{way_m} m: the bounds are not what ends it");
    assert!((lasted_ms as f64) < 0.95 * config.drive.disable_relax_ms, "{lasted_ms} ms");
    assert!(steps_m(&states).all(|step| step <= 10e-6), "nothing springs");
}

#[test]
fn little_load_is_relaxed_to_little_and_none_or_another_configuration_takes_power_at_once() {
    let mut config = SlaveConfig::default();
    config.drive.relax_n = 4.0;
    let mut bench = Bench::bent(&config, false, 0.5e-3);
    bench.ask(Transition::Disable).unwrap();
    let states = bench.until_off();
    let (first_n, last_n) = (largest_n(&states[0]), largest_n(&states[states.len() - 1]));
    assert!(first_n > 4.0 && last_n <= 4.0, "{first_n} to {last_n}");

    config.drive.relax_n = 500.0;
    let off = OnDisable::PowerOff;
    let mut lets_go = SlaveConfig::default();
    lets_go.drive.on_disable = off;
    for config in [config, lets_go] {
        let mut bench = Bench::bent(&config, false, 1e-3);
        bench.ask(Transition::Disable).unwrap();
        assert!(bench.is(OperatingState::Disabled) && !bench.core.drive().is_on);
    }
    // The slave itself, at its end, does not wait.
    let mut bench = Bench::bent(&SlaveConfig::default(), false, 1e-3);
    bench.core.transition(Transition::Disable, bench.now_ns).unwrap();
    assert!(!bench.core.drive().is_on);
}

#[test]
fn what_is_not_known_is_not_relaxed() {
    let mut bench = Bench::bent(&SlaveConfig::default(), false, 1e-3);
    bench.core.drive_mut().is_blind = true;
    bench.tick();
    bench.ask(Transition::Disable).unwrap();
    assert!(!bench.core.drive().is_on, "a load that is not known from the start: power goes at once");

    let mut bench = Bench::bent(&SlaveConfig::default(), false, 1e-3);
    bench.ask(Transition::Disable).unwrap();
    for _ in 0..100 {
        bench.tick();
    }
    let before = bench.state;
    bench.core.drive_mut().is_blind = true;
    let states = bench.until_off();
    assert!(states.len() < 12 && way_m(&before, &bench.state) < 6e-6, "{} states", states.len());
    assert!(bench.is(OperatingState::Disabled));
}

#[test]
fn a_stop_or_a_pause_ends_the_motion_at_once_and_power_goes_and_nothing_brings_it_back() {
    for pauses in [false, true] {
        let mut bench = Bench::bent(&SlaveConfig::default(), false, 1e-3);
        bench.ask(Transition::Disable).unwrap();
        for _ in 0..100 {
            bench.tick();
        }
        for transition in [Transition::Resume, Transition::Enable, Transition::Home, Transition::Unhome] {
            let refused = bench.ask(transition).unwrap_err().to_string();
            assert!(refused.contains("power is about to go"), "{refused}");
        }
        let before = bench.state;
        match pauses {
            true => bench.ask(Transition::Pause).unwrap(),
            false => bench.core.stop(bench.now_ns),
        }
        let states = bench.until_off();
        // 2 mm/s at 1 m/s2 are gone after 2 ms.
        assert!(states.len() < 12 && way_m(&before, &bench.state) < 6e-6, "{} states", states.len());
        assert!(bench.is(OperatingState::Disabled) && !bench.core.is_letting_go());
    }
}

#[test]
fn a_disable_behind_a_stop_relaxes_the_lines_and_one_asked_again_does_not_prolong_it() {
    let once = |again: bool| {
        let mut bench = Bench::bent(&SlaveConfig::default(), false, 2e-3);
        bench.core.stop(bench.now_ns);
        bench.ask(Transition::Disable).unwrap();
        assert!(bench.state.is_letting_go());
        for _ in 0..300 {
            bench.tick();
        }
        if again {
            bench.ask(Transition::Disable).unwrap();
        }
        bench.until_off();
        bench.now_ns
    };
    assert_eq!(once(true), once(false));
}

#[test]
fn a_fault_in_between_is_named_and_takes_power_at_once_whatever_a_fault_does_otherwise() {
    for keeps_power in [false, true] {
        for is_stuck in [false, true] {
            let mut bench = Bench::bent(&SlaveConfig::default(), keeps_power, 1e-3);
            bench.ask(Transition::Disable).unwrap();
            for _ in 0..50 {
                bench.tick();
            }
            match is_stuck {
                true => bench.core.drive_mut().is_stuck = true,
                false => bench.core.drive_mut().failure = Some(DriveError::Lost { actuator: 2, silent_ms: 15.0 }),
            }
            let at_ns = bench.now_ns;
            let states = bench.until_off();
            assert!(bench.is(OperatingState::Fault) && !bench.has(Reason::Relaxing), "{:?}", bench.state);
            assert!(bench.core.drive_error().is_some() && !bench.core.is_letting_go());
            assert_eq!(bench.state.flags & SlaveState::OTHERS_HOLD, 0, "what has no power does not hold");
            // A failure is seen at once; 0.3 mm beside the setpoint take 150 ms at 2 mm/s.
            let lasted_ms = (bench.now_ns - at_ns) / MS;
            assert!(
                if is_stuck { (145..200).contains(&lasted_ms) } else { lasted_ms <= 2 },
                "{lasted_ms} ms, {}",
                states.len()
            );
            bench.core.drive_mut().failure = None;
            bench.ask(Transition::Disable).unwrap();
            assert!(bench.is(OperatingState::Disabled));
        }
    }
}

#[test]
fn power_goes_when_the_time_is_over_also_in_motion_and_after_a_gap() {
    let mut config = SlaveConfig::default();
    config.drive.disable_relax_ms = 100.0;
    let mut bench = Bench::bent(&config, false, 2e-3);
    bench.ask(Transition::Disable).unwrap();
    let states = bench.until_off();
    let (rest, lasted_ms) = at_rest(&states);
    let steps: Vec<f64> = steps_m(&states).collect();
    assert!((95..=100).contains(&lasted_ms) && way_m(&rest, &bench.state) < 0.2e-3, "{lasted_ms} ms");
    assert!(steps[steps.len() - 1] < 0.5 * STEP_M, "it comes to rest before: {:?}", &steps[steps.len() - 6..]);

    // Shorter than the braking of the motion that was under way.
    config.drive.disable_relax_ms = 10.0;
    (config.deceleration_m_per_s2, config.watchdog_ms) = (0.7, 50.0);
    let mut bench = Bench::bent(&config, false, 2e-3);
    bench.ask(Transition::Disable).unwrap();
    let states = bench.until_off();
    assert!(states[states.len() - 1].sample_ns - states[0].sample_ns <= 11 * MS);

    // A slave that stood still until the time was over does not go on where it was.
    let mut bench = Bench::bent(&SlaveConfig::default(), false, 2e-3);
    bench.ask(Transition::Disable).unwrap();
    for _ in 0..100 {
        bench.tick();
    }
    let before = bench.state;
    bench.now_ns += 5000 * MS;
    bench.tick();
    assert!(bench.is(OperatingState::Disabled) && way_m(&before, &bench.state) == 0.0);
}

#[test]
fn relaxing_allocates_nothing() {
    let mut bench = Bench::bent(&SlaveConfig::default(), false, 1e-3);
    let n = crate::allocations::allocations_of(|| {
        bench.core.disable(bench.now_ns).unwrap();
        while bench.core.is_letting_go() {
            bench.tick();
        }
    });
    assert!(n == 0 && bench.is(OperatingState::Disabled));
}
