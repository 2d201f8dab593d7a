//! A chain's constants, and the effects between actuators and encoders and between the arc and what is seen of it.
//!
//! Only its parameters can be set after it is built, in place; memory is passed in. One code for values, shape derivatives and parameter derivatives.

use super::elastic::Backbones;
use super::settings::{ChainError, EffectSetting};
use super::stages::{Stage, Stages};
use crate::effects::cone::{self, Rub};
use crate::effects::prepared::{Constants, Now, Prepared};
use crate::effects::{EffectKind, MAX_PARAMETERS, Real, Scalar, encoder, formula, formula_variables, geometry, shape};
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

type Raw<P> = (EffectKind, [P; MAX_PARAMETERS]);

/// A chain's constants.
#[derive(Clone, Debug)]
pub(crate) struct ChainModel<P> {
    pub constants: Constants,
    pub stages: Stages<P>,
    /// Each effect with its parameters as they were set.
    raw: Vec<Raw<P>>,
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
    /// Whether friction is spread along the cone: what it gives follows the mean load along it.
    pub is_spread: bool,
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
        let stages = Stages::new(effects, &formulas, &constants, &parameter)?;
        let raw: Vec<_> =
            effects.iter().enumerate().map(|(k, e)| (e.kind(), core::array::from_fn(|n| parameter(k, n)))).collect();
        let zero = P::constant(0.0);
        let first = |kind| first_of(&raw, kind);
        let geometry = Geometry::of(&raw, &constants).ok_or(ChainError::Geometry)?;
        Ok(Self {
            backbones: Backbones::new(geometry.j, constants.l_m, stiffness(&stages, &raw, &constants)),
            divide: geometry.divide,
            c_d: geometry.c_d,
            c_c: geometry.c_c,
            friction_at_snake: effects.iter().any(|e| e.kind() == EffectKind::DiskFriction),
            half_width: first(EffectKind::Backlash).unwrap_or(zero),
            preload: first(EffectKind::Preload).unwrap_or(zero),
            preload_m: preload_m(first(EffectKind::Preload).unwrap_or(zero), &constants),
            stall: first(EffectKind::Saturation),
            delay: first(EffectKind::Latency),
            constants,
            short: stages.is_short(),
            is_spread: stages.is_spread(),
            cone: cone::program(stages.of(Stage::Cone)),
            stages,
            formulas,
            raw,
        })
    }

    /// Sets a parameter (place of the effect, place in the effect) and everything that follows from it. Allocates nothing.
    ///
    /// Values that would leave no lines to bend the snake with, which none within bounds does, change nothing.
    pub(crate) fn set(&mut self, (k, j): (usize, usize), value: P) {
        let Some((kind, own)) = self.raw.get_mut(k) else { return };
        let (kind, before) = (*kind, own[j]);
        own[j] = value;
        let values = *own;
        match kind {
            EffectKind::RadiusError | EffectKind::UnequalLines => {
                let Some(geometry) = Geometry::of(&self.raw, &self.constants) else {
                    self.raw[k].1[j] = before;
                    return;
                };
                (self.divide, self.c_d, self.c_c) = (geometry.divide, geometry.c_d, geometry.c_c);
                let stiffness_nm2 = stiffness(&self.stages, &self.raw, &self.constants);
                self.backbones = Backbones::new(geometry.j, self.constants.l_m, stiffness_nm2);
            }
            EffectKind::Backlash => self.half_width = value,
            EffectKind::Preload => (self.preload, self.preload_m) = (value, preload_m(value, &self.constants)),
            EffectKind::Saturation => self.stall = Some(value),
            EffectKind::Latency => self.delay = Some(value),
            EffectKind::StiffnessScale if self.stages.leading_scales().contains(&k) => {
                let stiffness_nm2 = stiffness(&self.stages, &self.raw, &self.constants);
                self.backbones = Backbones::new(self.backbones.j, self.constants.l_m, stiffness_nm2);
            }
            _ => {
                self.stages.set(k, Prepared::constants(kind, &values, &self.constants));
                if self.stages.of(Stage::Cone).iter().any(|e| e.kind == kind) {
                    cone::write_program(self.stages.of(Stage::Cone), &mut self.cone);
                }
            }
        }
    }

    /// A parameter (place of the effect, place in the effect) as it was set last.
    pub(crate) fn get(&self, (k, j): (usize, usize)) -> Option<P> {
        self.raw.get(k).map(|(_, values)| values[j])
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

/// First parameter of the first effect of a kind.
fn first_of<P: Real>(raw: &[Raw<P>], kind: EffectKind) -> Option<P> {
    raw.iter().find(|(own, _)| *own == kind).map(|(_, values)| values[0])
}

fn preload_m<P: Real>(preload: P, constants: &Constants) -> P {
    preload * P::constant(constants.c_d_m_per_n + constants.c_c_m_per_n + constants.axial_m_per_n)
}

/// E I times the load scales that come first.
fn stiffness<P: Real>(stages: &Stages<P>, raw: &[Raw<P>], constants: &Constants) -> P {
    let scale = |product: P, &k: &usize| product * raw[k].1[0];
    stages.leading_scales().iter().fold(P::constant(1.0), scale) * P::constant(constants.bending_stiffness_nm2)
}

/// What the effects on the geometry make of the lines.
struct Geometry<P> {
    j: [[P; 2]; 3],
    divide: [[P; 2]; 3],
    c_d: [P; 3],
    c_c: [P; 3],
}

impl<P: Real> Geometry<P> {
    fn of(raw: &[Raw<P>], constants: &Constants) -> Option<Self> {
        let mut j = nominal_jacobian(constants.r_m);
        let mut compliance = [P::constant(1.0); 3];
        for (kind, values) in raw {
            geometry::shape_jacobian(*kind, values, &mut j, &mut compliance);
        }
        Some(Self {
            divide: pseudo_inverse_transposed(&j)?,
            j,
            c_d: compliance.map(|c| c * P::constant(constants.c_d_m_per_n)),
            c_c: compliance.map(|c| c * P::constant(constants.c_c_m_per_n)),
        })
    }
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
