//! The public Python `mcap` reader opens a recording and decodes every message of every channel with what the file carries.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

mod common;
#[path = "common/python.rs"]
mod python;

use common::{chain, fresh_path, plausible};
use krait_record::{About, Attachment, DrawnMachine, RecordingWriter, Views};
use krait_schema::{Channel, Sample, View};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn read(path: &Path) -> Option<Value> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_with_python.py");
    python::read_with_python(Path::new(env!("CARGO_TARGET_TMPDIR")), &script, path)
}

fn record(name: &str) -> (common::TestPath, Vec<Sample>) {
    let path = fresh_path(name);
    let toml = Attachment {
        name: "krait.toml".to_owned(),
        media_type: "application/toml".to_owned(),
        data: b"[record]\n".to_vec(),
    };
    let given = BTreeMap::from([("compensation".to_owned(), "naive".to_owned())]);
    let about = About::run("python", &given, vec![toml]);
    let mut writer = RecordingWriter::create(&path, 64 * 1024, &about).expect("created");
    let begin_ns = krait_ipc::clock::monotonic_ns();
    let mut samples: Vec<_> = chain(1000, begin_ns).collect();
    for channel in [Channel::StateCommand, Channel::Marker, Channel::DeviceMarker, Channel::DriveCycle] {
        samples.push(plausible(channel, 1, begin_ns));
    }
    samples.push(plausible(Channel::Recorder, 1, begin_ns));
    for sample in &samples {
        writer.write(sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");
    (path, samples)
}

#[test]
fn python_decodes_every_message_of_every_channel_to_the_same_values() {
    let (path, samples) = record("python.mcap");
    let Some(found) = read(&path) else { return };
    assert_eq!(found["indexed"], true);
    assert_eq!(found["error"], Value::Null);
    assert_eq!(found["metadata"]["krait"]["compensation"], "naive");
    assert_eq!(found["attachments"]["krait.toml"], 9);
    assert_eq!(found["channels"].as_object().expect("channels").len(), Channel::ALL.len());
    for channel in Channel::ALL {
        let of_channel: Vec<_> = samples.iter().filter(|s| s.channel() == channel).collect();
        let seen = &found["channels"][channel.topic()];
        assert_eq!(seen["schema"], channel.schema().name);
        assert_eq!(seen["messages"], of_channel.len(), "{channel:?}");
        assert_eq!(seen["decoded"], of_channel.len(), "{channel:?}");
        for (key, sample) in [("first", of_channel[0]), ("last", of_channel[of_channel.len() - 1])] {
            assert_eq!(seen[key]["sequence"], sample.sequence(), "{channel:?}");
            assert_eq!(seen[key]["sample_ns"], sample.sample_ns(), "{channel:?}");
        }
    }
    let Some(Sample::Command(command)) = samples.iter().rfind(|s| s.channel() == Channel::Command) else {
        panic!("a command")
    };
    let last = &found["channels"]["/krait/command"]["last"];
    assert_eq!(last["q_tilde_m"]["line_2"], command.q_tilde_m[1]);
    assert_eq!(last["bend_rad"]["y"], command.bend_rad[1]);
    assert_eq!(last["stamps"]["input_sent_ns"], command.stamps.input_sent_ns);
    assert_eq!(last["model_hash"], command.model_hash);
    assert_eq!(found["channels"]["/krait/shape"]["last"]["q_tilde_m"]["line_1"], "NaN");
}

#[test]
fn a_careful_reader_finds_no_fault_and_everything_that_the_layout_and_the_views_name() {
    let path = fresh_path("views.mcap");
    let about = About::run("python", &BTreeMap::new(), Vec::new());
    let views = Views::new(Some(&DrawnMachine::default()), 30).expect("the default machine");
    let mut writer = RecordingWriter::create(&path, 64 * 1024, &about).expect("created").with_views(Some(views));
    let begin_ns = krait_ipc::clock::monotonic_ns();
    for sample in chain(2000, begin_ns).chain([plausible(Channel::Marker, 1, begin_ns)]) {
        writer.write(&sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (script, layout) = (root.join("tests/check_with_python.py"), root.join("../docs/krait.layout.json"));
    let found = python::run_with_python(Path::new(env!("CARGO_TARGET_TMPDIR")), &script, &[&path, &layout]);
    let Some(found) = found else { return };
    assert_eq!(found["doctor"], serde_json::json!([]));
    assert_eq!(found["layout"], serde_json::json!([]));
    assert!(found["layout_paths"].as_u64().is_some_and(|n| n > 25), "{found}");
    for view in View::ALL {
        assert_eq!(found["views"][view.topic()]["schema"], view.schema().name, "{view:?}");
    }
    // Two seconds touch 60 periods of 1/30 s, or 61.
    let n_drawn = |view: View| found["views"][view.topic()]["messages"].as_u64().expect("some");
    for view in [View::MeasuredCp, View::SetpointCp, View::MeasuredJs] {
        assert!((60..=61).contains(&n_drawn(view)), "{view:?}: {}", n_drawn(view));
    }
    assert_eq!(found["views"]["/snake/scene"]["lines"], serde_json::json!({"snake": 8, "setpoint": 1}));
    assert_eq!(found["views"]["/tf"]["frames"], serde_json::json!({"tip": true, "tip_setpoint": true}));
    assert!(found["views"]["/log"]["texts"].as_array().expect("lines").contains(&"MARK mark 1".into()), "{found}");
}

#[test]
fn python_reads_a_cut_recording_up_to_the_cut() {
    let (path, samples) = record("python_cut.mcap");
    let whole = fs::read(&path).expect("read");
    fs::write(&path, &whole[..whole.len() / 2]).expect("written");
    let Some(found) = read(&path) else { return };
    assert_eq!(found["indexed"], false);
    let n_decoded: u64 =
        found["channels"].as_object().expect("some").values().filter_map(|c| c["decoded"].as_u64()).sum();
    assert!(n_decoded > samples.len() as u64 / 4 && n_decoded < samples.len() as u64, "{n_decoded}");
}
