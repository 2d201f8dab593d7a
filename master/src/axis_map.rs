//! Which device axis, in which direction, drives which axis of the view: text such as `-z` in a configuration, checked once.

use serde::{Deserialize, Serialize};
use std::fmt;

/// One of the device's six axes with a sign, written `+x`, `-z`, `+ry`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct SignedAxis {
    axis_idx: usize,
    is_negated: bool,
}

/// Names of the device's axes in the order of its reports.
pub const AXIS_NAMES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

impl SignedAxis {
    /// Place of the axis in the device's reports: x, y, z, rx, ry, rz = 0..=5.
    pub fn axis_idx(self) -> usize {
        self.axis_idx
    }

    /// +1 or -1.
    pub fn sign(self) -> f64 {
        if self.is_negated { -1.0 } else { 1.0 }
    }
}

impl TryFrom<String> for SignedAxis {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        let (is_negated, name) = match text.split_at_checked(1) {
            Some(("+", name)) => (false, name),
            Some(("-", name)) => (true, name),
            _ => (false, ""),
        };
        match AXIS_NAMES.iter().position(|n| *n == name) {
            Some(axis_idx) => Ok(Self { axis_idx, is_negated }),
            None => {
                Err(format!("{text:?} is no device axis, expected a sign and one of x, y, z, rx, ry, rz, as in \"-z\""))
            }
        }
    }
}

impl From<SignedAxis> for String {
    fn from(axis: SignedAxis) -> Self {
        axis.to_string()
    }
}

impl fmt::Display for SignedAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", if self.is_negated { '-' } else { '+' }, AXIS_NAMES[self.axis_idx])
    }
}

/// The device axis behind each axis of the view frame (x right, y down, z away from the viewer).
///
/// The default takes the cap's translation as it is. The device counts +X to the right, +Y towards the user and +Z down,
/// so right = +x, down = +z, away = -y: the tip goes where the cap is pushed, for an operator who looks along view z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct AxisMap {
    /// Drives view x, to the right.
    pub view_x: SignedAxis,
    /// Drives view y, down.
    pub view_y: SignedAxis,
    /// Drives view z, away from the viewer.
    pub view_z: SignedAxis,
}

impl Default for AxisMap {
    fn default() -> Self {
        Self {
            view_x: SignedAxis { axis_idx: 0, is_negated: false },
            view_y: SignedAxis { axis_idx: 2, is_negated: false },
            view_z: SignedAxis { axis_idx: 1, is_negated: true },
        }
    }
}

impl AxisMap {
    /// The axes for view x, y, z.
    pub fn axes(&self) -> [SignedAxis; 3] {
        [self.view_x, self.view_y, self.view_z]
    }

    /// The axes for turning about view x, y, z: about the device axis whose translation the view's axis is (`rx` for `x`), the
    /// same way round for an eye on the view and a hand on the device. A map that mirrors turns the other way round.
    pub fn turns(&self) -> [SignedAxis; 3] {
        let axes = self.axes();
        let [a, b, c] = axes.map(|axis| axis.axis_idx % 3);
        // Even permutations keep the hand of the frame.
        let is_even = (b + 3 - a) % 3 == 1 && (c + 3 - b) % 3 == 1;
        let is_mirrored = is_even != (axes.iter().filter(|axis| axis.is_negated).count() % 2 == 0);
        axes.map(|axis| SignedAxis { axis_idx: (axis.axis_idx + 3) % 6, is_negated: axis.is_negated != is_mirrored })
    }

    /// Whether each view axis has a device axis of its own.
    pub fn is_one_to_one(&self) -> bool {
        let [x, y, z] = self.axes().map(SignedAxis::axis_idx);
        x != y && y != z && z != x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_go_the_same_way_round_as_on_the_device() {
        let text = |map: &AxisMap| map.turns().map(|axis| axis.to_string()).join(" ");
        assert_eq!(text(&AxisMap::default()), "+rx +rz -ry");
        let map = |axes: [&str; 3]| {
            let [view_x, view_y, view_z] = axes.map(|axis| SignedAxis::try_from(axis.to_owned()).expect("an axis"));
            AxisMap { view_x, view_y, view_z }
        };
        assert_eq!(text(&map(["+x", "+y", "+z"])), "+rx +ry +rz");
        assert_eq!(text(&map(["+y", "+z", "+x"])), "+ry +rz +rx");
        // Right and left exchanged: what turned to the right about the view's axis now turns to the left about the others.
        assert_eq!(text(&map(["-x", "+z", "-y"])), "+rx -rz +ry");
        assert_eq!(text(&map(["+rx", "+rz", "-ry"])), "+x +z -y");
    }

    #[test]
    fn an_axis_is_read_and_written_the_same_and_nonsense_is_named() {
        for text in ["+x", "-y", "+z", "-rx", "+ry", "-rz"] {
            assert_eq!(SignedAxis::try_from(text.to_owned()).expect("axis").to_string(), text);
        }
        for text in ["", "x", "+w", "--x", "é", "+X"] {
            let error = SignedAxis::try_from(text.to_owned()).expect_err("nonsense");
            assert!(error.contains("is no device axis"), "{error}");
        }
    }
}
