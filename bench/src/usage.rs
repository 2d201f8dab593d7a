//! What processes took of the machine: time on a core, and switches from one process to another.

use core::ops::{Add, AddAssign, Sub};
use serde::{Deserialize, Serialize};
use std::fs;

/// Counters of one or several processes, over all their threads; the difference of two is what was taken in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Usage {
    /// Time on a core, ns.
    pub cpu_ns: u64,
    /// Context switches, voluntary and not.
    pub n_switches: u64,
    /// CLOCK_MONOTONIC at which it was taken, or the time between two, ns.
    pub wall_ns: u64,
}

impl Usage {
    /// The counters of a process (`self` or a process id) at this moment; zero for one that has ended.
    pub fn of(process: &str) -> Self {
        let mut usage = Self { wall_ns: krait_ipc::clock::monotonic_ns().unsigned_abs(), ..Self::default() };
        let Ok(threads) = fs::read_dir(format!("/proc/{process}/task")) else { return usage };
        for thread in threads.flatten() {
            let read = |name: &str| fs::read_to_string(thread.path().join(name)).unwrap_or_default();
            let on_core = read("schedstat");
            usage.cpu_ns += on_core.split(' ').next().and_then(|ns| ns.parse::<u64>().ok()).unwrap_or(0);
            let status = read("status");
            let switches = status.lines().filter(|line| line.contains("voluntary_ctxt_switches:"));
            usage.n_switches +=
                switches.filter_map(|line| line.split_whitespace().last()?.parse::<u64>().ok()).sum::<u64>();
        }
        usage
    }

    /// Part of one core that was used, 0 to the number of cores.
    pub fn cpu_share(&self) -> f64 {
        self.cpu_ns as f64 / (self.wall_ns as f64).max(1.0)
    }

    /// Adds another process of the same time.
    #[must_use]
    pub fn beside(self, other: Self) -> Self {
        Self {
            cpu_ns: self.cpu_ns + other.cpu_ns,
            n_switches: self.n_switches + other.n_switches,
            wall_ns: self.wall_ns.max(other.wall_ns),
        }
    }
}

impl Sub for Usage {
    type Output = Self;
    fn sub(self, before: Self) -> Self {
        Self {
            cpu_ns: self.cpu_ns.saturating_sub(before.cpu_ns),
            n_switches: self.n_switches.saturating_sub(before.n_switches),
            wall_ns: self.wall_ns.saturating_sub(before.wall_ns),
        }
    }
}

impl Add for Usage {
    type Output = Self;
    fn add(self, later: Self) -> Self {
        Self {
            cpu_ns: self.cpu_ns + later.cpu_ns,
            n_switches: self.n_switches + later.n_switches,
            wall_ns: self.wall_ns + later.wall_ns,
        }
    }
}

impl AddAssign for Usage {
    fn add_assign(&mut self, later: Self) {
        *self = *self + later;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_computes_uses_a_core_and_one_that_has_gone_uses_nothing() {
        let before = Usage::of("self");
        let mut x = 1u64;
        while (Usage::of("self") - before).wall_ns < 60_000_000 {
            for _ in 0..100_000 {
                x = std::hint::black_box(x.wrapping_mul(6_364_136_223_846_793_005));
            }
        }
        let used = Usage::of("self") - before;
        assert!(used.cpu_ns > 0, "{used:?}");
        assert_eq!(Usage::of("0").cpu_ns, 0);
    }
}
