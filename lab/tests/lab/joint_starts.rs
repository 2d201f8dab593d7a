//! Plays that do not begin in their middle: where they begin is fitted for every trial, wherever the model of joints has hysteresis.

use crate::noise::Noise;
use krait_lab::compare::compare;
use krait_lab::diagnose::{DiagnoseOptions, Verdict, diagnose};
use krait_lab::machine::JointsLab;
use krait_lab::{AddOptions, Measurements, Quantity, Term, add, fitted_to, save};
use krait_model::model_file::ModelFile;

const NOISE: f64 = 1e-3;
const DT_S: f64 = 0.02;

fn model(text: &str) -> (ModelFile, JointsLab) {
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"joints\"\nn = 1\n{text}")).expect("a model");
    let machine = JointsLab::new(&file).expect("joints");
    (file, machine)
}

/// Trials of a joint behind a lag (0: none) and a play that begin at these places, -1 to 1, of the play; gain 1.1, offset 0.05 rad.
fn trials(half_width: f64, lag_s: f64, starts: &[f64]) -> Measurements {
    let n = 1500;
    let mut noise = Noise(1);
    let wave = |row: usize, hz: f64| (core::f64::consts::TAU * hz * DT_S * row as f64).sin();
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for start in starts {
        let command = |row: usize| 0.3 * wave(row, 0.09) + 0.15 * wave(row, 0.31);
        let mut behind_lag = command(0);
        let mut p = behind_lag + start * half_width;
        for row in 0..n {
            let (u, before) = (command(row), command(row.saturating_sub(1)));
            // Small steps of the lag between two rows, over which the command is a ramp.
            for step in 0..50 {
                let position = before + (u - before) * (f64::from(step) + 0.5) / 50.0;
                behind_lag += (position - behind_lag) * (DT_S / 50.0 / lag_s).min(1.0);
            }
            p = p.clamp(behind_lag - half_width, behind_lag + half_width);
            inputs.push(u);
            outputs.push(1.1 * p + 0.05 + NOISE * noise.normal());
        }
    }
    let rows = n * starts.len();
    let time_s = (0..rows).map(|row| DT_S * row as f64).collect();
    let bare = Measurements::bare("made.csv".to_owned(), Quantity::Joints, time_s, (inputs, 1), (outputs, 1));
    let trial = (0..rows).map(|row| (row / n) as u32).collect();
    Measurements { trial, sha256: "5eed".repeat(16), ..bare }
}

#[test]
fn a_play_of_the_model_begins_where_the_data_say_in_every_trial() {
    let data = trials(0.05, 0.0, &[1.0, -1.0, 0.3]);
    let (_, machine) = model("[[effect]]\nkind = \"backlash\"\nhalf_width = 0.05\n");
    let found = compare(&machine, &data).expect("a chain");
    let noise_deg = NOISE.to_degrees();
    assert!(found.error.rms < 1.05 * noise_deg, "{} deg beside a noise of {noise_deg} deg", found.error.rms);
    let found = diagnose(&machine, &data, &DiagnoseOptions::default()).expect("a chain");
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    assert!(found.base_heldout_rms < 1.05 * noise_deg, "{}", found.sentence);
}

/// Where every trial began in the middle of the play, the second effect was fitted to what the first left of its start.
#[test]
fn commands_followed_one_by_one_reach_what_the_diagnosis_promised() {
    let data = trials(0.05, 0.2, &[1.0, -1.0]);
    let (mut file, bare) = model("");
    let promised = diagnose(&bare, &data, &DiagnoseOptions::default()).expect("a chain");
    assert_eq!(promised.effects.len(), 2, "{}", promised.sentence);
    assert!(promised.final_heldout_rms < 1.05 * NOISE.to_degrees(), "{}", promised.sentence);
    let mut after = f64::INFINITY;
    for effect in promised.in_chain_order() {
        let machine = JointsLab::new(&file).expect("joints");
        let n_values = 1 + effect.parameters.iter().filter(|own| own.is_free).count();
        let mut term = Term::new(&effect.name, vec![0.0; n_values]);
        term.values[0] = effect.joint.expect("a joint") as f64;
        let refit = fitted_to(&file, &data);
        let options = AddOptions { term, from_given: false, free: Vec::new(), refit, recordings: Vec::new() };
        let added = add(&machine, &data, &options).expect("a fit");
        let better = save(&file, &added, &effect.name, &data, "2026-11-26").expect("a model");
        file = ModelFile::parse(&better.to_toml()).expect("read back");
        after = added.after;
    }
    assert!(
        after < 1.05 * promised.final_heldout_rms,
        "{after} deg after, {} deg promised",
        promised.final_heldout_rms
    );
    let again = JointsLab::new(&file).expect("joints");
    let found = diagnose(&again, &data, &DiagnoseOptions::default()).expect("a chain");
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
}
