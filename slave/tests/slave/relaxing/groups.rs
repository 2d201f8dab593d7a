//! Power off where lines of several groups are loaded: a limit stops the group that it meets, and the others go on and no further.

use super::*;
use krait_ipc::message::MAX_ACTUATORS;
use krait_slave::ActuatorConfig;

/// Lines of one snake.
const N: usize = 3;
const BACK_M: Actuators = lines([1.0, -0.5, -0.5]);

/// Two simulated snakes, each on three lines. The second was assembled bent: at zero of its actuators its lines are this far out.
struct TwoSnakes {
    snakes: [SimulatedSnake; 2],
    bent_m: f64,
    is_on: bool,
}

impl TwoSnakes {
    /// What the actuators of a snake are from where its lines are, m.
    fn offset_m(&self, snake: usize, k: usize) -> f64 {
        if snake == 1 { self.bent_m * BACK_M[k] } else { 0.0 }
    }
}

impl Drive for TwoSnakes {
    fn n_actuators(&self) -> usize {
        2 * N
    }
    fn traits(&self) -> DriveTraits {
        DriveTraits { n_actuators: 2 * N, n_together: 2 * N, ..self.snakes[0].traits() }
    }
    fn write(&mut self, stamp_ns: i64, q_tilde_m: Actuators) -> Result<(), DriveError> {
        let places_m: [Actuators; 2] = core::array::from_fn(|snake| {
            lines(core::array::from_fn(|k| q_tilde_m[snake * N + k] - self.offset_m(snake, k)))
        });
        self.snakes.iter_mut().zip(places_m).try_for_each(|(snake, place_m)| snake.write(stamp_ns, place_m))
    }
    fn read(&mut self, stamp_ns: i64) -> Result<DriveReading, DriveError> {
        let readings = [self.snakes[0].read(stamp_ns)?, self.snakes[1].read(stamp_ns)?];
        let mut all = readings[0];
        for k in 0..MAX_ACTUATORS.min(2 * N) {
            let (snake, line) = (k / N, k % N);
            all.q_tilde_m[k] = readings[snake].q_tilde_m[line] + self.offset_m(snake, line);
            all.tau_n[k] = readings[snake].tau_n[line];
            all.state[k] = readings[snake].state[line];
            all.sampled_ns[k] = readings[snake].sampled_ns[line];
        }
        Ok(all)
    }
    fn home(&mut self, stamp_ns: i64) -> Result<Homing, DriveError> {
        self.write(stamp_ns, [0.0; MAX_ACTUATORS])?;
        Ok(Homing::Done)
    }
    fn set_power(&mut self, stamp_ns: i64, on: bool) -> Result<Switching, DriveError> {
        self.is_on = on;
        for snake in &mut self.snakes {
            snake.set_power(stamp_ns, on)?;
        }
        Ok(Switching::Done)
    }
    fn quick_stop(&mut self, stamp_ns: i64) {
        self.snakes.iter_mut().for_each(|snake| snake.quick_stop(stamp_ns));
    }
}

/// A slave before two snakes, of which the second is bent by so much at its zero, and whose strokes are so long.
struct Pair {
    core: SlaveCore<TwoSnakes>,
    now_ns: i64,
    sequence: u64,
    states: Vec<SlaveState>,
}

impl Pair {
    /// Enabled, homed, engaged; the first snake is bent by so much of a line's way at 10 mm/s.
    fn bent(groups: [u32; 2 * N], (stroke_m, second_m, first_m): (f64, f64, f64)) -> Self {
        let mut config = SlaveConfig::default();
        config.limits.stroke_m = stroke_m;
        config.drive.actuator =
            groups.iter().map(|group| ActuatorConfig { group: *group, ..ActuatorConfig::default() }).collect();
        let snakes = core::array::from_fn(|_| SimulatedSnake::new(&Truth::default()));
        let drives = TwoSnakes { snakes, bent_m: second_m, is_on: false };
        let mut pair = Self { core: SlaveCore::new(drives, &config), now_ns: MS, sequence: 0, states: Vec::new() };
        pair.core.transition(Transition::Enable, MS).unwrap();
        pair.now_ns += MS;
        pair.core.on_tick(pair.now_ns);
        pair.core.report(pair.now_ns);
        for reasons in [1 << Reason::OperatorAbsent as u32, 0] {
            pair.command(0.0, Phase::Holding, reasons);
        }
        for k in 0..=(first_m / 10e-6) as u32 {
            pair.command(f64::from(k) * 10e-6, Phase::Following, 0);
        }
        let state = pair.states[pair.states.len() - 1];
        assert!(state.is_engaged(), "{state:?}");
        pair
    }

    fn command(&mut self, way_m: f64, phase: Phase, reasons: u64) {
        self.now_ns += MS;
        self.sequence += 1;
        // The second one's lines go the other way.
        let q_tilde_m = core::array::from_fn(|k| match k / N {
            0 => DIRECTION[k] * way_m,
            1 => BACK_M[k - N] * way_m,
            _ => 0.0,
        });
        let command = Command {
            sequence: self.sequence,
            sample_ns: self.now_ns,
            q_uncompensated_m: q_tilde_m,
            q_tilde_m,
            n_actuators: 2 * N as u32,
            model_hash: 1,
            phase: phase as u32,
            reasons,
            ..Command::default()
        };
        self.core.on_command(&command, self.now_ns);
        self.core.on_tick(self.now_ns);
        self.states.push(self.core.report(self.now_ns));
    }

    /// Asks for power off and ticks until it is; where the actuators stood before and after, m, and the last loads under power, N.
    fn relaxed(&mut self) -> (Actuators, Actuators, Actuators) {
        self.core.disable(self.now_ns).unwrap();
        let mut from_m = None;
        for _ in 0..10_000 {
            if !self.core.drive().is_on {
                let last = self.states[self.states.len() - 1];
                return (from_m.unwrap(), last.setpoint_q_m, last.measured_tau_n);
            }
            self.now_ns += MS;
            self.core.on_tick(self.now_ns);
            let state = self.core.report(self.now_ns);
            if self.core.is_still() {
                from_m.get_or_insert(state.setpoint_q_m);
            }
            self.states.push(state);
        }
        panic!("power never went: {:?}", self.states[self.states.len() - 1]);
    }
}

/// Of the lines of a snake, the largest value.
fn most(values: &Actuators, snake: usize) -> f64 {
    values[snake * N..(snake + 1) * N].iter().fold(0.0, |most: f64, value| most.max(value.abs()))
}

const ONE: [u32; 2 * N] = [1; 2 * N];
const TWO: [u32; 2 * N] = [1, 1, 1, 2, 2, 2];
const STROKE_M: f64 = 2.2e-3;

/// Ways of the two snakes' lines and their largest loads at the end, m and N.
fn ended(groups: [u32; 2 * N], second_m: f64) -> ([f64; 2], [f64; 2]) {
    let mut pair = Pair::bent(groups, (STROKE_M, second_m, 2e-3));
    let (from_m, to_m, loads_n) = pair.relaxed();
    let way_m: Actuators = core::array::from_fn(|k| to_m[k] - from_m[k]);
    let found = ([0, 1].map(|snake| most(&way_m, snake)), [0, 1].map(|snake| most(&loads_n, snake)));
    assert!(to_m.iter().all(|q_m| q_m.abs() <= STROKE_M + 1e-12), "{to_m:?}");
    for pair in pair.states.windows(2) {
        let step_m = (0..2 * N).map(|k| (pair[1].setpoint_q_m[k] - pair[0].setpoint_q_m[k]).abs()).fold(0.0, f64::max);
        assert!(step_m <= 10e-6 * (1.0 + 1e-9), "{step_m}");
    }
    found
}

/// The second snake would go on beyond its stroke. Where all are one group, everything ends there; where each snake is one, the first goes
/// as far as it does where nothing stops anybody, and not a hair further: it never catches up.
#[test]
fn a_limit_stops_its_own_group_and_the_other_goes_as_far_as_alone() {
    let relax_n = SlaveConfig::default().drive.relax_n;
    // At 2 mm the second one is nearly straight, and nothing meets its stroke.
    let (free_m, free_n) = ended(TWO, 2e-3);
    assert!(free_m[0] > 0.8e-3 && free_m[1] < 0.195e-3 && free_n[0] <= 1.01 * relax_n, "{free_m:?} {free_n:?}");
    let (together_m, together_n) = ended(ONE, 5e-3);
    assert!(together_m[0] < 0.25e-3 && together_n[0] > 2.0 * relax_n, "{together_m:?} {together_n:?}");
    let (grouped_m, grouped_n) = ended(TWO, 5e-3);
    assert!(
        (0.15e-3..=0.2e-3 + 1e-9).contains(&grouped_m[1]) && grouped_n[1] > 2.0 * relax_n,
        "{grouped_m:?} {grouped_n:?}"
    );
    assert!((grouped_m[0] - free_m[0]).abs() < 20e-6, "{} m, with nobody stopped {} m", grouped_m[0], free_m[0]);
    assert!((grouped_n[0] - free_n[0]).abs() < 0.1, "{} N, with nobody stopped {} N", grouped_n[0], free_n[0]);
}
