//! The effects of a chain, sorted by where they act, in the order of the model file within each place.

use super::settings::{ChainError, EffectSetting};
use crate::effects::formula::Formula;
use crate::effects::prepared::{Constants, Prepared};
use crate::effects::{EffectKind, Hook, MAX_PARAMETERS, Real};

/// The most effects in a chain.
pub(crate) const MAX_EFFECTS: usize = 16;
/// Stem coupling acts in two places.
const MAX_ENTRIES: usize = MAX_EFFECTS + 1;

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
            Self::Geometry => kind == K::HoleClearance || formula == Some(Hook::Geo),
            Self::Snake => match kind {
                K::DiskFriction | K::ViscousFriction | K::StribeckFriction => true,
                _ => formula == Some(Hook::Tau),
            },
            Self::Cone => matches!(kind, K::ConeFriction | K::StaticFriction | K::StemCoupling),
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
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stages<P> {
    entries: [Prepared<P>; MAX_ENTRIES],
    /// Where each stage begins, and where the last one ends.
    bounds: [usize; Stage::ALL.len() + 1],
    /// A bit for each stage that has effects: most have none, and one look at it is all that they cost.
    present: u32,
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
        let zero = [P::constant(0.0); MAX_PARAMETERS];
        let mut entries = [Prepared { kind: EffectKind::Formula, c: zero, state: 0, formula: 0 }; MAX_ENTRIES];
        let mut bounds = [0; Stage::ALL.len() + 1];
        let mut n = 0;
        let mut prepared = [entries[0]; MAX_EFFECTS];
        let (mut n_states, mut n_formulas) = (0, 0);
        for (k, (effect, own)) in effects.iter().zip(&mut prepared).enumerate() {
            let values = core::array::from_fn(|j| parameter(k, j));
            *own = Prepared::new(effect.kind(), &values, constants, n_states, n_formulas);
            n_states += effect.kind().definition().n_states;
            n_formulas += usize::from(effect.kind() == EffectKind::Formula);
        }
        for (s, stage) in Stage::ALL.into_iter().enumerate() {
            bounds[s] = n;
            for own in prepared.iter().take(effects.len()) {
                let hook =
                    (own.kind == EffectKind::Formula).then(|| formulas.get(own.formula).map(|f| f.hook)).flatten();
                if stage.has(own.kind, hook) {
                    entries[n] = *own;
                    n += 1;
                }
            }
        }
        bounds[Stage::ALL.len()] = n;
        let present = (0..Stage::ALL.len()).filter(|&s| bounds[s + 1] > bounds[s]).map(|s| 1 << s).sum();
        Ok(Self { entries, bounds, present })
    }

    /// Whether a stage has effects.
    #[inline(always)]
    pub(crate) fn has_any(&self, stage: Stage) -> bool {
        self.present & (1 << stage as usize) != 0
    }

    /// The effects of one stage.
    #[inline(always)]
    pub(crate) fn of(&self, stage: Stage) -> &[Prepared<P>] {
        if !self.has_any(stage) {
            return &[];
        }
        let s = stage as usize;
        self.entries.get(self.bounds[s]..self.bounds[s + 1]).unwrap_or_default()
    }
}
