//! When a simulated camera exposes, and when what it exposed is handed over.

/// Frames that may be under way at once: more than the longest latency times the highest rate.
const N_FRAMES: usize = 64;

/// Exposes whenever an instant of its grid (multiples of the period on CLOCK_MONOTONIC) has passed; keeps frames until their
/// latency has passed.
#[derive(Clone, Debug)]
pub(crate) struct Shutter<T> {
    period_ns: i64,
    latency_ns: i64,
    last_grid: Option<i64>,
    frames: [Option<(i64, T)>; N_FRAMES],
    n_exposed: usize,
    n_handed_over: usize,
}

impl<T: Copy> Shutter<T> {
    pub(crate) fn new(rate_hz: f64, latency_s: f64) -> Self {
        Self {
            period_ns: (1e9 / rate_hz) as i64,
            latency_ns: (latency_s * 1e9) as i64,
            last_grid: None,
            frames: [None; N_FRAMES],
            n_exposed: 0,
            n_handed_over: 0,
        }
    }

    /// The instant to expose at, if one of the grid has passed since the last look; of several the newest.
    pub(crate) fn exposes(&mut self, stamp_ns: i64) -> Option<i64> {
        let grid = stamp_ns.div_euclid(self.period_ns);
        let seen = self.last_grid.replace(grid);
        seen.is_some_and(|seen| grid > seen).then_some(grid * self.period_ns)
    }

    /// Keeps a frame.
    pub(crate) fn put(&mut self, exposure_ns: i64, frame: T) {
        self.frames[self.n_exposed % N_FRAMES] = Some((exposure_ns, frame));
        self.n_exposed += 1;
        // A reader that never comes loses the oldest frames.
        self.n_handed_over = self.n_handed_over.max(self.n_exposed.saturating_sub(N_FRAMES));
    }

    /// The oldest frame that has become available.
    pub(crate) fn take(&mut self, stamp_ns: i64) -> Option<T> {
        if self.n_handed_over == self.n_exposed {
            return None;
        }
        let (exposure_ns, frame) = self.frames[self.n_handed_over % N_FRAMES]?;
        if stamp_ns < exposure_ns.saturating_add(self.latency_ns) {
            return None;
        }
        self.n_handed_over += 1;
        Some(frame)
    }
}
