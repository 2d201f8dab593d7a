//! What this user may ask of the kernel: priority and locked memory.

use super::Finding;
use krait_ipc::{Priority, Realtime};
use rustix::process::{Resource, getrlimit};

/// A priority below the kernel's own threads for interrupts on PREEMPT_RT (50) would be held up by them; 80 is above.
const WANTED_PRIORITY: u8 = 80;

/// Whether SCHED_FIFO can be had: tried on a thread that ends at once.
pub fn rtprio() -> Finding {
    const NAME: &str = "real-time priority";
    let wish = Realtime { priority: Priority::Fixed(WANTED_PRIORITY), ..Realtime::ORDINARY };
    let refused = std::thread::scope(|scope| scope.spawn(|| wish.apply(0, "")).join());
    let limit = getrlimit(Resource::Rtprio).current.map_or_else(|| "unlimited".to_owned(), |limit| limit.to_string());
    if refused.is_ok_and(|refused| refused.is_empty()) {
        let found = format!("SCHED_FIFO {WANTED_PRIORITY} is granted (limit `rtprio` {limit})");
        return Finding::good(NAME, found, "a chain on two cores or more runs before ordinary work by itself");
    }
    let mend = "echo \"$USER - rtprio 95\" | sudo tee /etc/security/limits.d/krait.conf, then log in again";
    let found = format!("SCHED_FIFO {WANTED_PRIORITY} is refused (limit `rtprio` {limit})");
    Finding::advice(
        NAME,
        found,
        "a chain shares its cores with ordinary work as an equal, and a browser beside it costs it latency",
        mend.to_owned(),
    )
}

/// Whether all memory of a process may be locked.
pub fn memlock() -> Finding {
    const NAME: &str = "locked memory";
    let limit = getrlimit(Resource::Memlock).current;
    let found = limit.map_or_else(|| "unlimited".to_owned(), |bytes| format!("limit `memlock` {} kB", bytes / 1024));
    if krait_ipc::may_lock_all() {
        let found = if limit.is_some() { format!("{found}, which does not bind this user") } else { found };
        return Finding::good(NAME, found, "a chain with `[realtime] lock_memory = true` never waits for a page");
    }
    let mend = "echo \"$USER - memlock unlimited\" | sudo tee -a /etc/security/limits.d/krait.conf, then log in again";
    Finding::advice(
        NAME,
        found,
        "a page that was swapped out or not touched yet stops a process in its step",
        mend.to_owned(),
    )
}
