//! The only place that reads a clock. Control steps never call this: they take time as an argument.

use rustix::time::{ClockId, clock_gettime};

/// CLOCK_MONOTONIC, nanoseconds.
pub fn monotonic_ns() -> i64 {
    nanos(ClockId::Monotonic)
}

/// CLOCK_REALTIME, nanoseconds since 1970; for file names and for the log times of recordings only.
pub fn wall_ns() -> i64 {
    nanos(ClockId::Realtime)
}

fn nanos(id: ClockId) -> i64 {
    let t = clock_gettime(id);
    t.tv_sec * 1_000_000_000 + t.tv_nsec
}
