//! One report as the device sent it, in a place of fixed size, so that handing it on never allocates.

/// A raw HID input report of up to 64 bytes, the first of which is its id.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct RawReport {
    bytes: [u8; Self::MAX_BYTES],
    len: u8,
}

impl RawReport {
    /// The longest report of a full-speed USB device, bytes.
    pub const MAX_BYTES: usize = 64;

    /// Keeps the first 64 bytes. A report that is cut here is still longer than any that is accepted, so it stays refused.
    pub fn clipped(bytes: &[u8]) -> Self {
        let kept = &bytes[..bytes.len().min(Self::MAX_BYTES)];
        let mut report = Self { bytes: [0; Self::MAX_BYTES], len: kept.len() as u8 };
        report.bytes[..kept.len()].copy_from_slice(kept);
        report
    }

    /// The report's bytes, id first.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }
}

impl std::fmt::Debug for RawReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "RawReport({:02x?})", self.as_bytes())
    }
}
