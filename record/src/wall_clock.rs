//! The bridge from CLOCK_MONOTONIC, which krait's stamps use, to the wall clock, which recordings are sorted by.

use krait_ipc::clock;

/// Pairs of readings tried; the tightest wins, so that being interrupted between two readings does no harm.
const N_TRIES: usize = 16;

/// CLOCK_REALTIME minus CLOCK_MONOTONIC, measured once, so that a correction of the wall clock during a recording cannot
/// tear its time axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WallClock {
    /// The difference, nanoseconds.
    pub offset_ns: i64,
}

impl WallClock {
    /// Measures the offset of this machine now.
    pub fn measure() -> Self {
        let mut best = (i64::MAX, 0);
        for _ in 0..N_TRIES {
            let before = clock::monotonic_ns();
            let wall = clock::wall_ns();
            let after = clock::monotonic_ns();
            best = best.min((after - before, wall - (before + (after - before) / 2)));
        }
        Self { offset_ns: best.1 }
    }

    /// Wall-clock time of a monotonic stamp, nanoseconds since 1970; a stamp that leads before 1970 gives 0.
    pub fn wall_ns(self, monotonic_ns: i64) -> u64 {
        u64::try_from(monotonic_ns.saturating_add(self.offset_ns)).unwrap_or(0)
    }
}

/// A wall-clock instant as `2026-03-09T141502Z`: sortable, and free of characters that a file name cannot have.
pub fn utc_text(wall_ns: i64) -> String {
    let seconds = wall_ns.div_euclid(1_000_000_000);
    let (days, of_day) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    // Howard Hinnant's civil_from_days: the year begins in March, so that the leap day is its last.
    let shifted = days + 719_468;
    let era = shifted.div_euclid(146_097);
    let of_era = shifted.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}{minute:02}{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_agree_with_the_calendar() {
        for (seconds, text) in [
            (0, "1970-01-01T000000Z"),
            (951_827_696, "2000-02-29T123456Z"),
            (1_772_323_199, "2026-02-28T235959Z"),
            (1_772_323_200, "2026-03-01T000000Z"),
            (4_107_542_400, "2100-03-01T000000Z"),
        ] {
            assert_eq!(utc_text(seconds * 1_000_000_000), text);
        }
    }

    #[test]
    fn a_stamp_from_nowhere_stays_on_the_time_axis() {
        let clock = WallClock { offset_ns: 1_700_000_000_000_000_000 };
        assert_eq!(clock.wall_ns(5), 1_700_000_000_000_000_005);
        assert_eq!(clock.wall_ns(i64::MIN), 0);
        assert_eq!(clock.wall_ns(i64::MAX), i64::MAX.cast_unsigned());
    }
}
