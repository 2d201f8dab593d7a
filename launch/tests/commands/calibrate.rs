//! `krait calibrate`: the paper's Table II typed into the dialogue gives a model file, and what is missing is said.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("calibrate-{name}-{}", std::process::id()));
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn calibrate(folder: &Path, arguments: &[&str], typed: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_krait"))
        .arg("calibrate")
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A command that refuses at once does not read its input.
    let _refused = child.stdin.take().unwrap().write_all(typed.as_bytes());
    child.wait_with_output().unwrap()
}

const TABLE_II: [(u32, u32); 10] = [
    (0, 255),
    (100, 420),
    (200, 525),
    (300, 630),
    (400, 750),
    (500, 850),
    (700, 1150),
    (1000, 1500),
    (1500, 2150),
    (1800, 2600),
];

#[test]
fn table_ii_becomes_a_model_file() {
    let folder = folder("table-ii");
    let mut typed: String = TABLE_II.iter().map(|(w, scale)| format!("1\n{w}\nup\n{scale}\n")).collect();
    typed += "1\n\ny\n";
    let ended = calibrate(&folder, &["friction", "--csv", "friction.csv", "--model", "robot.toml"], &typed);
    let said = String::from_utf8(ended.stdout).unwrap();
    assert_eq!(ended.status.code(), Some(0), "{said}");
    let expected = "mu 0.1727 +- 0.0091, f_s 1.921 +- 0.130 N, correlation -0.83, chi2 11.7/8";
    assert!(said.contains(expected), "{said}");
    let text = std::fs::read_to_string(folder.join("robot.toml")).unwrap();
    let file = krait_model::model_file::ModelFile::parse(&text).unwrap();
    let names: Vec<&str> = file.effects().iter().map(|e| e.setting().kind().name()).collect();
    assert_eq!(names, ["static-friction", "cone-friction"], "the order of the chain");
    let origin = file.effects()[1].origin("mu").unwrap();
    assert_eq!(origin.from.as_deref(), Some("friction.csv"));
    assert!(origin.date.as_deref().is_some_and(|day| day.len() == 10), "{origin:?}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn poses_without_friction_say_what_comes_first() {
    let folder = folder("order");
    let ended = calibrate(&folder, &["poses", "--csv", "poses.csv", "--model", "none.toml"], "");
    let sentence = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{sentence}");
    assert!(sentence.contains("krait calibrate friction") && sentence.lines().count() == 1, "{sentence}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn nothing_is_written_without_a_yes() {
    let folder = folder("no");
    let mut typed: String = TABLE_II.iter().map(|(w, scale)| format!("1\n{w}\nup\n{scale}\n")).collect();
    typed += "1\n\n\n";
    let ended = calibrate(&folder, &["friction", "--csv", "friction.csv", "--model", "robot.toml"], &typed);
    assert_eq!(ended.status.code(), Some(1));
    assert!(!folder.join("robot.toml").exists() && folder.join("friction.csv").exists());
    std::fs::remove_dir_all(folder).unwrap();
}

const POSE_MODEL: &str = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"static-friction\"\nf_s_n = 1.9\n\
                          [[effect]]\nkind = \"cone-friction\"\nmu = 0.17\n";

#[test]
fn effects_that_poses_do_not_compute_are_refused_by_name() {
    let folder = folder("effect");
    let text = format!("{POSE_MODEL}[[effect]]\nkind = \"actuator-compliance\"\n");
    std::fs::write(folder.join("robot.toml"), text).unwrap();
    let ended = calibrate(&folder, &["poses", "--csv", "poses.csv", "--model", "robot.toml"], "");
    let sentence = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{sentence}");
    assert!(sentence.contains("actuator-compliance") && sentence.lines().count() == 1, "{sentence}");
    assert!(!folder.join("poses.csv").exists());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn poses_take_friction_along_the_cone_and_extension_inside_from_the_model() {
    let folder = folder("spread");
    let text = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"static-friction\"\nf_s_n = 1.9\n[[effect]]\nkind = \"distributed-capstan\"\nmu = 0.16\n[[effect]]\nkind = \"inside-extension\"\n";
    std::fs::write(folder.join("robot.toml"), text).unwrap();
    let ended = calibrate(&folder, &["poses", "--csv", "poses.csv", "--model", "robot.toml"], "q\n");
    let said = String::from_utf8(ended.stdout).unwrap();
    let sentence = "with mu 0.1600 along the cone, f_s 1.900 N and extension inside the snake (share 1) of robot.toml";
    assert!(said.contains(sentence), "{said}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn friction_along_the_cone_gets_its_mu() {
    let folder = folder("along");
    let text = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"distributed-capstan\"\n";
    std::fs::write(folder.join("robot.toml"), text).unwrap();
    let mut typed: String = TABLE_II.iter().map(|(w, scale)| format!("1\n{w}\nup\n{scale}\n")).collect();
    typed += "1\n\ny\n";
    let ended = calibrate(&folder, &["friction", "--csv", "friction.csv", "--model", "robot.toml"], &typed);
    assert_eq!(ended.status.code(), Some(0), "{}", String::from_utf8_lossy(&ended.stderr));
    let text = std::fs::read_to_string(folder.join("robot.toml")).unwrap();
    let file = krait_model::model_file::ModelFile::parse(&text).unwrap();
    let names: Vec<&str> = file.effects().iter().map(|e| e.setting().kind().name()).collect();
    assert_eq!(names, ["static-friction", "distributed-capstan"], "the order of the chain");
    let mu = file.effects()[1].setting().value("mu").unwrap();
    assert!((mu - 0.1727).abs() < 1e-4, "{mu}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_error_that_is_no_number_is_refused_as_an_option_and_as_a_row() {
    let folder = folder("sd");
    for sd in ["nan", "-5", "0"] {
        let option = format!("--scale-sd-g={sd}");
        let ended = calibrate(&folder, &["friction", "--csv", "f.csv", "--model", "m.toml", &option], "1\n0\n");
        let sentence = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(2), "{sentence}");
        assert!(sentence.contains("scale_sd_g") && sentence.lines().count() == 1, "{sentence}");
        assert!(!folder.join("f.csv").exists());
    }
    let rows = "line,weight_g,direction,scale_g,weight_sd_g,scale_sd_g,note\n1,0,up,255,1,25,\n1,100,up,420,1,NaN,\n";
    std::fs::write(folder.join("f.csv"), rows).unwrap();
    let ended = calibrate(&folder, &["friction", "--csv", "f.csv", "--model", "m.toml"], "");
    let sentence = String::from_utf8(ended.stderr).unwrap();
    assert!(sentence.contains("row 3") && sentence.contains("scale_sd_g"), "{sentence}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_motion_by_hand_cannot_be_left_out_and_quitting_there_fits_what_was_read() {
    let folder = folder("motion");
    std::fs::write(folder.join("robot.toml"), POSE_MODEL).unwrap();
    let ended = calibrate(&folder, &["poses", "--csv", "poses.csv", "--model", "robot.toml"], "s\n\nq\n");
    let said = String::from_utf8(ended.stdout).unwrap();
    let n_motions = said.matches("move the actuators to").count();
    assert!(said.contains("a motion cannot be left out") && n_motions == 3, "{said}");
    let sentence = String::from_utf8(ended.stderr).unwrap();
    assert!(sentence.contains("not determined"), "{sentence}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn bends_of_pictures_are_not_overwritten_and_poses_wait_for_them() {
    let folder = folder("bends");
    std::fs::write(folder.join("bends.csv"), "mine").unwrap();
    std::fs::write(folder.join("clicks.csv"), "image,view,kind,x_mm,z_mm,u_px,v_px\n").unwrap();
    let ended = calibrate(&folder, &["photo", "clicks.csv", "--out", "bends.csv"], "");
    let sentence = String::from_utf8(ended.stderr).unwrap();
    assert!(ended.status.code() == Some(2) && sentence.contains("bends.csv is already there"), "{sentence}");
    let ended = calibrate(&folder, &["photo", "clicks.csv", "--out", "bends.csv", "--force"], "");
    assert!(String::from_utf8(ended.stderr).unwrap().contains("no click"));
    assert_eq!(std::fs::read_to_string(folder.join("bends.csv")).unwrap(), "mine");

    std::fs::write(folder.join("robot.toml"), POSE_MODEL).unwrap();
    let poses = ["poses", "--csv", "poses.csv", "--model", "robot.toml", "--bends", "none.csv"];
    let both = calibrate(&folder, &[&poses[..], &["--sd-deg", "0.5"]].concat(), "");
    assert!(String::from_utf8(both.stderr).unwrap().contains("--sd-deg"), "the table states its own");
    // Two motions to the first pose, its pictures by the name in brackets, one more motion, and the end.
    let ended = calibrate(&folder, &poses, "\n\n\n\n\nq\n");
    let (said, sentence) = (String::from_utf8(ended.stdout).unwrap(), String::from_utf8(ended.stderr).unwrap());
    assert!(said.contains("photograph, name of the pictures? [pose-"), "{said}");
    assert!(
        sentence.contains("nothing is fitted yet: the pictures pose-") && sentence.contains("none.csv"),
        "{sentence}"
    );
    assert!(std::fs::read_to_string(folder.join("poses.csv")).unwrap().lines().count() >= 2);
    std::fs::remove_dir_all(folder).unwrap();
}

const TWO: &str = include_str!("../../../docs/segments/two.toml");

/// The value and the readings that it came from.
fn calibrated(file: &krait_model::model_file::ModelFile, kind: &str, parameter: &str) -> (f64, Option<String>) {
    let effect = file.effects().iter().find(|e| e.setting().kind().name() == kind).unwrap();
    (effect.setting().value(parameter).unwrap(), effect.origin(parameter).and_then(|own| own.from.clone()))
}

/// Answers for the dialogue of play: Enter at every motion, and what a dial shows of an output that follows its encoder with this play.
fn dial_answers(n_lines: usize, play_mm: f64) -> String {
    let mut typed = String::new();
    let mut output_mm = vec![0.0; n_lines];
    for output_mm in &mut output_mm {
        for turn in 1..=10 {
            let direction = if turn % 2 == 0 { 1.0 } else { -1.0 };
            let place_mm = f64::from(turn % 3) - 1.0;
            let mut go = |to_mm: f64| {
                let (low, high) = (to_mm - 0.5 * play_mm, to_mm + 0.5 * play_mm);
                *output_mm = f64::clamp(*output_mm, low, high);
                *output_mm
            };
            go(place_mm + direction);
            go(place_mm);
            typed += "\n\n";
            for travel_mm in [0.0, 0.3, 0.4, 0.5] {
                typed += &format!("\n{:.6}\n", go(place_mm + direction * travel_mm));
            }
        }
    }
    typed
}

#[test]
fn lines_of_segments_get_their_friction_and_play_and_what_one_snake_alone_has_is_refused() {
    let folder = folder("segments");
    std::fs::write(folder.join("two.toml"), TWO).unwrap();
    let mut typed: String = TABLE_II.iter().map(|(w, scale)| format!("5\n{w}\nup\n{scale}\n")).collect();
    typed += "1\n\ny\n";
    let ended = calibrate(&folder, &["friction", "--csv", "friction.csv", "--model", "two.toml"], &typed);
    assert_eq!(ended.status.code(), Some(0), "{}", String::from_utf8_lossy(&ended.stderr));
    let ended =
        calibrate(&folder, &["play", "--csv", "play.csv", "--model", "two.toml"], &(dial_answers(6, 0.16) + "y\n"));
    let said = String::from_utf8_lossy(&ended.stdout).into_owned();
    assert_eq!(ended.status.code(), Some(0), "{said}\n{}", String::from_utf8_lossy(&ended.stderr));
    assert!(said.contains("line 6: half-width 0.0800"), "{said}");
    let text = std::fs::read_to_string(folder.join("two.toml")).unwrap();
    let file = krait_model::model_file::ModelFile::parse(&text).unwrap();
    let (mu, from) = calibrated(&file, "cone-friction", "mu");
    assert!((mu - 0.1727).abs() < 1e-4 && from.as_deref() == Some("friction.csv"), "{mu} {from:?}");
    let (half_width_m, from) = calibrated(&file, "backlash", "half_width_m");
    assert!((half_width_m - 0.08e-3).abs() < 1e-8 && from.as_deref() == Some("play.csv"), "{half_width_m} {from:?}");

    let refused = |arguments: &[&str]| {
        let ended = calibrate(&folder, arguments, "");
        let sentence = String::from_utf8(ended.stderr).unwrap();
        assert!(ended.status.code() == Some(2) && sentence.lines().count() == 1, "{sentence}");
        sentence
    };
    let sentence = refused(&["poses", "--csv", "poses.csv", "--model", "two.toml"]);
    assert!(sentence.contains("of segments") && sentence.contains("krait lab fit"), "{sentence}");
    std::fs::write(folder.join("own.toml"), format!("{TWO}\n[[effect]]\nkind = \"backlash-2\"\n")).unwrap();
    let sentence = refused(&["play", "--csv", "own.csv", "--model", "own.toml"]);
    assert!(sentence.contains("backlash-2") && sentence.contains("no one value"), "{sentence}");
    let joints = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n";
    std::fs::write(folder.join("joints.toml"), joints).unwrap();
    let sentence = refused(&["friction", "--csv", "own.csv", "--model", "joints.toml"]);
    assert!(sentence.contains("kind joints") && !folder.join("own.csv").exists(), "{sentence}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn poses_of_one_camera_say_their_planes_what_the_picture_shows_and_their_price() {
    let folder = folder("front");
    std::fs::write(folder.join("robot.toml"), POSE_MODEL).unwrap();
    std::fs::write(folder.join("truth.toml"), "").unwrap();
    let poses = ["poses", "--csv", "poses.csv", "--model", "robot.toml", "--truth", "truth.toml"];
    let with = |words: &[&str], typed: &str| {
        let ended = calibrate(&folder, &[&poses[..], words].concat(), typed);
        (String::from_utf8(ended.stdout).unwrap(), String::from_utf8(ended.stderr).unwrap())
    };
    let (said, _) = with(&["--front", "60,0,120", "--largest-deg", "60"], "17.2\nq\n");
    for words in [
        "the plan has 60 poses and 6 for the check, bends up to 60 deg, seen from one side in the planes 60, 0, 120 deg",
        "times the standard errors of the full plan",
        "the picture shows the plane 60 deg",
        "bend towards 60 deg in the picture deg?",
        " deg towards 60 deg)",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let table = std::fs::read_to_string(folder.join("poses.csv")).unwrap();
    let row: Vec<&str> = table.lines().nth(1).unwrap().split(',').collect();
    assert_eq!((row[2], row[5]), ("60.0", "NaN"), "{table}");
    let bend_rad: f64 = row[4].parse().unwrap();
    assert!((bend_rad.to_degrees() - 17.2).abs() < 1e-9, "{table}");
    // What was begun goes on with the same planes and the same largest bend only.
    let (_, sentence) = with(&["--front"], "");
    assert!(sentence.contains("another plan") && sentence.contains("--largest-deg"), "{sentence}");
    let (_, sentence) = with(&["--front", "90"], "");
    assert!(sentence.contains("where one line does not move") && sentence.lines().count() == 1, "{sentence}");
    let (_, sentence) = with(&["--largest-deg", "30"], "");
    assert!(sentence.contains("--largest-deg") && sentence.contains("46 to 76 deg"), "{sentence}");
    std::fs::remove_dir_all(folder).unwrap();
}
