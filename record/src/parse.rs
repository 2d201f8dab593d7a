//! Records as `mcap` reads them, once their texts are known to fit: it takes memory for a text of the length that stands there
//! before it looks whether so many bytes follow.

use mcap::records::{Record, op};

/// What a record holds.
///
/// # Errors
/// What is damaged, in words.
pub(crate) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    if texts_fit(opcode, &mut Rest(body)).is_none() {
        return Err("its lengths contradict each other".to_owned());
    }
    mcap::parse_record(opcode, body).map_err(|error| error.to_string())
}

/// `None` where a text or a map is longer than what is left of the record.
fn texts_fit(opcode: u8, rest: &mut Rest<'_>) -> Option<()> {
    match opcode {
        op::HEADER => rest.texts(2),
        op::SCHEMA => rest.skip(2)?.texts(2),
        op::CHANNEL => {
            rest.skip(4)?.texts(2)?;
            rest.map()
        }
        op::ATTACHMENT => rest.skip(16)?.texts(2),
        op::METADATA => {
            rest.texts(1)?;
            rest.map()
        }
        op::CHUNK_INDEX => {
            let n_offsets = rest.skip(32)?.length()?;
            rest.skip(n_offsets)?.skip(8)?.texts(1)
        }
        _ => Some(()),
    }
}

/// What has not been looked at yet.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn skip(&mut self, n: usize) -> Option<&mut Self> {
        self.0 = self.0.get(n..)?;
        Some(self)
    }

    fn length(&mut self) -> Option<usize> {
        let (length, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        usize::try_from(u32::from_le_bytes(*length)).ok()
    }

    fn texts(&mut self, n: usize) -> Option<()> {
        for _ in 0..n {
            let length = self.length()?;
            self.skip(length)?;
        }
        Some(())
    }

    /// Pairs of texts, in so many bytes.
    fn map(&mut self) -> Option<()> {
        let n_bytes = self.length()?;
        let end = self.0.len().checked_sub(n_bytes)?;
        while self.0.len() > end {
            self.texts(2)?;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
    }

    #[test]
    fn a_record_is_read_and_one_whose_text_claims_more_than_there_is_is_not() {
        let schema = [&[7, 0][..], &text("krait.Command"), &text("protobuf"), &0_u32.to_le_bytes()].concat();
        let pair = [text("key"), text("value")].concat();
        let map = [&(pair.len() as u32).to_le_bytes()[..], &pair].concat();
        let channel = [&[1, 0, 7, 0][..], &text("command"), &text("protobuf"), &map].concat();
        let metadata = [text("krait"), map].concat();
        let offsets = [&10_u32.to_le_bytes()[..], &[0; 10]].concat();
        let index = [&[0; 32][..], &offsets, &[0; 8], &text("zstd"), &[0; 16]].concat();
        let header = [text("krait"), text("library")].concat();
        for (opcode, body, texts_at) in [
            (op::SCHEMA, schema, [2, 19]),
            (op::CHANNEL, channel, [4, 15]),
            (op::METADATA, metadata, [0, 13]),
            (op::CHUNK_INDEX, index, [32, 54]),
            (op::HEADER, header, [0, 9]),
        ] {
            parse(opcode, &body).unwrap_or_else(|error| panic!("{opcode}: {error}"));
            for at in texts_at {
                let mut broken = body.clone();
                broken[at..at + 4].copy_from_slice(&0x3000_0000_u32.to_le_bytes());
                assert!(parse(opcode, &broken).is_err(), "{opcode} {at}");
            }
            for n in 0..body.len() {
                // Cut anywhere: whatever it says, it neither panics nor takes memory.
                drop(parse(opcode, &body[..n]));
            }
        }
    }
}
