//! What the slave does when nobody commands any more: notices within its own time, and stops smoothly without help.

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

/// Brings a motion to rest: the speed falls at a constant rate, the direction stays.
#[derive(Clone, Copy, Debug)]
pub struct SmoothStop {
    deceleration_m_per_s2: f64,
    velocity_m_per_s: [f64; 3],
}

impl SmoothStop {
    /// At rest.
    pub fn new(deceleration_m_per_s2: f64) -> Self {
        Self { deceleration_m_per_s2, velocity_m_per_s: [0.0; 3] }
    }

    /// The motion that a stop would have to end, m/s per actuator.
    pub fn set_velocity(&mut self, velocity_m_per_s: [f64; 3]) {
        self.velocity_m_per_s = velocity_m_per_s;
    }

    /// Whether there is nothing left to stop.
    pub fn is_still(&self) -> bool {
        self.velocity_m_per_s == [0.0; 3]
    }

    /// Slows down for `elapsed_s` >= 0; returns the way that is covered meanwhile, m per actuator.
    pub fn slow_down(&mut self, elapsed_s: f64) -> [f64; 3] {
        let speed = crate::limiter::largest(self.velocity_m_per_s);
        if speed == 0.0 {
            return [0.0; 3];
        }
        let time_s = elapsed_s.min(speed / self.deceleration_m_per_s2);
        let end_part = 1.0 - time_s * self.deceleration_m_per_s2 / speed;
        let way = self.velocity_m_per_s.map(|v| v * time_s * 0.5 * (1.0 + end_part));
        // Below a nanometre per second it is rest, not a tail of rounding errors.
        let end = self.velocity_m_per_s.map(|v| v * end_part);
        self.velocity_m_per_s = if speed * end_part < 1e-9 { [0.0; 3] } else { end };
        way
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

    #[test]
    fn a_stop_covers_the_way_of_constant_deceleration_and_keeps_the_direction() {
        let mut stop = SmoothStop::new(1.0);
        stop.set_velocity([0.02, -0.01, -0.01]);
        let mut way = [0.0; 3];
        let mut n_steps = 0;
        while !stop.is_still() {
            let step = stop.slow_down(1e-3);
            assert!((step[1] + 0.5 * step[0]).abs() < 1e-15);
            way = core::array::from_fn(|i| way[i] + step[i]);
            n_steps += 1;
        }
        assert_eq!(n_steps, 20, "20 mm/s at 1 m/s2");
        assert!((way[0] - 0.02 * 0.02 / 2.0).abs() < 1e-12, "way {way:?}");
        assert_eq!(stop.slow_down(1e-3), [0.0; 3]);
    }
}
