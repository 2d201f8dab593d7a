//! What writing and reading cost on this machine: `cargo bench -p krait-record --bench throughput -- 3600` for an hour,
//! `... -- FILE.mcap` for reading a recording that is there already.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a measurement prints, and a panic ends it")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{chain, fresh_path};
use krait_ipc::clock::monotonic_ns;
use krait_record::columns::Columns;
use krait_record::{About, Contents, DrawnMachine, Recording, RecordingWriter, Views, samples_between};
use std::collections::BTreeMap;

/// Length of the recording that is written without an argument, s.
const DEFAULT_S: u64 = 60;
const MINUTE_NS: u64 = 60_000_000_000;

fn main() {
    if let Some(path) = std::env::args().skip(1).find(|argument| argument.ends_with(".mcap")) {
        let path = std::path::Path::new(&path);
        read(path, None);
        access(path);
        return;
    }
    let given = std::env::args().skip(1).find_map(|argument| argument.parse().ok());
    let length_s = given.unwrap_or(DEFAULT_S);
    let path = fresh_path("throughput.mcap");
    let (n_written, n_bytes) = write(&path, length_s);
    read(&path, Some(n_written));
    access(&path);
    println!("{} bytes, {} bytes per second of motion", n_bytes, n_bytes / length_s);
}

fn write(path: &std::path::Path, length_s: u64) -> (usize, u64) {
    let about = About::run("bench", &BTreeMap::new(), Vec::new());
    let views = Views::new(Some(&DrawnMachine::default()), 30).expect("the default machine");
    let mut writer = RecordingWriter::create(path, 256 * 1024, &about).expect("created").with_views(Some(views));
    let (mut n_written, mut making_ns) = (0, 0);
    let begun_ns = monotonic_ns();
    let mut samples = chain(length_s * 1000, begun_ns);
    loop {
        let making_since_ns = monotonic_ns();
        let batch: Vec<_> = samples.by_ref().take(100_000).collect();
        making_ns += monotonic_ns() - making_since_ns;
        if batch.is_empty() {
            break;
        }
        for sample in &batch {
            writer.write(sample, sample.sample_ns()).expect("written");
            n_written += 1;
            // As often as the recorder does at 1 kHz.
            if n_written % 209 == 0 {
                writer.flush().expect("flushed");
            }
        }
    }
    let n_bytes = writer.finish(&BTreeMap::new()).expect("finished");
    rate("written", n_written, monotonic_ns() - begun_ns - making_ns, length_s);
    (n_written, n_bytes)
}

fn read(path: &std::path::Path, n_written: Option<usize>) {
    let begun_ns = monotonic_ns();
    let recording = Recording::open(path).expect("opened");
    let took_ns = monotonic_ns() - begun_ns;
    let (first, last) = span(recording.contents());
    let length_s = (last - first) / 1_000_000_000;
    let n_held = recording.contents().channels.values().map(|channel| channel.n_messages as usize).sum();
    let n_bytes = std::fs::metadata(path).expect("there").len();
    println!("{n_bytes} bytes, {length_s} s, {} bytes per second", n_bytes / length_s.max(1));
    rate("opened and checked", n_held, took_ns, length_s);
    let begun_ns = monotonic_ns();
    let n_read = recording.samples().expect("there").filter(Result::is_ok).count();
    rate("read", n_read, monotonic_ns() - begun_ns, length_s);
    assert_eq!(n_read, n_written.unwrap_or(n_held));
    let begun_ns = monotonic_ns();
    let n_rows = Columns::of(&recording).expect("readable").n_rows();
    rate("read into columns (rows)", n_rows, monotonic_ns() - begun_ns, length_s);
}

/// A minute in the middle, or what there is of one.
fn access(path: &std::path::Path) {
    let (first, last) = span(Recording::open(path).expect("opened").contents());
    let from = first + (last - first) / 2;
    let begun_ns = monotonic_ns();
    let n_found = samples_between(path, from..from + MINUTE_NS).expect("read").len();
    println!("a minute in the middle: {n_found} messages in {:.3} s", (monotonic_ns() - begun_ns) as f64 * 1e-9);
}

/// First and last log time.
fn span(contents: &Contents) -> (u64, u64) {
    let spans = contents.channels.values().map(|c| (c.first_log_ns, c.last_log_ns));
    spans.fold((u64::MAX, 0), |(first, last), (a, b)| (first.min(a), last.max(b)))
}

fn rate(what: &str, n: usize, took_ns: i64, length_s: u64) {
    let took_s = took_ns as f64 * 1e-9;
    println!(
        "{what}: {n} in {took_s:.1} s, {:.0} per s, {:.0} times real time",
        n as f64 / took_s,
        length_s as f64 / took_s
    );
}
