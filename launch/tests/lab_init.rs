//! `krait lab init` on a real machine's log in another program's dialect: from the file to the first answer by the printed command.
#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("krait-lab-init-{test}-{}", std::process::id()));
        fs::create_dir_all(&path).expect("a folder");
        Self(path)
    }

    fn krait(&self, words: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_krait")).args(words).current_dir(&self.0).output().expect("krait starts")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left behind lies in the temporary directory and has its own name.
        let _removed = fs::remove_dir_all(&self.0);
    }
}

/// The shipped jaw with other names, in milliseconds, with semicolons and decimal commas.
fn foreign_jaw() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../lab/tests/data/davinci-jaw/00.csv");
    let text = fs::read_to_string(path).expect("a shipped file");
    let mut rows = vec!["Zeit [ms];Motor (deg);Jaw angle [deg]".to_owned()];
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let ms = 1e3 * cells[0].parse::<f64>().expect("a time");
        rows.push(format!("{ms};{};{}", cells[1], cells[2]).replace('.', ","));
    }
    rows.join("\r\n")
}

#[test]
fn from_a_foreign_file_to_the_first_answer_by_the_printed_command() {
    let folder = Folder::new("first");
    fs::write(folder.0.join("my jaw.csv"), foreign_jaw()).expect("written");
    let ended = folder.krait(&["lab", "init", "my jaw.csv"]);
    let printed = String::from_utf8(ended.stdout).expect("text");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let table: Vec<&str> = printed.lines().filter(|line| line.starts_with("  ")).collect();
    assert!(table.len() >= 4 && table.iter().all(|line| line.chars().count() <= 80), "{printed}");
    assert!(printed.contains("decimal comma") && printed.contains("Motor (deg)"), "{printed}");
    let next = printed.lines().find_map(|line| line.strip_prefix("Next: krait ")).expect("the next command");
    assert_eq!(next, "lab diagnose --model 'my jaw.model.toml' --data 'my jaw.csv' --map-file 'my jaw.map.toml'");
    let typed = format!("\"$0\" {next}");
    let ended = Command::new("sh")
        .args(["-c", &typed, env!("CARGO_BIN_EXE_krait")])
        .current_dir(&folder.0)
        .output()
        .expect("a shell");
    let printed = String::from_utf8(ended.stdout).expect("text");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(printed.contains("joint 1 (Jaw angle)"), "the user's own names: {printed}");
    assert!(
        ["bouc-wen", "backlash", "prandtl"].iter().any(|name| printed.contains(&format!("Next: krait lab add {name}")))
    );
    assert!(printed.contains("--map-file 'my jaw.map.toml' --out 'my jaw.model.better.toml'"), "{printed}");
}

#[test]
fn nothing_is_overwritten_and_nothing_is_written_for_what_is_refused() {
    let folder = Folder::new("refused");
    let text = foreign_jaw();
    fs::write(folder.0.join("a.csv"), &text).expect("written");
    fs::write(folder.0.join("a.map.toml"), "mine").expect("written");
    let sentence = |words: &[&str]| {
        let ended = folder.krait(words);
        assert_eq!(ended.status.code(), Some(2), "{words:?}");
        String::from_utf8(ended.stderr).expect("text")
    };
    assert!(sentence(&["lab", "init", "a.csv"]).contains("a.map.toml is already there"));
    assert_eq!(fs::read_to_string(folder.0.join("a.map.toml")).expect("there"), "mine");
    assert!(!folder.0.join("a.model.toml").exists());
    fs::write(folder.0.join("b.csv"), text.replace("[ms]", "[s]")).expect("written");
    let said = sentence(&["lab", "init", "b.csv"]);
    assert!(said.contains("Zeit [s]") && said.contains("in ms they are 50"), "{said}");
    assert!(said.trim_end().lines().count() == 1, "{said}");
    assert!(!folder.0.join("b.map.toml").exists() && !folder.0.join("b.model.toml").exists());
    assert!(folder.krait(&["lab", "init", "a.csv", "--force", "--json"]).status.success());
    let missing = ["lab", "diagnose", "--model", "a.model.toml", "--data", "b.csv", "--map-file", "a.map.toml"];
    let said = sentence(&missing);
    assert!(said.contains("\"Zeit [ms]\"") && said.contains("missing") && said.contains("Zeit [s]"), "{said}");
}
