//! Keeps what the reports so far have said, and counts what was refused, so that one broken report never spoils the next.

use crate::{HidReport, Layout, Refusal};

/// How many reports were decoded, and how many were refused for which reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReportCounts {
    /// Reports decoded.
    pub n_decoded: u64,
    /// Reports without an id.
    pub n_empty: u64,
    /// Reports of an unknown id.
    pub n_unknown: u64,
    /// Reports with too few bytes.
    pub n_short: u64,
    /// Reports with too many bytes.
    pub n_long: u64,
    /// Reports with a value out of range.
    pub n_out_of_range: u64,
}

impl ReportCounts {
    /// All reports that were refused.
    pub fn n_refused(&self) -> u64 {
        self.n_empty + self.n_unknown + self.n_short + self.n_long + self.n_out_of_range
    }

    /// Both together.
    pub(crate) fn plus(self, other: &Self) -> Self {
        Self {
            n_decoded: self.n_decoded + other.n_decoded,
            n_empty: self.n_empty + other.n_empty,
            n_unknown: self.n_unknown + other.n_unknown,
            n_short: self.n_short + other.n_short,
            n_long: self.n_long + other.n_long,
            n_out_of_range: self.n_out_of_range + other.n_out_of_range,
        }
    }
}

/// What is known of the device's axes, buttons and battery from its reports so far.
///
/// In the split layout a sample is whole with its rotation half, yet each half is used at once: waiting for the other half
/// would add 8 ms to the way from hand to snake and gain nothing, since the halves move independently.
#[derive(Clone, Copy, Debug, Default)]
pub struct Decoder {
    axes: [i16; 6],
    buttons: u32,
    charge_percent: Option<u8>,
    layout: Option<Layout>,
    counts: ReportCounts,
}

impl Decoder {
    /// Takes one report in; a refused one changes nothing but the counts.
    ///
    /// # Errors
    /// As [`HidReport::decode`].
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_report(&mut self, bytes: &[u8]) -> Result<HidReport, Refusal> {
        let report = HidReport::decode(bytes).inspect_err(|refusal| self.count(*refusal))?;
        self.counts.n_decoded += 1;
        match report {
            HidReport::Translation(counts) => self.put_axes(0, &counts, Layout::Split),
            HidReport::Rotation(counts) => self.put_axes(3, &counts, Layout::Split),
            HidReport::Motion(counts) => self.put_axes(0, &counts, Layout::Combined),
            HidReport::Buttons(bits) => self.buttons = bits,
            HidReport::Battery { charge_percent } => self.charge_percent = Some(charge_percent),
        }
        Ok(report)
    }

    /// The newest axes X, Y, Z, Rx, Ry, Rz, counts, as the device sent them (at most limit plus margin).
    pub fn axes(&self) -> [i16; 6] {
        self.axes
    }

    /// The buttons, bit n = button n.
    pub fn buttons(&self) -> u32 {
        self.buttons
    }

    /// The newest charge of the battery, percent; `None` for a device that has not told.
    pub fn charge_percent(&self) -> Option<u8> {
        self.charge_percent
    }

    /// The layout of the newest motion report.
    pub fn layout(&self) -> Option<Layout> {
        self.layout
    }

    /// What was decoded and refused so far.
    pub fn counts(&self) -> &ReportCounts {
        &self.counts
    }

    /// Forgets axes and buttons: another device, or the same one anew, starts at rest.
    pub fn forget_device(&mut self) {
        *self = Self { counts: self.counts, ..Self::default() };
    }

    fn put_axes(&mut self, first_idx: usize, counts: &[i16], layout: Layout) {
        self.axes[first_idx..first_idx + counts.len()].copy_from_slice(counts);
        self.layout = Some(layout);
    }

    fn count(&mut self, refusal: Refusal) {
        let counts = &mut self.counts;
        let counter = match refusal {
            Refusal::Empty => &mut counts.n_empty,
            Refusal::UnknownId { .. } => &mut counts.n_unknown,
            Refusal::Short { .. } => &mut counts.n_short,
            Refusal::Long { .. } => &mut counts.n_long,
            Refusal::OutOfRange { .. } => &mut counts.n_out_of_range,
        };
        *counter += 1;
    }
}
