//! When to wake ahead of a message that comes at a steady rate.
//!
//! Problem: a core that has slept for most of a millisecond is slow to wake and has forgotten its caches; the message pays.
//! Intuition: wake a little early, take a warm-up step (the work of the message, its result discarded), and sleep again. The second sleep is so
//! short that the core (or the host beneath it) does not sleep deeply, and the message finds everything at hand. It costs
//! one wake-up more per message, whenever the guess was right or wrong.
//!
//! where: `period` is the mean distance of the messages that follow one another like those before; a hold-up, a pause and
//! what comes in a burst behind them are left out.
//!
//! The processes of a chain wait for one sample after the other, and a core lets in one of them at a time. So they wake one
//! after the other too, the slave first: a timer that rings late because the core (or the host) slept deeply is the slave's,
//! and the process that the sample comes to first finds a core that is awake. With one lead for all, a late timer made all of
//! them wake when the sample was there, and it waited for every warm-up step.
//!
//! Failure: messages at no steady rate. They come before the early wake-up and are taken at once, or after it and find a
//! core that has gone back to sleep: then nothing was gained, and nothing else lost.

/// How early the process behind `master` wakes: longer than the kernel's timers are late (50 us), short enough that the core
/// stays awake (docs/bench has the trials), ns.
const LEAD_NS: i64 = 200_000;
/// How much earlier each process behind that one, ns.
const STEP_NS: i64 = 150_000;
/// A period shorter than this lets no core sleep deeply, ns; longer than every lead.
const SHORTEST_PERIOD_NS: i64 = 800_000;
/// So many distances in a row that are unlike the period are the beginning of another.
const MOST_UNLIKE: u32 = 4;
/// What a new distance counts for beside those before.
const SHARE: i64 = 16;

/// Learns the rate of a channel's messages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead {
    lead_ns: i64,
    last_ns: i64,
    /// 0 as long as it is not known.
    period_ns: i64,
    n_unlike: u32,
}

impl Ahead {
    /// For a process that stands so many behind the one that a sample comes to first.
    pub fn new(n_behind: u8) -> Self {
        Self { lead_ns: LEAD_NS + STEP_NS * i64::from(n_behind), last_ns: 0, period_ns: 0, n_unlike: 0 }
    }

    /// A message has come.
    pub fn arrived(&mut self, now_ns: i64) {
        let gap_ns = now_ns - core::mem::replace(&mut self.last_ns, now_ns);
        if (self.period_ns / 2..=self.period_ns.saturating_mul(2)).contains(&gap_ns) {
            self.period_ns += (gap_ns - self.period_ns) / SHARE;
            self.n_unlike = 0;
            return;
        }
        self.n_unlike += 1;
        if self.n_unlike >= MOST_UNLIKE {
            (self.period_ns, self.n_unlike) = (gap_ns, 0);
        }
    }

    /// When to wake ahead of the next message; `None` when that would be in the past, or of no use.
    pub fn rise_ns(&self, now_ns: i64) -> Option<i64> {
        let rise_ns = self.last_ns + self.period_ns - self.lead_ns;
        (self.period_ns >= SHORTEST_PERIOD_NS && rise_ns > now_ns).then_some(rise_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: i64 = 1_000_000;

    fn after(gaps_ns: impl IntoIterator<Item = i64>) -> (Ahead, i64) {
        let (mut ahead, mut now_ns) = (Ahead::new(0), 5_000_000_000);
        ahead.arrived(now_ns);
        for gap_ns in gaps_ns {
            now_ns += gap_ns;
            ahead.arrived(now_ns);
        }
        (ahead, now_ns)
    }

    #[test]
    fn a_steady_rate_wakes_once_and_early() {
        let (ahead, now_ns) = after([PERIOD_NS; 4]);
        assert_eq!(ahead.rise_ns(now_ns), Some(now_ns + PERIOD_NS - LEAD_NS));
        assert_eq!(ahead.rise_ns(now_ns + PERIOD_NS - LEAD_NS), None, "it has woken already");
    }

    #[test]
    fn the_first_messages_say_nothing_and_a_pause_leaves_the_rate_as_it_was() {
        let (ahead, now_ns) = after([PERIOD_NS; 2]);
        assert_eq!(ahead.rise_ns(now_ns), None);
        let (ahead, now_ns) = after([vec![PERIOD_NS; 9], vec![700 * PERIOD_NS]].concat());
        assert_eq!(ahead.rise_ns(now_ns), Some(now_ns + PERIOD_NS - LEAD_NS));
    }

    #[test]
    fn another_rate_is_learnt() {
        let (ahead, now_ns) = after([[PERIOD_NS; 20], [4 * PERIOD_NS; 20]].concat());
        assert_eq!(ahead.rise_ns(now_ns), Some(now_ns + 4 * PERIOD_NS - LEAD_NS));
    }

    #[test]
    fn a_rate_at_which_no_core_sleeps_deeply_is_left_alone() {
        let (ahead, now_ns) = after([125_000; 20]);
        assert_eq!(ahead.rise_ns(now_ns), None);
    }

    #[test]
    fn a_hold_up_and_the_burst_behind_it_leave_the_rate_as_it_was() {
        // What has piled up is taken at one go, so the burst itself is not seen.
        let (ahead, now_ns) = after([vec![PERIOD_NS; 50], vec![10 * PERIOD_NS, 10_000, PERIOD_NS]].concat());
        assert_eq!(ahead.rise_ns(now_ns), Some(now_ns + PERIOD_NS - LEAD_NS));
    }

    #[test]
    fn the_nearer_to_the_drives_the_earlier_and_all_within_the_shortest_period() {
        let leads = [0, 1, 2].map(|n_behind| Ahead::new(n_behind).lead_ns);
        assert_eq!(leads, [200_000, 350_000, 500_000]);
        assert!(leads.iter().all(|lead_ns| *lead_ns < SHORTEST_PERIOD_NS));
    }
}
