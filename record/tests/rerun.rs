//! Rerun's own importer opens a recording: transforms and poses as such, every krait field by reflection.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a panic is how a test fails; what is skipped is said aloud"
)]

mod common;
#[path = "common/python.rs"]
mod python;

use common::{chain, fresh_path};
use krait_model::MachineParameters;
use krait_record::{About, RecordingWriter, Views};
use std::collections::BTreeMap;
use std::path::Path;

/// Ignored because the viewer's package is a download of some 200 MB; `.ci/run` asks for it.
#[test]
#[ignore = "downloads the package of the Rerun viewer; run it with --ignored"]
fn rerun_imports_transforms_poses_the_log_and_every_field() {
    let target_tmp = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let probe = "from rerun.chunk import RrdReader";
    let python = match python::python_with(target_tmp, "python-rerun-0.41.0", &["rerun-sdk==0.41.0"], probe) {
        Ok(python) => python,
        Err(why) => return println!("SKIPPED: Rerun's importer was not tested, because {why}"),
    };
    let path = fresh_path("rerun.mcap");
    let about = About::run("rerun", &BTreeMap::new(), Vec::new());
    let views = Views::new(Some(&MachineParameters::default()), 30).expect("the default machine");
    let mut writer = RecordingWriter::create(&path, 64 * 1024, &about).expect("created").with_views(Some(views));
    for sample in chain(1000, krait_ipc::clock::monotonic_ns()) {
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
    has("/snake/measured_cp", "InstancePoses3D:translations");
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
