//! How late this machine wakes a process: on each core a thread sleeps to an instant, again and again, and looks how much
//! later it is.

use core::sync::atomic::{AtomicBool, Ordering};
use hdrhistogram::Histogram;
use krait_ipc::{Cores, Priority, Process, Realtime, allowed_cores, clock};
use krait_report::Quantiles;
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;
use serde::Serialize;

/// Time from one instant to the next, ns: the chain's own period.
const PERIOD_NS: i64 = 1_000_000;
/// Longest lateness that a histogram holds, ns (10 s).
const LONGEST_NS: u64 = 10_000_000_000;

/// Lateness of wake-ups on one core.
#[derive(Clone, Debug, Serialize)]
pub struct WakeUp {
    /// The core.
    pub core: usize,
    /// SCHED_FIFO priority that was granted; 0: time sharing.
    pub priority: u8,
    /// Wake-ups.
    pub n_samples: u64,
    /// How late, microseconds.
    pub late_us: Quantiles,
}

/// Measures every core that this process may use at once, with SCHED_FIFO where that is granted and `priority` is not 0.
/// Ends early when a stop is asked for.
pub fn measure(seconds: f64, priority: u8, stop: &AtomicBool) -> Vec<WakeUp> {
    std::thread::scope(|scope| {
        let threads: Vec<_> = allowed_cores()
            .into_iter()
            .map(|core| scope.spawn(move || on_core(core, seconds, priority, stop)))
            .collect();
        threads.into_iter().filter_map(|thread| thread.join().ok().flatten()).collect()
    })
}

fn on_core(core: usize, seconds: f64, priority: u8, stop: &AtomicBool) -> Option<WakeUp> {
    if !(Realtime { cores: Cores::Named(vec![core]), ..Realtime::ORDINARY }).apply(0, "").is_empty() {
        return None;
    }
    // The slave's turn has the priority itself; those before it have less.
    let is_granted = Realtime { priority: Priority::Fixed(priority), ..Realtime::ORDINARY }
        .apply(Process::Slave.core_turn()?, "")
        .is_empty();
    let mut histogram = Histogram::<u64>::new_with_bounds(1, LONGEST_NS, 3).ok()?;
    let mut due_ns = clock::monotonic_ns();
    let end_ns = due_ns + (seconds * 1e9) as i64;
    while due_ns < end_ns && !stop.load(Ordering::Relaxed) {
        due_ns += PERIOD_NS;
        let due = Timespec { tv_sec: due_ns / 1_000_000_000, tv_nsec: due_ns % 1_000_000_000 };
        if clock_nanosleep_absolute(ClockId::Monotonic, &due).is_err() {
            continue;
        }
        let now_ns = clock::monotonic_ns();
        histogram.saturating_record(u64::try_from(now_ns - due_ns).unwrap_or(0).clamp(1, LONGEST_NS));
        // Instants that have passed meanwhile are not slept to.
        due_ns = due_ns.max(now_ns - PERIOD_NS);
    }
    let late_us = Quantiles::of(&histogram);
    Some(WakeUp { core, priority: if is_granted { priority } else { 0 }, n_samples: histogram.len(), late_us })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_core_is_measured_and_no_wake_up_is_early() {
        let measured = measure(0.2, 0, &AtomicBool::new(false));
        assert!(!measured.is_empty());
        for core in measured {
            assert!(core.n_samples > 20 && core.late_us.p50 > 0.0 && core.late_us.max >= core.late_us.p99, "{core:?}");
        }
    }
}
