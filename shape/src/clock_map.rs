//! From the clock of the program that measures to CLOCK_MONOTONIC of this machine.
//!
//! Problem: two clocks without a common zero, and lines that are under way for a while.
//!
//! Intuition: a line that was sent at s by its own clock and arrived at a by ours shows a - s = offset + time under way. The
//! time under way is never negative and sometimes small, so the smallest a - s of the last seconds is the offset, too large
//! by the smallest time under way.
//!
//! where: the smallest is taken over two windows of [`WINDOW_NS`], so that a clock that drifts by 50 ppm is followed to 1 ms.
//!
//! Failure: a connection whose every line takes long makes shapes look younger than they are, by that time. Programs that
//! know better say so (`clock` = "monotonic", "realtime", or `offset_ns`).

use crate::line::{Header, SourceClock};

/// Length of a window, ns.
const WINDOW_NS: i64 = 10_000_000_000;
/// An offset is used when it has been learnt for so long: lines that were sent before krait listened arrive late, ns.
const LEARN_NS: i64 = 1_000_000_000;

/// When a line was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// CLOCK_MONOTONIC, ns.
    pub monotonic_ns: i64,
    /// CLOCK_REALTIME, ns.
    pub realtime_ns: i64,
}

/// Maps one program's stamps.
#[derive(Clone, Copy, Debug)]
pub struct ClockMap {
    clock: SourceClock,
    stated_offset_ns: Option<i64>,
    /// The smallest a - s of this window and of the one before, ns.
    smallest_ns: [Option<i64>; 2],
    window_began_ns: Option<i64>,
    /// Arrival of the first line that said when it was sent.
    learns_since_ns: Option<i64>,
}

impl ClockMap {
    /// The map that a header asks for.
    pub fn new(header: &Header) -> Self {
        let (clock, stated_offset_ns) = (header.clock, header.offset_ns);
        Self { clock, stated_offset_ns, smallest_ns: [None; 2], window_began_ns: None, learns_since_ns: None }
    }

    /// CLOCK_MONOTONIC minus the program's clock when a line arrived that says when it was sent; `None` where that cannot be
    /// known: the clock is the program's own, without an offset, and lines have not said for a second when they were sent.
    pub fn offset_ns(&mut self, arrival: &Arrival, sent_ns: Option<i64>) -> Option<i64> {
        match self.clock {
            SourceClock::Monotonic => Some(0),
            SourceClock::Realtime => arrival.monotonic_ns.checked_sub(arrival.realtime_ns),
            SourceClock::Own => self.stated_offset_ns.or_else(|| self.learnt_ns(arrival.monotonic_ns, sent_ns)),
        }
    }

    fn learnt_ns(&mut self, arrival_ns: i64, sent_ns: Option<i64>) -> Option<i64> {
        let began_ns = *self.window_began_ns.get_or_insert(arrival_ns);
        if arrival_ns.saturating_sub(began_ns) >= WINDOW_NS {
            self.window_began_ns = Some(arrival_ns);
            self.smallest_ns = [None, self.smallest_ns[0].or(self.smallest_ns[1])];
        }
        if let Some(difference_ns) = sent_ns.and_then(|sent_ns| arrival_ns.checked_sub(sent_ns)) {
            let smallest = &mut self.smallest_ns[0];
            *smallest = Some(smallest.map_or(difference_ns, |before| before.min(difference_ns)));
            self.learns_since_ns.get_or_insert(arrival_ns);
        }
        if self.learns_since_ns.is_none_or(|since_ns| arrival_ns.saturating_sub(since_ns) < LEARN_NS) {
            return None;
        }
        self.smallest_ns.into_iter().flatten().min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn map(clock: SourceClock, offset_ns: Option<i64>) -> ClockMap {
        ClockMap::new(&Header { krait_shapes: 1, clock, offset_ns, source: String::new() })
    }

    fn at(monotonic_ns: i64) -> Arrival {
        Arrival { monotonic_ns, realtime_ns: monotonic_ns + 1_700_000_000_000_000_000 }
    }

    #[test]
    fn known_clocks_are_mapped_as_they_are() {
        assert_eq!(map(SourceClock::Monotonic, None).offset_ns(&at(5), Some(9)), Some(0));
        assert_eq!(map(SourceClock::Realtime, None).offset_ns(&at(5), None), Some(-1_700_000_000_000_000_000));
        assert_eq!(map(SourceClock::Own, Some(-3)).offset_ns(&at(5), Some(9)), Some(-3));
        assert_eq!(map(SourceClock::Own, None).offset_ns(&at(5), None), None, "nothing is known yet");
    }

    /// A clock 7 s behind that gains 50 us a second, lines under way for 0.3 to 20 ms: the offset is too large by no more
    /// than the smallest time under way and the drift of two windows.
    #[test]
    fn an_offset_is_learnt_and_followed() {
        let mut map = map(SourceClock::Own, None);
        let mut worst_ms = [0.0_f64; 2];
        for k in 0..60 * 120 {
            let sent_here_ns = k * 16_666_667;
            let own_ns = sent_here_ns - 7_000 * MS + sent_here_ns / 20_000;
            let under_way_ns = 300_000 + (k * 7919 % 197) * 100_000;
            let Some(offset_ns) = map.offset_ns(&at(sent_here_ns + under_way_ns), Some(own_ns)) else {
                assert!(k <= 61, "a second is long enough");
                continue;
            };
            let error_ms = (offset_ns - (sent_here_ns - own_ns)) as f64 * 1e-6;
            if k > 600 {
                worst_ms = [worst_ms[0].min(error_ms), worst_ms[1].max(error_ms)];
            }
        }
        assert!(worst_ms[0] >= 0.0 && worst_ms[1] < 0.3 + 1.0 + 0.1, "{worst_ms:?} ms");
    }

    /// Lines that were sent in half a second before krait listened arrive all at once: none of them makes the offset.
    #[test]
    fn a_backlog_does_not_shift_the_clock() {
        let mut map = map(SourceClock::Own, None);
        for k in 0..30 {
            assert_eq!(map.offset_ns(&at(500 * MS), Some(k * 16 * MS)), None);
        }
        let mut offsets = (30..120).filter_map(|k| map.offset_ns(&at(k * 16 * MS + 2 * MS), Some(k * 16 * MS)));
        assert!(offsets.all(|offset_ns| offset_ns == 2 * MS));
    }

    #[test]
    fn stamps_at_the_ends_of_the_numbers_do_no_harm() {
        let mut map = map(SourceClock::Own, None);
        for sent_ns in [i64::MIN, i64::MAX, 0] {
            for arrival_ns in [i64::MIN, i64::MAX, 0] {
                map.offset_ns(&at(arrival_ns.clamp(0, i64::MAX / 8)), Some(sent_ns));
                map.learnt_ns(arrival_ns, Some(sent_ns));
            }
        }
    }
}
