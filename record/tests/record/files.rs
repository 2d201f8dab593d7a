//! Files in every state: whole, cut at any byte, damaged at any byte, of somebody else, on a full disk.

use crate::common::{chain, fresh_path, places_of, plausible, words_of};
use krait_ipc::message::{Message, Shape};
use krait_record::{
    About, Attachment, Missing, RecordError, Recorded, Recording, RecordingReadError, RecordingSink, RecordingWriter,
    recover,
};
use krait_schema::{Channel, Sample};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::path::Path;

const CHUNK_BYTES: usize = 256 * 1024;

fn about() -> About {
    let given =
        BTreeMap::from([("compensation".to_owned(), "estimated".to_owned()), ("pass".to_owned(), "3".to_owned())]);
    let data = b"[record]\nflush_ms = 100\n".to_vec();
    let toml = Attachment { name: "krait.toml".to_owned(), media_type: "application/toml".to_owned(), data };
    About::run("files", &given, vec![toml])
}

/// Records what a chain says in `n_ms`, with a flush every 100 ms as the recorder does. Returns the samples.
fn record<S: RecordingSink>(writer: &mut RecordingWriter<S>, n_ms: u64) -> Result<Vec<Sample>, RecordError> {
    let begin_ns = krait_ipc::clock::monotonic_ns();
    let mut samples = Vec::new();
    for sample in chain(n_ms, begin_ns) {
        writer.write(&sample, sample.sample_ns())?;
        if sample.channel() == Channel::State && sample.sequence().is_multiple_of(100) {
            writer.flush()?;
        }
        samples.push(sample);
    }
    Ok(samples)
}

fn recorded_file(name: &str, n_ms: u64) -> (crate::common::TestPath, Vec<Sample>) {
    let path = fresh_path(name);
    let mut writer = RecordingWriter::create(&path, CHUNK_BYTES, &about()).expect("created");
    let samples = record(&mut writer, n_ms).expect("recorded");
    let length = writer.finish(&BTreeMap::new()).expect("finished");
    assert_eq!(length, fs::metadata(&path).expect("there").len());
    (path, samples)
}

fn read(recording: &Recording) -> Vec<Recorded> {
    recording.samples().expect("still there").map(|recorded| recorded.expect("readable")).collect()
}

fn assert_is_prefix(read: &[Recorded], written: &[Sample]) {
    assert!(read.len() <= written.len());
    for (recorded, sample) in read.iter().zip(written) {
        assert_eq!(recorded.sample.channel(), sample.channel());
        assert_eq!(words_of(&recorded.sample), words_of(sample));
    }
}

#[test]
fn a_whole_file_gives_back_every_sample_its_metadata_and_attachments() {
    let about = about();
    let (path, written) = recorded_file("whole.mcap", 1000);
    let recording = Recording::open(&path).expect("opened");
    let back = read(&recording);
    assert_eq!(back.len(), written.len());
    assert_is_prefix(&back, &written);
    let contents = recording.contents();
    assert_eq!(contents.missing, []);
    assert!(contents.is_indexed);
    assert_eq!(contents.attachments, about.attachments);
    assert_eq!(contents.channels[&Channel::Command].n_messages, 1000);
    assert_eq!(contents.channels[&Channel::Shape].n_messages, 60);
    let metadata = &contents.metadata["krait"];
    assert_eq!((metadata["compensation"].as_str(), metadata["pass"].as_str()), ("estimated", "3"));
    for key in ["run_id", "instance", "host", "kernel", "krait_version", "git_revision", "start_wall_ns"] {
        assert!(!metadata[key].is_empty(), "{key}");
    }
    let offset_ns: i64 = metadata["clock_offset_ns"].parse().expect("a number");
    for recorded in &back {
        assert_eq!(recorded.publish_ns as i64, recorded.sample.sample_ns() + offset_ns);
        assert_eq!(recorded.log_ns, recorded.publish_ns);
    }
}

#[test]
fn a_stamp_far_from_now_does_not_tear_the_time_axis() {
    let path = fresh_path("axis.mcap");
    let about = about();
    let mut writer = RecordingWriter::create(&path, CHUNK_BYTES, &about).expect("created");
    let taken_ns = krait_ipc::clock::monotonic_ns();
    for sample_ns in [0, i64::MAX, i64::MIN] {
        writer.write(&plausible(Channel::Setpoint, 1, sample_ns), taken_ns).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");
    let recording = Recording::open(&path).expect("opened");
    for recorded in read(&recording) {
        assert_eq!(recorded.log_ns, about.clock.wall_ns(taken_ns));
        assert_eq!(recorded.publish_ns, about.clock.wall_ns(recorded.sample.sample_ns()));
    }
}

#[test]
fn a_file_cut_at_any_byte_gives_a_readable_prefix_and_says_that_it_is_cut() {
    let (path, written) = recorded_file("to_cut.mcap", 2000);
    let whole = fs::read(&path).expect("read");
    let cut_path = fresh_path("cut.mcap");
    let mut n_before = 0;
    let mut n_with_samples = 0;
    for cut in (0..200).map(|idx| idx * whole.len() / 200) {
        fs::write(&cut_path, &whole[..cut]).expect("written");
        let recording = match Recording::open(&cut_path) {
            Ok(recording) => recording,
            Err(error @ (RecordingReadError::NoHeader { .. } | RecordingReadError::NotMcap { .. })) => {
                assert!(cut < 100, "only a file without its header cannot be opened, not one of {cut} bytes: {error}");
                continue;
            }
            Err(error) => panic!("cut at {cut}: {error}"),
        };
        let back = read(&recording);
        assert_is_prefix(&back, &written);
        assert!(back.len() >= n_before, "more bytes never hold fewer samples");
        n_before = back.len();
        n_with_samples += usize::from(!back.is_empty());
        assert!(
            recording.contents().missing.iter().any(|m| matches!(m, Missing::Cut { .. } | Missing::End { .. })),
            "cut at {cut}: {:?}",
            recording.contents().missing
        );
    }
    assert!(n_with_samples > 150, "most cuts leave samples: {n_with_samples}");
    assert!(n_before > written.len() / 2);
}

#[test]
fn a_file_damaged_at_any_byte_never_panics_and_never_gives_a_sample_that_was_not_written() {
    let (path, written) = recorded_file("to_damage.mcap", 500);
    let whole = fs::read(&path).expect("read");
    let damaged_path = fresh_path("damaged.mcap");
    let written: std::collections::BTreeSet<_> = written.iter().map(|s| (s.channel(), words_of(s))).collect();
    let mut n_opened = 0;
    for idx in 0..400 {
        let mut damaged = whole.clone();
        let at = idx * whole.len() / 400;
        damaged[at] ^= 1 << (idx % 8);
        fs::write(&damaged_path, &damaged).expect("written");
        let Ok(recording) = Recording::open(&damaged_path) else { continue };
        n_opened += 1;
        for recorded in read(&recording) {
            assert!(written.contains(&(recorded.sample.channel(), words_of(&recorded.sample))), "damaged at {at}");
        }
    }
    assert!(n_opened > 300, "one flipped bit rarely costs the whole file: {n_opened} of 400 opened");
}

/// Whichever bit of its opcode is flipped, a chunk is named as missing and not passed over.
#[test]
fn a_chunk_whose_opcode_is_damaged_is_named() {
    let (path, written) = recorded_file("flipped_chunk.mcap", 1000);
    let whole = fs::read(&path).expect("read");
    let at = places_of(6, &whole)[1];
    for bit in 0..8 {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << bit;
        fs::write(&path, &bytes).expect("written");
        let recording = Recording::open(&path).expect("opened");
        assert!(!recording.contents().missing.is_empty(), "bit {bit}");
        let n_back = read(&recording).len();
        assert!(n_back > 0 && n_back < written.len(), "bit {bit}: {n_back}");
        let saved = recover(&path, &path.with_extension("recovered.mcap")).expect("recovered");
        assert!(saved.n_bytes_dropped > 1000, "bit {bit}: a chunk, and {} bytes dropped", saved.n_bytes_dropped);
        fs::remove_file(path.with_extension("recovered.mcap")).expect("there");
    }
}

/// One bit lies between the opcode of the index behind a chunk and that of a message, for which its bytes would then be taken.
#[test]
fn an_index_that_a_flipped_bit_calls_a_message_is_named_and_gives_no_sample() {
    let (path, written) = recorded_file("flipped_index.mcap", 500);
    let mut bytes = fs::read(&path).expect("read");
    let flipped = places_of(7, &bytes);
    assert!(flipped.len() > 5, "an index for each channel of each chunk");
    flipped.iter().for_each(|at| bytes[*at] ^= 2);
    fs::write(&path, &bytes).expect("written");
    let recording = Recording::open(&path).expect("opened");
    assert_eq!(recording.contents().missing.len(), flipped.len());
    let back = read(&recording);
    assert_eq!(back.len(), written.len());
    assert_is_prefix(&back, &written);
}

#[test]
fn a_damaged_chunk_costs_its_own_samples_only_and_is_named_with_its_offset() {
    let (path, written) = recorded_file("one_chunk.mcap", 1000);
    let mut bytes = fs::read(&path).expect("read");
    let middle = bytes.len() / 3;
    bytes[middle..middle + 64].fill(0x55);
    fs::write(&path, &bytes).expect("written");
    let recording = Recording::open(&path).expect("opened");
    let [missing @ Missing::Record { offset, .. }] = &recording.contents().missing[..] else {
        panic!("one damaged record, not {:?}", recording.contents().missing);
    };
    assert!((1..middle as u64).contains(offset));
    assert!(missing.to_string().contains(&offset.to_string()));
    let n_back = read(&recording).len();
    assert!(n_back > written.len() / 2 && n_back < written.len(), "{n_back} of {}", written.len());
}

#[test]
fn a_first_chunk_that_is_damaged_costs_no_more_than_any_other() {
    let (path, written) = recorded_file("first_chunk.mcap", 1000);
    let mut bytes = fs::read(&path).expect("read");
    let zstd_magic = [0x28, 0xb5, 0x2f, 0xfd];
    let first = bytes.windows(4).position(|w| w == zstd_magic).expect("a compressed chunk");
    bytes[first + 100] ^= 0xff;
    fs::write(&path, &bytes).expect("written");
    let recording = Recording::open(&path).expect("the definitions are repeated at the end");
    assert_eq!(recording.contents().missing.len(), 1);
    assert!(read(&recording).len() > written.len() / 2);
}

#[test]
fn files_of_others_are_refused_with_one_sentence() {
    let path = fresh_path("foreign");
    let refuse = |bytes: &[u8], expected: &str| {
        fs::write(&path, bytes).expect("written");
        let error = Recording::open(&path).expect_err("refused").to_string();
        assert!(error.contains(expected) && error.contains("foreign"), "{error}");
    };
    refuse(b"", "is not an MCAP file");
    refuse(b"time,theta\n0,1\n", "is not an MCAP file");
    refuse(&mcap::MAGIC[..5], "cut at byte 5");
    refuse(mcap::MAGIC, "cut at byte 8");
    refuse(b"\x89MCAP7\r\n", "at byte 5: MCAP version '7'");
    refuse(&mcap_with("ros2", "/krait/input", "krait.OperatorInput", "1"), "profile \"ros2\"");
    refuse(&mcap_with("krait", "/krait/input", "krait.Setpoint", "1"), "expected krait.OperatorInput");
    refuse(&mcap_with("krait", "/krait/new", "krait.New", "1"), "\"/krait/new\"");
    refuse(&mcap_with("krait", "/krait/input", "krait.OperatorInput", "7"), "payload version 7");
    let error = Recording::open(Path::new("/nowhere/foreign.mcap")).expect_err("missing").to_string();
    assert!(error.contains("/nowhere/foreign.mcap"), "{error}");
}

#[test]
fn health_of_before_there_was_room_for_more_reasons_reads_and_of_other_versions_is_refused() {
    for (version, reads) in [("1", false), ("2", true), ("3", true), ("4", false)] {
        let path = fresh_path(&format!("health-{version}.mcap"));
        fs::write(&path, mcap_with("krait", "/krait/health/slave", "krait.Health", version)).expect("written");
        match Recording::open(&path) {
            Ok(recording) => assert!(reads && read(&recording).len() == 1, "version {version}"),
            Err(error) => assert!(!reads && error.to_string().contains("reads version 3"), "{error}"),
        }
    }
}

#[test]
fn topics_of_others_in_a_recording_are_counted_and_passed_over() {
    let path = fresh_path("mixed.mcap");
    fs::write(&path, mcap_with("krait", "/imu", "sensor.Imu", "")).expect("written");
    let recording = Recording::open(&path).expect("opened");
    assert_eq!((recording.contents().n_foreign, read(&recording).len()), (1, 0));
}

fn mcap_with(profile: &str, topic: &str, schema: &str, version: &str) -> Vec<u8> {
    let mut writer = mcap::WriteOptions::new().profile(profile).create(Cursor::new(Vec::new())).expect("in memory");
    let schema_id = writer.add_schema(schema, "protobuf", &[]).expect("schema");
    let metadata = BTreeMap::from([("krait.payload.version".to_owned(), version.to_owned())]);
    let channel_id = writer.add_channel(schema_id, topic, "protobuf", &metadata).expect("channel");
    let header = mcap::records::MessageHeader { channel_id, sequence: 1, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, &[]).expect("message");
    writer.finish().expect("finished");
    writer.into_inner().into_inner()
}

#[test]
fn a_malformed_payload_is_an_error_with_topic_and_number() {
    let mut bytes = Vec::new();
    {
        let mut writer = mcap::WriteOptions::new().profile("krait").create(Cursor::new(&mut bytes)).expect("in memory");
        let schema_id = writer.add_schema("krait.Shape", "protobuf", &[]).expect("schema");
        let metadata = BTreeMap::from([("krait.payload.version".to_owned(), Shape::VERSION.to_string())]);
        let channel_id = writer.add_channel(schema_id, "/krait/shape", "protobuf", &metadata).expect("channel");
        let header = mcap::records::MessageHeader { channel_id, sequence: 77, log_time: 1, publish_time: 1 };
        writer.write_to_known_channel(&header, &[0xff; 5]).expect("message");
        writer.finish().expect("finished");
    }
    let path = fresh_path("malformed.mcap");
    fs::write(&path, bytes).expect("written");
    let recording = Recording::open(&path).expect("opened");
    let error = recording.samples().expect("there").next().expect("one").expect_err("malformed").to_string();
    assert!(error.contains("message 77 of /krait/shape"), "{error}");
}

#[test]
fn an_existing_file_is_never_overwritten() {
    let path = fresh_path("precious.mcap");
    fs::write(&path, b"precious").expect("written");
    let error = RecordingWriter::create(&path, CHUNK_BYTES, &about()).err().expect("refused");
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    assert_eq!(fs::read(&path).expect("there"), b"precious");
}

#[test]
fn missing_folders_are_made_and_a_folder_that_cannot_be_made_is_named() {
    let path = fresh_path("new").join("folder/a.mcap");
    drop(RecordingWriter::create(&path, CHUNK_BYTES, &about()).expect("created"));
    assert!(path.exists());
    let below_a_file = path.join("b.mcap");
    let error = RecordingWriter::create(&below_a_file, CHUNK_BYTES, &about()).err().expect("refused").to_string();
    assert!(error.contains("a.mcap/b.mcap cannot be created"), "{error}");
    fs::remove_dir_all(fresh_folder_of(&path)).expect("removed");
}

fn fresh_folder_of(path: &Path) -> &Path {
    path.parent().and_then(Path::parent).expect("two folders up")
}

#[test]
fn a_disk_that_is_full_from_the_start_is_one_sentence() {
    let full = File::options().write(true).open("/dev/full").expect("Linux has it");
    let error =
        RecordingWriter::begin(DevFull(full), Path::new("/dev/full"), CHUNK_BYTES, &about()).err().expect("full");
    assert!(error.to_string().contains("No space left on device"), "{error}");
}

/// `/dev/full` refuses every write but cannot be cut.
struct DevFull(File);

impl Write for DevFull {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Seek for DevFull {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.0.seek(to)
    }
}

impl RecordingSink for DevFull {
    fn truncate_to(&mut self, _length: u64) -> io::Result<()> {
        Ok(())
    }
    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A disk with room for so many bytes; it takes what still fits, as a real one does.
struct SmallDisk {
    file: File,
    room: u64,
}

impl Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let free = self.room - self.file.stream_position()?;
        let n_fitting = bytes.len().min(usize::try_from(free).expect("small"));
        if n_fitting == 0 {
            return Err(io::Error::from(io::ErrorKind::StorageFull));
        }
        self.file.write(&bytes[..n_fitting])
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for SmallDisk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl RecordingSink for SmallDisk {
    fn truncate_to(&mut self, length: u64) -> io::Result<()> {
        self.file.truncate_to(length)
    }
    fn sync(&mut self) -> io::Result<()> {
        self.file.sync()
    }
}

#[test]
fn a_disk_that_fills_up_at_any_moment_leaves_a_file_that_ends_in_order_at_its_last_chunk() {
    let whole = fs::metadata(recorded_file("not_full.mcap", 1000).0).expect("there").len();
    let path = fresh_path("full.mcap");
    for room in (1..40).map(|idx| idx * whole / 40) {
        let file = File::options().write(true).create(true).truncate(true).open(&path).expect("made");
        let Ok(mut writer) = RecordingWriter::begin(SmallDisk { file, room }, &path, CHUNK_BYTES, &about()) else {
            assert!(room < 5000, "{room} bytes are enough for the beginning");
            continue;
        };
        let written: Vec<Sample> = chain(1000, krait_ipc::clock::monotonic_ns()).collect();
        let recorded = written.iter().enumerate().try_for_each(|(idx, sample)| {
            writer.write(sample, sample.sample_ns())?;
            if idx % 400 == 399 { writer.flush() } else { Ok(()) }
        });
        let error = match recorded {
            Ok(()) => writer.finish(&BTreeMap::new()).expect_err("no room for the end"),
            Err(error) => {
                let again = writer.write(&written[0], 0).expect_err("stopped for good");
                assert!(matches!(again, RecordError::Write { .. }));
                error
            }
        };
        let RecordError::Write { offset, .. } = &error else { panic!("{error}") };
        let length = fs::metadata(&path).expect("there").len();
        assert!(length == *offset + 50 || length == *offset, "{length} is {offset} and the end");
        let recording = Recording::open(&path).expect("opened");
        assert_is_prefix(&read(&recording), &written);
        assert!(!recording.contents().is_indexed);
        let expected = if length == *offset { Missing::End { offset: *offset } } else { Missing::Rest };
        assert_eq!(recording.contents().missing, [expected]);
    }
}
