//! What a fit without a model leaves is told where something remains, and says how much can be explained.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::machine_of;
use krait_lab::{Measurements, Quantity};
use krait_model::model_file::ModelFile;

const NOISE_DEG: f64 = 0.1;

/// 80 s of a joint, whose position has something of its own beside the command.
fn diagnosed(own: impl Fn(f64, f64) -> f64) -> Diagnosis {
    let text = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\nu_unit = \"deg\"\ny_unit = \"deg\"\n";
    let machine = machine_of(&ModelFile::parse(text).unwrap()).unwrap();
    let mut noise = Noise(3);
    let time_s: Vec<f64> = (0..4000).map(|k| f64::from(k) / 50.0).collect();
    let u = |t: f64| 20.0 * (0.7 * t).sin() + 9.0 * (1.9 * t + 0.4).sin();
    let speed = |t: f64| (u(t + 0.01) - u(t - 0.01)) / 0.02;
    let inputs = time_s.iter().map(|t| u(*t)).collect();
    let outputs = time_s.iter().map(|t| u(*t) + own(u(*t), speed(*t)) + NOISE_DEG * noise.normal()).collect();
    let data = Measurements::bare("made".to_owned(), Quantity::Joints, time_s, (inputs, 1), (outputs, 1));
    diagnose(machine.as_ref(), &data, &DiagnoseOptions::default()).unwrap()
}

#[test]
fn what_no_effect_makes_can_be_explained_without_a_model_and_that_is_told() {
    // Two bumps of the way, each in one direction.
    let bump = |u: f64, at: f64| 2.0 * (-((u - at) / 3.0).powi(2)).exp();
    let found = diagnosed(|u, speed| if speed > 0.0 { bump(u, 10.0) } else { -bump(u, -8.0) });
    assert!(matches!(found.verdict, Verdict::Partly | Verdict::Unknown), "{}", found.sentence);
    let left = found.model_free_rms.unwrap();
    assert!(left > NOISE_DEG, "{left} deg is less than the noise: it has seen what it is asked");
    assert!(left < 0.7 * found.final_heldout_rms, "{left} of {} deg", found.final_heldout_rms);
    assert_eq!(found.to_json()["model_free_rms_deg"].as_f64(), Some(left));
}

#[test]
fn where_nothing_remains_no_hint_is_given() {
    let found = diagnosed(|_, _| 0.0);
    assert_eq!((found.verdict, found.model_free_rms), (Verdict::None, None), "{}", found.sentence);
}
