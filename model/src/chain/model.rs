//! The lines of a chain at one shape: displacement, loads, and the actuator positions between which each line sticks.
//!
//! Immutable after it is built; memory is passed in. One code for values, shape derivatives and parameter derivatives.

use super::settings::{ChainError, EffectSetting};
use super::stages::{Stage, Stages};
use crate::effects::friction::Limits;
use crate::effects::prepared::{Constants, Now, Prepared};
use crate::effects::{
    EffectKind, Real, Scalar, encoder, extension, formula, formula_variables, friction, geometry, moment, shape, three,
};
use core::ops::{Add, Mul};
use std::sync::Arc;

/// Numbers of memory that a chain can have: enough for every list of effects that is accepted (at most 24 + 9 + 14 times 6).
pub(crate) const MAX_STATES: usize = 160;

/// What the effects remember.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Memory<P> {
    pub states: [P; MAX_STATES],
    /// How often a formula was not finite and counted as zero.
    pub n_formula_faults: u64,
}

impl<P: Real> Memory<P> {
    /// At rest at the straight pose, every play in its middle.
    pub(crate) fn straight() -> Self {
        Self { states: [P::constant(0.0); MAX_STATES], n_formula_faults: 0 }
    }
}

/// The three lines at one shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lines<S> {
    /// Loads at the snake, N.
    pub tau: [S; 3],
    /// Loads at the actuator, N: about to be drawn back, about to be pushed.
    pub load: [Limits<S>; 3],
    /// Positions of the lines where friction begins, m: what stays where it is while a line sticks.
    pub seat: [S; 3],
    /// Positions behind the play that draw a line back and push it, m.
    pub position: [Limits<S>; 3],
}

/// A chain's constants.
#[derive(Clone, Debug)]
pub(crate) struct ChainModel<P> {
    pub constants: Constants,
    pub stages: Stages<P>,
    formulas: Arc<Vec<formula::Formula>>,
    /// d q / d bend, rows: lines.
    pub j: [[P; 2]; 3],
    /// Its pseudo-inverse's transpose: loads for a moment.
    pub divide: [[P; 2]; 3],
    /// Compliances of each line in the holder and in the cone, m/N.
    c_d: [P; 3],
    c_c: [P; 3],
    friction_at_snake: bool,
    /// Half-width of the play, m.
    pub half_width: P,
    /// Internal load at encoder zero, N.
    pub preload: P,
    /// Force at which an actuator stalls, N.
    pub stall: Option<P>,
    /// Delay of the camera, s.
    pub delay: Option<P>,
}

impl<P: Real> ChainModel<P> {
    pub(crate) fn new(
        constants: Constants,
        effects: &[EffectSetting],
        formulas: Arc<Vec<formula::Formula>>,
        parameter: impl Fn(usize, usize) -> P,
    ) -> Result<Self, ChainError> {
        let stages = Stages::new(effects, &formulas, &constants, &parameter)?;
        let first = |kind| effects.iter().position(|e| e.kind() == kind).map(|k| parameter(k, 0));
        let zero = P::constant(0.0);
        let mut j = nominal_jacobian(constants.r_m);
        let mut compliance = [P::constant(1.0); 3];
        for (k, effect) in effects.iter().enumerate() {
            let c: [P; crate::effects::MAX_PARAMETERS] = core::array::from_fn(|n| parameter(k, n));
            geometry::shape_jacobian(effect.kind(), &c, &mut j, &mut compliance);
        }
        Ok(Self {
            divide: pseudo_inverse_transposed(&j).ok_or(ChainError::Geometry)?,
            j,
            c_d: compliance.map(|c| c * P::constant(constants.c_d_m_per_n)),
            c_c: compliance.map(|c| c * P::constant(constants.c_c_m_per_n)),
            friction_at_snake: effects.iter().any(|e| e.kind() == EffectKind::DiskFriction),
            half_width: first(EffectKind::Backlash).unwrap_or(zero),
            preload: first(EffectKind::Preload).unwrap_or(zero),
            stall: first(EffectKind::Saturation),
            delay: first(EffectKind::Latency),
            constants,
            stages,
            formulas,
        })
    }

    /// The lines at a bend (rad) with an internal load (N) that all three share, which is a variable or a parameter.
    #[inline(always)]
    pub(crate) fn lines<S, T>(&self, memory: &mut Memory<P>, b: [S; 2], tau_common: T, now: &Now) -> Lines<S>
    where
        S: Scalar<P> + Add<T, Output = S>,
        T: Copy + Mul<P, Output = T>,
    {
        let mut q = three(|i| b[0] * self.j[i][0] + b[1] * self.j[i][1]);
        let mut m = self.elastic_moment(b, &q);
        for e in self.stages.of(Stage::Moment) {
            m = moment::apply(e, &mut memory.states, &self.constants, b, now, m, |m| self.loads(m));
        }
        let tau = self.loads(m);
        let tau = three(|i| tau[i] + tau_common);
        for e in self.stages.of(Stage::Geometry) {
            geometry::apply(e, &mut memory.states, self.constants.r_m, tau, now, &mut q);
            self.add_formula(e, memory, b, q, tau, now, |i, value| q[i] += value);
        }
        let mut load = three(|i| Limits { low: tau[i], high: tau[i] });
        for e in self.stages.of(Stage::Snake) {
            friction::apply_at_snake(e, &mut memory.states, b, q, now, &mut load);
            self.add_formula(e, memory, b, q, tau, now, |i, value| friction::add(&mut load[i], value));
        }
        let axial = tau_common * P::constant(self.constants.axial_m_per_n);
        let (seat, mut position) = self.stretch_holder(three(|i| q[i] + axial), &load);
        // Few effects look at the loads in the holder again.
        let holder = self.stages.has_any(Stage::Extension).then_some(load);
        for e in self.stages.of(Stage::Cone) {
            friction::apply_in_cone(e, now, &mut load);
        }
        for i in 0..3 {
            position[i].low += load[i].low * self.c_c[i];
            position[i].high += load[i].high * self.c_c[i];
        }
        for e in self.stages.of(Stage::Extension) {
            let lines = extension::Lines { q, tau, holder: holder.as_ref().unwrap_or(&load), actuator: &load };
            extension::apply(e, &mut memory.states, &self.constants, &lines, now, &mut position);
            self.add_formula(e, memory, b, q, tau, now, |i, value| friction::add(&mut position[i], value));
        }
        Lines { tau, load, seat, position }
    }

    /// What the encoders read at true actuator positions, m.
    #[inline]
    pub(crate) fn reading<S: Scalar<P>>(&self, memory: &mut Memory<P>, mut q_tilde: [S; 3], now: &Now) -> [S; 3] {
        for e in self.stages.of(Stage::Encoder) {
            for (i, own) in q_tilde.iter_mut().enumerate() {
                *own = self.encode(e, memory, i, *own, now);
            }
        }
        q_tilde
    }

    /// One encoder effect.
    pub(crate) fn encode<S: Scalar<P>>(&self, e: &Prepared<P>, memory: &mut Memory<P>, i: usize, x: S, now: &Now) -> S {
        match self.formula_of(e) {
            Some(formula) => {
                x + finite(memory, now, formula.evaluate(&formula_variables::encoder_values(x, i, now), &e.c))
            }
            None => encoder::reading(e, i, x),
        }
    }

    /// The shape as it is observed, without latency.
    pub(crate) fn observe<S: Scalar<P>>(&self, memory: &mut Memory<P>, mut b: [S; 2], now: &Now) -> [S; 2] {
        for e in self.stages.of(Stage::Shape) {
            b = match self.formula_of(e) {
                Some(formula) => seen_by_formula(formula, e, memory, b, now),
                None => shape::observe(e, b),
            };
        }
        b
    }

    /// The shape that is wanted where `b` is what shall be seen, through the effects that are in the snake.
    #[inline]
    pub(crate) fn unobserve<S: Scalar<P>>(&self, mut b: [S; 2]) -> [S; 2] {
        for e in self.stages.of(Stage::Shape).iter().rev() {
            if shape::is_in_snake(e.kind) {
                b = shape::unobserve(e, b);
            }
        }
        b
    }

    /// What a preload adds to every actuator's position, m.
    pub(crate) fn preload_m(&self) -> P {
        let c = &self.constants;
        self.preload * P::constant(c.c_d_m_per_n + c.c_c_m_per_n + c.axial_m_per_n)
    }

    /// d E / d bend, E = (E I b^2/2) (1/L + sum 1/L_i), L_i = L + q_i.
    #[inline(always)]
    fn elastic_moment<S: Scalar<P>>(&self, b: [S; 2], q: &[S; 3]) -> [S; 2] {
        let inverse = three(|i| (q[i] + P::constant(self.constants.l_m)).recip());
        let sum = inverse[0] + inverse[1] + inverse[2] + P::constant(1.0 / self.constants.l_m);
        let half_square = (b[0].square() + b[1].square()) * P::constant(-0.5);
        let squares = three(|i| inverse[i].square());
        let stiffness = P::constant(self.constants.bending_stiffness_nm2);
        let component = |k: usize| {
            let slope = squares[0] * self.j[0][k] + squares[1] * self.j[1][k] + squares[2] * self.j[2][k];
            (b[k] * sum + slope * half_square) * stiffness
        };
        [component(0), component(1)]
    }

    #[inline(always)]
    fn loads<S: Scalar<P>>(&self, m: [S; 2]) -> [S; 3] {
        three(|i| m[0] * self.divide[i][0] + m[1] * self.divide[i][1])
    }

    /// Where friction begins, and the ends of the lines in the holder at either limit; `base` is their beginning.
    #[inline(always)]
    fn stretch_holder<S: Scalar<P>>(&self, base: [S; 3], load: &[Limits<S>; 3]) -> ([S; 3], [Limits<S>; 3]) {
        let low = three(|i| base[i] + load[i].low * self.c_d[i]);
        // Without friction before the holder the two limits are one, and friction begins behind it.
        let (seat, high) =
            if self.friction_at_snake { (base, three(|i| base[i] + load[i].high * self.c_d[i])) } else { (low, low) };
        (seat, three(|i| Limits { low: low[i], high: high[i] }))
    }

    #[inline]
    fn formula_of(&self, e: &Prepared<P>) -> Option<&formula::Formula> {
        if e.kind == EffectKind::Formula { self.formulas.get(e.formula) } else { None }
    }

    #[expect(clippy::too_many_arguments, reason = "everything that a formula may name")]
    #[inline]
    fn add_formula<S: Scalar<P>>(
        &self,
        e: &Prepared<P>,
        memory: &mut Memory<P>,
        b: [S; 2],
        q: [S; 3],
        tau: [S; 3],
        now: &Now,
        mut add: impl FnMut(usize, S),
    ) {
        let Some(formula) = self.formula_of(e) else { return };
        for (i, tau) in tau.into_iter().enumerate() {
            let values = formula_variables::line_values(e, &mut memory.states, b, q, tau, i, now);
            let value = formula.evaluate(&values, &e.c);
            add(i, finite(memory, now, value));
        }
    }
}

fn seen_by_formula<P: Real, S: Scalar<P>>(
    formula: &formula::Formula,
    e: &Prepared<P>,
    memory: &mut Memory<P>,
    b: [S; 2],
    now: &Now,
) -> [S; 2] {
    let mut values = formula_variables::shape_values(b, now);
    [0, 1].map(|k| {
        formula_variables::set_axis(&mut values, [0.0, 1.0][k]);
        b[k] + finite(memory, now, formula.evaluate(&values, &e.c))
    })
}

/// A formula's value, zero where it is not finite, which is counted.
fn finite<P, S: Real>(memory: &mut Memory<P>, now: &Now, value: Option<S>) -> S {
    value.unwrap_or_else(|| {
        memory.n_formula_faults += u64::from(now.commit);
        S::constant(0.0)
    })
}

/// q_i = -r (b_x cos g_i - b_y sin g_i), g_i = (i-1) 120 deg.
fn nominal_jacobian<P: Real>(r_m: f64) -> [[P; 2]; 3] {
    let (c, s) = (0.5, 3.0_f64.sqrt() / 2.0);
    [[-1.0, 0.0], [c, s], [c, -s]].map(|row| row.map(|entry: f64| P::constant(entry * r_m)))
}

/// J (J^T J)^-1, 3x2.
fn pseudo_inverse_transposed<P: Real>(j: &[[P; 2]; 3]) -> Option<[[P; 2]; 3]> {
    let dot = |k: usize, l: usize| j[0][k] * j[0][l] + j[1][k] * j[1][l] + j[2][k] * j[2][l];
    let (a, b, d) = (dot(0, 0), dot(0, 1), dot(1, 1));
    let det = a * d - b * b;
    let usable = det.value() > 1e-3 * a.value() * d.value();
    usable.then(|| j.map(|row| [(row[0] * d - row[1] * b) / det, (row[1] * a - row[0] * b) / det]))
}
