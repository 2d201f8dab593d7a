//! The four kinds of machine that a model file describes.

use super::gripper::FileGripper;
use crate::effects::{EffectKind, ForceFormula};
use crate::gripper::Gripper;
use crate::parameters::{ParameterRange, range_of};
use crate::segments::SegmentsParameters;
use crate::{ChainError, ChainSettings, EffectSetting, MachineParameters};
use std::collections::BTreeMap;

/// What the effects are added to.
#[derive(Clone, Debug, PartialEq)]
pub enum Machine {
    /// A snake on three elastic lines.
    Snake(SnakeMachine),
    /// One to three segments in series on three to twelve elastic lines.
    Segments(SegmentsParameters),
    /// Any cable-driven joints.
    Joints(Joints),
    /// Joints whose torque or current follows from their motion.
    Force(ForceMachine),
}

/// A snake on three elastic lines. Friction of the cone is an effect here, not a property of the machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SnakeMachine {
    /// Geometry and material.
    pub parameters: MachineParameters,
    /// Settings that are no physics.
    pub settings: ChainSettings,
    /// What is known of each number of the geometry, by its key; a number that is not here is held.
    known: BTreeMap<&'static str, Known>,
    /// The gripper, if there is one.
    pub(super) gripper: Option<Box<FileGripper>>,
}

impl Machine {
    /// Its word in model files.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Snake(_) => "snake",
            Self::Segments(_) => "segments",
            Self::Joints(_) => "joints",
            Self::Force(_) => "force",
        }
    }
}

impl SnakeMachine {
    /// The numbers of geometry and material that a fit may free, in the order of the file.
    pub fn geometry() -> impl Iterator<Item = GeometryKey> {
        SNAKE_KEYS.iter().filter_map(|key| {
            let &ParameterRange { low, high, unit, .. } = range_of(key.name)?;
            Some(GeometryKey { name: key.name, unit, low, high, default: (key.get)(&Self::default()) })
        })
    }

    /// The value of a number of the geometry; `None` for a name that is none.
    pub fn value(&self, name: &str) -> Option<f64> {
        geometry_key(name).map(|key| (key.get)(self))
    }

    /// What is known of a number.
    pub fn known(&self, name: &str) -> &Known {
        self.known.get(name).unwrap_or(&Known::Held)
    }

    /// The same machine with another value of one number, of which this is known. A name that is none changes nothing.
    pub fn with(mut self, name: &str, value: f64, known: Known) -> Self {
        if let Some(key) = geometry_key(name) {
            (key.set)(&mut self, value);
            if known == Known::Held {
                self.known.remove(key.name);
            } else {
                self.known.insert(key.name, known);
            }
        }
        self
    }

    /// The gripper, if there is one.
    pub fn gripper(&self) -> Option<&Gripper> {
        self.gripper.as_ref().map(|own| &own.gripper)
    }

    /// The first number that the file says is free: such a machine is not calibrated.
    pub fn first_open(&self) -> Option<&'static str> {
        self.known.iter().find(|(_, known)| known.is_open()).map(|(name, _)| *name)
    }
}

/// A number of a snake's geometry or material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometryKey {
    /// Its key in the model file.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Value where a file leaves it out: the paper's.
    pub default: f64,
}

fn geometry_key(name: &str) -> Option<&'static NumberKey<SnakeMachine>> {
    SNAKE_KEYS.iter().find(|key| key.name == name && key.is_geometry())
}

/// Joints: y = G u + c, u commanded, y measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Joints {
    /// Number of joints, 1 to 16.
    pub n: usize,
    /// G, n rows of n, in units of y per unit of u; diagonal unless the file asks otherwise. 1 where it is not known.
    pub gain: Vec<Vec<f64>>,
    /// What is known of each joint's own gain.
    pub gain_known: Vec<Known>,
    /// c, in units of y. 0 where it is not known.
    pub offset: Vec<f64>,
    /// What is known of each offset.
    pub offset_known: Vec<Known>,
    /// Unit of u.
    pub u_unit: String,
    /// Unit of y.
    pub y_unit: String,
}

/// Joints whose torque or current follows from their motion. The sensor's offset is no key: every prediction solves for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ForceMachine {
    /// Number of joints, 1 to 6.
    pub n: usize,
    /// What is measured.
    pub unit: ForceUnit,
}

impl ForceMachine {
    /// Refuses effects that it cannot have, and two formulas of one name.
    pub(super) fn check_all<'a>(
        &self,
        effects: impl Iterator<Item = &'a EffectSetting> + Clone,
    ) -> Result<(), ChainError> {
        effects.clone().try_for_each(|effect| self.check(effect))?;
        check_names(effects)
    }

    /// Refuses an effect that it cannot have.
    fn check(&self, effect: &EffectSetting) -> Result<(), ChainError> {
        let name = effect.kind().name();
        if let Some(text) = effect.formula_text() {
            return Ok(ForceFormula::new(text).map(|_| ())?);
        }
        if !matches!(effect.kind(), EffectKind::Force(_)) {
            return Err(ChainError::OtherMachine { name, expected: "force" });
        }
        let high = self.n as f64;
        if let Some(found) = effect.value("joint").filter(|joint| *joint > high) {
            return Err(ChainError::OutOfBounds {
                effect: name,
                key: "joint",
                found,
                low: 0.0,
                high,
                unit: "(joints)",
            });
        }
        Ok(())
    }
}

/// Refuses two formulas of one name, which could not be told apart in a report or by `--free`.
pub(super) fn check_names<'a>(effects: impl Iterator<Item = &'a EffectSetting>) -> Result<(), ChainError> {
    let mut formulas: Vec<(usize, &str)> = Vec::new();
    for (place, effect) in effects.enumerate() {
        let Some(text) = effect.formula_text() else { continue };
        if let Some((first, _)) = formulas.iter().find(|(_, name)| *name == text.name) {
            return Err(ChainError::Twice { name: text.name.clone(), first: first + 1, second: place + 1 });
        }
        formulas.push((place, &text.name));
    }
    Ok(())
}

/// Unit of a joint's torque or current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForceUnit {
    /// Torque, Nm.
    NewtonMetre,
    /// Current, A.
    Ampere,
}

impl ForceUnit {
    /// Both.
    pub const ALL: [Self; 2] = [Self::NewtonMetre, Self::Ampere];

    /// The unit as it is shown and stands in model files.
    pub fn word(self) -> &'static str {
        match self {
            Self::NewtonMetre => "Nm",
            Self::Ampere => "A",
        }
    }
}

/// What a model file knows of a number of its machine.
#[derive(Clone, Debug, PartialEq)]
pub enum Known {
    /// The file leaves it out: every fit finds it anew.
    Absent,
    /// The file says "free": the same.
    Free,
    /// A bare number, held.
    Held,
    /// A fitted value: every further fit is drawn to it by its standard error.
    Fitted {
        /// Standard error, in the number's unit.
        se: f64,
        /// The data it was fitted to.
        from: Option<String>,
        /// The day of the fit, YYYY-MM-DD.
        date: Option<String>,
    },
}

impl Known {
    /// Whether nothing is known: a machine with such a number is not calibrated.
    pub fn is_open(&self) -> bool {
        matches!(self, Self::Absent | Self::Free)
    }
}

/// A number of a machine, or of a part of one, by its key.
pub(super) struct NumberKey<T> {
    pub name: &'static str,
    pub doc: &'static str,
    pub get: fn(&T) -> f64,
    pub set: fn(&mut T, f64),
}

impl NumberKey<SnakeMachine> {
    /// Whether it is a number of the geometry, which a fit may free, and no setting.
    pub(super) fn is_geometry(&self) -> bool {
        range_of(self.name).is_some()
    }
}

/// The keys of a snake's machine; ranges are in [`MachineParameters::check`] and [`ChainSettings`].
pub(super) const SNAKE_KEYS: [NumberKey<SnakeMachine>; 10] = [
    NumberKey {
        name: "l_m",
        doc: "m, 0.005 to 0.5: primary backbone, base disk to end disk",
        get: |m| m.parameters.l_m,
        set: |m, v| m.parameters.l_m = v,
    },
    NumberKey {
        name: "r_m",
        doc: "m, 0.0003 to 0.02: pitch radius of the lines",
        get: |m| m.parameters.r_m,
        set: |m, v| m.parameters.r_m = v,
    },
    NumberKey {
        name: "e_pa",
        doc: "Pa, 1e9 to 4e11: Young's modulus",
        get: |m| m.parameters.e_pa,
        set: |m, v| m.parameters.e_pa = v,
    },
    NumberKey {
        name: "d_outer_m",
        doc: "m, 0.00005 to 0.005: outer diameter of a backbone",
        get: |m| m.parameters.d_outer_m,
        set: |m, v| m.parameters.d_outer_m = v,
    },
    NumberKey {
        name: "d_inner_m",
        doc: "m, 0 to less than d_outer_m: inner diameter",
        get: |m| m.parameters.d_inner_m,
        set: |m, v| m.parameters.d_inner_m = v,
    },
    NumberKey {
        name: "l_d_m",
        doc: "m, 0.001 to 10: length of a line in the holder",
        get: |m| m.parameters.l_d_m,
        set: |m, v| m.parameters.l_d_m = v,
    },
    NumberKey {
        name: "l_c_m",
        doc: "m, 0.001 to 10: length of a line in the cone",
        get: |m| m.parameters.l_c_m,
        set: |m, v| m.parameters.l_c_m = v,
    },
    NumberKey {
        name: "phi_rad",
        doc: "rad, 0 to pi: angle of each of the cone's two arcs",
        get: |m| m.parameters.phi_rad,
        set: |m, v| m.parameters.phi_rad = v,
    },
    NumberKey {
        name: "strain_limit",
        doc: "1, 0.001 to 0.08: strain of the outer fibre (d_outer/2) b / L beyond which no shape is planned",
        get: |m| m.settings.strain_limit,
        set: |m, v| m.settings.strain_limit = v,
    },
    NumberKey {
        name: "transition_m",
        doc: "m, 1e-9 to 0.001: travel over which a line's sign of motion turns in the compensator",
        get: |m| m.settings.transition_m,
        set: |m, v| m.settings.transition_m = v,
    },
];
