//! Columns of torque and motion that are not what their names say: negated, of another joint, in another unit; and those that are right.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::ForceLab;
use krait_lab::{Measurements, Quantity};
use krait_model::model_file::ModelFile;

const ROWS: usize = 4000;
const STEP_S: f64 = 0.01;
/// What model files know of a joint whose torque's unit is to be told.
const WEIGHT: &str =
    "[[effect]]\nkind = \"gravity\"\nsine = { value = 1.1, se = 0.05, from = \"drawing\", date = \"2026-11-01\" }\n";

/// Angles, rad, and torques, Nm, of joints by textbook laws: joint k has inertia, weight and friction by its number.
pub(super) struct Made {
    n: usize,
    pub(super) angle_rad: Vec<f64>,
    pub(super) torque_nm: Vec<f64>,
}

pub(super) fn made(n: usize, seed: u64) -> Made {
    let mut noise = Noise(seed);
    let phases: Vec<f64> = (0..4 * n).map(|_| 3.0 * noise.normal()).collect();
    let mut own = Made { n, angle_rad: Vec::new(), torque_nm: Vec::new() };
    for row in 0..ROWS {
        let t = STEP_S * row as f64;
        for joint in 0..n {
            let (mut q, mut speed, mut acceleration) = (0.2, 0.0, 0.0);
            let faster = 1.0 + 0.23 * joint as f64;
            for (k, (hz, size)) in [(0.13, 0.7), (0.31, 0.35), (0.53, 0.2), (0.97, 0.12)].into_iter().enumerate() {
                let w = core::f64::consts::TAU * hz * faster;
                let phase = w * t + phases[4 * joint + k];
                q += size * phase.sin();
                speed += size * w * phase.cos();
                acceleration -= size * w * w * phase.sin();
            }
            let part = 1.0 - 0.3 * joint as f64;
            let torque = 0.05 * part * acceleration
                + 1.2 * part * q.sin()
                + 0.15 * speed.signum()
                + 0.08 * speed
                + 0.05
                + 0.02 * noise.normal();
            own.angle_rad.push(q + 1e-4 * noise.normal());
            own.torque_nm.push(torque);
        }
    }
    own
}

impl Made {
    /// The diagnosis of these columns, where `effects` stand in the model file; at most one effect, as columns come first.
    fn said(self, effects: &str) -> Diagnosis {
        let options = DiagnoseOptions { max_effects: 1, ..DiagnoseOptions::default() };
        self.diagnosed(effects, &options)
    }

    /// The diagnosis of these columns, where `effects` stand in the model file.
    pub(super) fn diagnosed(self, effects: &str, options: &DiagnoseOptions) -> Diagnosis {
        let (machine, data) = self.filtered(effects);
        diagnose(&machine, &data, options).expect("computed")
    }

    /// The machine, where `effects` stand in its model file, and its measurements.
    pub(super) fn filtered(self, effects: &str) -> (ForceLab, Measurements) {
        let model = format!("format = 1\n[machine]\nkind = \"force\"\nn = {}\nunit = \"Nm\"\n{effects}", self.n);
        let machine = ForceLab::new(&ModelFile::parse(&model).expect("a model")).expect("of kind force");
        let time_s = (0..ROWS).map(|row| STEP_S * row as f64).collect();
        let (angles, torques) = ((self.angle_rad, self.n), (self.torque_nm, self.n));
        let data = Measurements::bare("made.csv".to_owned(), Quantity::Force, time_s, angles, torques);
        let data = machine.filtered(data).expect("it moves");
        (machine, data)
    }

    fn with_angles(mut self, factor: f64) -> Self {
        self.angle_rad.iter_mut().for_each(|q| *q *= factor);
        self
    }

    fn with_torques(mut self, factor: f64) -> Self {
        self.torque_nm.iter_mut().for_each(|torque| *torque *= factor);
        self
    }
}

fn is_said(found: &Diagnosis, words: &str) {
    assert!(found.sentence.contains(words), "{words:?} in: {}", found.sentence);
    assert!(found.verdict == Verdict::Unknown && found.effects.is_empty(), "{}", found.sentence);
}

#[test]
fn a_negated_torque_or_angle_is_said() {
    for seed in [1, 2] {
        is_said(&made(1, seed).with_torques(-1.0).said(""), "tau1 is probably negated, or q1 is");
        is_said(&made(1, seed).with_angles(-1.0).said(""), "tau1 is probably negated, or q1 is");
        is_said(&made(1, seed).with_torques(-1.0).said(WEIGHT), "tau1 is probably negated, or q1 is");
    }
    is_said(&made(2, 3).with_torques(-1.0).said(""), "tau1 and tau2 are probably negated, or q1 and q2 are");
    // One of two.
    let mut one = made(2, 4);
    one.torque_nm.iter_mut().skip(1).step_by(2).for_each(|torque| *torque = -*torque);
    let found = one.said("");
    is_said(&found, "tau2 is probably negated, or q2 is");
    assert!(!found.sentence.contains("tau1"), "{}", found.sentence);
}

#[test]
fn the_torque_of_another_joint_is_said() {
    let mut two = made(2, 5);
    two.torque_nm.chunks_mut(2).for_each(|row| row.swap(0, 1));
    is_said(&two.said(""), "tau1 and tau2 are probably exchanged, or q1 and q2 are");
    let mut ring = made(3, 6);
    ring.torque_nm.chunks_mut(3).for_each(|row| row.rotate_left(1));
    let found = ring.said("");
    for words in ["tau1 probably belongs to q2", "tau2 probably belongs to q3", "tau3 probably belongs to q1"] {
        is_said(&found, words);
    }
}

#[test]
fn an_angle_in_another_unit_is_said_where_the_weight_shows_it() {
    let degrees = 180.0 / core::f64::consts::PI;
    is_said(&made(1, 7).with_angles(degrees).said(""), "q1 is probably in degrees where radians are expected");
    is_said(&made(2, 8).with_angles(degrees).said(""), "q1 and q2 are probably in degrees where radians are expected");
    let radians = made(1, 9).with_angles(degrees.recip());
    is_said(&radians.said(""), "q1 is probably in radians where degrees are expected");
}

#[test]
fn a_torque_in_another_unit_is_said_where_the_file_knows_its_size() {
    for (factor, words) in [(1e3, "in mNm where Nm is expected"), (1e-3, "in kNm where Nm is expected")] {
        is_said(&made(1, 10).with_torques(factor).said(WEIGHT), words);
        let held = "[[effect]]\nkind = \"inertia\"\ninertia = 0.05\n[[effect]]\nkind = \"gravity\"\nsine = 1.2\n";
        is_said(&made(1, 11).with_torques(factor).said(held), words);
        // Nothing knows how much a joint weighs.
        let found = made(1, 12).with_torques(factor).said("");
        assert!(!found.sentence.contains("columns first"), "{}", found.sentence);
    }
}

#[test]
fn nothing_is_said_of_columns_that_are_right() {
    let friction = "[[effect]]\nkind = \"coulomb\"\ntorque = 0.3\n";
    for seed in 20..26 {
        for (n, effects) in [(1, ""), (2, ""), (1, WEIGHT), (2, friction)] {
            let found = made(n, seed).said(effects);
            assert!(
                !found.sentence.contains("columns first"),
                "{n} joints, {effects:?}, seed {seed}: {}",
                found.sentence
            );
        }
    }
}

/// Torque of a joint at an angle, in a row.
type Part = fn(f64, usize) -> f64;

/// What no plain joint has: a spring, cogging, dry friction that rises with the way, noise alone.
#[test]
fn nothing_is_said_of_right_columns_of_joints_that_are_not_plain() {
    let parts: [(&str, Part); 4] = [
        ("spring", |q, _| 2.0 * q),
        ("cogging", |q, _| 0.4 * (30.0 * q).sin()),
        ("steps", |_, row| if row > ROWS / 2 { 1.0 } else { 0.0 }),
        ("hard spring", |q, _| 3.0 * q.powi(3) + q * q),
    ];
    for (what, part) in parts {
        for seed in [31, 32] {
            let mut own = made(1, seed);
            for row in 0..ROWS {
                own.torque_nm[row] += part(own.angle_rad[row], row);
            }
            let found = own.said("");
            assert!(!found.sentence.contains("columns first"), "{what}, seed {seed}: {}", found.sentence);
        }
    }
    let mut noise = Noise(33);
    let mut own = made(2, 33);
    own.torque_nm.iter_mut().for_each(|torque| *torque = 0.1 * noise.normal());
    let found = own.said("");
    assert!(!found.sentence.contains("columns first"), "{}", found.sentence);
}
