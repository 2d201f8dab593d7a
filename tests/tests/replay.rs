//! Recordings and trajectories through the real processes again: byte by byte, at any speed, with another stage, refused.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::message::{Command, Marker, ModelUpdate, OperatorInput, Phase, Setpoint, Shape, SlaveState};
use krait_ipc::{InstanceName, Reason, Reasons, resources_of};
use krait_record::{About, Recording, RecordingWriter};
use krait_schema::Sample;
use krait_tests::{Ended, Krait, TempFolder, instance_name, krait_program, processes_of, rewrite, rewrite_some};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;

const PATIENCE: Duration = Duration::from_secs(240);

fn shipped() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/flick.mcap").display().to_string()
}

/// What a replay must reproduce, channel by channel.
#[derive(Debug, Default)]
struct Channels {
    inputs: Vec<OperatorInput>,
    setpoints: Vec<Setpoint>,
    commands: Vec<Command>,
    states: Vec<SlaveState>,
    shapes: Vec<Shape>,
    updates: Vec<ModelUpdate>,
}

impl Channels {
    /// Every message of every channel is the same; the first that is not is shown.
    fn assert_same(&self, other: &Self, what: &str) {
        fn same<M: core::fmt::Debug>(channel: &str, what: &str, a: &[M], b: &[M]) {
            // As text, because what is not there is NaN, which equals nothing.
            let first = a.iter().zip(b).position(|(a, b)| format!("{a:?}") != format!("{b:?}"));
            assert!(
                first.is_none(),
                "{what}: {channel} {first:?}\n{:?}\n{:?}",
                first.map(|n| &a[n]),
                first.map(|n| &b[n])
            );
            assert_eq!(a.len(), b.len(), "{what}: {channel}");
        }
        same("input", what, &self.inputs, &other.inputs);
        same("setpoint", what, &self.setpoints, &other.setpoints);
        same("command", what, &self.commands, &other.commands);
        same("state", what, &self.states, &other.states);
        same("shape", what, &self.shapes, &other.shapes);
        same("model_update", what, &self.updates, &other.updates);
    }
}

fn read(path: &str) -> Channels {
    let recording = Recording::open(Path::new(path)).expect("readable");
    assert!(recording.contents().missing.is_empty(), "{:?}", recording.contents().missing);
    let mut channels = Channels::default();
    for recorded in recording.samples().expect("samples") {
        match recorded.expect("readable").sample {
            Sample::Input(m) => channels.inputs.push(m),
            Sample::Setpoint(m) => channels.setpoints.push(m),
            Sample::Command(m) => channels.commands.push(m),
            Sample::State(m) => channels.states.push(m),
            Sample::Shape(m) => channels.shapes.push(m),
            Sample::ModelUpdate(m) => channels.updates.push(m),
            _ => {}
        }
    }
    channels
}

/// Runs `krait replay --json` to its good end.
fn replay(arguments: &[&str]) -> Value {
    let instance = instance_name("replay");
    let all = [&["replay", "--json", "--instance", &instance], arguments].concat();
    let ended = Ended::of(&all, PATIENCE);
    assert_eq!(ended.code, Some(0), "{all:?}: {}\n{}", ended.stderr, ended.stdout);
    assert_eq!(processes_of(&instance), [], "no process is left");
    let name = InstanceName::new(&instance).expect("a name");
    assert_eq!(resources_of(&name), Vec::<std::path::PathBuf>::new(), "no shared memory is left");
    ended.json()
}

fn verify(path: &str) -> (Option<i32>, Value) {
    let ended = Ended::of(&["verify", "--json", path], PATIENCE);
    assert!(ended.code != Some(2), "{}", ended.stderr);
    (ended.code, ended.json())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn the_shipped_recording_gives_the_same_bytes_each_time() {
    let channels = read(&shipped());
    assert!(channels.commands.iter().filter(|c| c.phase == Phase::Following as u32).count() > 400);
    for _ in 0..2 {
        let (code, verdict) = verify(&shipped());
        assert_eq!((code, &verdict["first_difference"]), (Some(0), &Value::Null), "{verdict}");
        assert_eq!(verdict["setpoints_identical"], channels.setpoints.len());
        assert_eq!(verdict["commands_identical"], channels.commands.len());
        assert!(number(&verdict["bytes_identical"]) > 100_000.0, "{verdict}");
    }
}

#[test]
fn a_recording_that_was_tampered_with_is_found_out_at_the_sample_and_the_field() {
    let folder = TempFolder::new("tampered");
    let one_bit = |value: &mut f64| *value = f64::from_bits(value.to_bits() ^ 1);
    let path = folder.file("command.mcap");
    rewrite(&shipped(), &path, |sample| match sample {
        Sample::Command(command) if command.sequence == 400 => one_bit(&mut command.q_tilde_m[1]),
        _ => {}
    });
    let (code, verdict) = verify(&path);
    let difference = &verdict["first_difference"];
    assert_eq!((code, &difference["process"], &difference["sequence"]), (Some(1), &"compensate".into(), &400.into()));
    assert_eq!(difference["field"], "q_tilde_m", "{difference}");
    assert_ne!(difference["recorded"], difference["repeated"]);
    assert_eq!(verdict["commands_identical"], 399);
    assert!(verdict["recorded_with"].is_string() && verdict["verified_with"].is_string());

    let path = folder.file("setpoint.mcap");
    rewrite(&shipped(), &path, |sample| match sample {
        Sample::Setpoint(setpoint) if setpoint.sequence == 500 => setpoint.reasons ^= 1 << 13,
        Sample::Command(command) if command.sequence == 600 => one_bit(&mut command.q_tilde_m[0]),
        _ => {}
    });
    let difference = &verify(&path).1["first_difference"];
    assert_eq!((&difference["process"], &difference["sequence"]), (&"resolve".into(), &500.into()), "{difference}");
    assert_eq!(difference["field"], "reasons", "{difference}");
}

/// The sign of a zero is a bit like any other.
#[test]
fn a_zero_of_the_other_sign_is_a_difference() {
    let folder = TempFolder::new("zero");
    let path = folder.file("zero.mcap");
    let mut changed = None;
    rewrite(&shipped(), &path, |sample| match sample {
        Sample::Setpoint(setpoint) if changed.is_none() && setpoint.bend_vel_rad_per_s[0] == 0.0 => {
            setpoint.bend_vel_rad_per_s[0] = -setpoint.bend_vel_rad_per_s[0];
            changed = Some(setpoint.sequence);
        }
        _ => {}
    });
    let sequence = changed.expect("the snake stands at first");
    let (code, verdict) = verify(&path);
    let difference = &verdict["first_difference"];
    assert_eq!((code, &difference["process"], &difference["sequence"]), (Some(1), &"resolve".into(), &sequence.into()));
    assert_eq!(difference["field"], "bend_vel_rad_per_s", "{difference}");
    let values = [&difference["recorded"], &difference["repeated"]].map(|value| value.as_str().expect("a value"));
    assert!(values.contains(&"0.0") && values.contains(&"-0.0"), "{difference}");
}

#[test]
fn an_input_that_is_refused_now_is_a_difference_and_a_missing_one_cannot_be_verified() {
    let folder = TempFolder::new("refused");
    let path = folder.file("fast.mcap");
    rewrite(&shipped(), &path, |sample| match sample {
        Sample::Input(input) if input.sequence == 300 => input.tip_vel_in_view_m_per_s[0] = 50.0,
        _ => {}
    });
    let (code, verdict) = verify(&path);
    assert_eq!(code, Some(1));
    let difference = &verdict["first_difference"];
    assert_eq!((&difference["process"], &difference["field"]), (&"resolve".into(), &"(output)".into()), "{difference}");

    let path = folder.file("gap.mcap");
    rewrite(&shipped(), &path, |sample| match sample {
        Sample::Input(input) if input.sequence == 300 => input.sequence = 299,
        _ => {}
    });
    let ended = Ended::of(&["verify", &path], PATIENCE);
    assert_eq!(ended.code, Some(2), "{}", ended.stdout);
    assert!(ended.sentence().contains("message 300 of channel \"input\""), "{}", ended.sentence());
}

/// At full speed, at a pace, and once more after a restart: the same bytes on every channel; and these can be verified.
#[test]
fn a_replay_gives_the_same_bytes_at_every_speed_and_counts_every_sample() {
    let folder = TempFolder::new("speeds");
    let n_inputs = read(&shipped()).inputs.len();
    let mut first = None;
    for (name, speed) in [("a", "max"), ("b", "max"), ("c", "3")] {
        let path = folder.file(&format!("{name}.mcap"));
        let figures = replay(&[&shipped(), "--speed", speed, "--recording", &path]);
        let samples = &figures["samples"];
        assert_eq!(samples["recorded"], n_inputs, "{figures}");
        assert_eq!((&samples["lost"], &samples["answered"]), (&0.into(), &figures["messages_sent"]), "{figures}");
        assert_eq!(figures["commands_refused"], 0, "{figures}");
        let channels = read(&path);
        assert_eq!(channels.commands.len(), channels.inputs.len());
        assert!(channels.states.len() > channels.commands.len(), "a state for each command, and those before");
        match &first {
            None => first = Some(channels),
            Some(first) => first.assert_same(&channels, &format!("{name} at speed {speed}")),
        }
    }
    let (code, verdict) = verify(&folder.file("a.mcap"));
    assert_eq!((code, &verdict["first_difference"]), (Some(0), &Value::Null), "{verdict}");
}

/// A busy machine records few samples for a while, and none for longer: a step rests on a state that is fresh there too. With every
/// fourth sample left the 32nd before is 128 ms old, which the stages do not trust.
#[test]
fn what_a_busy_machine_has_recorded_is_followed_to_its_end() {
    let folder = TempFolder::new("sparse");
    let (sparse, out) = (folder.file("sparse.mcap"), folder.file("out.mcap"));
    let own = read(&shipped());
    let following =
        |channels: &Channels| channels.commands.iter().filter(|c| c.phase == Phase::Following as u32).count();
    let whole = following(&own);
    let last = own.inputs.last().map(|input| input.sequence).expect("inputs");
    rewrite_some(&shipped(), &sparse, |sample| match sample {
        Sample::Input(input) => input.sequence % 4 == 0 || input.sequence == last,
        _ => true,
    });
    replay(&[&sparse, "--speed", "max", "--recording", &out]);
    let channels = read(&out);
    let is_stale = |command: &&Command| Reasons::from_bits(command.reasons).contains(Reason::StateStale);
    assert_eq!(channels.commands.iter().filter(is_stale).count(), 0, "every state is fresh");
    let n = following(&channels);
    assert!(4 * n > whole * 9 / 10, "{n} of every fourth of {whole} commands follow");
}

/// A replay reads as it plays, and so does a verification: how much memory it takes does not depend on how long the
/// recording is.
#[test]
fn a_long_recording_takes_no_more_memory_than_a_short_one() {
    let folder = TempFolder::new("long");
    let long = folder.file("long.mcap");
    replay(&[&shipped(), "--speed", "max", "--loops", "60", "--recording", &long]);
    let n_bytes_in = |path: &str| {
        let channels = read(path);
        size_of_val(&*channels.inputs)
            + size_of_val(&*channels.setpoints)
            + size_of_val(&*channels.commands)
            + size_of_val(&*channels.states)
    };
    let more_to_play = n_bytes_in(&long) - n_bytes_in(&shipped());
    assert!(more_to_play > 30 << 20, "{more_to_play} bytes");
    let ways: [&[&str]; 2] = [&["replay", "--speed", "max", "--no-recording"], &["verify"]];
    for way in ways {
        let more_held = peak_bytes(way, &long).saturating_sub(peak_bytes(way, &shipped()));
        assert!(
            more_held < more_to_play / 4,
            "{way:?}: {more_held} bytes more memory for {more_to_play} bytes more to play"
        );
    }
}

/// Most memory that the program has held, as far as it was seen.
fn peak_bytes(way: &[&str], path: &str) -> usize {
    let krait = Krait::start(&[way, &[path]].concat());
    let status = format!("/proc/{}/status", krait.pid());
    let mut peak_kb = 0;
    // A program that has ended has no memory.
    while let Ok(text) = std::fs::read_to_string(&status)
        && let Some(line) = text.lines().find(|line| line.starts_with("VmHWM:"))
    {
        peak_kb = line.split_whitespace().nth(1).and_then(|kb| kb.parse().ok()).expect("kB");
        std::thread::sleep(Duration::from_millis(2));
    }
    let ended = krait.end(PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    peak_kb * 1024
}

#[test]
fn a_range_is_approached_and_played_as_often_as_asked_for() {
    let folder = TempFolder::new("range");
    let path = folder.file("range.mcap");
    let recorded = read(&shipped());
    let from_ns = recorded.inputs[0].sample_ns + 400_000_000;
    let first = recorded.inputs.iter().find(|input| input.sample_ns >= from_ns).expect("an input");
    let before = recorded.setpoints.iter().rev().find(|s| s.input_sequence < first.sequence).expect("a setpoint");
    let figures =
        replay(&[&shipped(), "--from", "0.4", "--to", "0.5", "--loops", "2", "--speed", "max", "--recording", &path]);
    let in_loop = number(&figures["samples_in_loop"]);
    assert!((80.0..=130.0).contains(&in_loop), "{figures}");
    assert_eq!(number(&figures["samples"]["recorded"]), 2.0 * in_loop);
    assert!(number(&figures["samples"]["approach"]) > 100.0, "the snake was led to the start: {figures}");
    let played = read(&path);
    let starts: Vec<usize> = (0..played.inputs.len())
        .filter(|k| played.inputs[*k].raw_axes == first.raw_axes && is_like(&played.inputs[*k], first))
        .collect();
    assert_eq!(starts.len(), 2, "both loops begin with the same sample");
    for start in starts {
        let setpoint = &played.setpoints[start - 1];
        let away = (setpoint.bend_rad[0] - before.bend_rad[0]).hypot(setpoint.bend_rad[1] - before.bend_rad[1]);
        assert!(away < 1e-3, "the start is reached: {away} rad away");
    }
}

fn is_like(input: &OperatorInput, other: &OperatorInput) -> bool {
    input.tip_vel_in_view_m_per_s == other.tip_vel_in_view_m_per_s && input.flags == other.flags
}

#[test]
fn a_better_model_in_the_place_of_compensate_lowers_the_tracking_error() {
    let folder = TempFolder::new("replace");
    let model = folder.file("better.toml");
    let effects = "[[effect]]\nkind = \"stiffness-scale\"\neta = 1.22\n[[effect]]\nkind = \"cone-friction\"\n\
                   [[effect]]\nkind = \"static-friction\"\n[[effect]]\nkind = \"backlash\"\nhalf_width_m = 0.089e-3\n";
    std::fs::write(&model, format!("format = 1\n[machine]\nkind = \"snake\"\n{effects}")).expect("written");
    let hand = fourteen_seconds(&folder);
    let error = |name: &str, options: &[&str]| {
        let recording = folder.file(&format!("{name}.mcap"));
        let all = [&[&*hand, "--speed", "max", "--recording", &recording], options].concat();
        number(&replay(&all)["tracking_error_deg"]["rms"])
    };
    let off = error("off", &["--compensation", "off"]);
    let naive = error("naive", &["--compensation", "naive"]);
    let better = error("better", &["--model", &model]);
    assert!(off > 2.0 * naive && naive > 1.5 * better, "off {off}, naive {naive}, better {better} deg");

    let sides = ["off", "naive"].map(|name| folder.file(&format!("{name}.mcap")));
    let compared = Ended::of(&["compare", "--json", &sides[0], &sides[1]], PATIENCE).json();
    let rms = |side: &str| number(&compared[side]["tracking_error_deg"]["rms"]);
    assert_eq!((rms("a"), rms("b")), (off, naive), "compare scores a file as replay did: {compared}");
    assert_eq!(number(&compared["a"]["scored_from_s"]), 10.0);
}

/// Fourteen seconds of motion with reversals and turns of the plane, as a table.
fn fourteen_seconds(folder: &TempFolder) -> String {
    let mut text = String::from("time_s,bend_x_deg,bend_y_deg\n");
    for k in 0..=140_u16 {
        let t = f64::from(k) / 10.0;
        let bend = 30.0 * (t / 2.0).min((14.0 - t) / 2.0).min(1.0) * (1.3 * t).sin();
        let (sin, cos) = (0.2 * t).sin_cos();
        text += &format!("{t:.1},{:.4},{:.4}\n", bend * cos, bend * sin);
    }
    let path = folder.file("hand.csv");
    std::fs::write(&path, text).expect("a table");
    path
}

#[test]
fn a_trajectory_is_followed_and_comes_to_rest() {
    let folder = TempFolder::new("table");
    let (table, path) = (folder.file("path.csv"), folder.file("path.mcap"));
    std::fs::write(&table, "time_s,theta_l_deg,delta_deg\n0,70,0\n1,60,40\n2,70,90\n").expect("written");
    let figures = replay(&[&table, "--speed", "max", "--recording", &path]);
    assert_eq!(figures["samples"]["recorded"], 2001);
    let played = read(&path);
    let middle = played.setpoints.iter().map(|s| s.bend_rad).fold(f64::MAX, |nearest, bend| {
        let (sin, cos) = 40f64.to_radians().sin_cos();
        nearest.min((bend[0] - 30f64.to_radians() * cos).hypot(bend[1] - 30f64.to_radians() * sin))
    });
    assert!(middle < 1e-9, "the curve goes through its row: {middle} rad away");
    let last = played.states.last().expect("states");
    assert_eq!(last.flags & SlaveState::FOLLOWING, 0, "the slave holds at the end");
    let (code, verdict) = verify(&path);
    assert_eq!((code, &verdict["first_difference"]), (Some(0), &Value::Null), "setpoints can be sent again: {verdict}");
}

/// On the machine's clock: led to a start that is not where the snake stands, eased in, never faster than allowed.
#[test]
fn on_the_clock_the_start_is_eased_in_and_the_drives_stay_within_their_rates() {
    let folder = TempFolder::new("live");
    let (table, path) = (folder.file("path.csv"), folder.file("path.mcap"));
    std::fs::write(&table, "time_s,bend_x_deg,bend_y_deg\n0,15,0\n0.8,15,10\n1.6,10,10\n").expect("written");
    let figures = replay(&[&table, "--real-time", "--engage", "--recording", &path]);
    assert_eq!(figures["samples"]["recorded"], 1601);
    assert!(number(&figures["samples"]["approach"]) > 500.0, "{figures}");
    let played = read(&path);
    let moved: Vec<&SlaveState> = played.states.iter().filter(|s| s.command_sequence > 0).collect();
    assert!(moved.len() > 1000, "{figures}");
    for pair in moved.windows(2) {
        let seconds = (pair[1].sample_ns - pair[0].sample_ns) as f64 * 1e-9;
        for k in 0..3 {
            let way_m = (pair[1].setpoint_q_m[k] - pair[0].setpoint_q_m[k]).abs();
            // 30 mm/s, and 10 ms of credit for a command that was held up.
            assert!(way_m <= 30e-3 * seconds.max(10e-3) + 1e-9, "{way_m} m in {seconds} s");
        }
    }
    let first = played.commands.iter().find(|c| c.phase == Phase::Following as u32).expect("motion");
    assert!(first.q_tilde_m.iter().all(|q| q.abs() < 50e-6), "the first command is where the drives are: {first:?}");
    let reached = played.states.iter().map(|s| s.setpoint_bend_rad[0]).fold(0.0, f64::max);
    assert!(reached > 14f64.to_radians(), "the start was reached: {reached} rad");
    assert_eq!(played.states.last().map(|s| s.flags & SlaveState::FOLLOWING), Some(0), "the end is at rest");
}

#[test]
fn a_replay_in_steps_sends_one_sample_for_each_line() {
    let instance = instance_name("step");
    let mut command = std::process::Command::new(krait_program());
    command.args(["replay", &shipped(), "--step", "--no-recording", "--instance", &instance]);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("krait starts");
    child.stdin.take().expect("piped").write_all(b"\n\n\n").expect("three steps");
    let output = child.wait_with_output().expect("it ends");
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(text.lines().filter(|line| line.starts_with("sample ")).count(), 3, "{text}");
    assert!(text.contains("Played 3 samples") && text.contains("It was stopped before its end."), "{text}");
}

/// An option that only one stage has says which stage is meant; what was inferred is said, and the result is the same.
#[test]
fn an_option_of_one_stage_replaces_it_without_being_told_so_twice() {
    let folder = TempFolder::new("inferred");
    let truth = folder.file("truth.toml");
    std::fs::write(&truth, "[effects]\nload_scale = 1.3\n").expect("written");
    let model = format!("{}/../model/models/off.toml", env!("CARGO_MANIFEST_DIR"));
    let play = |name: &str, options: &[&str]| {
        let (instance, path) = (instance_name("inferred"), folder.file(&format!("{name}.mcap")));
        let all = [&["replay", &shipped(), "--speed", "max", "--instance", &instance, "--recording", &path], options];
        let ended = Ended::of(&all.concat(), PATIENCE);
        assert_eq!(ended.code, Some(0), "{options:?}: {}", ended.stderr);
        (read(&path), ended.stderr)
    };
    let said = |stderr: &str| stderr.lines().filter(|line| line.contains("replaces")).map(str::to_owned).collect();
    let cases: [(&[&str], &str, &str); 3] = [
        (&["--compensation", "off"], "compensate", "--compensation replaces compensate"),
        (&["--model", &model], "compensate", "--model replaces compensate"),
        (&["--truth", &truth], "slave", "--truth replaces slave"),
    ];
    for (options, stage, words) in cases {
        let name = options[0].trim_start_matches('-');
        let (inferred, stderr) = play(&format!("{name}-inferred"), options);
        let lines: Vec<String> = said(&stderr);
        assert_eq!(lines, [format!("{words}; the other stages are as recorded")], "{stderr}");
        let (told, stderr) = play(&format!("{name}-told"), &[options, &["--replace", stage]].concat());
        assert_eq!(said(&stderr), Vec::<String>::new(), "nothing had to be inferred");
        told.assert_same(&inferred, words);
    }
}

#[test]
fn two_recordings_are_compared_as_a_table_and_as_pictures() {
    let folder = TempFolder::new("compare");
    let (off, out) = (folder.file("off.mcap"), folder.file("pictures"));
    replay(&[&shipped(), "--speed", "max", "--replace", "compensate", "--compensation", "off", "--recording", &off]);
    let ended = Ended::of(&["compare", "--json", &shipped(), &off, "--out", &out], PATIENCE);
    let figures = ended.json();
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(["a", "b"].iter().all(|side| figures[side]["tracking_error_deg"].is_null()), "{figures}");
    let text = Ended::of(&["compare", &shipped(), &off], PATIENCE).stdout;
    assert_eq!((text.matches(" too short ").count(), text.matches("too short: 10 s needed").count()), (6, 1), "{text}");
    assert!(number(&figures["a"]["latency_us"]["device -> drive"]["p50"]) > 0.0, "{figures}");
    assert_eq!(figures["b"]["latency_us"], serde_json::json!({}), "in its own time a replay has no latency");
    assert!(number(&figures["apart"]["command_mm"]["max"]) > 0.1, "{figures}");
    assert!(number(&figures["a"]["following_s"]) > 0.3 && figures["a"]["n_faults"] == 0, "{figures}");
    assert_eq!(figures["a"]["about"]["device_serial"], "none (script)", "{figures}");
    let pictures = figures["pictures"].as_array().expect("pictures");
    assert_eq!(pictures.len(), 4);
    for picture in pictures {
        let text = std::fs::read_to_string(picture.as_str().expect("a path")).expect("a picture");
        assert!(text.starts_with("<svg") && text.contains("polyline"), "{picture}");
    }
    let same = Ended::of(&["compare", "--json", &off, &off], PATIENCE).json();
    assert_eq!(same["apart"]["setpoint_deg"]["max"], 0.0, "{same}");
    let table = Ended::of(&["compare", &shipped(), &off], PATIENCE);
    assert!(
        table.stdout.contains("tracking error rms, deg") && table.stdout.contains("ENABLED, s"),
        "{}",
        table.stdout
    );
    assert_eq!(Ended::of(&["compare", &off, "/nowhere.mcap"], PATIENCE).code, Some(2));
}

/// A comparison says what a person looks for: how far each snake bent by its camera, and what was marked and when.
#[test]
fn a_comparison_has_measured_bends_and_marks_of_both_and_fits_a_terminal() {
    let folder = TempFolder::new("marked");
    let (off, marked) = (folder.file("off.mcap"), folder.file("marked.mcap"));
    replay(&[&shipped(), "--speed", "max", "--compensation", "off", "--recording", &off]);
    let channels = read(&shipped());
    let first_ns = channels.setpoints.iter().find(|s| s.phase() == Some(Phase::Following)).expect("motion").sample_ns;
    let text =
        "touched the wall of the phantom and came back, as the surgeon saw it through the camera; once more later";
    let mark = Marker::new(1, first_ns + 250_000_000, text).expect("a text");
    let recording = Recording::open(Path::new(&shipped())).expect("readable");
    let about = About::run("marked", &BTreeMap::new(), recording.contents().attachments.clone());
    let mut writer = RecordingWriter::create(Path::new(&marked), 1 << 18, &about).expect("created");
    for recorded in recording.samples().expect("samples") {
        let sample = recorded.expect("readable").sample;
        writer.write(&sample, sample.sample_ns()).expect("written");
    }
    writer.write(&Sample::Marker(Box::new(mark)), mark.sample_ns).expect("written");
    writer.finish(&BTreeMap::new()).expect("finished");

    let figures = Ended::of(&["compare", "--json", &marked, &off], PATIENCE).json();
    let [found] = &figures["a"]["marks"].as_array().expect("marks")[..] else { panic!("{figures}") };
    assert!((number(&found["at_s"]) - 0.25).abs() < 1e-6 && found["text"] == text, "{found}");
    assert_eq!(figures["b"]["marks"], serde_json::json!([]));
    let seen = [channels.shapes, read(&off).shapes];
    for (side, shapes) in ["a", "b"].into_iter().zip(&seen) {
        let bends = shapes.iter().filter_map(Shape::valid_bend_rad).map(|[x, y]| x.hypot(y).to_degrees());
        let largest = bends.fold(0.0, f64::max);
        let found = number(&figures[side]["peak_bend_deg"]["reached"]);
        assert!(largest > 1.0 && (found / largest - 1.0).abs() < 1e-9, "{side}: {found} deg, {largest} deg measured");
    }
    assert!(number(&figures["apart"]["shape_deg"]["max"]) > 0.1, "{figures}");

    let text_out = Ended::of(&["compare", &marked, &off], PATIENCE).stdout;
    let words: Vec<&str> = text_out.split_whitespace().collect();
    for expected in
        ["largest bend measured, deg", "largest bend commanded, deg", "measured bends", "0.250", text, "B none"]
    {
        assert!(words.join(" ").contains(expected), "{expected} is not in {text_out}");
    }
    for line in text_out.lines().filter(|line| !line.starts_with("A: ") && !line.starts_with("B: ")) {
        assert!(line.chars().count() <= 80, "{} columns: {line}", line.chars().count());
    }
}

#[test]
fn what_cannot_be_played_is_refused_with_one_sentence() {
    let folder = TempFolder::new("unplayable");
    let table = folder.file("path.csv");
    std::fs::write(&table, "time_s,bend_x_deg,bend_y_deg\n0,0,0\n1,ten,0\n").expect("written");
    let text = folder.file("notes.mcap");
    std::fs::write(&text, "no recording").expect("written");
    let flick = shipped();
    let cases: [(&[&str], &[&str]); 11] = [
        (&[&table], &["path.csv, line 3, column 2", "\"ten\""]),
        (&[&text], &["notes.mcap"]),
        (&["/nowhere/run.mcap"], &["/nowhere/run.mcap"]),
        (&[&flick, "--pass", "2"], &["--pass 2", "it holds 1 pass"]),
        (&[&flick, "--from", "2", "--to", "1"], &["--from 2 --to 1"]),
        (&[&flick, "--from", "500"], &["no operator input lies between --from 500 s and the end"]),
        (&[&flick, "--from", "-1"], &["--from -1: expected 0 s or later"]),
        (&[&flick, "--model", "/nowhere/better.toml"], &["/nowhere/better.toml", "could not be read"]),
        (&[&flick, "--real-time"], &["--real-time without --engage", "add --engage"]),
        (&[&flick, "--real-time", "--engage", "--speed", "max"], &["--real-time", "needs a speed"]),
        (&[&flick, "--config", "other.toml"], &["brings its own settings", "--replace STAGE"]),
    ];
    for (arguments, words) in cases {
        let instance = instance_name("bad");
        let all = [&["replay", "--no-recording", "--instance", &instance], arguments].concat();
        let ended = Ended::of(&all, PATIENCE);
        assert_eq!(ended.code, Some(2), "{arguments:?}: {}", ended.stdout);
        for word in words {
            assert!(ended.sentence().contains(word), "{word:?} is not in: {}", ended.sentence());
        }
        assert_eq!(processes_of(&instance), [], "no process is left");
    }
}
