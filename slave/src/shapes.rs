//! Measured shapes of the drive's own camera, published by the slave unless another program does.

use crate::process::SlaveError;
use crate::{Drive, SeenShape, ShapeReading};
use krait_ipc::message::Shape;
use krait_ipc::{Bus, IpcError, Writer};
use serde::{Deserialize, Serialize};

/// Who measures the shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShapeSource {
    /// The drive's own camera, where it has one.
    #[default]
    Camera,
    /// Another program, through `krait shape`; the drive's camera is not published.
    External,
}

impl ShapeSource {
    /// The word of the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::External => "external",
        }
    }
}

/// The channel `shape`, if it is the slave's.
pub struct Shapes {
    writer: Option<Writer<Shape>>,
    n_seen: u64,
}

impl Shapes {
    /// Becomes the writer if the drive has a camera and nobody else shall measure.
    ///
    /// # Errors
    /// [`SlaveError::ShapeTaken`] or [`SlaveError::Ipc`].
    pub fn open(bus: &Bus, drive: &impl Drive, source: ShapeSource) -> Result<Self, SlaveError> {
        let is_own = drive.has_camera() && source == ShapeSource::Camera;
        let taken = |error| match error {
            IpcError::SecondWriter { instance, .. } => SlaveError::ShapeTaken { instance },
            other => SlaveError::Ipc(other),
        };
        Ok(Self { writer: is_own.then(|| bus.writer()).transpose().map_err(taken)?, n_seen: 0 })
    }

    /// Publishes what the camera saw; readers are woken by [`Shapes::wake`].
    ///
    /// # Errors
    /// As [`Writer::put`].
    pub fn put(&mut self, now_ns: i64, seen: &ShapeReading) -> Result<(), IpcError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        self.n_seen += 1;
        let shape = match seen.seen {
            SeenShape::Bend(bend_rad) => {
                let shape = Shape::of_bend(self.n_seen, seen.exposure_ns, now_ns, bend_rad);
                let shape = shape.with_sigma(seen.sigma_rad).with_jaw(seen.jaw_rad, seen.sigma_rad);
                Shape { q_tilde_m: seen.q_tilde_m, ..shape }
            }
            SeenShape::Joints(joints_rad, n) => {
                let positions_rad = joints_rad.get(..n).unwrap_or(&joints_rad);
                let mut shape = Shape::of_joints(self.n_seen, seen.exposure_ns, now_ns, positions_rad);
                shape.joint_variances_rad2.iter_mut().take(n).for_each(|own| *own = seen.sigma_rad * seen.sigma_rad);
                shape
            }
        };
        writer.put(&shape)
    }

    /// Wakes whoever waits for shapes.
    ///
    /// # Errors
    /// As [`Writer::wake`].
    pub fn wake(&mut self) -> Result<(), IpcError> {
        self.writer.as_mut().map_or(Ok(()), Writer::wake)
    }

    /// Shapes published.
    pub fn n_sent(&self) -> u64 {
        self.writer.as_ref().map_or(0, Writer::n_sent)
    }
}
