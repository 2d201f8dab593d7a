//! Positions of a tip that a tracker saw in a frame of its own: bends come of them, effects are named as with a camera, and what is no
//! tip's position is refused.

use krait_lab::compare::compare;
use krait_lab::diagnose::{DiagnoseOptions, Verdict, diagnose};
use krait_lab::init::propose;
use krait_lab::machine::{MachineUnderTest, SnakeLab};
use krait_lab::read::ColumnMap;
use krait_lab::{Measurements, Quantity, Session, SessionError, Term};
use krait_model::Snake;
use krait_model::model_file::{Machine, ModelFile};
use nalgebra::{Isometry3, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::fmt::Write;
use std::path::PathBuf;

const MODEL: &str = "format = 1\n[machine]\nkind = \"snake\"\n";
/// Noise of each coordinate, m: a good electromagnetic tracker.
const NOISE_M: f64 = 5e-5;
/// The marker sits on the gripper.
const BEYOND_M: f64 = 2.5e-3;

fn lab() -> SnakeLab {
    SnakeLab::new(&ModelFile::parse(MODEL).unwrap()).unwrap()
}

fn snake() -> Snake {
    match ModelFile::parse(MODEL).unwrap().machine() {
        Machine::Snake(own) => Snake::new(&own.parameters).unwrap(),
        other => panic!("{other:?}"),
    }
}

/// Where the tracker stands: half a metre away and turned by more than a right angle.
fn tracker_from_base() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.31, -0.12, 0.45), Vector3::new(1.1, -0.7, 1.9))
}

/// Encoders of loops in planes that turn, 20 rows a second.
fn motion(n_rows: usize) -> Measurements {
    let time_s: Vec<f64> = (0..n_rows).map(|k| k as f64 / 20.0).collect();
    let line = |t: f64, i: f64| {
        let bend = 0.5 + 0.45 * (0.9 * t).sin();
        let plane = 2.7 * (0.23 * t).sin();
        -0.003 * bend * (plane + i * core::f64::consts::TAU / 3.0).cos()
    };
    let inputs = time_s.iter().flat_map(|t| [0.0, 1.0, 2.0].map(|i| line(*t, i))).collect();
    Measurements::bare("made".to_owned(), Quantity::Snake, time_s, (inputs, 3), (vec![f64::NAN; 2 * n_rows], 2))
}

/// Bends of a snake with hidden effects, rad, and the marker's positions in the tracker's frame, m, with noise.
fn seen(hidden: &[Term], seed: u64) -> (Measurements, Vec<Vector3<f64>>) {
    let mut data = motion(1600);
    data.outputs = lab().predict(hidden, &data).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || (0..12).map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX)).sum::<f64>() - 6.0;
    let snake = snake();
    let mut position = |bend: Vector2<f64>| {
        let axis = snake.base_from_tip_rotation(bend) * Vector3::z();
        let at = snake.tip_pos_in_base_m(bend) + axis * BEYOND_M + Vector3::from_fn(|_, _| NOISE_M * normal());
        (tracker_from_base() * nalgebra::Point3::from(at)).coords
    };
    let positions = data.outputs.chunks_exact(2).map(|own| position(Vector2::new(own[0], own[1]))).collect();
    (data, positions)
}

/// A table of encoders and positions, mm.
fn table(data: &Measurements, positions: &[Vector3<f64>], names: &str) -> String {
    let mut text = format!("time_s,q1_mm,q2_mm,q3_mm,{names}\n");
    for (row, at) in positions.iter().enumerate() {
        let mm = |x: f64| 1e3 * x;
        let own = data.input(row);
        let (x, y, z) = (mm(at.x), mm(at.y), mm(at.z));
        writeln!(text, "{},{},{},{},{x},{y},{z}", data.time_s[row], mm(own[0]), mm(own[1]), mm(own[2])).unwrap();
    }
    text
}

const NAMES: &str = "tip_x_mm,tip_y_mm,tip_z_mm";

fn file(name: &str, text: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("tip_{name}"));
    std::fs::write(&path, text).unwrap();
    path
}

fn opened(name: &str, text: &str) -> Result<Session, Box<SessionError>> {
    let model = file(&format!("{name}.toml"), MODEL);
    Session::open(&model, &file(&format!("{name}.csv"), text), &ColumnMap::default()).map_err(Box::new)
}

#[test]
fn the_motion_says_where_the_tracker_stands_and_the_bends_are_those_of_the_snake() {
    let (truth, positions) = seen(&[Term::new("backlash", vec![6e-5]), Term::new("stiffness-scale", vec![1.05])], 3);
    let session = opened("frame", &table(&truth, &positions, NAMES)).unwrap();
    let frame = &session.data.tip_frames[0];
    let apart = frame.base_from_tracker * tracker_from_base();
    // Its tilt is told by the bends alone, which have friction in them.
    assert!(apart.translation.vector.norm() < 5e-4 && apart.rotation.angle() < 0.05, "{apart}");
    assert!((frame.beyond_m.unwrap() - BEYOND_M).abs() < 3e-4, "{:?}", frame.beyond_m);
    assert!(frame.off_surface_m < 1.3 * NOISE_M && frame.off_surface_m > 0.7 * NOISE_M, "{frame:?}");
    assert_eq!((session.data.n_outputs, session.data.n_rows()), (2, 1600));
    // What the frame leaves open is taken out on both sides.
    let shift = |k: usize| {
        let apart = |row: usize| session.data.output(row)[k] - truth.output(row)[k];
        (0..1600).map(apart).sum::<f64>() / 1600.0
    };
    let (x, y) = (shift(0), shift(1));
    let left = (0..1600).map(|row| {
        let (seen, own) = (session.data.output(row), truth.output(row));
        (seen[0] - own[0] - x).hypot(seen[1] - own[1] - y)
    });
    // A tip near the straight pose moves by half of the length, and by the marker's distance beside it, for each radian.
    let noise_rad = 2.0_f64.sqrt() * NOISE_M / (0.5 * snake().l_m() + BEYOND_M);
    let rms = (left.map(|own| own * own).sum::<f64>() / 1600.0).sqrt();
    assert!(rms < 2.0 * noise_rad, "{rms} beside {noise_rad}");
    let found = compare(session.machine.as_ref(), &session.data).unwrap();
    assert_eq!(found.to_json()["tip_frames"][0]["recording"], "tip_frame.csv");
}

#[test]
fn effects_are_named_as_with_a_camera_and_what_the_frame_hides_is_not() {
    let hidden = [
        (Term::new("backlash", vec![6e-5]), Some("backlash")),
        (Term::new("twist", vec![0.06]), Some("twist")),
        (Term::new("latency", vec![0.08]), Some("latency")),
        (Term::new("stiffness-scale", vec![1.08]), Some("stiffness-scale")),
        (Term::new("camera-offset", vec![0.03, -0.02]), None),
        (Term::new("plane-offset", vec![0.05]), None),
    ];
    for (seed, (term, named)) in hidden.into_iter().enumerate() {
        let (truth, positions) = seen(core::slice::from_ref(&term), 40 + seed as u64);
        let session = opened(&format!("named{seed}"), &table(&truth, &positions, NAMES)).unwrap();
        let found = diagnose(session.machine.as_ref(), &session.data, &DiagnoseOptions::default()).unwrap();
        match named {
            Some(name) => {
                assert_eq!(found.verdict, Verdict::Missing, "{term:?}: {}", found.sentence);
                assert!(found.effects[0].class.iter().any(|own| own == name), "{term:?}: {}", found.sentence);
            }
            None => assert_eq!(found.verdict, Verdict::None, "{term:?}: {}", found.sentence),
        }
        assert!(found.cautions.iter().any(|own| own.contains("in the tracker's frame")), "{:?}", found.cautions);
    }
}

#[test]
fn a_file_with_three_lengths_and_a_position_is_proposed_as_a_snake() {
    let (truth, positions) = seen(&[], 5);
    let path = file("init.csv", &table(&truth, &positions, "marker x [mm],marker y [mm],marker z [mm]"));
    let found = propose(&path, &ColumnMap::default()).unwrap();
    assert_eq!(found.kind, "snake");
    assert!(found.machine.contains("a tip's position"), "{}", found.machine);
    assert_eq!(found.columns[4].stands_for.as_deref(), Some("tip_x_m"));
    assert_eq!(found.scored_rows, 1600);
    assert!(found.cautions.iter().any(|own| own.contains("mm beyond the end disk")), "{:?}", found.cautions);
}

#[test]
fn a_shape_beside_the_position_comes_first() {
    let (truth, positions) = seen(&[], 5);
    let text = table(&truth, &positions, NAMES);
    let with_bends = text.lines().enumerate().fold(String::new(), |all, (k, line)| match k {
        0 => format!("{line},bend_x_rad,bend_y_rad\n"),
        _ => all + &format!("{line},{},{}\n", truth.output(k - 1)[0], truth.output(k - 1)[1]),
    });
    let data = opened("both", &with_bends).unwrap().data;
    assert!(data.tip_frames.is_empty());
    assert_eq!(data.output(17), truth.output(17));
}

#[test]
fn what_is_no_tips_position_is_refused_in_one_sentence() {
    let (truth, positions) = seen(&[], 6);
    let of = |change: fn(Vector3<f64>) -> Vector3<f64>| {
        table(&truth, &positions.iter().map(|at| change(*at)).collect::<Vec<_>>(), NAMES)
    };
    let good = of(|at| at);
    let mut late = positions.clone();
    late.rotate_left(130);
    let exchanged = good.replacen("q1_mm,q2_mm", "q2_mm,q1_mm", 1);
    let half = good.lines().take(700).enumerate().fold(String::new(), |all, (k, line)| match k {
        300 => all + line.rsplit_once(',').unwrap().0 + ",\n",
        _ => all + line + "\n",
    });
    for (name, text, words) in [
        ("mirrored", of(|at| Vector3::new(at.y, at.x, at.z)), "mirror image"),
        ("unit", of(|at| at * 10.0), "leave the surface"),
        ("other", table(&truth, &late, NAMES), "of their motion follows the lines"),
        ("swapped", exchanged, "mirror image"),
        ("half", half, "tip_z_mm"),
        ("missing", good.replacen("tip_z_mm", "note", 1), "tip_z_m"),
        ("metres", good.replacen(NAMES, "tip_x_m,tip_y_m,tip_z_m", 1), "no position of a tip: more than 10 m"),
    ] {
        let sentence = opened(name, &text).map(|_| ()).expect_err(name).to_string();
        assert!(sentence.contains(words), "{name}: expected {words:?} in: {sentence}");
        assert!(!sentence.contains('\n'), "{name}: {sentence}");
    }
}

#[test]
fn two_recordings_may_have_the_tracker_at_two_places() {
    let hidden = [Term::new("backlash", vec![8e-5])];
    let (truth, positions) = seen(&hidden, 7);
    let moved: Vec<Vector3<f64>> = seen(&hidden, 8).1.iter().map(|at| Vector3::new(at.z, at.x, at.y)).collect();
    let model = file("two.toml", MODEL);
    let paths = [file("one.csv", &table(&truth, &positions, NAMES)), file("two.csv", &table(&truth, &moved, NAMES))];
    let session = Session::open_all(&model, &paths, &ColumnMap::default()).unwrap();
    let frames = &session.data.tip_frames;
    assert_eq!((frames.len(), frames[1].first_trial), (2, 1));
    assert!(frames[0].base_from_tracker.rotation.angle_to(&frames[1].base_from_tracker.rotation) > 0.5);
    let own = session.machine.predict(&hidden, &session.data).unwrap();
    let left: f64 = own.iter().zip(&session.data.outputs).map(|(own, seen)| (own - seen).powi(2)).sum();
    let noise_rad = NOISE_M / (0.5 * snake().l_m() + BEYOND_M);
    let rms = (left / own.len() as f64).sqrt();
    assert!(rms < 2.0 * noise_rad, "{rms} beside {noise_rad}");
}
