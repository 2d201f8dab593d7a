//! A camera that comes ahead of the encoders, or that was mounted anew, or lines whose columns are exchanged: the diagnosis says so, and the
//! commands that it prints reach what it promises.

use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Output};

fn krait(words: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_krait")).args(words.split_whitespace()).output().unwrap()
}

fn error_deg(words: &str) -> f64 {
    let output = krait(words);
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    answer["error_deg"]["rms"].as_f64().unwrap_or_else(|| panic!("{words}: {answer}"))
}

/// The error that an answer in words promises with the effects that it found, deg.
fn promised_deg(said: &str) -> f64 {
    let words: Vec<&str> = said.split_whitespace().collect();
    let own = words.windows(5).find(|own| own[1..] == ["deg", "with", "the", "effects;"]);
    own.unwrap_or_else(|| panic!("{said}"))[0].parse().unwrap()
}

/// The words behind `krait` of the command that an answer ends with.
fn next_command(said: &str) -> &str {
    said.lines().find_map(|line| line.strip_prefix("Next: krait ")).unwrap_or_else(|| panic!("{said}"))
}

/// Rows of a table with the measurements that it has so many rows later.
fn with_measurements_of_later(text: &str, n_rows: usize) -> String {
    let (header, rows) = text.split_once('\n').unwrap();
    let of_bend: Vec<bool> = header.split(',').map(|name| name.starts_with("bend_")).collect();
    assert_eq!(of_bend.iter().filter(|own| **own).count(), 2, "{header}");
    let rows: Vec<Vec<&str>> = rows.lines().map(|line| line.split(',').collect()).collect();
    let later = rows[n_rows..].iter().zip(&rows).map(|(later, row)| {
        let cell = |k: usize| if of_bend[k] { later[k] } else { row[k] };
        (0..row.len()).map(cell).collect::<Vec<_>>().join(",")
    });
    [header.to_owned()].into_iter().chain(later).map(|line| line + "\n").collect()
}

#[test]
fn commands_after_a_camera_ahead_reach_what_the_diagnosis_promised() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("clock-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    let (data, model) = (path("data.csv"), path("base.toml"));
    let made = krait(&format!("lab generate --kind softening --size 3 --seconds 80 --seed 31 --out {data}"));
    assert!(made.status.success(), "{made:?}");
    let text = std::fs::read_to_string(&data).unwrap();
    std::fs::write(&data, with_measurements_of_later(&text, 3)).unwrap();

    let files = format!("--model {model} --data {data}");
    let said = String::from_utf8(krait(&format!("lab diagnose {files} --max-effects 1")).stdout).unwrap();
    assert!(said.contains("ahead of the motion"), "{said}");
    let (promised, next) = (promised_deg(&said), next_command(&said));
    let (_, clock) = next.split_once("--clock ").unwrap_or_else(|| panic!("{next}"));
    let shift_s: f64 = clock.split(' ').next().unwrap().parse().unwrap();
    assert!(next.starts_with("lab add ") && (shift_s - 0.06).abs() < 0.006, "three rows of 20 ms: {next}");
    let added = krait(next);
    assert!(added.status.success(), "{}", String::from_utf8_lossy(&added.stderr));
    let better = next.rsplit(' ').next().unwrap();
    let clock = format!("--clock {shift_s}");
    let left = error_deg(&format!("lab compare --model {better} --data {data} {clock} --json"));
    assert!(left < 1.02 * promised, "{left} deg, promised {promised}");
    let without = error_deg(&format!("lab compare --model {better} --data {data} --json"));
    assert!(without > 1.3 * left, "{without} deg by the wrong clock, {left} by the right one");

    for (clock, why) in [
        ("--clock soon", "expected seconds"),
        ("--clock 0.1 --clock 0.2", "2 are given for 1 recordings"),
        ("--camera-offset left", "expected how much larger"),
        ("--camera-offset 0 --camera-offset 1,0", "2 are given for 1 recordings"),
        ("--camera-offset 1,0,0", "3 angles are given for a snake with 2 bends"),
    ] {
        let refused = krait(&format!("lab compare {files} {clock}"));
        assert_eq!(refused.status.code(), Some(2), "{clock}");
        assert!(String::from_utf8_lossy(&refused.stderr).contains(why), "{refused:?}");
    }
}

/// Two recordings of one snake, by halves of one table, of which the second's bends in x are seen larger by 0.8 degrees.
#[test]
fn commands_after_a_camera_mounted_anew_reach_what_the_diagnosis_promised() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("camera-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    let (whole, model, halves) = (path("whole.csv"), path("base.toml"), [path("first.csv"), path("second.csv")]);
    let made = krait(&format!("lab generate --kind stiffness --size 3 --seconds 80 --seed 31 --out {whole}"));
    assert!(made.status.success(), "{made:?}");
    let text = std::fs::read_to_string(&whole).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let x = header.split(',').position(|name| name == "bend_x_rad").unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let mounted_anew = |row: &str| {
        let cell = |(k, cell): (usize, &str)| match k == x {
            true => (cell.parse::<f64>().unwrap() + 0.8_f64.to_radians()).to_string(),
            false => cell.to_owned(),
        };
        row.split(',').enumerate().map(cell).collect::<Vec<_>>().join(",")
    };
    let (first, second) = rows.split_at(rows.len() / 2);
    let second: Vec<String> = second.iter().map(|row| mounted_anew(row)).collect();
    std::fs::write(&halves[0], format!("{header}\n{}\n", first.join("\n"))).unwrap();
    std::fs::write(&halves[1], format!("{header}\n{}\n", second.join("\n"))).unwrap();

    let files = format!("--model {model} --data {} --data {}", halves[0], halves[1]);
    let said = String::from_utf8(krait(&format!("lab diagnose {files} --max-effects 1")).stdout).unwrap();
    let words: Vec<&str> = said.split_whitespace().collect();
    assert!(words.join(" ").contains("the camera stood otherwise than in"), "{said}");
    let (promised, next) = (promised_deg(&said), next_command(&said));
    let (_, words) = next.split_once("--camera-offset ").unwrap_or_else(|| panic!("{next}"));
    let second = words.split_once("--camera-offset ").unwrap().1.split(' ').next().unwrap();
    assert!(words.starts_with("0 "), "{next}");
    let offset_deg: f64 = second.split(',').next().unwrap().parse().unwrap();
    assert!((offset_deg - 0.8).abs() < 0.1, "{next}");
    let added = krait(next);
    assert!(added.status.success(), "{}", String::from_utf8_lossy(&added.stderr));
    let better = next.rsplit(' ').next().unwrap();
    let data = format!("--model {better} --data {} --data {}", halves[0], halves[1]);
    let left = error_deg(&format!("lab compare {data} --camera-offset 0 --camera-offset {second} --json"));
    assert!(left < 1.02 * promised, "{left} deg, promised {promised}");
    let without = error_deg(&format!("lab compare {data} --json"));
    assert!(without > 1.2 * left, "{without} deg by one camera, {left} by its own");
}

#[test]
fn exchanged_lines_of_a_snake_are_followed_by_the_diagnosis_that_maps_them() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("lines-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    let (data, model) = (path("data.csv"), path("base.toml"));
    let made = krait(&format!("lab generate --kind stiffness --size 3 --seconds 60 --seed 32 --out {data}"));
    assert!(made.status.success(), "{made:?}");
    let text = std::fs::read_to_string(&data).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let header = header.replace("q1_m", "once").replace("q3_m", "q1_m").replace("once", "q3_m");
    std::fs::write(&data, format!("{header}\n{rows}")).unwrap();

    let files = format!("--model {model} --data {data}");
    let said = String::from_utf8(krait(&format!("lab diagnose {files} --max-effects 1")).stdout).unwrap();
    assert!(said.contains("q1 and q3 are probably exchanged"), "{said}");
    let next = said.lines().find_map(|line| line.strip_prefix("Next: with the columns in order: krait "));
    let next = next.unwrap_or_else(|| panic!("{said}"));
    assert!(next.contains("--map q1_m=q3_m --map q3_m=q1_m"), "{next}");
    let again = String::from_utf8(krait(&format!("{next} --max-effects 1")).stdout).unwrap();
    assert!(next_command(&again).starts_with("lab add stiffness"), "{again}");
    std::fs::remove_dir_all(folder).unwrap();
}
