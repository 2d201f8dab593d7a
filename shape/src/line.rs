//! One line of the format in docs/shapes.md: the header that a program begins with, and its shapes.

use krait_ipc::message::MAX_JOINTS;
use serde::Deserialize;

/// Longest line, bytes; a longer one is refused whole.
pub const MAX_LINE_BYTES: usize = 4096;
/// Version of the format.
const FORMAT: u32 = 1;

/// The first line: who measures, by which clock.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of the format, 1.
    pub krait_shapes: u32,
    /// The clock of every stamp.
    pub clock: SourceClock,
    /// Only for the clock `own`: CLOCK_MONOTONIC minus that clock, ns. Without it krait learns it from `sent_ns`.
    pub offset_ns: Option<i64>,
    /// The program's name, for sentences.
    #[serde(default)]
    pub source: String,
}

/// Whose clock the stamps are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SourceClock {
    /// CLOCK_MONOTONIC of this machine.
    Monotonic,
    /// CLOCK_REALTIME of this machine, or of one that is synchronised to it.
    Realtime,
    /// Any other clock that counts nanoseconds.
    Own,
}

/// Every other line: a measured shape.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct MeasuredLine {
    exposure_ns: i64,
    sent_ns: Option<i64>,
    frame: Option<u64>,
    valid: Option<bool>,
    bend_rad: Option<[Option<f64>; 2]>,
    covariance_rad2: Option<[Option<f64>; 3]>,
    joints_rad: Option<Vec<Option<f64>>>,
    variances_rad2: Option<Vec<Option<f64>>>,
}

/// A line that has been read.
#[derive(Clone, Debug, PartialEq)]
pub enum ShapeLine {
    /// The header; a later one begins a stream anew.
    Header(Header),
    /// A shape.
    Shape(Measured),
}

/// A measured shape by the clock of its program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Instant of exposure, ns.
    pub exposure_ns: i64,
    /// When the line was sent, ns, if the program says so.
    pub sent_ns: Option<i64>,
    /// The program's own number of the frame, if it counts.
    pub frame: Option<u64>,
    /// What it shows; `None`: the machine was not to be seen.
    pub value: Option<Value>,
}

/// What a frame shows. Numbers that the line wrote as `null` are NaN here, and refused later.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// The bend vector, rad, and its covariance (xx, xy, yy), rad^2.
    Bend {
        /// The bend vector, rad.
        bend_rad: [f64; 2],
        /// Its covariance, if stated.
        covariance_rad2: Option<[f64; 3]>,
    },
    /// Positions of joints, rad, and their variances, rad^2.
    Joints {
        /// How many.
        n: usize,
        /// Their positions, rad; 0 behind the last.
        positions_rad: [f64; MAX_JOINTS],
        /// Their variances, if stated; 0 behind the last.
        variances_rad2: Option<[f64; MAX_JOINTS]>,
    },
}

/// A line is no line of the format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// No JSON, or not with these keys.
    #[error("expected one JSON object as in docs/shapes.md, found: {0}")]
    Malformed(String),
    /// `NaN` and `Infinity` are no JSON, but several programs write them.
    #[error("it holds a number that is not finite; a frame without a shape says \"valid\": false")]
    NotFinite,
    /// Another version of the format.
    #[error("expected \"krait_shapes\": {FORMAT}, found {0}; this program speaks version {FORMAT} of the format")]
    Version(u32),
    /// It holds neither a bend nor joints, or both, or parts that do not fit.
    #[error("{0}")]
    Contradiction(&'static str),
}

impl ShapeLine {
    /// Reads a line without its end.
    ///
    /// # Errors
    /// [`LineError`] in one sentence, which begins behind the line's number.
    pub fn parse(bytes: &[u8]) -> Result<Self, LineError> {
        let text = core::str::from_utf8(bytes).map_err(|error| LineError::Malformed(error.to_string()))?;
        if text.contains("\"krait_shapes\"") {
            let header: Header = serde_json::from_str(text).map_err(|error| malformed(text, &error))?;
            return header.checked().map(Self::Header);
        }
        let line: MeasuredLine = serde_json::from_str(text).map_err(|error| malformed(text, &error))?;
        let value = line.value()?;
        Ok(Self::Shape(Measured { exposure_ns: line.exposure_ns, sent_ns: line.sent_ns, frame: line.frame, value }))
    }
}

fn malformed(text: &str, error: &serde_json::Error) -> LineError {
    let is_not_finite =
        ["NaN", "Infinity"].iter().any(|word| text.contains(word)) || error.to_string().contains("number out of range");
    if is_not_finite { LineError::NotFinite } else { LineError::Malformed(error.to_string()) }
}

impl Header {
    fn checked(self) -> Result<Self, LineError> {
        if self.krait_shapes != FORMAT {
            return Err(LineError::Version(self.krait_shapes));
        }
        if self.offset_ns.is_some() && self.clock != SourceClock::Own {
            return Err(LineError::Contradiction("\"offset_ns\" is for the clock \"own\" only; leave it out"));
        }
        Ok(self)
    }
}

impl MeasuredLine {
    fn value(&self) -> Result<Option<Value>, LineError> {
        if self.valid == Some(false) {
            return Ok(None);
        }
        match (&self.bend_rad, &self.joints_rad) {
            (Some(bend), None) if self.variances_rad2.is_none() => Ok(Some(Value::Bend {
                bend_rad: bend.map(number),
                covariance_rad2: self.covariance_rad2.map(|covariance| covariance.map(number)),
            })),
            (None, Some(joints)) if self.covariance_rad2.is_none() => {
                let variances_rad2 = self.variances_rad2.as_deref();
                if variances_rad2.is_some_and(|variances| variances.len() != joints.len()) {
                    return Err(LineError::Contradiction("\"variances_rad2\" must have one number for each joint"));
                }
                let (n, positions_rad) = (joints.len(), padded(joints)?);
                Ok(Some(Value::Joints { n, positions_rad, variances_rad2: variances_rad2.map(padded).transpose()? }))
            }
            (Some(_), Some(_)) => Err(LineError::Contradiction("it holds a bend and joints; expected one of them")),
            (None, None) => Err(LineError::Contradiction(
                "it holds neither \"bend_rad\" nor \"joints_rad\"; a frame without a shape says \"valid\": false",
            )),
            _ => Err(LineError::Contradiction(
                "\"covariance_rad2\" belongs to \"bend_rad\", and \"variances_rad2\" to \"joints_rad\"",
            )),
        }
    }
}

fn number(value: Option<f64>) -> f64 {
    value.unwrap_or(f64::NAN)
}

fn padded(values: &[Option<f64>]) -> Result<[f64; MAX_JOINTS], LineError> {
    if !(1..=MAX_JOINTS).contains(&values.len()) {
        return Err(LineError::Contradiction("\"joints_rad\" must have 1 to 8 numbers"));
    }
    let mut all = [0.0; MAX_JOINTS];
    all.iter_mut().zip(values).for_each(|(own, value)| *own = number(*value));
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> LineError {
        ShapeLine::parse(text.as_bytes()).expect_err(text)
    }

    #[test]
    fn the_lines_of_the_documentation_are_read() {
        let page = include_str!("../../docs/shapes.md");
        let lines: Vec<&str> = page.lines().filter(|line| line.starts_with('{')).collect();
        assert!(lines.len() >= 5, "{lines:?}");
        for line in lines {
            ShapeLine::parse(line.as_bytes()).unwrap_or_else(|error| panic!("{line}: {error}"));
        }
    }

    #[test]
    fn a_shape_is_read_with_all_that_it_says() {
        let text = r#"{"exposure_ns": 5, "sent_ns": 7, "frame": 3, "bend_rad": [0.1, -2e-1], "covariance_rad2": [1e-5, 0, 2e-5]}"#;
        let bend = Value::Bend { bend_rad: [0.1, -0.2], covariance_rad2: Some([1e-5, 0.0, 2e-5]) };
        let expected = Measured { exposure_ns: 5, sent_ns: Some(7), frame: Some(3), value: Some(bend) };
        assert_eq!(ShapeLine::parse(text.as_bytes()), Ok(ShapeLine::Shape(expected)));
        let lost = ShapeLine::parse(br#"{"exposure_ns": 5, "valid": false}"#).expect("a lost view");
        assert_eq!(lost, ShapeLine::Shape(Measured { exposure_ns: 5, sent_ns: None, frame: None, value: None }));
    }

    #[test]
    fn numbers_that_are_not_finite_are_told_apart_from_nonsense() {
        for text in [
            r#"{"exposure_ns": 5, "bend_rad": [NaN, 0]}"#,
            r#"{"exposure_ns": 5, "bend_rad": [-Infinity, 0]}"#,
            r#"{"exposure_ns": 5, "bend_rad": [1e999, 0]}"#,
        ] {
            assert_eq!(error(text), LineError::NotFinite, "{text}");
        }
        for text in ["", "[]", "{", "{\"exposure_ns\": \"five\"}", "{\"exposure_ns\": 5, \"bent_rad\": [0, 0]}"] {
            assert!(matches!(error(text), LineError::Malformed(_)), "{text}");
        }
        assert!(matches!(ShapeLine::parse(b"\xff\xfe"), Err(LineError::Malformed(_))));
    }

    #[test]
    fn a_header_of_another_version_and_parts_that_do_not_fit_are_refused() {
        assert_eq!(error(r#"{"krait_shapes": 2, "clock": "own"}"#), LineError::Version(2));
        for text in [
            r#"{"krait_shapes": 1, "clock": "monotonic", "offset_ns": 3}"#,
            r#"{"exposure_ns": 5}"#,
            r#"{"exposure_ns": 5, "bend_rad": [0, 0], "joints_rad": [0]}"#,
            r#"{"exposure_ns": 5, "bend_rad": [0, 0], "variances_rad2": [0]}"#,
            r#"{"exposure_ns": 5, "joints_rad": []}"#,
            r#"{"exposure_ns": 5, "joints_rad": [0, 0], "variances_rad2": [0]}"#,
            r#"{"exposure_ns": 5, "joints_rad": [0, 0, 0, 0, 0, 0, 0, 0, 0]}"#,
        ] {
            assert!(matches!(error(text), LineError::Contradiction(_)), "{text}: {:?}", error(text));
        }
    }
}
