//! The names of the effects of joints, and where each one's definition is.

use super::{hysteresis, position, rate};
use crate::effects::Definition;

/// One effect of a joint, as `docs/physics/effects.md` describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointEffect {
    /// `scale`.
    Scale,
    /// `offset`.
    Offset,
    /// `backlash`.
    Backlash,
    /// `bouc-wen`.
    BoucWen,
    /// `prandtl-ishlinskii`.
    PrandtlIshlinskii,
    /// `cone-friction`.
    ConeFriction,
    /// `creep`.
    Creep,
    /// `latency`.
    Latency,
    /// `first-order-lag`.
    FirstOrderLag,
    /// `cubic`.
    Cubic,
    /// `dead-zone`.
    DeadZone,
    /// `periodic-error`.
    PeriodicError,
    /// `cross-coupling`.
    CrossCoupling,
    /// `drift`.
    Drift,
    /// `saturation`.
    Saturation,
    /// `second-order`.
    SecondOrder,
    /// `rate-limit`.
    RateLimit,
    /// `load-friction`.
    LoadFriction,
    /// `generalised-prandtl-ishlinskii`.
    GeneralisedPrandtlIshlinskii,
    /// `quadratic`.
    Quadratic,
    /// `linear-drift`.
    LinearDrift,
}

impl JointEffect {
    /// All of them, in the order of the documentation's table.
    pub const ALL: [Self; 21] = [
        Self::Scale,
        Self::Offset,
        Self::Backlash,
        Self::BoucWen,
        Self::PrandtlIshlinskii,
        Self::ConeFriction,
        Self::Creep,
        Self::Latency,
        Self::FirstOrderLag,
        Self::Cubic,
        Self::DeadZone,
        Self::PeriodicError,
        Self::CrossCoupling,
        Self::Drift,
        Self::Saturation,
        Self::SecondOrder,
        Self::RateLimit,
        Self::LoadFriction,
        Self::GeneralisedPrandtlIshlinskii,
        Self::Quadratic,
        Self::LinearDrift,
    ];

    /// What is known about it. Units `u` and `y` are those of the machine.
    pub fn definition(self) -> &'static Definition {
        match self {
            Self::Scale => &position::SCALE,
            Self::Offset => &position::OFFSET,
            Self::Backlash => &hysteresis::BACKLASH,
            Self::BoucWen => &hysteresis::BOUC_WEN,
            Self::PrandtlIshlinskii => &hysteresis::PRANDTL_ISHLINSKII,
            Self::ConeFriction => &hysteresis::CONE_FRICTION,
            Self::Creep => &rate::CREEP,
            Self::Latency => &rate::LATENCY,
            Self::FirstOrderLag => &rate::FIRST_ORDER_LAG,
            Self::Cubic => &position::CUBIC,
            Self::DeadZone => &position::DEAD_ZONE,
            Self::PeriodicError => &position::PERIODIC_ERROR,
            Self::CrossCoupling => &position::CROSS_COUPLING,
            Self::Drift => &rate::DRIFT,
            Self::Saturation => &position::SATURATION,
            Self::SecondOrder => &rate::SECOND_ORDER,
            Self::RateLimit => &rate::RATE_LIMIT,
            Self::LoadFriction => &hysteresis::LOAD_FRICTION,
            Self::GeneralisedPrandtlIshlinskii => &hysteresis::GENERALISED_PRANDTL_ISHLINSKII,
            Self::Quadratic => &position::QUADRATIC,
            Self::LinearDrift => &rate::LINEAR_DRIFT,
        }
    }

    /// Its name in model files.
    pub fn name(self) -> &'static str {
        self.definition().name
    }

    /// Whether its contribution goes around the effects behind it: it is computed from the position as those before it pass it
    /// on, and added to what leaves the transmission.
    pub fn adds(self) -> bool {
        matches!(
            self,
            Self::BoucWen
                | Self::PrandtlIshlinskii
                | Self::LoadFriction
                | Self::GeneralisedPrandtlIshlinskii
                | Self::Creep
                | Self::Quadratic
                | Self::Cubic
                | Self::PeriodicError
                | Self::CrossCoupling
        )
    }

    /// The effect of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }
}
