//! Derivatives of predictions and commands with respect to parameters, carried along with the history.
//!
//! Forward: where F(y; parameters, memory, readings) = 0, dy = -(dF/dy)^-1 dF at constant y; memory then takes the tangents.
//! The derivative is one-sided where a line changes between sticking and sliding.

use super::circumstances::Circumstances;
use super::circumstances::Clock;
use super::delay::DelayLine;
use super::equations::{Ends, actuators};
use super::forward::{Prediction, Predictor};
use super::inverse::{ChainCommand, ChainCompensator, InverseCore};
use super::model::{ChainModel, Memory};
use crate::effects::prepared::Now;
use crate::effects::{Dual, Real, three};
use nalgebra::{SMatrix, Vector2, Vector3};

/// A prediction and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictionTangents<const K: usize> {
    /// The prediction.
    pub prediction: Prediction,
    /// d observed bend / d parameters, rad per unit of each.
    pub by_parameter: SMatrix<f64, 2, K>,
}

/// A [`Predictor`] that carries derivatives along.
#[derive(Clone, Debug)]
pub struct PredictorTangents<const K: usize> {
    plain: Predictor,
    model: ChainModel<Dual<K>>,
    memory: Memory<Dual<K>>,
    p_m: [Dual<K>; 3],
    seat_m: [Dual<K>; 3],
    delay: DelayLine<Dual<K>>,
    clock: Clock,
    /// The solution, with tangents.
    y: [Dual<K>; 3],
    /// Where the parameters are.
    places: [(usize, usize); K],
}

impl<const K: usize> PredictorTangents<K> {
    pub(super) fn new(chain: &super::Chain, model: ChainModel<Dual<K>>, places: [(usize, usize); K]) -> Self {
        let mut memory = Memory::straight();
        let now = Clock::default().now(&Circumstances::at(0.0));
        let y = [Dual::constant(0.0), Dual::constant(0.0), model.preload];
        let ends = Ends::of::<true, Dual<K>>(&model, &mut memory, y, &now);
        Self {
            plain: chain.predictor(),
            p_m: ends.middle(),
            seat_m: ends.seat,
            model,
            memory,
            delay: DelayLine::new(),
            clock: Clock::default(),
            y,
            places,
        }
    }

    /// Sets the parameters, in the order of the lanes, and moves everything that is remembered to where it would be, to first
    /// order, had the values been these all along. A value that is not finite, and a lane without a parameter, stay as they are.
    ///
    /// # Real-time
    /// No allocation.
    pub fn set_parameters(&mut self, values: &[f64; K]) {
        let mut moved = [0.0; K];
        for (lane, (&place, &value)) in self.places.iter().zip(values).enumerate() {
            let Some(before) = self.model.get(place).map(Dual::value).filter(|before| *before != value) else {
                continue;
            };
            if value.is_finite() {
                moved[lane] = value - before;
                self.model.set(place, Dual::seed(value, lane));
                self.plain.model.set(place, value);
            }
        }
        if moved == [0.0; K] {
            return;
        }
        let by = |x: &mut Dual<K>| x.value += x.tangent.iter().zip(&moved).map(|(t, m)| t * m).sum::<f64>();
        self.memory.states.iter_mut().chain(&mut self.p_m).chain(&mut self.seat_m).chain(&mut self.y).for_each(by);
        let values = |of: &[Dual<K>; 3]| of.map(Dual::value);
        self.plain.take_over(
            self.memory.states.map(Dual::value),
            values(&self.p_m),
            values(&self.seat_m),
            values(&self.y),
        );
    }

    /// The shape for the next readings of the encoders, m, and its derivatives.
    pub fn step(&mut self, reading_m: Vector3<f64>, at: &Circumstances) -> PredictionTangents<K> {
        let prediction = self.plain.step(reading_m, at);
        if !reading_m.norm().is_finite() {
            return PredictionTangents { prediction, by_parameter: SMatrix::zeros() };
        }
        let now = self.clock.now(at);
        self.clock.tick(&now);
        let reading = [0, 1, 2].map(|i| Dual::constant(reading_m[i]));
        self.p_m = actuators(&self.model, &mut self.memory, reading, &self.p_m, &now);
        let y = self.solution(&now);
        self.y = y;
        let now = Now { commit: true, ..now };
        self.seat_m = Ends::of::<true, Dual<K>>(&self.model, &mut self.memory, y, &now).seat;
        let shape = self.model.observe(&mut self.memory, [y[0], y[1]], &now);
        let seen = match self.model.delay {
            Some(delay) => self.delay.pass(now.time_s, shape, delay),
            None => shape,
        };
        PredictionTangents { prediction, by_parameter: SMatrix::from_fn(|i, k| seen[i].tangent[k]) }
    }

    /// The plain solution with its tangents.
    fn solution(&mut self, now: &Now) -> [Dual<K>; 3] {
        let y = self.plain.solution().map(Dual::<K>::constant);
        let ends = Ends::of::<true, Dual<K>>(&self.model, &mut self.memory, y, now);
        // In the cases of the plain solution: rounding must not decide otherwise here than there.
        let f = ends.residual(&self.plain.cases, &self.seat_m, &self.p_m);
        let by_parameter = SMatrix::<f64, 3, K>::from_fn(|i, k| -f[i].tangent[k]);
        let dy = self.plain.slope.lu().solve(&by_parameter).unwrap_or_else(SMatrix::zeros);
        three(|i| Dual { value: y[i].value, tangent: core::array::from_fn(|k| dy[(i, k)]) })
    }
}

/// A [`ChainCompensator`] that carries derivatives along.
#[derive(Clone, Debug)]
pub struct CommandTangents<const K: usize> {
    plain: ChainCompensator,
    core: InverseCore<Dual<K>>,
    clock: Clock,
}

impl<const K: usize> CommandTangents<K> {
    pub(super) fn new(plain: ChainCompensator, model: ChainModel<Dual<K>>) -> Self {
        let core = plain.core_with(model);
        Self { plain, core, clock: Clock::default() }
    }

    /// The command for the next setpoint, rad, and d q~ / d parameters, m per unit of each, at constant signs of motion.
    pub fn step(&mut self, bend_rad: Vector2<f64>, at: &Circumstances) -> (ChainCommand, SMatrix<f64, 3, K>) {
        let command = self.plain.step(bend_rad, at);
        if command.status != super::ChainStatus::Good {
            return (command, SMatrix::zeros());
        }
        let now = Now { commit: true, ..self.clock.now(at) };
        self.clock.tick(&now);
        let b = self.core.model.unobserve([Dual::constant(bend_rad.x), Dual::constant(bend_rad.y)]);
        let plan = self.core.step::<true, _>(b, &now);
        (command, SMatrix::from_fn(|i, k| (plan.q[i] + plan.eps[i]).tangent[k]))
    }
}
