//! The types of messages that hold a robot's joints and poses, and the columns that they become.

use super::cdr::Cdr;

/// A type of messages that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    JointState,
    PoseStamped,
    Float64,
    Float64MultiArray,
}

const KINDS: [(&str, Kind); 4] = [
    ("sensor_msgs/msg/JointState", Kind::JointState),
    ("geometry_msgs/msg/PoseStamped", Kind::PoseStamped),
    ("std_msgs/msg/Float64", Kind::Float64),
    ("std_msgs/msg/Float64MultiArray", Kind::Float64MultiArray),
];

/// What a message holds: its header's stamp, if it has a header, and values with the ends of their columns' names.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Values {
    pub stamp_ns: Option<i64>,
    pub cells: Vec<(String, f64)>,
}

impl Kind {
    pub(super) fn of(schema: &str) -> Option<Self> {
        KINDS.iter().find(|(name, _)| *name == schema).map(|(_, kind)| *kind)
    }

    /// The types that are read, for a sentence.
    pub(super) fn all() -> String {
        KINDS.map(|(name, _)| name).join(", ")
    }

    /// Decodes a message.
    pub(super) fn decode(self, payload: &[u8]) -> Result<Values, String> {
        let mut cdr = Cdr::new(payload)?;
        Ok(match self {
            Self::JointState => Values { stamp_ns: Some(header(&mut cdr)?), cells: joints(&mut cdr)? },
            Self::PoseStamped => Values { stamp_ns: Some(header(&mut cdr)?), cells: pose(&mut cdr)? },
            Self::Float64 => Values { stamp_ns: None, cells: vec![("data".to_owned(), cdr.f64()?)] },
            Self::Float64MultiArray => Values { stamp_ns: None, cells: array(&mut cdr)? },
        })
    }
}

fn header(cdr: &mut Cdr) -> Result<i64, String> {
    let (seconds, nanoseconds) = (cdr.i32()?, cdr.u32()?);
    cdr.text()?;
    Ok(i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds))
}

fn joints(cdr: &mut Cdr) -> Result<Vec<(String, f64)>, String> {
    let n = cdr.count(4)?;
    let names = (0..n).map(|_| cdr.text()).collect::<Result<Vec<_>, _>>()?;
    let mut cells = Vec::new();
    for (what, unit) in [("position", "rad"), ("velocity", "rad/s"), ("effort", "Nm")] {
        let values = cdr.f64s()?;
        if !values.is_empty() && values.len() != names.len() {
            return Err(format!("it has {} joints and {} values of {what}", names.len(), values.len()));
        }
        cells.extend(names.iter().zip(values).map(|(name, value)| (format!("{name}/{what} [{unit}]"), value)));
    }
    Ok(cells)
}

fn pose(cdr: &mut Cdr) -> Result<Vec<(String, f64)>, String> {
    const NAMES: [&str; 7] = [
        "position/x [m]",
        "position/y [m]",
        "position/z [m]",
        "orientation/x",
        "orientation/y",
        "orientation/z",
        "orientation/w",
    ];
    let mut cells = Vec::with_capacity(NAMES.len() + 2);
    for name in NAMES {
        cells.push((name.to_owned(), cdr.f64()?));
    }
    if let [.., (_, x), (_, y), (_, z), (_, w)] = *cells.as_slice() {
        let [bend_x, bend_y] = bend([x, y, z, w]);
        cells.push(("bend_x [rad]".to_owned(), bend_x));
        cells.push(("bend_y [rad]".to_owned(), bend_y));
    }
    Ok(cells)
}

/// Bend vector of a tip, rad, from its orientation in the base (quaternion x, y, z, w): how far its z axis is off the base's.
///
/// The bending plane's azimuth in the base is minus the angle of the vector (docs/NOTATION.md).
fn bend([x, y, z, w]: [f64; 4]) -> [f64; 2] {
    let axis = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w + z * z - x * x - y * y];
    let across = axis[0].hypot(axis[1]);
    let angle = across.atan2(axis[2]);
    let per = if across > 0.0 { angle / across } else { 0.0 };
    [axis[0] * per, -axis[1] * per]
}

fn array(cdr: &mut Cdr) -> Result<Vec<(String, f64)>, String> {
    let n_dimensions = cdr.count(12)?;
    for _ in 0..n_dimensions {
        cdr.text()?;
        cdr.u32()?;
        cdr.u32()?;
    }
    let offset = cdr.u32()? as usize;
    let values = cdr.f64s()?;
    Ok(values.into_iter().skip(offset).enumerate().map(|(k, value)| (format!("data/{k}"), value)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tip_that_leans_has_the_bend_of_its_axis() {
        let half = 0.25_f64;
        let [x, y] = bend([0.0, half.sin(), 0.0, half.cos()]);
        assert!((x - 0.5).abs() < 1e-12 && y.abs() < 1e-12, "{x} {y}");
        // About x, the axis goes to -y: azimuth -90 degrees, so delta is +90.
        let [x, y] = bend([half.sin(), 0.0, 0.0, half.cos()]);
        assert!(x.abs() < 1e-12 && (y - 0.5).abs() < 1e-12, "{x} {y}");
        assert_eq!(bend([0.0, 0.0, 1.0, 0.0]), [0.0, 0.0]);
    }
}
