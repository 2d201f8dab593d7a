//! The channels as their users meet them: order, loss, history, single writer, version, waiting, clearing up.

use core::time::Duration;
use iceoryx2::prelude::ZeroCopySend;
use krait_ipc::message::{HopStamps, Message, ModelUpdate, Shape};
use krait_ipc::{Bus, InstanceName, IpcError, ReadOptions, WaitMode, clock, resources_of};
use std::process::{Command, Stdio};

fn instance(test: &str) -> String {
    format!("t-{test}-{}", std::process::id())
}

fn shape(sequence: u64) -> Shape {
    Shape::of_bend(sequence, clock::monotonic_ns(), 0, [0.25, -0.5]).with_sigma(0.005)
}

#[test]
fn messages_arrive_in_order_and_none_is_lost_while_the_reader_keeps_up() {
    let bus = Bus::open(&instance("order"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut reader = bus.reader::<Shape>(ReadOptions::waking()).expect("reader");
    for sequence in 1..=5000 {
        writer.send(&shape(sequence)).expect("send");
        assert!(reader.wait(Duration::from_secs(5)).expect("wait"), "woken by its channel");
        let got = reader.take().expect("take").expect("a message");
        assert_eq!((got.sequence, got.bend_rad), (sequence, [0.25, -0.5]));
        assert!(got.q_tilde_m[0].is_nan(), "an invalid value stays invalid");
    }
    assert_eq!((reader.n_received(), reader.n_lost(), reader.n_out_of_order()), (5000, 0, 0));
}

#[test]
fn a_reader_that_falls_behind_loses_the_oldest_and_counts_them() {
    let bus = Bus::open(&instance("slow"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut reader = bus.reader::<Shape>(ReadOptions::glancing()).expect("reader");
    writer.send(&shape(1)).expect("send");
    assert_eq!(reader.take().expect("take").expect("first").sequence, 1);
    for sequence in 2..=600 {
        writer.send(&shape(sequence)).expect("a slow reader never stops a writer");
    }
    let newest = reader.take_newest().expect("take").expect("newest").sequence;
    assert_eq!(newest, 600);
    assert_eq!(reader.n_received() + reader.n_lost(), 600, "every message is either taken or counted as lost");
    assert!(reader.n_lost() > 100, "lost {}", reader.n_lost());
}

#[test]
fn a_sleeping_reader_with_a_full_event_queue_still_wakes_and_the_writer_never_blocks() {
    let bus = Bus::open(&instance("deaf"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut reader = bus.reader::<Shape>(ReadOptions::waking()).expect("reader");
    for sequence in 1..=20_000 {
        writer.send(&shape(sequence)).expect("send");
    }
    assert!(reader.wait(Duration::from_secs(5)).expect("wait"));
    assert_eq!(reader.take_newest().expect("take").expect("newest").sequence, 20_000);
    writer.send(&shape(20_001)).expect("send");
    assert!(reader.wait(Duration::from_secs(5)).expect("wait"), "it can be woken again");
    assert_eq!(reader.take_newest().expect("take").expect("newest").sequence, 20_001);
}

#[test]
fn a_late_reader_gets_the_newest_message_at_once() {
    let bus = Bus::open(&instance("late"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    for sequence in 1..=10 {
        writer.send(&shape(sequence)).expect("send");
    }
    let mut reader = bus.reader::<Shape>(ReadOptions::glancing()).expect("reader");
    // The writer hands over history when it next looks at its connections.
    writer.send(&shape(11)).expect("send");
    let first = reader.take().expect("take").expect("history").sequence;
    assert_eq!(first, 10);
}

#[test]
fn a_repeated_or_older_message_is_skipped_and_counted() {
    let bus = Bus::open(&instance("again"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut reader = bus.reader::<Shape>(ReadOptions::glancing()).expect("reader");
    for sequence in [5, 6, 6, 4, 7] {
        writer.send(&shape(sequence)).expect("send");
    }
    let mut taken = Vec::new();
    while let Some(message) = reader.take().expect("take") {
        taken.push(message.sequence);
    }
    assert_eq!((taken, reader.n_out_of_order()), (vec![5, 6, 7], 2));
}

#[test]
fn a_writer_that_starts_anew_counts_from_one_and_what_is_missing_is_counted() {
    let bus = Bus::open(&instance("anew"), "test").expect("bus");
    let mut reader = bus.reader::<Shape>(ReadOptions::glancing()).expect("reader");
    for first in [1, 3] {
        let mut writer = bus.writer::<Shape>().expect("writer");
        for sequence in first..=5 {
            writer.send(&shape(sequence)).expect("send");
        }
        while reader.take().expect("take").is_some() {}
    }
    assert_eq!((reader.n_received(), reader.n_lost(), reader.n_out_of_order()), (8, 2, 0));
}

#[test]
fn a_polling_reader_finds_messages_without_an_event() {
    let bus = Bus::open(&instance("poll"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut reader = bus.reader::<Shape>(ReadOptions::waking().with_mode(WaitMode::Polling)).expect("reader");
    assert!(!reader.wait(Duration::from_millis(1)).expect("wait"), "nothing was sent");
    writer.send(&shape(1)).expect("send");
    assert!(reader.wait(Duration::from_secs(5)).expect("wait"));
}

fn since(begun_ns: i64) -> Duration {
    Duration::from_nanos((clock::monotonic_ns() - begun_ns).unsigned_abs())
}

/// One that sleeps at a steady rate is woken early, once, without a message, and then sleeps until there is one.
#[test]
fn a_reader_that_wakes_ahead_does_so_once_for_each_message() {
    const PERIOD: Duration = Duration::from_millis(20);
    const PATIENCE: Duration = Duration::from_secs(2);
    let bus = Bus::open(&instance("ahead"), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut reader = bus.reader::<Shape>(ReadOptions::waking().with_mode(WaitMode::Ahead)).expect("reader");
    // On a busy machine one of the sleeps may take so long that no rate is seen.
    let was_early = (0..10u64).any(|attempt| {
        for n in 1..=4 {
            std::thread::sleep(PERIOD);
            writer.send(&shape(4 * attempt + n)).expect("send");
            assert!(reader.wait(PATIENCE).expect("wait"), "it is there");
            assert!(reader.take().expect("take").is_some());
        }
        let begun_ns = clock::monotonic_ns();
        assert!(!reader.wait(PATIENCE).expect("wait"), "nothing was sent");
        since(begun_ns) < PATIENCE / 2
    });
    assert!(was_early);
    let begun_ns = clock::monotonic_ns();
    assert!(!reader.wait(Duration::from_millis(100)).expect("wait"), "nothing was sent");
    assert!(since(begun_ns) >= Duration::from_millis(100), "the second sleep is not cut short");
    assert_eq!(reader.n_lost(), 0);
}

#[test]
fn a_second_writer_is_refused_with_the_channel_and_the_instance() {
    let name = instance("second");
    let bus = Bus::open(&name, "test").expect("bus");
    let _first = bus.writer::<Shape>().expect("writer");
    let other = Bus::open(&name, "other").expect("bus");
    let error = other.writer::<Shape>().expect_err("there is one already");
    assert!(matches!(error, IpcError::SecondWriter { .. }));
    let sentence = error.to_string();
    assert!(sentence.contains("\"shape\"") && sentence.contains(&name), "{sentence}");
}

#[test]
fn instances_do_not_hear_each_other() {
    let (one, two) = (instance("one"), instance("two"));
    let (a, b) = (Bus::open(&one, "test").expect("bus"), Bus::open(&two, "test").expect("bus"));
    let mut writer = a.writer::<Shape>().expect("writer");
    let _other_writer = b.writer::<Shape>().expect("a writer of its own");
    let mut reader = b.reader::<Shape>(ReadOptions::glancing()).expect("reader");
    writer.send(&shape(1)).expect("send");
    assert!(reader.take().expect("take").is_none());
    assert_eq!(a.members(), vec![("test".to_owned(), std::process::id())]);
}

/// `Shape` as another build of krait might have it: a field more, and a higher version.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("krait.Shape")]
struct NewerShape {
    sequence: u64,
    sample_ns: i64,
    more: [f64; 12],
}

impl Message for NewerShape {
    const CHANNEL: &'static str = Shape::CHANNEL;
    const VERSION: u32 = Shape::VERSION + 41;
    fn sequence(&self) -> u64 {
        self.sequence
    }
    fn sample_ns(&self) -> i64 {
        self.sample_ns
    }
}

/// The same layout, another meaning: only the version tells.
#[repr(C)]
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[type_name("krait.ModelUpdate")]
struct SameSizeOtherMeaning([u64; 37]);

impl Message for SameSizeOtherMeaning {
    const CHANNEL: &'static str = ModelUpdate::CHANNEL;
    const VERSION: u32 = ModelUpdate::VERSION + 1;
    fn sequence(&self) -> u64 {
        self.0[0]
    }
    fn sample_ns(&self) -> i64 {
        0
    }
}

#[test]
fn another_payload_version_is_refused_and_both_versions_are_named() {
    let name = instance("version");
    let bus = Bus::open(&name, "test").expect("bus");
    let _writer = bus.writer::<Shape>().expect("writer");
    let sentence = bus.reader::<NewerShape>(ReadOptions::waking()).expect_err("other size").to_string();
    let (found, expected) = (Shape::VERSION, NewerShape::VERSION);
    assert!(
        sentence.contains(&format!("version {found}")) && sentence.contains(&format!("version {expected}")),
        "{sentence}"
    );

    assert_eq!(size_of::<SameSizeOtherMeaning>(), size_of::<ModelUpdate>(), "the case is about equal sizes");
    let _writer = bus.writer::<ModelUpdate>().expect("writer");
    let error = bus.reader::<SameSizeOtherMeaning>(ReadOptions::waking()).expect_err("other version");
    assert!(matches!(error, IpcError::Version { .. }), "{error}");
}

#[test]
fn a_clean_end_leaves_no_shared_memory_and_no_file() {
    let name = instance("clean");
    let checked = InstanceName::new(&name).expect("name");
    {
        let bus = Bus::open(&name, "test").expect("bus");
        let mut writer = bus.writer::<Shape>().expect("writer");
        let mut reader = bus.reader::<Shape>(ReadOptions::waking()).expect("reader");
        writer.send(&shape(1)).expect("send");
        assert!(reader.take().expect("take").is_some());
        assert!(!resources_of(&checked).is_empty(), "while it lives there are files");
    }
    assert_eq!(resources_of(&checked), Vec::<std::path::PathBuf>::new());
}

/// Not a test: the body of the process that the next test kills.
#[test]
fn child_that_is_killed() {
    let Ok(name) = std::env::var("KRAIT_TEST_KILLED_INSTANCE") else { return };
    let bus = Bus::open(&name, "doomed").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let _reader = bus.reader::<Shape>(ReadOptions::waking()).expect("reader");
    writer.send(&shape(1)).expect("send");
    println!("ready");
    std::thread::sleep(Duration::from_secs(600));
}

#[test]
fn what_a_killed_process_left_behind_is_removed_at_the_next_start() {
    let name = instance("killed");
    let checked = InstanceName::new(&name).expect("name");
    let mut child = Command::new(std::env::current_exe().expect("exe"))
        .args(["--exact", "child_that_is_killed", "--nocapture"])
        .env("KRAIT_TEST_KILLED_INSTANCE", &name)
        .stdout(Stdio::piped())
        .spawn()
        .expect("child");
    let mut said = std::io::BufReader::new(child.stdout.take().expect("stdout"));
    let mut line = String::new();
    while !line.contains("ready") {
        line.clear();
        assert!(std::io::BufRead::read_line(&mut said, &mut line).expect("line") > 0, "the child ended too early");
    }
    child.kill().expect("kill");
    child.wait().expect("wait");
    assert!(!resources_of(&checked).is_empty(), "a killed process leaves its files behind");

    let bus = Bus::open(&name, "heir").expect("bus");
    let _writer = bus.writer::<Shape>().expect("the dead writer's place is free again");
    assert_eq!(bus.members().len(), 1);
    drop((_writer, bus));
    assert_eq!(resources_of(&checked), Vec::<std::path::PathBuf>::new());
}

#[test]
fn payloads_are_whole_numbers_of_words_so_that_no_padding_travels() {
    assert_eq!(size_of::<HopStamps>(), 64);
    assert_eq!(size_of::<krait_ipc::message::OperatorInput>(), 8 + 8 + 64 + 48 + 12 + 16 + 24 + 4);
}
