//! Time stamps: seconds since the Epoch in any unit are counted from the first row, exactly where they are whole numbers.

/// Seconds beyond which a stamp is no time since a recording began: three years.
pub(crate) const EPOCH_S: f64 = 1e8;

/// The first row's stamp, once it was read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stamps {
    first: Option<First>,
}

#[derive(Clone, Copy, Debug)]
enum First {
    /// Times count from the file's own zero.
    Zero,
    /// Nanoseconds since 1970 have 19 digits, which no floating-point number holds.
    Whole(i64),
    Part(f64),
}

impl Stamps {
    /// Time of a row, s, from the whole number in its cell, if it is one, the number, and the unit in s.
    pub(super) fn time_s(&mut self, whole: Option<i64>, number: f64, unit_s: f64) -> f64 {
        let first = *self.first.get_or_insert(match whole {
            _ if (number * unit_s).abs() < EPOCH_S => First::Zero,
            Some(whole) => First::Whole(whole),
            None => First::Part(number),
        });
        let since = match (first, whole) {
            (First::Zero, _) => number,
            (First::Whole(first), Some(whole)) => (i128::from(whole) - i128::from(first)) as f64,
            (First::Whole(first), None) => number - first as f64,
            (First::Part(first), _) => number - first,
        };
        since * unit_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_since_the_epoch_lose_nothing() {
        let mut stamps = Stamps::default();
        let mut time_s = |text: &str| stamps.time_s(text.parse().ok(), text.parse().expect("a number"), 1e-9);
        assert_eq!(time_s("1763809215000000001"), 0.0);
        assert!((time_s("1763809215000000008") - 7e-9).abs() < 1e-20);
        assert_eq!(time_s("1763809215020000001"), 0.02);
    }

    #[test]
    fn times_of_a_recording_stay_as_they_are() {
        let mut stamps = Stamps::default();
        assert_eq!(stamps.time_s(None, 12.5, 1.0), 12.5);
        assert_eq!(stamps.time_s(Some(13), 13.0, 1.0), 13.0);
        let mut stamps = Stamps::default();
        assert_eq!(stamps.time_s(None, 1_763_809_215.5, 1.0), 0.0);
        assert_eq!(stamps.time_s(Some(1_763_809_216), 1_763_809_216.0, 1.0), 0.5);
    }
}
