//! `krait model`: what it prints and how it ends, for good files and bad ones.

use std::path::PathBuf;
use std::process::{Command, Output};

fn krait(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_krait")).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A model file in a place of its own.
fn file(name: &str, text: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path
}

const GOOD: &str = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"backlash\"\nhalf_width_m = 1e-4\n";

#[test]
fn a_good_file_is_good_and_shown_with_what_its_keys_mean() {
    let path = file("good.toml", GOOD);
    let path = path.to_str().unwrap();
    let checked = krait(&["model", "check", path]);
    assert_eq!(checked.status.code(), Some(0));
    assert!(text(&checked.stdout).contains("good; snake with backlash"));
    let shown = krait(&["model", "show", path]);
    assert_eq!(shown.status.code(), Some(0));
    assert!(
        text(&shown.stdout).contains("half_width_m = 0.0001  # m, 0.0 to 0.002, default 8.9e-5"),
        "{}",
        text(&shown.stdout)
    );
    let json: serde_json::Value = serde_json::from_slice(&krait(&["model", "check", path, "--json"]).stdout).unwrap();
    assert_eq!(json["effects"][0]["parameters"][0]["value"], 1e-4);
    assert_eq!((json["valid"].as_bool(), json["not_compensable"].is_null()), (Some(true), true));
}

#[test]
fn without_a_file_the_model_of_a_plain_run_is_shown_and_with_a_configuration_its_own() {
    let shown = krait(&["model", "show"]);
    assert_eq!(shown.status.code(), Some(0), "{}", text(&shown.stderr));
    let usual = text(&shown.stdout);
    let (first, rest) = usual.split_once('\n').unwrap();
    assert!(first.starts_with("# estimated: the model that `krait run` takes"), "{first}");
    assert_eq!(rest, text(&krait(&["model", "show", "estimated"]).stdout));
    let again = file("usual.toml", &usual);
    let json = |args: &[&str]| -> serde_json::Value { serde_json::from_slice(&krait(args).stdout).unwrap() };
    let of = |args: &[&str]| json(&[&["model", "show", "--json"], args].concat())["hash"].clone();
    assert_eq!(of(&[]), of(&[again.to_str().unwrap()]), "what is shown is that model");
    assert_eq!(json(&["model", "show", "--json"])["file"], "estimated");

    let naive = file("naive-krait.toml", "compensation = \"naive\"\n");
    assert_eq!(of(&["--config", naive.to_str().unwrap()]), of(&["naive"]));
    let (good, own) = (file("own-good.toml", GOOD), file("own-krait.toml", ""));
    std::fs::write(&own, format!("model = {:?}\n", good.to_str().unwrap())).unwrap();
    assert_eq!(of(&["--config", own.to_str().unwrap()]), of(&[good.to_str().unwrap()]));
}

#[test]
fn what_is_shown_is_a_model_file() {
    let path = file("again.toml", GOOD);
    let shown = krait(&["model", "show", path.to_str().unwrap()]);
    let again = file("shown.toml", &text(&shown.stdout));
    assert_eq!(krait(&["model", "check", again.to_str().unwrap()]).status.code(), Some(0));
}

#[test]
fn a_refused_file_is_a_failure_found_and_names_file_line_and_key() {
    let path = file("bad.toml", &GOOD.replace("half_width_m", "half_with_m"));
    let path = path.to_str().unwrap();
    let checked = krait(&["model", "check", path]);
    assert_eq!(checked.status.code(), Some(1));
    let said = text(&checked.stdout);
    assert!(said.contains("bad.toml: line 6: unknown key `half_with_m`") && said.contains("`half_width_m`"), "{said}");
    let json: serde_json::Value = serde_json::from_slice(&krait(&["model", "check", path, "--json"]).stdout).unwrap();
    assert_eq!(json["valid"], false);
    let shown = krait(&["model", "show", path]);
    assert_eq!(shown.status.code(), Some(2));
    assert!(text(&shown.stderr).contains("bad.toml: line 6"), "{}", text(&shown.stderr));
}

#[test]
fn a_file_that_is_not_there_could_not_be_checked() {
    let checked = krait(&["model", "check", "/nowhere/model.toml"]);
    assert_eq!(checked.status.code(), Some(2));
    assert!(text(&checked.stderr).contains("/nowhere/model.toml"));
}

#[test]
fn the_defaults_of_every_effect_are_documented() {
    let shown = krait(&["model", "show", "--defaults"]);
    assert_eq!(shown.status.code(), Some(0));
    assert!(text(&shown.stdout).contains("kind = \"cross-coupling\"") && text(&shown.stdout).contains("temperature_c"));
}

#[test]
fn a_model_that_cannot_be_compensated_says_why() {
    let path =
        file("stall.toml", &GOOD.replace("backlash", "saturation").replace("half_width_m = 1e-4", "limit_n = 30"));
    let checked = krait(&["model", "check", path.to_str().unwrap()]);
    assert_eq!(checked.status.code(), Some(0));
    assert!(
        text(&checked.stdout).contains("`krait run` cannot use it: effect saturation cannot be compensated"),
        "{}",
        text(&checked.stdout)
    );
}

#[test]
fn a_check_names_the_line_that_is_first_at_the_slaves_limit_of_pull() {
    let check = |config: &str| {
        let config = file("limits.toml", config);
        let args = ["model", "check", "estimated", "--json", "--config", config.to_str().unwrap()];
        let found: serde_json::Value = serde_json::from_slice(&krait(&args).stdout).unwrap();
        found["load_limit"].clone()
    };
    assert!(check("").is_null(), "60 N hold the estimated snake up to 75 deg");
    let weak = check("[slave.limits]\npull_n = 20.0\n");
    let bend_deg = weak["bend_deg"].as_f64().unwrap();
    let load_n = weak["load_n"].as_f64().unwrap();
    assert!((-21.0..-20.0).contains(&load_n) && weak["a_preload_helps"] == true, "{weak}");
    // Half the pull is reached at about half the bend: the elastic load grows nearly in proportion.
    let weaker = check("[slave.limits]\npull_n = 10.0\n");
    let ratio = weaker["bend_deg"].as_f64().unwrap() / bend_deg;
    assert!((0.45..0.55).contains(&ratio), "{weak} {weaker}");
    let neither = check("[slave.limits]\npull_n = 20.0\npush_n = 15.0\n");
    assert!(neither["bend_deg"].as_f64().unwrap() < bend_deg, "{neither}");
}
