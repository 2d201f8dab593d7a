//! Packets of Dynamixel protocol 2.0: FF FF FD 00 id length instruction parameters CRC, and in an answer an error before its data.
//!
//! where: length (2 bytes, as every number the low byte first) counts what follows it; FF FF FD within instruction and parameters is
//! followed by one more FD, which is counted and taken out again; the CRC (polynomial x16 + x15 + x2 + 1, from 0) is of everything
//! before it. So a header stands nowhere but at a beginning.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" and "CRC Calculation".

use crate::serial::{ALL, Answer, Data};
use std::borrow::Cow;

/// Bytes of a packet besides its parameters.
pub(crate) const FRAME: usize = 10;
/// What an answer has for an instruction.
pub(crate) const STATUS: u8 = 0x55;
/// Bytes from the header to the length.
const HEAD: usize = 7;
const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
const PATTERN: [u8; 3] = [0xFF, 0xFF, 0xFD];

/// Puts a packet behind what is there.
pub(crate) fn put(bytes: &mut Vec<u8>, id: u8, instruction: u8, parameters: &[&[u8]]) {
    let begin = bytes.len();
    bytes.extend(HEADER);
    bytes.extend([id, 0, 0, instruction]);
    for byte in parameters.iter().copied().flatten() {
        bytes.push(*byte);
        if bytes[begin + HEAD..].ends_with(&PATTERN) {
            bytes.push(0xFD);
        }
    }
    let length = (bytes.len() - begin - HEAD + 2) as u16;
    bytes[begin + 5..begin + HEAD].copy_from_slice(&length.to_le_bytes());
    let sum = crc(&bytes[begin..]);
    bytes.extend(sum.to_le_bytes());
}

/// The check of everything before it.
pub(crate) fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |sum: u16, byte| {
        let index = usize::from((sum >> 8) as u8 ^ byte);
        sum << 8 ^ CRC_OF[index]
    })
}

/// The check of each single byte.
static CRC_OF: [u16; 256] = {
    let mut table = [0; 256];
    let mut k = 0;
    while k < 256 {
        let mut sum = (k as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            sum = if sum & 0x8000 == 0 { sum << 1 } else { sum << 1 ^ 0x8005 };
            bit += 1;
        }
        table[k] = sum;
        k += 1;
    }
    table
};

/// A whole packet as it was sent.
#[derive(Debug, PartialEq, Eq)]
struct Framed<'a> {
    id: u8,
    instruction: u8,
    /// With the bytes that keep a header from standing in them.
    stuffed: &'a [u8],
    n_bytes: usize,
}

/// A whole packet.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Packet<'a> {
    pub id: u8,
    pub instruction: u8,
    pub parameters: Cow<'a, [u8]>,
    /// Its bytes as they were sent.
    pub n_bytes: usize,
}

/// The packet at the beginning of these bytes; [`None`] where there is none, or not yet all of it.
fn framed(bytes: &[u8]) -> Option<Framed<'_>> {
    let length = bytes.get(5..HEAD).filter(|_| bytes.starts_with(&HEADER))?;
    let n_bytes = HEAD + usize::from(u16::from_le_bytes([length[0], length[1]]));
    let packet = bytes.get(..n_bytes).filter(|_| n_bytes >= FRAME)?;
    let (body, sum) = packet.split_at(n_bytes - 2);
    (crc(body).to_le_bytes() == sum).then(|| Framed {
        id: body[4],
        instruction: body[HEAD],
        stuffed: &body[HEAD + 1..],
        n_bytes,
    })
}

/// The same with its parameters as they were meant.
pub(crate) fn packet(bytes: &[u8]) -> Option<Packet<'_>> {
    let Framed { id, instruction, stuffed, n_bytes } = framed(bytes)?;
    let parameters = if is_stuffed(stuffed) {
        let mut plain = Vec::with_capacity(stuffed.len());
        each_plain(stuffed, |byte| plain.push(byte));
        Cow::Owned(plain)
    } else {
        Cow::Borrowed(stuffed)
    };
    Some(Packet { id, instruction, parameters, n_bytes })
}

fn is_stuffed(bytes: &[u8]) -> bool {
    bytes.windows(3).any(|three| three == PATTERN)
}

/// Hands on the bytes without those that keep a header from standing in them.
fn each_plain(stuffed: &[u8], mut take: impl FnMut(u8)) {
    // The newest three that were handed on.
    let mut newest = [0; 3];
    for byte in stuffed {
        if newest == PATTERN && *byte == 0xFD {
            // What follows begins anew.
            newest = [0; 3];
            continue;
        }
        take(*byte);
        newest = [newest[1], newest[2], *byte];
    }
}

/// The data of an answer without the bytes that keep a header from standing in it; [`None`]: more than anybody asks for.
fn plain_data(stuffed: &[u8]) -> Option<Data<'_>> {
    if !is_stuffed(stuffed) {
        return Some(stuffed.into());
    }
    let (mut data, mut fits) = (Data::empty(), true);
    each_plain(stuffed, |byte| fits &= data.push(byte));
    fits.then_some(data)
}

/// The next whole answer with so many bytes of data, from a place on, which is then behind it. What is broken hides no other.
///
/// Refusals (an error number, besides the alert in bit 7) are no answers, nor are questions that the adapter hands back.
pub(crate) fn next_answer<'a>(received: &'a [u8], at: &mut usize, n_data: usize) -> Option<Answer<'a>> {
    while let Some(rest) = received.get(*at..).filter(|rest| rest.len() > FRAME + n_data) {
        let Some(Framed { id, instruction, stuffed, n_bytes }) = framed(rest) else {
            *at += 1;
            continue;
        };
        *at += n_bytes;
        // An error that only tells an alert is no part of the pattern, so that the data after it is stuffed by itself.
        if let Some((error, data)) = stuffed.split_first()
            && instruction == STATUS
            && id < ALL
            && error & 0x7F == 0
            && let Some(data) = plain_data(data).filter(|data| data.len() == n_data)
        {
            return Some(Answer { id, error: *error, data });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::serial::{Block, PING, Protocol, READ, SYNC_READ, SYNC_WRITE, WRITE};
    use proptest::prelude::*;

    fn answers(received: &[u8], n_data: usize) -> Vec<Answer<'_>> {
        Protocol::Two.answers(received, n_data).collect()
    }

    fn answer_of(id: u8, error: u8, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        put(&mut bytes, id, STATUS, &[&[error], data]);
        bytes
    }

    #[test]
    fn packets_are_those_of_the_makers_manual() {
        // Examples of the e-Manual, "DYNAMIXEL Protocol 2.0": ping, read, write, sync read, sync write.
        let written = |put: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = Vec::new();
            put(&mut bytes);
            bytes
        };
        let ping = |id| written(&|bytes| put(bytes, id, PING, &[]));
        assert_eq!(ping(1), [0xFF, 0xFF, 0xFD, 0, 1, 3, 0, 1, 0x19, 0x4E]);
        assert_eq!(ping(ALL), [0xFF, 0xFF, 0xFD, 0, 0xFE, 3, 0, 1, 0x31, 0x42]);
        let position = Block { address: 132, n: 4 };
        let read = written(&|bytes| Protocol::Two.put_about(bytes, 1, READ, position, &[]));
        assert_eq!(read, [0xFF, 0xFF, 0xFD, 0, 1, 7, 0, 2, 0x84, 0, 4, 0, 0x1D, 0x15]);
        let write = written(&|bytes| put(bytes, 1, WRITE, &[&[0x74, 0], &[0, 2, 0, 0]]));
        assert_eq!(write, [0xFF, 0xFF, 0xFD, 0, 1, 9, 0, 3, 0x74, 0, 0, 2, 0, 0, 0xCA, 0x89]);
        let sync_read = written(&|bytes| Protocol::Two.put_about(bytes, ALL, SYNC_READ, position, &[1, 2]));
        assert_eq!(sync_read, [0xFF, 0xFF, 0xFD, 0, 0xFE, 9, 0, 0x82, 0x84, 0, 4, 0, 1, 2, 0xCE, 0xFA]);
        let goals = [1, 0x96, 0, 0, 0, 2, 0xAA, 0, 0, 0];
        let goal = Block { address: 116, n: 4 };
        let sync_write = written(&|bytes| Protocol::Two.put_about(bytes, ALL, SYNC_WRITE, goal, &goals));
        let head = [0xFF, 0xFF, 0xFD, 0, 0xFE, 0x11, 0, 0x83, 0x74, 0, 4, 0];
        assert_eq!(sync_write, [&head[..], &goals, &[0x82, 0x87]].concat());

        let one = [0xFF, 0xFF, 0xFD, 0, 1, 8, 0, 0x55, 0, 0xA6, 0, 0, 0, 0x8C, 0xC0];
        let two = [0xFF, 0xFF, 0xFD, 0, 2, 8, 0, 0x55, 0, 0x1F, 8, 0, 0, 0xBA, 0xBE];
        let answer = |id, data: &'static [u8]| Answer { id, error: 0, data: data.into() };
        let expected = [answer(1, &[0xA6, 0, 0, 0]), answer(2, &[0x1F, 8, 0, 0])];
        assert_eq!(answers(&[one, two].concat(), 4), expected);
        let pong = [0xFF, 0xFF, 0xFD, 0, 1, 7, 0, 0x55, 0, 6, 4, 0x26, 0x65, 0x5D];
        assert_eq!(answers(&pong, 3), [answer(1, &[6, 4, 0x26])]);
    }

    #[test]
    fn a_header_in_the_data_is_stuffed_and_comes_out_as_it_went_in() {
        let data = [0xFF, 0xFF, 0xFD, 0x00, 7];
        let bytes = answer_of(1, 0, &data);
        assert_eq!(bytes[9..15], [0xFF, 0xFF, 0xFD, 0xFD, 0x00, 7]);
        assert_eq!(bytes[5..7], [10, 0], "the length counts it");
        assert_eq!(answers(&bytes, 5)[0].data[..], data);
        // One more FD of its own stays, and the pattern may begin anew at once.
        let data = [0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD];
        assert_eq!(answers(&answer_of(1, 0, &data), 11)[0].data[..], data);
    }

    #[test]
    fn an_answer_holds_as_much_as_can_be_asked_for_also_where_it_is_stuffed() {
        let long: Vec<u8> = [0xFF, 0xFF, 0xFD].into_iter().cycle().take(255).collect();
        assert_eq!(answers(&answer_of(1, 0, &long), 255)[0].data[..], long);
        let longer: Vec<u8> = [0xFF, 0xFF, 0xFD].into_iter().cycle().take(256).collect();
        assert_eq!(answers(&answer_of(1, 0, &longer), 256), []);
    }

    #[test]
    fn whatever_is_broken_hides_no_other_answer_and_a_refusal_is_none() {
        let (one, two) = (answer_of(1, 0, &[1, 2, 3, 4]), answer_of(2, 0x80, &[0xFF, 0xFF, 0xFD, 4]));
        let ids = |received: &[u8]| answers(received, 4).iter().map(|answer| answer.id).collect::<Vec<u8>>();
        assert_eq!(ids(&[one.clone(), two.clone()].concat()), [1, 2]);
        assert_eq!(ids(&[&[0xFF], &one[..], &two[..]].concat()), [1, 2], "a stray byte");
        assert_eq!(ids(&[&one[..7], &two[..]].concat()), [2], "one is cut short");
        for k in 0..one.len() {
            let mut spoilt = one.clone();
            spoilt[k] ^= 0x10;
            assert_eq!(ids(&[spoilt, two.clone()].concat()), [2], "byte {k} is spoilt");
        }
        let mut question = Vec::new();
        Protocol::Two.put_about(&mut question, 1, READ, Block { address: 132, n: 4 }, &[]);
        assert_eq!(ids(&[question, one.clone()].concat()), [1], "the adapter's echo is no answer");
        assert_eq!(ids(&answer_of(1, 0x07, &[1, 2, 3, 4])), [0; 0], "access error");
        assert_eq!(answers(&two, 4)[0].error, 0x80, "an alert is none");
    }

    proptest! {
        #[test]
        fn whatever_is_received_nothing_panics(noise in noise(), n_data in 0_usize..40) {
            for answer in answers(&noise, n_data) {
                prop_assert_eq!(answer.data.len(), n_data);
            }
            let _either = packet(&noise);
        }

        #[test]
        fn every_packet_comes_out_as_it_went_in(id in 0_u8..=252, parameters in noise(), before in noise()) {
            let mut bytes = before.clone();
            put(&mut bytes, id, SYNC_WRITE, &[&parameters[..]]);
            let own = &bytes[before.len()..];
            prop_assert!(!own[1..].windows(4).any(|four| four == HEADER), "{:?}", own);
            let n_bytes = own.len();
            prop_assert_eq!(packet(own), Some(Packet { id, instruction: SYNC_WRITE, parameters: parameters[..].into(), n_bytes }));
            for cut in 0..n_bytes {
                prop_assert_eq!(packet(&own[..cut]), None);
            }
        }

        #[test]
        fn no_spoilt_byte_passes(data in noise(), at in any::<prop::sample::Index>(), by in 1_u8..=255) {
            let mut bytes = answer_of(5, 0, &data);
            let at = at.index(bytes.len());
            bytes[at] ^= by;
            prop_assert_eq!(answers(&bytes, data.len()), []);
        }
    }

    /// Bytes in which headers are not rare.
    fn noise() -> impl Strategy<Value = Vec<u8>> {
        let byte = prop_oneof![4 => Just(0xFF), 3 => Just(0xFD), 2 => Just(0x00), 1 => Just(0x55), 2 => any::<u8>()];
        prop::collection::vec(byte, 0..60)
    }
}
