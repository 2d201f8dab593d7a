//! How a CSV file separates its columns and writes its numbers: found in its first line and its first fraction.

use super::ReadError;
use std::path::Path;

/// Separators that are looked for; of equally frequent ones the first counts.
const DELIMITERS: [(u8, &str); 3] = [(b',', "comma"), (b';', "semicolon"), (b'\t', "tab")];
const UTF16: [&[u8]; 2] = [&[0xff, 0xfe], &[0xfe, 0xff]];

/// What separates the columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dialect {
    pub delimiter: u8,
}

impl Dialect {
    /// The dialect of a file that begins with these bytes.
    pub(super) fn of(path: &Path, start: &[u8]) -> Result<Self, ReadError> {
        if UTF16.iter().any(|mark| start.starts_with(mark)) {
            let reason = "the text is UTF-16; save it again as CSV in UTF-8".to_owned();
            return Err(ReadError::NotCsv { path: path.to_owned(), line: 1, reason });
        }
        let mut counts = [0_usize; DELIMITERS.len()];
        let mut is_quoted = false;
        for &byte in start.iter().take_while(|byte| **byte != b'\n') {
            is_quoted ^= byte == b'"';
            let place = DELIMITERS.iter().position(|(delimiter, _)| *delimiter == byte);
            if let Some(count) = place.filter(|_| !is_quoted).and_then(|place| counts.get_mut(place)) {
                *count += 1;
            }
        }
        let most = counts.iter().copied().max().unwrap_or(0);
        let found = DELIMITERS.iter().zip(counts).find(|(_, count)| *count == most);
        Ok(Self { delimiter: found.map_or(b',', |((delimiter, _), _)| *delimiter) })
    }

    /// The separator in a word.
    pub(crate) fn word(self) -> &'static str {
        DELIMITERS.iter().find(|(delimiter, _)| *delimiter == self.delimiter).map_or("comma", |(_, word)| word)
    }

    /// A reader of its numbers.
    pub(super) fn numbers(self) -> Numbers {
        Numbers { may_have_comma: self.delimiter != b',', mark: None }
    }
}

/// Reads numbers; the file's first fraction says whether fractions begin with a point or a comma.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Numbers {
    may_have_comma: bool,
    mark: Option<u8>,
}

impl Numbers {
    /// A finite number, or `None`; also for a fraction that is not written like the file's others.
    pub(super) fn parse(&mut self, cell: &[u8]) -> Option<f64> {
        let text = std::str::from_utf8(cell).ok()?;
        if !self.may_have_comma {
            return text.parse().ok().filter(|x: &f64| x.is_finite());
        }
        let mark = cell.iter().copied().find(|byte| matches!(byte, b'.' | b','));
        if mark.is_some() && self.mark.is_some() && mark != self.mark {
            return None;
        }
        let number = match mark {
            Some(b',') => text.replacen(',', ".", 1).parse::<f64>(),
            _ => text.parse(),
        };
        let number = number.ok().filter(|x| x.is_finite())?;
        self.mark = self.mark.or(mark);
        Some(number)
    }

    /// Whether a fraction with a comma was read.
    pub(crate) fn has_decimal_comma(&self) -> bool {
        self.mark == Some(b',')
    }

    /// Whether a cell is a number but for the mark of its fraction.
    pub(super) fn has_other_mark(&self, cell: &[u8]) -> bool {
        self.mark.is_some() && Self { mark: None, ..*self }.parse(cell).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delimiter(start: &str) -> u8 {
        Dialect::of(Path::new("x.csv"), start.as_bytes()).expect("UTF-8").delimiter
    }

    #[test]
    fn the_separator_is_the_one_that_the_first_line_has_most() {
        assert_eq!(delimiter("t,a,b\n1;2;3;4;5\n"), b',');
        assert_eq!(delimiter("t;\"a,b,c\";d\r\n"), b';');
        assert_eq!(delimiter("t\tx, y\tz\n"), b'\t');
        assert_eq!(delimiter("alone\n"), b',');
        assert!(Dialect::of(Path::new("x.csv"), b"\xff\xfet\0;\0").is_err());
    }

    #[test]
    fn the_first_fraction_decides_how_fractions_begin() {
        let mut numbers = Dialect { delimiter: b';' }.numbers();
        assert_eq!(numbers.parse(b"12"), Some(12.0));
        assert_eq!(numbers.parse(b"-1,5e-3"), Some(-1.5e-3));
        assert!(numbers.has_decimal_comma());
        assert_eq!(numbers.parse(b"1.5"), None);
        assert!(numbers.has_other_mark(b"1.5") && !numbers.has_other_mark(b"one"));
        for wrong in ["1,234,5", "1.234,5", "nan", "", ",", "1,e"] {
            assert_eq!(numbers.parse(wrong.as_bytes()), None, "{wrong}");
        }
        let mut points = Dialect { delimiter: b',' }.numbers();
        assert_eq!((points.parse(b"1.5"), points.parse(b"1,5")), (Some(1.5), None));
    }
}
