//! Questions for single objects of a drive and their answers: expedited transfers of at most 4 bytes.
//!
//! Source: CiA 301, SDO protocols. Failure: an answer about another object than the one asked for is no answer.

use super::frame::{Frame, SDO_TO};

/// An object's place: index and sub-index.
pub(crate) type Place = (u16, u8);

/// What a drive answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reply {
    /// The object is written.
    Written,
    /// Its value, as many bytes as it has.
    Value(u32),
    /// It refuses, with an abort code.
    Aborted(u32),
}

/// A question for an object's value.
pub(crate) fn upload(node: u8, (index, sub): Place) -> Frame {
    let [low, high] = index.to_le_bytes();
    Frame::new(SDO_TO + u16::from(node), &[0x40, low, high, sub, 0, 0, 0, 0])
}

/// Writes the first `n_bytes`, 1 to 4, of a value into an object.
pub(crate) fn download(node: u8, (index, sub): Place, value: u32, n_bytes: u8) -> Frame {
    let n_bytes = n_bytes.clamp(1, 4);
    let ([low, high], mut bytes) = (index.to_le_bytes(), value.to_le_bytes());
    bytes[usize::from(n_bytes)..].fill(0);
    let [b0, b1, b2, b3] = bytes;
    Frame::new(SDO_TO + u16::from(node), &[0x23 | (4 - n_bytes) << 2, low, high, sub, b0, b1, b2, b3])
}

/// What an answer says of an object; `None`: it is about another one, or of a kind that is not used here.
pub(crate) fn reply(data: [u8; 8], place: Place) -> Option<Reply> {
    let [command, low, high, sub, b0, b1, b2, b3] = data;
    if (u16::from_le_bytes([low, high]), sub) != place {
        return None;
    }
    let value = u32::from_le_bytes([b0, b1, b2, b3]);
    match command {
        0x60 => Some(Reply::Written),
        0x80 => Some(Reply::Aborted(value)),
        // Expedited, with or without a size.
        0x42 => Some(Reply::Value(value)),
        0x43 | 0x47 | 0x4B | 0x4F => {
            let n_bytes = 4 - u32::from(command >> 2 & 3);
            Some(Reply::Value(value & (u32::MAX >> (32 - 8 * n_bytes))))
        }
        _ => None,
    }
}

/// What an abort code means.
pub(crate) fn meaning(code: u32) -> &'static str {
    match code {
        0x0503_0000 | 0x0504_0000 | 0x0504_0001 => "the protocol was not kept",
        0x0601_0000..=0x0601_0002 => "it may not be read or written",
        0x0602_0000 => "there is no such object",
        0x0604_0041 | 0x0604_0042 => "it may not be sent cyclically",
        0x0607_0010 | 0x0607_0012 | 0x0607_0013 => "it has another length",
        0x0609_0011 => "there is no such part of the object",
        0x0609_0030..=0x0609_0036 => "the value is outside its range",
        0x0800_0020..=0x0800_0022 => "it cannot be written in the drive's state",
        _ => "a reason of its own",
    }
}

/// Whether an abort code says that the drive has no such object.
pub(crate) fn is_missing(code: u32) -> bool {
    matches!(code, 0x0602_0000 | 0x0609_0011)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_and_answers_are_those_of_the_standard() {
        assert_eq!(upload(3, (0x1018, 1)).data(), [0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
        assert_eq!(download(3, (0x6060, 0), 8, 1).data(), [0x2F, 0x60, 0x60, 0, 8, 0, 0, 0]);
        assert_eq!(download(3, (0x1017, 0), 0x0102, 2).data(), [0x2B, 0x17, 0x10, 0, 2, 1, 0, 0]);
        assert_eq!(download(3, (0x607A, 0), u32::MAX, 4).data(), [0x23, 0x7A, 0x60, 0, 255, 255, 255, 255]);
        let place = (0x6041, 0);
        assert_eq!(reply([0x4B, 0x41, 0x60, 0, 0x37, 0x02, 9, 9], place), Some(Reply::Value(0x0237)));
        assert_eq!(reply([0x4F, 0x41, 0x60, 0, 0xFE, 9, 9, 9], place), Some(Reply::Value(0xFE)));
        assert_eq!(reply([0x43, 0x41, 0x60, 0, 1, 2, 3, 4], place), Some(Reply::Value(0x0403_0201)));
        assert_eq!(reply([0x60, 0x41, 0x60, 0, 0, 0, 0, 0], place), Some(Reply::Written));
        assert_eq!(reply([0x80, 0x41, 0x60, 0, 0, 0, 2, 6], place), Some(Reply::Aborted(0x0602_0000)));
        assert_eq!(reply([0x4B, 0x41, 0x60, 1, 0, 0, 0, 0], place), None, "another object");
        assert_eq!(reply([0x41, 0x41, 0x60, 0, 9, 0, 0, 0], place), None, "in pieces, which nothing here asks for");
        for command in 0..=255 {
            reply([command, 0x41, 0x60, 0, 255, 255, 255, 255], place);
        }
    }
}
