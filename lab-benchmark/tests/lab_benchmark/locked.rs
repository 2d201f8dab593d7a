//! The error on a part that no choice has seen: it is that of a model which has not seen the part, and says so where there is none.

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, LockedPart, Verdict, diagnose};
use krait_lab::machine::{ForceLab, JointsLab, MachineUnderTest, SnakeLab};
use krait_lab::{LabError, Measurements};
use krait_lab_benchmark::force::{FORCE_MODEL, ForceKind, ForceRecipe, force};
use krait_lab_benchmark::generate::{Kind, Motion, Recipe, base_model, generate};
use krait_lab_benchmark::joints::{JOINTS_MODEL, JointKind, JointRecipe, joints};
use krait_model::model_file::ModelFile;

fn locked(machine: &dyn MachineUnderTest, data: &Measurements) -> Result<Diagnosis, LabError> {
    diagnose(machine, data, &DiagnoseOptions { max_effects: 2, is_locked: true, ..DiagnoseOptions::default() })
}

fn snake() -> (SnakeLab, Measurements) {
    let hidden = vec![(Kind::from_name("encoder-scale").unwrap(), 2.0)];
    let recipe = Recipe { hidden, motion: Motion::Rich, seconds: 60.0, seed: 11, ..Recipe::default() };
    let made = generate(&recipe).unwrap();
    (SnakeLab::new(&ModelFile::parse(&base_model()).unwrap()).unwrap(), made.measurements)
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn the_last_fifth_of_a_snake_s_only_trial_is_predicted_by_a_model_that_has_not_seen_it() {
    let (machine, data) = snake();
    let found = locked(&machine, &data).unwrap();
    let own = found.locked.clone().unwrap();
    assert_eq!(
        (own.part, own.verdict, own.effects.as_slice()),
        (LockedPart::Fifth, Verdict::Missing, &["encoder-scale".to_owned()][..])
    );
    let n_scored = (0..data.n_rows()).filter(|row| data.is_scored(*row)).count();
    assert!((n_scored / 6..=n_scored / 5).contains(&own.n_rows), "{} of {n_scored}", own.n_rows);
    let floor = found.noise_floor.unwrap();
    assert!(own.rms < 1.1 * floor && own.base_rms > 1.5 * floor, "{own:?}, floor {floor}");

    // Whatever the part holds, the model is the same: here a camera that was pushed, in a trial of its own.
    let mut pushed = data.clone();
    let first = data.n_rows() - data.n_rows() / 5;
    pushed.trial[first..].fill(1);
    pushed.outputs.iter_mut().skip(first * data.n_outputs).for_each(|y| *y += 0.05);
    let there = locked(&machine, &pushed).unwrap().locked.unwrap();
    assert_eq!((there.verdict, &there.effects), (own.verdict, &own.effects));
    let expected = (own.rms.powi(2) + 2.0 * 0.05_f64.to_degrees().powi(2)).sqrt();
    assert!((there.rms / expected - 1.0).abs() < 0.05, "{} deg, expected {expected}", there.rms);
}

#[test]
fn of_two_trials_the_last_one_is_locked_and_begins_where_its_first_part_says() {
    let file = ModelFile::parse(JOINTS_MODEL).unwrap();
    let machine = JointsLab::new(&file).unwrap();
    let hidden = vec![(JointKind::from_name("play").unwrap(), 4.0)];
    let (mut data, _) = joints(&JointRecipe { hidden, seconds: 80.0, seed: 21, ..JointRecipe::default() }).unwrap();
    // The second trial begins in the middle of a motion, wherever the play stands then.
    let middle = 5 * data.n_rows() / 9;
    data.trial[middle..].fill(1);
    let found = locked(&machine, &data).unwrap();
    let own = found.locked.unwrap();
    assert_eq!(
        (own.part, own.verdict, own.effects.as_slice()),
        (LockedPart::Trial, Verdict::Missing, &["backlash".to_owned()][..])
    );
    let floor = found.noise_floor.unwrap();
    assert!(own.rms < 1.15 * floor && own.base_rms > 1.5 * floor, "{own:?}, floor {floor}");
}

#[test]
fn the_last_fifth_of_a_torque_is_predicted_by_a_model_that_has_not_seen_it() {
    let machine = ForceLab::new(&ModelFile::parse(FORCE_MODEL).unwrap()).unwrap();
    let hidden = vec![(ForceKind::from_name("dry").unwrap(), 4.0)];
    let (data, ..) = force(&ForceRecipe { hidden, seed: 5, ..ForceRecipe::default() }).unwrap();
    let data = machine.filtered(data).unwrap();
    let found = locked(&machine, &data).unwrap();
    let own = found.locked.clone().unwrap();
    assert_eq!(
        (own.part, own.verdict, own.effects.len()),
        (LockedPart::Fifth, found.verdict, found.effects.len()),
        "{own:?}"
    );
    let floor = found.noise_floor.unwrap();
    assert!(own.rms < 1.15 * floor && own.base_rms > 2.0 * floor, "{own:?}, floor {floor}");

    // A torque that goes up and down from row to row there is no part of the model, and all of its error.
    let mut shaken = data.clone();
    let first = data.n_rows() - data.n_rows() / 5;
    let by = 3.0 * floor;
    shaken.trial[first..].fill(1);
    shaken
        .outputs
        .chunks_mut(2)
        .skip(first / 2)
        .flat_map(|pair| pair.iter_mut().zip([by, -by]))
        .for_each(|(y, by)| *y += by);
    let there = locked(&machine, &shaken).unwrap().locked.unwrap();
    assert_eq!((there.verdict, &there.effects), (own.verdict, &own.effects));
    assert!((there.rms / own.rms.hypot(by) - 1.0).abs() < 0.1, "{} beside {}", there.rms, own.rms.hypot(by));
}

#[test]
fn nothing_is_locked_that_was_not_asked_for_or_is_too_short() {
    let (machine, data) = snake();
    let short = data.select(&(0..60).collect::<Vec<_>>());
    assert_eq!(locked(&machine, &short).unwrap().locked, None, "too short");
    let options = DiagnoseOptions { max_effects: 1, ..DiagnoseOptions::default() };
    assert_eq!(diagnose(&machine, &short, &options).unwrap().locked, None, "not asked for");
}

#[test]
fn of_several_recordings_the_last_is_locked_and_has_a_gain_and_an_offset_of_its_own() {
    let file = ModelFile::parse(JOINTS_MODEL).unwrap();
    let machine = JointsLab::new(&file).unwrap();
    let hidden = || vec![(JointKind::from_name("play").unwrap(), 4.0)];
    let (mut data, _) =
        joints(&JointRecipe { hidden: hidden(), seconds: 120.0, seed: 22, ..JointRecipe::default() }).unwrap();
    // Three recordings; the sensor of the last one was mounted anew.
    let third = data.n_rows() / 3;
    for (row, trial) in data.trial.iter_mut().enumerate() {
        *trial = (row / third).min(2) as u32;
    }
    data.outputs.iter_mut().skip(2 * third * data.n_outputs).for_each(|y| *y = 0.8 * *y + 0.3);
    let recordings: Vec<(String, usize)> =
        ["a", "b", "c"].into_iter().zip(0..).map(|(name, k)| (name.to_owned(), k)).collect();
    let options = DiagnoseOptions { max_effects: 2, is_locked: true, recordings, ..DiagnoseOptions::default() };
    let found = diagnose(&machine, &data, &options).unwrap();
    let own = found.locked.clone().unwrap();
    assert_eq!(
        (own.part, own.verdict, own.effects.as_slice()),
        (LockedPart::Recording, Verdict::Missing, &["backlash".to_owned()][..])
    );
    let floor = found.noise_floor.unwrap();
    assert!(own.rms < 1.15 * floor && own.base_rms > 1.5 * floor, "{own:?}, floor {floor}");
    // Two thirds of a third of the rows.
    assert!((data.n_rows() / 5..data.n_rows() / 4).contains(&own.n_rows), "{} of {}", own.n_rows, data.n_rows());

    // What it holds changes nothing that was found without it.
    let mut shaken = data.clone();
    for (row, outputs) in shaken.outputs.chunks_mut(data.n_outputs).enumerate().skip(5 * data.n_rows() / 6) {
        let by = if row % 2 == 0 { 0.05 } else { -0.05 };
        outputs.iter_mut().for_each(|y| *y += by);
    }
    let there = diagnose(&machine, &shaken, &options).unwrap().locked.unwrap();
    assert_eq!((there.verdict, &there.effects), (own.verdict, &own.effects));
    assert!(there.rms > 1.5 * own.rms, "{there:?} beside {own:?}");
}
