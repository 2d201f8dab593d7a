//! What single segments have beside the effects of all: a factor on eta, friction and play of their lines, and how the camera sees them.

use super::chain::capstan;
use super::friction::Friction;
use super::{Bends, MAX_SEGMENTS, Segments};
use crate::effects::{EffectKind, SegmentEffect, SegmentLaw};
use crate::{ChainError, EffectSetting};

/// Neutral where a segment has no effect of its own.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OfSegments {
    /// Factor on eta, for both components of a segment's bend vector.
    pub eta: Bends,
    /// Added to f_s, N, and a factor on g.
    pub friction: [Friction; MAX_SEGMENTS],
    /// Added to half the play, m.
    pub half_width_m: [f64; MAX_SEGMENTS],
    /// Factor on what the camera shows of each component.
    pub seen_scale: Bends,
    /// Added to it, rad.
    seen_offset_rad: Bends,
}

impl OfSegments {
    /// # Errors
    /// [`ChainError::OfNoSegment`] for an effect of a segment that is not there.
    pub(super) fn new(effects: &[EffectSetting], machine: &Segments) -> Result<Self, ChainError> {
        let mut own = Self {
            eta: Bends::repeat(1.0),
            friction: [Friction::new(0.0, 1.0); MAX_SEGMENTS],
            half_width_m: [0.0; MAX_SEGMENTS],
            seen_scale: Bends::repeat(1.0),
            seen_offset_rad: Bends::zeros(),
        };
        for effect in effects {
            let EffectKind::OfSegment(SegmentEffect { law, segment }) = effect.kind() else { continue };
            if segment >= machine.n() {
                let (name, n) = (effect.kind().name(), machine.n());
                return Err(ChainError::OfNoSegment { name, segment: segment + 1, n });
            }
            // Its parameters, in the order of the definition.
            let [first, second, ..] = *effect.values();
            let both = 2 * segment..2 * segment + 2;
            match law {
                SegmentLaw::StiffnessScale => both.for_each(|k| own.eta[k] = first),
                SegmentLaw::StaticFriction => own.friction[segment].f_s_n = first,
                SegmentLaw::ConeFriction => {
                    own.friction[segment] = own.friction[segment].with_capstan(capstan(first, machine));
                }
                SegmentLaw::Backlash => own.half_width_m[segment] = first,
                SegmentLaw::CameraScale => both.for_each(|k| own.seen_scale[k] = 1.0 + first),
                SegmentLaw::CameraOffset => {
                    both.zip([first, second]).for_each(|(k, offset)| own.seen_offset_rad[k] = offset);
                }
            }
        }
        Ok(own)
    }

    /// True bends, rad, as the camera shows them.
    pub(super) fn seen(&self, bends_rad: &Bends) -> Bends {
        bends_rad.component_mul(&self.seen_scale) + self.seen_offset_rad
    }
}
