//! Where a recording and its repetition part: byte by byte first, and field by field once a byte differs.

use core::fmt::Debug;
use krait_ipc::Process;
use krait_schema::Sample;
use serde::Serialize;

/// The first place at which a recording and its repetition part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The process whose output differs.
    pub process: Process,
    /// Which run of the process in the recording, from 1: it counts from 1 again where it was started again.
    pub run: u64,
    /// Sequence number of the output.
    pub sequence: u64,
    /// The field.
    pub field: String,
    /// Its value in the recording.
    pub recorded: String,
    /// Its value now.
    pub repeated: String,
}

/// Compares samples by the bytes that a recording of them holds.
#[derive(Default)]
pub(crate) struct Bytes {
    recorded: Vec<u8>,
    repeated: Vec<u8>,
    /// Bytes compared so far.
    pub n_compared: u64,
}

impl Bytes {
    /// Whether two samples have the same bytes. A sample that cannot be encoded is like none.
    pub(crate) fn same(&mut self, recorded: &Sample, repeated: &Sample) -> bool {
        let encoded = krait_schema::encode(recorded, &mut self.recorded)
            .and_then(|()| krait_schema::encode(repeated, &mut self.repeated));
        self.n_compared += self.recorded.len() as u64;
        encoded.is_ok() && self.recorded == self.repeated
    }
}

/// The first field that differs: its name and both values. The debug format shows every bit of a float.
pub(crate) fn first_field(recorded: &impl Debug, repeated: &impl Debug) -> (String, String, String) {
    let (recorded, repeated) = (format!("{recorded:#?}"), format!("{repeated:#?}"));
    let mut field = String::new();
    for (was, is) in recorded.lines().zip(repeated.lines()) {
        if let Some((name, _)) = was.trim().split_once(": ") {
            field = name.to_owned();
        }
        if was != is {
            let value =
                |line: &str| line.trim().trim_start_matches(&format!("{field}: ")).trim_end_matches(',').to_owned();
            return (field.clone(), value(was), value(is));
        }
    }
    ("(bytes)".to_owned(), "other bytes".to_owned(), "other bytes".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    #[allow(dead_code, reason = "read through its debug format")]
    struct Pair {
        sequence: u64,
        q_m: [f64; 2],
    }

    #[test]
    fn the_first_field_that_differs_is_named_with_both_values() {
        let was = Pair { sequence: 3, q_m: [0.5, 1.0] };
        let is = Pair { sequence: 3, q_m: [0.5, f64::from_bits(1.0f64.to_bits() ^ 1)] };
        assert_eq!(first_field(&was, &is), ("q_m".to_owned(), "1.0".to_owned(), "1.0000000000000002".to_owned()));
        let is = Pair { sequence: 4, q_m: [0.5, 1.0] };
        assert_eq!(first_field(&was, &is).0, "sequence");
    }
}
