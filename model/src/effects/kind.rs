//! The names of all effects, and where each one's definition is.

use super::{Definition, ForceEffect, SegmentEffect, encoder, extension, formula, friction, geometry, moment, shape};
use crate::joints::JointEffect;

/// One effect of `docs/physics/effects.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectKind {
    /// `stiffness-scale`.
    StiffnessScale,
    /// `actuator-compliance`.
    ActuatorCompliance,
    /// `radius-error`.
    RadiusError,
    /// `camera-scale`.
    CameraScale,
    /// `inside-extension`.
    InsideExtension,
    /// `backlash`.
    Backlash,
    /// `static-friction`.
    StaticFriction,
    /// `bouc-wen`.
    BoucWen,
    /// `prandtl-ishlinskii`.
    PrandtlIshlinskii,
    /// `cone-friction`.
    ConeFriction,
    /// `distributed-capstan`.
    DistributedCapstan,
    /// `disk-friction`.
    DiskFriction,
    /// `bend-friction`.
    BendFriction,
    /// `hole-clearance`.
    HoleClearance,
    /// `superelastic-softening`.
    SuperelasticSoftening,
    /// `non-constant-curvature`.
    NonConstantCurvature,
    /// `axial-tip-force`.
    AxialTipForce,
    /// `tension-compression-asymmetry`.
    TensionCompressionAsymmetry,
    /// `line-buckling`.
    LineBuckling,
    /// `viscous-friction`.
    ViscousFriction,
    /// `latency`.
    Latency,
    /// `stribeck-friction`.
    StribeckFriction,
    /// `plane-offset`.
    PlaneOffset,
    /// `twist`.
    Twist,
    /// `lateral-tip-force`.
    LateralTipForce,
    /// `encoder-zero`.
    EncoderZero,
    /// `camera-offset`.
    CameraOffset,
    /// `encoder-scale`.
    EncoderScale,
    /// `unequal-lines`.
    UnequalLines,
    /// `lead-screw-error`.
    LeadScrewError,
    /// `creep`.
    Creep,
    /// `thermal-drift`.
    ThermalDrift,
    /// `stem-coupling`.
    StemCoupling,
    /// `saturation`.
    Saturation,
    /// `preload`.
    Preload,
    /// `cross-coupling`.
    CrossCoupling,
    /// `formula`.
    Formula,
    /// An effect of joints, which no snake has.
    Joint(JointEffect),
    /// An effect of a machine of kind force.
    Force(ForceEffect),
    /// An effect of one segment of a machine of kind segments.
    OfSegment(SegmentEffect),
}

impl EffectKind {
    /// All that a snake can have, in the order of the documentation's table.
    pub const ALL: [Self; 37] = [
        Self::StiffnessScale,
        Self::ActuatorCompliance,
        Self::RadiusError,
        Self::CameraScale,
        Self::InsideExtension,
        Self::Backlash,
        Self::StaticFriction,
        Self::BoucWen,
        Self::PrandtlIshlinskii,
        Self::ConeFriction,
        Self::DistributedCapstan,
        Self::DiskFriction,
        Self::BendFriction,
        Self::HoleClearance,
        Self::SuperelasticSoftening,
        Self::NonConstantCurvature,
        Self::AxialTipForce,
        Self::TensionCompressionAsymmetry,
        Self::LineBuckling,
        Self::ViscousFriction,
        Self::Latency,
        Self::StribeckFriction,
        Self::PlaneOffset,
        Self::Twist,
        Self::LateralTipForce,
        Self::EncoderZero,
        Self::CameraOffset,
        Self::EncoderScale,
        Self::UnequalLines,
        Self::LeadScrewError,
        Self::Creep,
        Self::ThermalDrift,
        Self::StemCoupling,
        Self::Saturation,
        Self::Preload,
        Self::CrossCoupling,
        Self::Formula,
    ];

    /// What is known about it.
    pub fn definition(self) -> &'static Definition {
        match self {
            Self::StiffnessScale => &moment::STIFFNESS_SCALE,
            Self::ActuatorCompliance => &extension::ACTUATOR_COMPLIANCE,
            Self::RadiusError => &geometry::RADIUS_ERROR,
            Self::CameraScale => &shape::CAMERA_SCALE,
            Self::InsideExtension => &extension::INSIDE_EXTENSION,
            Self::Backlash => &encoder::BACKLASH,
            Self::StaticFriction => &friction::STATIC_FRICTION,
            Self::BoucWen => &extension::BOUC_WEN,
            Self::PrandtlIshlinskii => &extension::PRANDTL_ISHLINSKII,
            Self::ConeFriction => &friction::CONE_FRICTION,
            Self::DistributedCapstan => &friction::DISTRIBUTED_CAPSTAN,
            Self::DiskFriction => &friction::DISK_FRICTION,
            Self::BendFriction => &moment::BEND_FRICTION,
            Self::HoleClearance => &geometry::HOLE_CLEARANCE,
            Self::SuperelasticSoftening => &moment::SUPERELASTIC_SOFTENING,
            Self::NonConstantCurvature => &shape::NON_CONSTANT_CURVATURE,
            Self::AxialTipForce => &moment::AXIAL_TIP_FORCE,
            Self::TensionCompressionAsymmetry => &extension::TENSION_COMPRESSION_ASYMMETRY,
            Self::LineBuckling => &extension::LINE_BUCKLING,
            Self::ViscousFriction => &friction::VISCOUS_FRICTION,
            Self::Latency => &shape::LATENCY,
            Self::StribeckFriction => &friction::STRIBECK_FRICTION,
            Self::PlaneOffset => &shape::PLANE_OFFSET,
            Self::Twist => &shape::TWIST,
            Self::LateralTipForce => &moment::LATERAL_TIP_FORCE,
            Self::EncoderZero => &encoder::ENCODER_ZERO,
            Self::CameraOffset => &shape::CAMERA_OFFSET,
            Self::EncoderScale => &encoder::ENCODER_SCALE,
            Self::UnequalLines => &geometry::UNEQUAL_LINES,
            Self::LeadScrewError => &encoder::LEAD_SCREW_ERROR,
            Self::Creep => &extension::CREEP,
            Self::ThermalDrift => &extension::THERMAL_DRIFT,
            Self::StemCoupling => &friction::STEM_COUPLING,
            Self::Saturation => &encoder::SATURATION,
            Self::Preload => &encoder::PRELOAD,
            Self::CrossCoupling => &extension::CROSS_COUPLING,
            Self::Formula => &formula::FORMULA,
            Self::Joint(effect) => effect.definition(),
            Self::Force(effect) => effect.definition(),
            Self::OfSegment(effect) => effect.definition(),
        }
    }

    /// The effect that is another law of the same thing, which no chain may hold beside it.
    pub fn excludes(self) -> Option<Self> {
        match self {
            Self::ConeFriction => Some(Self::DistributedCapstan),
            Self::DistributedCapstan => Some(Self::ConeFriction),
            _ => None,
        }
    }

    /// Its name in model files.
    pub fn name(self) -> &'static str {
        self.definition().name
    }

    /// The snake's effect of a name; those of joints are [`JointEffect::from_name`]'s.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_defaults_lie_within_bounds() {
        for (k, kind) in EffectKind::ALL.into_iter().enumerate() {
            assert_eq!(EffectKind::from_name(kind.name()), Some(kind));
            assert!(EffectKind::ALL[k + 1..].iter().all(|other| other.name() != kind.name()));
            let parameters = kind.definition().parameters;
            assert!(parameters.len() <= super::super::MAX_PARAMETERS);
            for (j, p) in parameters.iter().enumerate() {
                assert!(
                    p.low <= p.default && p.default <= p.high && !p.source.is_empty(),
                    "{} {}",
                    kind.name(),
                    p.name
                );
                assert!(parameters[j + 1..].iter().all(|other| other.name != p.name));
            }
        }
    }
}
