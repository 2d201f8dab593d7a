//! An event mark: a word of the operator's about this instant, for whoever reads the recording.

use super::message;
use super::text::{packed, unpacked};
use iceoryx2::prelude::ZeroCopySend;

/// Bytes that the text of a mark may have.
pub const MARKER_TEXT_MAX: usize = 240;

/// A mark, published by `krait mark` (channel `marker`) or by the master for a button (channel `marker/device`); the
/// recorder repeats each that it has taken on `marker/recorded`, so that a sender knows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.Marker")]
pub struct Marker {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// The instant that is marked, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// Process id of the sender.
    pub sender_pid: u32,
    /// Bytes of `text` that are used, 1 to [`MARKER_TEXT_MAX`].
    pub n_text: u32,
    /// UTF-8 without control characters; zeros behind its end.
    pub text: [u8; MARKER_TEXT_MAX],
}

message!(Marker, "marker", 1, super::RARE);

/// A text that no mark can carry.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MarkerTextError {
    /// Nothing, or too much.
    #[error("the text of a mark has {found} bytes, expected 1 to {MARKER_TEXT_MAX}; write less, or anything at all")]
    Length {
        /// Bytes given.
        found: usize,
    },
    /// A line break, a tab, an escape.
    #[error("the text of a mark holds the control character {found:?} at byte {at}, expected plain text; leave it out")]
    Control {
        /// The character.
        found: char,
        /// Where it is.
        at: usize,
    },
}

impl Marker {
    /// The channel on which the master publishes marks of a button.
    pub const DEVICE_CHANNEL: &'static str = "marker/device";
    /// The channel on which the guide of a calibration is told where to go next.
    pub const GUIDE_CHANNEL: &'static str = "marker/guide";
    /// The channel on which the recorder repeats what it has taken.
    pub const RECORDED_CHANNEL: &'static str = "marker/recorded";

    /// A mark of this process, about an instant.
    ///
    /// # Errors
    /// [`MarkerTextError`] for a text that is empty, too long or not plain.
    pub fn new(sequence: u64, sample_ns: i64, text: &str) -> Result<Self, MarkerTextError> {
        let length = || MarkerTextError::Length { found: text.len() };
        let (n_text, bytes) = packed(text).filter(|(n_text, _)| *n_text > 0).ok_or_else(length)?;
        if let Some((at, found)) = text.char_indices().find(|(_, c)| c.is_control()) {
            return Err(MarkerTextError::Control { found, at });
        }
        Ok(Self { sequence, sample_ns, sender_pid: std::process::id(), n_text, text: bytes })
    }

    /// The text, or `None` where a foreign process has sent what is none.
    pub fn text(&self) -> Option<&str> {
        let is_plain = |text: &&str| !text.is_empty() && !text.chars().any(char::is_control);
        unpacked(self.n_text, &self.text).filter(is_plain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_comes_back_and_one_that_is_none_is_refused_with_its_fault() {
        for text in ["x", "vessel touched, 2nd try - größer", &"x".repeat(MARKER_TEXT_MAX)] {
            assert_eq!(Marker::new(1, 0, text).expect(text).text(), Some(text));
        }
        let refused = |text: &str| Marker::new(1, 0, text).expect_err(text).to_string();
        assert!(refused("").contains("0 bytes"));
        assert!(refused(&"ü".repeat(121)).contains("242 bytes"));
        assert!(refused("a\nb").contains("'\\n' at byte 1"));
    }

    #[test]
    fn bytes_that_are_no_text_are_none() {
        let good = Marker::new(1, 0, "good").expect("a text");
        assert_eq!(Marker { n_text: 241, ..good }.text(), None);
        assert_eq!(Marker { n_text: u32::MAX, ..good }.text(), None);
        assert_eq!(Marker { n_text: 0, ..good }.text(), None);
        assert_eq!(Marker { text: [0xff; MARKER_TEXT_MAX], ..good }.text(), None);
        assert_eq!(Marker { n_text: 5, ..good }.text(), None, "a zero byte is no text");
    }
}
