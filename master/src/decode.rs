//! Decodes SpaceMouse reports, because every layout, length and value that comes from a device is untrusted.
//!
//! | id | length | content |
//! |---|---|---|
//! | 1 | 7 | split layout: X, Y, Z |
//! | 1 | 13 | combined layout: X, Y, Z, Rx, Ry, Rz |
//! | 2 | 7 | split layout: Rx, Ry, Rz |
//! | 3 | 2..=7 | buttons, bit n = button n; bits past the 32nd are ignored |
//! | 0x17 | 2 or 3 | battery charge 0..=100 %, then vendor bits |
//! | 4 (out) | 2 | LED: 1 on, 0 off |
//!
//! Axes are little-endian `i16` counts. The layout is told by the length of each report, so a device may even change it.

use crate::RawReport;

/// Logical maximum of every axis: a full deflection, counts.
pub const AXIS_LIMIT_COUNTS: i16 = 350;

/// How far beyond [`AXIS_LIMIT_COUNTS`] a value may lie before the report is refused, counts. Worn devices overshoot
/// slightly; a value further out is a broken report. What lies within the margin counts as a full deflection.
pub const AXIS_MARGIN_COUNTS: i16 = 50;

const ID_TRANSLATION: u8 = 1;
const ID_ROTATION: u8 = 2;
const ID_BUTTONS: u8 = 3;
const ID_LED: u8 = 4;
const ID_BATTERY: u8 = 0x17;

/// The output report that switches the device's light.
pub fn led_report(is_on: bool) -> [u8; 2] {
    [ID_LED, u8::from(is_on)]
}

/// A report in which only these buttons may be down; every other report as it is.
pub(crate) fn with_buttons(report: RawReport, kept: u32) -> RawReport {
    let mut bytes = [0; RawReport::MAX_BYTES];
    let len = report.as_bytes().len();
    bytes[..len].copy_from_slice(report.as_bytes());
    if bytes[0] == ID_BUTTONS {
        for (byte, kept) in bytes[1..].iter_mut().zip(kept.to_le_bytes()) {
            *byte &= kept;
        }
    }
    RawReport::clipped(&bytes[..len])
}

/// How a device puts its six axes into reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Older and wired devices: translation (id 1) and rotation (id 2) in turn.
    Split,
    /// Newer and wireless devices: all six axes in one report (id 1).
    Combined,
    /// No device: packets of a pose sender.
    Pose,
}

/// A report's content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HidReport {
    /// X, Y, Z of the split layout, counts.
    Translation([i16; 3]),
    /// Rx, Ry, Rz of the split layout, counts.
    Rotation([i16; 3]),
    /// X, Y, Z, Rx, Ry, Rz of the combined layout, counts.
    Motion([i16; 6]),
    /// Buttons, bit n = button n.
    Buttons(u32),
    /// Charge of the battery, 0..=100 %.
    Battery {
        /// Charge, percent.
        charge_percent: u8,
    },
}

/// Why a report was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Not even an id.
    Empty,
    /// An id that no known device sends.
    UnknownId {
        /// The id.
        id: u8,
    },
    /// Fewer bytes than the id needs.
    Short {
        /// The id.
        id: u8,
        /// Bytes found, id included.
        n_bytes: usize,
    },
    /// More bytes than the id has.
    Long {
        /// The id.
        id: u8,
        /// Bytes found, id included.
        n_bytes: usize,
    },
    /// An axis beyond limit and margin (counts), or a battery charge above 100 %.
    OutOfRange {
        /// The id.
        id: u8,
        /// The value.
        value: i16,
    },
}

impl HidReport {
    /// Decodes one report.
    ///
    /// # Errors
    /// [`Refusal`], for every byte string that is not a report of the table above.
    ///
    /// # Real-time
    /// No allocation, no blocking, at most six values.
    pub fn decode(bytes: &[u8]) -> Result<Self, Refusal> {
        let (&id, body) = bytes.split_first().ok_or(Refusal::Empty)?;
        let n_bytes = bytes.len();
        let (short, long) = (Refusal::Short { id, n_bytes }, Refusal::Long { id, n_bytes });
        match (id, n_bytes) {
            (ID_TRANSLATION, 7) => axes(id, body).map(Self::Translation),
            (ID_TRANSLATION, 13) => axes(id, body).map(Self::Motion),
            (ID_ROTATION, 7) => axes(id, body).map(Self::Rotation),
            (ID_BUTTONS, 2..=7) => Ok(Self::Buttons(buttons(body))),
            (ID_BATTERY, 2..=3) if body[0] <= 100 => Ok(Self::Battery { charge_percent: body[0] }),
            (ID_BATTERY, 2..=3) => Err(Refusal::OutOfRange { id, value: i16::from(body[0]) }),
            (ID_TRANSLATION, 0..=12) | (ID_ROTATION, 0..=6) | (ID_BUTTONS | ID_BATTERY, 0..=1) => Err(short),
            (ID_TRANSLATION | ID_ROTATION | ID_BUTTONS | ID_BATTERY, _) => Err(long),
            _ => Err(Refusal::UnknownId { id }),
        }
    }

    /// The report as a device sends it; buttons in the short form of two bytes where they fit.
    pub fn encode(self) -> RawReport {
        let mut bytes = [0_u8; 13];
        let n_bytes = match self {
            Self::Translation(counts) => put(&mut bytes, ID_TRANSLATION, &counts),
            Self::Rotation(counts) => put(&mut bytes, ID_ROTATION, &counts),
            Self::Motion(counts) => put(&mut bytes, ID_TRANSLATION, &counts),
            Self::Buttons(bits) => {
                bytes[0] = ID_BUTTONS;
                bytes[1..5].copy_from_slice(&bits.to_le_bytes());
                if bits <= u32::from(u16::MAX) { 3 } else { 5 }
            }
            Self::Battery { charge_percent } => {
                bytes[..2].copy_from_slice(&[ID_BATTERY, charge_percent]);
                3
            }
        };
        RawReport::clipped(&bytes[..n_bytes])
    }

    /// Whether the report tells where the cap is.
    pub fn is_motion(self) -> bool {
        matches!(self, Self::Translation(_) | Self::Rotation(_) | Self::Motion(_))
    }
}

fn axes<const N: usize>(id: u8, body: &[u8]) -> Result<[i16; N], Refusal> {
    let mut counts = [0_i16; N];
    for (value, pair) in counts.iter_mut().zip(body.chunks_exact(2)) {
        *value = i16::from_le_bytes([pair[0], pair[1]]);
        if value.unsigned_abs() > (AXIS_LIMIT_COUNTS + AXIS_MARGIN_COUNTS).unsigned_abs() {
            return Err(Refusal::OutOfRange { id, value: *value });
        }
    }
    Ok(counts)
}

fn buttons(body: &[u8]) -> u32 {
    let mut bits = [0_u8; 4];
    let n_bytes = body.len().min(4);
    bits[..n_bytes].copy_from_slice(&body[..n_bytes]);
    u32::from_le_bytes(bits)
}

fn put(bytes: &mut [u8; 13], id: u8, counts: &[i16]) -> usize {
    bytes[0] = id;
    for (pair, value) in bytes[1..].chunks_exact_mut(2).zip(counts) {
        pair.copy_from_slice(&value.to_le_bytes());
    }
    1 + 2 * counts.len()
}
