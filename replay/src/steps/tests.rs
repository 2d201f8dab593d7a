//! Steps of the shipped recording, whole and with messages taken out of it.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use super::*;
use crate::{Compensate, Resolve};
use krait_record::{About, Recording, RecordingWriter};
use krait_schema::Sample;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Samples of input in the shipped recording.
const N_STEPS: u64 = 790;

/// A recording in the temporary folder, removed at the end.
struct File(PathBuf);

impl Drop for File {
    fn drop(&mut self) {
        let _gone_is_fine = std::fs::remove_file(&self.0);
    }
}

fn shipped() -> Vec<Sample> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/recordings/flick.mcap"));
    let samples = Recording::open(path).expect("readable").samples().expect("samples");
    samples.map(|recorded| recorded.expect("readable").sample).collect()
}

fn file(name: &str, samples: impl IntoIterator<Item = Sample>) -> File {
    let path = std::env::temp_dir().join(format!("krait-steps-{name}-{}.mcap", std::process::id()));
    let mut writer =
        RecordingWriter::create(&path, 1 << 16, &About::run("steps", &BTreeMap::new(), Vec::new())).expect("created");
    for sample in samples {
        writer.write(&sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");
    File(path)
}

/// The recording as if `compensate` had refused some setpoints, by their sequence numbers.
fn refusing(refused: impl Fn(u64) -> bool) -> impl Iterator<Item = Sample> {
    let mut n_commands = 0;
    shipped().into_iter().filter_map(move |sample| match sample {
        Sample::Command(command) if refused(command.setpoint_sequence) => None,
        Sample::Command(command) => {
            n_commands += 1;
            Some(Sample::Command(Command { sequence: n_commands, ..command }))
        }
        other => Some(other),
    })
}

/// Every step of a run.
fn run_of<S: Stage>(file: &File, run: u64) -> Result<Vec<Step<S>>, ReplayError> {
    let mut window = Window::open(&file.0, S::CHANNELS)?;
    for before in 1..run {
        all_of(&mut Steps::<S>::of(&mut window, before)?.expect("a run"))?;
    }
    all_of(&mut Steps::of(&mut window, run)?.expect("a run"))
}

fn all_of<S: Stage>(steps: &mut Steps<'_, S>) -> Result<Vec<Step<S>>, ReplayError> {
    let mut all = Vec::new();
    while let Some(step) = steps.pop()? {
        all.push(step);
    }
    Ok(all)
}

#[test]
fn every_step_has_what_it_rests_on_and_no_more_is_held_than_needed() {
    let file = file("whole", shipped());
    let mut window = Window::open(&file.0, Compensate::CHANNELS).expect("readable");
    let mut steps = Steps::<Compensate>::of(&mut window, 1).expect("whole").expect("a run");
    let (mut most_held, mut n) = (0, 0);
    while let Some(step) = steps.pop().expect("whole") {
        n += 1;
        assert_eq!((step.output.sequence, step.input.1.sequence), (n, step.output.setpoint_sequence));
        assert!(step.state.is_none_or(|(_, state)| state.sequence == step.output.state_sequence));
        most_held = most_held.max(steps.window.states.len() + steps.window.setpoints.len());
    }
    assert_eq!(n, N_STEPS);
    assert!(most_held < 300, "{most_held} messages held");
    assert_eq!(run_of::<Resolve>(&file, 1).expect("whole").len() as u64, N_STEPS);
}

/// The slave, and with it its numbers, as if it had been started again after 300 states.
fn with_a_new_slave() -> Vec<Sample> {
    let renumber = |sequence: &mut u64| *sequence -= if *sequence > 300 { 300 } else { 0 };
    let mut samples = shipped();
    for sample in &mut samples {
        match sample {
            Sample::State(state) => renumber(&mut state.sequence),
            Sample::Setpoint(setpoint) => renumber(&mut setpoint.state_sequence),
            Sample::Command(command) => renumber(&mut command.state_sequence),
            _ => {}
        }
    }
    samples
}

#[test]
fn of_two_states_with_one_number_the_one_that_was_meant_is_found() {
    fn instants<S: Stage>(samples: Vec<Sample>, name: &str) -> (Vec<i64>, Vec<u64>) {
        let steps = run_of::<S>(&file(name, samples), 1).expect("whole");
        let known = steps.iter().filter_map(|step| step.state);
        known.map(|(run, state)| (state.sample_ns, run)).unzip()
    }
    let (was, is) = (instants::<Resolve>(shipped(), "was"), instants::<Resolve>(with_a_new_slave(), "is"));
    assert_eq!(was.0, is.0);
    assert!(was.1.iter().all(|run| *run == 1) && is.1.contains(&2), "{:?}", is.1);
    let (was, is) = (instants::<Compensate>(shipped(), "was"), instants::<Compensate>(with_a_new_slave(), "is"));
    assert_eq!(was.0, is.0);
}

#[test]
fn setpoints_that_compensate_refused_are_left_out() {
    let file = file("refused", refusing(|n| (300..400).contains(&n)));
    let taken: Vec<u64> =
        run_of::<Compensate>(&file, 1).expect("whole").iter().map(|step| step.input.1.sequence).collect();
    assert_eq!(taken, (1..300).chain(400..=N_STEPS).collect::<Vec<_>>());
}

#[test]
fn what_is_missing_is_named() {
    let without = |gone: fn(&Sample) -> bool| shipped().into_iter().filter(move |sample| !gone(sample));
    let found = file("input", without(|s| matches!(s, Sample::Input(m) if m.sequence == 300)));
    let error = run_of::<Resolve>(&found, 1).err();
    assert!(
        matches!(error, Some(ReplayError::Missing { sequence: 300, channel: "input", is_behind_end: false })),
        "{error:?}"
    );
    let found = file("setpoint", without(|s| matches!(s, Sample::Setpoint(m) if m.sequence == 300)));
    let error = run_of::<Resolve>(&found, 1).err();
    assert!(matches!(error, Some(ReplayError::Gap { channel: "setpoint", expected: 300, found: 301 })), "{error:?}");
    let error = run_of::<Compensate>(&found, 1).err();
    assert!(
        matches!(error, Some(ReplayError::Missing { sequence: 300, channel: "setpoint", is_behind_end: false })),
        "{error:?}"
    );
}

#[test]
fn a_recording_that_was_cut_is_repeated_as_far_as_it_goes() {
    let lack = |sample: &Sample| matches!(sample, Sample::State(m) if m.sequence > 300);
    let file = file("cut", shipped().into_iter().filter(|sample| !lack(sample)));
    let mut window = Window::open(&file.0, Compensate::CHANNELS).expect("readable");
    let mut steps = Steps::<Compensate>::of(&mut window, 1).expect("cut").expect("a run");
    let all = all_of(&mut steps).expect("no error");
    assert!(all.iter().all(|step| step.output.state_sequence <= 300) && all.len() > 200, "{} steps", all.len());
    assert_eq!(all.len() as u64 + steps.n_behind_end(), N_STEPS);
}

/// The same chain a minute later, as far as the steps of `resolve` go.
fn a_minute_later() -> Vec<Sample> {
    const MINUTE_NS: i64 = 60_000_000_000;
    let mut samples = shipped();
    for sample in &mut samples {
        match sample {
            Sample::Input(input) => input.sample_ns += MINUTE_NS,
            Sample::State(state) => state.sample_ns += MINUTE_NS,
            Sample::Setpoint(setpoint) => {
                setpoint.sample_ns += MINUTE_NS;
                setpoint.stamps.setpoint_sent_ns += MINUTE_NS;
            }
            _ => {}
        }
    }
    samples
}

#[test]
fn runs_follow_one_another() {
    let file = file("runs", [shipped(), a_minute_later()].concat());
    for run in 1..=2 {
        assert_eq!(run_of::<Resolve>(&file, run).expect("whole").len() as u64, N_STEPS);
    }
    let mut window = Window::open(&file.0, Resolve::CHANNELS).expect("readable");
    assert!(Steps::<Resolve>::of(&mut window, 3).expect("whole").is_none());
}
