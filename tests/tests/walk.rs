//! From an error that nobody understands to a model that follows the machine: run, diagnose, add, run again, learn.
//!
//! Every run goes through the chain's own processes, in the simulated snake's time, so that a busy machine disturbs nothing.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use krait_tests::{Riddle, hand, krait_json};
use std::fs;

/// Camera noise: sqrt(2) times 0.3 degrees.
const NOISE_DEG: f64 = 0.4243;

/// Runs a model on a snake: tracking error, degrees. What it sent and learnt comes out again.
fn run_deg(riddle: &Riddle, truth: &str, model: &str, recording: &str) -> f64 {
    let [truth, model, recording] = [truth, model, recording].map(|name| riddle.file(name));
    let hand = hand(&riddle.folder);
    let options = ["--speed", "max", "--truth", &truth, "--model", &model, "--recording", &recording];
    let figures = krait_json(&[&["replay", "--json", &*hand][..], &options].concat());
    assert_eq!((&figures["samples"]["lost"], &figures["commands_refused"]), (&0.into(), &0.into()), "{figures}");
    let verified = krait_json(&["verify", "--json", &recording]);
    assert!(
        verified["first_difference"].is_null() && verified["updates_identical"].as_u64() > Some(1000),
        "{verified}"
    );
    figures["tracking_error_deg"]["rms"].as_f64().expect("a figure")
}

/// A file of the riddle with some words put for others; each must be there.
fn rewritten(riddle: &Riddle, from: &str, to: &str, change: impl Fn(&str) -> Option<String>) {
    let text = fs::read_to_string(riddle.file(from)).expect("a file");
    let mut n_changed = 0;
    let lines = text.lines().map(|line| change(line).inspect(|_| n_changed += 1).unwrap_or_else(|| line.to_owned()));
    let text = lines.collect::<Vec<_>>().join("\n");
    assert!(n_changed > 0, "nothing to change in {from}:\n{text}");
    fs::write(riddle.file(to), text).expect("written");
}

#[test]
fn an_error_is_diagnosed_in_a_run_and_a_model_that_learns_follows_the_machine_when_it_changes() {
    let riddle = Riddle::new("stiffness", &["--size", "4", "--seed", "20060501", "--seconds", "140"]);
    let before_deg = run_deg(&riddle, "truth.toml", "base.toml", "base.mcap");
    assert!(before_deg > 2.0 * NOISE_DEG, "the hidden effect shows: {before_deg} deg");

    let recording = riddle.file("base.mcap");
    let diagnosis =
        krait_json(&["lab", "diagnose", "--json", "--model", &riddle.file("base.toml"), "--data", &recording]);
    let first = &diagnosis["effects"][0]["effect"];
    assert!(riddle.is_right(0, first), "{first} is none of {}", riddle.answer["right"]);
    let (named, base, better) = (first.as_str().expect("a name"), riddle.file("base.toml"), riddle.file("better.toml"));
    krait_json(&["lab", "add", named, "--json", "--model", &base, "--data", &recording, "--out", &better]);
    let added_deg = run_deg(&riddle, "truth.toml", "better.toml", "better.mcap");
    assert!(added_deg < 1.1 * NOISE_DEG, "{added_deg} deg is left beside the camera's noise");

    // In the middle of the next run the snake becomes stiffer by 20 % of what it was.
    let truth = fs::read_to_string(riddle.file("truth.toml")).expect("a truth");
    let stiffness = truth.lines().find_map(|line| line.strip_prefix("load_scale = ")?.parse::<f64>().ok());
    let moved = 0.2 * stiffness.expect("a factor");
    rewritten(&riddle, "truth.toml", "moved.toml", |line| match line.split_once(" = ")?.0 {
        "change_stiffness" => Some(format!("change_stiffness = {moved}")),
        "change_time_s" => Some("change_time_s = 15.0".to_owned()),
        _ => None,
    });
    rewritten(&riddle, "better.toml", "learning.toml", |line| {
        let value = line.strip_prefix("eta = { value = ")?.split(',').next()?;
        Some(format!("eta = {{ value = {value}, learn = {{ sd = 0.2, memory_s = 60.0 }} }}"))
    });
    let fixed_deg = run_deg(&riddle, "moved.toml", "better.toml", "fixed.mcap");
    let learning_deg = run_deg(&riddle, "moved.toml", "learning.toml", "learning.mcap");
    println!(
        "base {before_deg:.3}, added {added_deg:.3}; moved by 20 %: fixed {fixed_deg:.3}, learning {learning_deg:.3} deg"
    );
    assert!(fixed_deg > 2.0 * NOISE_DEG, "without learning the change shows: {fixed_deg} deg");
    // The time in which it learns counts too.
    assert!(learning_deg < 1.2 * NOISE_DEG && learning_deg < 0.5 * fixed_deg, "{learning_deg} deg with learning");
}
