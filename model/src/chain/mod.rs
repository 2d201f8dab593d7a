//! A chain: effects, in order, over the base model of elastic lines; inverse (shape to encoders) and forward (encoders to shape).
//!
//! **Base** (an empty list). A shape is a bend vector b and an internal load tau_m that all three lines share.
//! - q = J_q b, Eq. (1); m = dE/db, Eq. (9); tau = J_q (J_q^T J_q)^-1 m + tau_m (1,1,1), Eq. (11);
//! - q~ = q + (3 L/(E A)) tau_m + tau/K_d + tau/K_c, Eqs. (15)-(17) without friction, load scale 1, no play.
//!
//! **Where effects enter**, in the order of the inverse; within one place in the order of the list:
//! 1. *meas*: b from what shall be seen, b_m = f(b), for effects that are in the snake (twist, ...), last in the list first;
//! 2. *tau, moment*: m <- f(m, b) (load scale, softening, bending friction, tip forces);
//! 3. *geo*: J_q itself (radius, unequal lines: constant, so that tau follows by virtual work), then q <- f(q, tau), and the lines'
//!    extension inside the snake, which is there before any friction begins;
//! 4. *tau, line*: tau becomes an interval [T-, T+] of loads in the holder (disks), then [tau~-, tau~+] at the actuator (cone):
//!    what the line carries when it is about to be drawn back, and when it is about to be pushed. A frictionless line's is a point;
//! 5. *eps*: A+- = q + (3 L/(E A)) tau_m + T+-/K_d + tau~+-/K_c + eps(q, tau, T+-, tau~+-);
//! 6. *cmd*: p = (1+s)/2 A+ + (1-s)/2 A-, play q~ = p + h s', preload q~ - (1/K_d + 1/K_c + 3 L/(E A)) tau_0;
//! 7. *enc*: reading = f(q~): what the actuators are told, in the encoders' own terms.
//!
//! s and s' are signs of each line's motion, -1 to 1, with memory (below); tau_m = tau_0 is planned, 0 without the effect `preload`.
//!
//! **Forward** goes the other way: enc inverted, preload added, play on q~ gives p, and then the equilibrium: (b, tau_m) such that for
//! each line  clamp(x - x', A- - p, A+ - p) = 0, with x the line's position where friction begins (q + (3 L/(E A)) tau_m, and
//! tau/K_d where no disk rubs) and x' that of the step before: a line that slides up has A+ = p, one that slides back A- = p,
//! and one that sticks has x = x'. Three equations, three unknowns, Newton's method with steps halved. The internal load is solved
//! with the bend because friction depends on it; without friction it is what the mean of q~ says. The load at the actuator is tau~+
//! of a line that slides up and tau~- of one that slides back; of one that sticks it is as far between them as p is between A- and A+.
//!
//! **Memory.** Every hysteretic effect but play and friction is driven by the shape (q, tau, b), so that planning and solving
//! evaluate the same function and the inverse is exact at every step. Play and friction decide by the direction of motion:
//! their inverse is exact once a line has travelled `transition_m` in its new direction, continuous in between, and a line
//! lags by less than that travel while its sign turns. s is the direction of x, where friction begins, and s' that of
//! p, behind the play; both are stop operators, with the transition measured in travel of q at the straight pose:
//! nothing depends on time or sampling, and a line at rest does not chatter.

mod circumstances;
mod delay;
mod elastic;
mod equations;
mod forward;
mod inverse;
mod learn;
mod lines;
mod model;
mod plausible;
mod settings;
mod stages;
mod tangents;

pub use circumstances::{ChainStatus, Circumstances};
pub(crate) use delay::DelayLine;
pub use forward::{Prediction, Predictor};
pub use inverse::{ChainCommand, ChainCompensator, ChainMemory};
pub(crate) use learn::learnt;
pub use learn::{Learn, LearntParameter, MAX_LEARNT};
pub use plausible::Implausible;
pub use settings::{ChainError, ChainSettings, EffectSetting, KnownColumns};
pub use tangents::{CommandTangents, PredictionTangents, PredictorTangents};

use crate::effects::formula::Formula;
use crate::effects::prepared::Constants;
use crate::effects::{Dual, EffectKind, Inverse, Needs, Real};
use crate::gripper::Gripper;
use crate::hash::{self, ModelHash};
use crate::parameters::in_range;
use crate::{MachineParameters, Snake};
use core::f64::consts::PI;
use model::ChainModel;
use nalgebra::Vector2;
use std::sync::Arc;

/// A checked chain. Building allocates; nothing that it builds does so in its steps.
#[derive(Clone, Debug)]
pub struct Chain {
    machine: MachineParameters,
    effects: Vec<EffectSetting>,
    learnt: Vec<LearntParameter>,
    formulas: Arc<Vec<Formula>>,
    model: ChainModel<f64>,
    settings: ChainSettings,
    /// No shape beyond this bend is planned, rad.
    max_bend_rad: f64,
    floor_rad: Option<f64>,
    gripper: Option<Arc<Gripper>>,
}

impl Chain {
    /// Checks and builds a chain.
    ///
    /// `columns` says what will be given at every step besides the encoders or the setpoint.
    ///
    /// # Errors
    /// [`ChainError`], one sentence, naming the effect and the parameter.
    pub fn new(
        machine: &MachineParameters,
        settings: ChainSettings,
        effects: &[EffectSetting],
        columns: KnownColumns,
    ) -> Result<Self, ChainError> {
        let snake = Snake::new(machine)?;
        in_range("strain_limit", settings.strain_limit, 0.001, 0.08, "(no unit)")?;
        in_range("transition_m", settings.transition_m, 1e-9, 1e-3, "m")?;
        check_repeats(effects)?;
        let formulas: Vec<Formula> =
            effects.iter().filter_map(EffectSetting::formula_text).map(Formula::new).collect::<Result<_, _>>()?;
        check_columns(effects, &formulas, columns)?;
        let formulas = Arc::new(formulas);
        let constants = constants(machine, &snake);
        let value = |k: usize, j: usize| value_of(effects, k, j);
        let model = ChainModel::new(constants, effects, Arc::clone(&formulas), value)?;
        let max_bend_rad = max_bend_rad(&model, settings.strain_limit);
        let learnt = learn::learnt(effects)?;
        let (machine, effects, floor_rad, gripper) = (*machine, effects.to_vec(), None, None);
        Ok(Self { machine, effects, learnt, formulas, model, settings, max_bend_rad, floor_rad, gripper })
    }

    /// The inverse: turns setpoints into actuator positions. Starts at rest at the straight pose.
    ///
    /// # Errors
    /// [`ChainError::NoInverse`] for the first effect that no command undoes.
    pub fn compensator(&self) -> Result<ChainCompensator, ChainError> {
        for effect in &self.effects {
            if let Inverse::None(reason) = effect.inverse() {
                return Err(ChainError::NoInverse { name: effect.kind().name(), reason });
            }
        }
        Ok(ChainCompensator::new(self))
    }

    /// The forward model: turns the encoders' history into shapes. Starts at rest at the straight pose.
    pub fn predictor(&self) -> Predictor {
        Predictor::new(self)
    }

    /// The forward model with derivatives of every prediction with respect to K parameters (effect's place, parameter's name).
    ///
    /// # Errors
    /// [`ChainError::UnknownParameter`] for an effect's place or a parameter that is not there.
    pub fn predictor_with_tangents<const K: usize>(
        &self,
        parameters: &[(usize, &str); K],
    ) -> Result<PredictorTangents<K>, ChainError> {
        let places = self.places(parameters)?;
        Ok(PredictorTangents::new(self, self.model_with_tangents(&places)?, places))
    }

    /// The inverse with derivatives of the command with respect to K parameters, at the signs of motion of the inverse itself.
    ///
    /// # Errors
    /// As [`Chain::compensator`] and [`Chain::predictor_with_tangents`].
    pub fn compensator_with_tangents<const K: usize>(
        &self,
        parameters: &[(usize, &str); K],
    ) -> Result<CommandTangents<K>, ChainError> {
        let plain = self.compensator()?;
        Ok(CommandTangents::new(plain, self.model_with_tangents(&self.places(parameters)?)?))
    }

    /// The forward model with derivatives by the parameters that it learns, in their order; the lanes behind them are zero.
    ///
    /// # Errors
    /// None that building the chain would not have met.
    pub fn learning_predictor(&self) -> Result<PredictorTangents<MAX_LEARNT>, ChainError> {
        let mut places = [NOWHERE; MAX_LEARNT];
        for (place, learnt) in places.iter_mut().zip(&self.learnt) {
            *place = (learnt.effect, learnt.parameter);
        }
        Ok(PredictorTangents::new(self, self.model_with_tangents(&places)?, places))
    }

    /// The parameters that are learnt while the machine moves, in the order of the effects.
    pub fn learnt(&self) -> &[LearntParameter] {
        &self.learnt
    }

    /// The machine.
    pub fn machine(&self) -> &MachineParameters {
        &self.machine
    }

    /// The same chain with the error that its model file states as the measurement's own, rad; the hash stays.
    pub fn with_floor(self, floor_rad: Option<f64>) -> Self {
        Self { floor_rad, ..self }
    }

    /// What of its error is the measurement's own, as the model file states it, rad.
    pub fn floor_rad(&self) -> Option<f64> {
        self.floor_rad
    }

    /// The same chain with a gripper at its end, or none.
    pub fn with_gripper(self, gripper: Option<Gripper>) -> Self {
        Self { gripper: gripper.map(Arc::new), ..self }
    }

    /// The gripper at its end, if there is one.
    pub fn gripper(&self) -> Option<&Gripper> {
        self.gripper.as_deref()
    }

    /// Which model it is.
    pub fn hash(&self) -> ModelHash {
        hash::of_snake(&self.machine, self.settings, &self.effects, self.gripper())
    }

    /// The effects, in order.
    pub fn effects(&self) -> &[EffectSetting] {
        &self.effects
    }

    /// The settings that are no physics.
    pub fn settings(&self) -> ChainSettings {
        self.settings
    }

    /// The largest bend that is planned, rad: where the outer fibre reaches its strain limit, and never beyond pi.
    pub fn max_bend_rad(&self) -> f64 {
        self.max_bend_rad
    }

    /// Strain of the outer fibre of a backbone at a bend, 1: (d_outer/2) b / L.
    pub fn outer_strain(&self, bend_rad: Vector2<f64>) -> f64 {
        outer_strain(&self.model.constants, bend_rad.norm())
    }

    fn model_with_tangents<const K: usize>(&self, places: &[Place; K]) -> Result<ChainModel<Dual<K>>, ChainError> {
        let value = |k: usize, j: usize| {
            let value = value_of(&self.effects, k, j);
            match places.iter().position(|&place| place == (k, j)) {
                Some(lane) => Dual::seed(value, lane),
                None => Dual::constant(value),
            }
        };
        ChainModel::new(self.model.constants, &self.effects, Arc::clone(&self.formulas), value)
    }

    fn places<const K: usize>(&self, parameters: &[(usize, &str); K]) -> Result<[Place; K], ChainError> {
        let mut places = [NOWHERE; K];
        for (place, &(k, name)) in places.iter_mut().zip(parameters) {
            let effect = self.effects.get(k).ok_or_else(|| ChainError::UnknownParameter {
                effect: format!("number {}", k + 1),
                name: name.to_owned(),
                nearest: format!("one of the chain's {} effects", self.effects.len()),
            })?;
            *place = (k, effect.index(name).ok_or_else(|| effect.unknown(name))?);
        }
        Ok(places)
    }
}

/// Where a parameter is: place of the effect in the chain, place in the effect.
type Place = (usize, usize);
/// Of a lane without a parameter.
const NOWHERE: Place = (usize::MAX, 0);

fn value_of(effects: &[EffectSetting], k: usize, j: usize) -> f64 {
    effects[k].values()[j]
}

fn constants(machine: &MachineParameters, snake: &Snake) -> Constants {
    Constants {
        l_m: snake.l_m,
        r_m: snake.r_m,
        bending_stiffness_nm2: snake.bending_stiffness_nm2,
        c_d_m_per_n: snake.c_d_m_per_n,
        c_c_m_per_n: snake.c_c_m_per_n,
        axial_m_per_n: snake.axial_m_per_n,
        l_d_m: machine.l_d_m,
        phi_rad: machine.phi_rad,
        d_outer_m: machine.d_outer_m,
    }
}

fn outer_strain(constants: &Constants, bend_rad: f64) -> f64 {
    0.5 * constants.d_outer_m * bend_rad / constants.l_m
}

/// Strain, half a turn, and no backbone shorter than a tenth of its length, whichever comes first.
fn max_bend_rad(model: &ChainModel<f64>, strain_limit: f64) -> f64 {
    let longest = model.backbones.j.iter().map(|row| row[0].hypot(row[1])).fold(0.0, f64::max);
    (strain_limit / outer_strain(&model.constants, 1.0)).min(0.999 * PI).min(0.9 * model.constants.l_m / longest)
}

/// Every effect is a snake's, none stands there twice that may not, and none beside another law of the same thing.
fn check_repeats(effects: &[EffectSetting]) -> Result<(), ChainError> {
    for (second, effect) in effects.iter().enumerate() {
        if matches!(effect.kind(), EffectKind::Joint(_) | EffectKind::Force(_) | EffectKind::OfSegment(_)) {
            return Err(ChainError::OtherMachine { name: effect.kind().name(), expected: "snake" });
        }
        // Two formulas of one name could not be told apart in a report.
        let same = |other: &EffectSetting| {
            other.label() == effect.label()
                && (!effect.kind().definition().repeatable || effect.kind() == EffectKind::Formula)
        };
        if let Some(first) = effects.iter().take(second).position(same) {
            return Err(ChainError::Twice { name: effect.label().to_owned(), first: first + 1, second: second + 1 });
        }
        let other_law = |other: &EffectSetting| effect.kind().excludes() == Some(other.kind());
        if let Some(first) = effects.iter().take(second).position(other_law) {
            let [first_name, second_name] = [effects[first].kind(), effect.kind()].map(EffectKind::name);
            return Err(ChainError::TwoLaws { first_name, second_name, first: first + 1, second: second + 1 });
        }
    }
    Ok(())
}

fn check_columns(effects: &[EffectSetting], formulas: &[Formula], columns: KnownColumns) -> Result<(), ChainError> {
    let mut formulas = formulas.iter();
    for effect in effects {
        let formula = if effect.kind() == EffectKind::Formula { formulas.next() } else { None };
        let needs = effect.kind().definition().needs;
        let wanted = [
            (needs == Needs::Time || formula.is_some_and(Formula::uses_time), columns.time, "time_s"),
            (
                needs == Needs::StemAngle || formula.is_some_and(Formula::uses_stem_angle),
                columns.stem_angle,
                "stem_angle_rad",
            ),
            (formula.is_some_and(Formula::uses_temperature), columns.temperature, "temperature_c"),
        ];
        if let Some((_, _, column)) = wanted.into_iter().find(|&(needed, given, _)| needed && !given) {
            return Err(ChainError::MissingColumn { name: effect.label().to_owned(), column: column.to_owned() });
        }
    }
    Ok(())
}
