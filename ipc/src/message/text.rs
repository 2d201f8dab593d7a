//! Texts in messages: UTF-8 in a fixed number of bytes, zeros behind its end.

/// A text and how many bytes it has; `None` for one that is too long.
pub(super) fn packed<const N: usize>(text: &str) -> Option<(u32, [u8; N])> {
    let mut bytes = [0; N];
    bytes.get_mut(..text.len())?.copy_from_slice(text.as_bytes());
    Some((text.len() as u32, bytes))
}

/// The text, or `None` where a foreign process has sent what is none.
pub(super) fn unpacked<const N: usize>(n: u32, bytes: &[u8; N]) -> Option<&str> {
    core::str::from_utf8(bytes.get(..usize::try_from(n).ok()?)?).ok()
}
