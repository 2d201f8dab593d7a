//! One report as the device sent it, in a place of fixed size, so that handing it on never allocates.

/// A raw HID input report, the first byte of which is its id, or a packet of a pose sender; up to 80 bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct RawReport {
    bytes: [u8; Self::MAX_BYTES],
    len: u8,
}

impl RawReport {
    /// The longest report of a full-speed USB device has 64 bytes and a pose packet 72; one that is longer must be seen to be.
    pub const MAX_BYTES: usize = 80;

    /// Keeps the first 80 bytes. A report that is cut here is still longer than any that is accepted, so it stays refused.
    pub fn clipped(bytes: &[u8]) -> Self {
        let kept = &bytes[..bytes.len().min(Self::MAX_BYTES)];
        let mut report = Self { bytes: [0; Self::MAX_BYTES], len: kept.len() as u8 };
        report.bytes[..kept.len()].copy_from_slice(kept);
        report
    }

    /// The report's bytes.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }
}

impl std::fmt::Debug for RawReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RawReport({:02x?})", self.as_bytes())
    }
}
