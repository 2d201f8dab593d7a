//! What emulated actuators share behind their shafts: a machine whose loads follow from where all of them are.

use core::fmt::{self, Debug, Formatter};
use std::sync::{Arc, Mutex, PoisonError};

/// From where all shafts are, counts, what each pulls with: part of its largest, in the direction in which that drives the encoder.
type Loads = dyn FnMut(&[f64]) -> Vec<f64> + Send;

/// A machine that servos, or CAN drives, move together.
#[derive(Clone)]
pub struct Coupling {
    loads: Arc<Mutex<Loads>>,
}

impl Coupling {
    /// A machine: `loads` is given the shafts' places, counts, in the order of the bus's actuators, and answers what each pulls with,
    /// part of its largest (of a CAN drive: of its rated torque), in the direction in which that drives the encoder. Actuators behind the
    /// last answer carry nothing of it.
    pub fn new(loads: impl FnMut(&[f64]) -> Vec<f64> + Send + 'static) -> Self {
        Self { loads: Arc::new(Mutex::new(loads)) }
    }

    pub(crate) fn loads(&self, places: &[f64]) -> Vec<f64> {
        let mut loads = self.loads.lock().unwrap_or_else(PoisonError::into_inner);
        loads(places)
    }
}

impl Debug for Coupling {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Coupling").finish_non_exhaustive()
    }
}
