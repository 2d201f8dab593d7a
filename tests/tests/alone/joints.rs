//! Joints through the real processes: the same scripted motion with and without compensation, figures in the joints' own
//! unit, and every recorded step repeated byte for byte.

use super::{PATIENCE, alone, scripted};
use core::time::Duration;
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name, wait_until};
use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

const WRIST: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml");
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv");
const OFF: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 3\ngain = [1.0, 1.0, 1.0]\noffset = [0.0, 0.0, 0.0]\n";

/// Runs the script with a model and gives the figures of the pass.
fn run(model: &str, recording: &str, seconds: &str, more: &[&str]) -> Value {
    scripted(SCRIPT, recording, &[&["--seconds", seconds, "--model", model], more].concat())
}

fn verified(recording: &str) -> Value {
    let ended = Ended::of(&["verify", recording, "--json"], PATIENCE);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    ended.json()
}

#[test]
fn a_wrist_follows_better_with_its_model_and_its_recording_verifies() {
    let folder = TempFolder::new("joints");
    let off = folder.file("off.toml");
    std::fs::write(&off, OFF).expect("a file");
    let (without, with) = (folder.file("off.mcap"), folder.file("wrist.mcap"));
    let rms = |figures: &Value| {
        let pass = &figures["passes"][0];
        assert_eq!((pass["joints"]["unit"].as_str(), pass["peak_bend_deg"].is_null()), (Some("deg"), true), "{pass}");
        assert_eq!(pass["joints"]["joints"].as_array().map(Vec::len), Some(3), "{pass}");
        pass["joints"]["error"]["rms"].as_f64().unwrap_or_else(|| panic!("no error in {pass}"))
    };
    let wrist_deg = rms(&run(WRIST, &with, "13", &[]));
    // The same hand through the same processes, in the simulated joints' time.
    let score_deg = |figures: Value| figures["joints"]["error"]["rms"].as_f64().expect("more than 10 s of motion");
    let off_deg = score_deg(replayed(&with, &without, &["--model", &off]));
    assert!(wrist_deg < 0.25 * off_deg, "{wrist_deg} deg with the model, {off_deg} deg without");
    let verdict = verified(&with);
    assert!(
        verdict["first_difference"].is_null() && verdict["commands_identical"].as_u64() > Some(10_000),
        "{verdict}"
    );
    in_the_lab(&folder, &off, &without);
    // Played again, the wrist does as well, and twice the same.
    let (one, two) = (folder.file("one.mcap"), folder.file("two.mcap"));
    let again_deg = score_deg(replayed(&with, &one, &[]));
    assert!(again_deg < 0.25 * off_deg, "{again_deg} deg when played again, {off_deg} deg without the model");
    assert_eq!(replayed(&with, &two, &[])["samples"]["lost"], 0);
    let alike = compared(&one, &two);
    assert!(alike["apart"]["command_mm"]["max"] == 0.0 && alike["apart"]["setpoint_joints"]["max"] == 0.0, "{alike}");
    let apart = compared(&without, &with);
    let side = |letter: &str| apart[letter]["joints"]["error"]["rms"].as_f64().unwrap_or_else(|| panic!("{apart}"));
    assert!((side("a") - off_deg).abs() < 1e-9 && (side("b") - wrist_deg).abs() < 1e-9, "run and compare say the same");
}

/// What the chain has recorded without a model of its own tells the lab what is missing: play in each joint. Its export is the
/// same measurements.
fn in_the_lab(folder: &TempFolder, model: &str, recording: &str) {
    let table = folder.file("off.csv");
    let exported = Ended::of(&["export", recording, "--out", &table], PATIENCE);
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let header = std::fs::read_to_string(&table).expect("written").lines().next().map(str::to_owned);
    assert!(header.is_some_and(|header| header.starts_with("time_s,u1_rad,u2_rad,u3_rad,y1_rad,y2_rad,y3_rad")));
    let rms = |data: &str| {
        let compared = Ended::of(&["lab", "compare", "--model", model, "--data", data, "--json"], PATIENCE);
        assert_eq!(compared.code, Some(0), "{compared:?}");
        compared.json()["as_given_rms"].as_f64()
    };
    let (recorded, exported) = (rms(recording).expect("a figure"), rms(&table).expect("a figure"));
    assert!((recorded - exported).abs() < 1e-9 * recorded, "{recorded} of the recording, {exported} of the table");
    let bare = folder.file("bare.toml");
    std::fs::write(&bare, "format = 1\n[machine]\nkind = \"joints\"\nn = 3\n").expect("a file");
    let found = Ended::of(&["lab", "diagnose", "--model", &bare, "--data", recording, "--json"], PATIENCE);
    assert_eq!(found.code, Some(0), "{found:?}");
    let effects = found.json()["effects"].as_array().cloned().unwrap_or_default();
    let play = ["backlash", "bouc-wen", "prandtl-ishlinskii"];
    let has_play = |joint: u64| {
        effects
            .iter()
            .any(|own| own["joint"] == joint && own["effect"].as_str().is_some_and(|name| play.contains(&name)))
    };
    assert!((1..=3).all(has_play), "{effects:?}");
}

#[test]
#[ignore = "a chain for half a minute; .ci/run runs it"]
fn a_wrist_with_a_wrong_play_learns_it_and_keeps_it() {
    let folder = TempFolder::new("learning");
    let (model, recording, kept) = (folder.file("wrong.toml"), folder.file("learning.mcap"), folder.file("kept.toml"));
    let text = std::fs::read_to_string(WRIST).expect("the shipped model");
    let wrong =
        text.replace("half_width = 0.05", "half_width = { value = 0.02, learn = { sd = 0.02, memory_s = 600.0 } }");
    std::fs::write(&model, wrong).expect("a file");
    let figures = run(&model, &recording, "13", &[]);
    let learnt = &figures["passes"][0]["learnt"][0];
    assert_eq!(learnt["name"], "backlash.half_width", "{figures}");
    let value = learnt["value"].as_f64().expect("a value");
    assert!((value - 0.05).abs() < 0.005, "the simulated joints have 0.05 rad: {learnt}");
    let verdict = verified(&recording);
    assert!(verdict["first_difference"].is_null() && verdict["updates_identical"].as_u64() > Some(500), "{verdict}");
    let ended = Ended::of(&["model", "save-learnt", &recording, "--json", "--out", &kept], PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let saved = ended.json();
    let unexplained = |k: usize| saved["unexplained"][k].as_f64().expect("a figure");
    assert!(saved["unexplained_unit"] == "deg" && unexplained(1) < 0.5 * unexplained(0), "{saved}");
    let text = std::fs::read_to_string(&kept).expect("a model file");
    assert!(text.contains(&format!("half_width = {{ value = {value}")), "{text}");
}

#[test]
fn a_wrist_follows_a_trajectory_through_its_rows_and_can_be_sent_it_again() {
    let folder = TempFolder::new("path");
    let (table, recording, instance) = (folder.file("path.csv"), folder.file("path.mcap"), instance_name("path"));
    std::fs::write(&table, "time_s,q1_deg,q2_deg,q3_deg\n0,5,0,0\n1,20,-10,5\n2,0,0,10\n").expect("written");
    let play = |table: &str| {
        let on = ["replay", table, "--speed", "max", "--json", "--instance", &instance, "--model", WRIST];
        Ended::of(&[&on[..], &["--recording", &recording]].concat(), PATIENCE)
    };
    let played = play(&table);
    assert_eq!(played.code, Some(0), "{played:?}");
    assert_eq!(played.json()["samples"]["recorded"], 2001);
    // How near a sample comes to the middle row, rad: the setpoints to nothing, the measured joints to the play's remainder.
    let row = [20f64, -10.0, 5.0].map(f64::to_radians);
    let beside = |joints: &[f64]| joints.iter().zip(row).map(|(joint, row)| (joint - row).abs()).fold(0.0, f64::max);
    let mut nearest = [f64::MAX; 2];
    for message in Recording::open(Path::new(&recording)).expect("a recording").samples().expect("samples") {
        match message.expect("readable").sample {
            Sample::Setpoint(setpoint) => nearest[0] = nearest[0].min(beside(&setpoint.joints_rad)),
            Sample::Shape(shape) => nearest[1] = nearest[1].min(beside(&shape.joints_rad)),
            _ => {}
        }
    }
    assert!(nearest[0] < 1e-9 && nearest[1] < 2f64.to_radians(), "{nearest:?} rad");
    let verdict = verified(&recording);
    assert!(verdict["first_difference"].is_null() && verdict["commands_identical"].as_u64() > Some(2000), "{verdict}");
    std::fs::write(&table, "time_s,q1_deg,q2_deg,q3_deg\n0,0,0,0\n1,60,0,0\n").expect("written");
    let refused = play(&table);
    let sentence = "line 3, column 2: expected joint 1 from -0.8 to 0.8 rad, found 1.04720 rad";
    assert!(refused.code == Some(2) && refused.stderr.contains(sentence), "{refused:?}");
}

#[test]
#[ignore = "a chain for half a minute; .ci/run runs it"]
fn eight_sliding_joints_are_driven_in_mm_and_verify() {
    let folder = TempFolder::new("slides");
    let file = |name: &str, text: String| {
        std::fs::write(folder.path().join(name), text).expect("a file");
        folder.file(name)
    };
    let ones = ["1.0"; 8].join(", ");
    let zeros = ["0.0"; 8].join(", ");
    let model = file(
        "slides.toml",
        format!(
            "format = 1\n[machine]\nkind = \"joints\"\nn = 8\nu_unit = \"mm\"\ny_unit = \"mm\"\ngain = [{ones}]\noffset = [{zeros}]\n\
             [[effect]]\nkind = \"backlash\"\nhalf_width = 0.25\n"
        ),
    );
    let row = "[0.1, 0.0, 0.0, 0.0, 0.0, 0.0]";
    let config = file("krait.toml", format!("[joints]\nrates = [{}]\n", [row; 8].join(", ")));
    let truth = file("truth.toml", "[[joint]]\nradius_m = 1.0\nzero_rad = 0.0\n".repeat(8));
    let recording = folder.file("slides.mcap");
    let figures = run(&model, &recording, "5", &["--config", &config, "--truth", &truth]);
    let joints = &figures["passes"][0]["joints"];
    assert_eq!(joints["unit"], "mm", "{joints}");
    assert!(joints["joints"][7]["peak_reached"].as_f64() > Some(1.0), "{joints}");
    let recorded = Recording::open(Path::new(&recording)).expect("a recording");
    let measured = recorded.samples().expect("samples").filter_map(|sample| match sample.expect("a sample").sample {
        Sample::Shape(shape) => shape.valid_joints_rad().map(<[f64]>::len),
        _ => None,
    });
    assert!(measured.filter(|n| *n == 8).count() > 100, "the joints are measured on the shape channel");
    assert!(verified(&recording)["first_difference"].is_null());
    let again = replayed(&recording, &folder.file("again.mcap"), &[]);
    assert!(again["joints"]["unit"] == "mm" && again["samples"]["recorded"].as_u64() > Some(4_000), "{again}");
}

/// Plays a recording as fast as the processes go, into another.
fn replayed(recording: &str, again: &str, more: &[&str]) -> Value {
    let replay = ["replay", recording, "--speed", "max", "--recording", again, "--json"];
    let ended = Ended::of(&[&replay, more].concat(), PATIENCE);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    ended.json()
}

fn compared(a: &str, b: &str) -> Value {
    let ended = Ended::of(&["compare", a, b, "--json"], PATIENCE);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    ended.json()
}

#[test]
#[ignore = "a chain for half a minute; .ci/run runs it"]
fn joints_take_a_better_model_while_they_run() {
    let folder = TempFolder::new("exchanged");
    let (off, recording, second) = (folder.file("off.toml"), folder.file("run.mcap"), folder.file("run-model2.mcap"));
    std::fs::write(&off, OFF).expect("a file");
    let other = folder.file("other.toml");
    std::fs::write(
        &other,
        OFF.replace("n = 3", "n = 2").replace("1.0, 1.0, 1.0", "1.0, 1.0").replace("0.0, 0.0, 0.0", "0.0, 0.0"),
    )
    .expect("a file");
    let instance = instance_name("exchanged");
    let run = ["run", "--engage=again", "--master", "script", "--input", SCRIPT, "--model", &off];
    let _alone = alone();
    let chain = Krait::start(&[&run[..], &["--instance", &instance, "--recording", &recording]].concat());
    let grown = wait_until(PATIENCE, || std::fs::metadata(&recording).is_ok_and(|file| file.len() > 200_000));
    assert!(grown, "it never moved");
    let exchange = |model: &str| Ended::of(&["model", "exchange", model, "--instance", &instance], PATIENCE);
    let refused = exchange(&other);
    assert!(refused.code != Some(0) && refused.stderr.contains("another machine"), "{refused:?}");
    let taken = exchange(WRIST);
    assert_eq!(taken.code, Some(0), "{taken:?}");
    std::thread::sleep(Duration::from_secs(3));
    chain.signal(Signal::TERM);
    let ended = chain.end(PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let models = |recording: &str| -> BTreeSet<u64> {
        let recorded = Recording::open(Path::new(recording)).expect("a recording");
        let samples = recorded.samples().expect("samples").map(|sample| sample.expect("a sample").sample);
        samples.filter_map(|sample| if let Sample::Command(c) = sample { Some(c.model_hash) } else { None }).collect()
    };
    let (before, after) = (models(&recording), models(&second));
    assert!(before.len() == 1 && after.len() == 1 && before != after, "{before:?} {after:?}");
    for recording in [&recording, &second] {
        assert!(verified(recording)["first_difference"].is_null());
    }
}

#[test]
fn a_joint_follows_the_turning_of_a_scripted_hand() {
    let folder = TempFolder::new("turning");
    let (script, config, recording) = (folder.file("turn.csv"), folder.file("turn.toml"), folder.file("turn.mcap"));
    let head = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,tip_wx_rad_per_s,tip_wy_rad_per_s,tip_wz_rad_per_s";
    std::fs::write(&script, format!("{head}\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0.4\n3,0,0,0,0,0,0.4\n")).expect("written");
    // The third joint alone follows the turn about the view's axis.
    let rates = "rates = [[0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]]";
    std::fs::write(&config, format!("[joints]\n{rates}\n")).expect("written");
    let instance = instance_name("turning");
    let run = ["run", "--engage=again", "--master", "script", "--input", &script, "--config", &config];
    let more = ["--model", WRIST, "--seconds", "3", "--instance", &instance, "--recording", &recording];
    let _alone = alone();
    let ended = Ended::of(&[&run[..], &more[..]].concat(), PATIENCE);
    assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
    let mut furthest = [0.0_f64; 3];
    for recorded in Recording::open(Path::new(&recording)).expect("readable").samples().expect("samples") {
        if let Sample::Setpoint(setpoint) = recorded.expect("readable").sample {
            for (furthest, joint) in furthest.iter_mut().zip(setpoint.joints_rad) {
                *furthest = furthest.max(joint.abs());
            }
        }
    }
    assert!(furthest[2] > 0.3, "the third joint turns: {furthest:?}");
    // They stay where the drives' zero has them.
    assert!(furthest[0] < 0.03 && furthest[1] < 0.03, "nothing else does: {furthest:?}");
}
