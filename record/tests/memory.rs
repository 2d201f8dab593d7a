//! What a recording keeps in memory while it is written: its index, and nothing else that grows.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

mod common;

use common::{chain, fresh_path};
use core::cell::Cell;
use krait_record::{About, DrawnMachine, RecordConfig, RecordingWriter, Views};
use krait_schema::Sample;
use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeMap;

struct Counting;

thread_local! {
    /// Bytes that this thread holds.
    static N_BYTES: Cell<i64> = const { Cell::new(0) };
}

#[allow(unsafe_code)]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        N_BYTES.set(N_BYTES.get() + layout.size() as i64);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        N_BYTES.set(N_BYTES.get() - layout.size() as i64);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Bytes of memory that a closed chunk may leave behind until its file ends: its entry in the index.
const MOST_PER_CHUNK: i64 = 1500;
/// Bytes that the index of one file may come to with the default settings.
const MOST_PER_FILE: i64 = 200 << 20;

#[test]
fn a_chunk_leaves_its_entry_in_the_index_and_a_file_ends_before_that_is_much() {
    let about = About::run("memory", &BTreeMap::new(), Vec::new());
    let views = Views::new(Some(&DrawnMachine::default()), 30).expect("the default machine");
    let path = fresh_path("memory.mcap");
    let mut writer = RecordingWriter::create(&path, 256 * 1024, &about).expect("created").with_views(Some(views));
    let chunk: Vec<Sample> = chain(50, 1_000_000_000).collect();
    let mut write = |n_chunks: i64| {
        let before = N_BYTES.get();
        for _ in 0..n_chunks {
            for sample in &chunk {
                writer.write(sample, sample.sample_ns()).expect("written");
            }
            writer.flush().expect("flushed");
        }
        N_BYTES.get() - before
    };
    write(100);
    let n_chunks = 4000;
    let per_chunk = write(n_chunks) / n_chunks;
    assert!((1..MOST_PER_CHUNK).contains(&per_chunk), "{per_chunk} bytes of memory per chunk");
    let n_before_end = N_BYTES.get();
    writer.finish(&BTreeMap::new()).expect("finished");
    assert!(N_BYTES.get() < n_before_end - n_chunks * per_chunk / 2, "the end of a file gives its index back");

    let RecordConfig { rotate_bytes, rotate_s, flush_ms, chunk_bytes, .. } = RecordConfig::default();
    assert!(rotate_bytes > 0 && rotate_s > 0, "a file ends by itself");
    // Chunks that a flush has closed, and full ones that shrink to no less than a tenth.
    let n_by_time = rotate_s * 1000 / flush_ms;
    let n_by_size = rotate_bytes * 10 / chunk_bytes as u64;
    let most = (n_by_time + n_by_size) as i64 * per_chunk;
    assert!(most < MOST_PER_FILE, "{most} bytes of index in one file");
}
