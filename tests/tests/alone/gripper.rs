//! A snake with a gripper through the real processes: the jaw follows its buttons while the snake bends, better with its wire's effects,
//! the snake as well as without one; every recorded step repeated byte for byte; replay, comparison, table; refusals in one sentence.

use super::{PATIENCE, alone, done, scripted};
use krait_ipc::message::{GRIPPER_WIRE, SlaveState};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Console, Ended, Krait, PadPage, TempFolder, instance_name};
use rustix::process::Signal;
use serde_json::Value;
use std::path::Path;

const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/gripper/snake.toml");
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/gripper/grasp.csv");
/// What the camera of the simulated snake adds to each angle, deg.
const CAMERA_DEG: f64 = 0.3;

/// Runs the script with a model and gives the figures of the pass.
fn run(model: &str, recording: &str, more: &[&str]) -> Value {
    scripted(SCRIPT, recording, &[&["--seconds", "14", "--model", model], more].concat())["passes"][0].clone()
}

fn jaw_rms_deg(score: &Value) -> f64 {
    assert_eq!((score["unit"].as_str(), score["joints"].as_array().map(Vec::len)), (Some("deg"), Some(1)), "{score}");
    score["error"]["rms"].as_f64().unwrap_or_else(|| panic!("no error of a jaw in {score}"))
}

/// The shipped model, with what of it is behind a word left out.
fn model_until(folder: &TempFolder, word: &str, name: &str) -> String {
    let (text, path) = (std::fs::read_to_string(SHIPPED).expect("shipped"), folder.file(name));
    std::fs::write(&path, text.split_once(word).expect("it has that").0).expect("written");
    path
}

#[test]
fn a_jaw_follows_its_buttons_while_the_snake_bends_better_with_its_effects_and_verifies() {
    let folder = TempFolder::new("gripper");
    let bare = model_until(&folder, "[[gripper.effect]]", "off.toml");
    let none = model_until(&folder, "[gripper]", "none.toml");
    let [off, full, without] = ["off", "full", "without"].map(|name| folder.file(&format!("{name}.mcap")));
    let full_pass = run(SHIPPED, &full, &[]);
    // The same hand through the same processes, in the simulated snake's time.
    let played = |model: &str, again: &str| {
        done(&["replay", &full, "--model", model, "--speed", "max", "--recording", again, "--json"]);
        done(&["compare", again, &full, "--json"])["a"].clone()
    };
    let (off_pass, plain_pass) = (played(&bare, &off), played(&none, &without));
    let (off_deg, full_deg) = (jaw_rms_deg(&off_pass["jaw"]), jaw_rms_deg(&full_pass["jaw"]));
    assert!(plain_pass["jaw"].is_null(), "{plain_pass}");
    assert!(off_deg > 2.0, "an uncompensated jaw misses by {off_deg} deg");
    assert!(full_deg < 0.35 * off_deg, "{full_deg} deg with the wire's effects, {off_deg} deg without");
    assert!(full_deg < 1.5 * CAMERA_DEG, "{full_deg} deg, and the camera alone has {CAMERA_DEG}");
    let jaw = &full_pass["jaw"]["joints"][0];
    assert!(jaw["peak_reached"].as_f64() > Some(30.0), "{jaw}");
    // The snake bends as well with a gripper as without: to the camera's noise.
    let floor_deg = CAMERA_DEG * core::f64::consts::SQRT_2;
    for error in [&full_pass["error_deg"], &off_pass["tracking_error_deg"], &plain_pass["tracking_error_deg"]] {
        let snake_deg = error["rms"].as_f64().expect("an error");
        assert!(snake_deg < 1.2 * floor_deg, "{snake_deg} deg, and the camera alone has {floor_deg}");
    }
    assert!(full_pass["peak_bend_deg"]["reached"].as_f64() > Some(20.0), "{full_pass}");
    for recording in [&off, &full, &without] {
        let verdict = done(&["verify", recording, "--json"]);
        let n = verdict["commands_identical"].as_u64();
        assert!(verdict["first_difference"].is_null() && n > Some(10_000), "{verdict}");
    }
    what_the_messages_hold(&full, &without);
    what_is_made_of_it(&folder, &off, &full);
}

/// Four actuators and a jaw of the one, three and none of the other.
fn what_the_messages_hold(with: &str, without: &str) {
    let newest = |recording: &str| {
        let (mut state, mut shape, mut command) = (None, None, None);
        for sample in Recording::open(Path::new(recording)).expect("a recording").samples().expect("samples") {
            match sample.expect("readable").sample {
                Sample::State(own) if own.flags & SlaveState::FOLLOWING != 0 => state = Some(own),
                Sample::Shape(own) if own.valid_bend_rad().is_some() => shape = Some(own),
                Sample::Command(own) => command = Some(own),
                _ => {}
            }
        }
        (state.expect("states"), shape.expect("shapes"), command.expect("commands"))
    };
    let (state, shape, command) = newest(with);
    assert_eq!((state.n_actuators, command.n_actuators, command.n_joints), (4, 4, 0));
    assert!(shape.valid_jaw_rad().is_some() && state.measured_q_m[GRIPPER_WIRE] != 0.0, "{state:?}");
    let (state, shape, command) = newest(without);
    assert_eq!((state.n_actuators, command.n_actuators, command.joints_rad), (3, 0, [0.0; 8]));
    assert!(shape.valid_jaw_rad().is_none() && shape.joints_rad.iter().all(|own| own.is_nan()), "{shape:?}");
}

fn jaw_setpoints_rad(recording: &str) -> Vec<(i64, f64)> {
    let samples = Recording::open(Path::new(recording)).expect("a recording").samples().expect("samples");
    let jaw = |sample| if let Sample::Setpoint(own) = sample { Some((own.sample_ns, own.jaw_rad()?)) } else { None };
    samples.filter_map(|recorded| jaw(recorded.expect("readable").sample)).collect()
}

/// The script leaves it where it is from 2 s to 4 s.
fn jaw_rad_in_the_third_second(recording: &str) -> f64 {
    let all = jaw_setpoints_rad(recording);
    let from_ns = all.first().expect("setpoints").0 + 3_000_000_000;
    all.iter().find(|(at_ns, _)| *at_ns > from_ns).expect("14 s").1
}

fn last_jaw_rad(recording: &str) -> f64 {
    jaw_setpoints_rad(recording).last().expect("setpoints").1
}

fn what_is_made_of_it(folder: &TempFolder, off: &str, full: &str) {
    let (one, two) = (folder.file("one.mcap"), folder.file("two.mcap"));
    for again in [&one, &two] {
        let played = done(&["replay", full, "--speed", "max", "--recording", again, "--json"]);
        assert_eq!(played["samples"]["lost"], 0, "{played}");
    }
    let alike = done(&["compare", &one, &two, "--json"]);
    assert_eq!(alike["apart"]["command_mm"]["max"], 0.0, "{alike}");
    let full_deg = jaw_rms_deg(&done(&["compare", off, full, "--json"])["b"]["jaw"]);
    let again_deg = jaw_rms_deg(&alike["a"]["jaw"]);
    assert!(again_deg < 1.5 * full_deg, "{again_deg} deg when played again, {full_deg} deg at first");
    let table = folder.file("full.csv");
    let exported = Ended::of(&["export", full, "--out", &table], PATIENCE);
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let text = std::fs::read_to_string(&table).expect("written");
    let header = "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,tau1_n,tau2_n,tau3_n,jaw_wire_m,jaw_wire_n,jaw_rad,trial";
    assert_eq!(text.lines().next(), Some(header));
    let has_jaw = |line: &&str| line.split(',').nth(12).is_some_and(|cell| !cell.is_empty());
    let n_seen = text.lines().skip(1).filter(has_jaw).count();
    assert!(n_seen > 500, "{n_seen} rows with a measured jaw");
    // Played from the middle, it begins with the jaw where it was.
    let middle = folder.file("middle.mcap");
    done(&["replay", full, "--from", "3", "--to", "3.5", "--speed", "max", "--recording", &middle, "--json"]);
    let (was_rad, begins_rad) = (jaw_rad_in_the_third_second(full), last_jaw_rad(&middle));
    assert!(was_rad > 0.5 && (begins_rad - was_rad).abs() < 0.03, "{begins_rad} rad, and it was {was_rad}");
    // The lab reads it like any snake's.
    let compared = Ended::of(&["lab", "compare", "--model", SHIPPED, "--data", full, "--json"], PATIENCE);
    assert_eq!(compared.code, Some(0), "{compared:?}");
    let path = folder.file("path.csv");
    std::fs::write(&path, "time_s,bend_x_deg,bend_y_deg\n0,0,0\n1,10,0\n2,0,0\n").expect("written");
    let played = done(&["replay", &path, "--model", SHIPPED, "--recording", &folder.file("path.mcap"), "--json"]);
    assert_eq!(played["samples"]["lost"], 0, "{played}");
}

/// Something hard between the jaws and a close button that is held: the page and the terminal say that the jaw holds, with its load,
/// and it is no limit of the snake.
#[test]
#[ignore = "a chain for half a minute; .ci/run runs it"]
fn a_jaw_that_holds_something_is_told_as_that_and_limits_nothing_else() {
    let folder = TempFolder::new("gripper-holds");
    let [truth, script] = ["truth.toml", "close.csv"].map(|name| folder.file(name));
    std::fs::write(&truth, "[gripper]\nobject_rad = 0.35\n").expect("written");
    let closes = "2,0,0,0,1,0,-1\n120,0,0,0,1,0,-1\n";
    let head = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch,jaw\n0,0,0,0,1,0,0\n1,0,0,0,1,0,1\n";
    std::fs::write(&script, head.to_owned() + closes).expect("written");
    let _alone = alone();
    let instance = instance_name("gripper");
    let run = ["run", "--engage=again", "--console", "--no-recording", "--instance", &instance, "--model", SHIPPED];
    let more = ["--master", "script", "--input", &script, "--truth", &truth];
    let mut krait = Krait::start(&[&run[..], &more].concat());
    let mut page = PadPage::open(&Console::of(&mut krait));
    let told = |frame: &Value| {
        let mut reasons = frame["reasons"].as_array().into_iter().flatten();
        reasons.find(|reason| reason["words"]["say"] == "The jaw holds as hard as it may.").cloned()
    };
    // What crossed its play on the way there is told for some time.
    let holds = |frame: &Value| told(frame).is_some() && frame["shown"] == "following";
    let frame = page.until("the jaw holds", |_, frame| holds(frame));
    let reason = told(&frame).expect("told");
    assert!(reason["value"].as_str().is_some_and(|value| value.ends_with("of 15 N.")), "{frame}");
    assert_eq!(reason["words"]["level"], "info", "{frame}");
    let watched = Ended::of(&["watch", "--once", "--instance", &instance], PATIENCE);
    assert!(
        watched.stdout.contains("note        The jaw holds as hard as it may. It closes no further"),
        "{watched:?}"
    );
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// A wire with more play and another lever than the model says: the lab reads the jaw as a joint and names the play with its size, which
/// is half the slack and what the friction stretches the wire by.
#[test]
#[ignore = "a chain for half a minute; .ci/run runs it"]
fn what_the_simulated_gripper_hides_the_lab_names_from_a_recording() {
    let folder = TempFolder::new("gripper-hidden");
    let bare = model_until(&folder, "[[gripper.effect]]", "bare.toml");
    let [truth, recording, table] = ["truth.toml", "hidden.mcap", "jaw.csv"].map(|name| folder.file(name));
    let (slack_m, friction_n, wire_n_per_m) = (6e-4, 2.0, 20e3);
    std::fs::write(
        &truth,
        format!(
            "[gripper]\nradius_m = 0.0021\nslack_m = {slack_m}\nfriction_n = {friction_n}\ncable_n_per_m = {wire_n_per_m}\n"
        ),
    )
    .expect("written");
    run(&bare, &recording, &["--truth", &truth]);
    let exported = done(&["export", &recording, "--jaw", "--out", &table, "--json"]);
    assert!(exported["rows_with_shape"].as_u64() > Some(500), "{exported}");
    let initialised = Ended::of(&["lab", "init", &table], PATIENCE);
    assert_eq!(initialised.code, Some(0), "{initialised:?}");
    let found = done(&["lab", "diagnose", "--model", &folder.file("jaw.model.toml"), "--data", &table, "--json"]);
    let (effect, half_m) = (&found["effects"][0], slack_m / 2.0 + friction_n / wire_n_per_m);
    assert_eq!((found["verdict"].as_str(), effect["effect"].as_str()), (Some("missing"), Some("backlash")), "{found}");
    let half_width_m = effect["params"]["half_width"]["value"].as_f64().expect("a size");
    assert!((half_width_m / half_m - 1.0).abs() < 0.02, "{half_width_m} m, and it is {half_m}");
    let gain = found["calibration"][0]["value"].as_f64().expect("a gain");
    assert!((gain * 0.0021 - 1.0).abs() < 0.02, "{gain} rad/m, and it is {}", 1.0 / 0.0021);
    // A snake without a gripper has no jaw to export.
    let without = folder.file("without.mcap");
    let plain = ["run", "--engage=again", "--seconds", "2", "--recording", &without];
    let instance = instance_name("gripper");
    assert!(matches!(Ended::of(&[&plain[..], &["--instance", &instance]].concat(), PATIENCE).code, Some(0 | 1)));
    let refused = Ended::of(&["export", &without, "--jaw", "--out", &folder.file("none.csv")], PATIENCE);
    assert!(refused.code == Some(2) && refused.sentence().contains("holds no jaw"), "{refused:?}");
}

#[test]
fn what_cannot_be_done_with_a_gripper_is_refused_in_one_sentence() {
    let folder = TempFolder::new("gripper-refused");
    let text = std::fs::read_to_string(SHIPPED).expect("shipped");
    let model = |name: &str, from: &str, to: &str| {
        let path = folder.file(name);
        std::fs::write(&path, text.replace(from, to)).expect("written");
        path
    };
    let (wide, odd) =
        (model("wide.toml", "0.002", "0.02"), model("odd.toml", "half_width = 1.5e-4", "half_width = -1"));
    let truth = folder.file("truth.toml");
    std::fs::write(&truth, "[gripper]\nslack_m = 0.5\n").expect("written");
    let drives = folder.file("drives.toml");
    let real =
        "[slave.limits]\npull_n = inf\npush_n = inf\n[slave.drive]\nkind = \"sts3215\"\nport = \"/dev/ttyS77\"\n";
    let actuator = |id| format!("[[slave.drive.actuator]]\nid = {id}\nzero_count = 2048\n");
    std::fs::write(&drives, real.to_owned() + &[1, 2, 3].map(actuator).concat()).expect("written");
    for (arguments, words) in [
        (
            &["run", "--model", wide.as_str(), "--no-recording", "--seconds", "1"][..],
            "its wire goes 20.94 mm from its zero, expected at most [compensate] max_stroke_m = 5.20 mm",
        ),
        (&["run", "--model", &odd, "--no-recording", "--seconds", "1"], "half_width is -1, expected 0"),
        (
            &["run", "--engage", "--model", SHIPPED, "--truth", &truth, "--no-recording", "--seconds", "1"],
            "gripper.slack_m is 0.5, expected 0 to 0.002",
        ),
        (
            &["run", "--model", SHIPPED, "--config", &drives, "--no-recording", "--seconds", "1"],
            "describes 3 actuators, and the machine of the model has 4 with its gripper's wire, the last",
        ),
    ] {
        let instance = instance_name("gripper");
        let ended = Ended::of(&[arguments, &["--instance", &instance]].concat(), PATIENCE);
        assert!(ended.code != Some(0) && ended.stderr.contains(words), "{words}: {ended:?}");
    }
}
