//! The recorder on a real bus: what is published is what is in the file, and what is not is counted.

use crate::common::{chain, fresh_path, plausible, words_of};
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{
    Command, DriveCycle, Health, Marker, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState, StateCommand,
};
use krait_ipc::{Bus, Process, ReadOptions, Reason, Reasons, Received, Writer, clock, health_channel};
use krait_record::{Missing, RecordConfig, RecordError, RecordReport, Recording, run};
use krait_schema::{Channel, Sample};
use rustix::process::{Resource, Rlimit, setrlimit};
use std::collections::BTreeMap;
use std::thread;

fn instance(test: &str) -> String {
    format!("rec-{test}-{}", std::process::id())
}

/// Writers of every channel but the recorder's own health.
struct Chain {
    input: Writer<OperatorInput>,
    setpoint: Writer<Setpoint>,
    command: Writer<Command>,
    state: Writer<SlaveState>,
    state_command: Writer<StateCommand>,
    shape: Writer<Shape>,
    model_update: Writer<ModelUpdate>,
    markers: Writer<Marker>,
    device_markers: Writer<Marker>,
    drive_cycles: Writer<DriveCycle>,
    healths: BTreeMap<Process, Writer<Health>>,
}

impl Chain {
    fn open(bus: &Bus) -> Self {
        let health = |process: Process| (process, bus.writer_on(&health_channel(process)).expect("health"));
        Self {
            input: writer(bus),
            setpoint: writer(bus),
            command: writer(bus),
            state: writer(bus),
            state_command: writer(bus),
            shape: writer(bus),
            model_update: writer(bus),
            markers: writer(bus),
            device_markers: bus.writer_on(Marker::DEVICE_CHANNEL).expect("writer"),
            drive_cycles: writer(bus),
            healths: Process::ALL.into_iter().filter(|p| *p != Process::Record).map(health).collect(),
        }
    }

    fn send(&mut self, sample: &Sample) {
        match sample {
            Sample::Input(message) => self.input.send(message),
            Sample::Setpoint(message) => self.setpoint.send(message),
            Sample::Command(message) => self.command.send(message),
            Sample::State(message) => self.state.send(message),
            Sample::StateCommand(message) => self.state_command.send(message),
            Sample::Shape(message) => self.shape.send(message),
            Sample::ModelUpdate(message) => self.model_update.send(message),
            Sample::Health(process, message) => self.healths.get_mut(process).expect("a writer").send(message),
            Sample::Marker(message) => self.markers.send(message),
            Sample::DeviceMarker(message) => self.device_markers.send(message),
            Sample::DriveCycle(message) => self.drive_cycles.send(message),
            Sample::Recorder(_) => Ok(()),
        }
        .expect("sent");
    }
}

fn writer<M: Message>(bus: &Bus) -> Writer<M> {
    bus.writer().expect("writer")
}

/// Runs a recorder beside `act`, which begins when the recorder says that it is ready. What `act` returns, its writers, live
/// until the recorder has ended.
fn beside_a_recorder<T>(
    instance: &str,
    config: &RecordConfig,
    act: impl FnOnce(&Bus) -> T,
) -> Result<RecordReport, RecordError> {
    let bus = Bus::open(instance, "test").expect("bus");
    let mut health = bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::waking()).expect("reader");
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let recorder =
            scope.spawn(|| run(&Bus::open(instance, "record").expect("bus"), config, || stop.load(Ordering::Relaxed)));
        let is_ready = (0..100).any(|_| health.wait(Duration::from_millis(100)).expect("wait"));
        assert!(is_ready || recorder.is_finished(), "the recorder neither becomes ready nor says why");
        let _writers = act(&bus);
        stop.store(true, Ordering::Relaxed);
        recorder.join().expect("no panic")
    })
}

fn is_from_the_test(sample: &Sample) -> bool {
    !matches!(sample.channel(), Channel::Recorder | Channel::Health(Process::Record))
}

#[test]
fn everything_that_a_chain_publishes_is_in_the_file_bit_for_bit() {
    let path = fresh_path("end_to_end.mcap");
    let config = RecordConfig { path: Some(path.to_path_buf()), ..RecordConfig::default() };
    let begin_ns = clock::monotonic_ns();
    let mut sent: Vec<Sample> = chain(3000, begin_ns).filter(is_from_the_test).collect();
    for channel in [Channel::StateCommand, Channel::Marker, Channel::DeviceMarker, Channel::DriveCycle] {
        sent.push(plausible(channel, 1, begin_ns));
    }
    let report = beside_a_recorder(&instance("all"), &config, |bus| {
        let mut chain = Chain::open(bus);
        for (idx, sample) in sent.iter().enumerate() {
            chain.send(sample);
            if idx % 4 == 3 {
                thread::sleep(Duration::from_millis(1));
            }
        }
        chain
    })
    .expect("recorded");
    let length = report.outcome.expect("ended in order");
    assert_eq!(length, std::fs::metadata(&path).expect("there").len());

    let recording = Recording::open(&path).expect("opened");
    assert_eq!(recording.contents().missing, []);
    assert!(recording.contents().is_indexed);
    let mut recorded = BTreeMap::<Channel, Vec<Vec<u64>>>::new();
    let mut n_statuses = 0;
    for sample in recording.samples().expect("there").map(|r| r.expect("readable").sample) {
        recorded.entry(sample.channel()).or_default().push(words_of(&sample));
        n_statuses += u64::from(sample.channel() == Channel::Recorder);
    }
    for channel in
        Channel::ALL.into_iter().filter(|c| *c != Channel::Recorder && *c != Channel::Health(Process::Record))
    {
        let expected: Vec<_> = sent.iter().filter(|s| s.channel() == channel).map(words_of).collect();
        assert!(!expected.is_empty(), "{channel:?}");
        assert_eq!(recorded[&channel].len(), expected.len(), "{channel:?}");
        assert!(recorded[&channel] == expected, "{channel:?} differs");
        assert_eq!(report.status.of(channel).expect("counted").n_written, expected.len() as u64);
    }
    let total = report.status.total();
    assert_eq!((total.n_dropped, total.n_lost, total.n_out_of_order), (0, 0, 0));
    let n_healths = recorded[&Channel::Health(Process::Record)].len() as u64;
    assert_eq!(total.n_written, sent.len() as u64 + n_healths);
    assert!(n_statuses >= 2, "once a second and at the end: {n_statuses}");
    assert_eq!(recording.contents().metadata["krait.end"]["n_written"], total.n_written.to_string());
}

#[test]
fn what_is_published_just_before_the_end_is_in_the_file() {
    let path = fresh_path("last.mcap");
    let config = RecordConfig { path: Some(path.to_path_buf()), ..RecordConfig::default() };
    let report = beside_a_recorder(&instance("last"), &config, |bus| {
        let mut chain = Chain::open(bus);
        let now_ns = clock::monotonic_ns();
        for sequence in 1..=2000 {
            chain.send(&plausible(Channel::Command, sequence, now_ns));
        }
        chain
    })
    .expect("recorded");
    assert_eq!(report.status.of(Channel::Command).expect("counted").n_written, 2000);
    assert_eq!(Recording::open(&path).expect("opened").contents().channels[&Channel::Command].n_messages, 2000);
}

#[test]
fn what_is_lost_or_out_of_order_is_counted_and_in_the_file() {
    let path = fresh_path("lost.mcap");
    let config = RecordConfig { path: Some(path.to_path_buf()), ..RecordConfig::default() };
    let report = beside_a_recorder(&instance("lost"), &config, |bus| {
        let mut chain = Chain::open(bus);
        for sequence in [1, 2, 10, 9, 11] {
            chain.send(&plausible(Channel::Shape, sequence, clock::monotonic_ns()));
        }
        chain
    })
    .expect("recorded");
    let shape = report.status.of(Channel::Shape).expect("counted");
    assert_eq!((shape.n_written, shape.n_lost, shape.n_out_of_order), (4, 7, 1));
    let recording = Recording::open(&path).expect("opened");
    assert!(recording.contents().missing.iter().any(|m| m.to_string().contains("7 never reached it")));
    let last =
        recording.samples().expect("there").filter_map(Result::ok).filter_map(|recorded| match recorded.sample {
            Sample::Recorder(status) => Some(*status),
            _ => None,
        });
    assert_eq!(last.last().expect("a status").of(Channel::Shape).expect("counted"), shape);
}

/// Rotates while 2500 commands are sent; returns how many parts there are.
fn rotated(name: &str, config: RecordConfig) -> usize {
    let path = fresh_path(&format!("{name}.mcap"));
    let config = RecordConfig { path: Some(path.to_path_buf()), flush_ms: 10, ..config };
    let report = beside_a_recorder(&instance(name), &config, |bus| {
        let mut chain = Chain::open(bus);
        for sequence in 1..=2500 {
            chain.send(&plausible(Channel::Command, sequence, clock::monotonic_ns()));
            thread::sleep(Duration::from_millis(1));
        }
        chain
    })
    .expect("recorded");
    let parts = Recording::open_parts(&path).expect("opened");
    assert_eq!(parts.len(), report.n_parts as usize);
    let mut commands = Vec::new();
    let (mut n_bytes, mut n_written) = (0, 0);
    for (idx, part) in parts.iter().enumerate() {
        let contents = part.contents();
        assert_eq!(contents.missing, [], "part {idx} is whole");
        assert!(contents.is_indexed && contents.metadata["krait"]["part"] == (idx + 1).to_string());
        assert_eq!(contents.metadata["krait"]["run_id"], parts[0].contents().metadata["krait"]["run_id"]);
        n_bytes += std::fs::metadata(part.path()).expect("there").len();
        n_written += contents.metadata["krait.end"]["n_written"].parse::<u64>().expect("a number");
        for recorded in part.samples().expect("there") {
            if let Sample::Command(command) = recorded.expect("readable").sample {
                commands.push(command.sequence);
            }
        }
        if idx > 0 {
            std::fs::remove_file(part.path()).expect("removed");
        }
    }
    assert!(commands.iter().copied().eq(1..=2500), "nothing is lost or doubled between parts");
    assert_eq!(report.outcome.expect("ended in order"), n_bytes);
    assert_eq!(report.status.total().n_written, n_written);
    parts.len()
}

#[test]
fn a_recording_that_is_rotated_by_size_or_time_loses_nothing_and_each_part_is_whole() {
    assert!(rotated("by_size", RecordConfig { rotate_bytes: 65_536, ..RecordConfig::default() }) >= 3);
    assert!((2..=4).contains(&rotated("by_time", RecordConfig { rotate_s: 1, ..RecordConfig::default() })));
}

#[test]
fn a_mark_is_recorded_told_in_the_log_and_confirmed_to_its_sender() {
    let path = fresh_path("marked.mcap");
    let config = RecordConfig { path: Some(path.to_path_buf()), ..RecordConfig::default() };
    let mark = Marker::new(1, clock::monotonic_ns(), "vessel touched").expect("a text");
    beside_a_recorder(&instance("marked"), &config, |bus| {
        let mut confirmed = bus.reader_on::<Marker>(Marker::RECORDED_CHANNEL, ReadOptions::waking()).expect("reader");
        let mut writer = writer::<Marker>(bus);
        writer.send(&mark).expect("sent");
        assert!((0..100).any(|_| confirmed.wait(Duration::from_millis(100)).expect("wait")), "the recorder confirms");
        assert_eq!(confirmed.take().expect("take").map(|seen| *seen), Some(mark));
        writer
    })
    .expect("recorded");
    let recording = Recording::open(&path).expect("opened");
    let marks = recording.samples().expect("there").filter_map(|recorded| match recorded.expect("readable").sample {
        Sample::Marker(marker) => marker.text().map(str::to_owned),
        _ => None,
    });
    assert_eq!(marks.collect::<Vec<_>>(), ["vessel touched"]);
    assert!(recording.contents().n_views >= 1, "viewers see it in the log");
}

/// Name of the variable that gives the child its path.
const FULL_DISK_PATH: &str = "KRAIT_TEST_FULL_DISK_PATH";
/// File size at which the child's disk is full.
const FULL_DISK_BYTES: u64 = 60_000;

/// A limit on file sizes stands for the disk. It holds for a whole process, so the recorder runs in one of its own, below
/// a shell that has the signal of that limit ignored.
#[test]
fn a_disk_that_fills_up_stops_the_recording_and_nothing_else() {
    let path = fresh_path("full_disk.mcap");
    let output = std::process::Command::new("sh")
        .args(["-c", "trap '' XFSZ; exec \"$0\" --exact end_to_end::recorder_on_a_disk_that_fills_up --nocapture"])
        .arg(std::env::current_exe().expect("this test"))
        .env(FULL_DISK_PATH, path.as_os_str())
        .output()
        .expect("a shell");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("1 passed"), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let recording = Recording::open(&path).expect("opened");
    // Ended in order, but where the last chunk left less than the 50 bytes that an end needs.
    let is_ended = recording.contents().missing == [Missing::Rest];
    let is_at_the_brim =
        matches!(recording.contents().missing[..], [Missing::End { offset }] if offset + 50 > FULL_DISK_BYTES);
    assert!(is_ended || is_at_the_brim, "{:?}", recording.contents().missing);
    assert!(std::fs::metadata(&path).expect("there").len() <= FULL_DISK_BYTES);
    let commands =
        recording.samples().expect("there").filter_map(|recorded| match recorded.expect("readable").sample {
            Sample::Command(command) => Some(command.sequence),
            _ => None,
        });
    let commands: Vec<_> = commands.collect();
    assert!(!commands.is_empty() && commands.iter().copied().eq(1..=commands.len() as u64), "{commands:?}");
}

/// Processor time of this process, ns.
fn cpu_ns() -> i64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

/// Not a test: the child of `a_disk_that_fills_up_stops_the_recording_and_nothing_else`.
#[test]
fn recorder_on_a_disk_that_fills_up() {
    let Some(path) = std::env::var_os(FULL_DISK_PATH) else { return };
    let config = RecordConfig { path: Some(path.into()), flush_ms: 20, ..RecordConfig::default() };
    let name = instance("full");
    let bus = Bus::open(&name, "observer").expect("bus");
    let mut health =
        bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::observing()).expect("reader");
    let (mut n_sent, mut busy_of) = (0, (0, 0));
    let report = beside_a_recorder(&name, &config, |bus| {
        let mut chain = Chain::open(bus);
        let limit = Rlimit { current: Some(FULL_DISK_BYTES), maximum: Some(FULL_DISK_BYTES) };
        setrlimit(Resource::Fsize, limit).expect("limited");
        let has_stopped = |newest: Option<Received<Health>>| {
            newest.is_some_and(|h| Reasons::from_bits(h.reasons_now).contains(Reason::RecordingStopped))
        };
        while !has_stopped(health.take_newest().expect("take")) {
            n_sent += 1;
            chain.send(&plausible(Channel::Command, n_sent, clock::monotonic_ns()));
            thread::sleep(Duration::from_millis(1));
        }
        // What comes after it is counted, by threads that sleep in between.
        let (wall_ns, busy_ns) = (clock::monotonic_ns(), cpu_ns());
        while clock::monotonic_ns() < wall_ns + 2_000_000_000 {
            n_sent += 1;
            chain.send(&plausible(Channel::Command, n_sent, clock::monotonic_ns()));
            thread::sleep(Duration::from_millis(1));
        }
        busy_of = (cpu_ns() - busy_ns, clock::monotonic_ns() - wall_ns);
        chain
    })
    .expect("a full disk is no error of the recorder");
    let (busy_ns, wall_ns) = busy_of;
    assert!(busy_ns < wall_ns / 2, "{busy_ns} ns of work in {wall_ns} ns beside a recording that has stopped");
    let error = report.outcome.expect_err("the disk was full").to_string();
    assert!(error.contains("stopped at byte") && error.contains("File too large"), "{error}");
    let counts = report.status.of(Channel::Command).expect("counted");
    assert_eq!(counts.n_lost, 0, "shared memory was emptied to the end");
    assert_eq!(counts.n_written + counts.n_dropped, n_sent);
    let last = *health.take_newest().expect("take").expect("a last word");
    assert!(Reasons::from_bits(last.reasons_now).contains(Reason::RecordingStopped));
    assert!(Reasons::from_bits(last.reasons_now).contains(Reason::RecordingDropped));
}

/// Name of the variable that gives the recorder to be killed its instance.
const KILLED_INSTANCE: &str = "KRAIT_TEST_KILLED_INSTANCE";
/// Name of the variable that gives it its path.
const KILLED_PATH: &str = "KRAIT_TEST_KILLED_PATH";

#[test]
fn a_recorder_that_is_killed_leaves_everything_up_to_its_last_chunk() {
    let path = fresh_path("killed.mcap");
    let name = instance("killed");
    let bus = Bus::open(&name, "test").expect("bus");
    let mut health = bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::waking()).expect("reader");
    let mut recorder = std::process::Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", "end_to_end::recorder_that_is_killed"])
        .env(KILLED_INSTANCE, &name)
        .env(KILLED_PATH, path.as_os_str())
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("started");
    assert!((0..100).any(|_| health.wait(Duration::from_millis(100)).expect("wait")), "it becomes ready");
    let mut chain = Chain::open(&bus);
    for sequence in 1..=1000 {
        chain.send(&plausible(Channel::Command, sequence, clock::monotonic_ns()));
        thread::sleep(Duration::from_millis(1));
    }
    recorder.kill().expect("killed");
    recorder.wait().expect("gone");

    let recording = Recording::open(&path).expect("opened");
    assert!(matches!(recording.contents().missing[..], [Missing::End { .. } | Missing::Cut { .. }]));
    let commands =
        recording.samples().expect("there").filter_map(|recorded| match recorded.expect("readable").sample {
            Sample::Command(command) => Some(command.sequence),
            _ => None,
        });
    let commands: Vec<_> = commands.collect();
    assert!(!commands.is_empty() && commands.iter().copied().eq(1..=commands.len() as u64), "{commands:?}");
    assert_eq!(recording.contents().metadata["krait"]["instance"], name);
}

/// Not a test: the child of `a_recorder_that_is_killed_leaves_everything_up_to_its_last_chunk`.
#[test]
fn recorder_that_is_killed() {
    let (Some(path), Ok(name)) = (std::env::var_os(KILLED_PATH), std::env::var(KILLED_INSTANCE)) else { return };
    let config = RecordConfig { path: Some(path.into()), ..RecordConfig::default() };
    run(&Bus::open(&name, "record").expect("bus"), &config, || false).expect("killed before it ends");
}

#[test]
fn a_recording_that_cannot_begin_says_why_and_is_never_ready() {
    let path = fresh_path("there.mcap");
    std::fs::write(&path, b"precious").expect("written");
    let config = RecordConfig { path: Some(path.to_path_buf()), ..RecordConfig::default() };
    let bus = Bus::open(&instance("exists"), "record").expect("bus");
    let mut health =
        bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::glancing()).expect("reader");
    let error = run(&bus, &config, || true).expect_err("refused");
    assert!(error.to_string().contains("there.mcap exists already"), "{error}");
    assert!(health.take().expect("take").is_none());
    assert_eq!(std::fs::read(&path).expect("there"), b"precious");
}

#[test]
fn the_last_health_of_a_good_recording_has_no_reason() {
    let path = fresh_path("health.mcap");
    let config = RecordConfig { path: Some(path.to_path_buf()), ..RecordConfig::default() };
    let name = instance("health");
    let bus = Bus::open(&name, "observer").expect("bus");
    let mut health =
        bus.reader_on::<Health>(&health_channel(Process::Record), ReadOptions::observing()).expect("reader");
    beside_a_recorder(&name, &config, |bus| {
        let mut chain = Chain::open(bus);
        chain.send(&plausible(Channel::Input, 1, clock::monotonic_ns()));
        // A reader that has looked once keeps what a writer said before it left.
        while health.take_newest().expect("take").is_none() {
            thread::sleep(Duration::from_millis(1));
        }
        chain
    })
    .expect("recorded");
    let last = *health.take_newest().expect("take").expect("a last word");
    assert_eq!(Reasons::from_bits(last.reasons_ever), Reasons::NONE);
    assert!(!Reasons::from_bits(last.reasons_now).contains(Reason::RecordingStopped));
    assert!(last.n_received > 0 && last.n_sent == last.sequence);
}
