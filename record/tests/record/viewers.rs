//! What viewers draw of segments in series and of a jaw, read back from the file by the public crate: places, counts, and that krait's
//! own messages keep their bytes.

use crate::common::{chain, fresh_path, plausible};
use core::f64::consts::FRAC_PI_2;
use krait_ipc::message::{JAW, N_WITH_GRIPPER, Setpoint, Shape};
use krait_model::model_file::{Machine, ModelFile};
use krait_model::segments::{Bends, SegmentParameters, Segments, SegmentsParameters};
use krait_record::{About, DrawnMachine, RecordingWriter, Views, WallClock};
use krait_schema::generated::foxglove::{
    FrameTransforms, JointStates, LinePrimitive, Point3, PoseInFrame, SceneEntity, SceneUpdate,
};
use krait_schema::{Channel, Sample};
use nalgebra::{Isometry3, Point3 as Place, Quaternion, UnitQuaternion, Vector3};
use prost::Message;
use std::collections::BTreeMap;

const TWO: &str = include_str!("../../../docs/segments/two.toml");
/// The page's geometry, in mm.
const PAGE: &str = include_str!("../../../console/web/js/snake.js");
const MS: i64 = 1_000_000;
const NEAR_M: f64 = 1e-12;
/// Points of a strand within a segment, its first one included.
const N_ALONG: usize = 9;

type Read = BTreeMap<String, Vec<Vec<u8>>>;

fn two() -> SegmentsParameters {
    match ModelFile::parse(TWO).expect("the shipped model").machine() {
        Machine::Segments(parameters) => parameters.clone(),
        other => panic!("{other:?}"),
    }
}

/// The most that a model can have: three segments, twelve lines, none like another.
fn three() -> SegmentsParameters {
    let segment = |n: u8| {
        let azimuth_rad = |k: u8| 0.3 * f64::from(n) + 1.4 * f64::from(k);
        let mut own = SegmentParameters::of_table_i(&[azimuth_rad(0), azimuth_rad(1), azimuth_rad(2), azimuth_rad(3)]);
        own.l_m = 0.02 + 0.005 * f64::from(n);
        own.lines.iter_mut().for_each(|line| line.radius_m = 2e-3 - 2e-4 * f64::from(n));
        own
    };
    SegmentsParameters { segments: (0..3).map(segment).collect(), ..SegmentsParameters::default() }
}

/// The samples written with a machine to be drawn and read again, by topic.
fn recorded(name: &str, machine: Option<&DrawnMachine>, samples: &[Sample]) -> Read {
    let path = fresh_path(name);
    // One wall clock for all recordings: measured twice, it differs by nanoseconds.
    let clock = WallClock { offset_ns: 1_700_000_000_000_000_000 };
    let about = About { clock, ..About::run("viewers", &BTreeMap::new(), Vec::new()) };
    let views = machine.map(|machine| Views::new(Some(machine), 30).expect("a machine"));
    let mut writer = RecordingWriter::create(&path, 64 * 1024, &about).expect("created").with_views(views);
    for sample in samples {
        writer.write(sample, sample.sample_ns()).expect("written");
    }
    writer.finish(&BTreeMap::new()).expect("finished");
    let bytes = std::fs::read(&path).expect("there");
    let mut read = Read::new();
    for message in mcap::MessageStream::new(&bytes).expect("MCAP") {
        let message = message.expect("readable");
        read.entry(message.channel.topic.clone()).or_default().push(message.data.into_owned());
    }
    read
}

fn decoded<M: Message + Default>(read: &Read, topic: &str) -> Vec<M> {
    let of_topic = read.get(topic).map_or(&[][..], Vec::as_slice);
    of_topic.iter().map(|bytes| M::decode(&bytes[..]).expect("decodes")).collect()
}

/// The newest entity of a name in the scene.
fn entity(read: &Read, id: &str) -> SceneEntity {
    let scenes = decoded::<SceneUpdate>(read, "/snake/scene");
    let mut entities = scenes.into_iter().flat_map(|scene| scene.entities);
    entities.rfind(|entity| entity.id == id).unwrap_or_else(|| panic!("no {id}"))
}

fn shown(sample_ns: i64, bends_rad: &[f64]) -> Sample {
    Sample::Shape(Shape::of_joints(1, sample_ns, sample_ns, bends_rad))
}

fn asked(sample_ns: i64, bends_rad: &[f64]) -> Sample {
    let Sample::Setpoint(mut setpoint) = plausible(Channel::Setpoint, 1, sample_ns) else { panic!("a setpoint") };
    setpoint.joints_rad[..bends_rad.len()].copy_from_slice(bends_rad);
    Sample::Setpoint(Setpoint {
        bend_rad: [f64::NAN; 2],
        n_joints: bends_rad.len() as u32,
        tip_pos_in_base_m: [0.0, 0.0, 0.05],
        ..setpoint
    })
}

fn at(point: &Point3) -> Vector3<f64> {
    Vector3::new(point.x, point.y, point.z)
}

fn last(line: &LinePrimitive) -> Vector3<f64> {
    at(line.points.last().expect("points"))
}

fn length_m(points: &[Point3]) -> f64 {
    points.windows(2).map(|pair| (at(&pair[1]) - at(&pair[0])).norm()).sum()
}

fn near(found: Vector3<f64>, expected: Vector3<f64>, what: &str) {
    assert!((found - expected).norm() < NEAR_M, "{what}: {found:?} instead of {expected:?}");
}

/// Where a frame was last, in the base frame.
fn frame(read: &Read, name: &str) -> Isometry3<f64> {
    let mut all = decoded::<FrameTransforms>(read, "/tf").into_iter().flat_map(|message| message.transforms);
    let own = all.rfind(|own| own.child_frame_id == name).unwrap_or_else(|| panic!("no {name}"));
    assert_eq!(own.parent_frame_id, "base");
    let (to, turn) = (own.translation.expect("set"), own.rotation.expect("set"));
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(turn.w, turn.x, turn.y, turn.z));
    Isometry3::from_parts(Vector3::new(to.x, to.y, to.z).into(), turn)
}

#[test]
fn two_segments_are_drawn_where_a_half_circle_and_a_corner_have_their_ends() {
    // Both bent by a quarter turn towards x; then the second one across.
    let (half, corner) = ([FRAC_PI_2, 0.0, FRAC_PI_2, 0.0], [FRAC_PI_2, 0.0, 0.0, FRAC_PI_2]);
    let samples = [shown(5 * MS, &half), asked(6 * MS, &corner)];
    let read = recorded("half_circle.mcap", Some(&DrawnMachine::Segments(two())), &samples);
    let r = 0.026 / FRAC_PI_2;
    let (knee, half_tip) = (Vector3::new(r, 0.0, r), Vector3::new(2.0 * r, 0.0, 0.0));
    // Behind the quarter turn the disk's x points down and its z along x; a plane of 90 deg is at -y.
    let corner_tip = Vector3::new(2.0 * r, -r, r);
    let (snake, setpoint) = (entity(&read, "snake"), entity(&read, "setpoint"));
    assert_eq!((snake.frame_id.as_str(), setpoint.frame_id.as_str()), ("base", "base"));
    assert_eq!((snake.lines.len(), setpoint.lines.len()), (1 + 6 + 7, 1), "backbone, lines, disks; backbone");
    for (line, tip) in [(&snake.lines[0], half_tip), (&setpoint.lines[0], corner_tip)] {
        assert_eq!(line.points.len(), 2 * N_ALONG - 1);
        near(at(&line.points[0]), Vector3::zeros(), "base");
        near(at(&line.points[N_ALONG - 1]), knee, "end of segment 1");
        near(last(line), tip, "tip");
    }
    // The half circle's middle line of points lies on it.
    for point in &snake.lines[0].points {
        assert!(((at(point) - Vector3::new(r, 0.0, 0.0)).norm() - r).abs() < NEAR_M, "{point:?}");
    }
    let (tip, tip_setpoint) = (frame(&read, "tip"), frame(&read, "tip_setpoint"));
    near(tip.translation.vector, half_tip, "tip");
    near(tip * Vector3::z(), -Vector3::z(), "the tip looks back");
    near(tip * Vector3::y(), Vector3::y(), "and is not twisted");
    near(tip_setpoint.translation.vector, corner_tip, "tip_setpoint");
    near(tip_setpoint * Vector3::z(), -Vector3::y(), "the wanted tip looks aside");
    for (topic, name) in [("/snake/measured_cp", "tip"), ("/snake/setpoint_cp", "tip_setpoint")] {
        let pose = decoded::<PoseInFrame>(&read, topic).pop().expect("one").pose.expect("set");
        let position = pose.position.expect("set");
        let position = Vector3::new(position.x, position.y, position.z);
        near(position, frame(&read, name).translation.vector, topic);
    }
}

#[test]
fn every_line_of_three_segments_runs_to_its_own_disk_and_is_as_long_as_the_model_says() {
    let parameters = three();
    let machine = Segments::new(&parameters).expect("a machine");
    let bends_rad = [0.7, -0.4, -0.5, 0.6, 0.3, 0.9];
    let read = recorded("three.mcap", Some(&DrawnMachine::Segments(parameters)), &[shown(0, &bends_rad)]);
    let bends_rad = Bends::from_row_slice(&bends_rad);
    let lines = entity(&read, "snake").lines;
    assert_eq!(lines.len(), 1 + 12 + 4 + 3 + 3);
    let (backbone, q_m) = (&lines[0].points, machine.q_m(&bends_rad));
    for segment in 0..3 {
        let disk_m = machine.base_from_disk(&bends_rad, segment).translation.vector;
        near(at(&backbone[(segment + 1) * (N_ALONG - 1)]), disk_m, "end of a segment");
    }
    near(last(&lines[0]), machine.tip(&bends_rad).0, "tip");
    let mut radius_m = [0.0_f64; 3];
    for k in 0..12 {
        let (line, segment) = (&lines[1 + k], machine.segment_of(k));
        assert_eq!(line.points.len(), 1 + (segment + 1) * (N_ALONG - 1), "line {k} ends at its disk");
        let in_disk = machine.line_in_disk_m(k);
        let end = machine.base_from_disk(&bends_rad, segment) * Place::new(in_disk.x, in_disk.y, 0.0);
        near(last(line), end.coords, "end of a line");
        let found_q_m = length_m(&line.points) - length_m(&backbone[..line.points.len()]);
        assert!((found_q_m - q_m[k]).abs() < 3e-5, "line {k}: {found_q_m} instead of {}", q_m[k]);
        radius_m[segment] = radius_m[segment].max(in_disk.norm());
    }
    // The last disk of each segment is as wide as the lines that run there.
    for (segment, at_line) in [(0, 16), (1, 19), (2, 22)] {
        let disk = machine.base_from_disk(&bends_rad, segment);
        for corner in &lines[at_line].points {
            let own = disk.inverse() * Place::from(at(corner));
            assert!(own.z.abs() < NEAR_M && (own.coords.norm() - radius_m[segment]).abs() < NEAR_M, "{segment}: {own}");
        }
    }
    assert!(lines[1].color != lines[5].color && lines[5].color != lines[9].color, "lines show where they end");
}

#[test]
fn segments_are_drawn_as_often_as_a_snake_and_nothing_of_another_machine_is() {
    let segments = DrawnMachine::Segments(two());
    let begin_ns = krait_ipc::clock::monotonic_ns();
    let bent = |sample: Sample| match sample {
        Sample::Shape(shape) => shown(shape.sample_ns, &[0.3, 0.1, -0.2, 0.4]),
        Sample::Setpoint(setpoint) => asked(setpoint.sample_ns, &[0.3, 0.1, -0.2, 0.4]),
        other => other,
    };
    let samples: Vec<Sample> = chain(2000, begin_ns).map(bent).collect();
    let read = recorded("counts.mcap", Some(&segments), &samples);
    // Two seconds touch 60 periods of 1/30 s, or 61; the scene and the frames have both, the seen and the wanted.
    for (topic, each) in [
        ("/snake/measured_cp", 1),
        ("/snake/setpoint_cp", 1),
        ("/tf", 2),
        ("/snake/scene", 2),
        ("/snake/actuators/measured_js", 1),
    ] {
        let n = read[topic].len();
        assert!((60 * each..=61 * each).contains(&n), "{topic}: {n}");
    }
    let names: Vec<String> = decoded::<JointStates>(&read, "/snake/actuators/measured_js")
        .pop()
        .expect("one")
        .joints
        .into_iter()
        .map(|joint| joint.name)
        .collect();
    assert!(
        names.iter().enumerate().all(|(k, name)| *name == format!("line_{}", k + 1)),
        "no wire of a gripper: {names:?}"
    );
    // Three segments, a snake, joints without a tip, a view that was lost.
    let mut joints = asked(1, &[0.3, 0.1, -0.2, 0.4]);
    if let Sample::Setpoint(setpoint) = &mut joints {
        setpoint.tip_pos_in_base_m = [f64::NAN; 3];
    }
    let others = [
        shown(0, &[0.1; 6]),
        asked(0, &[0.1; 6]),
        Sample::Shape(Shape::of_bend(1, 40 * MS, 40 * MS, [0.1, 0.2])),
        joints,
        Sample::Shape(Shape::lost(1, 80 * MS, 80 * MS)),
        asked(80 * MS, &[0.1, f64::NAN, 0.1, 0.1]),
    ];
    let read = recorded("others.mcap", Some(&segments), &others);
    assert!(!read.contains_key("/snake/scene") && !read.contains_key("/tf"), "{:?}", read.keys());
}

#[test]
fn a_jaw_is_two_fingers_at_the_tip_as_the_page_draws_them_and_changes_nothing_besides() {
    let (bend_rad, jaw_rad) = ([0.6, -0.3], 0.5);
    let bent = |sample: Sample, with_jaw: bool| match sample {
        Sample::Shape(shape) => {
            let shape = Shape::of_bend(shape.sequence, shape.sample_ns, shape.available_ns, bend_rad);
            Sample::Shape(if with_jaw { shape.with_jaw(jaw_rad, 0.01) } else { shape })
        }
        Sample::Setpoint(mut setpoint) => {
            (setpoint.bend_rad, setpoint.n_joints, setpoint.n_actuators) = (bend_rad, 0, N_WITH_GRIPPER as u32);
            setpoint.joints_rad[JAW] = if with_jaw { 0.0 } else { f64::NAN };
            Sample::Setpoint(setpoint)
        }
        other => other,
    };
    let samples = |with_jaw| chain(1000, MS).map(move |sample| bent(sample, with_jaw)).collect::<Vec<_>>();
    let read = recorded("jaw.mcap", Some(&DrawnMachine::default()), &samples(true));
    let tip = frame(&read, "tip");
    for (id, others, opening_rad) in [("snake", 8, jaw_rad), ("setpoint", 1, 0.0)] {
        let lines = entity(&read, id).lines;
        assert_eq!(lines.len(), others + 2, "{id}");
        let tip = if id == "snake" { tip } else { frame(&read, "tip_setpoint") };
        for (line, side) in lines[others..].iter().zip([-1.0, 1.0]) {
            let [root, end] = [0, 1].map(|k| tip.inverse() * Place::from(at(&line.points[k])));
            near(root.coords, Vector3::new(side * 0.7e-3, 0.0, 0.45e-3), "root");
            let half_rad: f64 = 0.5 * opening_rad;
            near(end - root, Vector3::new(side * half_rad.sin(), 0.0, half_rad.cos()) * 5e-3, "finger");
        }
    }
    assert!(
        PAGE.contains("FINGER = 5, FINGER_ASIDE = 0.7;") && PAGE.contains("0.45 + along * Math.cos"),
        "the page's fingers"
    );
    // Without a known jaw the same recording has the same bytes in every topic of viewers but the scene.
    let without = recorded("no_jaw.mcap", Some(&DrawnMachine::default()), &samples(false));
    for topic in ["/tf", "/snake/measured_cp", "/snake/setpoint_cp", "/snake/actuators/measured_js", "/log"] {
        assert!(!read[topic].is_empty() && read[topic] == without[topic], "{topic}");
    }
    assert_eq!((entity(&without, "snake").lines.len(), entity(&without, "setpoint").lines.len()), (8, 1));
}

#[test]
fn what_is_drawn_leaves_every_byte_of_krait_s_own_messages_as_it_is() {
    let samples: Vec<Sample> = chain(500, MS).chain([shown(40 * MS, &[0.1; 4]), asked(40 * MS, &[0.1; 4])]).collect();
    let bare = recorded("bare.mcap", None, &samples);
    assert!(bare.keys().all(|topic| topic.starts_with("/krait/")) && bare.len() > 6, "{:?}", bare.keys());
    for machine in [DrawnMachine::default(), DrawnMachine::Segments(two())] {
        let mut read = recorded("drawn.mcap", Some(&machine), &samples);
        let n_topics = read.len();
        read.retain(|topic, _| topic.starts_with("/krait/"));
        assert!(read == bare && read.len() + 4 < n_topics, "{machine:?}");
    }
}
