//! Writes the shipped recording anew; a test compares the file with what this would write.

mod arc;
mod generate;
mod plan;

use std::path::Path;

fn main() -> std::io::Result<()> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/default.krr");
    std::fs::write(path, generate::shipped_recording_text()?)
}
