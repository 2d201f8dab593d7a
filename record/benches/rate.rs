//! What recording a fast chain costs: `cargo bench -p krait-record --bench rate -- 8000 60` for 8 kHz over 60 s.
//!
//! The recorder is a process of its own, as in a chain, and reports its own use of the processor and of memory.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a measurement prints, and a panic ends it")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{fresh_path, plausible};
use core::time::Duration;
use krait_ipc::message::{Command, Health, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_ipc::{Bus, Process, ReadOptions, Writer, clock, health_channel};
use krait_record::{RecordConfig, Recording, run};
use krait_schema::{Channel, Sample};
use rustix::process::{Pid, Signal, kill_process};
use std::process::{Command as Program, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

const RECORDER: &str = "--recorder";

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    match &arguments[..] {
        [first, instance, path] if first == RECORDER => record(instance, path),
        [rate_hz, length_s] => chain(rate_hz.parse().expect("a rate, Hz"), length_s.parse().expect("a length, s")),
        _ => chain(8000, 10),
    }
}

struct Writers {
    input: Writer<OperatorInput>,
    setpoint: Writer<Setpoint>,
    command: Writer<Command>,
    state: Writer<SlaveState>,
    shape: Writer<Shape>,
    model_update: Writer<ModelUpdate>,
}

fn writer<M: Message>(bus: &Bus) -> Writer<M> {
    bus.writer().expect("writer")
}

impl Writers {
    fn send(&mut self, channel: Channel, sequence: u64, now_ns: i64) {
        match plausible(channel, sequence, now_ns) {
            Sample::Input(m) => self.input.send(&m),
            Sample::Setpoint(m) => self.setpoint.send(&m),
            Sample::Command(m) => self.command.send(&m),
            Sample::State(m) => self.state.send(&m),
            Sample::Shape(m) => self.shape.send(&m),
            Sample::ModelUpdate(m) => self.model_update.send(&m),
            _ => Ok(()),
        }
        .expect("sent");
    }
}

fn chain(rate_hz: u64, length_s: u64) {
    let path = fresh_path("rate.mcap");
    let instance = format!("rate-{}", std::process::id());
    let bus = Bus::open(&instance, "bench").expect("bus");
    let mut health = bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::waking()).expect("reader");
    let recorder = Program::new(std::env::current_exe().expect("this bench"))
        .args([RECORDER, &instance, &path.display().to_string()])
        .stdout(Stdio::piped())
        .spawn()
        .expect("started");
    while !health.wait(Duration::from_secs(10)).expect("wait") {}
    let mut writers = Writers {
        input: writer(&bus),
        setpoint: writer(&bus),
        command: writer(&bus),
        state: writer(&bus),
        shape: writer(&bus),
        model_update: writer(&bus),
    };
    let begun_ns = clock::monotonic_ns();
    let (mut n_sent, mut n_seen) = (0, 0);
    while n_sent < rate_hz * length_s {
        let now_ns = clock::monotonic_ns();
        let n_due = ((now_ns - begun_ns) as u64 * rate_hz / 1_000_000_000).min(rate_hz * length_s);
        for sequence in n_sent + 1..=n_due {
            for channel in [Channel::Input, Channel::Setpoint, Channel::Command, Channel::State] {
                writers.send(channel, sequence, now_ns);
            }
            // A camera at a 60 Hz beside it.
            if sequence * 60 / rate_hz > n_seen {
                n_seen += 1;
                writers.send(Channel::Shape, n_seen, now_ns);
                writers.send(Channel::ModelUpdate, n_seen, now_ns);
            }
        }
        n_sent = n_due;
        thread::sleep(Duration::from_micros(500));
    }
    let took_s = (clock::monotonic_ns() - begun_ns) as f64 * 1e-9;
    let pid = Pid::from_raw(recorder.id().cast_signed()).expect("a pid");
    kill_process(pid, Signal::TERM).expect("told to end");
    let output = recorder.wait_with_output().expect("ended");
    println!("{rate_hz} Hz on four channels for {took_s:.1} s: {}", String::from_utf8_lossy(&output.stdout).trim());
    let contents = Recording::open(&path).expect("opened").contents().clone();
    println!(
        "in the file: {} commands of {n_sent}; missing: {:?}",
        contents.channels[&Channel::Command].n_messages,
        contents.missing
    );
}

/// The recorder's process: ends on SIGTERM.
fn record(instance: &str, path: &str) {
    let stop = std::sync::Arc::new(AtomicBool::new(false));
    signal_hook::flag::register(signal_hook::consts::SIGTERM, stop.clone()).expect("a signal can be heard");
    let bus = Bus::open(instance, "record").expect("bus");
    let config = RecordConfig { path: Some(path.into()), ..RecordConfig::default() };
    let (begun_ns, begun_cpu_s) = (clock::monotonic_ns(), cpu_s());
    let early_kb = thread::scope(|scope| {
        let early = scope.spawn(|| {
            // After two seconds every buffer has been in use.
            for _ in 0..20 {
                thread::sleep(Duration::from_millis(100));
                if stop.load(Ordering::Relaxed) {
                    break;
                }
            }
            peak_kb()
        });
        let report = run(&bus, &config, || stop.load(Ordering::Relaxed)).expect("recorded");
        let total = report.status.total();
        let part = (cpu_s() - begun_cpu_s) / ((clock::monotonic_ns() - begun_ns) as f64 * 1e-9);
        print!(
            "{:.1} % of one core; {} written, {} dropped, {} lost; {} bytes",
            100.0 * part,
            total.n_written,
            total.n_dropped,
            total.n_lost,
            report.outcome.expect("ended in order")
        );
        early.join().expect("no panic")
    });
    println!("; peak memory {} kB after 2 s, {} kB at the end", early_kb, peak_kb());
}

/// Time that this process has spent on a processor, s.
fn cpu_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Most memory that this process has ever held, shared memory included, kB.
fn peak_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).expect("a peak");
    line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("kB")
}
