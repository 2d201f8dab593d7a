//! The slave as others meet it: through its real channels, on a real bus, from enable to a clean end.
#![allow(clippy::unwrap_used, clippy::panic)] // Helpers of tests fail as tests do.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{
    Command, Health, HopStamps, OperatingState, Phase, Shape, SlaveState, StateCommand, Transition,
};
use krait_ipc::{Bus, Process, ReadOptions, Reader, Reason, Reasons, Writer, health_channel};
use krait_sim::{SimError, Simulation, run};
use krait_slave::{Actuators, ShapeSource, SlaveConfig, lines};
use std::thread;

const DIRECTION: Actuators = lines([-1.0, 0.5, 0.5]);

struct Others {
    commands: Option<Writer<Command>>,
    state_commands: Writer<StateCommand>,
    states: Reader<SlaveState>,
    shapes: Reader<Shape>,
    health: Reader<Health>,
    sequence: u64,
    n_state_commands: u64,
    seen_shapes: Vec<Shape>,
    seen_health: Option<Health>,
    // Last: the instance's files go when its last member goes.
    bus: Bus,
}

impl Others {
    fn open(bus: Bus) -> Self {
        Self {
            commands: Some(bus.writer().unwrap()),
            state_commands: bus.writer().unwrap(),
            states: bus.reader(ReadOptions::observing()).unwrap(),
            shapes: bus.reader(ReadOptions::observing()).unwrap(),
            health: bus.reader_on(&health_channel(Process::Slave), ReadOptions::waking()).unwrap(),
            sequence: 0,
            n_state_commands: 0,
            seen_shapes: Vec::new(),
            seen_health: None,
            bus,
        }
    }

    /// Another process becomes the writer of the commands, and goes on with the numbers of the one before.
    fn exchange_writer(&mut self) {
        self.commands = None;
        self.commands = Some(self.bus.writer().unwrap());
    }

    fn ask(&mut self, transition: Transition) {
        self.n_state_commands += 1;
        self.state_commands
            .send(&StateCommand {
                sequence: self.n_state_commands,
                sample_ns: monotonic_ns(),
                transition: transition as u32,
                sender_pid: std::process::id(),
            })
            .unwrap();
    }

    /// Sends a command about this instant, and lets a millisecond pass.
    fn go(&mut self, way_m: f64) {
        self.send(way_m, Phase::Following, 0);
    }

    fn send(&mut self, way_m: f64, phase: Phase, reasons: u64) {
        self.sequence += 1;
        let q_tilde_m = DIRECTION.map(|d| d * way_m);
        let commands = self.commands.as_mut().unwrap();
        commands
            .send(&Command {
                sequence: self.sequence,
                sample_ns: monotonic_ns(),
                stamps: HopStamps::default(),
                setpoint_sequence: 0,
                state_sequence: 0,
                model_update_sequence: 0,
                bend_rad: [way_m / 1.684e-3, 0.0],
                q_uncompensated_m: q_tilde_m,
                q_tilde_m,
                n_actuators: 3,
                model_hash: 1,
                learnt: [f64::NAN; 8],
                n_learnt: 0,
                phase: phase as u32,
                reasons,
                ..Command::default()
            })
            .unwrap();
        thread::sleep(Duration::from_millis(1));
    }

    /// The operator lets go and takes hold anew, where the slave stands.
    fn engage(&mut self, way_m: f64) {
        for is_present in [false, true] {
            for _ in 0..5 {
                self.send(way_m, Phase::Holding, if is_present { 0 } else { 1 << Reason::OperatorAbsent as u32 });
            }
        }
        self.until("engaged", SlaveState::is_engaged);
    }

    /// Takes what the slave shows beside its state: a channel that is first looked at after its writer has gone is empty.
    fn look(&mut self) {
        while let Some(shape) = self.shapes.take().unwrap() {
            self.seen_shapes.push(*shape);
        }
        if let Some(health) = self.health.take_newest().unwrap() {
            self.seen_health = Some(*health);
        }
    }

    /// Waits until the slave is in a state; every state until then is returned.
    fn until(&mut self, what: &str, is_so: impl Fn(&SlaveState) -> bool) -> Vec<SlaveState> {
        let mut states = Vec::new();
        for _ in 0..20_000 {
            self.look();
            while let Some(state) = self.states.take().unwrap() {
                states.push(*state);
                if is_so(&state) {
                    return states;
                }
            }
            thread::sleep(Duration::from_micros(500));
        }
        panic!("never {what}; last {:?}", states.last());
    }
}

fn has(state: &SlaveState, reason: Reason) -> bool {
    Reasons::from_bits(state.reasons).contains(reason)
}

/// Tells the slave to end even where a test fails, so that no thread is left waiting.
struct Stops<'a>(&'a AtomicBool);

impl Drop for Stops<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn with_slave(test: &str, config: &SlaveConfig, talk: impl FnOnce(&mut Others)) -> (Others, Result<(), SimError>) {
    let instance = format!("t-slave-{test}-{}", std::process::id());
    let stop = AtomicBool::new(false);
    let bus = Bus::open(&instance, "test").unwrap();
    let mut others = Others::open(bus);
    let result = thread::scope(|scope| {
        let slave = scope.spawn(|| {
            let bus = Bus::open(&instance, "slave").unwrap();
            run(&bus, config, Simulation::Snake(None), &stop)
        });
        let _stops = Stops(&stop);
        assert!(others.health.wait(Duration::from_secs(20)).unwrap(), "the slave says that it is ready");
        talk(&mut others);
        stop.store(true, Ordering::Relaxed);
        slave.join().unwrap()
    });
    (others, result)
}

#[test]
fn the_slave_enables_follows_stops_by_itself_refuses_and_ends_disabled() {
    // Patient, so that a busy machine that holds up this test is not mistaken for a fault of the slave.
    let mut config = SlaveConfig { watchdog_ms: 200.0, ..SlaveConfig::default() };
    (config.limits.command_age_ms, config.limits.late_ms) = (1000.0, 1000.0);
    let (mut others, result) = with_slave("life", &config, |others| {
        others.ask(Transition::Enable);
        others.until("ready", SlaveState::is_ready);
        others.engage(0.0);
        for k in 0..=300 {
            others.go(f64::from(k) * 5e-6);
        }
        stops_by_itself_within_its_time(others);
        follows_again_from_its_setpoint_and_refuses_what_is_wrong(others);
        others.ask(Transition::Pause);
        others.until("paused", |s| s.operating() == Some(OperatingState::Paused));
        others.ask(Transition::Enable);
        thread::sleep(Duration::from_millis(5));
    });
    result.unwrap();
    let states = others.until("disabled", |s| s.operating() == Some(OperatingState::Disabled));
    assert!(states.iter().all(|s| s.operating() != Some(OperatingState::Enabled)), "an invalid enable changed nothing");
    assert_eq!(others.states.n_lost(), 0);

    others.look();
    let health = others.seen_health.unwrap();
    assert_eq!((health.n_refused, health.n_lost), (2, 0), "the NaN and the jump");
    assert_eq!(health.n_received, others.sequence + others.n_state_commands);
    assert!(Reasons::from_bits(health.reasons_ever).contains(Reason::NotFinite));
    assert_eq!(health.records[Reason::StepLimit as usize].limit, 0.5e-3);
    sees_the_snake_bend(&others.seen_shapes);
}

/// Reads what followed the end of the commands.
fn stops_by_itself_within_its_time(others: &mut Others) {
    let last = others.sequence;
    let states = others.until("stale", |s| has(s, Reason::CommandStale) && s.command_sequence == last);
    let written: Vec<&SlaveState> = states.iter().filter(|s| s.command_sequence > 0).collect();
    assert!(written.len() > 300, "a report with every command");
    for state in &written {
        let stamps = state.stamps;
        assert!(stamps.slave_begun_ns > 0 && stamps.drive_written_ns >= stamps.slave_begun_ns);
    }
    let silent: Vec<&SlaveState> = states.iter().filter(|s| s.command_sequence == last).collect();
    let speeds = silent.windows(2).map(|pair| (pair[0].setpoint_q_m[0] - pair[1].setpoint_q_m[0]) * 1e6);
    let steps: Vec<f64> = speeds.filter(|way_um| *way_um != 0.0).collect();
    assert!(steps.iter().all(|way_um| *way_um > 0.0), "it goes on in its direction: {steps:?}");
    let overshoot_um: f64 = steps.iter().sum();
    assert!(overshoot_um < 500.0, "and not far: {overshoot_um} um");
    let end = silent.last().unwrap();
    assert_eq!(end.operating(), Some(OperatingState::Enabled));
    assert_eq!(end.flags & SlaveState::FOLLOWING, 0);
    assert!((end.measured_q_m[0] - end.setpoint_q_m[0]).abs() < 2e-6);
    let at_rest = &silent[silent.len() - 2];
    assert_eq!(at_rest.setpoint_q_m, end.setpoint_q_m, "it rests before it calls the commands stale");
}

fn follows_again_from_its_setpoint_and_refuses_what_is_wrong(others: &mut Others) {
    let rest = *others.until("at rest", |s| has(s, Reason::CommandStale)).last().unwrap();
    let way_m = -rest.setpoint_q_m[0];
    others.go(way_m);
    others.until("named", |s| has(s, Reason::ChainStalled) && has(s, Reason::NotEngaged));
    others.engage(way_m);
    others.go(way_m);
    others.until("following", |s| s.flags & SlaveState::FOLLOWING != 0);
    for (bad, reason) in [(f64::NAN, Reason::NotFinite), (way_m - 0.9e-3, Reason::StepLimit)] {
        // Keeps the stream alive, so that the jump is judged while following.
        others.go(way_m);
        others.go(bad);
        let refused = *others.until("refused", |s| has(s, reason)).last().unwrap();
        assert!((refused.setpoint_q_m[0] - rest.setpoint_q_m[0]).abs() < 1e-6, "{refused:?}");
    }
}

fn sees_the_snake_bend(shapes: &[Shape]) {
    assert!(shapes.len() > 15, "{} shapes", shapes.len());
    for pair in shapes.windows(2) {
        let frames = (pair[1].sample_ns - pair[0].sample_ns) as f64 / 16_666_666.0;
        assert!((frames - frames.round()).abs() < 1e-6 && frames > 0.5, "exposures are on the camera's grid");
    }
    let last = shapes.last().unwrap();
    // 1.5 mm is 51 deg of joint travel; half of it arrives, less the play.
    assert!(last.bend_rad[0] > 0.3 && last.bend_rad[0] < 0.5, "{last:?}");
    assert!(
        (last.theta_l_rad - (core::f64::consts::FRAC_PI_2 - last.bend_rad[0].hypot(last.bend_rad[1]))).abs() < 1e-12
    );
    assert!(last.available_ns >= last.sample_ns && (last.q_tilde_m[0] + 1.5e-3).abs() < 0.5e-3);
}

#[test]
fn a_polling_slave_answers_too_and_a_stop_in_motion_is_smooth() {
    let config = SlaveConfig { wait: krait_ipc::WaitMode::Polling, ..SlaveConfig::default() };
    let (mut others, result) = with_slave("stop", &config, |others| {
        others.ask(Transition::Enable);
        others.until("ready", SlaveState::is_ready);
        others.engage(0.0);
        for k in 0..=100 {
            others.go(f64::from(k) * 10e-6);
        }
    });
    result.unwrap();
    let states = others.until("disabled", |s| s.operating() == Some(OperatingState::Disabled));
    let end = states.last().unwrap();
    let moved_on_um = (-end.setpoint_q_m[0] - 1e-3) * 1e6;
    assert!(moved_on_um > -20.0 && moved_on_um < 500.0, "{moved_on_um} um");
}

#[test]
fn a_new_writer_of_the_commands_holds_until_engaged_anew_even_if_it_goes_on_with_their_numbers() {
    let mut config = SlaveConfig { watchdog_ms: 200.0, ..SlaveConfig::default() };
    (config.limits.command_age_ms, config.limits.late_ms) = (1000.0, 1000.0);
    let (_, result) = with_slave("writer", &config, |others| {
        others.ask(Transition::Enable);
        others.until("ready", SlaveState::is_ready);
        others.engage(0.0);
        for k in 0..=100 {
            others.go(f64::from(k) * 5e-6);
        }
        let way_m = 100.0 * 5e-6;
        others.until("following", |s| s.flags & SlaveState::FOLLOWING != 0);
        others.exchange_writer();
        for _ in 0..20 {
            others.go(way_m);
        }
        let newest = others.sequence;
        let held = *others.until("named", |s| has(s, Reason::StageRestarted)).last().unwrap();
        assert!(!held.is_engaged() && held.flags & SlaveState::FOLLOWING == 0, "{held:?}");
        for k in 0..50 {
            others.go(way_m + f64::from(k) * 5e-6);
        }
        let last = *others.until("heard", |s| s.n_commands >= newest + 50).last().unwrap();
        assert!(!last.is_engaged() && has(&last, Reason::NotEngaged), "{last:?}");
        let q_m = others.until("at rest", |s| s.sequence > last.sequence + 50).pop().unwrap().setpoint_q_m;
        assert!((q_m[0] + way_m).abs() < 0.1e-3, "{q_m:?}: only the braking moved it");
        others.engage(-q_m[0]);
    });
    result.unwrap();
}

#[test]
fn shapes_of_another_program_have_the_channel_to_themselves() {
    let instance = format!("t-slave-shape-{}", std::process::id());
    let bus = Bus::open(&instance, "vision").unwrap();
    let _vision = bus.writer::<Shape>().unwrap();
    let sentence =
        run(&bus, &SlaveConfig::default(), Simulation::Snake(None), &AtomicBool::new(false)).unwrap_err().to_string();
    assert!(
        sentence.contains("already publishes measured shapes") && sentence.contains("--shape external"),
        "{sentence}"
    );
    let config = SlaveConfig { shape: ShapeSource::External, ..SlaveConfig::default() };
    run(&bus, &config, Simulation::Snake(None), &AtomicBool::new(true)).unwrap();
}

#[test]
fn a_bad_configuration_or_truth_is_refused_before_anything_is_opened() {
    let bus = Bus::open(&format!("t-slave-bad-{}", std::process::id()), "slave").unwrap();
    let stop = AtomicBool::new(false);
    let missing = SlaveConfig { truth: Some("/nowhere/truth.toml".into()), ..SlaveConfig::default() };
    let sentence = run(&bus, &missing, Simulation::Snake(None), &stop).unwrap_err().to_string();
    assert!(sentence.contains("/nowhere/truth.toml"), "{sentence}");
    let mut far = SlaveConfig::default();
    far.limits.stroke_m = 9e-3;
    let sentence = run(&bus, &far, Simulation::Snake(None), &stop).unwrap_err().to_string();
    assert!(sentence.contains("limits.stroke_m") && sentence.contains("travel"), "{sentence}");
    let slow = SlaveConfig { watchdog_ms: 10.0, ..SlaveConfig::default() };
    let sentence = run(&bus, &slow, Simulation::Snake(None), &stop).unwrap_err().to_string();
    assert!(sentence.contains("watchdog_ms"), "{sentence}");
}
