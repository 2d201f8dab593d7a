//! The data of an answer: where it was received, or, where bytes had to be taken out of it, in a copy that needs no heap.

use core::fmt;
use core::ops::Deref;

/// Most bytes of data that anybody asks for: a number of registers is a byte.
const MOST: usize = 255;

/// Bytes of an answer.
#[allow(clippy::large_enum_variant, reason = "a box would be the heap that this is there to do without")]
#[derive(Clone)]
pub(crate) enum Data<'a> {
    /// As they were received.
    Received(&'a [u8]),
    /// A copy, and how many bytes of it count.
    Copied([u8; MOST], usize),
}

impl Data<'_> {
    /// An empty copy, to be filled.
    pub(crate) fn empty() -> Self {
        Self::Copied([0; MOST], 0)
    }

    /// Puts a byte behind those of a copy; whether there was room.
    pub(crate) fn push(&mut self, byte: u8) -> bool {
        let Self::Copied(bytes, n) = self else { return false };
        let Some(place) = bytes.get_mut(*n) else { return false };
        (*place, *n) = (byte, *n + 1);
        true
    }
}

impl Deref for Data<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Received(bytes) => bytes,
            Self::Copied(bytes, n) => &bytes[..*n],
        }
    }
}

impl<'a> From<&'a [u8]> for Data<'a> {
    fn from(bytes: &'a [u8]) -> Self {
        Self::Received(bytes)
    }
}

impl PartialEq for Data<'_> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Eq for Data<'_> {}

impl fmt::Debug for Data<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}
