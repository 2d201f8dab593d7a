//! Small files that unpack to gigabytes: read or refused in one sentence, by a program that may take 256 MB.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::time::Duration;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use krait_tests::{Ended, TempFolder};
use mcap::records::MessageHeader;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::sync::Arc;

const PATIENCE: Duration = Duration::from_secs(240);

/// What `krait lab init` says of a file, in little memory.
fn looked_at(path: &str) -> Ended {
    let n_bytes = fs::metadata(path).expect("there").len();
    assert!(n_bytes < 30_000_000, "{path}: {n_bytes} bytes are no small file");
    Ended::limited("-d 262144", &["lab", "init", path], PATIENCE)
}

/// It is refused because it is too large, with what it has.
fn assert_too_large(path: &str, words: &str) {
    let ended = looked_at(path);
    assert_eq!(ended.code, Some(2), "{path}: {ended:?}");
    let said = ended.stderr;
    assert!(said.starts_with("krait: ") && said.contains(path) && said.contains(words), "{said}");
}

/// It is read, or refused for what its numbers are: no memory ran out.
fn assert_fits(path: &str) {
    let ended = looked_at(path);
    assert!(matches!(ended.code, Some(0..=2)), "{path}: {ended:?}");
    let said = ended.stderr;
    assert!(!said.contains("too large") && !said.contains("expected at most"), "{said}");
}

/// A MATLAB file with vectors of so many numbers of nothing.
fn matlab(path: &str, names: &[&str], n_rows: usize) {
    let element = |sort: u32, bytes: &[u8]| {
        let mut all = [sort.to_le_bytes(), (bytes.len() as u32).to_le_bytes()].concat();
        all.extend_from_slice(bytes);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    };
    let mut file = File::create(path).expect("made");
    let mut head = [b' '; 128];
    head[..6].copy_from_slice(b"MATLAB");
    head[124..].copy_from_slice(&[0, 1, b'I', b'M']);
    file.write_all(&head).expect("written");
    for name in names {
        let sizes = [n_rows as u32, 1].map(u32::to_le_bytes).concat();
        let parts = [element(6, &[6, 0, 0, 0, 0, 0, 0, 0]), element(5, &sizes), element(1, name.as_bytes())].concat();
        let n_bytes = parts.len() + 8 + 8 * n_rows;
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(&[14_u32.to_le_bytes(), (n_bytes as u32).to_le_bytes()].concat()).expect("packed");
        packed.write_all(&parts).expect("packed");
        packed.write_all(&[9_u32.to_le_bytes(), (8 * n_rows as u32).to_le_bytes()].concat()).expect("packed");
        let rows = vec![0; 8 * 1000];
        for _ in 0..n_rows / 1000 {
            packed.write_all(&rows).expect("packed");
        }
        let packed = packed.finish().expect("packed");
        file.write_all(&[15_u32.to_le_bytes(), (packed.len() as u32).to_le_bytes()].concat()).expect("written");
        file.write_all(&packed).expect("written");
    }
}

#[test]
fn matlab_files_are_refused_by_what_they_unpack_to() {
    let folder = TempFolder::new("bomb-matlab");
    let (one, many, fits) = (folder.file("one.mat"), folder.file("many.mat"), folder.file("fits.mat"));
    matlab(&one, &["t"], 11_000_000);
    assert_too_large(&one, "too large");
    matlab(&many, &["t", "u1_deg", "y1_deg"], 3_400_000);
    assert_too_large(&many, "more than");
    matlab(&fits, &["t", "u1_deg", "y1_deg"], 3_300_000);
    assert_fits(&fits);
}

/// A Parquet table of columns of numbers that are all the same, and of labels that are.
fn parquet(path: &str, numbers: &[&str], label: Option<&[u8]>, n_rows: usize) {
    const BATCH: usize = 1000;
    let mut schema: String = numbers.iter().map(|name| format!("required double {name};")).collect();
    schema += if label.is_some() { "required binary note (UTF8);" } else { "" };
    let schema = Arc::new(parse_message_type(&format!("message table {{ {schema} }}")).expect("a schema"));
    let properties = Arc::new(WriterProperties::builder().build());
    let mut file = SerializedFileWriter::new(File::create(path).expect("made"), schema, properties).expect("begun");
    let mut group = file.next_row_group().expect("begun");
    while let Some(mut column) = group.next_column().expect("a column") {
        match label {
            Some(label)
                if matches!(column.untyped(), parquet::column::writer::ColumnWriter::ByteArrayColumnWriter(_)) =>
            {
                let values = vec![ByteArray::from(label.to_vec()); BATCH];
                for _ in 0..n_rows / BATCH {
                    column.typed::<ByteArrayType>().write_batch(&values, None, None).expect("written");
                }
            }
            _ => {
                for _ in 0..n_rows / BATCH {
                    column.typed::<DoubleType>().write_batch(&[1.5; BATCH], None, None).expect("written");
                }
            }
        }
        column.close().expect("closed");
    }
    group.close().expect("closed");
    file.close().expect("closed");
}

#[test]
fn parquet_tables_are_refused_by_what_they_unpack_to() {
    let folder = TempFolder::new("bomb-parquet");
    let (many, labels, fits) =
        (folder.file("many.parquet"), folder.file("labels.parquet"), folder.file("fits.parquet"));
    parquet(&many, &["t", "u1_deg", "y1_deg"], None, 3_400_000);
    assert_too_large(&many, "3400000 rows of 3 columns");
    // A few rows whose labels are one and the same long text.
    parquet(&labels, &["t", "u1_deg"], Some(&[b'a'; 200_000]), 5_000);
    assert_too_large(&labels, "its labels take 1000000000 bytes");
    parquet(&fits, &["t", "u1_deg", "y1_deg"], None, 3_300_000);
    assert_fits(&fits);
}

/// Bytes of a message as ROS 2 writes it: each number at a multiple of its size behind the head.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        self.0.resize(self.0.len().next_multiple_of(N), 0);
        self.0.extend(bytes);
    }

    fn text(&mut self, text: &str) {
        self.number((text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text.bytes().chain([0]));
    }

    fn message(self) -> Vec<u8> {
        [&[0, 1, 0, 0][..], &self.0].concat()
    }
}

/// A message of so many joints.
fn joint_state(n_joints: usize) -> Vec<u8> {
    let mut cdr = Cdr::default();
    cdr.number(1_i32.to_le_bytes());
    cdr.number(0_u32.to_le_bytes());
    cdr.text("");
    cdr.number((n_joints as u32).to_le_bytes());
    (0..n_joints).for_each(|joint| cdr.text(&format!("j{joint}")));
    cdr.number((n_joints as u32).to_le_bytes());
    (0..n_joints).for_each(|_| cdr.number(0.5_f64.to_le_bytes()));
    cdr.number(0_u32.to_le_bytes());
    cdr.number(0_u32.to_le_bytes());
    cdr.message()
}

/// A bag with messages of these kinds, so often each, one after the other.
fn bag(path: &str, messages: &[(&str, &str, Vec<u8>, u32)]) {
    let mut writer = mcap::WriteOptions::new()
        .profile("ros2")
        .emit_message_indexes(false)
        .create(File::create(path).expect("made"))
        .expect("begun");
    let mut log_time = 1_700_000_000_000_000_000;
    let mut channels: BTreeMap<&str, u16> = BTreeMap::new();
    for (topic, kind, payload, n) in messages {
        let channel_id = *channels.entry(topic).or_insert_with(|| {
            let schema = writer.add_schema(kind, "ros2msg", b"").expect("added");
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("added")
        });
        for sequence in 0..*n {
            log_time += 1_000_000;
            let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, payload).expect("written");
        }
    }
    writer.finish().expect("finished");
}

#[test]
fn bags_are_refused_by_the_rows_and_columns_that_their_topics_make() {
    const JOINTS: &str = "sensor_msgs/msg/JointState";
    let folder = TempFolder::new("bomb-bag");
    let number = || {
        let mut cdr = Cdr::default();
        cdr.number(0.25_f64.to_le_bytes());
        cdr.message()
    };
    let path = |name: &str| folder.file(name);
    let (long, wide, late, fits) = (path("long.mcap"), path("wide.mcap"), path("late.mcap"), path("fits.mcap"));
    let float = |n| ("/u", "std_msgs/msg/Float64", number(), n);
    bag(&long, &[float(2_600_000)]);
    assert_too_large(&long, "hold more than 10000000 values");
    // One message of nine hundred joints beside a million numbers would be a table of nine hundred million.
    bag(&wide, &[("/joints", JOINTS, joint_state(900), 1), float(1_000_000)]);
    assert_too_large(&wide, "1000000 rows of 901 columns");
    // And so would joints that come to a topic late.
    bag(&late, &[("/joints", JOINTS, joint_state(1), 1_000_000), ("/joints", JOINTS, joint_state(900), 1)]);
    assert_too_large(&late, "hold more than 10000000 values");
    bag(&fits, &[("/joints", JOINTS, joint_state(2), 1_900_000)]);
    assert_fits(&fits);
}
