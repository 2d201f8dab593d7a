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
//! and the noise, and rest is the middle. An axis may also come from a way or from two keys ([`AxisFrom`]).

use crate::evdev_host::FIRST_BUTTON;
use crate::evdev_names::{button_code, button_name};
use crate::profile_axis::{ReadAxis, Wrong, wrong};
use crate::profile_signs::{ReadLights, ReadRumble};
use crate::recording::read_bounded;
use crate::recording_lines::parse_vid_pid;
use crate::{AxisFrom, LightRole, MasterError, ProfileAxis};
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
    /// The key, by the kernel's number, that ends the motion and gives the device back to the rest of the machine.
    pub release: Option<u16>,
    /// What lights, by the kernel's numbers, are for while krait has the device.
    pub lights: Vec<(LightRole, u16)>,
    /// What it rumbles for, and how strongly, as a part of the most that it can.
    pub rumble: Vec<(LightRole, f64)>,
}

/// Which device a profile is of. A keyboard is one only if somebody names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProfileDevice {
    /// The first one with this vendor and product.
    Id(u16, u16),
    /// The one behind this node, as in `/dev/input/by-id/...-event-joystick`.
    Path(PathBuf),
    /// None: a built-in profile of a mouse, keyboard or pedal, of which the user must say which. No device is ever chosen for it.
    Unnamed,
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
const SHIPPED: [(&str, &str); 5] = [
    ("extreme-3d-pro", include_str!("../profiles/extreme-3d-pro.toml")),
    ("xbox-360", include_str!("../profiles/xbox-360.toml")),
    ("mouse", include_str!("../profiles/mouse.toml")),
    ("keyboard", include_str!("../profiles/keyboard.toml")),
    ("pedal", include_str!("../profiles/pedal.toml")),
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

    /// Reads a profile, and takes the device behind `node`, if one is given, for the profile's own.
    ///
    /// # Errors
    /// As [`Profile::load`]; [`MasterError::NoNode`] for a profile that names no device, without a node.
    pub fn of_device(path: &Path, node: Option<&Path>) -> Result<Self, MasterError> {
        let mut profile = Self::load(path)?;
        if let Some(node) = node {
            profile.device = ProfileDevice::Path(node.to_owned());
        }
        match profile.device {
            ProfileDevice::Unnamed => Err(MasterError::NoNode { profile: path.to_owned() }),
            _ => Ok(profile),
        }
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
            (None, None) if Self::is_shipped(Path::new(file)) => ProfileDevice::Unnamed,
            (id, _) => {
                let found = if id.is_some() { "both" } else { "neither" };
                return Err(refuse("the head".to_owned(), "either id or path of the device", found.to_owned()));
            }
        };
        let of_key = |(key, expected, found): Wrong| refuse(format!("key {key}"), expected, found);
        let lights = read.lights.checked(&read.light).map_err(of_key)?;
        let rumble = read.rumble.as_ref().map_or(Ok(Vec::new()), ReadRumble::checked).map_err(of_key)?;
        let (name, axes, buttons) = (read.name, Vec::new(), Vec::new());
        let mut profile = Self { name, device, axes, buttons, release: None, lights, rumble };
        for (idx, axis) in read.axis.iter().enumerate() {
            let checked = axis.checked(&profile.axes);
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
        let release = profile.release(read.release.as_deref());
        profile.release = release.map_err(of_key)?;
        Ok(profile)
    }

    /// A person at a keyboard that types nowhere else needs a key that ends this.
    fn release(&self, read: Option<&str>) -> Result<Option<u16>, Wrong> {
        let Some(text) = read else {
            let is_keyboard = self.axes.iter().any(|axis| axis.keys().any(|key| key < FIRST_BUTTON));
            let expected = "a key that gives the keyboard back, as in release = \"KEY_ESC\"";
            return if is_keyboard { Err(("release", expected, "none".to_owned())) } else { Ok(None) };
        };
        match button_code(text) {
            Some(code) if self.keys().any(|key| key == code) => {
                Err(wrong("release", "a key that is no axis and no button of the hand", text))
            }
            Some(code) => Ok(Some(code)),
            None => Err(wrong("release", "a key of the kernel as in \"KEY_ESC\", or its number", text)),
        }
    }

    /// Every key and button of the device that is the hand's.
    pub(crate) fn keys(&self) -> impl Iterator<Item = u16> {
        self.buttons.iter().map(|button| button.code).chain(self.axes.iter().flat_map(ProfileAxis::keys))
    }

    /// What a person must know before a mouse or keyboard is taken: that nothing else hears it, and how to get it back. None for a
    /// hand that does nothing else anyway.
    pub fn warning(&self) -> Option<String> {
        let is_keyboard = self.keys().chain(self.release).any(|key| key < FIRST_BUTTON);
        let is_mouse = self.axes.iter().any(|axis| matches!(axis.from, AxisFrom::Way { .. }));
        let device = match &self.device {
            ProfileDevice::Path(node) => format!("{:?} at {}", self.name, node.display()),
            ProfileDevice::Id(..) | ProfileDevice::Unnamed => format!("{:?}", self.name),
        };
        let taken = format!("{device} is taken while krait runs: nothing else on this machine hears it");
        match self.release.map(button_name) {
            Some(key) if is_keyboard => {
                Some(format!("{taken}, not even Ctrl-C typed on it; {key} ends the motion and gives it back"))
            }
            Some(key) => Some(format!("{taken}; {key} ends the motion and gives it back")),
            None if is_keyboard => {
                Some(format!("{taken}, not even Ctrl-C typed on it; end krait from another keyboard"))
            }
            None if is_mouse => Some(format!("{taken}; it is given back when krait ends")),
            None => None,
        }
    }

    fn button(&self, read: &ReadButton) -> Result<ProfileButton, Wrong> {
        if read.of >= N_BUTTONS || self.buttons.iter().any(|button| button.button == read.of) {
            return Err(wrong("of", "each button from 0 to 31 at most once", &read.of.to_string()));
        }
        match button_code(&read.from) {
            Some(code) if self.keys().any(|key| key == code) => {
                Err(wrong("from", "each button and key of the device at most once", &read.from))
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read {
    name: String,
    id: Option<String>,
    path: Option<PathBuf>,
    release: Option<String>,
    light: Option<String>,
    #[serde(default)]
    lights: ReadLights,
    rumble: Option<ReadRumble>,
    #[serde(default)]
    axis: Vec<ReadAxis>,
    #[serde(default)]
    button: Vec<ReadButton>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReadButton {
    of: u8,
    from: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AxisPlace;

    const GOOD: &str = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\nrange = [0, 1023]\nrest = 512\nnoise = 12\n[[axis]]\nof = \"y\"\nfrom = \"1\"\nsign = \"-\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n";
    const KEYS: &str = "name = \"Keys\"\nid = \"046d:c31c\"\nrelease = \"KEY_ESC\"\n[[axis]]\nof = \"y\"\nfrom = \"REL_WHEEL\"\nfull_counts_per_s = 60\n[[axis]]\nof = \"x\"\nplus = \"KEY_D\"\nminus = \"KEY_A\"\n[[axis]]\nof = \"z\"\nplus = \"KEY_S\"\nminus = \"KEY_W\"\n[[axis]]\nof = \"rz\"\nfrom = \"REL_HWHEEL\"\nfull_counts_per_s = 6\n[[button]]\nof = 0\nfrom = \"KEY_SPACE\"\n";

    /// A profile with one thing made wrong is refused with these words.
    fn refused(good: &str, from: &str, to: &str, words: &str) {
        assert!(good.contains(from), "{from}");
        let error = Profile::parse("stick.toml", &good.replacen(from, to, 1)).expect_err(words).to_string();
        assert!(error.starts_with("profile stick.toml, ") && error.contains(words), "{error}");
        assert!(!error.contains('\n') && error.contains("correct it"), "{error}");
    }

    #[test]
    fn a_profile_is_read_and_says_what_is_what() {
        let profile = Profile::parse("stick.toml", GOOD).expect("a profile");
        assert_eq!(profile.device, ProfileDevice::Id(0x046d, 0xc215));
        let place = AxisPlace { code: 0, range: Some([0, 1023]), rest: Some(512), noise: Some(12) };
        let x = ProfileAxis { axis_idx: 0, is_negated: false, from: AxisFrom::Place(place) };
        let y = ProfileAxis { axis_idx: 1, is_negated: true, from: AxisFrom::Place(AxisPlace::of(1)) };
        assert_eq!(profile.axes, [x, y]);
        assert_eq!(profile.buttons, [ProfileButton { button: 0, code: 0x120 }]);
        assert_eq!((profile.release, profile.warning()), (None, None), "a stick does nothing else anyway");
    }

    #[test]
    fn ways_and_keys_are_axes_and_a_keyboard_says_how_it_is_given_back() {
        let profile = Profile::parse("keys.toml", KEYS).expect("a profile");
        let way = AxisFrom::Way { code: 8, full_counts_per_s: 60.0 };
        let keys = AxisFrom::Keys { plus: 32, minus: 30, deflection_ratio: 0.5 };
        assert_eq!([0, 1].map(|idx| profile.axes[idx].from), [way, keys], "0.5 where nothing is said");
        assert_eq!((profile.release, profile.axes[1].name()), (Some(1), "KEY_D/KEY_A".to_owned()));
        let said = profile.warning().expect("a warning");
        assert!(
            said.contains("not even Ctrl-C") && said.contains("KEY_ESC ends the motion and gives it back"),
            "{said}"
        );
        let pedal = "name = \"Pedal\"\nid = \"0c45:7403\"\n[[button]]\nof = 0\nfrom = \"KEY_B\"\n";
        let said = Profile::parse("pedal.toml", pedal).expect("without a release").warning().expect("a warning");
        assert!(said.contains("from another keyboard"), "{said}");
    }

    #[test]
    fn a_mouse_or_keyboard_is_nobodys_until_its_node_is_named() {
        for name in ["mouse", "keyboard"] {
            let refused = Profile::of_device(Path::new(name), None).expect_err("which one?").to_string();
            assert!(refused.contains(name) && refused.contains("--node"), "{refused}");
            let node = Path::new("/dev/input/by-id/mine");
            let profile = Profile::of_device(Path::new(name), Some(node)).expect("named");
            assert_eq!(profile.device, ProfileDevice::Path(node.to_owned()));
            let said = profile.warning().expect("it says what it takes");
            assert!(said.contains("/dev/input/by-id/mine"), "{said}");
        }
        assert!(Profile::of_device(Path::new("pedal"), None).is_err());
        let pedal = Profile::of_device(Path::new("pedal"), Some(Path::new("/dev/input/by-id/foot"))).expect("named");
        assert_eq!(pedal.warning(), None, "it does nothing else anyway");
        assert!(Profile::of_device(Path::new("xbox-360"), None).is_ok());
        let own = "name = \"My mouse\"\n[[axis]]\nof = \"x\"\nfrom = \"REL_X\"\nfull_counts_per_s = 900\n";
        assert!(Profile::parse("own.toml", own).is_err(), "one's own names its device");
    }

    #[test]
    fn the_built_in_profiles_are_good_and_go_by_their_names() {
        let shipped = Profile::shipped().expect("good");
        assert_eq!(shipped.len(), SHIPPED.len());
        for (name, profile) in shipped {
            assert_eq!(Profile::load(Path::new(name)).expect("by its name"), profile);
            assert_eq!(
                (profile.axes.len() >= 3, profile.buttons.len()),
                (name != "pedal", 3),
                "presence, clutch and mark"
            );
            assert_eq!(profile.device == ProfileDevice::Unnamed, ["mouse", "keyboard", "pedal"].contains(&name));
        }
    }

    #[test]
    fn a_faulty_profile_is_refused_with_file_place_expectation_and_finding() {
        for (from, to, words) in [
            ("id = \"046d:c215\"", "id = \"46d:c215\"", "id: expected vendor:product"),
            ("id = \"046d:c215\"\n", "", "expected either id or path of the device, found neither"),
            ("id = \"046d:c215\"", "id = \"046d:c215\"\npath = \"/dev/input/event3\"", "found both"),
            ("\"x\"", "\"w\"", "axis 1, key of: expected x, y, z, rx, ry or rz, found \"w\""),
            ("\"ABS_X\"", "\"REL_X\"", "axis 1, key range: expected none: a way"),
            ("\"ABS_X\"", "\"ABS_XX\"", "axis 1, key from: expected an axis of the kernel"),
            ("sign = \"-\"", "full_counts_per_s = 9", "axis 2, key full_counts_per_s: expected it only for a way"),
            ("sign = \"-\"", "deflection = 0.5", "axis 2, key deflection: expected it only beside"),
            ("sign = \"-\"", "plus = \"KEY_A\"", "axis 2, key from: expected either `from`, or the two keys"),
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
            refused(GOOD, from, to, words);
        }
        for (from, to, words) in [
            (
                "full_counts_per_s = 60\n",
                "",
                "axis 1, key full_counts_per_s: expected the speed that is a full deflection, 1 to",
            ),
            ("full_counts_per_s = 60", "full_counts_per_s = 0", "found \"0\""),
            ("full_counts_per_s = 60", "full_counts_per_s = nan", "found \"NaN\""),
            ("minus = \"KEY_A\"\n", "", "axis 2, key from: expected either `from`, or the two keys `plus` and `minus`"),
            ("\"KEY_A\"", "\"KEY_D\"", "axis 2, key minus: expected another key"),
            ("\"KEY_A\"", "\"REL_X\"", "axis 2, key minus: expected a key of the kernel"),
            (
                "minus = \"KEY_A\"",
                "minus = \"KEY_A\"\ndeflection = 1.5",
                "key deflection: expected 0.05 to 1 of the full",
            ),
            ("minus = \"KEY_A\"", "minus = \"KEY_A\"\nrest = 5", "axis 2, key rest: expected none: keys have only"),
            (
                "\"KEY_S\"",
                "\"KEY_A\"",
                "axis 3, key of: expected each axis of hand and device, and each key, at most once",
            ),
            ("REL_HWHEEL", "REL_WHEEL", "axis 4, key of: expected each axis of hand and device"),
            ("REL_HWHEEL", "REL_WHEEL_HI_RES", "(a wheel by one of its two names)"),
            ("\"KEY_SPACE\"", "\"KEY_W\"", "button 1, key from: expected each button and key"),
            ("release = \"KEY_ESC\"\n", "", "key release: expected a key that gives the keyboard back"),
            ("\"KEY_ESC\"", "\"KEY_W\"", "key release: expected a key that is no axis and no button"),
            ("release", "light = \"LED_SCROLL\"\nrelease", "key light: expected a light of the kernel"),
            (
                "release",
                "lights = { limit = \"LED_CAPS\" }\nrelease",
                "key lights.limit: expected a light of the kernel",
            ),
            (
                "release",
                "light = \"LED_MUTE\"\nlights = { fault = \"LED_MUTE\" }\nrelease",
                "key lights.fault: expected each light",
            ),
            ("release", "lights = { taken = \"LED_MUTE\" }\nrelease", "line 3"),
            (
                "release",
                "lights = { load = \"LED_MUTE\", compensation = \"LED_MUTE\" }\nrelease",
                "key lights.compensation: expected each light",
            ),
            ("release", "rumble = { limit = 0.0 }\nrelease", "key rumble.limit: expected 0.05 to 1 of the strongest"),
            ("release", "rumble = { fault = nan }\nrelease", "key rumble.fault: expected 0.05 to 1 of the strongest"),
            ("release", "rumble = { load = 1.2 }\nrelease", "key rumble.load: expected 0.05 to 1 of the strongest"),
            ("release", "rumble = { engaged = 0.5 }\nrelease", "line 3"),
            ("release", "rumble = {}\nrelease", "key rumble: expected at least one of limit, fault, load"),
            ("\"KEY_ESC\"", "\"ESCAPE\"", "key release: expected a key of the kernel"),
        ] {
            refused(KEYS, from, to, words);
        }
        let nothing =
            Profile::parse("empty.toml", "name = \"x\"\nid = \"046d:c215\"\n").expect_err("nothing").to_string();
        assert!(nothing.contains("at least one [[axis]] or [[button]]"), "{nothing}");
    }
}
