//! Follows a page of the documentation: its commands, against the real binary, print what its text shows.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Numbers may differ by this part: another machine's last digits, not another answer.
const TOLERANCE: f64 = 0.02;

/// Runs the commands of a page where these files of `docs` are, and compares what they print with what the page shows.
pub fn follow(page: &str, files: &[&str], folder: &Folder) -> usize {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let text = fs::read_to_string(docs.join(page)).expect("the tutorial");
    for file in files {
        let name = Path::new(file).file_name().expect("a file");
        fs::copy(docs.join(file), folder.0.join(name)).expect("a shipped file");
    }
    let mut n_commands = 0;
    for block in text.split("```console\n$ krait ").skip(1) {
        let block = block.split("```").next().expect("a block ends");
        let (command, shown) = block.split_once('\n').expect("a command and its output");
        let ended = Command::new(env!("CARGO_BIN_EXE_krait"))
            .args(command.split_whitespace())
            .current_dir(&folder.0)
            .output()
            .expect("krait starts");
        assert!(ended.status.success(), "{command}: {}", String::from_utf8_lossy(&ended.stderr));
        let printed = String::from_utf8(ended.stdout).expect("text");
        for line in shown.lines() {
            assert!(printed.lines().any(|own| says(own, line)), "{command}: expected {line:?} in:\n{printed}");
        }
        n_commands += 1;
    }
    n_commands
}

/// Whether a printed line begins with the shown one's words, its numbers nearly the same.
fn says(printed: &str, shown: &str) -> bool {
    let mut own = printed.split_whitespace();
    shown.split_whitespace().all(|word| own.next().is_some_and(|own| own == word || is_near(own, word)))
}

fn is_near(a: &str, b: &str) -> bool {
    match (a.trim_end_matches(',').parse::<f64>(), b.trim_end_matches(',').parse::<f64>()) {
        // A standard error is shown with two digits: it may round to its neighbour.
        (Ok(a), Ok(b)) => (a - b).abs() <= (TOLERANCE * b.abs()).max(0.06 * b.abs() * f64::from(b.abs() < 1e-6)),
        _ => false,
    }
}

/// A folder that goes with the test.
pub struct Folder(pub PathBuf);

impl Folder {
    /// A new one, named for the test.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("krait-page-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder");
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left behind lies in the temporary directory and has its own name.
        let _removed = fs::remove_dir_all(&self.0);
    }
}
