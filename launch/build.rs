//! Says which commit is being built, for the metadata of recordings.

#![allow(clippy::print_stdout, reason = "cargo is told through standard output")]

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo:rustc-env=KRAIT_GIT_REVISION={}", git_revision().unwrap_or_else(|| "unknown".to_owned()));
}

/// The commit that is being built, or `None` outside a git checkout.
fn git_revision() -> Option<String> {
    // The log grows with every commit and checkout, so that the revision is never one of the past.
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    if Path::new(&log).exists() {
        println!("cargo:rerun-if-changed={log}");
    }
    git(&["rev-parse", "HEAD"])
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
