//! The model that a chain runs with: a snake, joints whose commands and positions are brought to SI, or segments in series.

use crate::config::ResolveConfig;
use crate::joints_error::JointsError;
use crate::step::BridgeError;
use krait_ipc::message::MAX_JOINTS;
use krait_model::joints::JointChain;
use krait_model::model_file::{Machine, ModelFile};
use krait_model::segments::{MAX_SEGMENTS, SegmentChain, SegmentsParameters};
use krait_model::{Chain, KnownColumns, LearntParameter, ModelHash};

/// A model that every process of a running chain can use.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a process has one, from its start to its end")]
pub enum LiveModel {
    /// A snake of three lines.
    Snake(Chain),
    /// Cable-driven joints.
    Joints(JointModel),
    /// Snakes in series on any lines.
    Segments(SegmentModel),
}

/// Segments that can be driven.
#[derive(Clone, Debug)]
pub struct SegmentModel {
    chain: SegmentChain,
    parameters: SegmentsParameters,
    hash: ModelHash,
}

/// Joints that can be driven: their chain, and what its units are in SI.
#[derive(Clone, Debug)]
pub struct JointModel {
    pub(crate) chain: JointChain,
    hash: ModelHash,
    pub(crate) u: Unit,
    pub(crate) y: Unit,
}

/// A unit of commands or positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Radians or metres in one.
    pub si: f64,
    /// Whether it is one of length, not of angle.
    pub is_length: bool,
}

impl Unit {
    /// The unit of a name, if it is one of angle or of length.
    pub fn of(name: &str) -> Option<Self> {
        let (si, is_length) = match name {
            "rad" => (1.0, false),
            "mrad" => (1e-3, false),
            "deg" => (1f64.to_radians(), false),
            "m" => (1.0, true),
            "mm" => (1e-3, true),
            "um" => (1e-6, true),
            _ => return None,
        };
        Some(Self { si, is_length })
    }
}

impl LiveModel {
    /// The model of a file for a machine that gives time stamps and nothing else besides.
    ///
    /// # Errors
    /// [`BridgeError`] says why no running chain can use it.
    pub fn of(file: &ModelFile) -> Result<Self, BridgeError> {
        let uncalibrated = |(key, of): (_, &str)| BridgeError::Uncalibrated { key, of: of.to_owned() };
        let calibrated = || file.first_open().map_or(Ok(()), |open| Err(uncalibrated(open)));
        if let Some(chain) = file.chain(KnownColumns::default())? {
            chain.compensator()?;
            calibrated()?;
            return Ok(Self::Snake(chain));
        }
        if let (Some(chain), Machine::Segments(parameters)) = (file.segment_chain()?, file.machine()) {
            calibrated()?;
            return Ok(Self::Segments(SegmentModel { chain, parameters: parameters.clone(), hash: file.hash() }));
        }
        let columns = KnownColumns { time: true, ..KnownColumns::default() };
        let chain = file.joint_chain(columns)?;
        match (chain, file.machine()) {
            (Some(chain), Machine::Joints(joints)) => {
                let n = chain.n();
                if n > MAX_JOINTS {
                    return Err(JointsError::TooMany { found: n }.into());
                }
                let unit =
                    |key, name: &str| Unit::of(name).ok_or_else(|| JointsError::Unit { key, found: name.to_owned() });
                let (u, y) = (unit("u_unit", &joints.u_unit)?, unit("y_unit", &joints.y_unit)?);
                chain.compensator(krait_model::joints::JointInverseSettings::default())?;
                calibrated()?;
                Ok(Self::Joints(JointModel { chain, hash: file.hash(), u, y }))
            }
            _ => Err(JointsError::TooMany { found: 0 }.into()),
        }
    }

    /// Which model it is.
    pub fn hash(&self) -> ModelHash {
        match self {
            Self::Snake(chain) => chain.hash(),
            Self::Joints(joints) => joints.hash,
            Self::Segments(segments) => segments.hash,
        }
    }

    /// What it learns while the machine moves.
    pub fn learnt(&self) -> &[LearntParameter] {
        match self {
            Self::Snake(chain) => chain.learnt(),
            Self::Joints(joints) => joints.chain.learnt(),
            Self::Segments(segments) => segments.chain.learnt(),
        }
    }

    /// Whether `estimate` has work: it watches every snake and all segments for changes, of joints it only learns parameters.
    pub fn needs_estimate(&self) -> bool {
        !matches!(self, Self::Joints(_)) || !self.learnt().is_empty()
    }

    /// The snake's chain, if it is one.
    pub fn snake(&self) -> Option<&Chain> {
        match self {
            Self::Snake(chain) => Some(chain),
            Self::Joints(_) | Self::Segments(_) => None,
        }
    }

    /// The joints, if it is some.
    pub fn joints(&self) -> Option<&JointModel> {
        match self {
            Self::Snake(_) | Self::Segments(_) => None,
            Self::Joints(joints) => Some(joints),
        }
    }

    /// The segments, if it is some.
    pub fn segments(&self) -> Option<&SegmentModel> {
        match self {
            Self::Snake(_) | Self::Joints(_) => None,
            Self::Segments(segments) => Some(segments),
        }
    }
}

impl SegmentModel {
    /// The segments with their effects.
    pub fn chain(&self) -> &SegmentChain {
        &self.chain
    }

    /// What they are made of.
    pub fn parameters(&self) -> &SegmentsParameters {
        &self.parameters
    }

    /// Which model it is.
    pub fn hash(&self) -> ModelHash {
        self.hash
    }

    /// The largest bend of each segment that `resolve` asks for, rad: the configuration's, and no more than its strain limit allows.
    pub fn max_bend_rad(&self, config: &ResolveConfig) -> [f64; MAX_SEGMENTS] {
        core::array::from_fn(|segment| self.chain.machine().max_bend_rad(segment).min(config.max_bend_rad))
    }
}

impl JointModel {
    /// How many joints there are, 1 to 8.
    pub fn n(&self) -> usize {
        self.chain.n()
    }

    /// Which model it is.
    pub fn hash(&self) -> ModelHash {
        self.hash
    }

    /// Whether the model's commands are lengths of cable, not angles of a capstan.
    pub fn is_driven_by_lengths(&self) -> bool {
        self.u.is_length
    }

    /// Whether the joints slide: their positions are lengths.
    pub fn slides(&self) -> bool {
        self.y.is_length
    }
}
