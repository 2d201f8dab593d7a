//! A chain's constants, and the effects between actuators and encoders and between the arc and what is seen of it.
//!
//! Immutable after it is built; memory is passed in. One code for values, shape derivatives and parameter derivatives.

use super::elastic::Backbones;
use super::settings::{ChainError, EffectSetting};
use super::stages::{Stage, Stages};
use crate::effects::cone::{self, Rub};
use crate::effects::prepared::{Constants, Now, Prepared};
use crate::effects::{EffectKind, Real, Scalar, encoder, formula, formula_variables, geometry, shape};
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

/// A chain's constants.
#[derive(Clone, Debug)]
pub(crate) struct ChainModel<P> {
    pub constants: Constants,
    pub stages: Stages<P>,
    /// Whether steps with `FULL` false are enough: no effect acts anywhere but in the cone.
    pub short: bool,
    formulas: Arc<Vec<formula::Formula>>,
    pub backbones: Backbones<P>,
    /// Pseudo-inverse of J_q, transposed: loads for a moment.
    pub divide: [[P; 2]; 3],
    /// Compliances of each line in the holder and in the cone, m/N.
    pub c_d: [P; 3],
    pub c_c: [P; 3],
    pub friction_at_snake: bool,
    /// Friction behind the holder.
    pub cone: Vec<Rub<P>>,
    /// Half-width of the play, m.
    pub half_width: P,
    /// Internal load at encoder zero, N.
    pub preload: P,
    /// What that adds to every actuator's position, m.
    pub preload_m: P,
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
        let mut stages = Stages::new(effects, &formulas, &constants, &parameter)?;
        let stiffness_nm2 = stages.take_scale() * P::constant(constants.bending_stiffness_nm2);
        let first = |kind| effects.iter().position(|e| e.kind() == kind).map(|k| parameter(k, 0));
        let zero = P::constant(0.0);
        let preload = first(EffectKind::Preload).unwrap_or(zero);
        let mut j = nominal_jacobian(constants.r_m);
        let mut compliance = [P::constant(1.0); 3];
        for (k, effect) in effects.iter().enumerate() {
            let c: [P; crate::effects::MAX_PARAMETERS] = core::array::from_fn(|n| parameter(k, n));
            geometry::shape_jacobian(effect.kind(), &c, &mut j, &mut compliance);
        }
        Ok(Self {
            divide: pseudo_inverse_transposed(&j).ok_or(ChainError::Geometry)?,
            // Load scales that come first are part of the stiffness.
            backbones: Backbones::new(j, constants.l_m, stiffness_nm2),
            c_d: compliance.map(|c| c * P::constant(constants.c_d_m_per_n)),
            c_c: compliance.map(|c| c * P::constant(constants.c_c_m_per_n)),
            friction_at_snake: effects.iter().any(|e| e.kind() == EffectKind::DiskFriction),
            half_width: first(EffectKind::Backlash).unwrap_or(zero),
            preload,
            preload_m: preload * P::constant(constants.c_d_m_per_n + constants.c_c_m_per_n + constants.axial_m_per_n),
            stall: first(EffectKind::Saturation),
            delay: first(EffectKind::Latency),
            constants,
            short: stages.is_short(),
            cone: cone::program(stages.of(Stage::Cone)),
            stages,
            formulas,
        })
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

    #[inline]
    fn formula_of(&self, e: &Prepared<P>) -> Option<&formula::Formula> {
        if e.kind == EffectKind::Formula { self.formulas.get(e.formula) } else { None }
    }

    #[expect(clippy::too_many_arguments, reason = "everything that a formula may name")]
    #[inline]
    pub(super) fn add_formula<S: Scalar<P>>(
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
