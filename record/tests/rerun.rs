//! Rerun's own importer opens a recording: transforms and poses as such, every krait field by reflection.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a panic is how a test fails; what is skipped is said aloud"
)]

mod common;
#[path = "common/python.rs"]
mod python;

use common::{chain, fresh_path};
use krait_ipc::message::Shape;
use krait_model::model_file::{Machine, ModelFile};
use krait_record::{About, DrawnMachine, RecordingWriter, Views};
use krait_schema::Sample;
use std::collections::BTreeMap;
use std::path::Path;

const TWO: &str = include_str!("../../docs/segments/two.toml");

/// Ignored because the viewer's package is a download of some 200 MB; `.ci/run` asks for it.
#[test]
#[ignore = "downloads the package of the Rerun viewer; run it with --ignored"]
fn rerun_imports_transforms_poses_the_log_and_every_field() {
    let begin_ns = krait_ipc::clock::monotonic_ns();
    imports("rerun.mcap", &DrawnMachine::default(), chain(1000, begin_ns));
}

/// Ignored for the same reason.
#[test]
#[ignore = "downloads the package of the Rerun viewer; run it with --ignored"]
fn rerun_imports_as_much_of_segments() {
    let file = ModelFile::parse(TWO).expect("the shipped model");
    let Machine::Segments(parameters) = file.machine() else { panic!("segments") };
    let bends_rad = [0.4, 0.1, -0.2, 0.5];
    let bent = |sample: Sample| match sample {
        Sample::Shape(Shape { sequence, sample_ns, available_ns, .. }) => {
            Sample::Shape(Shape::of_joints(sequence, sample_ns, available_ns, &bends_rad))
        }
        Sample::Setpoint(mut setpoint) => {
            setpoint.joints_rad[..4].copy_from_slice(&bends_rad);
            (setpoint.n_joints, setpoint.tip_pos_in_base_m) = (4, [0.0, 0.0, 0.05]);
            Sample::Setpoint(setpoint)
        }
        other => other,
    };
    let samples = chain(1000, krait_ipc::clock::monotonic_ns()).map(bent);
    imports("rerun-segments.mcap", &DrawnMachine::Segments(parameters.clone()), samples);
}

/// Ignored for the same reason.
#[test]
#[ignore = "downloads the package of the Rerun viewer; run it with --ignored"]
fn the_blueprint_draws_the_body_of_each_picture() {
    let target_tmp = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let packages = ["rerun-sdk==0.41.0", "mcap==1.6.0", "mcap-protobuf-support==0.6.0"];
    let probe = "import mcap_protobuf.decoder; from rerun.chunk import RrdReader";
    let python = match python::python_with(target_tmp, "python-rerun-0.41.0-mcap", &packages, probe) {
        Ok(python) => python,
        Err(why) => return println!("SKIPPED: the blueprint for Rerun was not tested, because {why}"),
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let (script, recording) = (root.join("docs/rerun/blueprint.py"), root.join("tests/recordings/flick.mcap"));
    let out = fresh_path("flick.rrd");
    let found = python::answer(&python, &script, &[&recording, &out]);
    // Eight lines of a snake: four backbones and what holds them; one of what was asked for.
    assert_eq!(found["strips"], serde_json::json!({"snake": 8, "setpoint": 1}));
    assert_eq!(found["messages"]["/snake/scene"], 52, "{found}");
    assert!(std::fs::metadata(&out).is_ok_and(|file| file.len() > 50_000), "bodies and curves are in the file");
}

fn imports(name: &str, machine: &DrawnMachine, samples: impl Iterator<Item = Sample>) {
    let target_tmp = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let probe = "from rerun.chunk import RrdReader";
    let python = match python::python_with(target_tmp, "python-rerun-0.41.0", &["rerun-sdk==0.41.0"], probe) {
        Ok(python) => python,
        Err(why) => return println!("SKIPPED: Rerun's importer was not tested, because {why}"),
    };
    let path = fresh_path(name);
    let about = About::run("rerun", &BTreeMap::new(), Vec::new());
    let views = Views::new(Some(machine), 30).expect("a machine");
    let mut writer = RecordingWriter::create(&path, 64 * 1024, &about).expect("created").with_views(Some(views));
    for sample in samples {
        writer.write(&sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");

    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import_with_rerun.py");
    let found = python::answer(&python, &script, &[&path]);
    let has = |entity: &str, part: &str| {
        let components = found["entities"][entity].as_array().unwrap_or_else(|| panic!("{entity}: {found}"));
        assert!(
            components.iter().any(|c| c.as_str().is_some_and(|c| c.contains(part))),
            "{entity} {part}: {components:?}"
        );
    };
    has("/tf", "Transform3D:translation");
    for pose in ["/snake/measured_cp", "/snake/setpoint_cp"] {
        has(pose, "InstancePoses3D:translations");
    }
    has("/log", "TextLog");
    for (entity, message) in [
        ("/krait/input", "krait.OperatorInput"),
        ("/krait/setpoint", "krait.Setpoint"),
        ("/krait/command", "krait.Command"),
        ("/krait/state", "krait.SlaveState"),
        ("/krait/shape", "krait.Shape"),
        ("/krait/health/slave", "krait.Health"),
    ] {
        has(entity, message);
    }
    assert!(found["timelines"].as_array().is_some_and(|lines| !lines.is_empty()), "{found}");
}
