//! The cycles of a bus in a recording: whole, with the failure, and enough to run the slave again; also where the file holds nonsense.

use super::PATIENCE;
use krait_drives::ServoMake;
use krait_record::{About, Recording, RecordingWriter};
use krait_schema::{Channel, Sample};
use krait_slave::{ActuatorConfig, DriveConfig, DriveKind, SlaveConfig};
use krait_tests::{Ended, TempFolder};
use std::collections::BTreeMap;
use std::path::Path;

/// Every cycle of the bus is in the recording, the failure too, and the slave wants the same of it when it is run again.
pub fn are_whole_and_repeat_the_slave(make: ServoMake, path: &str, folder: &TempFolder, config: &str) {
    let recording = Recording::open(Path::new(path)).expect("readable");
    let cycles: Vec<_> = recording
        .samples()
        .expect("samples")
        .filter_map(|recorded| match recorded.expect("readable").sample {
            Sample::DriveCycle(cycle) => Some(cycle),
            _ => None,
        })
        .collect();
    let numbers: Vec<(u64, u64)> = cycles.iter().map(|cycle| (cycle.sequence, cycle.cycle)).collect();
    assert_eq!(numbers, (0..cycles.len() as u64).map(|k| (k + 1, k)).collect::<Vec<_>>(), "no gap");
    let failed: Vec<_> = cycles.iter().filter(|cycle| cycle.failure != 0).collect();
    assert!(!failed.is_empty() && failed.iter().all(|cycle| (cycle.failure, cycle.failure_actuator) == (1, 2)));

    let again = |more: &[&str]| Ended::of(&[&["replay", path, "--slave", "recorded"], more].concat(), PATIENCE);
    let same = again(&["--json"]);
    let found = same.json();
    let number = |key: &str| found[key].as_u64().expect("a number");
    assert_eq!((number("cycles_missing"), number("steps_without_cause")), (0, 0), "{found}");
    assert!(number("cycles") + 2 >= cycles.len() as u64 - 1 && number("cycles_failed") > 10, "{found}");
    // An instant that no state tells, or an answer at the very moment of a look, may come out otherwise for a cycle.
    let few = 2 + number("cycles") / 100;
    assert!(number("wishes_differ") <= few && number("goals_differ") <= few, "{found}");
    assert!(number("judged_otherwise") <= few && number("setpoints_differ") <= 2 + number("steps") / 100, "{found}");
    assert_eq!(same.code, Some(i32::from(!found["first_difference"].is_null())), "{found}");

    // Another rate is other wishes; what does not belong to it is refused.
    let slower = folder.file("slower.toml");
    let text =
        std::fs::read_to_string(config).expect("written").replace("rate_m_per_s = 0.01", "rate_m_per_s = 0.0005");
    std::fs::write(&slower, text).expect("written");
    let other = again(&["--replace", "slave", "--config", &slower]);
    assert!(other.code == Some(1) && other.stdout.contains("wish_q_m"), "{} {}", other.stdout, other.stderr);
    assert!(again(&["--engage"]).sentence().contains("--engage has no place there"));
    assert!(again(&["--pass", "7"]).sentence().contains("--pass 7"));
    let simulated = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/flick.mcap");
    let refused = Ended::of(&["replay", simulated, "--slave", "recorded"], PATIENCE);
    assert!(refused.sentence().contains("holds no cycles of a bus"), "{}", refused.stderr);
    whatever_a_recording_holds_is_survived(make, path, folder);
}

/// Numbers that no slave writes, put into the recorded messages one at a time: the run is refused, or repeated with differences.
fn whatever_a_recording_holds_is_survived(make: ServoMake, path: &str, folder: &TempFolder) {
    let kept = |sample: &Sample| {
        matches!(sample.channel(), Channel::Command | Channel::State | Channel::StateCommand | Channel::DriveCycle)
    };
    let recording = Recording::open(Path::new(path)).expect("readable");
    let samples = recording.samples().expect("samples").map(|recorded| recorded.expect("readable").sample);
    // Power, the first motion and some of the rest.
    let samples: Vec<Sample> = samples.filter(kept).take(6000).collect();
    // As configured above.
    let actuator = |id| ActuatorConfig { id, zero_count: Some(2048), ..ActuatorConfig::default() };
    let drive = DriveConfig {
        kind: if make == ServoMake::Xl330 { DriveKind::Xl330 } else { DriveKind::Sts3215 },
        period_ms: 20.0,
        timeout_ms: 18.0,
        lost_cycles: 20,
        wish_ms: 900.0,
        actuator: (1..=3).map(actuator).collect(),
        ..DriveConfig::default()
    };
    let mut config = SlaveConfig { drive, ..SlaveConfig::default() };
    (config.limits.rate_m_per_s, config.limits.following_error_m) = (0.01, 0.003);
    (config.limits.pull_n, config.limits.push_n) = (f64::INFINITY, f64::INFINITY);
    let setup = krait_drives::setup_of(&config).expect("servos");
    let broken = Path::new(&folder.file("broken.mcap")).to_owned();
    let again = |samples: &[Sample]| {
        std::fs::remove_file(&broken).ok();
        let about = About::run("broken", &BTreeMap::new(), Vec::new());
        let mut writer = RecordingWriter::create(&broken, 64 * 1024, &about).expect("created");
        for sample in samples {
            writer.write(sample, sample.sample_ns()).expect("written");
        }
        writer.finish(&BTreeMap::new()).expect("finished");
        krait_replay::repeat_slave(&broken, 1, &config, &setup)
    };
    assert!(again(&samples).expect("sound").cycles.n_cycles > 20);
    type Break = fn(&mut Sample, u64);
    let breaks: [Break; 6] = [
        |sample, word| {
            if let Sample::DriveCycle(cycle) = sample {
                (cycle.cycle, cycle.turn, cycle.flags, cycle.failure_text) = (word, word, word as u32, word as u32);
            }
        },
        |sample, word| {
            if let Sample::DriveCycle(cycle) = sample {
                (cycle.sample_ns, cycle.answered_ns, cycle.wish_ns) = (word as i64, -(word as i64 / 2), word as i64);
            }
        },
        |sample, word| {
            if let Sample::DriveCycle(cycle) = sample {
                let own = &mut cycle.actuators[(word % 3) as usize];
                (own.counts, own.goal_counts, own.told_counts) = (word as i32, word as i32, !word as i32);
                (own.n_boots, own.trouble, own.trouble_code) = (word as u32, word as u32, word as u32);
                (own.sampled_ns, own.current_a, own.torque_nm) = (word as i64, f64::from_bits(word), f64::NAN);
            }
        },
        |sample, word| {
            if let Sample::State(state) = sample {
                (state.n_commands, state.n_stops, state.command_sequence) = (word, word as u32, word);
                (state.state_command_sequence, state.operating_state) = (word, word as u32);
            }
        },
        |sample, word| {
            if let Sample::State(state) = sample {
                (state.sample_ns, state.setpoint_ns, state.stamps.slave_begun_ns) =
                    (word as i64, word as i64, word as i64);
            }
        },
        |sample, word| {
            if let Sample::Command(command) = sample {
                (command.sample_ns, command.stamps.command_sent_ns) = (word as i64, word as i64);
                command.q_tilde_m[0] = f64::from_bits(word);
            }
        },
    ];
    for word in [0, u64::MAX, i64::MAX as u64, i64::MAX as u64 / 2, 1 << 63, 0x7ff0_0000_0000_0000, 4096] {
        for break_it in breaks {
            let mut broken: Vec<Sample> = samples.clone();
            broken.iter_mut().skip(17).step_by(83).for_each(|sample| break_it(sample, word));
            // Whether it is refused or repeated, nothing panics and it ends.
            let _either = again(&broken).map_err(|refused| refused.to_string());
        }
    }
}
