//! The table `[gripper]` of a snake's model file: a jaw on a wire through the central tube, and the effects of that wire.

use super::machine::Machine;
use super::read::Section;
use super::write::{Out, number, numbers};
use super::{FileEffect, Joints, Known, ModelFileError, read_effect};
use crate::gripper::{Gripper, GripperNumbers};
use crate::{ChainError, EffectSetting, ParameterError};

const WIRE_DOC: &str = "m of wire for one radian of the jaw, 1e-4 to 0.02: pushed it opens, pulled it closes";
const RANGE_DOC: &str = "deg, [closed, open]: -180 to 0, 0 to 180, at least 1 apart; the drive's zero is the jaw at 0";
const VEL_DOC: &str = "deg/s, 1 to 720: fastest motion of the jaw";

/// A gripper, and where the values of its effects come from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FileGripper {
    pub gripper: Gripper,
    effects: Vec<FileEffect>,
}

impl FileGripper {
    /// What a file that says nothing else of a gripper is told as an example: the shipped one's numbers, no effects.
    pub(super) fn example() -> Result<Self, ChainError> {
        let numbers = GripperNumbers { wire_m_per_rad: 2e-3, range_deg: [0.0, 60.0], max_vel_deg_per_s: 90.0 };
        Ok(Self { gripper: Gripper::new(numbers, &[])?, effects: Vec::new() })
    }
}

/// Reads the table.
pub(super) fn gripper(section: &Section) -> Result<FileGripper, ModelFileError> {
    section.only(&["wire_m_per_rad", "range_deg", "max_vel_deg_per_s", "effect"])?;
    let number = |key: &'static str, expected| {
        section.number(key)?.map(|given| given.value).ok_or_else(|| section.missing(key, expected))
    };
    let wire_m_per_rad = number("wire_m_per_rad", WIRE_DOC)?;
    let range = section.get("range_deg").ok_or_else(|| section.missing("range_deg", RANGE_DOC))?;
    let range_deg = section.all_numbers("range_deg", range)?;
    let [closed_deg, open_deg] = range_deg[..] else {
        let (line, key, found) = (section.line_at(range), "range_deg".to_owned(), range_deg.len());
        return Err(ModelFileError::Count { line, key, found, expected: 2 });
    };
    let max_vel_deg_per_s = number("max_vel_deg_per_s", VEL_DOC)?;
    let numbers = GripperNumbers { wire_m_per_rad, range_deg: [closed_deg, open_deg], max_vel_deg_per_s };
    let refused = |source: ChainError| {
        let line = match &source {
            ChainError::Machine(ParameterError::OutOfRange { key, .. }) => section.line_of_key(key),
            _ => section.line,
        };
        ModelFileError::Chain { line, source }
    };
    let mut effects = Vec::new();
    let mut gripper = Gripper::new(numbers, &[]).map_err(refused)?;
    let jaw = Machine::Joints(numbers.joints());
    for section in &section.sections("effect")? {
        effects.push(read_effect::held_effect(section, &jaw)?);
        // The whole list so far: what is wrong with it is wrong with its last effect.
        let chain = |source| ModelFileError::Chain { line: section.line, source };
        gripper = Gripper::new(numbers, &settings(&effects)).map_err(chain)?;
    }
    Ok(FileGripper { gripper, effects })
}

fn settings(effects: &[FileEffect]) -> Vec<EffectSetting> {
    effects.iter().map(|effect| effect.setting().clone()).collect()
}

/// Writes the table.
pub(super) fn write(out: &mut Out, own: &FileGripper) {
    let GripperNumbers { wire_m_per_rad, range_deg, max_vel_deg_per_s } = *own.gripper.numbers();
    out.line("\n[gripper]", "a jaw on a wire through the central tube, which no bend pulls");
    out.line(&format!("wire_m_per_rad = {}", number(wire_m_per_rad)), WIRE_DOC);
    out.line(&format!("range_deg = {}", numbers(&range_deg)), RANGE_DOC);
    out.line(&format!("max_vel_deg_per_s = {}", number(max_vel_deg_per_s)), VEL_DOC);
    own.effects.iter().for_each(|effect| out.effect("gripper.effect", effect));
}

impl GripperNumbers {
    /// The jaw as a machine of one joint: commands in m of wire, positions in rad.
    pub(crate) fn joints(&self) -> Joints {
        Joints {
            n: 1,
            gain: vec![vec![1.0 / self.wire_m_per_rad]],
            gain_known: vec![Known::Held],
            offset: vec![0.0],
            offset_known: vec![Known::Held],
            u_unit: "m".to_owned(),
            y_unit: "rad".to_owned(),
        }
    }
}
