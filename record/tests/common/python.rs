//! A Python with the public `mcap` reader in it, made once per target folder, and the script that reads a recording.
//!
//! Other crates' tests take this file in with `#[path]`; it needs nothing but `std` and `serde_json`.

#![allow(
    dead_code,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a panic is how a test fails; what is skipped is said aloud"
)]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// Everything that is installed, pinned: a new release of a reader must not turn a build red.
const PACKAGES: [&str; 5] =
    ["mcap==1.6.0", "mcap-protobuf-support==0.6.0", "protobuf==7.36.2", "zstandard==0.25.0", "lz4==4.4.5"];

/// What `read_with_python.py` says of a recording, or `None` where Python or the package index is out of reach: that is
/// said aloud, and is a failure where `CI` is set.
pub fn read_with_python(target_tmp: &Path, script: &Path, recording: &Path) -> Option<serde_json::Value> {
    run_with_python(target_tmp, script, &[recording])
}

/// What a script says of some files; `None` as [`read_with_python`].
pub fn run_with_python(target_tmp: &Path, script: &Path, files: &[&Path]) -> Option<serde_json::Value> {
    let python = match python_with_mcap(target_tmp) {
        Ok(python) => python,
        Err(why) => {
            assert!(std::env::var_os("CI").is_none(), "the Python reader must be tested in CI, but {why}");
            println!("SKIPPED: the public Python reader was not tested, because {why}");
            return None;
        }
    };
    Some(answer(&python, script, files))
}

/// What a script says, as JSON.
pub fn answer(python: &Path, script: &Path, files: &[&Path]) -> serde_json::Value {
    let output = Command::new(python).arg(script).args(files).output().expect("Python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one line of JSON")
}

fn python_with_mcap(target_tmp: &Path) -> Result<PathBuf, String> {
    python_with(target_tmp, "python-mcap-1.6.0", &PACKAGES, "import mcap.reader, mcap_protobuf.decoder")
}

/// A Python with packages, made once in a folder of that name; `probe` is a line that needs them all.
///
/// # Errors
/// What is out of reach.
pub fn python_with(target_tmp: &Path, name: &str, packages: &[&str], probe: &str) -> Result<PathBuf, String> {
    // Tests of one program are threads of one process; only the first sets it up.
    static SET_UP: Mutex<()> = Mutex::new(());
    let _guard = SET_UP.lock().unwrap_or_else(PoisonError::into_inner);
    let home = target_tmp.join(name);
    let python = home.join("bin/python");
    let is_complete = || run(Command::new(&python).args(["-c", probe])).is_ok();
    if is_complete() {
        return Ok(python);
    }
    // Made aside and moved into place whole, because other test programs may be looking for it at the same time.
    let aside = target_tmp.join(format!("{name}-{}", std::process::id()));
    run(Command::new("python3").args(["-m", "venv"]).arg(&aside))?;
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    run(Command::new(aside.join("bin/python")).args(pip).args(packages))?;
    let moved = std::fs::rename(&aside, &home);
    if is_complete() { Ok(python) } else { Err(format!("{} could not be set up: {moved:?}", home.display())) }
}

fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| format!("{command:?} did not run: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    Err(format!("{command:?} failed: {}", String::from_utf8_lossy(&output.stderr).trim()))
}
