//! House rules that a program can see: first lines, READMEs, file lengths, units in names, reasons for dependencies, licences.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Nobody holds more than this in the head; tests and generated text may be longer.
const MOST_LINES: usize = 500;
/// Endings that say the unit of a float in a message, and words that have none.
const UNITS: [&str; 23] = [
    "_m",
    "_rad",
    "_rad2",
    "_n",
    "_s",
    "_ns",
    "_hz",
    "_m_per_s",
    "_rad_per_s",
    "_m_per_rad",
    // Of a motor and its encoder.
    "_counts_per_s",
    "_a",
    "_celsius",
    "_v",
    // The unit of a learnt parameter is the parameter's own, which the model file names.
    "learnt",
    "value",
    "sd",
    "worst",
    "newest",
    "limit",
    "motion_scale",
    "_ms",
    "_nm",
];
/// Licences that may be linked into a program under MIT.
const LICENCES: [&str; 12] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "Unlicense",
    "0BSD",
    "Unicode-3.0",
    "CC0-1.0",
    "BSL-1.0",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every Rust file that git tracks or would track.
fn rust_files() -> Vec<PathBuf> {
    let listed = Command::new("git")
        .args(["ls-files", "--cached", "--others", "--exclude-standard", "*.rs"])
        .current_dir(root())
        .output()
        .expect("git lists the files");
    let text = String::from_utf8(listed.stdout).expect("paths are text");
    let files: Vec<PathBuf> = text.lines().map(|line| root().join(line)).filter(|path| path.exists()).collect();
    assert!(files.len() > 50, "found only {} files", files.len());
    files
}

#[test]
fn every_file_says_in_its_first_line_why_it_exists() {
    for path in rust_files() {
        let text = fs::read_to_string(&path).expect("readable");
        assert!(text.starts_with("//! "), "{} does not begin with `//! `", path.display());
    }
}

#[test]
fn no_file_is_longer_than_a_head_can_hold() {
    let is_test = |path: &Path| path.strip_prefix(root()).is_ok_and(|path| path.iter().any(|part| part == "tests"));
    let production: Vec<PathBuf> = rust_files().into_iter().filter(|path| !is_test(path)).collect();
    assert!(production.len() > 300, "found only {} files outside tests", production.len());
    for path in production {
        let n_lines = fs::read_to_string(&path).expect("readable").lines().count();
        assert!(n_lines <= MOST_LINES, "{} has {n_lines} lines", path.display());
    }
}

#[test]
fn no_test_is_written_where_none_would_be_run() {
    let metadata = metadata();
    let mut n_silent = 0;
    for target in
        metadata["packages"].as_array().expect("packages").iter().flat_map(|package| {
            package["targets"].as_array().into_iter().flatten().filter(|_| package["source"].is_null())
        })
    {
        let silent = |key: &str| target[key] == false && (target["kind"][0] == "lib" || target["kind"][0] == "bin");
        let source = Path::new(target["src_path"].as_str().expect("a path")).parent().expect("a folder").to_owned();
        let holds = |what: &str| {
            let files =
                rust_files().into_iter().filter(|path| path.canonicalize().is_ok_and(|path| path.starts_with(&source)));
            files.filter(|path| fs::read_to_string(path).expect("readable").contains(what)).collect::<Vec<_>>()
        };
        for (key, what) in [("doctest", "//! ```"), ("doctest", "/// ```"), ("test", "#[test]")] {
            if silent(key) && (key != "doctest" || target["kind"][0] == "lib") {
                n_silent += 1;
                let found = holds(what);
                assert!(found.is_empty(), "{key} is off in Cargo.toml, and `{what}` stands in {found:?}");
            }
        }
    }
    assert!(n_silent > 20, "only {n_silent} switches found: has the form of the metadata changed?");
}

#[test]
fn no_public_type_shares_its_name_with_another() {
    let mut places: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in rust_files().into_iter().filter(|path| path.iter().any(|part| part == "src")) {
        for line in fs::read_to_string(&path).expect("text").lines() {
            let item = line.trim_start();
            let declared =
                ["pub struct ", "pub enum ", "pub trait ", "pub type "].iter().find_map(|kind| item.strip_prefix(kind));
            let name: Option<String> = declared.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric()).collect());
            if let Some(name) = name.filter(|name| !name.is_empty()) {
                places.entry(name).or_default().push(path.clone());
            }
        }
    }
    assert!(places.len() > 300, "{} public types were found; the search is broken", places.len());
    let twice: Vec<_> = places.into_iter().filter(|(_, places)| places.len() > 1).collect();
    assert!(twice.is_empty(), "a reader cannot tell them apart: {twice:#?}");
}

#[test]
fn every_crate_has_a_readme_of_a_few_sentences() {
    for entry in fs::read_dir(root()).expect("root").flatten().filter(|entry| entry.path().join("Cargo.toml").exists())
    {
        let readme = fs::read_to_string(entry.path().join("README.md"));
        let n_lines = readme.unwrap_or_else(|e| panic!("{}: {e}", entry.path().display())).lines().count();
        assert!((2..=8).contains(&n_lines), "{} has {n_lines} lines", entry.path().display());
    }
}

#[test]
fn every_float_in_a_message_carries_its_unit() {
    for path in rust_files().into_iter().filter(|path| path.to_string_lossy().contains("ipc/src/message")) {
        for line in fs::read_to_string(&path).expect("readable").lines() {
            let Some((name, kind)) = line.trim().strip_prefix("pub ").and_then(|rest| rest.split_once(": ")) else {
                continue;
            };
            if kind.contains("f64") && !line.contains("fn ") {
                assert!(UNITS.iter().any(|unit| name.ends_with(unit)), "{}: {name} has no unit", path.display());
            }
        }
    }
}

fn metadata() -> serde_json::Value {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(root())
        .output()
        .expect("cargo knows the packages");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn architecture_says_why_each_dependency_is_there() {
    let architecture = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("Cargo.toml");
    let table =
        manifest.split("[workspace.dependencies]").nth(1).expect("a table").split("\n[").next().expect("its end");
    let names: BTreeSet<&str> = table.lines().filter_map(|line| line.split_once(" = ")).map(|(name, _)| name).collect();
    assert!(names.len() > 15, "{names:?}");
    let rows = architecture.split("## Dependencies").nth(1).expect("a chapter on dependencies");
    let named: BTreeSet<&str> = rows
        .lines()
        .filter_map(|line| line.strip_prefix("| ")?.split(" | ").next())
        .flat_map(|cell| cell.split(", "))
        .map(|word| word.split(' ').next().unwrap_or(word))
        .collect();
    for name in names.iter().filter(|name| !name.starts_with("krait-")) {
        assert!(named.contains(name), "ARCHITECTURE.md does not say why {name} is there");
    }
}

#[test]
fn every_licence_may_be_linked_into_a_program_under_mit() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().expect("packages");
    assert!(packages.len() > 50);
    for package in packages {
        let licence = package["license"].as_str().unwrap_or("none");
        let alternatives = licence.replace('/', " OR ").replace(['(', ')'], "");
        let allowed = |one: &str| one.split(" AND ").all(|part| LICENCES.contains(&part.trim()));
        assert!(alternatives.split(" OR ").any(|one| allowed(one.trim())), "{} is under {licence}", package["name"]);
    }
}
