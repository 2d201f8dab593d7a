//! `krait model compensate`: a table of setpoints becomes the commands that the model's inverse asks for.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Ended, TempFolder, krait_json};

const PATIENCE: Duration = Duration::from_secs(60);
const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");

/// The numbers of a table, row by row, and its first line.
fn table(path: &str) -> (String, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).expect("a table");
    let (header, rows) = text.split_once('\n').expect("a first line");
    let row = |line: &str| line.split(',').map(|cell| cell.parse().expect("a number")).collect();
    (header.to_owned(), rows.lines().map(row).collect())
}

#[test]
fn a_snakes_and_a_wrists_setpoints_become_their_commands() {
    let folder = TempFolder::new("model-compensate");
    let (setpoints, out) = (folder.file("setpoints.csv"), folder.file("commands.csv"));
    // There and back: where the line turns, play and friction turn with it.
    let rows = (0..=200).map(|k| (f64::from(k) * 0.01, 40.0 * (f64::from(k) * core::f64::consts::PI / 200.0).sin()));
    let text: String = rows.map(|(t, deg)| format!("{t},{deg},0\n")).collect();
    std::fs::write(&setpoints, format!("time_s,bend_x_deg,bend_y_deg\n{text}")).expect("written");
    for (model, corrects) in [("off", false), ("naive", true), ("estimated", true)] {
        let done = krait_json(&["model", "compensate", model, "--json", "--in", &setpoints, "--out", &out, "--force"]);
        assert_eq!((&done["rows"], &done["rows_not_reached"]), (&201.into(), &0.into()), "{done}");
        let correction_m = done["largest_correction"].as_f64().expect("a length");
        assert_eq!(correction_m > 1e-4, corrects, "{model}: {done}");
        let (header, rows) = table(&out);
        assert_eq!(header, "time_s,bend_x_rad,bend_y_rad,q1_m,q2_m,q3_m");
        let top = &rows[100];
        assert!((top[1] - 40f64.to_radians()).abs() < 1e-12, "degrees become radians");
        // Line 1 lies in the plane of the bend and is pulled by r times the bend; the correction is on top of it.
        let plain_m = -1.684e-3 * top[1];
        assert!((top[3] - plain_m).abs() <= correction_m + 1e-12 && top[3] <= plain_m + 1e-12, "{model}: {top:?}");
    }

    // The same in the dialect of a spreadsheet of another country.
    std::fs::write(&setpoints, "\u{feff}Zeit [ms];X;Y\r\n0;40,0;0\r\n10;39,5;0\r\n").expect("written");
    let names = ["--map", "time_s=Zeit [ms]:ms", "--map", "bend_x_rad=X:deg", "--map", "bend_y_rad=Y:deg"];
    let asked = ["model", "compensate", "naive", "--json", "--in", &setpoints, "--out", &out, "--force"];
    assert_eq!(krait_json(&[&asked[..], &names].concat())["rows"], 2);
    let (_, rows) = table(&out);
    assert_eq!((rows[1][0], rows[1][1]), (0.01, 39.5_f64.to_radians()));

    let still: String = (0..50).map(|k| format!("{},0.1,0.0,-0.1\n", f64::from(k) * 0.01)).collect();
    std::fs::write(&setpoints, format!("time_s,y1_rad,y2_rad,y3_rad\n{still}")).expect("written");
    let done = krait_json(&["model", "compensate", WRIST, "--json", "--in", &setpoints, "--out", &out, "--force"]);
    assert_eq!((&done["rows"], &done["unit"]), (&50.into(), &"rad".into()), "{done}");
    let (header, rows) = table(&out);
    assert_eq!(header, "time_s,y1_rad,y2_rad,y3_rad,u1_rad,u2_rad,u3_rad");
    let without_play = (0.1 - 0.02) / 0.8884;
    assert!((rows[49][4] - without_play).abs() < 0.051, "{:?}", rows[49]);
}

#[test]
fn tables_that_cannot_be_used_are_refused_in_one_sentence_and_nothing_is_written() {
    let folder = TempFolder::new("model-compensate-bad");
    let (setpoints, out) = (folder.file("setpoints.csv"), folder.file("commands.csv"));
    let header = "time_s,bend_x_rad,bend_y_rad\n";
    for (text, words) in [
        (String::new(), "the file is empty"),
        (header.to_owned(), "there are no rows"),
        ("time_s,bend_x_rad\n0,0\n".to_owned(), "column bend_y_rad is missing"),
        (format!("{header}0,0,0\n0.1,x,0\n"), "line 3, column bend_x_rad: \"x\" is no finite number"),
        (format!("{header}0,0,0\n0.1,NaN,0\n"), "line 3, column bend_x_rad: \"NaN\" is no finite number"),
        (format!("{header}0,0,0\n0,0,0\n"), "line 3, column time_s, time 0 s is the same as the 0 s"),
        ("time_s,bend_x_rad,bend_x_deg,bend_y_rad\n0,0,0,0\n".to_owned(), "both give bend_x_rad"),
        (format!("{header}0,0,0\n0.1,9,0\n"), "row 2: the bend is larger than"),
    ] {
        std::fs::write(&setpoints, &text).expect("written");
        let ended = Ended::of(&["model", "compensate", "naive", "--in", &setpoints, "--out", &out], PATIENCE);
        assert_eq!(ended.code, Some(2), "{text:?}: {}", ended.stderr);
        assert!(ended.sentence().contains(words), "{text:?}: {}", ended.sentence());
        assert!(!std::path::Path::new(&out).exists(), "nothing is written");
    }
    std::fs::write(&setpoints, format!("{header}0,0,0\n")).expect("written");
    let asked = ["model", "compensate", "naive", "--in", &setpoints, "--out", &setpoints, "--force"];
    let ended = Ended::of(&asked, PATIENCE);
    assert!(ended.code == Some(2) && ended.sentence().contains("named as --in and as --out"), "{}", ended.stderr);
    assert_eq!(std::fs::read_to_string(&setpoints).expect("there"), format!("{header}0,0,0\n"));
}
