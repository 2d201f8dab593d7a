//! The forward model of a chain: where the snake comes to rest for the encoders' history.

use super::circumstances::{ChainStatus, Circumstances, Clock};
use super::delay::DelayLine;
use super::model::{ChainModel, Lines, Memory};
use super::stages::Stage;
use super::{Chain, outer_strain};
use crate::effects::prepared::Now;
use crate::effects::{Dual, Real, Scalar, play};
use nalgebra::{Matrix3, Vector2, Vector3};

/// One step's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The bend vector that is observed, rad.
    pub observed_bend_rad: Vector2<f64>,
    /// The bend vector of the arc, rad.
    pub bend_rad: Vector2<f64>,
    /// Loads of the lines at the snake, N, push positive.
    pub tau_n: Vector3<f64>,
    /// Internal load that all three lines share, N.
    pub tau_common_n: f64,
    /// What there is to say.
    pub status: ChainStatus,
    /// Newton steps taken.
    pub n_iterations: u32,
    /// Largest part of the equations that is left, m.
    pub residual_m: f64,
}

/// Predicts shapes step by step; owns the memory of every effect.
#[derive(Clone, Debug)]
pub struct Predictor {
    pub(super) model: ChainModel<f64>,
    memory: Memory<f64>,
    /// Outputs of the plays.
    p_m: [f64; 3],
    /// Positions of the lines where friction begins.
    seat_m: [f64; 3],
    /// (b_x, b_y, tau_m).
    y: [f64; 3],
    delay: DelayLine<f64>,
    clock: Clock,
    last: Prediction,
    strain_limit: f64,
    max_bend_rad: f64,
    /// d residual / d y at the last solution.
    pub(super) slope: Matrix3<f64>,
}

/// Newton converges in 4 to 8 steps; more than this means that it does not.
const MAX_ITERATIONS: u32 = 40;
/// Rounding level of positions of a millimetre.
const TOLERANCE_M: f64 = 2e-18;
/// Rounding may stop the search short of that; up to here it has converged.
const CONVERGED_M: f64 = 1e-14;
const MAX_HALVINGS: u32 = 10;
/// Where lines change between sticking and sliding the residual may have to rise before it falls.
const MAX_RISES: u32 = 6;

impl Predictor {
    pub(super) fn new(chain: &Chain) -> Self {
        let model = chain.model.clone();
        let preload = model.preload;
        let mut memory = Memory::straight();
        let now = Clock::default().now(&Circumstances::at(0.0));
        let lines = model.lines(&mut memory, [0.0; 2], preload, &now);
        let last = Prediction {
            observed_bend_rad: Vector2::zeros(),
            bend_rad: Vector2::zeros(),
            tau_n: Vector3::from(lines.tau),
            tau_common_n: preload,
            status: ChainStatus::Good,
            n_iterations: 0,
            residual_m: 0.0,
        };
        Self {
            p_m: middle(&lines),
            seat_m: lines.seat,
            y: [0.0, 0.0, preload],
            model,
            memory,
            delay: DelayLine::new(),
            clock: Clock::default(),
            last,
            strain_limit: chain.settings.strain_limit,
            max_bend_rad: chain.max_bend_rad,
            slope: Matrix3::identity(),
        }
    }

    /// The shape for the next readings of the encoders, m, push positive.
    ///
    /// Readings that are not finite repeat the prediction before; an equilibrium out of range leaves the shape where it was.
    ///
    /// # Real-time
    /// No allocation; at most 40 Newton steps with 10 halvings each.
    pub fn step(&mut self, reading_m: Vector3<f64>, at: &Circumstances) -> Prediction {
        if !reading_m.norm().is_finite() {
            self.last.status = ChainStatus::NotFinite;
            return self.last;
        }
        let now = self.clock.now(at);
        self.clock.tick(&now);
        let p_m = actuators(&self.model, &mut self.memory, reading_m.into(), &self.p_m, &now);
        let found = self.solve(p_m, &now);
        let in_range = found.y[0].hypot(found.y[1]) <= self.max_bend_rad && found.y.iter().all(|y| y.is_finite());
        if in_range {
            (self.y, self.p_m) = (found.y, p_m);
        }
        let now = Now { commit: true, ..now };
        let [b_x, b_y, tau_common] = self.y;
        self.slope = slope(&self.model, &mut self.memory, &self.y, &self.seat_m, &self.p_m, &now);
        let lines = self.model.lines(&mut self.memory, [b_x, b_y], tau_common, &now);
        self.seat_m = lines.seat;
        self.last = Prediction {
            observed_bend_rad: self.observe(&now),
            bend_rad: Vector2::new(b_x, b_y),
            tau_n: Vector3::from(lines.tau),
            tau_common_n: tau_common,
            status: self.status(&found, in_range),
            n_iterations: found.n_iterations,
            residual_m: found.residual.amax(),
        };
        self.last
    }

    /// How often a formula was not finite since the start, and counted as zero.
    pub fn n_formula_faults(&self) -> u64 {
        self.memory.n_formula_faults
    }

    pub(super) fn solution(&self) -> [f64; 3] {
        self.y
    }

    fn status(&self, found: &Found, in_range: bool) -> ChainStatus {
        let bend_rad = found.y[0].hypot(found.y[1]);
        match (in_range, found.residual.amax() <= CONVERGED_M) {
            (false, true) if bend_rad.is_finite() => {
                let strain = outer_strain(&self.model.constants, bend_rad);
                ChainStatus::BeyondStrain { strain, limit: self.strain_limit }
            }
            (false, _) => ChainStatus::OutOfRange,
            (true, true) => ChainStatus::Good,
            (true, false) => ChainStatus::Stuck,
        }
    }

    fn observe(&mut self, now: &Now) -> Vector2<f64> {
        let shape = self.model.observe(&mut self.memory, [self.y[0], self.y[1]], now);
        match self.model.delay {
            Some(delay) => self.delay.pass(now.time_s, shape, delay).into(),
            None => shape.into(),
        }
    }

    /// Newton's method with halved steps from the shape of the step before.
    fn solve(&mut self, p_m: [f64; 3], now: &Now) -> Found {
        let mut found = self.at(self.y, &p_m, now);
        let mut best = found;
        let mut n_rises = 0;
        for n_iterations in 1..=MAX_ITERATIONS {
            if best.residual.amax() <= TOLERANCE_M {
                break;
            }
            let slope = slope(&self.model, &mut self.memory, &found.y, &self.seat_m, &p_m, now);
            let Some(step) = slope.lu().solve(&found.residual) else { break };
            let (next, helped) = self.search(&found, step, &p_m, now);
            if !helped {
                n_rises += 1;
            }
            if n_rises > MAX_RISES
                || !next.residual.amax().is_finite()
                || (!helped && found.residual.amax() < CONVERGED_M)
            {
                break;
            }
            found = next;
            if found.residual.amax() < best.residual.amax() {
                best = Found { n_iterations, ..found };
            }
        }
        best
    }

    /// The first halving that reduces the residual, or else the full step.
    fn search(&mut self, from: &Found, step: Vector3<f64>, p_m: &[f64; 3], now: &Now) -> (Found, bool) {
        let mut scale = 1.0;
        let mut full = *from;
        for k in 0..MAX_HALVINGS {
            let y = core::array::from_fn(|i| from.y[i] - scale * step[i]);
            let trial = self.at(y, p_m, now);
            if trial.residual.amax() < from.residual.amax() {
                return (trial, true);
            }
            if k == 0 {
                full = trial;
            }
            scale *= 0.5;
        }
        (full, false)
    }

    fn at(&mut self, y: [f64; 3], p_m: &[f64; 3], now: &Now) -> Found {
        let lines = self.model.lines(&mut self.memory, [y[0], y[1]], y[2], now);
        let residual = Vector3::from(residual(&self.model, &lines, &self.seat_m, p_m));
        Found { y, residual, n_iterations: 0 }
    }
}

#[derive(Clone, Copy, Debug)]
struct Found {
    y: [f64; 3],
    residual: Vector3<f64>,
    n_iterations: u32,
}

/// clamp(x - x', A- - p, A+ - p) for each line, m; with stalling actuators, between the limits of their force as well.
pub(super) fn residual<P: Real, S: Scalar<P>>(
    model: &ChainModel<P>,
    lines: &Lines<S>,
    seat: &[P; 3],
    p: &[P; 3],
) -> [S; 3] {
    core::array::from_fn(|i| {
        let position = &lines.position[i];
        let free = clamp(lines.seat[i] - seat[i], position.low - p[i], position.high - p[i]);
        let Some(stall) = model.stall else { return free };
        let c = P::constant(model.constants.c_d_m_per_n);
        let (pushed, drawn) = ((lines.load[i].high - stall) * c, (lines.load[i].low + stall) * c);
        clamp(free, pushed, drawn)
    })
}

/// Half-way between the limits of friction: where the lines' ends are at the start.
pub(super) fn middle<P: Real>(lines: &Lines<P>) -> [P; 3] {
    [0, 1, 2].map(|i| (lines.position[i].low + lines.position[i].high) * P::constant(0.5))
}

/// Positions behind the plays for readings of the encoders, m.
pub(super) fn actuators<P: Scalar<P>>(
    model: &ChainModel<P>,
    memory: &mut Memory<P>,
    reading: [P; 3],
    p: &[P; 3],
    now: &Now,
) -> [P; 3] {
    let q_tilde = decode(model, memory, reading, now);
    core::array::from_fn(|i| play(p[i], q_tilde[i] + model.preload_m(), model.half_width, now.fresh))
}

/// True positions from readings: each encoder effect inverted, last first, by Newton's method on a monotone function.
fn decode<P: Scalar<P>>(model: &ChainModel<P>, memory: &mut Memory<P>, reading: [P; 3], now: &Now) -> [P; 3] {
    let mut x = reading;
    for e in model.stages.of(Stage::Encoder).iter().rev() {
        for (i, own) in x.iter_mut().enumerate() {
            let target = *own;
            for _ in 0..DECODE_STEPS {
                let h = 1e-9;
                let here = model.encode(e, memory, i, *own, now);
                let above = model.encode(e, memory, i, *own + P::constant(h), now);
                let slope = ((above.value() - here.value()) / h).clamp(0.1, 10.0);
                *own = *own - (here - target) * P::constant(1.0 / slope);
            }
        }
    }
    x
}

/// The slope's difference quotient costs convergence a digit or so a step, and the last one is below rounding.
const DECODE_STEPS: u32 = 12;

fn clamp<S: Real>(x: S, low: S, high: S) -> S {
    if x.value() < low.value() {
        low
    } else if x.value() > high.value() {
        high
    } else {
        x
    }
}

fn slope(
    model: &ChainModel<f64>,
    memory: &mut Memory<f64>,
    y: &[f64; 3],
    seat: &[f64; 3],
    p: &[f64; 3],
    now: &Now,
) -> Matrix3<f64> {
    let now = Now { commit: false, ..*now };
    let [b_x, b_y, tau_common] = [0, 1, 2].map(|k| Dual::<3>::seed(y[k], k));
    let lines = model.lines(memory, [b_x, b_y], tau_common, &now);
    let f = residual(model, &lines, seat, p);
    Matrix3::from_fn(|i, k| f[i].tangent[k])
}
