//! HID report recordings: raw reports with stamps, as text that a person can read, compare and cut.
//!
//! ```text
//! krait-report-recording 1
//! device 046d:c626
//! layout split
//! note anything that a reader should know; any number of note lines, here or between reports
//! reports
//! 0 01000000000000
//! 8003150 02000000000000
//! end 2
//! ```
//!
//! Where further devices were beside the hand controller, there is a line `beside <vid>:<pid>` for each of them after `layout`, and a report
//! of the first of them is `stamp_ns 1:hexbytes`, of the second `stamp_ns 2:hexbytes`, of the third `stamp_ns 3:hexbytes`.
//!
//! Where a device was unplugged, there is `unplugged` in the place of the bytes, and `plugged` where it was there again.
//!
//! A report line is `stamp_ns hexbytes`: nanoseconds since the first line, one space, the report's 1 to 80 bytes in
//! lower-case hexadecimal with its id first. The first stamp is 0, stamps never run backwards. `layout` is `split`,
//! `combined` or `unknown`, which informs a person, for the decoder tells the layout by each report; or `pose`: the reports
//! are packets of a pose sender. `end` carries the number of reports, so that a truncated file is noticed. Lines end with a
//! line feed and hold at most 200 bytes; a file holds at most 64 MB and is read into memory at load. Reports are not decoded here: a recording of a faulty device is a good recording.

use crate::recording_lines::{DAMAGED, Lines, note};
use crate::{Layout, MasterError, Plug, RawReport};
use krait_ipc::input;
use std::io;
use std::path::Path;

pub(crate) const MAGIC: &str = "krait-report-recording 1";
const MAX_BYTES: u64 = 64 * 1024 * 1024;

/// The shipped recording; `examples/generate_recording` makes it.
const SHIPPED_TEXT: &str = include_str!("../recordings/default.krr");

/// The lines before the first report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingHeader {
    /// USB vendor id.
    pub vendor_id: u16,
    /// USB product id.
    pub product_id: u16,
    /// How the device lays out its reports; `None` when that was not known.
    pub layout: Option<Layout>,
    /// Vendor and product id of each device beside it, at most three.
    pub beside: Vec<(u16, u16)>,
    /// What a reader should know, one line each; notes between reports are gathered here too.
    pub notes: Vec<String>,
}

/// A recording in memory.
#[derive(Clone, Debug)]
pub struct HidRecording {
    header: RecordingHeader,
    events: Vec<StampedEvent>,
}

/// What came of a device.
#[derive(Clone, Copy, Debug)]
pub enum RecordedEvent {
    /// It sent this.
    Report(RawReport),
    /// It was unplugged or plugged in.
    Plug(Plug),
}

/// What came and when, nanoseconds since the first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StampedEvent {
    pub(crate) stamp_ns: i64,
    /// Of which of the hand's devices, 0 is the hand controller.
    pub(crate) device: usize,
    pub(crate) event: RecordedEvent,
}

impl StampedEvent {
    fn report(&self) -> Option<(i64, usize, &[u8])> {
        match &self.event {
            RecordedEvent::Report(report) => Some((self.stamp_ns, self.device, report.as_bytes())),
            RecordedEvent::Plug(_) => None,
        }
    }
}

impl HidRecording {
    /// The recording that is built into the binary: 31 s of a synthetic operator (see its notes).
    ///
    /// # Errors
    /// [`MasterError::Recording`], never for a binary that passed its tests.
    pub fn shipped() -> Result<Self, MasterError> {
        Self::parse("recordings/default.krr (built in)", SHIPPED_TEXT.as_bytes())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`MasterError::File`], [`MasterError::TooLarge`] or [`MasterError::Recording`].
    pub fn load(path: &Path) -> Result<Self, MasterError> {
        Self::parse(&path.display().to_string(), &read_bounded(path, MAX_BYTES)?)
    }

    /// Reads a recording from memory; `file` names it in error sentences.
    ///
    /// # Errors
    /// [`MasterError::Recording`] for the first line that is wrong.
    pub fn parse(file: &str, bytes: &[u8]) -> Result<Self, MasterError> {
        let mut lines = Lines::new(file, bytes);
        lines.magic()?;
        let (vendor_id, product_id) = lines.device()?;
        let layout = lines.layout()?;
        let (beside, notes) = (Vec::new(), Vec::new());
        let header = RecordingHeader { vendor_id, product_id, layout, beside, notes };
        let mut recording = Self { header, events: Vec::new() };
        recording.read_notes(&mut lines)?;
        recording.read_reports(&mut lines)?;
        Ok(recording)
    }

    /// The header.
    pub fn header(&self) -> &RecordingHeader {
        &self.header
    }

    /// Number of reports.
    pub fn n_reports(&self) -> usize {
        self.reports().count()
    }

    /// Time from what came first to what came last, ns.
    pub fn duration_ns(&self) -> i64 {
        self.events.last().map_or(0, |own| own.stamp_ns)
    }

    /// The reports with their stamps, nanoseconds since what came first.
    pub fn reports(&self) -> impl Iterator<Item = (i64, &[u8])> {
        self.events.iter().filter_map(StampedEvent::report).map(|(stamp_ns, _, bytes)| (stamp_ns, bytes))
    }

    /// All that came: stamp, nanoseconds since what came first, and of which of the hand's devices: 0 is the hand controller.
    pub fn events(&self) -> impl ExactSizeIterator<Item = (i64, usize, RecordedEvent)> {
        self.events.iter().map(|own| (own.stamp_ns, own.device, own.event))
    }

    /// The part up to a time (s) after what came first.
    pub fn first_s(mut self, duration_s: f64) -> Self {
        self.events.retain(|own| own.stamp_ns as f64 <= duration_s * 1e9);
        self
    }

    pub(crate) fn stamped(&self, event_idx: usize) -> Option<StampedEvent> {
        self.events.get(event_idx).copied()
    }

    fn read_notes(&mut self, lines: &mut Lines<'_>) -> Result<(), MasterError> {
        loop {
            match lines.next()? {
                b"reports" => return Ok(()),
                line if line.starts_with(b"beside ") => {
                    let device = lines.beside(line, self.header.beside.len())?;
                    self.header.beside.push(device);
                }
                line if line.starts_with(b"note ") => self.header.notes.push(note(line)),
                line => {
                    return Err(lines.refuse("`note ...`, `beside <vid>:<pid>` or `reports`", shown(line), DAMAGED));
                }
            }
        }
    }

    fn read_reports(&mut self, lines: &mut Lines<'_>) -> Result<(), MasterError> {
        loop {
            let line = lines.next()?;
            if line.starts_with(b"note ") {
                self.header.notes.push(note(line));
            } else if let Some(count) = line.strip_prefix(b"end ") {
                return self.finish(lines, count);
            } else {
                let n_beside = self.header.beside.len();
                let stamped = lines.event(line, self.events.last().map(|own| own.stamp_ns), n_beside)?;
                self.events.push(stamped);
            }
        }
    }

    fn finish(&self, lines: &Lines<'_>, count: &[u8]) -> Result<(), MasterError> {
        let n_reports = self.n_reports();
        if count != n_reports.to_string().as_bytes() {
            return Err(lines.refuse(
                &format!("`end {n_reports}`, the number of reports above"),
                shown(count),
                DAMAGED,
            ));
        }
        if n_reports == 0 {
            return Err(lines.refuse("at least one report", "none".to_owned(), DAMAGED));
        }
        if !lines.rest().is_empty() {
            return Err(lines.refuse("nothing after `end`", format!("{} more bytes", lines.rest().len()), DAMAGED));
        }
        Ok(())
    }
}

/// Reads a file of at most `limit_bytes`; never more, whatever the file claims to be.
pub(crate) fn read_bounded(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, MasterError> {
    input::bytes(path, limit_bytes).map_err(|source| match source.kind() {
        io::ErrorKind::FileTooLarge => MasterError::TooLarge { file: path.display().to_string(), limit_bytes },
        _ => MasterError::File { path: path.to_owned(), doing: "read", source },
    })
}

/// Text of a foreign file, made harmless and short enough for a sentence.
pub(crate) fn shown(bytes: &[u8]) -> String {
    const MAX_SHOWN: usize = 40;
    let head = bytes[..bytes.len().min(MAX_SHOWN)].escape_ascii();
    if bytes.len() > MAX_SHOWN { format!("\"{head}...\" ({} bytes)", bytes.len()) } else { format!("\"{head}\"") }
}
