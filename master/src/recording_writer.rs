//! Writes report recordings, so that what a device sent can be played again, byte by byte.

use crate::recording::MAGIC;
use crate::recording_lines::plug_word;
use crate::{Layout, RawReport, RecordedEvent, RecordingHeader};
use std::io::{self, Write};

/// Writes one recording. Without [`HidRecordingWriter::finish`] the file counts as truncated.
#[derive(Debug)]
pub struct HidRecordingWriter<W: Write> {
    out: W,
    first_ns: Option<i64>,
    last_ns: i64,
    n_reports: u64,
}

impl<W: Write> HidRecordingWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// What the output says.
    pub fn new(mut out: W, header: &RecordingHeader) -> io::Result<Self> {
        let layout = match header.layout {
            Some(Layout::Split) => "split",
            Some(Layout::Combined) => "combined",
            Some(Layout::Pose) => "pose",
            None => "unknown",
        };
        writeln!(out, "{MAGIC}\ndevice {:04x}:{:04x}\nlayout {layout}", header.vendor_id, header.product_id)?;
        for (vendor_id, product_id) in &header.beside {
            writeln!(out, "beside {vendor_id:04x}:{product_id:04x}")?;
        }
        let mut writer = Self { out, first_ns: None, last_ns: 0, n_reports: 0 };
        for text in &header.notes {
            writer.note(text)?;
        }
        writeln!(writer.out, "reports")?;
        Ok(writer)
    }

    /// Writes a report of the hand controller. `stamp_ns` is on any clock that does not run backwards; the file's stamps begin with 0.
    /// A report without bytes has nothing to be recorded and is left out.
    ///
    /// # Errors
    /// What the output says.
    pub fn push(&mut self, stamp_ns: i64, bytes: &[u8]) -> io::Result<()> {
        if bytes.is_empty() {
            return Ok(());
        }
        self.push_of(0, stamp_ns, &RecordedEvent::Report(RawReport::clipped(bytes)))
    }

    /// Writes what came of one of the hand's devices: 0 is the hand controller, 1 the first that the header has beside it.
    ///
    /// # Errors
    /// What the output says.
    pub fn push_of(&mut self, device: usize, stamp_ns: i64, event: &RecordedEvent) -> io::Result<()> {
        let first_ns = *self.first_ns.get_or_insert(stamp_ns);
        self.last_ns = stamp_ns.saturating_sub(first_ns).max(self.last_ns);
        write!(self.out, "{} ", self.last_ns)?;
        if device > 0 {
            write!(self.out, "{device}:")?;
        }
        match event {
            RecordedEvent::Report(report) => {
                self.n_reports += 1;
                report.as_bytes().iter().try_for_each(|byte| write!(self.out, "{byte:02x}"))?;
            }
            RecordedEvent::Plug(plug) => write!(self.out, "{}", plug_word(*plug))?,
        }
        writeln!(self.out)
    }

    /// Writes a note where the recording stands; line breaks become spaces, and what is too long for a line is cut.
    ///
    /// # Errors
    /// What the output says.
    pub fn note(&mut self, text: &str) -> io::Result<()> {
        const MAX_CHARS: usize = 48; // 4 bytes each at most, so that the line stays below 200 bytes.
        let is_short = text.len() <= 4 * MAX_CHARS;
        let kept = text.chars().take(if is_short { usize::MAX } else { MAX_CHARS });
        let line: String = kept.map(|c| if c.is_control() { ' ' } else { c }).collect();
        writeln!(self.out, "note {line}")
    }

    /// Writes the end and hands the output back.
    ///
    /// # Errors
    /// What the output says.
    pub fn finish(mut self) -> io::Result<W> {
        writeln!(self.out, "end {}", self.n_reports)?;
        self.out.flush()?;
        Ok(self.out)
    }

    /// Makes what was written so far survive a kill of this process.
    ///
    /// # Errors
    /// What the output says.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
