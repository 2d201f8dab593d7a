//! `krait lab init` on a real machine's log in another program's dialect: from the file to the first answer by the printed command.

use serde_json::Value;
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

/// Pages and motions are written anew without `--force`, in the place of an earlier one and of nothing else.
#[test]
fn a_page_or_a_motion_takes_no_other_files_place() {
    let folder = Folder::new("places");
    fs::write(folder.0.join("a.csv"), foreign_jaw()).expect("written");
    let same = folder.krait(&["lab", "init", "a.csv", "--map-out", "x.toml", "--model-out", "./x.toml"]);
    assert!(same.status.code() == Some(2) && !folder.0.join("x.toml").exists());
    assert!(folder.krait(&["lab", "init", "a.csv"]).status.success());
    let asked = ["--model", "a.model.toml", "--data", "a.csv", "--map-file", "a.map.toml"];
    fs::write(folder.0.join("mine.html"), "<!DOCTYPE html>\n<html>mine").expect("written");
    for (verb, option, place) in [
        ("compare", "--report", "a.csv"),
        ("compare", "--report", "mine.html"),
        ("diagnose", "--report", "mine.html"),
        ("diagnose", "--experiment", "a.csv"),
        ("diagnose", "--experiment", "a.map.toml"),
    ] {
        let before = fs::read(folder.0.join(place)).expect("there");
        let ended = folder.krait(&[&["lab", verb][..], &asked, &[option, place]].concat());
        let said = String::from_utf8(ended.stderr).expect("text");
        assert!(
            ended.status.code() == Some(2) && said.contains(place) && said.trim_end().lines().count() == 1,
            "{said}"
        );
        assert_eq!(fs::read(folder.0.join(place)).expect("there"), before, "{verb} {option} {place}");
    }
    // Its own page it writes again.
    for _ in 0..2 {
        assert!(folder.krait(&[&["lab", "compare"][..], &asked, &["--report", "page.html"]].concat()).status.success());
    }
}

/// A program that opens what it takes for its own format could not read it; whatever is written, it is refused before any work.
#[test]
fn no_command_writes_under_a_name_that_promises_another_format() {
    let folder = Folder::new("ending");
    let files = ["--model", "none.toml", "--data", "none.csv"];
    for (words, own) in [
        (&[&["lab", "add", "backlash"][..], &files].concat()[..], "toml"),
        (&[&["lab", "fit"][..], &files].concat(), "toml"),
        (&["lab", "generate", "--kind", "backlash"], "csv"),
        (&["lab", "quiz"], "csv"),
        (&["model", "save-learnt", "none.mcap"], "toml"),
        (&["model", "compensate", "none.toml", "--in", "none.csv"], "csv"),
        (&["recover", "none.mcap"], "mcap"),
        (&["calibrate", "photo", "none.csv"], "csv"),
        (&[&["calibrate", "stem"][..], &files].concat(), "toml"),
        (&["export", "none.mcap"], "csv"),
    ] {
        let ended = folder.krait(&[words, &["--out", "x.xlsx"][..]].concat());
        let said = String::from_utf8(ended.stderr).expect("text");
        assert_eq!(ended.status.code(), Some(2), "{words:?}: {said}");
        let expected = format!("x.xlsx ends in .xlsx, and what would be written is .{own}; name a .{own} file");
        assert!(said.contains(&expected) && said.trim_end().lines().count() == 1, "{words:?}: {said}");
    }
    assert!(!folder.0.join("x.xlsx").exists());
}

/// A joint that turns 1.03 times as far as told from an offset on, with the camera ahead by some rows: 40 s at 50 Hz.
fn joint(unit: &str, offset: f64, n_ahead: usize) -> String {
    let mut text = format!("time_s,u1_{unit},y1_{unit}\n");
    let mut seed = 9_u64;
    let mut noise = || {
        // A sum of uniform numbers is near enough to normal.
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..12).map(|_| uniform()).sum::<f64>()
    };
    let at = |row: usize| {
        let t = row as f64 * 0.02;
        20.0 * (0.9 * t).sin() + 9.0 * (2.3 * t + 1.0).sin() + 4.0 * (4.1 * t).sin()
    };
    let per_unit = if unit == "rad" { 1_f64.to_radians() } else { 1.0 };
    for row in 0..2000 {
        let y = 1.03 * at(row + n_ahead) + offset + 0.05 * noise();
        text += &format!("{:.2},{:.7},{:.7}\n", row as f64 * 0.02, per_unit * at(row), per_unit * y);
    }
    text
}

/// The same joint with a slow drive (0.2 s) and behind it a play of 1.5 deg each way, which begins at one end.
fn slow_and_loose() -> String {
    let exact = joint("deg", 0.0, 0);
    let mut text = String::new();
    let (mut slow, mut last, mut loose) = (f64::NAN, 0.0, 0.0);
    for (row, line) in exact.lines().enumerate() {
        if row == 0 {
            text += "time_s,u1_deg,y1_deg\n";
            continue;
        }
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        let (u, noise) = (cells[1], cells[2] - 1.03 * cells[1]);
        if slow.is_nan() {
            (slow, last, loose) = (u, u, u + 1.5);
        }
        for step in 0..20 {
            let position = last + (u - last) * (f64::from(step) + 0.5) / 20.0;
            slow += (position - slow) * 0.02 / 20.0 / 0.2;
        }
        last = u;
        loose = loose.clamp(slow - 1.5, slow + 1.5);
        text += &format!("{:.2},{u:.7},{:.7}\n", cells[0], 1.03 * loose + 2.0 + noise);
    }
    text
}

/// What a text says behind this word at the beginning of a line.
fn commands(text: &str, word: &str) -> Vec<Vec<String>> {
    let lines = text.lines().filter_map(|line| line.strip_prefix(word)?.strip_prefix("krait "));
    lines.map(|line| line.split(' ').map(str::to_owned).collect()).collect()
}

#[test]
fn printed_commands_followed_one_by_one_end_with_nothing_missing() {
    let folder = Folder::new("next");
    fs::write(folder.0.join("d.csv"), slow_and_loose()).expect("written");
    fs::write(folder.0.join("m.toml"), joint_model("deg", "")).expect("written");
    // A name that is taken is not proposed.
    fs::write(folder.0.join("m.better.toml"), "mine").expect("written");
    let run = |words: &[String]| {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let ended = folder.krait(&words);
        assert!(ended.status.success(), "{words:?}: {}", String::from_utf8_lossy(&ended.stderr));
        String::from_utf8(ended.stdout).expect("text")
    };
    let first = ["lab", "diagnose", "--model", "m.toml", "--data", "d.csv"].map(str::to_owned);
    let said = run(&first);
    assert!(said.lines().filter(|line| !line.contains("krait ")).all(|line| line.chars().count() <= 80), "{said}");
    let mut additions = commands(&said, "Next: ");
    additions.extend(commands(&said, "then: "));
    assert_eq!(additions.len(), 2, "{said}");
    let added: Vec<String> = additions.iter().map(|words| run(words)).collect();
    let last = commands(&added[1], "Next: ");
    assert!(last.len() == 1 && last[0].contains(&"m.better3.toml".to_owned()), "{}", added[1]);
    let again = run(&last[0]);
    assert!(again.starts_with("Nothing is missing"), "{again}");
    let fit = commands(&again, "Next: ");
    assert!(run(&fit[0]).contains("machine.gain1"), "{fit:?}");
    assert_eq!(fs::read_to_string(folder.0.join("m.better.toml")).expect("there"), "mine");
}

/// A linkage that turns a fifth further beyond 6 deg is no effect of the library: its formula is proposed, added as printed, and enough.
#[test]
fn what_no_effect_makes_is_proposed_as_a_formula_that_can_be_added() {
    let folder = Folder::new("formula");
    let straight = joint("deg", 2.0, 0);
    let kinked = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        format!("{},{},{:.7}\n", cells[0], cells[1], cells[2] + 0.2 * (cells[1] - 6.0).max(0.0))
    };
    let rows: String = straight.lines().skip(1).map(kinked).collect();
    fs::write(folder.0.join("d.csv"), format!("time_s,u1_deg,y1_deg\n{rows}")).expect("written");
    fs::write(folder.0.join("m.toml"), joint_model("deg", "")).expect("written");
    let ended = folder.krait(&["lab", "diagnose", "--model", "m.toml", "--data", "d.csv", "--json"]);
    let found: Value = serde_json::from_slice(&ended.stdout).expect("JSON");
    assert_eq!(found["verdict"], "unknown", "{}", found["sentence"]);
    let first = &found["proposals"][0];
    assert!(first["term"].as_str().is_some_and(|term| term.starts_with("max(u_i - ")), "{first}");
    assert!(first["share"].as_f64().is_some_and(|share| share > 0.9), "{first}");
    let ended = folder.krait(&["lab", "diagnose", "--model", "m.toml", "--data", "d.csv"]);
    let said = String::from_utf8(ended.stdout).expect("text");
    let next = said.lines().find_map(|line| line.strip_prefix("Next: krait ")).expect("a command");
    assert!(next.starts_with("lab add formula --name rest --hook joint --formula '"), "{next}");
    // The formula is the one quoted part with blanks.
    let parts: Vec<&str> = next.split('\'').collect();
    let mut words: Vec<&str> = parts[0].split_whitespace().collect();
    words.push(parts[1]);
    words.extend(parts[2].split_whitespace());
    let ended = folder.krait(&words);
    assert!(ended.status.success(), "{words:?}: {}", String::from_utf8_lossy(&ended.stderr));
    let ended = folder.krait(&["lab", "compare", "--model", "m.better.toml", "--data", "d.csv", "--json"]);
    let compared: Value = serde_json::from_slice(&ended.stdout).expect("JSON");
    let rms = compared["error"]["rms"].as_f64().expect("a number");
    assert!(rms < 0.1 && found["base_heldout_rms"].as_f64().is_some_and(|before| before > 4.0 * rms), "{rms} deg");
}

#[test]
fn an_effect_on_a_joint_that_there_is_not_is_refused() {
    let folder = Folder::new("seventh");
    fs::write(folder.0.join("d.csv"), joint("deg", 2.0, 0)).expect("written");
    fs::write(folder.0.join("m.toml"), joint_model("deg", "")).expect("written");
    for (set, expected) in [("joint=7", "expected 0 to 1"), ("joint=0.5", "a whole one")] {
        let words = ["lab", "add", "backlash", "--set", set, "--model", "m.toml", "--data", "d.csv", "--out", "o.toml"];
        let ended = folder.krait(&words);
        let said = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code() == Some(2) && said.contains(set) && said.contains(expected), "{said}");
        assert!(!folder.0.join("o.toml").exists());
    }
}

fn joint_model(unit: &str, numbers: &str) -> String {
    format!("format = 1\n[machine]\nkind = \"joints\"\nn = 1\nu_unit = \"{unit}\"\ny_unit = \"{unit}\"\n{numbers}")
}

#[test]
fn gain_and_offset_that_are_fitted_by_name_or_left_free_stand_in_the_file_and_the_error_stays_down() {
    for (unit, per_deg) in [("deg", 1.0), ("rad", 1_f64.to_radians())] {
        let folder = Folder::new(&format!("numbers-{unit}"));
        fs::write(folder.0.join("d.csv"), joint(unit, 2.0, 0)).expect("written");
        let asked = ["--free", "machine.gain1", "--free", "machine.offset1"];
        for (numbers, more) in
            [("gain = [-0.9]\noffset = [1.0]\n", &asked[..]), ("gain = \"free\"\noffset = \"free\"\n", &[])]
        {
            fs::write(folder.0.join("m.toml"), joint_model(unit, numbers)).expect("written");
            let words = ["lab", "fit", "--model", "m.toml", "--data", "d.csv", "--out", "o.toml", "--force"];
            let ended = folder.krait(&[&words[..], more].concat());
            assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
            let told = String::from_utf8(ended.stdout).expect("text");
            assert!(told.contains("machine.gain1") && told.contains("machine.offset1"), "{told}");
            let text = fs::read_to_string(folder.0.join("o.toml")).expect("a model");
            let file = krait_model::model_file::ModelFile::parse(&text).expect("a model");
            let krait_model::model_file::Machine::Joints(joints) = file.machine() else { panic!("{text}") };
            let offset_deg = joints.offset[0] / per_deg;
            assert!((joints.gain[0][0] - 1.03).abs() < 1e-3 && (offset_deg - 2.0).abs() < 0.02, "{text}");
            let compared = folder.krait(&["lab", "compare", "--model", "o.toml", "--data", "d.csv", "--json"]);
            let answer: serde_json::Value = serde_json::from_slice(&compared.stdout).expect("JSON");
            let rms = answer["error"]["rms"].as_f64().expect("an error");
            assert!(rms < 0.06, "{answer}");
        }
        // What a file leaves out stays out where nobody asked for it.
        fs::write(folder.0.join("m.toml"), joint_model(unit, "")).expect("written");
        let words = ["lab", "fit", "--model", "m.toml", "--data", "d.csv", "--out", "o.toml", "--force"];
        let ended = folder.krait(&[&words[..], &asked[..2]].concat());
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        let text = fs::read_to_string(folder.0.join("o.toml")).expect("a model");
        assert!(text.contains("\ngain") && !text.contains("\noffset"), "{text}");
    }
}

#[test]
fn a_camera_that_runs_ahead_is_calibration_and_nothing_is_missing() {
    let folder = Folder::new("ahead");
    fs::write(folder.0.join("d.csv"), joint("deg", 2.0, 6)).expect("written");
    fs::write(folder.0.join("m.toml"), joint_model("deg", "")).expect("written");
    let ended = folder.krait(&["lab", "diagnose", "--model", "m.toml", "--data", "d.csv", "--json"]);
    let answer: serde_json::Value = serde_json::from_slice(&ended.stdout).expect("JSON");
    assert_eq!((answer["verdict"].as_str(), &answer["effects"]), (Some("none"), &serde_json::json!([])), "{answer}");
    let delays = answer["calibration"].as_array().expect("numbers").iter().filter(|own| own["name"] == "delay");
    let delays: Vec<f64> = delays.filter_map(|own| own["value"].as_f64()).collect();
    assert!(delays.len() == 1 && (delays[0] + 0.12).abs() < 0.005, "{delays:?}");
}

#[test]
fn one_recording_does_not_count_twice() {
    let folder = Folder::new("twice");
    for name in ["a.csv", "b.csv"] {
        fs::write(folder.0.join(name), joint("deg", 2.0, 0)).expect("written");
    }
    fs::write(folder.0.join("m.toml"), joint_model("deg", "")).expect("written");
    let ended = folder.krait(&["lab", "compare", "--model", "m.toml", "--data", "a.csv", "--data", "b.csv"]);
    let sentence = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(2), "{sentence}");
    assert!(sentence.contains("b.csv: the same bytes as a.csv") && sentence.lines().count() == 1, "{sentence}");
}
