//! The forward model of a chain: where the snake comes to rest for the encoders' history.

use super::circumstances::{ChainStatus, Circumstances, Clock};
use super::delay::DelayLine;
use super::equations::{Case, Ends, actuators};
use super::model::{ChainModel, MAX_STATES, Memory};
use super::{Chain, outer_strain};
use crate::effects::prepared::Now;
use crate::effects::{Dual, Real, three};
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
    /// Loads of the lines at their actuators, where load cells are, N, push positive: those at the snake and all friction between.
    pub actuator_load_n: Vector3<f64>,
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
    /// The lines at y.
    ends: Ends<Dual<3>>,
    /// What decided about each line at the last solution.
    pub(super) cases: [Case; 3],
    /// d residual / d y there.
    pub(super) slope: Matrix3<f64>,
}

/// Newton converges in 4 to 8 steps; more than this means that it does not.
const MAX_ITERATIONS: u32 = 40;
/// A few roundings of positions of a millimetre: what is below cannot be told from noise, and a snake at rest stays at rest.
const TOLERANCE_M: f64 = 1e-17;
/// Rounding may stop the search short of that; up to here it has converged.
const CONVERGED_M: f64 = 1e-14;
const MAX_HALVINGS: u32 = 10;
/// Where lines change between sticking and sliding the residual may have to rise before it falls.
const MAX_RISES: u32 = 6;

impl Predictor {
    pub(super) fn new(chain: &Chain) -> Self {
        let model = chain.model.clone();
        let mut memory = Memory::straight();
        let now = Clock::default().now(&Circumstances::at(0.0));
        let y = [0.0, 0.0, model.preload];
        let ends = Ends::<Dual<3>>::of::<true, f64>(&model, &mut memory, three(|k| Dual::seed(y[k], k)), &now);
        let last = Prediction {
            observed_bend_rad: Vector2::zeros(),
            bend_rad: Vector2::zeros(),
            tau_n: ends.tau_n.into(),
            actuator_load_n: ends.actuator_loads_n(&[Case::Rests; 3], &ends.middle().map(Dual::value)).into(),
            tau_common_n: model.preload,
            status: ChainStatus::Good,
            n_iterations: 0,
            residual_m: 0.0,
        };
        Self {
            p_m: ends.middle().map(Dual::value),
            seat_m: ends.seat.map(Dual::value),
            y,
            model,
            memory,
            delay: DelayLine::new(),
            clock: Clock::default(),
            last,
            strain_limit: chain.settings.strain_limit,
            max_bend_rad: chain.max_bend_rad,
            ends,
            cases: [Case::Rests; 3],
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
        if self.model.short { self.advance::<false>(reading_m, at) } else { self.advance::<true>(reading_m, at) }
    }

    #[inline(always)]
    fn advance<const FULL: bool>(&mut self, reading_m: Vector3<f64>, at: &Circumstances) -> Prediction {
        if !reading_m.norm().is_finite() {
            self.last.status = ChainStatus::NotFinite;
            return self.last;
        }
        let now = self.clock.now(at);
        self.clock.tick(&now);
        let p_m = actuators(&self.model, &mut self.memory, reading_m.into(), &self.p_m, &now);
        if FULL {
            // Time and memory have moved on; without them the ends depend on the shape alone.
            self.ends = self.ends_at::<true>(self.y, &now);
        }
        let found = self.solve::<FULL>(&p_m, &now);
        let in_range = found.y[0].hypot(found.y[1]) <= self.max_bend_rad && found.y.iter().all(|y| y.is_finite());
        (self.cases, self.slope) = if in_range {
            (self.y, self.p_m, self.ends) = (found.y, p_m, found.ends);
            (found.cases, found.slope)
        } else {
            let stays = Found::new(self.y, self.ends, &self.seat_m, &self.p_m);
            (stays.cases, stays.slope)
        };
        let (tau_n, actuator_load_n) = self.settle::<FULL>(&Now { commit: true, ..now });
        self.last = Prediction {
            observed_bend_rad: self.observe(&now),
            bend_rad: Vector2::new(self.y[0], self.y[1]),
            tau_n: tau_n.into(),
            actuator_load_n: actuator_load_n.into(),
            tau_common_n: self.y[2],
            status: self.status(&found, in_range),
            n_iterations: found.n_iterations,
            residual_m: found.largest(),
        };
        self.last
    }

    /// How often a formula was not finite since the start, and counted as zero.
    pub fn n_formula_faults(&self) -> u64 {
        self.memory.n_formula_faults
    }

    /// Goes on from other memory, after other parameters have been set.
    pub(super) fn take_over(&mut self, states: [f64; MAX_STATES], p_m: [f64; 3], seat_m: [f64; 3], y: [f64; 3]) {
        let now = Now { dt_s: 0.0, ..self.clock.now(&Circumstances::at(f64::NAN)) };
        (self.memory.states, self.p_m, self.seat_m, self.y) = (states, p_m, seat_m, y);
        self.ends = self.ends_at::<true>(self.y, &now);
    }

    pub(super) fn solution(&self) -> [f64; 3] {
        self.y
    }

    fn status(&self, found: &Found, in_range: bool) -> ChainStatus {
        let bend_rad = found.y[0].hypot(found.y[1]);
        match (in_range, found.largest() <= CONVERGED_M) {
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

    /// Lets friction begin where the lines are now, and the effects remember it; gives the loads at the snake and at the
    /// actuators, N.
    #[inline(always)]
    fn settle<const FULL: bool>(&mut self, now: &Now) -> ([f64; 3], [f64; 3]) {
        if FULL {
            let ends = Ends::of::<true, f64>(&self.model, &mut self.memory, self.y, now);
            self.seat_m = ends.seat;
            return (ends.tau_n, ends.actuator_loads_n(&self.cases, &self.p_m));
        }
        self.seat_m = self.ends.seat.map(Dual::value);
        (self.ends.tau_n, self.ends.actuator_loads_n(&self.cases, &self.p_m))
    }

    /// Newton's method with halved steps from the shape of the step before.
    #[inline(always)]
    fn solve<const FULL: bool>(&mut self, p_m: &[f64; 3], now: &Now) -> Found {
        let start = Found::new(self.y, self.ends, &self.seat_m, p_m);
        // Trials are a kilobyte each: two places take turns, and none is copied on the way.
        let (mut here, mut there) = (start, start);
        let (mut found, mut next) = (&mut here, &mut there);
        let mut best = None::<Found>;
        let mut n_rises = 0;
        for n_iterations in 1..=MAX_ITERATIONS {
            if found.largest() <= TOLERANCE_M {
                break;
            }
            let Some(step) = found.newton_step() else { break };
            self.search::<FULL>(found, step, p_m, now, next);
            next.n_iterations = n_iterations;
            if next.largest() >= found.largest() || !next.largest().is_finite() {
                n_rises += 1;
                if n_rises > MAX_RISES || !next.largest().is_finite() || found.largest() < CONVERGED_M {
                    break;
                }
                best = Some(found.better(best));
            }
            core::mem::swap(&mut found, &mut next);
        }
        found.better(best)
    }

    /// The first halving that reduces the residual, or else the full step.
    #[inline(always)]
    fn search<const FULL: bool>(
        &mut self,
        from: &Found,
        step: Vector3<f64>,
        p_m: &[f64; 3],
        now: &Now,
        next: &mut Found,
    ) {
        self.try_step::<FULL>(from, step, p_m, now, next);
        if next.largest() < from.largest() {
            return;
        }
        let full = *next;
        let mut scale = 1.0;
        for _ in 1..MAX_HALVINGS {
            scale *= 0.5;
            self.try_step::<FULL>(from, step * scale, p_m, now, next);
            if next.largest() < from.largest() {
                return;
            }
        }
        *next = full;
    }

    #[inline]
    fn try_step<const FULL: bool>(
        &mut self,
        from: &Found,
        step: Vector3<f64>,
        p_m: &[f64; 3],
        now: &Now,
        next: &mut Found,
    ) {
        let y = three(|k| from.y[k] - step[k]);
        *next = Found::new(y, self.ends_at::<FULL>(y, now), &self.seat_m, p_m);
    }

    #[inline(always)]
    fn ends_at<const FULL: bool>(&mut self, y: [f64; 3], now: &Now) -> Ends<Dual<3>> {
        Ends::of::<FULL, f64>(&self.model, &mut self.memory, three(|k| Dual::seed(y[k], k)), now)
    }
}

/// A trial (b_x, b_y, tau_m).
#[derive(Clone, Copy, Debug)]
struct Found {
    y: [f64; 3],
    ends: Ends<Dual<3>>,
    cases: [Case; 3],
    residual: Vector3<f64>,
    /// d residual / d y.
    slope: Matrix3<f64>,
    n_iterations: u32,
}

impl Found {
    #[inline(always)]
    fn new(y: [f64; 3], ends: Ends<Dual<3>>, seat: &[f64; 3], p: &[f64; 3]) -> Self {
        let cases = ends.cases(seat, p);
        let residual = ends.residual(&cases, seat, p);
        Self {
            y,
            ends,
            cases,
            residual: residual.map(Dual::value).into(),
            slope: Matrix3::from_fn(|i, k| residual[i].tangent[k]),
            n_iterations: 0,
        }
    }

    #[inline(always)]
    fn largest(&self) -> f64 {
        self.residual.amax()
    }

    fn better(self, other: Option<Self>) -> Self {
        match other {
            Some(other) if other.largest() <= self.largest() => other,
            _ => self,
        }
    }

    /// slope^-1 residual by Cramer's rule; nothing where the slope is singular.
    #[inline(always)]
    fn newton_step(&self) -> Option<Vector3<f64>> {
        let [a, b, c] = [0, 1, 2].map(|k| self.slope.column(k));
        let (b_c, r) = (b.cross(&c), &self.residual);
        let determinant = a.dot(&b_c);
        let step = Vector3::new(r.dot(&b_c), a.dot(&r.cross(&c)), a.dot(&b.cross(r))) / determinant;
        step.iter().all(|part| part.is_finite()).then_some(step)
    }
}
