//! Learnt values on their way into force: checked, and blended in within a rate for each parameter, so that nothing jumps.

use crate::step::{Refused, check_model};
use krait_ipc::Reason;
use krait_ipc::message::{MAX_LEARNT, ModelUpdate};
use krait_model::{LearntParameter, ModelHash};

/// The newest update, and what it may be.
#[derive(Clone, Debug)]
pub(crate) struct Blend {
    parameters: Vec<LearntParameter>,
    update: Option<ModelUpdate>,
}

impl Blend {
    pub fn new(parameters: &[LearntParameter]) -> Self {
        Self { parameters: parameters.to_vec(), update: None }
    }

    /// Takes an update of a model; the one before stays where this one is refused.
    pub fn note(&mut self, model: ModelHash, update: &ModelUpdate) -> Result<(), Refused> {
        check_model(model, update.model_hash)?;
        let refused = |found: f64, limit: f64| Err(Refused { reason: Reason::ModelUpdateRefused, found, limit });
        if !update.innovation_rms_rad.is_finite() {
            return Err(Refused { reason: Reason::NotFinite, found: update.innovation_rms_rad, limit: f64::MAX });
        }
        if update.learnt().len() != self.parameters.len() {
            return refused(update.learnt().len() as f64, self.parameters.len() as f64);
        }
        for (own, given) in self.parameters.iter().zip(update.learnt()) {
            if (usize::from(given.effect), usize::from(given.parameter)) != (own.effect, own.parameter) {
                return refused(f64::from(given.effect), own.effect as f64);
            }
            if !(own.low..=own.high).contains(&given.value) {
                return refused(given.value, if given.value < own.low { own.low } else { own.high });
            }
        }
        self.update = Some(*update);
        Ok(())
    }

    /// The values in force after the next step, if they are not those of now: each moves towards the newest update by at most
    /// `sds_per_s` prior standard deviations in a second.
    pub fn next(&self, now: &[f64; MAX_LEARNT], sds_per_s: f64, step_s: f64) -> Option<[f64; MAX_LEARNT]> {
        let update = self.update.as_ref()?;
        let mut next = *now;
        for (lane, (own, wanted)) in self.parameters.iter().zip(update.learnt()).enumerate().take(MAX_LEARNT) {
            let largest = sds_per_s * own.learn.sd * step_s;
            next[lane] = now[lane] + (wanted.value - now[lane]).clamp(-largest, largest);
        }
        next.iter().zip(now).any(|(next, now)| next.is_finite() && next != now).then_some(next)
    }

    /// What the newest update says was not explained of the measured shapes, rad; 0 before the first.
    pub fn innovation_rms_rad(&self) -> f64 {
        self.update.map_or(0.0, |update| update.innovation_rms_rad)
    }

    /// Of the newest update; 0 before the first.
    pub fn update_sequence(&self) -> u64 {
        self.update.map_or(0, |update| update.sequence)
    }

    pub fn n_learnt(&self) -> u32 {
        self.parameters.len() as u32
    }
}
