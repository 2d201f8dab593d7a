//! What recording costs on this machine: `cargo bench -p krait-record`.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a measurement prints, and a panic ends it")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{chain, fresh_path};
use krait_record::{About, Recording, RecordingWriter, Sample};
use std::collections::BTreeMap;

/// Length of the recording that is written, s.
const CHAIN_S: u64 = 60;

fn main() {
    let path = fresh_path("throughput.mcap");
    let samples: Vec<Sample> = chain(CHAIN_S * 1000, krait_ipc::clock::monotonic_ns()).collect();
    let about = About::run("bench", &BTreeMap::new(), Vec::new());
    let mut writer = RecordingWriter::create(&path, 256 * 1024, &about).expect("created");
    let begun_ns = krait_ipc::clock::monotonic_ns();
    for (idx, sample) in samples.iter().enumerate() {
        writer.write(sample, sample.sample_ns()).expect("written");
        // As often as the recorder does at 1 kHz.
        if idx % 418 == 417 {
            writer.flush().expect("flushed");
        }
    }
    let written_ns = krait_ipc::clock::monotonic_ns();
    let n_bytes = writer.finish(&BTreeMap::new()).expect("finished");
    let open_ns = krait_ipc::clock::monotonic_ns();
    let recording = Recording::open(&path).expect("opened");
    let opened_ns = krait_ipc::clock::monotonic_ns();
    let n_read = recording.samples().expect("there").filter(Result::is_ok).count();
    let read_ns = krait_ipc::clock::monotonic_ns();
    std::fs::remove_file(&path).expect("removed");
    assert_eq!(n_read, samples.len());
    let per_s = |n: usize, ns: i64| n as f64 / (ns as f64 * 1e-9);
    println!(
        "{} messages of {CHAIN_S} s: written at {:.0}/s, opened at {:.0}/s, read at {:.0}/s; {} bytes/s in the file",
        samples.len(),
        per_s(samples.len(), written_ns - begun_ns),
        per_s(samples.len(), opened_ns - open_ns),
        per_s(samples.len(), read_ns - opened_ns),
        n_bytes / CHAIN_S,
    );
}
