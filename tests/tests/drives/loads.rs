//! Loads on their whole way: lines of the simulated snake, currents of emulated servos, the bus, the recording, the lab's reader.

use super::*;
use core::sync::atomic::{AtomicBool, Ordering};
use krait_drives::emulator::Coupling;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::SlaveState;
use krait_ipc::{Bus, ReadOptions};
use krait_lab::LoadUse;
use krait_lab::read::{ColumnMap, Expected};
use krait_sim::{CableSnake, SimulatedSnake, Truth};
use krait_slave::{Drive, SeenShape};
use std::process::ChildStdin;
use std::sync::{Arc, Mutex};

/// Counts of a servo for a metre of line on its spool of 8 mm.
const PER_M: f64 = 4096.0 / (core::f64::consts::TAU * 0.008);
/// Largest load of a servo, N; its current has 400 steps of 6.5 mA.
const LARGEST_N: f64 = 200.0;
const STEP_N: f64 = LARGEST_N / 400.0;
const NEWTON_METRE_PER_AMPERE: f64 = LARGEST_N * 0.008 / (400.0 * 6.5e-3);
/// Which way each servo is wound.
const SIGNS: [f64; 3] = [1.0, -1.0, 1.0];
const GAIN_SD: f64 = 0.3;
/// Readings may be so much older than the state that holds them, ns: a machine under load holds up a bus.
const LATE_NS: i64 = 400_000_000;
/// What the recording says per newton of the lines.
const SLOPES: core::ops::Range<f64> = 0.85..1.15;

/// What the lines carried, N, push positive, and when, ns.
type Carried = Vec<(i64, [f64; 3])>;

/// Three servos that bend a snake on cables, and what its lines carry.
fn snake() -> (Emulator, Arc<Mutex<Carried>>) {
    let carried = Arc::new(Mutex::new(Carried::new()));
    let (mut snake, log) = (CableSnake::new(Truth::default()), Arc::clone(&carried));
    let mut wire = ServoWire::new((1..=3).map(|id| Servo::of(ServoMake::Sts3215, id, ZERO)).collect());
    wire.coupling = Some(Coupling::new(move |places| {
        let loads_n = snake.loads_n(core::array::from_fn(|k| SIGNS[k] * (places[k] - ZERO) / PER_M));
        log.lock().expect("no panic before").push((monotonic_ns(), loads_n));
        (0..3).map(|k| SIGNS[k] * loads_n[k] / LARGEST_N).collect()
    }));
    (Emulator::start(wire).expect("a pseudo-terminal"), carried)
}

/// A camera that looks at a snake which goes where the slave says, until it is told to stop.
fn look(instance: &str, mut out: ChildStdin, stop: &AtomicBool) {
    let bus = Bus::open(instance, "camera").expect("bus");
    let mut states = bus.reader::<SlaveState>(ReadOptions::observing()).expect("reader");
    let mut snake = SimulatedSnake::new(&Truth::default());
    snake.set_power(0, true).expect("powered");
    let mut text = "{\"krait_shapes\": 1, \"clock\": \"monotonic\"}\n".to_owned();
    while !stop.load(Ordering::Relaxed) {
        while let Some(state) = states.take().expect("states") {
            snake.write(state.sample_ns, state.setpoint_q_m).expect("within travel");
            if let Some((seen, SeenShape::Bend([x, y]))) = snake.shape(state.sample_ns).map(|seen| (seen, seen.seen)) {
                let exposure_ns = seen.exposure_ns;
                text += &format!("{{\"exposure_ns\": {exposure_ns}, \"bend_rad\": [{x}, {y}]}}\n");
            }
        }
        if out.write_all(core::mem::take(&mut text).as_bytes()).is_err() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Slope of what was found over what was, both without their means.
fn slope(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (mean_true, mean_found) = pairs.iter().fold((0.0, 0.0), |(a, b), (t, f)| (a + t / n, b + f / n));
    let (mut both, mut own) = (0.0, 0.0);
    for (was, found) in pairs {
        both += (was - mean_true) * (found - mean_found);
        own += (was - mean_true).powi(2);
    }
    both / own
}

#[test]
fn loads_of_the_lines_reach_the_lab_with_their_sign_their_size_and_how_well_they_are_known() {
    let (instance, folder) = (instance_name("loads"), TempFolder::new("loads"));
    let (emulator, carried) = snake();
    let more = format!("load_gain_sd = {GAIN_SD}\n");
    let config = configuration_of(ServoMake::Sts3215, &folder, &emulator, 3, ["", &more, ""]);
    let text = std::fs::read_to_string(&config).expect("written");
    let text = text
        .replace(
            "zero_count = 2048\n",
            &format!("zero_count = 2048\nnewton_metre_per_ampere = {NEWTON_METRE_PER_AMPERE}\n"),
        )
        .replace("id = 2\n", "id = 2\nsign = -1\n");
    std::fs::write(&config, text).expect("written");
    let path = folder.file("run.mcap");
    let run = ["run", "--engage", "--shape", "external", "--instance", &instance, "--config", &config];
    let krait = Krait::start(&[&run[..], &["--recording", &path]].concat());
    assert!(wait_until(PATIENCE, || pid_of(&instance, "master").is_some()), "the chain is there");
    let (shape, out) = Krait::start_with_input(&["shape", "--instance", &instance]);
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| look(&instance, out, &stop));
        let moves = wait_until(PATIENCE, || farthest(&emulator) > 60.0);
        std::thread::sleep(Duration::from_secs(4));
        stop.store(true, Ordering::Relaxed);
        assert!(moves, "{:?}", emulator.wire().servos);
    });
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    shape.end(PATIENCE);
    let carried = carried.lock().expect("no panic before").clone();

    let csv = folder.file("run.csv");
    let exported = Ended::of(&["export", &path, "--format", "csv", "--out", &csv], PATIENCE);
    assert_eq!(exported.code, Some(0), "{}\n{}", exported.stderr, ended.stderr);
    let head = std::fs::read_to_string(&csv).expect("written");
    assert!(head.lines().next().is_some_and(|head| head.contains(",tau1_n,tau2_n,tau3_n,")), "{:.200}", head);

    let data = krait_lab::read::read(Path::new(&path), &ColumnMap::default(), Expected::Snake).expect("read");
    assert_eq!(data.load_use, LoadUse::Estimated { gain_sd: GAIN_SD }, "as the configuration states it");
    let loads_n = data.loads_n.as_ref().expect("loads");
    assert_eq!(loads_n.len(), 3 * data.n_rows());
    judge(&path, &data.time_s, loads_n, &carried);
}

/// Each load of the table is one that its line carried just before.
fn judge(path: &str, time_s: &[f64], loads_n: &[f64], carried: &Carried) {
    let recording = Recording::open(Path::new(path)).expect("readable");
    let is_row = |state: &SlaveState| state.flags & SlaveState::IS_HOMED != 0 && state.flags & SlaveState::IS_BUSY == 0;
    let begun_ns = recording
        .samples()
        .expect("samples")
        .find_map(|recorded| match recorded.expect("readable").sample {
            Sample::State(state) if is_row(&state) => Some(state.sample_ns),
            _ => None,
        })
        .expect("a row");
    let (mut pairs, mut n_other) = ([const { Vec::new() }; 3], [0; 3]);
    for (row, time_s) in time_s.iter().enumerate() {
        let now_ns = begun_ns + (time_s * 1e9) as i64;
        let end = carried.partition_point(|(at_ns, _)| *at_ns <= now_ns);
        let begin = carried.partition_point(|(at_ns, _)| *at_ns < now_ns - LATE_NS);
        let Some((_, newest)) = carried[begin..end].last() else { continue };
        for k in 0..3 {
            let found = loads_n[3 * row + k];
            let lately = carried[begin..end].iter().map(|(_, loads_n)| loads_n[k]);
            let (low, high) =
                lately.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), n| (low.min(n), high.max(n)));
            // The servo cuts its current off at a whole step, toward 0.
            n_other[k] += usize::from(!(low - 0.1 * STEP_N..=high + 1.1 * STEP_N).contains(&found));
            pairs[k].push((newest[k], found));
        }
    }
    for (k, pairs) in pairs.iter().enumerate() {
        let own = pairs.iter().map(|(was, _)| *was);
        let (low, high) = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), n| (low.min(n), high.max(n)));
        assert!(
            pairs.len() > 1000 && high - low > 10.0 * STEP_N,
            "line {}: {low} N to {high} N in {}",
            k + 1,
            pairs.len()
        );
        assert!(n_other[k] * 50 < pairs.len(), "line {}: {} of {} rows", k + 1, n_other[k], pairs.len());
        assert!(SLOPES.contains(&slope(pairs)), "line {}: {}", k + 1, slope(pairs));
        // Lines that pull are loaded negative, and none of these can push.
        assert!(pairs.iter().all(|(_, found)| *found <= 0.0), "line {}: its sign", k + 1);
    }
}
