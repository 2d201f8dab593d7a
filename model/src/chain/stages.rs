//! The effects of a chain, sorted by where they act, in the order of the model file within each place.

use super::settings::{ChainError, EffectSetting};
use crate::effects::formula::Formula;
use crate::effects::prepared::{Constants, Prepared};
use crate::effects::{EffectKind, Hook, MAX_PARAMETERS, Real};

/// The most effects in a chain.
pub(crate) const MAX_EFFECTS: usize = 16;

/// Where an effect acts, in the order of the inverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Shape,
    Moment,
    Geometry,
    Snake,
    Cone,
    Extension,
    Encoder,
}

impl Stage {
    const ALL: [Self; 7] =
        [Self::Shape, Self::Moment, Self::Geometry, Self::Snake, Self::Cone, Self::Extension, Self::Encoder];

    fn has(self, kind: EffectKind, formula: Option<Hook>) -> bool {
        use EffectKind as K;
        match self {
            Self::Shape => match kind {
                K::CameraScale | K::CameraOffset | K::PlaneOffset | K::Twist | K::NonConstantCurvature => true,
                _ => formula == Some(Hook::Meas),
            },
            Self::Moment => matches!(
                kind,
                K::StiffnessScale | K::SuperelasticSoftening | K::BendFriction | K::AxialTipForce | K::LateralTipForce
            ),
            Self::Geometry => match kind {
                K::HoleClearance | K::InsideExtension => true,
                _ => formula == Some(Hook::Geo),
            },
            Self::Snake => match kind {
                K::DiskFriction | K::ViscousFriction | K::StribeckFriction => true,
                _ => formula == Some(Hook::Tau),
            },
            Self::Cone => matches!(kind, K::ConeFriction | K::DistributedCapstan | K::StaticFriction | K::StemCoupling),
            Self::Extension => match kind {
                K::ActuatorCompliance
                | K::BoucWen
                | K::PrandtlIshlinskii
                | K::TensionCompressionAsymmetry
                | K::LineBuckling
                | K::Creep
                | K::ThermalDrift
                | K::CrossCoupling
                | K::StemCoupling => true,
                _ => formula == Some(Hook::Eps),
            },
            Self::Encoder => match kind {
                K::EncoderZero | K::EncoderScale | K::LeadScrewError => true,
                _ => formula == Some(Hook::Enc),
            },
        }
    }
}

/// The effects, by stage.
#[derive(Clone, Debug)]
pub(crate) struct Stages<P> {
    by_stage: [Vec<Prepared<P>>; Stage::ALL.len()],
    /// Places of the load scales that come before all other effects on the moment.
    leading_scales: Vec<usize>,
}

impl<P: Real> Stages<P> {
    /// Sorts the effects; `parameter` gives the value of a parameter by effect and place.
    pub(crate) fn new(
        effects: &[EffectSetting],
        formulas: &[Formula],
        constants: &Constants,
        parameter: &impl Fn(usize, usize) -> P,
    ) -> Result<Self, ChainError> {
        if effects.len() > MAX_EFFECTS {
            return Err(ChainError::TooMany { found: effects.len(), limit: MAX_EFFECTS });
        }
        let mut by_stage = Stage::ALL.map(|_| Vec::new());
        let (mut n_states, mut n_formulas) = (0, 0);
        for (k, effect) in effects.iter().enumerate() {
            let values = core::array::from_fn(|j| parameter(k, j));
            let prepared = Prepared::new(effect.kind(), k, &values, constants, n_states, n_formulas);
            let is_formula = effect.kind() == EffectKind::Formula;
            let hook = is_formula.then(|| formulas.get(n_formulas).map(|formula| formula.hook)).flatten();
            for (own, stage) in by_stage.iter_mut().zip(Stage::ALL) {
                // Stem coupling acts in two places.
                if stage.has(effect.kind(), hook) {
                    own.push(prepared);
                }
            }
            n_states += effect.kind().definition().n_states;
            n_formulas += usize::from(is_formula);
        }
        let moment = &mut by_stage[Stage::Moment as usize];
        let n = moment.iter().take_while(|e| e.kind == EffectKind::StiffnessScale).count();
        let leading_scales = moment.drain(..n).map(|e| e.effect).collect();
        Ok(Self { by_stage, leading_scales })
    }

    /// Whether no effect acts anywhere but in the cone, at one place of it.
    pub(crate) fn is_short(&self) -> bool {
        let only_cone =
            Stage::ALL.into_iter().all(|stage| stage == Stage::Cone || self.by_stage[stage as usize].is_empty());
        only_cone && !self.is_spread()
    }

    /// Whether friction is spread along the cone.
    pub(crate) fn is_spread(&self) -> bool {
        self.of(Stage::Cone).iter().any(|e| e.kind == EffectKind::DistributedCapstan)
    }

    /// Whether a stage has effects.
    #[inline(always)]
    pub(crate) fn has_any(&self, stage: Stage) -> bool {
        !self.of(stage).is_empty()
    }

    /// The effects of one stage.
    #[inline(always)]
    pub(crate) fn of(&self, stage: Stage) -> &[Prepared<P>] {
        &self.by_stage[stage as usize]
    }

    /// Places of the load scales that come before all other effects on the moment: they are part of the stiffness.
    pub(crate) fn leading_scales(&self) -> &[usize] {
        &self.leading_scales
    }

    /// Takes over other parameters of the effect at a place.
    pub(crate) fn set(&mut self, effect: usize, c: [P; MAX_PARAMETERS]) {
        for own in self.by_stage.iter_mut().flatten().filter(|own| own.effect == effect) {
            own.c = c;
        }
    }
}
