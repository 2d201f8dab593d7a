//! From ways to speeds: what a mouse tells is how far it has gone, and a deflection is how fast it goes.
//!
//! v = sum of the counts of one window / T
//!
//! where: v: speed, counts/s; T: the window, 0.016 s. Windows follow each other by the stamps of the kernel's events, so that every
//! count is in exactly one; the first begins with the first count, and after silence there is none.

/// Length of a window, us: as often as the slowest SpaceMouse reports.
pub(crate) const WINDOW_US: i64 = 16_000;
/// Ways that a device may have.
const N_WAYS: usize = 16;

/// The windows of one device.
#[derive(Clone, Debug, Default)]
pub(crate) struct WayWindow {
    begin_us: Option<i64>,
    sums: [i32; N_WAYS],
    whole: [i32; N_WAYS],
}

impl WayWindow {
    /// Goes on to an instant, us; true if a window has ended.
    pub(crate) fn advance(&mut self, now_us: i64) -> bool {
        let Some(begin_us) = self.begin_us else { return false };
        let next_us = begin_us.saturating_add(WINDOW_US);
        if (begin_us..next_us).contains(&now_us) {
            return false;
        }
        let has_counts = self.sums != [0; N_WAYS];
        // A clock that was set, and a reader that slept, begin anew.
        let follows = has_counts && (next_us..next_us.saturating_add(WINDOW_US)).contains(&now_us);
        self.begin_us = follows.then_some(next_us);
        self.whole = std::mem::take(&mut self.sums);
        true
    }

    /// Takes counts that came at an instant to which it has gone on.
    pub(crate) fn add(&mut self, code: u16, counts: i32, now_us: i64) {
        if let Some(sum) = self.sums.get_mut(usize::from(code)) {
            *sum = sum.saturating_add(counts);
            self.begin_us.get_or_insert(now_us);
        }
    }

    /// Nothing came for the length of a window: the open one has ended, and after that one all stands still. True if that changes
    /// anything.
    pub(crate) fn end_by_silence(&mut self) -> bool {
        let is_moving = self.is_moving();
        self.begin_us = None;
        self.whole = std::mem::take(&mut self.sums);
        is_moving
    }

    /// Whether silence would change anything.
    pub(crate) fn is_moving(&self) -> bool {
        self.begin_us.is_some() || self.whole != [0; N_WAYS]
    }

    /// Speed in the newest whole window, counts/s.
    pub(crate) fn counts_per_s(&self, code: u16) -> f64 {
        self.whole.get(usize::from(code)).map_or(0.0, |sum| f64::from(*sum) * 1e6 / WINDOW_US as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_count_is_in_one_window_and_a_steady_way_is_a_steady_speed() {
        let mut window = WayWindow::default();
        let (mut n_windows, mut sum) = (0, 0.0);
        // 125 reports a second of 8 counts are 1000 counts/s.
        for k in 0..125_i64 {
            if window.advance(k * 8000) {
                n_windows += 1;
                assert_eq!(window.counts_per_s(0), 1000.0, "window {n_windows}");
                sum += window.counts_per_s(0) * 16.0;
            }
            window.add(0, 8, k * 8000);
        }
        assert!(window.end_by_silence() && window.is_moving());
        sum += window.counts_per_s(0) * 16.0;
        assert_eq!((n_windows, sum), (62, 1_000_000.0), "ms times counts/s");
        assert!(window.end_by_silence() && !window.is_moving() && !window.end_by_silence());
        assert_eq!(window.counts_per_s(0), 0.0);
    }

    #[test]
    fn a_window_without_counts_is_rest_and_a_clock_that_was_set_begins_anew() {
        let mut window = WayWindow::default();
        window.add(1, 5, 0);
        assert!(window.advance(16_000) && window.counts_per_s(1) > 0.0);
        assert!(window.advance(32_000), "without a count");
        assert_eq!((window.counts_per_s(1), window.is_moving()), (0.0, false));
        window.add(1, 5, i64::MAX);
        assert!(window.advance(i64::MIN) && window.counts_per_s(1) > 0.0);
        window.add(1, i32::MAX, i64::MIN);
        window.add(1, i32::MAX, i64::MIN);
        window.add(99, 1, i64::MIN);
        assert!(window.advance(0));
        assert_eq!(window.counts_per_s(1), f64::from(i32::MAX) * 62.5);
    }
}
