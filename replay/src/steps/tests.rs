//! Steps of the shipped recording, whole and with messages taken out of it.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use super::*;
use krait_record::{About, Recording, RecordingWriter};
use krait_schema::Sample;
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

/// Every step of a pass, and the states in the order in which they would be sent.
fn all_of(steps: &mut Steps<'_>) -> Result<(Vec<Step>, Vec<u64>), ReplayError> {
    let (mut all, mut states) = (Vec::new(), Vec::new());
    while let Some(step) = steps.peek().copied() {
        let newest = step.cue.resolve_state_sequence.max(step.cue.compensate_state_sequence);
        while let Some(state) = steps.states.next_up_to(newest) {
            states.push(state.sequence);
        }
        steps.pop()?;
        all.push(step);
    }
    Ok((all, states))
}

fn first_pass(
    name: &str,
    samples: impl IntoIterator<Item = Sample>,
) -> Result<(Vec<Step>, Vec<u64>, usize), ReplayError> {
    let file = file(name, samples);
    let mut window = Window::open(&file.0)?;
    let mut steps = Steps::of(&mut window, 1, true)?.expect("a pass");
    let (all, states) = all_of(&mut steps)?;
    Ok((all, states, steps.n_unanswered()))
}

#[test]
fn every_step_has_what_it_rests_on_and_no_more_is_held_than_needed() {
    let file = file("whole", shipped());
    let mut window = Window::open(&file.0).expect("readable");
    let mut steps = Steps::of(&mut window, 1, true).expect("whole").expect("a pass");
    let mut most_held = 0;
    let mut n = 0;
    while let Some(step) = steps.peek().copied() {
        n += 1;
        assert_eq!(step.setpoint.sequence, n);
        assert_eq!(step.input.expect("an input").sequence, step.cue.input_sequence);
        assert_eq!(step.command.expect("a command").setpoint_sequence, n);
        steps.pop().expect("whole");
        most_held = most_held.max(steps.window.states.len() + steps.window.setpoints.len());
    }
    let n_setpoints = shipped().iter().filter(|sample| matches!(sample, Sample::Setpoint(_))).count() as u64;
    assert_eq!((n, steps.n_unanswered()), (n_setpoints, 0));
    assert!(most_held < 300, "{most_held} messages held");
}

#[test]
fn a_state_that_compensate_knew_before_resolve_is_sent_once_and_in_order() {
    let samples = shipped().into_iter().map(|sample| match sample {
        // As if `compensate` had lagged behind `resolve` by three samples.
        Sample::Command(command) if (100..700).contains(&command.sequence) => {
            Sample::Command(Command { state_sequence: command.state_sequence + 3, ..command })
        }
        other => other,
    });
    let (all, states, _) = first_pass("order", samples).expect("whole");
    assert!(states.is_sorted_by(|a, b| a < b), "each once, upwards");
    let named = all.iter().flat_map(|step| [step.cue.resolve_state_sequence, step.cue.compensate_state_sequence]);
    assert!(named.filter(|sequence| *sequence > 0).all(|sequence| states.binary_search(&sequence).is_ok()));
}

#[test]
fn a_state_that_resolve_knew_before_compensate_is_kept_for_it() {
    let samples = shipped().into_iter().map(|sample| match sample {
        Sample::Command(command) => {
            Sample::Command(Command { state_sequence: command.state_sequence.saturating_sub(3), ..command })
        }
        other => other,
    });
    let (_, states, _) = first_pass("late", samples).expect("whole");
    assert!(states.is_sorted_by(|a, b| a < b), "each once, upwards");
}

#[test]
fn setpoints_that_compensate_refused_are_steps_without_a_command() {
    let (all, _, n_unanswered) = first_pass("refused", refusing(|n| (300..304).contains(&n))).expect("whole");
    let without: Vec<u64> =
        all.iter().filter(|step| step.command.is_none()).map(|step| step.setpoint.sequence).collect();
    assert_eq!((without, n_unanswered), (vec![300, 301, 302, 303], 0));
}

#[test]
fn setpoints_at_the_end_without_commands_are_counted_and_left_out() {
    for n_answered in [600, 760] {
        let (all, _, n_unanswered) = first_pass("end", refusing(|n| n > n_answered)).expect("whole");
        assert_eq!(all.last().map(|step| step.setpoint.sequence), Some(n_answered));
        assert_eq!(n_unanswered as u64, N_STEPS - n_answered);
    }
}

#[test]
fn a_long_run_without_commands_cannot_be_repeated() {
    let error = first_pass("long", refusing(|n| (300..=364).contains(&n))).expect_err("65 of them");
    assert!(matches!(error, ReplayError::Missing { sequence: 364, channel: "command" }), "{error}");
    first_pass("short", refusing(|n| (300..=363).contains(&n))).expect("64 of them");
}

#[test]
fn what_is_missing_is_named() {
    let without = |gone: fn(&Sample) -> bool| shipped().into_iter().filter(move |sample| !gone(sample));
    let error = first_pass("input", without(|s| matches!(s, Sample::Input(m) if m.sequence == 300)));
    assert!(matches!(error, Err(ReplayError::Missing { sequence: 300, channel: "input" })), "{error:?}");
    let error = first_pass("setpoint", without(|s| matches!(s, Sample::Setpoint(m) if m.sequence == 300)));
    assert!(matches!(error, Err(ReplayError::Gap { channel: "setpoint", expected: 300, found: 301 })), "{error:?}");
    let error = first_pass("last", without(|s| matches!(s, Sample::Setpoint(m) if m.sequence == N_STEPS)));
    assert!(matches!(error, Err(ReplayError::Missing { sequence: N_STEPS, channel: "setpoint" })), "{error:?}");
}

#[test]
fn passes_follow_one_another() {
    let file = file("passes", [shipped(), shipped()].concat());
    let mut window = Window::open(&file.0).expect("readable");
    for pass in 1..=2 {
        let mut steps = Steps::of(&mut window, pass, true).expect("whole").expect("a pass");
        assert_eq!(all_of(&mut steps).expect("whole").0.len() as u64, N_STEPS);
    }
    assert!(Steps::of(&mut window, 3, true).expect("whole").is_none());
}
