//! The master's step allocates nothing, whatever arrives: counted, not believed.

#![allow(unsafe_code, reason = "a global allocator cannot be written without it; it only counts and forwards")]

use krait_master::{MasterConfig, MasterCore, RawReport, Recording, ScriptSample};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static N_ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is forwarded unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        N_ALLOCATIONS.with(|n| n.set(n.get() + 1));
        // SAFETY: as required of the caller.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as required of the caller.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn n_allocations() -> u64 {
    N_ALLOCATIONS.with(Cell::get)
}

#[test]
fn the_counter_counts() {
    let before = n_allocations();
    std::hint::black_box(Vec::<u8>::with_capacity(10));
    assert_eq!(n_allocations(), before + 1);
}

#[test]
fn no_report_tick_or_event_allocates() {
    let recording = Recording::shipped().expect("built in");
    let mut core = MasterCore::new(&MasterConfig::default()).expect("default");
    let before = n_allocations();
    let mut n_moving = 0;
    for (stamp_ns, bytes) in recording.reports() {
        std::hint::black_box(core.on_report(bytes, stamp_ns)).expect("report");
        n_moving += u32::from(core.on_tick(stamp_ns).tip_vel_in_view_m_per_s != [0.0; 3]);
        std::hint::black_box(core.on_report(RawReport::clipped(&[9; 70]).as_bytes(), stamp_ns)).expect_err("refused");
    }
    core.on_unplugged();
    core.on_plugged();
    core.on_drained(3);
    core.on_script(ScriptSample { tip_vel_in_view_m_per_s: [0.01; 3], is_present: true, is_clutched: false });
    std::hint::black_box(core.on_tick(i64::MAX));
    core.on_ended();
    std::hint::black_box(core.on_tick(i64::MAX));
    assert_eq!(n_allocations(), before);
    assert!(n_moving > 1000, "the way through the operator's mapping was taken {n_moving} times");
}
