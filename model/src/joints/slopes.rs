//! What joints would do if a learnt parameter were a little larger, beside what they do: slopes by differences.
//!
//! where: for each parameter a second predictor goes the same way with the parameter larger by a thousandth of its prior's standard
//! deviation h, memory included, so that slope = (y(parameter + h) - y(parameter)) / h holds through plays and friction.
//!
//! Failure: a law whose positions jump where a parameter changes a little; none of the catalogue's does.

use super::{JointChain, JointPredictor, MAX_JOINTS};
use crate::chain::MAX_LEARNT;
use crate::recursion::Slopes;
use crate::{Circumstances, LearntParameter};

/// The difference, in prior standard deviations.
const DIFFERENCE: f64 = 1e-3;

/// A [`JointPredictor`] with slopes by the parameters that are learnt.
#[derive(Clone, Debug)]
pub(super) struct JointSlopes {
    plain: JointPredictor,
    /// One for each parameter, which is larger there.
    beside: Vec<JointPredictor>,
    lanes: Vec<LearntParameter>,
}

impl JointSlopes {
    pub fn new(chain: &JointChain) -> Self {
        let (plain, lanes) = (chain.predictor(), chain.learnt().to_vec());
        let mut own = Self { beside: vec![plain.clone(); lanes.len()], plain, lanes };
        own.set(&core::array::from_fn(|lane| chain.learnt().get(lane).map_or(f64::NAN, |own| own.start)));
        own
    }

    /// Sets the learnt parameters; what the effects remember stays. Allocates nothing.
    pub fn set(&mut self, values: &[f64; MAX_LEARNT]) {
        for (lane, (own, &value)) in self.lanes.iter().zip(values).enumerate() {
            self.plain.set(own.effect, own.parameter, value);
            for (other, beside) in self.beside.iter_mut().enumerate() {
                let more = if other == lane { DIFFERENCE * own.learn.sd } else { 0.0 };
                beside.set(own.effect, own.parameter, value + more);
            }
        }
    }

    /// The measured positions for the next commands, and their slopes by each parameter, per prior standard deviation.
    pub fn step(&mut self, u: &[f64], at: &Circumstances) -> ([f64; MAX_JOINTS], Slopes<MAX_JOINTS>) {
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
