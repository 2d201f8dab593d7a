//! Whether the machine itself stood still while a fault was tried: on each core a thread above the chain's priority that does
//! nothing but wake up. What keeps it from waking is no process of krait's.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::{Cores, Priority, Process, Realtime, allowed_cores, clock};
use std::sync::Arc;
use std::thread::JoinHandle;

/// How often a core must wake up.
const EVERY: Duration = Duration::from_millis(2);
/// A gap between two wakings that is noted, ns.
const NOTED_NS: i64 = 5_000_000;

/// A span in which a core ran nothing of ours, ns.
type Gap = (i64, i64);

/// Threads that listen on every core that this process may use.
pub struct Pauses {
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Vec<Gap>>>,
}

impl Pauses {
    /// Begins to listen, above a priority of the chain's where that is allowed.
    ///
    /// # Errors
    /// A thread could not be started.
    pub fn above(priority: u8) -> anyhow::Result<Self> {
        let mut listening = Self { is_over: Arc::default(), threads: Vec::new() };
        for core in allowed_cores() {
            let priority = Priority::Fixed(priority + 1);
            let wish = Realtime { priority, cores: Cores::Named(vec![core]), ..Realtime::ORDINARY };
            let is_over = listening.is_over.clone();
            let thread = std::thread::Builder::new().name(format!("core {core}"));
            listening.threads.push(thread.spawn(move || listen(&wish, &is_over))?);
        }
        Ok(listening)
    }

    /// Ends; the longest pause that any core had between two instants, ms, 0 where none could hide a stall of the chain, which is half
    /// of the silence that ends its motion.
    pub fn longest_ms(self, (from_ns, to_ns): (i64, i64), silence_ns: i64) -> f64 {
        self.is_over.store(true, Ordering::Relaxed);
        let gaps = self.threads.into_iter().filter_map(|thread| thread.join().ok()).flatten();
        let within = gaps.filter(|(begin, end)| *end >= from_ns && *begin <= to_ns && 2 * (end - begin) > silence_ns);
        within.map(|(begin, end)| (end - begin) as f64 * 1e-6).fold(0.0, f64::max)
    }
}

/// Sleeps and wakes up, and notes when that took too long.
fn listen(wish: &Realtime, is_over: &AtomicBool) -> Vec<Gap> {
    // Without the priority a busy machine keeps it from waking too, as it does the chain.
    let refused = Process::Slave.core_turn().map(|turn| wish.apply(turn, ""));
    for refused in refused.into_iter().flatten() {
        tracing::debug!("{refused}");
    }
    let mut gaps = Vec::new();
    let mut before_ns = clock::monotonic_ns();
    while !is_over.load(Ordering::Relaxed) {
        std::thread::sleep(EVERY);
        let now_ns = clock::monotonic_ns();
        if now_ns - before_ns > NOTED_NS {
            gaps.push((before_ns, now_ns));
        }
        before_ns = now_ns;
    }
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the watchdog allows, ns.
    const SILENCE_NS: i64 = 50_000_000;

    #[test]
    fn a_gap_counts_where_it_meets_the_span_that_is_asked_for() {
        let with = |gap: Gap| Pauses { is_over: Arc::default(), threads: vec![std::thread::spawn(move || vec![gap])] };
        assert_eq!(with((10_000_000, 40_000_000)).longest_ms((0, 20_000_000), SILENCE_NS), 30.0);
        assert_eq!(with((10_000_000, 40_000_000)).longest_ms((40_000_000, 50_000_000), SILENCE_NS), 30.0);
        assert_eq!(with((10_000_000, 40_000_000)).longest_ms((41_000_000, 50_000_000), SILENCE_NS), 0.0);
    }

    #[test]
    fn a_fault_that_is_silent_itself_leaves_the_machine_less() {
        let with = |gap: Gap| Pauses { is_over: Arc::default(), threads: vec![std::thread::spawn(move || vec![gap])] };
        assert_eq!(with((10_000_000, 30_000_000)).longest_ms((0, 50_000_000), SILENCE_NS), 0.0);
        assert_eq!(with((10_000_000, 30_000_000)).longest_ms((0, 50_000_000), SILENCE_NS - 20_000_000), 20.0);
    }

    #[test]
    fn every_core_is_listened_to_until_the_end() {
        let listening = Pauses::above(0).expect("threads");
        assert!(listening.threads.len() >= std::thread::available_parallelism().expect("cores").get());
        std::thread::sleep(4 * EVERY);
        assert!(listening.threads.iter().all(|thread| !thread.is_finished()));
        let longest_ms = listening.longest_ms((0, i64::MAX), SILENCE_NS);
        assert!(longest_ms == 0.0 || longest_ms > 0.5e-6 * SILENCE_NS as f64, "{longest_ms} ms");
    }
}
