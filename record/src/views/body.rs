//! The body that is drawn: a snake, or segments in series. Where its disks are and where its lines cross them is `model`'s.

use core::f64::consts::TAU;
use krait_ipc::message::{Setpoint, Shape};
use krait_model::segments::{Bends, Segments, SegmentsParameters};
use krait_model::{ChainError, MachineParameters, Snake};
use nalgebra::{Isometry3, Rotation3, Vector2, Vector3};

const N_SNAKE_LINES: u32 = 3;

/// The machine that viewers draw, as its model has it.
#[derive(Clone, Debug, PartialEq)]
pub enum DrawnMachine {
    /// A snake of three lines.
    Snake(MachineParameters),
    /// Segments in series on any lines.
    Segments(SegmentsParameters),
}

impl Default for DrawnMachine {
    fn default() -> Self {
        Self::Snake(MachineParameters::default())
    }
}

/// The same, checked.
#[derive(Debug)]
pub(super) enum Body {
    Snake(Snake),
    Segments(Box<Segments>),
}

/// A cross-section in the base frame.
pub(super) struct Section {
    at_m: Vector3<f64>,
    base_from_here: Rotation3<f64>,
}

/// What runs along a body at the same place of every disk, from the base to the disk of a segment.
pub(super) struct Strand {
    /// The segment, from 0.
    pub(super) ends: usize,
    /// From the middle of a disk.
    pub(super) offset_m: Vector3<f64>,
}

impl Section {
    /// A place given from the middle of the disk and along its axes.
    pub(super) fn at(&self, offset_m: Vector3<f64>) -> Vector3<f64> {
        self.at_m + self.base_from_here * offset_m
    }
}

impl Body {
    pub(super) fn new(machine: &DrawnMachine) -> Result<Self, ChainError> {
        Ok(match machine {
            DrawnMachine::Snake(parameters) => Self::Snake(Snake::new(parameters)?),
            DrawnMachine::Segments(parameters) => Self::Segments(Box::new(Segments::new(parameters)?)),
        })
    }

    pub(super) fn is_snake(&self) -> bool {
        matches!(self, Self::Snake(_))
    }

    pub(super) fn n_segments(&self) -> usize {
        match self {
            Self::Snake(_) => 1,
            Self::Segments(segments) => segments.n(),
        }
    }

    /// The bends that a shape shows, where it shows this body.
    pub(super) fn measured(&self, shape: &Shape) -> Option<Bends> {
        match self {
            Self::Snake(_) => shape.valid_bend_rad().map(|bend_rad| bends(&bend_rad)),
            Self::Segments(segments) => {
                shape.valid_joints_rad().filter(|found| found.len() == segments.n_bends()).map(bends)
            }
        }
    }

    /// The bends that a setpoint asks for, where it is for this body.
    pub(super) fn wanted(&self, setpoint: &Setpoint) -> Option<Bends> {
        let wanted = match self {
            Self::Snake(_) => bends(&setpoint.bend_rad),
            Self::Segments(own) if setpoint.n_segments() == own.n() => bends(&setpoint.joints_rad[..own.n_bends()]),
            Self::Segments(_) => return None,
        };
        wanted.iter().all(|b| b.is_finite()).then_some(wanted)
    }

    pub(super) fn base_from_tip(&self, bends_rad: &Bends) -> Isometry3<f64> {
        match self {
            Self::Snake(snake) => snake.base_from_tip(first(bends_rad)),
            Self::Segments(segments) => segments.base_from_tip(bends_rad),
        }
    }

    /// The cross-section at the part `along` (0 to 1) of a segment's length. The piece up to there is a shorter one with the same
    /// part of the bend: curvature is constant.
    pub(super) fn section(&self, bends_rad: &Bends, segment: usize, along: f64) -> Section {
        match self {
            Self::Snake(snake) => {
                let bend_rad = first(bends_rad) * along;
                let at_m = snake.tip_pos_in_base_m(bend_rad) * along;
                Section { at_m, base_from_here: snake.base_from_tip_rotation(bend_rad) }
            }
            Self::Segments(segments) => {
                let pose = segments.base_from_part(bends_rad, segment, along);
                Section { at_m: pose.translation.vector, base_from_here: pose.rotation.to_rotation_matrix() }
            }
        }
    }

    /// Every line, segment 1's first.
    pub(super) fn lines(&self) -> Vec<Strand> {
        match self {
            Self::Snake(snake) => {
                let line = |idx| Strand { ends: 0, offset_m: on_circle(snake.r_m(), idx, N_SNAKE_LINES) };
                (0..N_SNAKE_LINES).map(line).collect()
            }
            Self::Segments(segments) => {
                let line = |k| Strand { ends: segments.segment_of(k), offset_m: segments.line_in_disk_m(k).push(0.0) };
                (0..segments.n_lines()).map(line).collect()
            }
        }
    }
}

/// A corner of a regular figure about the middle of a disk, the first on its x.
pub(super) fn on_circle(radius_m: f64, idx: u32, n: u32) -> Vector3<f64> {
    let azimuth_rad = TAU * f64::from(idx) / f64::from(n);
    Vector3::new(azimuth_rad.cos(), azimuth_rad.sin(), 0.0) * radius_m
}

fn bends(values_rad: &[f64]) -> Bends {
    Bends::from_fn(|k, _| values_rad.get(k).copied().unwrap_or(0.0))
}

fn first(bends_rad: &Bends) -> Vector2<f64> {
    Vector2::new(bends_rad[0], bends_rad[1])
}
