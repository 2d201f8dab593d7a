//! The demo as a user runs it: its figures, its recording, and the bytes that a replay of its input gives.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

#[path = "../../record/tests/common/python.rs"]
mod python;

use core::time::Duration;
use krait_ipc::message::{Command, OperatorInput, Setpoint, SlaveState};
use krait_ipc::{InstanceName, resources_of};
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Console, Ended, Krait, TempFolder, instance_name, next_of_kind, processes_of};
use rustix::process::Signal;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// One demo serves every check. Its passes are shorter than those that a user sees, which `.ci/run` runs.
#[test]
fn the_demo_shows_what_compensation_does_and_its_recording_proves_it() {
    let (instance, folder) = (instance_name("demo"), TempFolder::new("demo"));
    let recording = folder.file("demo.mcap");
    let ended = Ended::of(
        &["demo", "--json", "--seconds", "14", "--instance", &instance, "--recording", &recording],
        Duration::from_secs(240),
    );
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stderr, ended.stdout);
    let figures = ended.json();
    check_errors(&figures);
    check_processes(&figures);
    check_latency_and_samples(&figures);
    assert_eq!(figures["recording"], recording.as_str());
    assert_eq!(processes_of(&instance), [], "no process is left");
    let name = InstanceName::new(&instance).expect("a name");
    assert_eq!(resources_of(&name), Vec::<std::path::PathBuf>::new(), "no shared memory is left");

    let channels = read_channels(Path::new(&recording));
    check_rates(&channels);
    check_replay(&recording, &channels);
    check_with_python(&recording, &channels);
}

/// Whoever has seen the figures is told how to see the snake, and the command is one that works as it stands.
#[test]
fn the_demos_last_line_is_a_command_that_opens_the_page() {
    let (instance, folder) = (instance_name("last"), TempFolder::new("last"));
    let recording = folder.file("demo.mcap");
    let all = ["demo", "--seconds", "12", "--instance", &instance, "--recording", &recording];
    let ended = Ended::of(&all, Duration::from_secs(240));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let last = ended.stdout.trim_end().lines().next_back().expect("figures");
    let command = last.split('`').nth(1).and_then(|command| command.strip_prefix("krait ")).expect("a command");
    assert!(command.contains("run --console"), "{last}");
    let words: Vec<&str> = command.split(' ').collect();
    let mut krait = Krait::start(&[&words[..], &["--instance", &instance, "--no-recording"]].concat());
    let mut live = Console::of(&mut krait).page();
    let follows = (0..7200).any(|_| next_of_kind(&mut live, "frame")["shown"] == "following");
    assert!(follows, "the snake moves on the page");
    krait.signal(Signal::INT);
    assert_eq!(krait.end(Duration::from_secs(60)).code, Some(0));
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn check_errors(figures: &Value) {
    let passes = figures["passes"].as_array().expect("passes");
    let names: Vec<&str> = passes.iter().filter_map(|p| p["compensation"].as_str()).collect();
    assert_eq!(names, ["off", "naive", "estimated"]);
    let rms: Vec<f64> = passes.iter().map(|p| number(&p["error_deg"]["rms"])).collect();
    assert!(rms[1] > 1.0, "naive compensation misses one degree: {rms:?}");
    assert!(rms[2] < 1.0, "estimated compensation reaches it: {rms:?}");
    assert!(rms[0] > 2.0 * rms[1] && rms[1] > 2.0 * rms[2], "{rms:?}");
    for pass in passes {
        let error = &pass["error_deg"];
        assert!(number(&error["rms"]) <= number(&error["max"]) && number(&error["p95"]) <= number(&error["max"]));
        assert!(number(&pass["scored_shapes"]) > 180.0, "{pass}");
    }
    let peak = &passes[0]["peak_bend_deg"];
    let reached = number(&peak["reached"]) / number(&peak["commanded"]);
    assert!((0.40..0.60).contains(&reached), "without compensation the snake reaches about half: {reached}");
    let peak = &passes[2]["peak_bend_deg"];
    let reached = number(&peak["reached"]) / number(&peak["commanded"]);
    assert!((0.95..1.05).contains(&reached), "with estimates it arrives: {reached}");
    let learnt = &passes[2]["learnt"];
    assert_eq!(
        (&learnt[0]["name"], &learnt[1]["name"]),
        (&"stiffness-scale.eta".into(), &"backlash.half_width_m".into())
    );
    assert!((number(&learnt[0]["value"]) - 1.22).abs() < 0.02, "{learnt}");
}

fn check_processes(figures: &Value) {
    let processes = figures["processes"].as_array().expect("processes");
    let pids: BTreeSet<u64> = processes.iter().filter_map(|p| p["pid"].as_u64()).collect();
    assert_eq!(pids.len(), processes.len(), "each is an operating-system process of its own");
    assert_eq!(pids.len(), 1 + 3 * 5, "one recorder, and five processes in each pass");
    let names: BTreeSet<&str> = processes.iter().filter_map(|p| p["name"].as_str()).collect();
    assert_eq!(names, ["compensate", "estimate", "master", "record", "resolve", "slave"].into());
}

fn check_latency_and_samples(figures: &Value) {
    let latency = &figures["latency_us"];
    for quantiles in latency["hops"].as_array().expect("hops").iter().chain([&latency["end_to_end"]]) {
        let values = ["p50", "p99", "p999", "max"].map(|q| number(&quantiles[q]));
        assert!(values[0] > 0.0 && values.is_sorted(), "{quantiles}");
    }
    let hops = latency["hops"].as_array().expect("hops");
    let chain: Vec<&str> = hops.iter().filter_map(|h| h["to"].as_str()).collect();
    assert_eq!(chain, ["master", "resolve", "compensate", "slave"]);
    let samples = &figures["samples"];
    assert_eq!(samples["lost"], 0, "{samples}");
    assert_eq!(samples["sent"], samples["received"], "{samples}");
    // Of 42,000: a busy machine makes the hand miss ticks; its rate is judged by the median period (`check_rates`).
    assert!(number(&samples["sent"]) > 21_000.0, "three passes of 14 s at 1 kHz: {samples}");
}

/// What a replay needs, in the order of the recording.
#[derive(Default)]
struct Channels {
    inputs: Vec<OperatorInput>,
    setpoints: Vec<Setpoint>,
    commands: Vec<Command>,
    states: Vec<SlaveState>,
    shapes_ns: Vec<i64>,
}

fn read_channels(path: &Path) -> Channels {
    let recording = Recording::open(path).expect("the recording is readable");
    let contents = recording.contents();
    assert!(contents.is_indexed && contents.missing.is_empty(), "{contents:?}");
    assert!(contents.attachments.iter().any(|a| a.name == "krait.toml"), "the configuration is embedded");
    let mut channels = Channels::default();
    for recorded in recording.samples().expect("samples") {
        match recorded.expect("every sample is readable").sample {
            Sample::Input(input) => channels.inputs.push(input),
            Sample::Setpoint(setpoint) => channels.setpoints.push(setpoint),
            Sample::Command(command) => channels.commands.push(command),
            Sample::State(state) => channels.states.push(state),
            Sample::Shape(shape) => channels.shapes_ns.push(shape.sample_ns),
            _ => {}
        }
    }
    channels
}

/// Samples a second by the median period: the pauses between the passes, and a tick that a busy machine missed, do not count.
fn median_hz(times_ns: &[i64]) -> f64 {
    let mut periods_ns: Vec<i64> = times_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
    periods_ns.sort_unstable();
    1e9 / periods_ns[periods_ns.len() / 2] as f64
}

fn check_rates(channels: &Channels) {
    let shapes_hz = median_hz(&channels.shapes_ns);
    assert!((59.0..61.0).contains(&shapes_hz), "the camera gives 60 shapes a second: {shapes_hz}");
    let inputs_ns: Vec<i64> = channels.inputs.iter().map(|input| input.sample_ns).collect();
    let inputs_hz = median_hz(&inputs_ns);
    assert!((900.0..1100.0).contains(&inputs_hz), "the hand is read 1000 times a second: {inputs_hz}");
    let span_ns = inputs_ns[inputs_ns.len() - 1] - inputs_ns[0];
    assert!(span_ns >= 41_000_000_000, "three passes of 14 s each: {span_ns} ns");
    assert!(channels.states.len() >= channels.commands.len(), "encoders come with every command");
    let drained: u64 = channels.inputs.iter().map(|i| i.n_reports).max().unwrap_or(0);
    let is_tripped =
        |command: &Command| krait_ipc::Reasons::from_bits(command.reasons).contains(krait_ipc::Reason::MismatchTrip);
    assert!(!channels.commands.iter().any(is_tripped), "no pass is so far from its model that it is ended");
    assert!(drained > 500, "the input is made of HID reports: {drained}");
    assert!(channels.inputs.iter().any(|i| i.clutch_pressed()), "the operator used the clutch");
    let at_rest = krait_ipc::message::DeviceState::AtRest;
    assert!(channels.inputs.iter().filter(|i| i.device() == Some(at_rest)).count() > 600, "and rested");
}

/// Recorded input gives the same setpoints and commands, bit for bit; a recording that was tampered with does not.
fn check_replay(recording: &str, channels: &Channels) {
    let ended = Ended::of(&["verify", "--json", recording], Duration::from_secs(240));
    let verdict = ended.json();
    assert_eq!((ended.code, &verdict["first_difference"]), (Some(0), &Value::Null), "{verdict}");
    assert_eq!(verdict["passes"], 3);
    assert_eq!(verdict["setpoints_identical"], channels.setpoints.len());
    assert_eq!(verdict["commands_identical"], channels.commands.len());

    let tampered = format!("{recording}.tampered.mcap");
    let at = tamper(recording, &tampered, channels.commands.len() / 2);
    let ended = Ended::of(&["verify", "--json", &tampered], Duration::from_secs(240));
    let difference = &ended.json()["first_difference"];
    assert_eq!(ended.code, Some(1), "{difference}");
    assert_eq!((&difference["process"], &difference["sequence"]), (&"compensate".into(), &at.into()), "{difference}");
    assert_eq!(difference["field"], "q_tilde_m", "{difference}");
}

/// Writes the recording anew with one bit of one command changed; gives the command's sequence number.
fn tamper(from: &str, to: &str, n_th: usize) -> u64 {
    let recording = Recording::open(Path::new(from)).expect("readable");
    let about = krait_record::About::run("tampered", &BTreeMap::new(), recording.contents().attachments.clone());
    let mut writer = krait_record::RecordingWriter::create(Path::new(to), 1 << 18, &about).expect("created");
    let (mut n_commands, mut at) = (0, 0);
    for recorded in recording.samples().expect("samples") {
        let mut sample = recorded.expect("readable").sample;
        if let Sample::Command(command) = &mut sample {
            n_commands += 1;
            if n_commands == n_th {
                command.q_tilde_m[1] = f64::from_bits(command.q_tilde_m[1].to_bits() ^ 1);
                at = command.sequence;
            }
        }
        writer.write(&sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");
    at
}

/// The public Python reader decodes every channel, and counts what Rust counted.
fn check_with_python(recording: &str, channels: &Channels) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../record/tests/read_with_python.py");
    let target_tmp = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let Some(seen) = python::read_with_python(target_tmp, &script, Path::new(recording)) else { return };
    assert_eq!(seen["indexed"], true);
    let topics = seen["channels"].as_object().expect("channels");
    for (topic, channel) in topics {
        assert_eq!(channel["messages"], channel["decoded"], "{topic}");
        assert!(number(&channel["decoded"]) > 0.0, "{topic} holds something");
    }
    let decoded = |topic: &str| topics[topic]["decoded"].as_u64().expect("a count") as usize;
    assert_eq!(decoded("/krait/input"), channels.inputs.len());
    assert_eq!(decoded("/krait/setpoint"), channels.setpoints.len());
    assert_eq!(decoded("/krait/command"), channels.commands.len());
    assert_eq!(decoded("/krait/state"), channels.states.len());
    assert_eq!(decoded("/krait/shape"), channels.shapes_ns.len());
}
