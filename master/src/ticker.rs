//! The fixed tick beside the reports: when it is due, and how many inputs may go out between two of them.

/// A grid of instants. A late tick is not made up for by a burst: what was missed is skipped and counted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ticker {
    due_ns: i64,
    period_ns: i64,
    n_ticks: u64,
    n_skipped: u64,
    may_tell_report: bool,
    may_tell_loss: bool,
}

impl Ticker {
    pub(crate) fn new(now_ns: i64, period_ns: i64) -> Self {
        Self {
            due_ns: now_ns + period_ns,
            period_ns,
            n_ticks: 0,
            n_skipped: 0,
            may_tell_report: true,
            may_tell_loss: true,
        }
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

    /// Whether an input is to be published now: at the tick, and between two ticks for the first report and for the first loss
    /// only. So a device that reports faster than the tick cannot drive the rate beyond twice the tick's, one that is lost again
    /// and again not beyond three times; and no loss waits for a tick because a report came just before.
    pub(crate) fn is_due(&mut self, now_ns: i64, has_report: bool, has_loss: bool) -> bool {
        if now_ns >= self.due_ns {
            let n_late = (now_ns - self.due_ns) / self.period_ns;
            self.due_ns += (n_late + 1) * self.period_ns;
            self.n_skipped += n_late.unsigned_abs();
            self.n_ticks += n_late.unsigned_abs() + 1;
            (self.may_tell_report, self.may_tell_loss) = (true, true);
            return true;
        }
        has_loss && std::mem::take(&mut self.may_tell_loss) || has_report && std::mem::take(&mut self.may_tell_report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_tick_is_published_once_and_the_missed_ones_are_counted() {
        let mut ticker = Ticker::new(0, 10);
        assert!(!ticker.is_due(9, false, false));
        assert!(ticker.is_due(10, false, false));
        assert!(ticker.is_due(57, false, false), "due at 20, and late by three whole periods");
        assert_eq!((ticker.due_ns(), ticker.n_skipped(), ticker.n_ticks()), (60, 3, 5));
        assert!(!ticker.is_due(59, false, false) && ticker.is_due(60, false, false), "the grid stays where it was");
    }

    #[test]
    fn a_flood_of_reports_cannot_more_than_double_the_rate() {
        let mut ticker = Ticker::new(0, 10);
        let n_published = (1..=1000).filter(|now_ns| ticker.is_due(*now_ns, true, false)).count();
        assert_eq!(n_published, 200);
    }

    #[test]
    fn a_loss_just_after_a_report_does_not_wait_for_the_tick_and_a_flood_of_both_cannot_more_than_triple_the_rate() {
        let mut ticker = Ticker::new(0, 10);
        assert!(ticker.is_due(1, true, false));
        assert!(ticker.is_due(2, true, true), "the loss is told at once");
        assert!(!ticker.is_due(3, true, true), "each once between two ticks");
        let n_published = (10..1010).filter(|now_ns| ticker.is_due(*now_ns, true, true)).count();
        assert_eq!(n_published, 300);
    }
}
