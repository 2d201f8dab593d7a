//! How the slave notices, within its own time and without help, that nobody commands any more.

/// Knows when the last acceptable command came.
#[derive(Clone, Copy, Debug)]
pub struct Watchdog {
    limit_ns: i64,
    last_fresh_ns: Option<i64>,
}

impl Watchdog {
    /// A watchdog that bites `limit_ms` after the last command, and until the first one.
    pub fn new(limit_ms: f64) -> Self {
        Self { limit_ns: (limit_ms * 1e6) as i64, last_fresh_ns: None }
    }

    /// An acceptable command has come.
    pub fn feed(&mut self, now_ns: i64) {
        self.last_fresh_ns = Some(now_ns);
    }

    /// Time since the last acceptable command, ns; `None` before the first.
    pub fn age_ns(&self, now_ns: i64) -> Option<i64> {
        self.last_fresh_ns.map(|last| now_ns.saturating_sub(last))
    }

    /// Whether the last acceptable command is older than the limit, or there was none.
    pub fn is_stale(&self, now_ns: i64) -> bool {
        self.age_ns(now_ns).is_none_or(|age| age > self.limit_ns)
    }

    /// The limit, ms.
    pub fn limit_ms(&self) -> f64 {
        self.limit_ns as f64 * 1e-6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_watchdog_bites_before_the_first_command_and_after_its_limit() {
        let mut watchdog = Watchdog::new(50.0);
        assert!(watchdog.is_stale(0));
        watchdog.feed(1_000_000);
        assert!(!watchdog.is_stale(51_000_000));
        assert!(watchdog.is_stale(51_000_001));
    }
}
