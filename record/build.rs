//! Turns the `.proto` files into Rust types and into one embedded descriptor set per message, without needing `protoc`.

use prost_build::Config;
use protox::prost::Message as _;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Root of the imports in the `.proto` files.
const ROOT: &str = "proto";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed={ROOT}");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let files = proto_files()?;
    Config::new().compile_fds(protox::compile(&files, [ROOT])?)?;
    for file in &files {
        // A viewer gets the file of its message and what that imports, with the comments, and nothing else.
        let descriptors = protox::compile([file], [ROOT])?;
        let stem = file.file_stem().ok_or("a .proto file without a name")?;
        std::fs::write(out.join(stem).with_extension("fds"), descriptors.encode_to_vec())?;
    }
    println!("cargo:rustc-env=KRAIT_GIT_REVISION={}", git_revision().unwrap_or_else(|| "unknown".to_owned()));
    Ok(())
}

fn proto_files() -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(Path::new(ROOT).join("krait"))? {
        files.push(entry?.path());
    }
    files.sort();
    Ok(files)
}

/// The commit that is being built, or `None` outside a git checkout.
fn git_revision() -> Option<String> {
    // Grows with every commit and checkout, so that the revision is never one of the past.
    let log = Path::new("../.git/logs/HEAD");
    if log.exists() {
        println!("cargo:rerun-if-changed={}", log.display());
    }
    let output = Command::new("git").args(["rev-parse", "HEAD"]).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
