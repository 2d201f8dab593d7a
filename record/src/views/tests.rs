//! Tests of what viewers draw: the geometry agrees with the model, the rate is kept, only changes are told.

use super::*;
use krait_ipc::message::{Health, HopStamps, lines};
use krait_ipc::{Process, Reason, Reasons};
use krait_model::{MachineParameters, Snake};
use krait_schema::generated::foxglove::{FrameTransforms, JointStates, Log, SceneUpdate};
use nalgebra::{Vector2, Vector3};

const MS: i64 = 1_000_000;
const CLOCK: WallClock = WallClock { offset_ns: 1_700_000_000_000_000_000 };

fn views() -> Views {
    Views::new(Some(&DrawnMachine::default()), 30).expect("the default machine")
}

fn shape(sample_ns: i64, bend_rad: [f64; 2]) -> Sample {
    Sample::Shape(Shape::of_bend(1, sample_ns, sample_ns, bend_rad).with_sigma(0.005))
}

fn state(sample_ns: i64, operating_state: u32) -> Sample {
    Sample::State(SlaveState {
        sequence: 1,
        sample_ns,
        stamps: HopStamps::default(),
        command_sequence: 0,
        operating_state,
        flags: 0,
        setpoint_q_m: lines([1e-3, 2e-3, -3e-3]),
        setpoint_bend_rad: [0.0; 2],
        setpoint_joints_rad: [0.0; 8],
        n_actuators: 3,
        n_joints: 0,
        measured_q_m: lines([1.1e-3, 2.1e-3, -3.1e-3]),
        measured_tau_n: lines([1.0, f64::NAN, -2.0]),
        reasons: 0,
        n_commands: 0,
        n_refused: 0,
        ..SlaveState::default()
    })
}

fn only<M: Message + Default>(derived: &[Derived], view: View) -> M {
    let mut of_view = derived.iter().filter(|(found, _)| *found == view);
    let message = M::decode(&of_view.next().expect("one").1[..]).expect("decodes");
    assert!(of_view.next().is_none(), "more than one {view:?}");
    message
}

#[test]
fn backbones_end_on_the_end_disk_and_keep_their_length() {
    let (snake, bend_rad) = (Snake::new(&MachineParameters::default()).expect("fits"), Vector2::new(0.7, -0.4));
    let derived = views().of(&shape(5 * MS, bend_rad.into()), CLOCK);
    let scene: SceneUpdate = only(&derived, View::Scene);
    let lines = &scene.entities[0].lines;
    assert_eq!(lines.len(), 8, "a primary and three secondary backbones, four disks");
    let at = |p: &foxglove::Point3| Vector3::new(p.x, p.y, p.z);
    let length_m =
        |idx: usize| -> f64 { lines[idx].points.windows(2).map(|pair| (at(&pair[1]) - at(&pair[0])).norm()).sum() };
    let tip_m = snake.tip_pos_in_base_m(bend_rad);
    assert!((at(lines[0].points.last().expect("points")) - tip_m).norm() < 1e-12);
    assert!((length_m(0) - snake.l_m()).abs() < 2e-3 * snake.l_m());
    let q_m = snake.j_q_bend() * bend_rad;
    for idx in 0..3 {
        let found_q_m = length_m(idx + 1) - length_m(0);
        assert!((found_q_m - q_m[idx]).abs() < 2e-5, "line {idx}: {found_q_m} instead of {}", q_m[idx]);
    }
    let transforms: FrameTransforms = only(&derived, View::Transforms);
    let tip = transforms.transforms[0].translation.expect("set");
    assert!((Vector3::new(tip.x, tip.y, tip.z) - tip_m).norm() < 1e-12);
    assert_eq!(
        (transforms.transforms[0].parent_frame_id.as_str(), transforms.transforms[0].child_frame_id.as_str()),
        ("base", "tip")
    );
    let stamp = transforms.transforms[0].timestamp.expect("set");
    assert_eq!((stamp.seconds, stamp.nanos), (1_700_000_000, 5_000_000));
}

#[test]
fn nothing_is_drawn_more_often_than_asked_and_a_clock_that_falls_back_is_no_end() {
    let mut views = views();
    let mut n_drawn = |stamps_ms: &mut dyn Iterator<Item = i64>| {
        stamps_ms.filter(|ms| !views.of(&shape(ms * MS, [0.1, 0.2]), CLOCK).is_empty()).count()
    };
    assert_eq!(n_drawn(&mut (10_000..11_000)), 30);
    assert_eq!(n_drawn(&mut (0..100)), 3);
    assert_eq!(n_drawn(&mut (0..120).map(|frame| 20_000 + frame * 1000 / 60)), 60, "every second frame of a camera");
}

#[test]
fn a_shape_that_saw_nothing_draws_nothing() {
    assert!(views().of(&shape(0, [f64::NAN; 2]), CLOCK).is_empty());
}

#[test]
fn a_load_that_is_not_measured_is_left_out() {
    let derived = views().of(&state(0, 1), CLOCK);
    let joints: JointStates = only(&derived, View::MeasuredJs);
    let seen: Vec<_> = joints.joints.iter().map(|j| (j.name.as_str(), j.position, j.effort)).collect();
    assert_eq!(seen[0], ("line_1", Some(1.1e-3), Some(1.0)));
    assert_eq!(seen[1], ("line_2", Some(2.1e-3), None));
    let joints: JointStates = only(&derived, View::SetpointJs);
    assert_eq!(joints.joints[2].position, Some(-3e-3));
}

#[test]
fn only_changes_are_told() {
    let mut views = views();
    let mut lines = |sample: &Sample| -> Vec<String> {
        let derived = views.of(sample, CLOCK);
        let logs = derived.iter().filter(|(view, _)| *view == View::Log);
        logs.map(|(_, bytes)| Log::decode(&bytes[..]).expect("decodes").message).collect()
    };
    let health = |reasons: &[Reason]| {
        let mut set = Reasons::NONE;
        reasons.iter().for_each(|reason| set.insert(*reason));
        Sample::Health(Process::Resolve, Box::new(Health { reasons_now: set.bits(), ..Health::default() }))
    };
    assert!(lines(&health(&[])).is_empty());
    assert_eq!(lines(&health(&[Reason::BendLimit])), [Reason::BendLimit.sentence()]);
    assert!(lines(&health(&[Reason::BendLimit])).is_empty());
    assert_eq!(lines(&health(&[])), [format!("no longer: {}", Reason::BendLimit.sentence())]);
    let again = lines(&Sample::Health(Process::Resolve, Box::new(Health { pid: 7, ..Health::default() })));
    assert!(again.len() == 1 && again[0].starts_with("started again, pid 7"), "{again:?}");
    assert_eq!(lines(&state(0, 0)), ["operating state: DISABLED"]);
    assert!(lines(&state(MS, 0)).is_empty());
    assert_eq!(lines(&state(2 * MS, 3)), ["operating state: FAULT"]);
}
