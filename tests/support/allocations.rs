//! Counts the allocations of a thread. A test takes this file in with `#[path]`: a program has one allocator, and each test
//! file is a program.
//!
//! Of one thread: the test harness has a thread of its own, which allocates when it likes.

#![allow(unsafe_code, reason = "an allocator can only be watched by being one; this one only counts and forwards")]

use core::cell::Cell;
use std::alloc::{GlobalAlloc, Layout, System};

thread_local! {
    // Const and without a destructor: reading it never allocates.
    static N_ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed to the system's allocator unchanged; counting touches no memory that it manages.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        N_ALLOCATIONS.set(N_ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System` through `alloc` above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What this thread allocates while it works.
pub fn allocations_of(work: impl FnOnce()) -> u64 {
    let before = N_ALLOCATIONS.get();
    work();
    N_ALLOCATIONS.get() - before
}

/// What the calling thread has allocated since it began: for code that runs in a thread of somebody else's.
#[allow(dead_code, reason = "each test program uses a part")]
pub fn allocations_so_far() -> u64 {
    N_ALLOCATIONS.get()
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| drop(std::hint::black_box(Box::new(7)))), 1);
}
