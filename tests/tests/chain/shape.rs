//! Shapes of another program: a second process looks at the machine and tells krait through `krait shape`.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use krait_ipc::message::{Health, ModelUpdate, Shape, SlaveState, Validity};
use krait_ipc::{Bus, Process, ReadOptions, clock, health_channel};
use krait_record::Recording;
use krait_schema::Sample;
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, SeenShape};
use krait_tests::{Ended, Krait, TempFolder, instance_name, processes_of, wait_until};
use std::io::Write;
use std::path::Path;
use std::process::ChildStdin;

const PATIENCE: Duration = Duration::from_secs(240);
/// Zero of the camera program's own clock against CLOCK_MONOTONIC, ns.
const CLOCK_OFFSET_NS: i64 = 1_234_567_891_011;
const HEADER: &str = "{\"krait_shapes\": 1, \"clock\": \"own\", \"source\": \"test camera\"}\n";

/// A camera program: it has a snake of its own, which goes where the drives of the chain say that they are, and writes
/// what its camera sees. Every 40th frame is followed by a line that is wrong. Returns frames and wrong lines.
fn look(instance: &str, mut out: ChildStdin, stop: &AtomicBool) -> (u64, u64) {
    let bus = Bus::open(instance, "camera").expect("bus");
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing()).expect("reader");
    let mut snake = SimulatedSnake::new(&Truth::default());
    snake.set_power(0, true).expect("powered");
    let wrong =
        ["nonsense", "{\"exposure_ns\": 1, \"bend_rad\": [NaN, 0]}", "{\"exposure_ns\": 1, \"bend_rad\": [0, 0]}"];
    let (mut n_frames, mut n_wrong) = (0_u64, 0_u64);
    out.write_all(HEADER.as_bytes()).expect("krait shape reads");
    while !stop.load(Ordering::Relaxed) {
        while let Some(state) = states.take().expect("states") {
            snake.write(state.sample_ns, state.setpoint_q_m).expect("within travel");
            let Some(seen) = snake.shape(state.sample_ns) else { continue };
            n_frames += 1;
            let (exposure_ns, sent_ns) = (seen.exposure_ns - CLOCK_OFFSET_NS, clock::monotonic_ns() - CLOCK_OFFSET_NS);
            let SeenShape::Bend([x, y]) = seen.seen else { panic!("a camera on a snake sees a bend") };
            let variance = seen.sigma_rad * seen.sigma_rad;
            let mut text = format!(
                "{{\"exposure_ns\": {exposure_ns}, \"sent_ns\": {sent_ns}, \"frame\": {n_frames}, \
                 \"bend_rad\": [{x}, {y}], \"covariance_rad2\": [{variance}, 0.0, {variance}]}}\n"
            );
            if n_frames % 40 == 0 {
                text += &format!("{}\n", wrong[n_wrong as usize % wrong.len()]);
                n_wrong += 1;
            }
            if out.write_all(text.as_bytes()).is_err() {
                return (n_frames, n_wrong);
            }
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    (n_frames, n_wrong)
}

fn shapes_and_updates(recording: &str) -> (Vec<Shape>, Vec<ModelUpdate>) {
    let (mut shapes, mut updates) = (Vec::new(), Vec::new());
    for recorded in Recording::open(Path::new(recording)).expect("readable").samples().expect("samples") {
        match recorded.expect("readable").sample {
            Sample::Shape(shape) => shapes.push(shape),
            Sample::ModelUpdate(update) => updates.push(update),
            _ => {}
        }
    }
    (shapes, updates)
}

#[test]
fn a_chain_learns_from_another_programs_camera_and_its_recording_verifies_and_replays() {
    let (instance, folder) = (instance_name("shape"), TempFolder::new("shape"));
    let recording = folder.file("run.mcap");
    let chain = Krait::start(&[
        "run",
        "--engage",
        "--json",
        "--instance",
        &instance,
        "--shape",
        "external",
        "--compensation",
        "estimated",
        "--seconds",
        "15",
        "--recording",
        &recording,
    ]);
    assert!(wait_until(PATIENCE, || processes_of(&instance).iter().any(|(name, _)| name == "master")));
    let (shape, out) = Krait::start_with_input(&["shape", "--json", "--instance", &instance]);
    let stop = AtomicBool::new(false);
    let ((n_frames, n_wrong), ended) = std::thread::scope(|scope| {
        let camera = scope.spawn(|| look(&instance, out, &stop));
        let ended = chain.end(PATIENCE);
        stop.store(true, Ordering::Relaxed);
        (camera.join().expect("the camera"), ended)
    });
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let counts = shape.end(PATIENCE);
    assert_eq!(counts.code, Some(0), "{}", counts.stderr);
    let counts = counts.json();
    let count = |key: &str| counts[key].as_u64().expect("a count");
    assert_eq!(count("lines"), 1 + n_frames + n_wrong, "every line counts: {counts}");
    // A third of the wrong lines is nonsense, a third is not finite, a third is old; a busy machine may add old ones.
    assert_eq!((count("malformed"), count("not_finite")), (n_wrong.div_ceil(3), (n_wrong + 1) / 3), "{counts}");
    // The clock is learnt for a second.
    assert!(count("stale") + 1 >= n_wrong / 3 && count("no_clock") >= 50, "{counts}");
    let refused = ["malformed", "not_finite", "stale", "no_clock"].map(count).iter().sum::<u64>();
    assert_eq!(count("published") + refused, n_frames + n_wrong, "{counts}");
    assert!(count("published") > 600 && n_wrong > 12, "{counts}");

    let (shapes, updates) = shapes_and_updates(&recording);
    assert!(shapes.len() > 500 && shapes.iter().all(|s| s.validity == Validity::Valid as u32), "{}", shapes.len());
    let latency_ms = |shape: &Shape| (shape.available_ns - shape.sample_ns) as f64 * 1e-6;
    assert!(shapes.iter().all(|shape| latency_ms(shape) >= 0.0), "an exposure lies before its arrival");
    let last = updates.last().expect("estimate has learnt");
    let scale = last.learnt().first().expect("the built-in model learns the load scale first");
    assert!(last.n_used > 300 && (scale.value - Truth::default().effects.load_scale).abs() < 0.06, "{last:?}");

    let verdict = Ended::of(&["verify", "--json", &recording], PATIENCE);
    assert_eq!((verdict.code, &verdict.json()["first_difference"]), (Some(0), &serde_json::Value::Null), "{verdict:?}");
    let copy = folder.file("replay.mcap");
    let played = Ended::of(&["replay", &recording, "--to", "4", "--speed", "max", "--recording", &copy], PATIENCE);
    assert_eq!(played.code, Some(0), "{}", played.stderr);
    let (seen, learnt) = shapes_and_updates(&copy);
    assert!(seen.len() > 100 && learnt.len() == seen.len(), "the replay's own camera looks: {} shapes", seen.len());
}

#[test]
fn a_second_writer_and_a_stream_without_a_header_get_one_sentence() {
    let instance = instance_name("second");
    let (first, mut out) = Krait::start_with_input(&["shape", "--instance", &instance]);
    out.write_all(HEADER.as_bytes()).expect("written");
    {
        // It has its channel when it says that it is ready.
        let bus = Bus::open(&instance, "test").expect("bus");
        let channel = health_channel(Process::Shape);
        let mut health = bus.reader_on::<Health>(&channel, ReadOptions::glancing()).expect("reader");
        assert!(wait_until(PATIENCE, || health.take_newest().expect("health").is_some()));
    }
    let second = Ended::of(&["shape", "--instance", &instance], PATIENCE);
    assert_eq!(second.code, Some(2), "{}", second.stderr);
    assert!(second.sentence().contains("another `krait shape` (pid "), "{}", second.sentence());
    let chain = Ended::of(&["run", "--no-recording", "--instance", &instance, "--seconds", "1"], PATIENCE);
    assert_eq!(chain.code, Some(2), "{}", chain.stderr);
    assert!(chain.sentence().contains("--shape external"), "{}", chain.sentence());
    drop(out);
    assert_eq!(first.end(PATIENCE).code, Some(0));

    let (bare, mut out) = Krait::start_with_input(&["shape", "--instance", &instance_name("bare")]);
    out.write_all(b"{\"exposure_ns\": 1, \"bend_rad\": [0, 0]}\n").expect("written");
    let ended = bare.end(PATIENCE);
    assert_eq!(ended.code, Some(2));
    assert!(ended.sentence().contains("expected a header"), "{}", ended.sentence());
}
