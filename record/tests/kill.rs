//! A recorder that is killed at random moments leaves a readable file, from the first message to the last that was flushed.
//!
//! `KRAIT_KILLS=200 cargo test --release -p krait-record --test kill -- --nocapture` kills as often as it is told and prints
//! how much was missing.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a panic is how a test fails; a rig prints its figures"
)]

mod common;

use common::{fresh_path, plausible};
use core::time::Duration;
use krait_ipc::message::{Command, Health};
use krait_ipc::{Bus, Process, ReadOptions, Writer, clock, health_channel};
use krait_record::{Missing, RecordConfig, Recording, run};
use krait_schema::{Channel, Sample};
use std::process::Stdio;
use std::thread;

const INSTANCE: &str = "KRAIT_TEST_KILL_INSTANCE";
const PATH: &str = "KRAIT_TEST_KILL_PATH";
/// Kills without a wish.
const N_KILLS: u64 = 4;
/// Longest and shortest life of a recorder, ms.
const SHORTEST_MS: u64 = 150;
const LONGEST_MS: u64 = 1200;

#[test]
fn a_recorder_killed_at_random_moments_leaves_readable_files() {
    let wish = std::env::var("KRAIT_KILLS").ok().and_then(|n| n.parse().ok());
    let mut missing_ms: Vec<f64> = (0..wish.unwrap_or(N_KILLS)).map(kill_one).collect();
    missing_ms.sort_by(f64::total_cmp);
    let quantile = |part: f64| missing_ms[((missing_ms.len() - 1) as f64 * part) as usize];
    println!(
        "{} recorders killed, {} files readable; missing at the end, ms: median {:.1}, 90 % {:.1}, worst {:.1}; over 100 ms: {}",
        missing_ms.len(),
        missing_ms.len(),
        quantile(0.5),
        quantile(0.9),
        quantile(1.0),
        missing_ms.iter().filter(|ms| **ms > 100.0).count()
    );
}

/// Kills one recorder beside a writer at 1 kHz; returns how much of the time before the kill is missing, ms.
fn kill_one(idx: u64) -> f64 {
    let path = fresh_path(&format!("kill_{idx}.mcap"));
    let name = format!("kill-{}-{idx}", std::process::id());
    let bus = Bus::open(&name, "test").expect("bus");
    let mut health = bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::waking()).expect("reader");
    let mut recorder = std::process::Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "recorder_to_be_killed"])
        .env(INSTANCE, &name)
        .env(PATH, path.as_os_str())
        .stdout(Stdio::null())
        .spawn()
        .expect("started");
    assert!((0..100).any(|_| health.wait(Duration::from_millis(100)).expect("wait")), "it becomes ready");
    let mut commands: Writer<Command> = bus.writer().expect("writer");
    let life_ms = SHORTEST_MS + random(idx) % (LONGEST_MS - SHORTEST_MS);
    let (begun_ns, mut n_sent) = (clock::monotonic_ns(), 0);
    while clock::monotonic_ns() - begun_ns < life_ms as i64 * 1_000_000 {
        n_sent += 1;
        let Sample::Command(command) = plausible(Channel::Command, n_sent, clock::monotonic_ns()) else {
            panic!("a command")
        };
        commands.send(&command).expect("sent");
        thread::sleep(Duration::from_millis(1));
    }
    let killed_ns = clock::monotonic_ns();
    recorder.kill().expect("killed");
    recorder.wait().expect("gone");
    drop(commands);

    let recording = Recording::open(&path).expect("readable");
    let missing = &recording.contents().missing;
    assert!(matches!(missing[..], [Missing::End { .. } | Missing::Cut { .. }]), "{missing:?}");
    let samples = recording.samples().expect("there").map(|recorded| recorded.expect("readable").sample);
    let commands: Vec<_> = samples.filter_map(|s| if let Sample::Command(c) = s { Some(c) } else { None }).collect();
    assert!(commands.iter().map(|c| c.sequence).eq(1..=commands.len() as u64), "nothing is missing but the end");
    assert!(!commands.is_empty() && commands.len() as u64 <= n_sent);
    killed_ns.saturating_sub(commands.last().map_or(begun_ns, |c| c.sample_ns)) as f64 * 1e-6
}

/// Not a test: the child.
#[test]
fn recorder_to_be_killed() {
    let (Some(path), Ok(name)) = (std::env::var_os(PATH), std::env::var(INSTANCE)) else { return };
    let config = RecordConfig { path: Some(path.into()), ..RecordConfig::default() };
    run(&Bus::open(&name, "record").expect("bus"), &config, || false).expect("killed before it ends");
}

/// Another number for each kill and each run: SplitMix64.
fn random(idx: u64) -> u64 {
    let mut z = idx.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ clock::monotonic_ns().cast_unsigned();
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
