//! Packets of the servos' protocol, version 1: FF FF id length instruction-or-error parameters checksum.
//!
//! where: length counts what follows it; the checksum is the inverted sum of everything between header and itself. Nothing is
//! escaped, so a header may stand inside of a packet, and an answer may lie anywhere in what was received.

use crate::serial::{ALL, Answer};

/// Bytes of a packet besides its parameters.
pub(crate) const FRAME: usize = 6;

/// Puts a packet behind what is there.
pub(crate) fn put(bytes: &mut Vec<u8>, id: u8, instruction: u8, parameters: &[&[u8]]) {
    let begin = bytes.len();
    let n: usize = parameters.iter().map(|part| part.len()).sum();
    bytes.extend([0xFF, 0xFF, id, (n + 2) as u8, instruction]);
    for part in parameters {
        bytes.extend_from_slice(part);
    }
    bytes.push(checksum(&bytes[begin + 2..]));
}

/// The checksum of what stands between header and checksum.
pub(crate) fn checksum(body: &[u8]) -> u8 {
    !body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// The next whole answer with so many bytes of data, from a place on, which is then behind it.
///
/// A question that the adapter hands back is no answer, because no question has as many parameters as its answer has data.
pub(crate) fn next_answer<'a>(received: &'a [u8], at: &mut usize, n_data: usize) -> Option<Answer<'a>> {
    while *at + FRAME + n_data <= received.len() {
        let packet = &received[*at..*at + FRAME + n_data];
        if let Some(answer) = answer(packet, n_data) {
            *at += packet.len();
            return Some(answer);
        }
        *at += 1;
    }
    None
}

fn answer(packet: &[u8], n_data: usize) -> Option<Answer<'_>> {
    let (body, sum) = (packet.get(2..packet.len() - 1)?, packet.last()?);
    let is_whole = packet.starts_with(&[0xFF, 0xFF]) && usize::from(body[1]) == n_data + 2 && checksum(body) == *sum;
    (is_whole && body[0] < ALL).then(|| Answer { id: body[0], error: body[2], data: body[3..].into() })
}

/// A number with its sign in a bit of its own, as these servos write them.
pub(crate) fn signed(raw: u16, sign_bit: u16) -> i32 {
    let magnitude = i32::from(raw & ((1 << sign_bit) - 1));
    if raw >> sign_bit & 1 == 1 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::serial::{Protocol, READ, WRITE, word};

    fn answers(received: &[u8], n_data: usize) -> impl Iterator<Item = Answer<'_>> {
        Protocol::One.answers(received, n_data)
    }

    fn answer_of(id: u8, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        put(&mut bytes, id, 0, &[data]);
        bytes
    }

    #[test]
    fn packets_are_those_of_the_protocols_manual() {
        // Examples of the manual "Communication protocol" for serial bus servos: read the position of 1, write a goal to 1.
        let mut bytes = Vec::new();
        put(&mut bytes, 1, READ, &[&[0x38, 0x02]]);
        assert_eq!(bytes, [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x38, 0x02, 0xBE]);
        bytes.clear();
        put(&mut bytes, 1, WRITE, &[&[0x2A], &[0x00, 0x08, 0x00, 0x00, 0xE8, 0x03]]);
        assert_eq!(bytes, [0xFF, 0xFF, 0x01, 0x09, 0x03, 0x2A, 0x00, 0x08, 0x00, 0x00, 0xE8, 0x03, 0xD5]);
        let received = [0xFF, 0xFF, 0x01, 0x04, 0x00, 0x18, 0x05, 0xDD];
        let found: Vec<Answer> = answers(&received, 2).collect();
        assert_eq!(found, [Answer { id: 1, error: 0, data: [0x18, 0x05][..].into() }]);
        assert_eq!(word(&found[0].data, 0), 1304);
    }

    #[test]
    fn whatever_is_broken_hides_no_other_answer() {
        let (one, two) = (answer_of(1, &[1, 2, 3, 4]), answer_of(2, &[0xFF, 0xFF, 3, 4]));
        let ids = |received: &[u8]| answers(received, 4).map(|answer| answer.id).collect::<Vec<u8>>();
        assert_eq!(ids(&[one.clone(), two.clone()].concat()), [1, 2]);
        assert_eq!(ids(&[&[0xFF], &one[..], &two[..]].concat()), [1, 2], "a stray byte");
        assert_eq!(ids(&[&one[..5], &two[..]].concat()), [2], "one is cut short");
        for k in 0..one.len() {
            let mut spoilt = one.clone();
            spoilt[k] ^= 0x10;
            assert_eq!(ids(&[spoilt, two.clone()].concat()).last(), Some(&2), "byte {k} is spoilt");
        }
        let mut question = Vec::new();
        put(&mut question, 1, READ, &[&[40, 4]]);
        assert_eq!(ids(&[question, one].concat()), [1], "the adapter's echo is no answer");
    }

    #[test]
    fn whatever_is_received_nothing_panics() {
        let mut state = 1_u64;
        let noise: Vec<u8> = (0..20_000)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                if state >> 61 == 0 { (state >> 40) as u8 } else { 0xFF }
            })
            .collect();
        for n_data in [0, 2, 31, 249] {
            assert!(answers(&noise, n_data).all(|answer| answer.data.len() == n_data));
        }
    }

    #[test]
    fn signs_stand_in_a_bit_of_their_own() {
        assert_eq!([0, 5, 0x8005, 0x8000, 0x7FFF].map(|raw| signed(raw, 15)), [0, 5, -5, 0, 32767]);
        assert_eq!(signed(0x0400 | 250, 10), -250);
    }
}
