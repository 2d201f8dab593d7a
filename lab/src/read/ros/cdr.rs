//! CDR, the wire format of ROS 2: numbers aligned to their size, texts and sequences behind their length, in either byte order.

/// Bytes before the first value; alignment counts from behind them.
const N_HEAD: usize = 4;

/// Reads a message value by value; every length is checked against what is left.
#[derive(Clone, Debug)]
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Cdr<'a> {
    /// Begins behind the encapsulation header.
    ///
    /// # Errors
    /// It is none of plain CDR (version 1).
    pub(super) fn new(payload: &'a [u8]) -> Result<Self, String> {
        let head = payload.get(..N_HEAD).ok_or("it is shorter than the head of a CDR message")?;
        let is_little = match head {
            [0, 0, ..] => false,
            [0, 1, ..] => true,
            _ => return Err(format!("its encoding {:02x}{:02x} is not plain CDR", head[0], head[1])),
        };
        Ok(Self { bytes: payload.get(N_HEAD..).unwrap_or_default(), at: 0, is_little })
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(n).ok_or("a length in it is too large")?;
        let bytes = self.bytes.get(self.at..end).ok_or_else(|| {
            format!("{n} bytes are expected at byte {} of {}", self.at + N_HEAD, self.bytes.len() + N_HEAD)
        })?;
        self.at = end;
        Ok(bytes)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], String> {
        self.take(self.at.next_multiple_of(N) - self.at)?;
        let mut bytes: [u8; N] = self.take(N)?.try_into().map_err(|_length| "a number is cut")?;
        if !self.is_little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, String> {
        self.number().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Result<i32, String> {
        self.number().map(i32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, String> {
        self.number().map(f64::from_le_bytes)
    }

    /// Items of a sequence of which each takes at least `least` bytes.
    pub(super) fn count(&mut self, least: usize) -> Result<usize, String> {
        let n = self.u32()? as usize;
        let n_left = self.bytes.len() - self.at;
        if n.checked_mul(least).is_none_or(|n_bytes| n_bytes > n_left) {
            return Err(format!("it claims {n} items in {n_left} bytes"));
        }
        Ok(n)
    }

    /// A text; its length counts the zero at its end.
    pub(super) fn text(&mut self) -> Result<&'a str, String> {
        let n = self.count(1)?;
        let bytes = self.take(n)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).map_err(|_error| "a text in it is not UTF-8".to_owned())
    }

    pub(super) fn f64s(&mut self) -> Result<Vec<f64>, String> {
        let n = self.count(size_of::<f64>())?;
        (0..n).map(|_| self.f64()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_and_read_in_either_byte_order() {
        let little =
            [&[0, 1, 0, 0][..], &3_u32.to_le_bytes(), b"ab\0", &[0; 1], &(-2_i32).to_le_bytes(), &[0; 4]].concat();
        let little = [&little[..], &1.5_f64.to_le_bytes()].concat();
        let mut cdr = Cdr::new(&little).expect("CDR");
        assert_eq!((cdr.text(), cdr.i32(), cdr.f64()), (Ok("ab"), Ok(-2), Ok(1.5)));
        assert!(cdr.u32().is_err());
        let big = [&[0, 0, 0, 0][..], &1_u32.to_be_bytes(), &[0; 4], &2.5_f64.to_be_bytes()].concat();
        assert_eq!(Cdr::new(&big).and_then(|mut cdr| cdr.f64s()), Ok(vec![2.5]));
    }

    #[test]
    fn a_length_beyond_the_message_is_refused_before_memory_is_taken() {
        let claim = [&[0, 1, 0, 0][..], &u32::MAX.to_le_bytes(), &[0; 16]].concat();
        assert!(Cdr::new(&claim).and_then(|mut cdr| cdr.f64s()).is_err_and(|why| why.contains("4294967295")));
        assert!(Cdr::new(&claim).and_then(|mut cdr| cdr.text().map(str::len)).is_err());
        assert!(Cdr::new(&[0, 7, 0, 0]).is_err_and(|why| why.contains("0007")));
    }
}
