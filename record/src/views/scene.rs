//! The snake as lines: primary and secondary backbones as arcs, disks as circles, in the base frame.

use super::BASE;
use core::f64::consts::TAU;
use krait_model::Snake;
use krait_schema::generated::foxglove::line_primitive::Type;
use krait_schema::generated::foxglove::{Color, LinePrimitive, Point3, SceneEntity, SceneUpdate};
use krait_schema::generated::google::protobuf::Timestamp;
use nalgebra::{Vector2, Vector3};

/// Points along a backbone: an arc of 90 degrees in steps of 11, which looks round.
const N_ALONG: u32 = 9;
/// Base disk, two spacer disks, end disk.
const N_DISKS: u32 = 4;
/// Corners of a disk: each backbone meets one.
const N_AROUND: u32 = 12;
const N_BACKBONES: u32 = 3;

const MEASURED: Color = Color { r: 0.20, g: 0.55, b: 0.95, a: 1.0 };
const DISKS: Color = Color { r: 0.75, g: 0.75, b: 0.80, a: 1.0 };
const WANTED: Color = Color { r: 0.98, g: 0.65, b: 0.10, a: 0.9 };

/// The snake as the camera saw it.
pub(super) fn measured(snake: &Snake, bend_rad: Vector2<f64>, stamp: Timestamp) -> SceneUpdate {
    let mut lines = vec![backbone(snake, bend_rad, Vector3::zeros(), MEASURED, 3.0)];
    for idx in 0..N_BACKBONES {
        let offset_m = on_circle(snake.r_m(), idx, N_BACKBONES);
        lines.push(backbone(snake, bend_rad, offset_m, MEASURED, 2.0));
    }
    for idx in 0..N_DISKS {
        let along = f64::from(idx) / f64::from(N_DISKS - 1);
        let corner = |around| point(snake, bend_rad, along, on_circle(snake.r_m(), around, N_AROUND));
        lines.push(line(Type::LineLoop, (0..N_AROUND).map(corner).collect(), DISKS, 2.0));
    }
    entity("snake", lines, stamp)
}

/// The primary backbone as it shall be.
pub(super) fn wanted(snake: &Snake, bend_rad: Vector2<f64>, stamp: Timestamp) -> SceneUpdate {
    entity("setpoint", vec![backbone(snake, bend_rad, Vector3::zeros(), WANTED, 3.0)], stamp)
}

/// A line through the same place of every disk, `offset_m` from its centre.
fn backbone(snake: &Snake, bend_rad: Vector2<f64>, offset_m: Vector3<f64>, color: Color, pixels: f64) -> LinePrimitive {
    let at = |idx: u32| point(snake, bend_rad, f64::from(idx) / f64::from(N_ALONG - 1), offset_m);
    line(Type::LineStrip, (0..N_ALONG).map(at).collect(), color, pixels)
}

/// A point of the cross-section at the part `along` (0 to 1) of the length. The piece up to there is a shorter snake with
/// the same part of the bend: curvature is constant.
fn point(snake: &Snake, bend_rad: Vector2<f64>, along: f64, offset_m: Vector3<f64>) -> Point3 {
    let bend_rad = bend_rad * along;
    let at_m = snake.tip_pos_in_base_m(bend_rad) * along + snake.base_from_tip_rotation(bend_rad) * offset_m;
    Point3 { x: at_m.x, y: at_m.y, z: at_m.z }
}

fn on_circle(radius_m: f64, idx: u32, n: u32) -> Vector3<f64> {
    let azimuth_rad = TAU * f64::from(idx) / f64::from(n);
    Vector3::new(azimuth_rad.cos(), azimuth_rad.sin(), 0.0) * radius_m
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
