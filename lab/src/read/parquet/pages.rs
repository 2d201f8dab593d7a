//! What the pages of a column claim, checked before the format's library takes memory for it.
//!
//! The library trusts a page's head: the size that it unpacks to and the number of its values. Heads are in Thrift's compact
//! protocol (struct PageHeader of parquet.thrift).

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// No page of a table is larger; writers make them of a megabyte.
const MOST_PAGE_BYTES: i64 = 64 << 20;
/// No head of a page is longer: its statistics hold two values.
const MOST_HEAD_BYTES: u64 = 1 << 16;
/// Fields within fields.
const MOST_DEPTH: usize = 8;

/// Field numbers of PageHeader and of the three structs in it.
const UNPACKED: i16 = 2;
const PACKED: i16 = 3;
const DATA: i16 = 5;
const DICTIONARY: i16 = 7;
const DATA_V2: i16 = 8;
const N_VALUES: i16 = 1;
const V2_NULLS: i16 = 2;
const V2_ROWS: i16 = 3;
const V2_LEVELS: [i16; 2] = [5, 6];
const ENCODING: i16 = 2;
const V2_ENCODING: i16 = 4;
const LEVEL_ENCODINGS: [i16; 2] = [3, 4];
/// Numbers of encodings: values as places in a dictionary, and those that levels can have.
const IN_DICTIONARY: [i64; 2] = [2, 8];
const OF_LEVELS: [i64; 2] = [3, 4];

/// Looks at every page of a column chunk.
pub(super) fn check(file: &mut File, begin: u64, n_bytes: u64, n_rows: u64) -> Result<(), String> {
    let end = begin.checked_add(n_bytes).ok_or("a column's length in it is too large")?;
    let mut at = begin;
    let mut n_values = 0_u64;
    let mut has_dictionary = false;
    while n_values < n_rows && at < end {
        file.seek(SeekFrom::Start(at)).map_err(|error| error.to_string())?;
        let mut bytes = Vec::new();
        file.take((end - at).min(MOST_HEAD_BYTES)).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        let mut thrift = Thrift { rest: &bytes };
        let mut head = Head::default();
        thrift.fields(0, &mut |path, value| head.take(path, value)).ok_or("the head of a page in it is damaged")?;
        has_dictionary |= head.n_dictionary.is_some();
        if head.needs_dictionary && !has_dictionary {
            return Err("a page in it needs a dictionary that is not there".to_owned());
        }
        n_values += head.n_values(n_rows - n_values)?;
        let n_head = (bytes.len() - thrift.rest.len()) as u64;
        at = at.saturating_add(n_head).saturating_add(head.packed.unsigned_abs());
    }
    if at > end || n_values < n_rows {
        return Err(format!("a column has {n_values} values in its pages, its head says {n_rows}"));
    }
    Ok(())
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Head {
    unpacked: i64,
    packed: i64,
    n_data: Option<i64>,
    n_dictionary: Option<i64>,
    n_nulls: i64,
    n_rows: Option<i64>,
    levels: i64,
    needs_dictionary: bool,
    has_other_levels: bool,
}

impl Head {
    fn take(&mut self, path: &[i16], value: i64) {
        match *path {
            [UNPACKED] => self.unpacked = value,
            [PACKED] => self.packed = value,
            [DATA | DATA_V2, N_VALUES] => self.n_data = Some(value),
            [DATA, ENCODING] | [DATA_V2, V2_ENCODING] => self.needs_dictionary = IN_DICTIONARY.contains(&value),
            [DATA, field] if LEVEL_ENCODINGS.contains(&field) => self.has_other_levels |= !OF_LEVELS.contains(&value),
            [DICTIONARY, N_VALUES] => self.n_dictionary = Some(value),
            [DATA_V2, V2_NULLS] => self.n_nulls = value,
            [DATA_V2, V2_ROWS] => self.n_rows = Some(value),
            [DATA_V2, field] if V2_LEVELS.contains(&field) => {
                self.levels = if value < 0 { i64::MAX } else { self.levels.saturating_add(value) };
            }
            _ => {}
        }
    }

    /// Values of a page of data, at most so many, if all of its claims can be true.
    fn n_values(&self, n_left: u64) -> Result<u64, String> {
        let Self { unpacked, packed, .. } = *self;
        if !(0..=MOST_PAGE_BYTES).contains(&unpacked) || !(0..=MOST_PAGE_BYTES).contains(&packed) {
            return Err(format!("a page in it claims {unpacked} bytes, expected at most {MOST_PAGE_BYTES}"));
        }
        if self.has_other_levels {
            return Err("the levels of a page in it are in an unknown encoding".to_owned());
        }
        if self.levels > unpacked.min(packed) {
            return Err("the levels of a page in it are longer than the page".to_owned());
        }
        // A value of a dictionary takes a byte or more; of other pages a bit may stand for many.
        if let Some(n) = self.n_dictionary.filter(|n| !(0..=unpacked).contains(n)) {
            return Err(format!("a dictionary in it claims {n} values in {unpacked} bytes"));
        }
        let n = self.n_data.unwrap_or(0);
        let is_rows = self.n_rows.is_none_or(|rows| rows == n);
        match u64::try_from(n).ok().filter(|n| *n <= n_left) {
            Some(n_values) if is_rows && (0..=n).contains(&self.n_nulls) => Ok(n_values),
            _ => Err(format!("a page in it claims {n} values, expected at most {n_left}")),
        }
    }
}

/// A reader of Thrift's compact protocol that gives every whole number with the numbers of its fields, and skips the rest.
struct Thrift<'a> {
    rest: &'a [u8],
}

impl Thrift<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn skip(&mut self, n: u64) -> Option<()> {
        self.rest = self.rest.get(usize::try_from(n).ok()?..)?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    fn fields(&mut self, depth: usize, take: &mut dyn FnMut(&[i16], i64)) -> Option<()> {
        if depth >= MOST_DEPTH {
            return None;
        }
        let mut number = 0_i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            number = match head >> 4 {
                0 => i16::try_from(self.zigzag()?).ok()?,
                delta => number.checked_add(i16::from(delta))?,
            };
            let mut inner = |path: &[i16], value: i64| {
                let path: Vec<i16> = [&[number], path].concat();
                take(&path, value);
            };
            self.value(head & 0x0f, depth, &mut inner)?;
        }
    }

    fn value(&mut self, sort: u8, depth: usize, take: &mut dyn FnMut(&[i16], i64)) -> Option<()> {
        match sort {
            // True and false stand in the head of their field.
            1 | 2 => Some(()),
            3 => self.skip(1),
            4..=6 => {
                take(&[], self.zigzag()?);
                Some(())
            }
            7 => self.skip(8),
            8 => {
                let n = self.varint()?;
                self.skip(n)
            }
            12 => self.fields(depth + 1, take),
            // Lists, sets and maps have no place in the head of a page.
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_s_claims_are_found_and_false_ones_refused() {
        // type 0, 80 bytes, 40 packed, data_page_header { 10 values, encoding 0 }
        let bytes = [0x15, 0x00, 0x15, 0xa0, 0x01, 0x15, 0x50, 0x2c, 0x15, 0x14, 0x15, 0x00, 0x00, 0x00, 0xff];
        let mut thrift = Thrift { rest: &bytes };
        let mut head = Head::default();
        thrift.fields(0, &mut |path, value| head.take(path, value)).expect("a head");
        assert_eq!((head.unpacked, head.packed, head.n_data, thrift.rest), (80, 40, Some(10), &[0xff][..]));
        assert_eq!(head.n_values(10), Ok(10));
        assert!(head.n_values(9).is_err());
        assert!(Head { unpacked: 1 << 31, ..head.clone() }.n_values(10).is_err());
        assert!(Head { n_dictionary: Some(81), ..head.clone() }.n_values(10).is_err());
        assert!(Head { levels: 41, ..head.clone() }.n_values(10).is_err());
        let mut plain = Head::default();
        plain.take(&[DATA, ENCODING], 8);
        plain.take(&[DATA, 3], 7);
        assert!(plain.needs_dictionary && plain.n_values(10).is_err_and(|why| why.contains("unknown encoding")));
        let nested = [0x1c; 40];
        assert!(Thrift { rest: &nested }.fields(0, &mut |_, _| {}).is_none());
    }
}
