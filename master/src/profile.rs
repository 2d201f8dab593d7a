//! A profile: which device of the kernel's input system is the hand, and which of its axes and buttons is what. From TOML,
//! checked once.
//!
//! ```toml
//! name = "Extreme 3D Pro"
//! id = "046d:c215"
//!
//! [[axis]]
//! of = "x"
//! from = "ABS_X"
//! range = [0, 1023]
//! rest = 512
//! noise = 12
//! sign = "+"
//!
//! [[button]]
//! of = 0
//! from = "BTN_TRIGGER"
//! ```
//!
//! `of` is the hand's axis (+x right, +y towards the user, +z down, rx, ry, rz about them) or button; `from` the kernel's name
//! for the device's. `range`, `rest` and `noise` are in the device's own counts and may be left out: the kernel tells the range
//! and the noise, and rest is the middle.

use crate::evdev_names::{axis_code, button_code};
use crate::recording::read_bounded;
use crate::recording_lines::parse_vid_pid;
use crate::{AXIS_NAMES, MasterError};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Largest profile that is read, bytes.
const MAX_BYTES: u64 = 64 * 1024;
/// Buttons of a hand.
const N_BUTTONS: u8 = 32;

/// A device and what its axes and buttons are.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// What a person calls it.
    pub name: String,
    /// Which device it is.
    pub device: ProfileDevice,
    /// Its axes that are the hand's.
    pub axes: Vec<ProfileAxis>,
    /// Its buttons that are the hand's.
    pub buttons: Vec<ProfileButton>,
}

/// Which device a profile is of. A keyboard is one only if somebody names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProfileDevice {
    /// The first one with this vendor and product.
    Id(u16, u16),
    /// The one behind this node, as in `/dev/input/by-id/...-event-joystick`.
    Path(PathBuf),
}

/// One of the device's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileAxis {
    /// The hand's axis: x, y, z, rx, ry, rz = 0..=5.
    pub axis_idx: usize,
    /// The kernel's number of the device's axis.
    pub code: u16,
    /// Smallest and largest value, counts; none: as the kernel says.
    pub range: Option<[i32; 2]>,
    /// Value at rest, counts; none: the middle of the range.
    pub rest: Option<i32>,
    /// How far the value strays at rest, counts; none: as the kernel says.
    pub noise: Option<i32>,
    /// Whether larger values are the hand's negative direction.
    pub is_negated: bool,
}

/// One of the device's buttons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProfileButton {
    /// The hand's button, 0..=31.
    pub button: u8,
    /// The kernel's number of the device's button.
    pub code: u16,
}

/// The profiles that are built in, by their names.
const SHIPPED: [(&str, &str); 2] = [
    ("extreme-3d-pro", include_str!("../profiles/extreme-3d-pro.toml")),
    ("xbox-360", include_str!("../profiles/xbox-360.toml")),
];

impl Profile {
    /// Every profile that is built in, by its name.
    ///
    /// # Errors
    /// [`MasterError::Profile`], never for a binary that passed its tests.
    pub fn shipped() -> Result<Vec<(&'static str, Self)>, MasterError> {
        SHIPPED.iter().map(|(name, text)| Ok((*name, Self::parse(name, text)?))).collect()
    }

    /// Whether a path is the name of a built-in profile.
    pub fn is_shipped(path: &Path) -> bool {
        SHIPPED.iter().any(|(name, _)| path == Path::new(name))
    }

    /// Reads a file, or a built-in profile by its name.
    ///
    /// # Errors
    /// [`MasterError::File`], [`MasterError::TooLarge`] or [`MasterError::Profile`].
    pub fn load(path: &Path) -> Result<Self, MasterError> {
        if let Some((name, text)) = SHIPPED.iter().find(|(name, _)| path == Path::new(name)) {
            return Self::parse(name, text);
        }
        let file = path.display().to_string();
        let bytes = read_bounded(path, MAX_BYTES)?;
        let text = std::str::from_utf8(&bytes).map_err(|error| MasterError::Profile {
            file: file.clone(),
            place: format!("byte {}", error.valid_up_to()),
            expected: "text (UTF-8)".to_owned(),
            found: "something else".to_owned(),
        })?;
        Self::parse(&file, text)
    }

    /// Reads a profile from its text; `file` names it in error sentences.
    ///
    /// # Errors
    /// [`MasterError::Profile`] for the first thing that is wrong.
    pub fn parse(file: &str, text: &str) -> Result<Self, MasterError> {
        let refuse = |place: String, expected: &str, found: String| MasterError::Profile {
            file: file.to_owned(),
            place,
            expected: expected.to_owned(),
            found,
        };
        let read: Read = toml::from_str(text).map_err(|error| {
            let before = error.span().map_or("", |span| &text[..span.start.min(text.len())]);
            let line = before.matches('\n').count() + 1;
            refuse(format!("line {line}"), "a profile as docs/hands.md shows it", error.message().replace('\n', " "))
        })?;
        let device = match (&read.id, &read.path) {
            (Some(id), None) => match parse_vid_pid(id) {
                Some((vendor_id, product_id)) => ProfileDevice::Id(vendor_id, product_id),
                None => return Err(refuse("id".to_owned(), "vendor:product as in \"046d:c215\"", format!("{id:?}"))),
            },
            (None, Some(path)) => ProfileDevice::Path(path.clone()),
            (id, _) => {
                let found = if id.is_some() { "both" } else { "neither" };
                return Err(refuse("the head".to_owned(), "either id or path of the device", found.to_owned()));
            }
        };
        let mut profile = Self { name: read.name, device, axes: Vec::new(), buttons: Vec::new() };
        for (idx, axis) in read.axis.iter().enumerate() {
            let checked = profile.axis(axis);
            let checked = checked
                .map_err(|(key, expected, found)| refuse(format!("axis {}, key {key}", idx + 1), expected, found))?;
            profile.axes.push(checked);
        }
        for (idx, button) in read.button.iter().enumerate() {
            let checked = profile.button(button);
            let checked = checked
                .map_err(|(key, expected, found)| refuse(format!("button {}, key {key}", idx + 1), expected, found))?;
            profile.buttons.push(checked);
        }
        if profile.axes.is_empty() && profile.buttons.is_empty() {
            return Err(refuse("the file".to_owned(), "at least one [[axis]] or [[button]]", "none".to_owned()));
        }
        Ok(profile)
    }

    fn axis(&self, read: &ReadAxis) -> Result<ProfileAxis, Wrong> {
        let axis_idx = AXIS_NAMES.iter().position(|name| *name == read.of);
        let axis_idx = axis_idx.ok_or_else(|| wrong("of", "x, y, z, rx, ry or rz", &read.of))?;
        let code = axis_code(&read.from);
        let code =
            code.ok_or_else(|| wrong("from", "an axis of the kernel as in \"ABS_X\", or its number", &read.from))?;
        if self.axes.iter().any(|axis| axis.axis_idx == axis_idx || axis.code == code) {
            return Err(wrong("of", "each axis of hand and device at most once", &read.of));
        }
        if let Some([low, high]) = read.range
            && low >= high
        {
            return Err(wrong(
                "range",
                "the smaller value first, and another one after it",
                &format!("[{low}, {high}]"),
            ));
        }
        if let (Some([low, high]), Some(rest)) = (read.range, read.rest)
            && !(low..=high).contains(&rest)
        {
            return Err(wrong("rest", "a value within the range", &rest.to_string()));
        }
        if let Some(noise) = read.noise {
            let widest = read.range.map_or(i64::from(i32::MAX), |[low, high]| (i64::from(high) - i64::from(low)) / 4);
            if noise < 0 || i64::from(noise) > widest {
                return Err(wrong("noise", "0 to a quarter of the range", &noise.to_string()));
            }
        }
        let is_negated = match read.sign.as_str() {
            "+" => false,
            "-" => true,
            other => return Err(wrong("sign", "\"+\" or \"-\"", other)),
        };
        Ok(ProfileAxis { axis_idx, code, range: read.range, rest: read.rest, noise: read.noise, is_negated })
    }

    fn button(&self, read: &ReadButton) -> Result<ProfileButton, Wrong> {
        if read.of >= N_BUTTONS || self.buttons.iter().any(|button| button.button == read.of) {
            return Err(wrong("of", "each button from 0 to 31 at most once", &read.of.to_string()));
        }
        match button_code(&read.from) {
            Some(code) if self.buttons.iter().any(|button| button.code == code) => {
                Err(wrong("from", "each button of the device at most once", &read.from))
            }
            Some(code) => Ok(ProfileButton { button: read.of, code }),
            None => Err(wrong(
                "from",
                "a button of the kernel as in \"BTN_TRIGGER\" or \"KEY_A\", or its number",
                &read.from,
            )),
        }
    }
}

/// Key, what was expected, what was found.
type Wrong = (&'static str, &'static str, String);

fn wrong(key: &'static str, expected: &'static str, found: &str) -> Wrong {
    let shown: String = found.chars().take(40).collect();
    (key, expected, format!("{shown:?}"))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read {
    name: String,
    id: Option<String>,
    path: Option<PathBuf>,
    #[serde(default)]
    axis: Vec<ReadAxis>,
    #[serde(default)]
    button: Vec<ReadButton>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReadAxis {
    of: String,
    from: String,
    range: Option<[i32; 2]>,
    rest: Option<i32>,
    noise: Option<i32>,
    #[serde(default = "plus")]
    sign: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReadButton {
    of: u8,
    from: String,
}

fn plus() -> String {
    "+".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\nrange = [0, 1023]\nrest = 512\nnoise = 12\n[[axis]]\nof = \"y\"\nfrom = \"1\"\nsign = \"-\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n";

    #[test]
    fn a_profile_is_read_and_says_what_is_what() {
        let profile = Profile::parse("stick.toml", GOOD).expect("a profile");
        assert_eq!(profile.device, ProfileDevice::Id(0x046d, 0xc215));
        let x = ProfileAxis {
            axis_idx: 0,
            code: 0,
            range: Some([0, 1023]),
            rest: Some(512),
            noise: Some(12),
            is_negated: false,
        };
        let y = ProfileAxis { axis_idx: 1, code: 1, range: None, rest: None, noise: None, is_negated: true };
        assert_eq!(profile.axes, [x, y]);
        assert_eq!(profile.buttons, [ProfileButton { button: 0, code: 0x120 }]);
    }

    #[test]
    fn the_built_in_profiles_are_good_and_go_by_their_names() {
        let shipped = Profile::shipped().expect("good");
        assert_eq!(shipped.len(), SHIPPED.len());
        for (name, profile) in shipped {
            assert_eq!(Profile::load(Path::new(name)).expect("by its name"), profile);
            assert!(profile.axes.len() >= 3 && profile.buttons.len() == 3, "presence, clutch and mark");
        }
    }

    #[test]
    fn a_faulty_profile_is_refused_with_file_place_expectation_and_finding() {
        for (from, to, words) in [
            ("id = \"046d:c215\"", "id = \"46d:c215\"", "id: expected vendor:product"),
            ("id = \"046d:c215\"\n", "", "expected either id or path of the device, found neither"),
            ("id = \"046d:c215\"", "id = \"046d:c215\"\npath = \"/dev/input/event3\"", "found both"),
            ("\"x\"", "\"w\"", "axis 1, key of: expected x, y, z, rx, ry or rz, found \"w\""),
            ("\"ABS_X\"", "\"REL_X\"", "axis 1, key from"),
            ("[0, 1023]", "[1023, 0]", "axis 1, key range"),
            ("512", "1024", "axis 1, key rest: expected a value within the range"),
            ("noise = 12", "noise = 300", "axis 1, key noise: expected 0 to a quarter of the range"),
            ("noise = 12", "noise = -1", "axis 1, key noise"),
            ("\"-\"", "\"\"", "axis 2, key sign"),
            ("\"y\"", "\"x\"", "axis 2, key of: expected each axis"),
            ("from = \"1\"", "from = \"0\"", "axis 2, key of: expected each axis"),
            ("of = 0", "of = 32", "button 1, key of"),
            ("BTN_TRIGGER", "BTN_TRIGER", "button 1, key from"),
            ("of = 0", "of = zero", "line 14"),
            ("name", "nome", "line 1"),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let error = Profile::parse("stick.toml", &GOOD.replacen(from, to, 1)).expect_err("faulty").to_string();
            assert!(error.starts_with("profile stick.toml, ") && error.contains(words), "{error}");
            assert!(!error.contains('\n') && error.contains("correct it"), "{error}");
        }
        let nothing =
            Profile::parse("empty.toml", "name = \"x\"\nid = \"046d:c215\"\n").expect_err("nothing").to_string();
        assert!(nothing.contains("at least one [[axis]] or [[button]]"), "{nothing}");
    }
}
