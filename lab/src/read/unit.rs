//! Units that a column's name may carry, and what a value in them is in SI units and radians.

/// What a number counts; only units of the same quantity can be converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dimension {
    Time,
    Length,
    Angle,
    Force,
    Temperature,
    Number,
}

/// A unit: value in SI = value * `factor` + `shift`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    /// The end of a column's name.
    pub suffix: &'static str,
    pub dimension: Dimension,
    pub factor: f64,
    pub shift: f64,
}

const DEG: f64 = std::f64::consts::PI / 180.0;

const UNITS: [Unit; 18] = [
    unit("s", Dimension::Time, 1.0),
    unit("ms", Dimension::Time, 1e-3),
    unit("us", Dimension::Time, 1e-6),
    unit("ns", Dimension::Time, 1e-9),
    unit("m", Dimension::Length, 1.0),
    unit("cm", Dimension::Length, 1e-2),
    unit("mm", Dimension::Length, 1e-3),
    unit("um", Dimension::Length, 1e-6),
    unit("rad", Dimension::Angle, 1.0),
    unit("mrad", Dimension::Angle, 1e-3),
    unit("deg", Dimension::Angle, DEG),
    unit("n", Dimension::Force, 1.0),
    unit("mn", Dimension::Force, 1e-3),
    unit("kn", Dimension::Force, 1e3),
    unit("c", Dimension::Temperature, 1.0),
    Unit { suffix: "k", dimension: Dimension::Temperature, factor: 1.0, shift: -273.15 },
    unit("1", Dimension::Number, 1.0),
    unit("percent", Dimension::Number, 1e-2),
];

/// Other ways to write them.
const ALIASES: [(&str, &str); 29] = [
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("millisecond", "ms"),
    ("milliseconds", "ms"),
    ("usec", "us"),
    ("\u{b5}s", "us"),
    ("\u{3bc}s", "us"),
    ("microseconds", "us"),
    ("nsec", "ns"),
    ("nanosec", "ns"),
    ("nanoseconds", "ns"),
    ("meter", "m"),
    ("metre", "m"),
    ("\u{b5}m", "um"),
    ("\u{3bc}m", "um"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("\u{b0}", "deg"),
    ("newton", "n"),
    ("celsius", "c"),
    ("degc", "c"),
    ("\u{b0}c", "c"),
    ("kelvin", "k"),
    ("%", "percent"),
];

const fn unit(suffix: &'static str, dimension: Dimension, factor: f64) -> Unit {
    Unit { suffix, dimension, factor, shift: 0.0 }
}

impl Unit {
    /// The unit with this suffix, in any case and by any of its names.
    pub(crate) fn from_suffix(suffix: &str) -> Option<Self> {
        let alias = ALIASES.iter().find(|(alias, _)| alias.eq_ignore_ascii_case(suffix));
        let suffix = alias.map_or(suffix, |(_, own)| own);
        UNITS.into_iter().find(|unit| unit.suffix.eq_ignore_ascii_case(suffix))
    }
}

impl Dimension {
    /// The suffixes of its units, for a sentence.
    pub(crate) fn suffixes(self) -> String {
        let names: Vec<&str> = UNITS.iter().filter(|unit| unit.dimension == self).map(|unit| unit.suffix).collect();
        names.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_convert_to_si_and_radians() {
        let si = |suffix, value: f64| Unit::from_suffix(suffix).map(|u| value * u.factor + u.shift);
        assert_eq!(si("deg", 180.0), Some(std::f64::consts::PI));
        assert_eq!(si("mm", 2.0), Some(0.002));
        assert_eq!(si("K", 273.15), Some(0.0));
        assert_eq!(si("\u{b0}", 180.0), si("Degrees", 180.0));
        assert_eq!(si("msec", 5.0), Some(0.005));
        assert_eq!(si("inch", 1.0), None);
    }
}
