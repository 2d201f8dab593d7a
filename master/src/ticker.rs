//! The fixed tick beside the reports: when it is due, and how many inputs may go out between two of them.

/// A grid of instants. A late tick is not made up for by a burst: what was missed is skipped and counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ticker {
    due_ns: i64,
    period_ns: i64,
    n_ticks: u64,
    n_skipped: u64,
    may_publish_at_once: bool,
}

impl Ticker {
    pub(crate) fn new(now_ns: i64, period_ns: i64) -> Self {
        Self { due_ns: now_ns + period_ns, period_ns, n_ticks: 0, n_skipped: 0, may_publish_at_once: true }
    }

    /// The next instant of the grid.
    pub(crate) fn due_ns(&self) -> i64 {
        self.due_ns
    }

    /// Ticks so far, skipped ones among them.
    pub(crate) fn n_ticks(&self) -> u64 {
        self.n_ticks
    }

    /// Ticks that were skipped because the process came too late for them.
    pub(crate) fn n_skipped(&self) -> u64 {
        self.n_skipped
    }

    /// Whether an input is to be published now: at the tick, and between two ticks for the first report only. So a device that
    /// reports faster than the tick cannot drive the rate beyond twice the tick's.
    pub(crate) fn is_due(&mut self, now_ns: i64, has_report: bool) -> bool {
        if now_ns >= self.due_ns {
            let n_late = (now_ns - self.due_ns) / self.period_ns;
            self.due_ns += (n_late + 1) * self.period_ns;
            self.n_skipped += n_late.unsigned_abs();
            self.n_ticks += n_late.unsigned_abs() + 1;
            self.may_publish_at_once = true;
            return true;
        }
        has_report && std::mem::take(&mut self.may_publish_at_once)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_tick_is_published_once_and_the_missed_ones_are_counted() {
        let mut ticker = Ticker::new(0, 10);
        assert!(!ticker.is_due(9, false));
        assert!(ticker.is_due(10, false));
        assert!(ticker.is_due(57, false), "due at 20, and late by three whole periods");
        assert_eq!((ticker.due_ns(), ticker.n_skipped(), ticker.n_ticks()), (60, 3, 5));
        assert!(!ticker.is_due(59, false) && ticker.is_due(60, false), "the grid stays where it was");
    }

    #[test]
    fn a_flood_of_reports_cannot_more_than_double_the_rate() {
        let mut ticker = Ticker::new(0, 10);
        let n_published = (1..=1000).filter(|now_ns| ticker.is_due(*now_ns, true)).count();
        assert_eq!(n_published, 200);
    }
}
