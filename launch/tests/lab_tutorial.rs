//! The tutorial of the model lab: its commands print what its text says.
#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Numbers may differ by this part: another machine's last digits, not another answer.
const TOLERANCE: f64 = 0.02;

#[test]
fn the_tutorial_s_commands_print_what_its_text_says() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let text = fs::read_to_string(docs.join("lab-tutorial.md")).expect("the tutorial");
    let folder = Folder::new();
    for name in ["base.toml", "hidden.csv"] {
        fs::copy(docs.join("lab-tutorial").join(name), folder.0.join(name)).expect("a shipped file");
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
    assert_eq!(n_commands, 4);
    let page = fs::read_to_string(folder.0.join("why.html")).expect("the page of pictures");
    assert!(page.contains("Direction split") && page.contains("Travel since the last reversal"));
    let script = fs::read_to_string(folder.0.join("next.csv")).expect("the script");
    assert!(script.contains("time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch"));
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

struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        let path = std::env::temp_dir().join(format!("krait-lab-tutorial-{}", std::process::id()));
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
