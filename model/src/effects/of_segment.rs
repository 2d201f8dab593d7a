//! Effects of one segment alone: the laws that a machine of segments has for all, and the camera's, each beside what acts on all.
//!
//! `backlash-2` is the play that the lines of segment 2 have beside `backlash`: half-widths, forces and coefficients of friction add,
//! load scales multiply. Where an effect of one segment is absent it is neutral.

use super::definition::{Class, Definition, Hook, ParameterSpec, effect, parameter};
use super::shape::SENSOR;
use super::{EffectKind, encoder, friction, moment};

/// What an effect of one segment does there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentLaw {
    /// `stiffness-scale`: eta on the moments of the segment's backbones and of every line in it.
    StiffnessScale,
    /// `static-friction` of the lines that end there.
    StaticFriction,
    /// `cone-friction` of the lines that end there.
    ConeFriction,
    /// `backlash` of the lines that end there.
    Backlash,
    /// `camera-scale`: the camera's scale of the segment's bend vector.
    CameraScale,
    /// `camera-offset` of the segment's bend vector.
    CameraOffset,
}

/// An effect of one segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SegmentEffect {
    /// What it does.
    pub law: SegmentLaw,
    /// The segment, from 0 at the base.
    pub segment: usize,
}

/// Segments that have effects of their own.
const N: usize = crate::segments::MAX_SEGMENTS;
const ONE_S: &str = "of one segment";

static STIFFNESS: [Definition; N] =
    named(moment::STIFFNESS_SCALE, ["stiffness-scale-1", "stiffness-scale-2", "stiffness-scale-3"], &ETA);
static STATIC: [Definition; N] =
    named(friction::STATIC_FRICTION, ["static-friction-1", "static-friction-2", "static-friction-3"], &F_S);
static CONE: [Definition; N] =
    named(friction::CONE_FRICTION, ["cone-friction-1", "cone-friction-2", "cone-friction-3"], &MU);
static PLAY: [Definition; N] = named(encoder::BACKLASH, ["backlash-1", "backlash-2", "backlash-3"], &HALF_WIDTH);
static SCALE: [Definition; N] = named(CAMERA_SCALE, ["camera-scale-1", "camera-scale-2", "camera-scale-3"], &RELATIVE);
static OFFSET: [Definition; N] =
    named(CAMERA_OFFSET, ["camera-offset-1", "camera-offset-2", "camera-offset-3"], &OFFSETS);

static ETA: [ParameterSpec; 1] =
    [parameter("eta", "1", [0.1, 10.0], 1.0, "beside that of all segments, a factor; 1: as all").fixed(ONE_S)];
static F_S: [ParameterSpec; 1] =
    [parameter("f_s_n", "N", [0.0, 20.0], 0.0, "added to that of all lines; 0: as all").fixed(ONE_S)];
static MU: [ParameterSpec; 1] =
    [parameter("mu", "1", [0.0, 1.0], 0.0, "added to that of all lines; 0: as all").fixed(ONE_S)];
static HALF_WIDTH: [ParameterSpec; 1] =
    [parameter("half_width_m", "m", [0.0, 0.002], 0.0, "added to that of all lines; 0: as all").fixed(ONE_S)];
static RELATIVE: [ParameterSpec; 1] =
    [parameter("relative", "1", [-0.2, 0.2], 0.0, "0.5 to 2 %, engineering").fixed(ONE_S)];
static OFFSETS: [ParameterSpec; 2] = [
    parameter("offset_x_rad", "rad", [-0.5, 0.5], 0.0, "tilt of the view; 0.2 to 1 deg, engineering").fixed(ONE_S),
    parameter("offset_y_rad", "rad", [-0.5, 0.5], 0.0, "tilt of the view in the other axis").fixed(ONE_S),
];

const CAMERA_SCALE: Definition =
    Definition { inverse: SENSOR, ..effect("camera-scale", Hook::Meas, Class::Proportional, "b_m = (1 + relative) b") };
const CAMERA_OFFSET: Definition = Definition {
    inverse: SENSOR,
    ..effect("camera-offset", Hook::Meas, Class::FirstHarmonic, "b_m = b + (offset_x, offset_y)")
};

/// A definition for each segment; what it is called besides is the effect of all segments.
const fn named(of_all: Definition, names: [&'static str; N], parameters: &'static [ParameterSpec]) -> [Definition; N] {
    let own = Definition { also: &[], parameters, ..of_all };
    let [first, second, third] = names;
    [Definition { name: first, ..own }, Definition { name: second, ..own }, Definition { name: third, ..own }]
}

impl SegmentLaw {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::StiffnessScale,
        Self::StaticFriction,
        Self::ConeFriction,
        Self::Backlash,
        Self::CameraScale,
        Self::CameraOffset,
    ];

    /// The effect that does the same in all segments; of the camera's, a snake's.
    pub fn of_all(self) -> EffectKind {
        match self {
            Self::StiffnessScale => EffectKind::StiffnessScale,
            Self::StaticFriction => EffectKind::StaticFriction,
            Self::ConeFriction => EffectKind::ConeFriction,
            Self::Backlash => EffectKind::Backlash,
            Self::CameraScale => EffectKind::CameraScale,
            Self::CameraOffset => EffectKind::CameraOffset,
        }
    }

    fn definitions(self) -> &'static [Definition; N] {
        match self {
            Self::StiffnessScale => &STIFFNESS,
            Self::StaticFriction => &STATIC,
            Self::ConeFriction => &CONE,
            Self::Backlash => &PLAY,
            Self::CameraScale => &SCALE,
            Self::CameraOffset => &OFFSET,
        }
    }
}

impl SegmentEffect {
    /// Every one, segment after segment.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..N).flat_map(|segment| SegmentLaw::ALL.into_iter().map(move |law| Self { law, segment }))
    }

    /// The effect of a name: `backlash-2`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|own| own.definition().name == name)
    }

    /// What is known about it.
    pub fn definition(self) -> &'static Definition {
        // No segment is beyond the last one: `from_name` and `all` make none.
        let all = self.law.definitions();
        all.get(self.segment).unwrap_or(&all[0])
    }

    /// What it acts on, in words: `the lines of segment 2`.
    pub fn acts_on(self) -> String {
        let number = self.segment + 1;
        match self.law {
            SegmentLaw::StiffnessScale | SegmentLaw::CameraScale | SegmentLaw::CameraOffset => {
                format!("segment {number}")
            }
            SegmentLaw::StaticFriction | SegmentLaw::ConeFriction | SegmentLaw::Backlash => {
                format!("the lines of segment {number}")
            }
        }
    }
}

/// The name of an effect without the number of its segment: `backlash` of `backlash-2`; every other name as it is.
pub fn without_segment(name: &str) -> &str {
    let of_one = SegmentEffect::from_name(name).and_then(|_| name.rsplit_once('-'));
    of_one.map_or(name, |(of_all, _)| of_all)
}
