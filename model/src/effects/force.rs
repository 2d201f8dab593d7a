//! The effects of a machine of kind force: what a joint's torque or current is made of, from its motion.
//!
//! Problem: tau = inertia qdd + gravity(q) + friction(q, qd, load). q, qd, qdd are the joint's angle, rad, and its derivatives; s is
//! the sign of the speed; L is the load that the gear carries: the recorded one, or else the model's own gravity. The ladder of
//! servo friction models M1 to M6 (Duclusaud et al., "Extended friction models for the physics simulation of servo actuators", 2024)
//! is made of these terms.

use super::{Class, Definition, Hook, Inverse, ParameterSpec, effect, parameter};
use crate::joints::MAX_JOINTS;

/// One effect of a machine of kind force. `y` in units is the machine's own: Nm or A.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForceEffect {
    /// `inertia`.
    Inertia,
    /// `gravity`.
    Gravity,
    /// `coulomb`.
    Coulomb,
    /// `viscous`.
    Viscous,
    /// `stribeck`.
    Stribeck,
    /// `load-coulomb`.
    LoadCoulomb,
    /// `load-stribeck`.
    LoadStribeck,
    /// `quadratic-load`.
    QuadraticLoad,
    /// `direction-viscous`.
    DirectionViscous,
    /// `quadratic-viscous`.
    QuadraticViscous,
}

impl ForceEffect {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Inertia,
        Self::Gravity,
        Self::Coulomb,
        Self::Viscous,
        Self::Stribeck,
        Self::LoadCoulomb,
        Self::LoadStribeck,
        Self::QuadraticLoad,
        Self::DirectionViscous,
        Self::QuadraticViscous,
    ];

    /// What is known about it.
    pub fn definition(self) -> &'static Definition {
        match self {
            Self::Inertia => &INERTIA,
            Self::Gravity => &GRAVITY,
            Self::Coulomb => &COULOMB,
            Self::Viscous => &VISCOUS,
            Self::Stribeck => &STRIBECK,
            Self::LoadCoulomb => &LOAD_COULOMB,
            Self::LoadStribeck => &LOAD_STRIBECK,
            Self::QuadraticLoad => &QUADRATIC_LOAD,
            Self::DirectionViscous => &DIRECTION_VISCOUS,
            Self::QuadraticViscous => &QUADRATIC_VISCOUS,
        }
    }

    /// Its name in model files.
    pub fn name(self) -> &'static str {
        self.definition().name
    }

    /// The effect of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|effect| effect.name() == name)
    }
}

const JOINT: ParameterSpec =
    parameter("joint", "1", [0.0, MAX_JOINTS as f64], 0.0, "which joint, counted from 1; 0: every joint")
        .fixed("an index");
const SIZE: [f64; 2] = [-1e6, 1e6];
const NOT_NEGATIVE: [f64; 2] = [0.0, 1e6];
const VELOCITY: ParameterSpec =
    parameter("velocity_rad_per_s", "rad/s", [1e-4, 1e3], 0.1, "speed at which it has fallen to exp(-1) of its size");

const fn torque(name: &'static str, class: Class, equation: &'static str) -> Definition {
    let inverse = Inverse::None("a model of kind force drives nothing");
    Definition { repeatable: true, inverse, ..effect(name, Hook::Tau, class, equation) }
}

static INERTIA: Definition = Definition {
    also: &["mass"],
    parameters: &[
        JOINT,
        parameter(
            "inertia",
            "y s^2/rad",
            NOT_NEGATIVE,
            0.0,
            "torque for each rad/s^2, the drive's own included; 0: none",
        ),
    ],
    ..torque("inertia", Class::Rate, "tau <- tau + inertia qdd")
};

static GRAVITY: Definition = Definition {
    also: &["weight"],
    parameters: &[
        JOINT,
        parameter("sine", "y", SIZE, 0.0, "torque where sin q is one; 0: none"),
        parameter("cosine", "y", SIZE, 0.0, "torque where cos q is one; 0: none"),
    ],
    ..torque("gravity", Class::Periodic, "tau <- tau + sine sin q + cosine cos q")
};

static COULOMB: Definition = Definition {
    also: &["coulomb-friction", "friction", "dry-friction", "static-friction"],
    parameters: &[JOINT, parameter("torque", "y", NOT_NEGATIVE, 0.0, "against motion at any speed; 0: none")],
    ..torque("coulomb", Class::ConstantHysteresis, "tau <- tau + torque s")
};

static VISCOUS: Definition = Definition {
    also: &["damping", "viscous-friction", "drag"],
    parameters: &[JOINT, parameter("drag", "y s/rad", NOT_NEGATIVE, 0.0, "torque for each rad/s; 0: none")],
    ..torque("viscous", Class::Rate, "tau <- tau + drag qd")
};

static STRIBECK: Definition = Definition {
    also: &["stiction", "stick-slip", "stribeck-friction"],
    parameters: &[
        JOINT,
        parameter("torque", "y", NOT_NEGATIVE, 0.0, "what friction at rest has more than in motion; 0: none"),
        VELOCITY,
    ],
    ..torque("stribeck", Class::ConstantHysteresisAndRate, "tau <- tau + torque s exp(-(qd/velocity)^2)")
};

static LOAD_COULOMB: Definition = Definition {
    also: &["load-friction"],
    parameters: &[JOINT, parameter("share", "1", [0.0, 10.0], 0.0, "friction for each unit of load; 0: none")],
    ..torque("load-coulomb", Class::LoadHysteresis, "tau <- tau + share |L| s")
};

static LOAD_STRIBECK: Definition = Definition {
    parameters: &[
        JOINT,
        parameter(
            "share",
            "1",
            [0.0, 10.0],
            0.0,
            "friction at rest beyond that in motion, for each unit of load; 0: none",
        ),
        VELOCITY,
    ],
    ..torque("load-stribeck", Class::LoadHysteresis, "tau <- tau + share |L| s exp(-(qd/velocity)^2)")
};

static QUADRATIC_LOAD: Definition = Definition {
    parameters: &[JOINT, parameter("share", "1/y", [-1e3, 1e3], 0.0, "friction for the square of the load; 0: none")],
    ..torque("quadratic-load", Class::LoadHysteresis, "tau <- tau + share L^2 s")
};

static DIRECTION_VISCOUS: Definition = Definition {
    parameters: &[
        JOINT,
        parameter("drag", "y s/rad", SIZE, 0.0, "half the difference of drag forth and back; 0: none"),
    ],
    ..torque("direction-viscous", Class::Asymmetry, "tau <- tau + drag |qd|")
};

static QUADRATIC_VISCOUS: Definition = Definition {
    parameters: &[JOINT, parameter("drag", "y s^2/rad^2", SIZE, 0.0, "torque for the square of speed; 0: none")],
    ..torque("quadratic-viscous", Class::Rate, "tau <- tau + drag qd |qd|")
};
