//! Columns that `krait lab init` does not use, and how one is taken out.

use krait_lab::Measurements;
use krait_lab::init::{Proposal, propose};
use krait_lab::read::{ColumnMap, Mapping, read};
use krait_model::model_file::ModelFile;
use std::path::{Path, PathBuf};

/// 20 s at 50 Hz in a file of a test, named by it: header, then rows made from the time.
fn file(name: &str, header: &str, row: impl Fn(f64) -> String) -> PathBuf {
    let rows = (0..1000).map(|k| row(f64::from(k) * 0.02)).collect::<Vec<_>>();
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("init_columns_{name}.csv"));
    std::fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).expect("the test folder can be written");
    path
}

fn mapped(map: &[&str]) -> ColumnMap {
    map.iter().map(|own| own.parse::<Mapping>().expect("well formed")).collect()
}

fn proposed(path: &Path, map: &[&str]) -> Proposal {
    propose(path, &mapped(map)).unwrap_or_else(|error| panic!("{error}"))
}

/// What the proposal's own two files read.
fn data(path: &Path, found: &Proposal) -> Measurements {
    let map = path.with_extension("map.toml");
    std::fs::write(&map, found.map.to_toml("data")).expect("written");
    let model = ModelFile::parse(&found.model).expect("a model");
    read(path, &ColumnMap::from_file(&map).expect("a mapping"), model.machine().into()).expect("good data")
}

/// A command, a position, a current and columns of no use.
fn with_a_current(name: &str) -> PathBuf {
    let row = |t: f64| {
        let (u, noise) = (30.0 * t.sin(), (37.0 * t).sin());
        format!(
            "{t:.2},{u:.4},{:.4},{:.4},{:.1},x,{:.3},7",
            u + 0.3 * (5.0 * t).sin(),
            t.cos() + 0.01 * noise,
            90.0 * noise,
            t * t
        )
    };
    file(name, "t_s,cmd_deg,angle_deg,motor [A],brake [mA],note,foo,k", row)
}

#[test]
fn columns_that_are_not_used_are_named_with_the_reason() {
    let found = proposed(&with_a_current("unused"), &[]);
    let why = |name: &str| found.columns.iter().find(|seen| seen.name == name).map(|seen| seen.why.as_str());
    for (name, reason) in [
        ("motor [A]", "a current"),
        ("brake [mA]", "a current"),
        ("note", "text"),
        ("foo", "unknown name"),
        ("k", "never changes"),
    ] {
        assert_eq!(why(name), Some(reason), "{name}");
    }
    let hint = found.cautions.iter().find(|caution| caution.contains("kind force")).expect("a hint");
    assert!(hint.contains("\"motor [A]\"") && hint.contains("--map none=cmd_deg"), "{hint}");
}

#[test]
fn one_command_in_two_units_is_one_joint() {
    let row = |t: f64| {
        let u: f64 = 30.0 * t.sin();
        format!("{t:.2},{u:.4},{:.6},{:.4}", u.to_radians(), 0.9 * u)
    };
    let path = file("two_units", "time_s,u1_deg,u1_rad,y1_deg", row);
    let found = proposed(&path, &[]);
    assert_eq!(found.pairs.len(), 1, "{:?}", found.pairs);
    let spare = found.columns.iter().find(|seen| seen.name == "u1_rad").map(|seen| seen.why.as_str());
    assert_eq!(spare, Some("a spare command"));
    assert_eq!(data(&path, &found).n_inputs, 1);
}

#[test]
fn a_column_that_is_taken_out_is_not_proposed_and_not_read() {
    let path = with_a_current("taken_out");
    let found = proposed(&path, &["none=cmd_deg", "none=foo"]);
    assert_eq!(found.kind, "force", "the hint's own words make a machine of it");
    let is =
        |name: &str| found.columns.iter().find(|seen| seen.name == name).and_then(|seen| seen.stands_for.as_deref());
    assert_eq!([is("motor [A]"), is("angle_deg"), is("cmd_deg")], [Some("i1_a"), Some("q1_rad"), None]);
    let read = data(&path, &found);
    assert!(read.names_beside().all(|name| name != "foo" && name != "cmd_deg"), "the mapping file says it too");
    assert!(data(&path, &proposed(&path, &[])).names_beside().any(|name| name == "foo"));
    let sentence = propose(&path, &mapped(&["none=bar"])).expect_err("no such column").to_string();
    assert!(sentence.contains("\"bar\"") && sentence.contains("--map"), "{sentence}");
}
