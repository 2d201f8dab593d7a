//! Bytes of a MATLAB file in either byte order, taken from a source that may be unpacked on the way.

use std::io::{self, Read};

/// Bytes that are read at once: a length that is a lie takes no more memory.
const PIECE: usize = 1 << 16;

/// A source whose end is known: no element reads beyond the one that holds it.
pub(super) struct Stream<'a> {
    source: &'a mut dyn Read,
    pub is_big: bool,
    /// Bytes that may still be taken.
    n_left: u64,
}

/// The head of an element: its type, its bytes, and for a small one the bytes themselves.
pub(super) struct Tag {
    pub sort: u32,
    pub n_bytes: u64,
    small: Option<[u8; 4]>,
}

impl<'a> Stream<'a> {
    pub(super) fn new(source: &'a mut dyn Read, is_big: bool, n_left: u64) -> Self {
        Self { source, is_big, n_left }
    }

    /// The inside of an element of so many bytes, whose bytes count as taken.
    pub(super) fn inner(&mut self, n_bytes: u64) -> Result<Stream<'_>, String> {
        let left = self.n_left.checked_sub(n_bytes);
        self.n_left = left.ok_or_else(|| format!("{n_bytes} bytes are expected where {} are left", self.n_left))?;
        Ok(Stream { source: &mut *self.source, is_big: self.is_big, n_left: n_bytes })
    }

    /// Bytes that may still be taken.
    pub(super) fn n_left(&self) -> u64 {
        self.n_left
    }

    /// Whether nothing is left.
    pub(super) fn is_over(&self) -> bool {
        self.n_left == 0
    }

    /// The bytes that are left, as a source.
    pub(super) fn bytes(&mut self) -> io::Take<&mut dyn Read> {
        let n_left = std::mem::take(&mut self.n_left);
        Read::take(&mut *self.source, n_left)
    }

    /// Takes what is left.
    pub(super) fn skip_rest(&mut self) -> Result<(), String> {
        self.skip(self.n_left)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), String> {
        let n = bytes.len() as u64;
        if n > self.n_left {
            return Err(format!("{n} bytes are expected where {} are left", self.n_left));
        }
        self.source.read_exact(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => "the file ends in the middle of a variable".to_owned(),
            _ => error.to_string(),
        })?;
        self.n_left -= n;
        Ok(())
    }

    /// Gives so many bytes piece by piece.
    pub(super) fn pieces(&mut self, n_bytes: u64, mut take: impl FnMut(&[u8])) -> Result<(), String> {
        let mut piece = vec![0; usize::try_from(n_bytes).unwrap_or(PIECE).min(PIECE)];
        let mut n_left = n_bytes;
        while n_left > 0 {
            let n = usize::try_from(n_left).unwrap_or(PIECE).min(piece.len());
            let bytes = piece.get_mut(..n).unwrap_or_default();
            self.fill(bytes)?;
            take(bytes);
            n_left -= n as u64;
        }
        Ok(())
    }

    pub(super) fn skip(&mut self, n_bytes: u64) -> Result<(), String> {
        self.pieces(n_bytes, |_| {})
    }

    fn u32(&mut self) -> Result<[u8; 4], String> {
        let mut bytes = [0; 4];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    pub(super) fn whole(&self, bytes: [u8; 4]) -> u32 {
        if self.is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
    }

    /// The next element's head.
    pub(super) fn tag(&mut self) -> Result<Tag, String> {
        let first = self.u32()?;
        let (first, second) = (self.whole(first), self.u32()?);
        if first >> 16 == 0 {
            return Ok(Tag { sort: first, n_bytes: u64::from(self.whole(second)), small: None });
        }
        Ok(Tag { sort: first & 0xffff, n_bytes: u64::from(first >> 16).min(4), small: Some(second) })
    }

    /// The bytes of an element, piece by piece, and what fills them up to eight.
    pub(super) fn data(&mut self, tag: &Tag, mut take: impl FnMut(&[u8])) -> Result<(), String> {
        if let Some(small) = tag.small {
            take(small.get(..usize::try_from(tag.n_bytes).unwrap_or(4)).unwrap_or_default());
            return Ok(());
        }
        self.pieces(tag.n_bytes, take)?;
        // The last element of a file need not be filled up.
        self.skip((tag.n_bytes.next_multiple_of(8) - tag.n_bytes).min(self.n_left))
    }

    /// The bytes of an element that has at most so many.
    pub(super) fn short(&mut self, most: u64) -> Result<Vec<u8>, String> {
        let tag = self.tag()?;
        if tag.n_bytes > most {
            return Err(format!("an entry of {} bytes is found where at most {most} are expected", tag.n_bytes));
        }
        let mut bytes = Vec::new();
        self.data(&tag, |piece| bytes.extend_from_slice(piece))?;
        Ok(bytes)
    }
}
