//! What the packets of serial servos have in common: registers of one or of many, asked for and set by id.

use super::data::Data;
use crate::sts3215::packet as one;
use crate::xl330::packet as two;

/// Id that all servos listen to.
pub(crate) const ALL: u8 = 0xFE;
/// Asks who is there, without registers.
pub(crate) const PING: u8 = 0x01;
/// Asks one for registers.
pub(crate) const READ: u8 = 0x02;
/// Sets registers of one.
pub(crate) const WRITE: u8 = 0x03;
/// Asks many for the same registers.
pub(crate) const SYNC_READ: u8 = 0x82;
/// Sets the same registers of many.
pub(crate) const SYNC_WRITE: u8 = 0x83;

/// Registers side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Block {
    pub address: u8,
    pub n: usize,
}

/// An answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer<'a> {
    pub id: u8,
    pub error: u8,
    pub data: Data<'a>,
}

/// How packets are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Protocol {
    /// Of Feetech's servos, and of older Dynamixels.
    One,
    /// Of newer Dynamixels.
    Two,
}

impl Protocol {
    /// Bytes of a question besides its parameters.
    pub(crate) fn question_bytes(self) -> usize {
        match self {
            Self::One => one::FRAME,
            Self::Two => two::FRAME,
        }
    }

    /// Bytes of an answer besides its data.
    pub(crate) fn answer_bytes(self) -> usize {
        match self {
            Self::One => one::FRAME,
            // The error is one more.
            Self::Two => two::FRAME + 1,
        }
    }

    /// Bytes of an address, and of a number of registers.
    pub(crate) fn address_bytes(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
        }
    }

    /// Puts a packet behind what is there.
    pub(crate) fn put(self, bytes: &mut Vec<u8>, id: u8, instruction: u8, parameters: &[&[u8]]) {
        match self {
            Self::One => one::put(bytes, id, instruction, parameters),
            Self::Two => two::put(bytes, id, instruction, parameters),
        }
    }

    /// Puts a packet that is about a block of registers.
    pub(crate) fn put_about(self, bytes: &mut Vec<u8>, id: u8, instruction: u8, block: Block, more: &[u8]) {
        let n = block.n as u8;
        match self {
            Self::One => self.put(bytes, id, instruction, &[&[block.address, n], more]),
            Self::Two => self.put(bytes, id, instruction, &[&[block.address, 0, n, 0], more]),
        }
    }

    /// Every whole answer with so many bytes of data that lies somewhere in what was received. What is broken hides no other.
    pub(crate) fn answers(self, received: &[u8], n_data: usize) -> impl Iterator<Item = Answer<'_>> {
        let mut at = 0;
        core::iter::from_fn(move || match self {
            Self::One => one::next_answer(received, &mut at, n_data),
            Self::Two => two::next_answer(received, &mut at, n_data),
        })
    }
}

/// Two registers as a number, the low byte first.
pub(crate) fn word(data: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([data[at], data[at + 1]])
}
