//! Measurements from CSV files: what is accepted in which unit, and every kind of file that is refused, with its sentence.

use krait_lab::Measurements;
use krait_lab::read::{ColumnMap, Expected, Mapping, ReadError, read};
use krait_model::model_file::ModelFile;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::PathBuf;

/// A file of a test, named by it.
fn file(name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.csv"));
    std::fs::write(&path, text).expect("the test folder can be written");
    path
}

fn snake(name: &str, text: impl AsRef<[u8]>, map: &[&str]) -> Result<Measurements, ReadError> {
    let map: ColumnMap = map.iter().map(|m| m.parse::<Mapping>().expect("well formed")).collect();
    read(&file(name, text), &map, Expected::Snake)
}

fn refused(name: &str, text: impl AsRef<[u8]>, words: &[&str]) {
    let sentence = snake(name, text, &[]).expect_err(name).to_string();
    for word in words.iter().chain(&[name]) {
        assert!(sentence.contains(word), "{name}: expected {word:?} in: {sentence}");
    }
}

/// A run of 3 s at 20 Hz: header, then rows made from the time.
fn run(header: &str, row: impl Fn(f64) -> String) -> String {
    let rows = (0..60).map(|k| row(f64::from(k) * 0.05)).collect::<Vec<_>>();
    format!("{header}\n{}\n", rows.join("\n"))
}

const HEADER: &str = "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad";

fn good(t: f64) -> String {
    format!("{t},{},{},{},{},{}", 1e-3 * t.sin(), -5e-4 * t.sin(), -5e-4 * t.sin(), 0.5 * t.sin(), 0.1 * t.cos())
}

/// The good run with one line, counted from 1, replaced.
fn with_line(number: usize, line: &str) -> String {
    let text = run(HEADER, good);
    let mut lines: Vec<&str> = text.lines().collect();
    lines[number - 1] = line;
    lines.join("\n")
}

#[test]
fn a_plain_file_comes_back_as_it_is() {
    let text = run(HEADER, good);
    let data = snake("plain", &text, &[]).expect("good");
    assert_eq!((data.n_rows(), data.n_inputs, data.n_outputs), (60, 3, 2));
    assert_eq!(data.source, "plain.csv");
    assert_eq!(data.time_s[2], 0.1);
    assert_eq!(data.input(1), [1e-3 * 0.05_f64.sin(), -5e-4 * 0.05_f64.sin(), -5e-4 * 0.05_f64.sin()]);
    assert_eq!(data.output(1), [0.5 * 0.05_f64.sin(), 0.1 * 0.05_f64.cos()]);
    assert!(data.trial.iter().all(|&trial| trial == 0));
}

#[test]
fn the_hash_is_the_one_that_sha256sum_prints() {
    let text = run("time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad", |t| format!("{t:.2},{t:.2}e-4,0,0,{t:.2},0"));
    let data = snake("hash", &text, &[]).expect("good");
    assert_eq!(data.sha256, "f46f71147737b29e6b37d3f59bd2826d3715f9d65947b8aae2b622eb34a2ff2f");
}

#[test]
fn units_are_converted_and_polar_shapes_become_bend_vectors() {
    let header =
        "time_ms,q1_mm,q2_um,q3_m,theta_l_deg,delta_deg,tau1_n,tau2_n,tau3_n,stem_angle_deg,temperature_k,note";
    let text = run(header, |t| format!("{},{t},{},{t}e-3,{},90,1,2,3,45,300,up", t * 1e3, t * 1e3, 90.0 - 10.0 * t));
    let data = snake("units", text, &[]).expect("good");
    let row = 20;
    assert_eq!(data.time_s[row], 1.0);
    for q_m in data.input(row) {
        assert!((q_m - 1e-3).abs() < 1e-15);
    }
    let [x, y] = *data.output(row) else { panic!("two outputs") };
    assert!(x.abs() < 1e-12 && (y - 10.0_f64.to_radians()).abs() < 1e-12, "{x} {y}");
    assert_eq!(data.loads_n.as_ref().map(|l| l[..3].to_vec()), Some(vec![1.0, 2.0, 3.0]));
    assert!((data.stem_angle_rad.as_ref().expect("there")[0] - PI / 4.0).abs() < 1e-15);
    assert!((data.temperature_c.as_ref().expect("there")[0] - 26.85).abs() < 1e-9);
    assert!(data.extra.is_empty(), "notes are no numbers");
}

#[test]
fn columns_of_other_names_are_mapped_with_their_units() {
    let text = run("t,m1,m2,m3,cam.x,cam.y,volts", |t| format!("{t},{t},0,0,{},0,7", 10.0 * t));
    let map = ["time_s=t", "q1_m=m1:mm", "q2_m=m2:mm", "q3_mm=m3", "bend_x_rad=cam.x:deg", "bend_y_rad=cam.y:deg"];
    let data = snake("mapped", &text, &map).expect("good");
    assert!((data.input(20)[0] - 1e-3).abs() < 1e-15);
    assert!((data.output(20)[0] - 10.0_f64.to_radians()).abs() < 1e-12);
    assert_eq!(data.extra, [("volts".to_owned(), vec![7.0; 60])]);
    for (map, word) in [("q1_m=m9", "m9"), ("bend_z_rad=cam.x", "bend_z_rad"), ("q1_m=m1:deg", "cannot have this unit")]
    {
        let sentence = snake("mapped_wrong", &text, &[map]).expect_err(map).to_string();
        assert!(sentence.contains(word), "{sentence}");
    }
}

#[test]
fn a_new_label_begins_a_trial_and_its_time_may_begin_anew() {
    let row = |t: f64| format!("{},{},{}", good(t), if t < 1.5 { "up" } else { "down" }, 1.0 + t);
    let data = snake("trials", run(&format!("{HEADER},trial,weight"), row), &[]).expect("good");
    assert_eq!((data.trial[29], data.trial[30]), (0, 1));
    assert!(data.starts_trial(30) && !data.starts_trial(31));
    assert_eq!(data.sigma.as_ref().map(|s| s[0]), Some(1.0));
    let again = |t: f64| format!("{},{}", good(if t < 1.4999 { t } else { t - 1.5 }), t >= 1.4999);
    assert!(snake("trials_anew", run(&format!("{HEADER},trial"), again), &[]).is_ok());
}

#[test]
fn an_empty_shape_is_history_without_a_measurement() {
    let data = snake("gap", with_line(4, "0.1,0,0,0,,"), &[]).expect("good");
    assert!(!data.is_scored(2) && data.is_scored(1));
    for (k, nothing) in ["nan,NaN", "NA,na", "null,NULL"].into_iter().enumerate() {
        let data = snake(&format!("nothing{k}"), with_line(4, &format!("0.1,0,0,0,{nothing}")), &[]).expect("good");
        assert!(!data.is_scored(2) && data.is_scored(1), "{nothing}");
    }
    let weighted = run(&format!("{HEADER},weight"), |t| format!("{},{}", good(t), if t == 0.0 { 0 } else { 4 }));
    let data = snake("weighted", weighted, &[]).expect("good");
    assert!(!data.is_scored(0) && data.is_scored(1));
    assert_eq!(data.sigma.map(|s| s[1]), Some(0.5));
}

#[test]
fn a_header_that_does_not_fit_is_refused_with_its_column() {
    let nothing = |_| "0,0,0,0,0,0".to_owned();
    let refuse = |name, header: &str, words: &[&str]| refused(name, run(header, nothing), words);
    refuse("no_time", "t,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad", &["time_s is missing", "--map time_s="]);
    refuse("no_q2", "time_s,q1_m,x,q3_m,bend_x_rad,bend_y_rad", &["q2_m is missing"]);
    refuse("no_shape", "time_s,q1_m,q2_m,q3_m,a,b", &["bend_x_rad is missing"]);
    refuse("half_shape", "time_s,q1_m,q2_m,q3_m,bend_x_rad,b", &["bend_y_rad is missing"]);
    refuse("no_unit", "time_s,q1,q2_m,q3_m,bend_x_rad,bend_y_rad", &["line 1", "no unit", "mm"]);
    refuse("furlongs", "time_s,q1_furlong,q2_m,q3_m,bend_x_rad,bend_y_rad", &["line 1", "unknown unit \"furlong\""]);
    refuse("wrong_kind", "time_s,q1_deg,q2_m,q3_m,bend_x_rad,bend_y_rad", &["unknown unit \"deg\""]);
    refuse("same_name", "time_s,q1_m,q1_m,q3_m,bend_x_rad,bend_y_rad", &["columns 2 (\"q1_m\") and 3 (\"q1_m\")"]);
    refuse("same_kind", "time_s,q1_m,q1_mm,q3_m,bend_x_rad,bend_y_rad", &["columns 2 (\"q1_m\") and 3 (\"q1_mm\")"]);
    refuse("joints", "time_s,u1_rad,u2_rad,y1_rad,y2_rad,x", &["joints", "the model is of a snake"]);
    refused("empty", "", &["line 1", "empty"]);
    refused("binary", [0x89, 0xff, 0x00, b'\n', 0xfe], &["UTF-8"]);
    refused("latin", b"time_s,q1_m,q2_m,q3_m,bend_x_rad,caf\xe9\n", &["UTF-8"]);
}

#[test]
fn a_row_that_does_not_fit_is_refused_with_line_and_column() {
    refused("cut", with_line(61, "2.95,0.001,0.0"), &["line 61", "3 columns", "6", "cut short"]);
    refused("nan", with_line(5, "0.15,0,0,nan,0,0"), &["line 5", "q3_m", "\"nan\"", "every row"]);
    refused("half_nan", with_line(5, "0.15,0,0,0,nan,0"), &["line 5", "bend_x_rad", "empty"]);
    refused("none", with_line(5, "0.15,0,0,0,none,0"), &["line 5", "bend_x_rad", "\"none\"", "empty"]);
    refused("inf", with_line(5, "0.15,0,inf,0,0,0"), &["line 5", "q2_m", "\"inf\""]);
    refused("word", with_line(5, "0.15,0,0,0,0,left"), &["line 5", "bend_y_rad", "left"]);
    refused("no_encoder", with_line(5, "0.15,0,,0,0,0"), &["line 5", "q2_m", "every row"]);
    refused("half", with_line(5, "0.15,0,0,0,0.1,"), &["line 5", "bend_y_rad", "empty"]);
    refused("back", with_line(5, "0.05,0,0,0,0,0"), &["line 5", "time_s", "0.05", "before the 0.1", "trial"]);
    refused("twice", with_line(5, "0.1,0,0,0,0,0"), &["line 5", "time_s", "same as the 0.1"]);
    let unset =
        |t: f64| good(t).replacen(&t.to_string(), &if t == 0.0 { t } else { t + 1_763_809_215.0 }.to_string(), 1);
    refused("unset", run(HEADER, unset), &["line 3", "time_s", "years after 0 s", "remove the rows before"]);
    refused("degrees", with_line(5, "0.15,0,0,0,42.5,0"), &["line 5", "bend_x_rad", "42.5", "6.283 rad", "bend_x_deg"]);
    refused("mm", with_line(5, "0.15,0,1.25,0,0,0"), &["line 5", "q2_m", "1.25", "0.1 m", "q2_mm"]);
    refused("huge", with_line(5, "1e999,0,0,0,0,0"), &["line 5", "time_s"]);
    let crlf = |line: &str| with_line(5, line).replace('\n', "\r\n");
    refused("crlf", crlf("0.15,0,0,0,0,left"), &["line 5", "bend_y_rad", "left"]);
    refused("crlf_cut", crlf("0.15,0"), &["line 5", "2 columns"]);
}

#[test]
fn a_file_with_too_little_in_it_is_refused() {
    refused("no_rows", format!("{HEADER}\n"), &["line 1", "no rows"]);
    refused("one_second", run(HEADER, |t| good(t / 3.0)), &["time_s", "0.983 s", "2 s or more"]);
    refused("one_row", format!("{HEADER}\n{}\n", good(0.0)), &["time_s", "0.000 s"]);
    let pose = |t: f64| format!("{t},0.001,0.002,0.003,{},0", 0.01 * t.sin());
    refused("one_pose", run(HEADER, pose), &["lines 2 to 61", "q1_m, q2_m, q3_m", "one single pose", "reversals"]);
    let stuck = |t: f64| format!("{t},{},0,0,0.3,0.1", 1e-3 * t.sin());
    refused("stuck", run(HEADER, stuck), &["nothing ever changes in columns bend_x_rad, bend_y_rad", "sensor"]);
    let blind = |t: f64| format!("{t},{},0,0,,", 1e-3 * t.sin());
    refused("blind", run(HEADER, blind), &["bend_x_rad, bend_y_rad", "0 rows"]);
    let both = run(&format!("{HEADER},weight,sigma_bend_rad"), |t| format!("{},1,1", good(t)));
    refused("two_sigmas", both, &["weight", "sigma_bend_rad"]);
    let negative = run(&format!("{HEADER},weight"), |t| format!("{},-1", good(t)));
    refused("negative", negative, &["line 2", "weight", "-1"]);
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let sentence =
        |path: PathBuf| read(&path, &ColumnMap::default(), Expected::Snake).expect_err("no file").to_string();
    assert!(sentence(folder.clone()).contains("not a regular file"));
    assert!(sentence(folder.join("nobody.csv")).contains("cannot be read"));
    assert!(sentence("/dev/null".into()).contains("not a regular file"));
}

#[test]
fn joints_are_read_in_the_units_of_their_model() {
    let model = |text: &str| ModelFile::parse(text).expect("a model of joints");
    let rad = model("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n");
    let deg = model("format = 1\n[machine]\nkind = \"joints\"\nn = 2\nu_unit = \"counts\"\ny_unit = \"deg\"\n");
    let in_degrees = run("time_s,u1_deg,u2_deg,y1_deg,y2_deg", |t| {
        let second = if t < 2.0 { "1" } else { "" };
        format!("{t},{},0,{},{second}", 90.0 * t, 45.0 * t)
    });
    let data = |name, text: &str, model: &ModelFile| {
        let expected = Expected::from(model.machine());
        read(&file(name, text), &ColumnMap::default(), expected)
    };
    let read_rad = data("joints_rad", &in_degrees, &rad).expect("good");
    assert!((read_rad.input(20)[0] - FRAC_PI_2).abs() < 1e-12);
    assert!(read_rad.is_scored(20) && !read_rad.is_scored(50), "a row counts where every joint was measured");
    let sentence = data("joints_counts", &in_degrees, &deg).expect_err("degrees are no counts").to_string();
    assert!(sentence.contains("u1_deg") && sentence.contains("counts"), "{sentence}");
    let in_counts = in_degrees.replace("u1_deg,u2_deg", "u1_counts,u2_counts");
    assert_eq!(data("joints_deg", &in_counts, &deg).expect("good").output(20)[0], 45.0);
    let three = in_degrees.replace("y2_deg", "y2_deg,u3_deg,y3_deg");
    let sentence = data("joints_three", &three, &rad).expect_err("three joints").to_string();
    assert!(sentence.contains("3 joints") && sentence.contains("2 joints"), "{sentence}");
    let sentence = data("joints_snake", &run(HEADER, good), &rad).expect_err("a snake").to_string();
    assert!(sentence.contains("snake") && sentence.contains("joints"), "{sentence}");
}
