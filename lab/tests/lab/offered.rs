//! Formulas that a user offers take part in the ranking: named where they are what is missing, and not where they are not.

use crate::noise::Noise;
use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{ForceLab, JointsLab, MachineUnderTest, SegmentsLab, SnakeLab};
use krait_lab::read::{ColumnMap, read};
use krait_lab::{Measurements, Offered, Quantity, offered};
use krait_lab_benchmark::generate::{Kind, Recipe, generate};
use krait_lab_benchmark::segments::{SegmentKind, SegmentsRecipe, segments};
use krait_model::model_file::ModelFile;
use std::path::Path;

const SNAKE: &str = "format = 1\n[machine]\nkind = \"snake\"\n";
const JOINTS: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 2\n";

fn formula(name: &str, hook: &str, text: &str, params: &str) -> String {
    format!(
        "[[effect]]\nkind = \"formula\"\nname = \"{name}\"\nhook = \"{hook}\"\nformula = \"{text}\"\nparams = {{ {params} }}\n"
    )
}

fn offer(machine: &str, effects: &str) -> Vec<Offered> {
    let file = ModelFile::parse(&format!("{machine}{effects}")).expect("a model");
    offered(Path::new("own.toml"), &file, file.machine()).expect("formulas with a size")
}

fn refused(machine: &str, effects: &str) -> String {
    let file = ModelFile::parse(&format!("{machine}{effects}")).expect("a model");
    let model = ModelFile::parse(JOINTS).expect("a model");
    offered(Path::new("own.toml"), &file, model.machine()).expect_err("refused").to_string()
}

fn found(machine: &dyn MachineUnderTest, data: &Measurements, offered: Vec<Offered>, most: usize) -> Diagnosis {
    let options = DiagnoseOptions { offered, max_effects: most, ..DiagnoseOptions::default() };
    diagnose(machine, data, &options).expect("a chain")
}

fn names(diagnosis: &Diagnosis) -> Vec<(&str, Option<usize>)> {
    diagnosis.effects.iter().map(|own| (own.name.as_str(), own.joint)).collect()
}

/// Two joints with gains of their own; the second has `hidden`, a function of its command and of the sign of its motion.
fn joints(what: &str, hidden: impl Fn(f64, f64) -> f64) -> (JointsLab, Measurements) {
    let file = ModelFile::parse(JOINTS).expect("a model");
    let mut noise = Noise(11);
    let mut text = String::from("time_s,u1_rad,u2_rad,y1_rad,y2_rad\n");
    let mut last = 0.0;
    let mut motion = 0.0;
    for k in 0..3000_u32 {
        let t = f64::from(k) * 0.02;
        let (a, b) = (0.6 * (0.7 * t).sin(), 0.5 * (0.45 * t + 1.0).sin() + 0.3 * (1.3 * t).sin());
        motion = if k == 0 { 0.0 } else { f64::signum(b - last) };
        last = b;
        let (first, second) =
            (1.04 * a + 0.01 + 0.002 * noise.normal(), 0.97 * b - 0.02 + hidden(b, motion) + 0.002 * noise.normal());
        text += &format!("{t:.2},{a:.7},{b:.7},{first:.7},{second:.7}\n");
    }
    assert!(motion != 0.0, "it moves");
    let path = std::env::temp_dir().join(format!("krait-lab-offered-{}-{what}.csv", std::process::id()));
    std::fs::write(&path, text).expect("a file");
    let data = read(&path, &ColumnMap::default(), file.machine().into()).expect("measurements");
    std::fs::remove_file(&path).expect("the file goes");
    (JointsLab::new(&file).expect("joints"), data)
}

/// A bump of a width of its own around a place of its own: no effect of the library.
const BUMP: &str = "a * exp(0 - ((u_i - c) / w)^2)";

#[test]
fn a_formula_of_joints_that_is_missing_is_named_with_its_joint_and_its_values() {
    let (machine, data) = joints("bump", |u, _| 0.03 * f64::exp(-((u - 0.2) / 0.1_f64).powi(2)));
    let without = found(&machine, &data, Vec::new(), 2);
    assert_ne!(without.verdict, Verdict::Missing, "no effect of the library explains it: {}", without.sentence);

    let own = offer(JOINTS, &formula("bump", "joint", BUMP, "a = 0.01, c = 0.1, w = 0.2"));
    let diagnosis = found(&machine, &data, own, 2);
    assert_eq!(
        (diagnosis.verdict, names(&diagnosis)),
        (Verdict::Missing, vec![("bump", Some(2))]),
        "{}",
        diagnosis.sentence
    );
    for (own, truth) in diagnosis.effects[0].parameters.iter().zip([0.03, 0.2, 0.1]) {
        assert!((own.value.abs() - truth).abs() < 0.1 * truth && own.is_free && own.se > 0.0, "{own:?}, {truth}");
    }
    let candidate = diagnosis.candidates.iter().find(|own| own.name == "bump").expect("in the table");
    assert!(candidate.state.starts_with("chosen") && candidate.p_value < 0.05, "{candidate:?}");

    // What was found predicts as it was found, on its joint alone.
    let calibrated = diagnosis.calibrated.as_ref().expect("calibrated");
    let predicted = calibrated.predict(&diagnosis.terms, &data).expect("a chain");
    let rms = |joint: usize| {
        let off = |row: usize| (predicted[2 * row + joint] - data.output(row)[joint]).powi(2);
        ((0..data.n_rows()).map(off).sum::<f64>() / data.n_rows() as f64).sqrt()
    };
    assert!(rms(0) < 0.0025 && rms(1) < 0.0025, "noise of 0.002: {}, {}", rms(0), rms(1));
    let term = diagnosis.term_of(&diagnosis.effects[0]).expect("its term");
    assert!(term.formula.as_ref().is_some_and(|own| own.text.starts_with("max(1 - abs(joint - 2), 0)")), "{term:?}");
}

#[test]
fn a_formula_with_memory_of_the_direction_takes_part() {
    let (machine, data) = joints("direction", |u, motion| 0.02 * motion * (1.0 - u * u));
    let text = formula("one-way", "joint", "a * motion_i * (1 - u_i * u_i)", "a = 0.0");
    let diagnosis = found(&machine, &data, offer(JOINTS, &text), 2);
    let first = diagnosis.effects.first().unwrap_or_else(|| panic!("{}", diagnosis.sentence));
    assert_eq!((first.name.as_str(), first.joint), ("one-way", Some(2)), "{}", diagnosis.sentence);
    assert!((first.parameters[0].value / 0.02 - 1.0).abs() < 0.1, "{first:?}");
}

#[test]
fn a_formula_that_is_offered_and_not_there_is_not_named() {
    let bump = || offer(JOINTS, &formula("bump", "joint", BUMP, "a = 0.01, c = 0.1, w = 0.2"));
    let (machine, data) = joints("nothing", |_, _| 0.0);
    let diagnosis = found(&machine, &data, bump(), 3);
    assert_eq!((diagnosis.verdict, names(&diagnosis)), (Verdict::None, vec![]), "{}", diagnosis.sentence);

    let (machine, data) = joints("cubic", |u, _| 0.1 * u.powi(3));
    let diagnosis = found(&machine, &data, bump(), 3);
    assert!(names(&diagnosis).iter().all(|(name, _)| *name != "bump"), "{}", diagnosis.sentence);
    assert!(diagnosis.effects.iter().any(|own| own.class.iter().any(|name| name == "cubic")), "{}", diagnosis.sentence);
}

/// A minute of a snake; `hidden` in its model file is what it has and the base has not.
fn snake(hidden: &str) -> (SnakeLab, Measurements) {
    let file = ModelFile::parse(SNAKE).expect("a model");
    let machine = SnakeLab::new(&file).expect("a snake");
    let nothing = Recipe { hidden: Vec::new(), seconds: 60.0, seed: 5, ..Recipe::default() };
    let mut data = generate(&nothing).expect("data").measurements;
    let own = SnakeLab::new(&ModelFile::parse(&format!("{SNAKE}{hidden}")).expect("a model")).expect("a snake");
    let base = machine.predict(machine.effects(), &data).expect("a chain");
    let there = own.predict(own.effects(), &data).expect("a chain");
    data.outputs.iter_mut().zip(base.iter().zip(&there)).for_each(|(y, (base, there))| *y += there - base);
    (machine, data)
}

const SHELF: &str = "a * tanh(bend / b) * cos(2 * (delta - d0))";

#[test]
fn a_formula_of_a_snake_that_is_missing_is_named() {
    let (machine, data) = snake(&formula("shelf", "meas", SHELF, "a = 0.03, b = 0.2, d0 = 0.4"));
    let own = offer(SNAKE, &formula("shelf", "meas", SHELF, "a = 0.01, b = 0.3, d0 = 0.0"));
    let diagnosis = found(&machine, &data, own, 2);
    assert_eq!(names(&diagnosis), vec![("shelf", None)], "{}", diagnosis.sentence);
    assert!(matches!(diagnosis.verdict, Verdict::Missing | Verdict::Partly), "{}", diagnosis.sentence);
    let size = diagnosis.effects[0].parameters[0].value.abs();
    assert!((size / 0.03 - 1.0).abs() < 0.15, "{:?}", diagnosis.effects[0].parameters);
    let term = diagnosis.term_of(&diagnosis.effects[0]).expect("its term");
    assert_eq!(term.formula.as_ref().map(|own| own.text.as_str()), Some(SHELF));
}

#[test]
fn a_formula_of_a_snake_that_is_not_there_is_not_named() {
    let (machine, _) = snake("");
    let hidden = vec![(Kind::from_name("backlash").expect("a kind"), 3.0)];
    let data = generate(&Recipe { hidden, seconds: 60.0, seed: 7, ..Recipe::default() }).expect("data").measurements;
    let own = offer(SNAKE, &formula("shelf", "meas", SHELF, "a = 0.01, b = 0.3, d0 = 0.0"));
    let diagnosis = found(&machine, &data, own, 2);
    let first = diagnosis.effects.first().unwrap_or_else(|| panic!("{}", diagnosis.sentence));
    assert!(first.class.iter().any(|name| name == "backlash"), "{}", diagnosis.sentence);
    assert!(names(&diagnosis).iter().all(|(name, _)| *name != "shelf"), "{}", diagnosis.sentence);
}

/// A minute of two segments with these effects of the library hidden; `own` in its model file is what it has beside them.
fn two_segments(hidden: &[&str], own: &str, seed: u64) -> (SegmentsLab, String, Measurements) {
    let kind = |name: &&str| (SegmentKind::from_name(name, 2).expect("a kind"), 2.0);
    let hidden = hidden.iter().map(kind).collect();
    let made = segments(&SegmentsRecipe { hidden, seconds: 60.0, seed, ..SegmentsRecipe::default() }).expect("data");
    let lab = |text: &str| SegmentsLab::new(&ModelFile::parse(text).expect("a model")).expect("segments");
    let (machine, there) = (lab(&made.model), lab(&format!("{}\n{own}", made.model)));
    let mut data = made.measurements;
    let base = machine.predict(machine.effects(), &data).expect("a chain");
    let there = there.predict(there.effects(), &data).expect("a chain");
    data.outputs.iter_mut().zip(base.iter().zip(&there)).for_each(|(y, (base, there))| *y += there - base);
    (machine, made.model, data)
}

/// The bend of segment 2 sags towards one side, the more the farther it bends.
const SAG: &str = "a * max(1 - abs(segment - 2), 0) * (1 - axis) * bend^2 / (bend + c)";

#[test]
fn a_formula_of_segments_that_is_missing_is_named_and_one_that_is_not_there_is_not() {
    let own = |params: &str| formula("sag", "meas", SAG, params);
    let (machine, model, data) = two_segments(&[], &own("a = 0.08, c = 0.2"), 3);
    let found_one = found(&machine, &data, offer(&model, &own("a = 0.01, c = 0.3")), 2);
    assert_eq!(names(&found_one), vec![("sag", None)], "{}", found_one.sentence);
    assert!(matches!(found_one.verdict, Verdict::Missing | Verdict::Partly), "{}", found_one.sentence);
    let size = &found_one.effects[0].parameters[0];
    assert!((size.value - 0.08).abs() < 3.0 * size.se + 0.02 * 0.08, "{size:?}");

    let (machine, model, data) = two_segments(&[], "", 4);
    let nothing = found(&machine, &data, offer(&model, &own("a = 0.01, c = 0.3")), 2);
    assert!(names(&nothing).is_empty(), "{}", nothing.sentence);

    let (machine, model, data) = two_segments(&["backlash-2"], "", 5);
    let play = found(&machine, &data, offer(&model, &own("a = 0.01, c = 0.3")), 2);
    let first = play.effects.first().unwrap_or_else(|| panic!("{}", play.sentence));
    assert!(first.class.iter().any(|name| name == "backlash-2"), "{}", play.sentence);
    assert!(names(&play).iter().all(|(name, _)| *name != "sag"), "{}", play.sentence);
}

const FORCE: &str = "format = 1\n[machine]\nkind = \"force\"\nn = 1\nunit = \"Nm\"\n";

/// A minute of a joint with inertia, weight, dry and viscous friction and what is `hidden` of its angle and speed.
fn force(seed: u64, hidden: impl Fn(f64, f64) -> f64) -> (ForceLab, Measurements) {
    let machine = ForceLab::new(&ModelFile::parse(FORCE).expect("a model")).expect("of kind force");
    let mut noise = Noise(seed);
    let phases: Vec<f64> = (0..4).map(|_| 3.0 * noise.normal()).collect();
    let (mut time_s, mut angles, mut torques) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..8000 {
        let t = 0.01 * f64::from(row);
        let (mut q, mut speed, mut acceleration) = (0.0, 0.0, 0.0);
        for ((hz, size), phase) in [(0.13, 0.7), (0.31, 0.35), (0.53, 0.2), (0.97, 0.12)].into_iter().zip(&phases) {
            let w = core::f64::consts::TAU * hz;
            q += size * (w * t + phase).sin();
            speed += size * w * (w * t + phase).cos();
            acceleration -= size * w * w * (w * t + phase).sin();
        }
        let plain = 0.05 * acceleration + 1.2 * q.sin() + 0.15 * speed.signum() + 0.08 * speed;
        time_s.push(t);
        angles.push(q + 1e-4 * noise.normal());
        torques.push(plain + hidden(q, speed) + 0.05 + 0.02 * noise.normal());
    }
    let data = Measurements::bare("made.csv".to_owned(), Quantity::Force, time_s, (angles, 1), (torques, 1));
    let data = machine.filtered(data).expect("it moves");
    (machine, data)
}

/// Rubbing around one place of the way: dry friction there and nowhere else.
const RUB: &str = "a * motion_i * exp(0 - ((angle_i - c) / w)^2)";

#[test]
fn a_formula_of_force_that_is_missing_is_named_and_one_that_is_not_there_is_not() {
    let rub = || offer(FORCE, &formula("rub", "force", RUB, "a = 0.1, c = 0.3, w = 0.3"));
    let (machine, data) = force(2, |q, speed| 0.12 * speed.signum() * f64::exp(-((q - 0.4) / 0.25_f64).powi(2)));
    let diagnosis = found(&machine, &data, rub(), 5);
    let mut named: Vec<&str> = diagnosis.effects.iter().map(|own| own.name.as_str()).collect();
    named.sort_unstable();
    assert_eq!(named, ["coulomb", "gravity", "inertia", "rub", "viscous"], "{}", diagnosis.sentence);
    let own = diagnosis.effects.iter().find(|own| own.name == "rub").expect("named");
    for (own, truth) in own.parameters.iter().zip([0.12, 0.4, 0.25]) {
        assert!((own.value.abs() - truth).abs() < 0.15 * truth, "{own:?}, {truth}");
    }

    for seed in [3, 5] {
        let (machine, data) = force(seed, |_, _| 0.0);
        let diagnosis = found(&machine, &data, rub(), 5);
        let mut named: Vec<&str> = diagnosis.effects.iter().map(|own| own.name.as_str()).collect();
        named.sort_unstable();
        assert_eq!(named, ["coulomb", "gravity", "inertia", "viscous"], "seed {seed}: {}", diagnosis.sentence);
        let next = diagnosis.next_experiment.as_ref().expect("a rub as wide as the way looks like dry friction");
        assert_eq!(next.separates, ["coulomb", "rub"], "seed {seed}");
        assert!(next.instruction.starts_with("Run each joint alone"), "seed {seed}: {}", next.instruction);
    }
}

#[test]
fn formulas_that_a_machine_of_segments_or_of_force_cannot_have_are_refused_in_one_sentence() {
    let segments = "format = 1\n[machine]\nkind = \"segments\"\n[[machine.segment]]\nazimuth_deg = [0, 120, 240]\n";
    let learnt = formula("own", "meas", "a * bend", "a = { value = 0.1, learn = { sd = 0.1 } }");
    for (machine, effects, words) in [
        (segments, formula("own", "eps", "a * bend", "a = 0.1"), "hook eps, which this machine does not have"),
        (segments, formula("own", "meas", "a * temperature_c", "a = 0.1"), "temperature_c"),
        (segments, learnt, "a is a number of a formula"),
        (segments, formula("own", "meas", "a * bend", "a = 1.0").repeat(2), "twice"),
        (FORCE, formula("own", "joint", "a * u_i", "a = 0.1"), "hook joint, which this machine does not have"),
        (FORCE, formula("own", "force", "a * u_i", "a = 0.1"), "not known at hook force"),
        (FORCE, formula("own", "force", "a * angle_i", "a = 1.0").repeat(2), "twice"),
    ] {
        let said = ModelFile::parse(&format!("{machine}{effects}")).expect_err("refused").to_string();
        assert!(said.contains(words) && !said.contains('\n'), "{words:?} in: {said}");
    }
}

#[test]
fn what_cannot_be_offered_is_refused_in_one_sentence() {
    let size = "no parameter that scales it";
    for (machine, effects, words) in [
        (
            SNAKE,
            formula("own", "eps", "a * bend", "a = 0.1"),
            "its machine is a snake, expected that of the model, 2 joints",
        ),
        (JOINTS, String::new(), "no effect of kind formula"),
        (JOINTS, formula("own", "joint", "sin(a * u_i)", "a = 1.0"), size),
        (JOINTS, formula("backlash", "joint", "a * u_i", "a = 1.0"), "the name of another effect"),
    ] {
        let said = refused(machine, &effects);
        assert!(said.contains(words) && said.contains("own.toml") && !said.contains('\n'), "{said}");
    }
    // A column that these data do not have.
    let (machine, data) = joints("column", |_, _| 0.0);
    let text = formula("own", "joint", "a * torque", "a = 0.1") + "columns = { torque = \"Torque\" }\n";
    let options = DiagnoseOptions { offered: offer(JOINTS, &text), ..DiagnoseOptions::default() };
    let said = diagnose(&machine, &data, &options).expect_err("no such column").to_string();
    assert!(said.contains("Torque"), "{said}");
}
