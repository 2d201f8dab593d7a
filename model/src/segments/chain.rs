//! A model of segments, checked: the machine with those of the snake's effects that it can have.

use super::friction::Friction;
use super::sharing::LoadSharing;
use super::{LineValues, SegmentCompensator, SegmentPredictor, Segments, SegmentsError, SegmentsParameters};
use crate::effects::EffectKind;
use crate::{ChainError, EffectSetting};

/// The effects that segments can have.
pub const SEGMENT_EFFECTS: [EffectKind; 5] = [
    EffectKind::StiffnessScale,
    EffectKind::InsideExtension,
    EffectKind::StaticFriction,
    EffectKind::ConeFriction,
    EffectKind::Backlash,
];

/// Segments with their effects.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentChain {
    pub(super) machine: Segments,
    pub(super) sharing: LoadSharing,
    pub(super) transition_m: f64,
    /// eta on the elastic load of every segment.
    pub(super) eta: f64,
    /// Share of its load that a line carries inside the snake.
    pub(super) inside: f64,
    pub(super) friction: Friction,
    pub(super) half_width_m: f64,
}

impl SegmentChain {
    /// Checks machine and effects.
    ///
    /// # Errors
    /// [`ChainError`] for a machine that is none, an effect that segments cannot have or have already, and a parameter that shall be
    /// learnt.
    pub fn new(parameters: &SegmentsParameters, effects: &[EffectSetting]) -> Result<Self, ChainError> {
        let machine = Segments::new(parameters)?;
        let value = |kind: EffectKind, key, without| {
            let own = effects.iter().find(|effect| effect.kind() == kind);
            own.and_then(|effect| effect.value(key)).unwrap_or(without)
        };
        for (second, effect) in effects.iter().enumerate() {
            let name = effect.kind().name();
            if !SEGMENT_EFFECTS.contains(&effect.kind()) {
                return Err(ChainError::OtherMachine { name, expected: "segments" });
            }
            if let Some(first) = effects[..second].iter().position(|before| before.kind() == effect.kind()) {
                return Err(ChainError::Twice { name: name.to_owned(), first: first + 1, second: second + 1 });
            }
            if let Some(key) = effect.parameter_names().find(|key| effect.learn(key).is_some()) {
                let (effect, key, reason) = (name.to_owned(), key.to_owned(), "a value of segments");
                return Err(ChainError::NotLearnt { effect, key, reason });
            }
        }
        let place = |kind| effects.iter().position(|effect| effect.kind() == kind);
        if place(EffectKind::ConeFriction) < place(EffectKind::StaticFriction)
            && place(EffectKind::ConeFriction).is_some()
        {
            return Err(SegmentsError::ConeFirst.into());
        }
        let mu = value(EffectKind::ConeFriction, "mu", 0.0);
        Ok(Self {
            sharing: LoadSharing {
                low_n: LineValues::repeat(parameters.low_n),
                high_n: LineValues::repeat(parameters.high_n),
                preload_n: parameters.preload_n,
            },
            transition_m: parameters.settings.transition_m,
            eta: value(EffectKind::StiffnessScale, "eta", 1.0),
            inside: value(EffectKind::InsideExtension, "share", 0.0),
            friction: Friction {
                f_s_n: value(EffectKind::StaticFriction, "f_s_n", 0.0),
                capstan: (2.0 * mu * machine.phi_rad).exp(),
            },
            half_width_m: value(EffectKind::Backlash, "half_width_m", 0.0),
            machine,
        })
    }

    /// The segments themselves.
    pub fn machine(&self) -> &Segments {
        &self.machine
    }

    /// How the lines share their loads.
    pub fn sharing(&self) -> &LoadSharing {
        &self.sharing
    }

    /// The factor eta on the elastic load.
    pub fn eta(&self) -> f64 {
        self.eta
    }

    /// A compensator that begins straight and at rest.
    pub fn compensator(&self) -> SegmentCompensator {
        SegmentCompensator::new(self)
    }

    /// A predictor that begins straight, with every actuator at zero and in the middle of its play.
    pub fn predictor(&self) -> SegmentPredictor {
        SegmentPredictor::new(self)
    }
}
