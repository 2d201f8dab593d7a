//! The body as lines in the base frame: primary and secondary backbones as arcs, disks as circles, the jaw of a gripper as two
//! fingers. What is asked for is the primary backbone and the fingers alone.

use super::BASE;
use super::body::{Body, Section, Strand, on_circle};
use krait_model::segments::Bends;
use krait_schema::generated::foxglove::line_primitive::Type;
use krait_schema::generated::foxglove::{Color, LinePrimitive, Point3, SceneEntity, SceneUpdate};
use krait_schema::generated::google::protobuf::Timestamp;
use nalgebra::Vector3;

/// Points along a segment's backbone: an arc of 90 degrees in steps of 11, which looks round.
const N_ALONG: u32 = 9;
/// Base disk, two spacer disks, end disk.
const N_DISKS: u32 = 4;
/// Corners of a disk: each backbone of a snake meets one.
const N_AROUND: u32 = 12;

/// Lines by the segment at which they end; the primary backbone as the first.
const MEASURED: [Color; 3] = [
    Color { r: 0.20, g: 0.55, b: 0.95, a: 1.0 },
    Color { r: 0.20, g: 0.75, b: 0.55, a: 1.0 },
    Color { r: 0.70, g: 0.45, b: 0.90, a: 1.0 },
];
const DISKS: Color = Color { r: 0.75, g: 0.75, b: 0.80, a: 1.0 };
const WANTED: Color = Color { r: 0.98, g: 0.65, b: 0.10, a: 0.9 };

/// A finger of the jaw as the page draws it (`console/web/js/snake.js`): its length, its root's distance from the middle and height
/// above the end disk. A model has the jaw's angle alone; its size, and that it opens in the plane of the tip's x, are made up.
const FINGER_M: f64 = 5e-3;
const FINGER_ASIDE_M: f64 = 0.7e-3;
const FINGER_ABOVE_M: f64 = 0.45e-3;

/// The body as the camera saw it, with the jaw's measured angle where there is one.
pub(super) fn measured(body: &Body, bends_rad: &Bends, jaw_rad: Option<f64>, stamp: Timestamp) -> SceneUpdate {
    let sections = along(body, bends_rad, N_ALONG);
    let mut lines = vec![strand(&sections, &middle(body), MEASURED[0], 3.0)];
    let own = body.lines();
    lines.extend(own.iter().map(|line| strand(&sections, line, MEASURED[line.ends.min(2)], 2.0)));
    for (segment, disks) in along(body, bends_rad, N_DISKS).iter().enumerate() {
        // As wide as the farthest line that runs in the segment.
        let passing = own.iter().filter(|line| line.ends >= segment);
        let radius_m = passing.fold(0.0_f64, |most, line| most.max(line.offset_m.norm()));
        // A segment stands on the last disk of the one before.
        for disk in disks.iter().skip(usize::from(segment > 0)) {
            let corners = (0..N_AROUND).map(|idx| point(disk, on_circle(radius_m, idx, N_AROUND))).collect();
            lines.push(line(Type::LineLoop, corners, DISKS, 2.0));
        }
    }
    lines.extend(fingers(body, bends_rad, jaw_rad, DISKS));
    entity("snake", lines, stamp)
}

/// The primary backbone as it shall be, and the jaw.
pub(super) fn wanted(body: &Body, bends_rad: &Bends, jaw_rad: Option<f64>, stamp: Timestamp) -> SceneUpdate {
    let mut lines = vec![strand(&along(body, bends_rad, N_ALONG), &middle(body), WANTED, 3.0)];
    lines.extend(fingers(body, bends_rad, jaw_rad, WANTED));
    entity("setpoint", lines, stamp)
}

/// Of each segment as many cross-sections, from its first to its last.
fn along(body: &Body, bends_rad: &Bends, n: u32) -> Vec<Vec<Section>> {
    let of = |segment| (0..n).map(|idx| body.section(bends_rad, segment, f64::from(idx) / f64::from(n - 1))).collect();
    (0..body.n_segments()).map(of).collect()
}

/// The primary backbone.
fn middle(body: &Body) -> Strand {
    Strand { ends: body.n_segments() - 1, offset_m: Vector3::zeros() }
}

fn strand(sections: &[Vec<Section>], own: &Strand, color: Color, pixels: f64) -> LinePrimitive {
    let passed = sections.iter().take(own.ends + 1).enumerate();
    // The first place of a segment is the last one of the segment before.
    let places = passed.flat_map(|(segment, of_segment)| of_segment.iter().skip(usize::from(segment > 0)));
    line(Type::LineStrip, places.map(|place| point(place, own.offset_m)).collect(), color, pixels)
}

/// Both fingers of a jaw at the tip; none where its angle is not known.
fn fingers(body: &Body, bends_rad: &Bends, jaw_rad: Option<f64>, color: Color) -> Vec<LinePrimitive> {
    let Some(jaw_rad) = jaw_rad.filter(|jaw_rad| jaw_rad.is_finite()) else { return Vec::new() };
    let tip = body.section(bends_rad, body.n_segments() - 1, 1.0);
    let (sin, cos) = (0.5 * jaw_rad).sin_cos();
    let finger = |side: f64| {
        let at = |m: f64| Vector3::new(side * (FINGER_ASIDE_M + m * sin), 0.0, FINGER_ABOVE_M + m * cos);
        line(Type::LineStrip, vec![point(&tip, at(0.0)), point(&tip, at(FINGER_M))], color, 4.0)
    };
    vec![finger(-1.0), finger(1.0)]
}

fn point(section: &Section, offset_m: Vector3<f64>) -> Point3 {
    let at_m = section.at(offset_m);
    Point3 { x: at_m.x, y: at_m.y, z: at_m.z }
}
fn line(kind: Type, points: Vec<Point3>, color: Color, pixels: f64) -> LinePrimitive {
    LinePrimitive {
        r#type: kind as i32,
        thickness: pixels,
        scale_invariant: true,
        points,
        color: Some(color),
        ..LinePrimitive::default()
    }
}

fn entity(id: &str, lines: Vec<LinePrimitive>, stamp: Timestamp) -> SceneUpdate {
    let entity = SceneEntity {
        timestamp: Some(stamp),
        frame_id: BASE.to_owned(),
        id: id.to_owned(),
        lines,
        ..SceneEntity::default()
    };
    SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
}
