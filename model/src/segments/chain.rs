//! A model of segments, checked: the machine with those of the snake's effects that it can have.

use super::friction::Friction;
use super::of_segments::OfSegments;
use super::seen::Seen;
use super::sharing::LoadSharing;
use super::statics::Stiffnesses;
use super::{
    Bends, BendsByBends, LineValues, SegmentCompensator, SegmentPredictor, Segments, SegmentsError, SegmentsParameters,
};
use crate::effects::EffectKind;
use crate::{ChainError, EffectSetting, LearntParameter, MAX_LEARNT};

/// The effects that segments can have for all of them alike; those of one segment are [`crate::effects::SegmentEffect`]s.
pub const SEGMENT_EFFECTS: [EffectKind; 6] = [
    EffectKind::StiffnessScale,
    EffectKind::InsideExtension,
    EffectKind::StaticFriction,
    EffectKind::ConeFriction,
    EffectKind::Backlash,
    EffectKind::Latency,
];

/// Segments with their effects.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentChain {
    pub(super) machine: Segments,
    pub(super) sharing: LoadSharing,
    pub(super) transition_m: f64,
    /// eta on the elastic load of every segment.
    pub(super) eta: f64,
    /// Share of its load that a line carries inside the snake.
    pub(super) inside: f64,
    pub(super) friction: Friction,
    pub(super) half_width_m: f64,
    /// How late the camera shows the bends, s, where the model says so; no command follows it.
    pub(super) delay_s: Option<f64>,
    /// What single segments have beside these.
    pub(super) of_segments: OfSegments,
    /// What a user's formulas add to the bends that the camera shows.
    pub(super) seen: Seen,
    learnt: Vec<LearntParameter>,
    /// The effect of each of them; each has one parameter, and all of them can be learnt.
    pub(super) lanes: Vec<EffectKind>,
}

impl SegmentChain {
    /// Checks machine and effects.
    ///
    /// # Errors
    /// [`ChainError`] for a machine that is none, and an effect that segments cannot have or have already.
    pub fn new(parameters: &SegmentsParameters, effects: &[EffectSetting]) -> Result<Self, ChainError> {
        let machine = Segments::new(parameters)?;
        let value = |kind: EffectKind, key, without| {
            let own = effects.iter().find(|effect| effect.kind() == kind);
            own.and_then(|effect| effect.value(key)).unwrap_or(without)
        };
        for (second, effect) in effects.iter().enumerate() {
            let name = effect.kind().name();
            let is_own = matches!(effect.kind(), EffectKind::OfSegment(_) | EffectKind::Formula);
            if !SEGMENT_EFFECTS.contains(&effect.kind()) && !is_own {
                return Err(ChainError::OtherMachine { name, expected: "segments" });
            }
            if let Some(first) = effects[..second].iter().position(|before| before.label() == effect.label()) {
                let name = effect.label().to_owned();
                return Err(ChainError::Twice { name, first: first + 1, second: second + 1 });
            }
        }
        let place = |kind| effects.iter().position(|effect| effect.kind() == kind);
        if place(EffectKind::ConeFriction) < place(EffectKind::StaticFriction)
            && place(EffectKind::ConeFriction).is_some()
        {
            return Err(SegmentsError::ConeFirst.into());
        }
        let mu = value(EffectKind::ConeFriction, "mu", 0.0);
        let learnt = crate::chain::learnt(effects)?;
        let lanes = learnt.iter().filter_map(|own| effects.get(own.effect)).map(EffectSetting::kind).collect();
        Ok(Self {
            sharing: LoadSharing {
                low_n: LineValues::repeat(parameters.low_n),
                high_n: LineValues::repeat(parameters.high_n),
                preload_n: parameters.preload_n,
            },
            transition_m: parameters.settings.transition_m,
            eta: value(EffectKind::StiffnessScale, "eta", 1.0),
            inside: value(EffectKind::InsideExtension, "share", 0.0),
            friction: Friction::new(value(EffectKind::StaticFriction, "f_s_n", 0.0), capstan(mu, &machine)),
            half_width_m: value(EffectKind::Backlash, "half_width_m", 0.0),
            delay_s: place(EffectKind::Latency).map(|_| value(EffectKind::Latency, "delay_s", 0.0)),
            of_segments: OfSegments::new(effects, &machine)?,
            seen: Seen::new(effects)?,
            learnt,
            lanes,
            machine,
        })
    }

    /// The segments themselves.
    pub fn machine(&self) -> &Segments {
        &self.machine
    }

    /// How the lines share their loads.
    pub fn sharing(&self) -> &LoadSharing {
        &self.sharing
    }

    /// The factor eta on the elastic load of all segments.
    pub fn eta(&self) -> f64 {
        self.eta
    }

    /// Moments that hold these bends, N m: eta grad E, eta that of all segments times each one's own.
    pub fn moments_nm(&self, bends_rad: &Bends) -> Bends {
        self.moments_with_nm(bends_rad, &self.machine.stiffnesses(bends_rad))
    }

    /// The same where the stiffnesses at these bends are known.
    pub(super) fn moments_with_nm(&self, bends_rad: &Bends, stiffnesses: &Stiffnesses) -> Bends {
        let grad_nm = self.machine.grad_energy_with_nm(bends_rad, stiffnesses);
        (grad_nm * self.eta).component_mul(&self.of_segments.eta)
    }

    /// How fast these moments change while the bends do, N m/s.
    pub(super) fn moments_vel_nm_per_s(
        &self,
        bends_rad: &Bends,
        vel_rad_per_s: &Bends,
        stiffnesses: &Stiffnesses,
    ) -> Bends {
        let rates = self.machine.grad_energy_vel_nm_per_s(bends_rad, vel_rad_per_s, stiffnesses);
        (rates * self.eta).component_mul(&self.of_segments.eta)
    }

    /// How these moments change with the bends, N m/rad.
    pub(super) fn moment_slopes_nm(&self, bends_rad: &Bends) -> BendsByBends {
        let mut slopes = self.machine.hess_energy_nm(bends_rad) * self.eta;
        for (mut row, eta) in slopes.row_iter_mut().zip(self.of_segments.eta.iter()) {
            row *= *eta;
        }
        slopes
    }

    /// Friction of a line.
    pub(super) fn friction(&self, line: usize) -> Friction {
        self.friction.and(&self.of_segments.friction[self.machine.segment_of(line)])
    }

    /// Half the play of a line, m.
    pub(super) fn half_width_m(&self, line: usize) -> f64 {
        self.half_width_m + self.of_segments.half_width_m[self.machine.segment_of(line)]
    }

    /// The parameters that are learnt while the machine moves, in the order of the effects.
    pub fn learnt(&self) -> &[LearntParameter] {
        &self.learnt
    }

    /// The values that these begin with; NaN behind the last.
    pub(super) fn start_values(&self) -> [f64; MAX_LEARNT] {
        core::array::from_fn(|lane| self.learnt.get(lane).map_or(f64::NAN, |own| own.start))
    }

    /// Sets the learnt parameters, in their order; a value that is not finite stays as it is. Allocates nothing.
    pub(super) fn set(&mut self, values: &[f64; MAX_LEARNT]) {
        for (lane, &value) in values.iter().enumerate().take(self.lanes.len()).filter(|(_, value)| value.is_finite()) {
            match self.lanes[lane] {
                EffectKind::StiffnessScale => self.eta = value,
                EffectKind::InsideExtension => self.inside = value,
                EffectKind::StaticFriction => self.friction.f_s_n = value,
                EffectKind::ConeFriction => {
                    self.friction = self.friction.with_capstan(capstan(value, &self.machine));
                }
                EffectKind::Backlash => self.half_width_m = value,
                EffectKind::Latency => self.delay_s = Some(value),
                // No other effect is one of SEGMENT_EFFECTS.
                _ => {}
            }
        }
    }

    /// A compensator that begins straight and at rest.
    pub fn compensator(&self) -> SegmentCompensator {
        SegmentCompensator::new(self)
    }

    /// A predictor that begins straight, with every actuator at zero and in the middle of its play.
    pub fn predictor(&self) -> SegmentPredictor {
        SegmentPredictor::new(self)
    }
}

/// g of the cone's two arcs.
pub(super) fn capstan(mu: f64, machine: &Segments) -> f64 {
    (2.0 * mu * machine.phi_rad).exp()
}
