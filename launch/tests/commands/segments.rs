//! Models of kind segments from outside: the page's commands, commands that bend segments as wanted, and every refusal.

use crate::page::{Folder, follow};
use krait_model::model_file::ModelFile;
use krait_model::segments::{Bends, LineValues};
use krait_sim::{SegmentTruth, SegmentsTruth, SimulatedSegments};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const TWO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/segments/two.toml");
const SETPOINTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/segments/setpoints.csv");

fn krait(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_krait")).args(args).output().expect("krait starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", text(&output.stderr)))
}

fn path(folder: &Folder, name: &str) -> String {
    folder.0.join(name).to_str().expect("a path of text").to_owned()
}

/// The shipped model with some text exchanged.
fn changed(folder: &Folder, old: &str, new: &str) -> String {
    let model = fs::read_to_string(TWO).expect("the shipped model");
    assert!(model.contains(old), "{old}");
    let own = path(folder, "changed.toml");
    fs::write(&own, model.replacen(old, new, 1)).expect("a model");
    own
}

/// The rows of a table, a list of numbers each, and its first line.
fn table(path: &str) -> (String, Vec<Vec<f64>>) {
    let text = fs::read_to_string(path).expect("a table");
    let (header, rows) = text.split_once('\n').expect("a first line");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    (header.to_owned(), rows.lines().map(row).collect())
}

#[test]
fn the_page_s_commands_print_what_its_text_says() {
    let folder = Folder::new("segments");
    let n_commands = follow("segments.md", &["segments/two.toml", "segments/setpoints.csv"], &folder);
    assert_eq!(n_commands, 3);
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/segments.md")).expect("the page");
    let (header, rows) = table(&path(&folder, "commands.csv"));
    assert!(page.contains(&header), "the page shows the columns: {header}");
    assert_eq!(rows.len(), 81);
}

#[test]
fn the_commands_bend_the_segments_as_wanted_and_their_loads_are_within_the_bounds() {
    let folder = Folder::new("segment-commands");
    let file = ModelFile::parse(&fs::read_to_string(TWO).expect("the shipped model")).expect("a model");
    let mut forward = file.segment_chain().expect("a chain").expect("segments").predictor();
    let out = path(&folder, "commands.csv");
    let done = json(&krait(&["model", "compensate", TWO, "--in", SETPOINTS, "--out", &out, "--json"]));
    assert_eq!((&done["rows"], &done["rows_not_reached"], &done["unit"]), (&81.into(), &0.into(), &"m".into()));
    let (header, rows) = table(&out);
    let columns: Vec<&str> = header.split(',').collect();
    assert_eq!(columns[..5], ["time_s", "bend1_rad", "plane1_rad", "bend2_rad", "plane2_rad"]);
    assert_eq!(
        (columns[5], columns[11], columns[17], columns[23]),
        ("q1_m", "tau1_n", "tau_tilde1_n", "limiting_line")
    );
    let (mut largest_n, mut n_bounded, mut errors_rad) = (0.0_f64, 0, Vec::new());
    for row in &rows {
        let q_tilde_m = LineValues::from_fn(|k, _| if k < 6 { row[5 + k] } else { 0.0 });
        let found = forward.step(&q_tilde_m);
        let (b1, b2) = (row[1], row[3]);
        let wanted = Bends::from_column_slice(&[
            b1 * row[2].cos(),
            b1 * row[2].sin(),
            b2 * row[4].cos(),
            b2 * row[4].sin(),
            0.0,
            0.0,
        ]);
        errors_rad.push((found - wanted).amax());
        for load_n in &row[11..17] {
            assert!((-60.0 - 1e-9..=40.0 + 1e-9).contains(load_n), "{row:?}");
            largest_n = largest_n.max(load_n.abs());
        }
        let is_at_bound = row[11..17].iter().any(|n| (n + 60.0).abs() < 1e-6 || (n - 40.0).abs() < 1e-6);
        assert_eq!(row[23] > 0.0, is_at_bound, "{row:?}");
        n_bounded += usize::from(is_at_bound);
    }
    // From rest and at the turn lines cross their play and friction; the model says 12 mrad at most for each that turns.
    let turned = |idx: usize| (5..=40).contains(&idx) || idx >= 47;
    for (idx, error_rad) in errors_rad.into_iter().enumerate() {
        assert!(error_rad < if turned(idx) { 1e-9 } else { 0.012 }, "row {idx}: {error_rad} rad");
    }
    let said = done["loads"]["largest"]["load_n"].as_f64().expect("a load").abs();
    assert!((said - largest_n).abs() < 1e-9, "{said} {largest_n}");
    assert_eq!(done["loads"]["rows_at_bound"], n_bounded);
    assert!(done["largest_correction"].as_f64().expect("a length") > 5e-4);
}

#[test]
fn the_line_that_limits_is_said_in_each_row_and_at_the_end() {
    let folder = Folder::new("segment-limits");
    let model = changed(&folder, "high_n = 40.0", "high_n = 12.0");
    let out = path(&folder, "commands.csv");
    let done = krait(&["model", "compensate", &model, "--in", SETPOINTS, "--out", &out]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let (_, rows) = table(&out);
    let mut counts = [0; 7];
    rows.iter().for_each(|row| counts[row[23] as usize] += 1);
    let n_bounded = 81 - counts[0];
    let most = (1..7).max_by_key(|&line| counts[line]).expect("a line");
    assert!(n_bounded > 0 && rows.iter().all(|row| row[11..17].iter().all(|n| *n <= 12.0 + 1e-9)), "{counts:?}");
    let said = format!("lines are at their bounds in {n_bounded} rows; the one that limits most often is line {most}");
    assert!(text(&done.stdout).contains(&said), "{said}: {}", text(&done.stdout));
    let checked = text(&krait(&["model", "check", &model]).stdout);
    assert!(checked.contains("is the first at its bound of 12 N"), "{checked}");
}

#[test]
fn tables_that_cannot_be_used_are_refused_in_one_sentence_and_nothing_is_written() {
    let folder = Folder::new("segment-refusals");
    let (setpoints, out) = (path(&folder, "setpoints.csv"), path(&folder, "commands.csv"));
    let narrow = changed(&folder, "high_n = 40.0", "high_n = 1.0");
    let header = "time_s,bend1_deg,plane1_deg,bend2_deg,plane2_deg\n";
    for (model, text_of_table, words) in [
        (TWO, "time_s,bend1_deg,plane1_deg,bend2_deg\n0,0,0,0\n".to_owned(), "column plane2_rad is missing"),
        (
            TWO,
            "time_s,bend1_deg,plane1_deg,bend2_deg,plane2_deg,bend3_deg\n0,0,0,0,0,0\n".to_owned(),
            "there is a column of bend3",
        ),
        (TWO, "time_s,bend_x_deg,bend_y_deg\n0,0,0\n".to_owned(), "column bend1_rad is missing"),
        (TWO, format!("{header}0,0,0,0,0\n0.1,x,0,0,0\n"), "line 3, column bend1_deg: \"x\" is no finite number"),
        (TWO, format!("{header}0,0,0,0,0\n0.1,1,0,nan,0\n"), "line 3, column bend2_deg: \"nan\" is no finite number"),
        (TWO, format!("{header}0,0,0,0,0\n0.1,0,0,1e300,0\n"), "row 2: the bend of segment 2 is larger than"),
        (TWO, format!("{header}0,-300,0,0,0\n"), "row 1: the bend of segment 1 is larger than"),
        (
            TWO,
            format!("{header}0,0,0,0,0\n0.1,0,1e308,1,1e308\n0,0,0,0,0\n"),
            "line 4, column time_s, time 0 s is before the 0.1 s of the row before",
        ),
        (
            narrow.as_str(),
            format!("{header}0,0,0,0,0\n0.1,60,0,0,0\n"),
            "row 2: no loads within low_n and high_n hold these bends: line ",
        ),
    ] {
        fs::write(&setpoints, &text_of_table).expect("a table");
        let ended = krait(&["model", "compensate", model, "--in", &setpoints, "--out", &out]);
        let said = text(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{said}");
        assert!(said.contains(words) && said.trim_end().lines().count() == 1, "{words}: {said}");
        assert!(!Path::new(&out).exists(), "nothing is written");
    }
}

#[test]
fn what_does_not_use_segments_says_so_in_one_sentence_and_what_does() {
    let folder = Folder::new("segment-users");
    let (data, out) = (path(&folder, "data.csv"), path(&folder, "out.toml"));
    fs::write(&data, "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad\n0,0,0,0,0,0\n").expect("a table");
    let no_lab = "the columns q1..q3 are those of a snake, but the model is of kind segments";
    for (args, words) in [
        (vec!["experiment", "fig10", "--engage", "--model", TWO], "is for snakes, and the model is of segments"),
        (vec!["lab", "compare", "--model", TWO, "--data", &data], no_lab),
        (vec!["lab", "diagnose", "--model", TWO, "--data", &data], no_lab),
        (vec!["lab", "add", "backlash", "--model", TWO, "--data", &data, "--out", &out], no_lab),
        (vec!["lab", "fit", "--free", "backlash.half_width_m", "--model", TWO, "--data", &data, "--out", &out], no_lab),
    ] {
        let ended = krait(&args);
        let said = text(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains(words) && said.trim_end().lines().count() == 1, "{args:?}: {said}");
    }
    let checked = krait(&["model", "check", TWO, "--json"]);
    let found = json(&checked);
    assert_eq!(
        (checked.status.code(), &found["machine"], &found["valid"]),
        (Some(0), &"segments".into(), &true.into())
    );
    assert!(found["not_compensable"].is_null() && found["implausible"].is_null(), "{found}");
    assert_eq!(found["segments"][1]["lines"], serde_json::json!([4, 5, 6]));
}

#[test]
fn what_is_shown_is_the_same_model_and_refused_files_name_line_and_key() {
    let folder = Folder::new("segment-show");
    let shown = krait(&["model", "show", TWO]);
    let again = path(&folder, "shown.toml");
    fs::write(&again, &shown.stdout).expect("a model");
    let hash = |file: &str| json(&krait(&["model", "check", file, "--json"]))["hash"].clone();
    assert_eq!(hash(&again), hash(TWO));
    assert!(
        text(&shown.stdout).contains("azimuth_deg = [60.0, 180.0, 300.0]  # deg, -360 to 360"),
        "{}",
        text(&shown.stdout)
    );
    let bad = changed(&folder, "azimuth_deg = [60, 180, 300]", "azimuth_deg = [60, 240]");
    let checked = krait(&["model", "check", &bad]);
    assert_eq!(checked.status.code(), Some(1));
    let said = text(&checked.stdout);
    assert!(said.contains("changed.toml: line 18: segment 2: its 2 lines lie in one plane"), "{said}");
}

/// The shipped model's segments as a simulated machine of its own code.
fn simulated(has_friction: bool) -> SimulatedSegments {
    let segment = |azimuths_deg: [f64; 3]| SegmentTruth {
        azimuths_rad: azimuths_deg.map(f64::to_radians).to_vec(),
        ..SegmentTruth::default()
    };
    let mut truth = SegmentsTruth::ideal(vec![segment([0.0, 120.0, 240.0]), segment([60.0, 180.0, 300.0])]);
    (truth.effects.load_scale, truth.effects.inside) = (1.22, 1.0);
    if has_friction {
        (truth.effects.play_m, truth.effects.mu, truth.effects.f_s_n) = (2.0 * 8.9e-5, 0.1727, 1.959);
    }
    SimulatedSegments::new(&truth).expect("a truth")
}

#[test]
fn simulated_segments_go_where_the_model_says_without_friction_and_with_it_once_the_lines_have_turned() {
    let folder = Folder::new("segment-simulated");
    let text = fs::read_to_string(TWO).expect("the shipped model");
    let without = path(&folder, "without.toml");
    fs::write(&without, text.split("[[effect]]\nkind = \"static").next().expect("the first half")).expect("a model");
    let out = path(&folder, "commands.csv");
    for (model, has_friction) in [(without.as_str(), false), (TWO, true)] {
        let done = krait(&["model", "compensate", model, "--in", SETPOINTS, "--out", &out, "--force"]);
        assert_eq!(done.status.code(), Some(0), "{}", text_of(&done));
        let mut machine = simulated(has_friction);
        for (idx, row) in table(&out).1.iter().enumerate() {
            machine.move_to(&row[5..11]);
            let turned = !has_friction || (5..=40).contains(&idx) || idx >= 47;
            for (segment, pair) in row[1..5].chunks(2).enumerate() {
                let [x, y] = machine.bend_rad(segment);
                let error_rad = (x - pair[0] * pair[1].cos()).hypot(y - pair[0] * pair[1].sin());
                assert!(error_rad < if turned { 1e-6 } else { 0.02 }, "row {idx}, segment {segment}: {error_rad} rad");
            }
            if turned {
                for (k, load_n) in machine.loads_n().enumerate() {
                    assert!((load_n - row[11 + k]).abs() < 1e-4, "row {idx}, line {k}: {load_n} N, {} N", row[11 + k]);
                }
            }
        }
        assert_eq!(machine.n_unsolved(), 0);
    }
    // Nothing of this is small: what the model corrects is most of the motion.
    let mut machine = simulated(true);
    let (_, rows) = table(&out);
    let file = ModelFile::parse(&text).expect("a model");
    let chain = file.segment_chain().expect("a chain").expect("segments");
    let top = &rows[40];
    let mut bends = Bends::zeros();
    (bends[0], bends[3]) = (top[1], top[3]);
    machine.move_to(&chain.machine().q_m(&bends).as_slice()[..6]);
    let [x, _] = machine.bend_rad(0);
    assert!(x < 0.8 * top[1], "uncompensated, {x} of {} rad", top[1]);
}

fn text_of(output: &Output) -> String {
    text(&output.stderr)
}

#[test]
fn generated_segments_are_recognised_diagnosed_guessed_and_refused_where_nothing_can_be_made() {
    let folder = Folder::new("segments-lab");
    let [data, report, truth] = ["two.csv", "why.html", "truth.toml"].map(|name| path(&folder, name));
    let generate = ["lab", "generate", "--segments", "2", "--seconds", "60", "--rate", "25", "--seed", "9"];
    let made = krait(&[&generate[..], &["--kind", "backlash-2", "--truth", &truth, "--out", &data]].concat());
    assert!(made.status.success(), "{}", text(&made.stderr));
    let again = krait(&[&generate[..], &["--kind", "stiffness", "--force", "--out", &path(&folder, "b.csv")]].concat());
    assert!(again.status.success(), "{}", text(&again.stderr));
    let base = fs::read_to_string(path(&folder, "base.toml")).expect("a model");
    assert!(!base.contains("[[effect]]"), "an effect of all is hidden in elastic lines: {base}");
    let refused = krait(&[&generate[..], &["--kind", "cone-2", "--out", &path(&folder, "c.csv")]].concat());
    assert!(text(&refused.stderr).contains("base.toml"), "another base model is not overwritten: {refused:?}");
    assert!(fs::read_to_string(&truth).expect("a truth").contains("[segment.effects]"));

    // The proposal of `init` has these lines; with the effects that the machine is known to have it is the model again.
    let found = json(&krait(&["lab", "init", &data, "--json"]));
    assert_eq!(found["kind"], "segments", "{found}");
    let model = path(&folder, "two.model.toml");
    let known = fs::read_to_string(TWO).expect("a model").split_once("[[effect]]").expect("effects").1.to_owned();
    let proposed = fs::read_to_string(&model).expect("a proposal");
    fs::write(&model, format!("{proposed}\n[[effect]]{known}")).expect("a model");
    let map = path(&folder, "two.map.toml");
    let args = ["lab", "diagnose", "--model", &model, "--data", &data, "--map-file", &map, "--report", &report];
    let said = text(&krait(&args).stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    let words = "Here: of the lines of segment 2 alone, beside what all have.";
    assert!(said.contains("backlash-2") && said.contains(words), "{said}");
    assert!(fs::read_to_string(&report).expect("a page").contains(words));

    let check = |guess: &str| krait(&["lab", "check", "--data", &data, "--guess", guess, "--json"]);
    assert_eq!(json(&check("backlash-2"))["judgement"], "right");
    assert_eq!(json(&check("backlash-1"))["judgement"], "wrong");
    for (args, words) in [
        (&["--kind", "backlash-3"][..], "did you mean backlash-"),
        (&["--kind", "camera-scale-1", "--truth", "t.toml"], "which is of the picture alone"),
        (&["--segments", "4"], "4 is not in 2..=3"),
        (&["--perturb", "0.05"], "cannot be used with"),
    ] {
        let out = path(&folder, "refused.csv");
        let own = if args[0] == "--segments" { &generate[..2] } else { &generate[..] };
        let refused = krait(&[own, args, &["--out", &out]].concat());
        assert!(!refused.status.success() && text(&refused.stderr).contains(words), "{args:?}: {refused:?}");
        assert!(!Path::new(&out).exists(), "{args:?}");
    }
    let listed = text(&krait(&["lab", "generate", "--segments", "3", "--list"]).stdout);
    assert!(listed.contains("backlash-3") && listed.contains("x_push") && !listed.contains("lead-screw"), "{listed}");
}
