//! What joints would do if a learnt parameter were a little larger, beside what they do: slopes by differences.
//!
//! where: for each parameter a second predictor goes the same way with the parameter larger by a thousandth of its prior's standard
//! deviation h, memory included, so that slope = (y(parameter + h) - y(parameter)) / h holds through plays and friction.
//!
//! Failure: a law whose positions jump where a parameter changes a little; none of the catalogue's does. New values move nothing that is
//! remembered: a play or a friction remembers where it was, and comes to what they make of it when the joint turns or slides.

use super::{JointChain, JointPredictor, MAX_JOINTS};
use crate::chain::MAX_LEARNT;
use crate::recursion::Slopes;
use crate::vector_learner::SlopedPredictor;
use crate::{Circumstances, LearntParameter};

/// The difference, in prior standard deviations.
const DIFFERENCE: f64 = 1e-3;

/// A [`JointPredictor`] with slopes by the parameters that are learnt.
#[derive(Clone, Debug)]
pub struct JointSlopes {
    plain: JointPredictor,
    /// One for each parameter, which is larger there.
    beside: Vec<JointPredictor>,
    lanes: Vec<LearntParameter>,
}

impl JointSlopes {
    pub(super) fn new(chain: &JointChain) -> Self {
        let (plain, lanes) = (chain.predictor(), chain.learnt().to_vec());
        let mut own = Self { beside: vec![plain.clone(); lanes.len()], plain, lanes };
        own.set(&core::array::from_fn(|lane| chain.learnt().get(lane).map_or(f64::NAN, |own| own.start)));
        own
    }
}

impl SlopedPredictor<MAX_JOINTS, MAX_JOINTS> for JointSlopes {
    fn set(&mut self, values: &[f64; MAX_LEARNT]) {
        for (lane, (own, &value)) in self.lanes.iter().zip(values).enumerate() {
            self.plain.set(own.effect, own.parameter, value);
            for (other, beside) in self.beside.iter_mut().enumerate() {
                let more = if other == lane { DIFFERENCE * own.learn.sd } else { 0.0 };
                beside.set(own.effect, own.parameter, value + more);
            }
        }
    }

    fn step(&mut self, u: &[f64; MAX_JOINTS], at: &Circumstances) -> ([f64; MAX_JOINTS], Slopes<MAX_JOINTS>) {
        let u = &u[..self.plain.n()];
        let mut y = [0.0; MAX_JOINTS];
        y.iter_mut().zip(self.plain.step(u, at)).for_each(|(own, y)| *own = *y);
        let mut slopes = Slopes::zeros();
        for (lane, beside) in self.beside.iter_mut().enumerate() {
            for (joint, (there, here)) in beside.step(u, at).iter().zip(&y).enumerate() {
                slopes[(joint, lane)] = (there - here) / DIFFERENCE;
            }
        }
        (y, slopes)
    }
}
