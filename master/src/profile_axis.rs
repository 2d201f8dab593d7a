//! One axis of a profile: the hand's axis, and where on the device it comes from. Read from TOML, checked once.
//!
//! | on the device | keys | what it becomes |
//! |---|---|---|
//! | a place (`ABS_X`: stick, pedal, tablet) | `from`, `range`, `rest`, `noise` | how far it is from rest |
//! | a way (`REL_X`: mouse, wheel) | `from`, `full_counts_per_s` | how fast it is |
//! | two keys | `plus`, `minus`, `deflection` | which of them is down |

use crate::AXIS_NAMES;
use crate::evdev_names::{axis_code, axis_name, button_code, button_name, way_code, way_name};
use serde::Deserialize;

/// The way of a wheel and its finer twin: the kernel tells one turn on both.
const TWINS: [[&str; 2]; 2] = [["REL_WHEEL", "REL_WHEEL_HI_RES"], ["REL_HWHEEL", "REL_HWHEEL_HI_RES"]];
/// Slowest and fastest full speed of a way, counts/s.
const LEAST_FULL_COUNTS_PER_S: f64 = 1.0;
const MOST_FULL_COUNTS_PER_S: f64 = 1e6;
/// What a pressed key is of the full deflection where the profile does not say.
const DEFLECTION_RATIO: f64 = 0.5;
const LEAST_DEFLECTION_RATIO: f64 = 0.05;

/// One axis of the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileAxis {
    /// The hand's axis: x, y, z, rx, ry, rz = 0..=5.
    pub axis_idx: usize,
    /// Whether larger values are the hand's negative direction.
    pub is_negated: bool,
    /// Where on the device it comes from.
    pub from: AxisFrom,
}

/// Where on the device an axis comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisFrom {
    /// An absolute axis.
    Place(AxisPlace),
    /// A relative axis.
    Way {
        /// The kernel's number of it.
        code: u16,
        /// The speed that is the full deflection, counts/s, above 0.
        full_counts_per_s: f64,
    },
    /// Two keys; both down are none.
    Keys {
        /// The kernel's number of the key for the positive direction.
        plus: u16,
        /// The kernel's number of the key for the negative direction.
        minus: u16,
        /// What a pressed key is of the full deflection, 0.05..=1.
        deflection_ratio: f64,
    },
}

/// An absolute axis of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisPlace {
    /// The kernel's number of it.
    pub code: u16,
    /// Smallest and largest value, counts; none: as the kernel says.
    pub range: Option<[i32; 2]>,
    /// Value at rest, counts; none: the middle of the range.
    pub rest: Option<i32>,
    /// How far the value strays at rest, counts; none: as the kernel says.
    pub noise: Option<i32>,
}

impl AxisPlace {
    /// An axis of which the kernel tells the range and the noise.
    pub fn of(code: u16) -> Self {
        Self { code, range: None, rest: None, noise: None }
    }
}

impl ProfileAxis {
    /// What of the device it comes from, as a profile names it.
    pub fn name(&self) -> String {
        match self.from {
            AxisFrom::Place(place) => axis_name(place.code),
            AxisFrom::Way { code, .. } => way_name(code),
            AxisFrom::Keys { plus, minus, .. } => format!("{}/{}", button_name(plus), button_name(minus)),
        }
    }

    /// The absolute axis that it comes from, if it does.
    pub fn place(&self) -> Option<&AxisPlace> {
        if let AxisFrom::Place(place) = &self.from { Some(place) } else { None }
    }

    /// The keys that it comes from, none or two.
    pub fn keys(&self) -> impl Iterator<Item = u16> {
        let keys =
            if let AxisFrom::Keys { plus, minus, .. } = self.from { [Some(plus), Some(minus)] } else { [None; 2] };
        keys.into_iter().flatten()
    }

    /// Whether two axes come from the same of the device.
    fn shares_with(&self, other: &Self) -> bool {
        match (self.from, other.from) {
            (AxisFrom::Place(own), AxisFrom::Place(others)) => own.code == others.code,
            (AxisFrom::Way { .. }, AxisFrom::Way { .. }) => {
                let names = [self.name(), other.name()];
                names[0] == names[1]
                    || TWINS.iter().any(|twins| names.iter().all(|name| twins.contains(&name.as_str())))
            }
            _ => self.keys().any(|key| other.keys().any(|others| others == key)),
        }
    }
}

/// Key, what was expected, what was found.
pub(crate) type Wrong = (&'static str, &'static str, String);

pub(crate) fn wrong(key: &'static str, expected: &'static str, found: &str) -> Wrong {
    let shown: String = found.chars().take(40).collect();
    (key, expected, format!("{shown:?}"))
}

/// An axis as it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReadAxis {
    of: String,
    from: Option<String>,
    range: Option<[i32; 2]>,
    rest: Option<i32>,
    noise: Option<i32>,
    full_counts_per_s: Option<f64>,
    plus: Option<String>,
    minus: Option<String>,
    deflection: Option<f64>,
    #[serde(default = "plus")]
    sign: String,
}

fn plus() -> String {
    "+".to_owned()
}

impl ReadAxis {
    /// Checks it, beside the axes before it.
    pub(crate) fn checked(&self, before: &[ProfileAxis]) -> Result<ProfileAxis, Wrong> {
        let axis_idx = AXIS_NAMES.iter().position(|name| *name == self.of);
        let axis_idx = axis_idx.ok_or_else(|| wrong("of", "x, y, z, rx, ry or rz", &self.of))?;
        let from = self.source()?;
        let is_negated = match self.sign.as_str() {
            "+" => false,
            "-" => true,
            other => return Err(wrong("sign", "\"+\" or \"-\"", other)),
        };
        let axis = ProfileAxis { axis_idx, is_negated, from };
        if before.iter().any(|other| other.axis_idx == axis_idx || other.shares_with(&axis)) {
            let expected = "each axis of hand and device, and each key, at most once (a wheel by one of its two names)";
            return Err(wrong("of", expected, &self.of));
        }
        Ok(axis)
    }

    fn source(&self) -> Result<AxisFrom, Wrong> {
        let foreign = |keys: &[(&'static str, bool)], expected| {
            let found = keys.iter().find(|(_, is_there)| *is_there);
            found.map_or(Ok(()), |(key, _)| Err((*key, expected, "one".to_owned())))
        };
        let of_place =
            [("range", self.range.is_some()), ("rest", self.rest.is_some()), ("noise", self.noise.is_some())];
        let speed = ("full_counts_per_s", self.full_counts_per_s.is_some());
        let deflection = ("deflection", self.deflection.is_some());
        match (&self.from, &self.plus, &self.minus) {
            (Some(from), None, None) => {
                foreign(&[deflection], "it only beside `plus` and `minus`")?;
                if let Some(code) = way_code(from) {
                    foreign(&of_place, "none: a way has neither range nor rest, only `full_counts_per_s`")?;
                    return self.way(code);
                }
                foreign(&[speed], "it only for a way, as in from = \"REL_X\"")?;
                let expected = "an axis of the kernel as in \"ABS_X\" or \"REL_X\", or the number of an absolute one";
                axis_code(from).ok_or_else(|| wrong("from", expected, from)).and_then(|code| self.place(code))
            }
            (None, Some(plus), Some(minus)) => {
                foreign(&of_place, "none: keys have only `deflection`")?;
                foreign(&[speed], "it only for a way, as in from = \"REL_X\"")?;
                self.keys(plus, minus)
            }
            (from, ..) => {
                let found = if from.is_some() { "both" } else { "neither" };
                Err(("from", "either `from`, or the two keys `plus` and `minus`", found.to_owned()))
            }
        }
    }

    fn place(&self, code: u16) -> Result<AxisFrom, Wrong> {
        if let Some([low, high]) = self.range
            && low >= high
        {
            return Err(wrong(
                "range",
                "the smaller value first, and another one after it",
                &format!("[{low}, {high}]"),
            ));
        }
        if let (Some([low, high]), Some(rest)) = (self.range, self.rest)
            && !(low..=high).contains(&rest)
        {
            return Err(wrong("rest", "a value within the range", &rest.to_string()));
        }
        if let Some(noise) = self.noise {
            let widest = self.range.map_or(i64::from(i32::MAX), |[low, high]| (i64::from(high) - i64::from(low)) / 4);
            if noise < 0 || i64::from(noise) > widest {
                return Err(wrong("noise", "0 to a quarter of the range", &noise.to_string()));
            }
        }
        Ok(AxisFrom::Place(AxisPlace { code, range: self.range, rest: self.rest, noise: self.noise }))
    }

    fn way(&self, code: u16) -> Result<AxisFrom, Wrong> {
        let expected = "the speed that is a full deflection, 1 to 1000000 counts/s (a mouse: 2000, its wheel: 60)";
        match self.full_counts_per_s {
            Some(full_counts_per_s)
                if (LEAST_FULL_COUNTS_PER_S..=MOST_FULL_COUNTS_PER_S).contains(&full_counts_per_s) =>
            {
                Ok(AxisFrom::Way { code, full_counts_per_s })
            }
            Some(other) => Err(wrong("full_counts_per_s", expected, &other.to_string())),
            None => Err(("full_counts_per_s", expected, "nothing".to_owned())),
        }
    }

    fn keys(&self, plus: &str, minus: &str) -> Result<AxisFrom, Wrong> {
        let code_of = |key, text: &str| {
            button_code(text).ok_or_else(|| {
                wrong(key, "a key of the kernel as in \"KEY_D\" or \"BTN_DPAD_UP\", or its number", text)
            })
        };
        let (plus_code, minus_code) = (code_of("plus", plus)?, code_of("minus", minus)?);
        if plus_code == minus_code {
            return Err(wrong("minus", "another key than that of `plus`", minus));
        }
        let deflection_ratio = self.deflection.unwrap_or(DEFLECTION_RATIO);
        if !(LEAST_DEFLECTION_RATIO..=1.0).contains(&deflection_ratio) {
            let expected = "0.05 to 1 of the full deflection";
            return Err(wrong("deflection", expected, &deflection_ratio.to_string()));
        }
        Ok(AxisFrom::Keys { plus: plus_code, minus: minus_code, deflection_ratio })
    }
}
