//! The channels that viewers draw without an extension: topic and public Foxglove type of each.

use crate::channel::Schema;

/// A derived channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum View {
    /// Measured and wanted pose of the tip as frames `tip` and `tip_setpoint` in `base`.
    Transforms,
    /// CRTK `measured_cp`: the tip's pose by the camera.
    MeasuredCp,
    /// CRTK `setpoint_cp`: the tip's pose that is asked for.
    SetpointCp,
    /// CRTK `measured_js` of the actuators: encoders and loads.
    MeasuredJs,
    /// CRTK `setpoint_js` of the actuators: what the drives were told.
    SetpointJs,
    /// Backbones and disks as lines.
    Scene,
    /// Reasons, operating states and marks as sentences.
    Log,
}

impl View {
    /// Every derived channel, in the order of [`View::index`].
    pub const ALL: [Self; 7] = [
        Self::Transforms,
        Self::MeasuredCp,
        Self::SetpointCp,
        Self::MeasuredJs,
        Self::SetpointJs,
        Self::Scene,
        Self::Log,
    ];

    /// Place in [`View::ALL`].
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name in the file.
    pub fn topic(self) -> &'static str {
        match self {
            Self::Transforms => "/tf",
            Self::MeasuredCp => "/snake/measured_cp",
            Self::SetpointCp => "/snake/setpoint_cp",
            Self::MeasuredJs => "/snake/actuators/measured_js",
            Self::SetpointJs => "/snake/actuators/setpoint_js",
            Self::Scene => "/snake/scene",
            Self::Log => "/log",
        }
    }

    /// The view with a topic, or `None`.
    pub fn from_topic(topic: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|view| view.topic() == topic)
    }

    /// Its protobuf type.
    pub fn schema(self) -> Schema {
        macro_rules! schema {
            ($name:literal, $file:literal) => {
                Schema {
                    name: concat!("foxglove.", $name),
                    descriptors: include_bytes!(concat!(env!("OUT_DIR"), "/", $file, ".fds")),
                    version: 1,
                }
            };
        }
        match self {
            Self::Transforms => schema!("FrameTransforms", "frame_transforms"),
            Self::MeasuredCp | Self::SetpointCp => schema!("PoseInFrame", "pose_in_frame"),
            Self::MeasuredJs | Self::SetpointJs => schema!("JointStates", "joint_states"),
            Self::Scene => schema!("SceneUpdate", "scene_update"),
            Self::Log => schema!("Log", "log"),
        }
    }
}
