//! Loads at the actuators of two segments: the plant's against the model's, and what they tell the lab.

use krait_lab::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use krait_lab::machine::{MachineUnderTest, SegmentsLab};
use krait_lab::{Measurements, Term};
use krait_lab_benchmark::generate::Generated;
use krait_lab_benchmark::segments::{SegmentKind, SegmentsRecipe, segments};
use krait_model::model_file::ModelFile;
use krait_sim::SegmentsTruth;

fn made(kind: &str, size: f64, seed: u64, load_sigma_n: f64) -> Generated<SegmentsTruth> {
    let hidden = SegmentKind::from_name(kind, 2).map(|kind| (kind, size)).into_iter().collect();
    let load_sigma_n = Some(load_sigma_n);
    segments(&SegmentsRecipe { hidden, seconds: 60.0, seed, load_sigma_n, ..SegmentsRecipe::default() }).unwrap()
}

fn lab(made: &Generated<SegmentsTruth>) -> SegmentsLab {
    SegmentsLab::new(&ModelFile::parse(&made.model).unwrap()).unwrap()
}

fn answer(made: &Generated<SegmentsTruth>, loads_n: Option<Vec<f64>>) -> Diagnosis {
    let data = Measurements { loads_n, ..made.measurements.clone() };
    diagnose(&lab(made), &data, &DiagnoseOptions::default()).unwrap()
}

/// The model has the plant's parameters and none of its code: where both have the same law, they have the same loads.
#[test]
fn with_the_answer_s_parameters_the_model_s_loads_are_the_plant_s() {
    for kind in
        ["stiffness", "backlash", "static-friction", "cone", "inside", "backlash-2", "static-friction-1", "cone-2"]
    {
        let made = made(kind, 2.0, 11, 0.0);
        let lab = lab(&made);
        let (effect, known) = made.answer.known.first_key_value().unwrap();
        let parameters = lab.parameters(&Term::new(effect, Vec::new())).unwrap();
        let values = parameters.iter().map(|own| known.get(&own.name).copied().unwrap_or(own.default)).collect();
        let measured = made.measurements.loads_n.as_ref().unwrap();
        assert_eq!(measured.len(), made.measurements.inputs.len());
        let left = |effects: &[Term]| {
            let (_, predicted) = lab.predict_with_loads(effects, &made.measurements).unwrap();
            let square: f64 = predicted.unwrap().iter().zip(measured).map(|(f, y)| (y - f).powi(2)).sum();
            (square / measured.len() as f64).sqrt()
        };
        let (before, after) = (left(lab.effects()), left(&[lab.effects(), &[Term::new(effect, values)]].concat()));
        println!("{kind}: {before:.4} N of the loads are not the base model's, {after:.4} N not those of the effect");
        assert!(after < 0.03 && before > 0.1, "{kind}: {before} N, {after} N");
    }
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn play_and_static_friction_of_all_lines_or_of_one_segment_s_are_told_apart_by_the_loads_and_by_nothing_else() {
    for (kind, other, value, size) in [
        ("backlash", "static-friction", "half_width_m", 2.0),
        ("static-friction", "backlash", "f_s_n", 2.0),
        ("backlash-2", "static-friction-2", "half_width_m", 0.5),
        ("static-friction-2", "backlash-2", "f_s_n", 0.5),
    ] {
        let made = made(kind, size, 300, 0.1);
        let (with, without) = (answer(&made, made.measurements.loads_n.clone()), answer(&made, None));
        assert_eq!((with.verdict, without.verdict), (Verdict::Missing, Verdict::Missing), "{kind}");
        let named = |found: &Diagnosis| found.effects.iter().map(|own| own.class.clone()).collect::<Vec<_>>();
        println!("{kind}: {:?} with loads, {:?} without", named(&with), named(&without));
        let ([own], [alike]) = (&named(&with)[..], &named(&without)[..]) else {
            panic!("{kind}: {} {}", with.sentence, without.sentence)
        };
        assert!(own[0] == kind && !own.iter().any(|name| name == other), "{kind} with loads: {own:?}");
        assert!([kind, other].iter().all(|name| alike.iter().any(|own| own == name)), "{kind} without: {alike:?}");
        let found = with.effects[0].parameters.iter().find(|own| own.name == value).unwrap();
        let truth = made.answer.known[kind][value];
        assert!((found.value - truth).abs() < 4.0 * found.se, "{kind}: {found:?} and {truth}");
        let cells = with.loads.unwrap();
        assert_eq!(cells.iter().map(|cell| cell.line).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6]);
        for cell in cells {
            assert!((cell.gain - 1.0).abs() < 0.02 && (cell.after_n / 0.1 - 1.0).abs() < 0.15, "{kind}: {cell:?}");
        }
        assert!(without.loads.is_none());
    }
}

#[test]
fn without_anything_hidden_nothing_is_named_and_cells_of_other_lines_or_gains_change_nothing() {
    let made = made("none", 1.0, 1, 0.1);
    let loads_n = made.measurements.loads_n.clone().unwrap();
    let found = answer(&made, Some(loads_n.clone()));
    assert_eq!((found.verdict, found.loads.map(|cells| cells.len())), (Verdict::None, Some(6)), "{}", found.sentence);
    let of_rows = |change: fn(&mut [f64])| {
        let mut loads_n = loads_n.clone();
        loads_n.chunks_exact_mut(6).for_each(change);
        answer(&made, Some(loads_n))
    };
    let turned = of_rows(|row| row.rotate_left(1));
    assert!(turned.loads.is_none() && turned.verdict == Verdict::None);
    assert!(turned.cautions.iter().any(|own| own.contains("loads are not used")), "{:?}", turned.cautions);
    let other = of_rows(|row| (row[0], row[5]) = (1.1 * row[0] + 4.0, -row[5] - 7.0));
    let cells = other.loads.unwrap();
    assert_eq!(other.verdict, Verdict::None, "{}", other.sentence);
    assert!((cells[0].gain - 1.1).abs() < 0.02 && (cells[5].gain + 1.0).abs() < 0.02, "{cells:?}");
    assert!(other.cautions.iter().any(|own| own.contains("tau6_n") && own.contains("negated")), "{:?}", other.cautions);
}

#[test]
fn generated_loads_stand_in_the_file_and_change_nothing_else_in_it() {
    let with = made("backlash-2", 1.0, 4, 0.1);
    let mut without = with.clone();
    without.measurements.loads_n = None;
    let (with, without) = (with.csv(), without.csv());
    let header = "time_s,u1_m,u2_m,u3_m,u4_m,u5_m,u6_m,y1_rad,y2_rad,y3_rad,y4_rad";
    assert!(with.starts_with(&format!("{header},tau1_n,tau2_n,tau3_n,tau4_n,tau5_n,tau6_n\n")));
    for (with, without) in with.lines().zip(without.lines()).skip(1) {
        assert!(with.strip_prefix(without).is_some_and(|loads| loads.matches(',').count() == 6), "{with}");
    }
}
