//! Files made to fill a reader's memory: they are read in little, and what could not be held is named.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

mod common;

use common::{fresh_path, places_of};
use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use krait_record::Recording;
use mcap::records::MessageHeader;
use std::alloc::{GlobalAlloc, Layout, System};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

struct Counting;

static N_BYTES: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[allow(unsafe_code)]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = N_BYTES.fetch_add(layout.size(), Relaxed) + layout.size();
        PEAK.fetch_max(now, Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        N_BYTES.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What a reader may hold at once, bytes.
const MOST: usize = 64 << 20;

/// A file of krait's profile whose one chunk unpacks to so many bytes of nothing.
fn bomb(path: &Path, n_bytes: usize) {
    let options = mcap::WriteOptions::new()
        .profile("krait")
        .compression(Some(mcap::Compression::Zstd))
        .chunk_size(Some(u64::MAX / 2));
    let mut writer = options.create(File::create(path).expect("made")).expect("begun");
    let channel = writer.add_channel(0, "/other", "none", &BTreeMap::new()).expect("added");
    let header = MessageHeader { channel_id: channel, sequence: 1, log_time: 1, publish_time: 1 };
    let piece = vec![0; 1 << 20];
    for _ in 0..n_bytes >> 20 {
        writer.write_to_known_channel(&header, &piece).expect("written");
    }
    writer.finish().expect("finished");
}

#[test]
fn a_small_file_that_unpacks_to_gigabytes_is_read_in_little_memory_and_named() {
    let path = fresh_path("bomb.mcap");
    bomb(&path, 1 << 30);
    let size = std::fs::metadata(&*path).expect("there").len();
    assert!(size < 300_000, "{size} bytes on disk");
    let before = N_BYTES.load(Relaxed);
    PEAK.store(before, Relaxed);
    let recording = Recording::open(&path).expect("opened");
    let n_samples = recording.samples().expect("there").count();
    let held = PEAK.load(Relaxed) - before;
    assert!(held < MOST, "{held} bytes held");
    let missing: Vec<String> = recording.contents().missing.iter().map(ToString::to_string).collect();
    assert!(n_samples == 0 && missing.iter().any(|what| what.contains("it unpacks to")), "{missing:?}");
}

#[test]
fn a_chunk_that_lies_about_its_size_yields_nothing() {
    let path = fresh_path("liar.mcap");
    bomb(&path, 64 << 20);
    let mut bytes = std::fs::read(&*path).expect("there");
    // Opcode and length, then a chunk's body, which begins with two times and the unpacked size.
    let at = places_of(6, &bytes)[0];
    bytes[at + 25..at + 33].copy_from_slice(&1000_u64.to_le_bytes());
    std::fs::write(&*path, &bytes).expect("written");
    let before = N_BYTES.load(Relaxed);
    PEAK.store(before, Relaxed);
    let recording = Recording::open(&path).expect("opened");
    assert!(PEAK.load(Relaxed) - before < MOST, "{} bytes held", PEAK.load(Relaxed) - before);
    assert!(!recording.contents().missing.is_empty(), "the chunk is named");
}
