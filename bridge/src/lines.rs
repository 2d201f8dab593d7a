//! How q becomes q~: by the paper's equations or by the chain of a model file, behind one step.

use crate::config::CompensateConfig;
use crate::stage::BridgeError;
use krait_ipc::message::Compensation;
use krait_model::{
    Chain, ChainCompensator, Circumstances, CompensationMode, Compensator, CompensatorParameters, MachineParameters,
    Snake,
};
use nalgebra::{Vector2, Vector3};

/// What a step gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LineStep {
    /// q of Eq. (1), m.
    pub q_m: Vector3<f64>,
    /// q~ = q + eps, m.
    pub q_tilde_m: Vector3<f64>,
    /// Planned loads of the lines at the snake, N.
    pub tau_n: Vector3<f64>,
}

/// The lines' compensation, with its memory.
#[allow(clippy::large_enum_variant, reason = "there is one per process, and the usual mode shall not follow a pointer")]
#[derive(Clone, Debug)]
pub(crate) enum Lines {
    /// The paper's equations.
    Paper(Compensator),
    /// A model file's chain; its memory and its formulas make it large.
    Chain(Box<ChainCompensator>),
}

impl CompensateConfig {
    /// The model's parameters of the paper's equations for this configuration.
    pub fn lines(&self) -> CompensatorParameters {
        let mode = match self.mode {
            Compensation::Off => CompensationMode::Off,
            Compensation::Naive => CompensationMode::Naive,
            // Beside a chain the paper's equations only forecast the actuators' rates.
            Compensation::Estimated | Compensation::Model => CompensationMode::Estimated,
        };
        CompensatorParameters { mode, eta: self.eta, lambda_m: self.lambda_m, transition_m: self.transition_m }
    }
}

impl Lines {
    pub(crate) fn new(
        machine: &MachineParameters,
        config: &CompensateConfig,
        chain: Option<&Chain>,
    ) -> Result<Self, BridgeError> {
        match (config.mode, chain) {
            (Compensation::Model, Some(chain)) => Ok(Self::Chain(Box::new(chain.compensator()?))),
            (Compensation::Model, None) => Err(BridgeError::NoModelFile),
            _ => Ok(Self::Paper(Compensator::new(Snake::new(machine)?, config.lines())?)),
        }
    }

    /// One step; `time_s` counts from any instant that stays the same.
    pub(crate) fn step(&mut self, bend_rad: Vector2<f64>, time_s: f64) -> LineStep {
        match self {
            Self::Paper(lines) => {
                let step = lines.step(bend_rad);
                LineStep { q_m: step.q_m, q_tilde_m: step.q_tilde_m, tau_n: step.tau_n }
            }
            Self::Chain(lines) => {
                let step = lines.step(bend_rad, &Circumstances::at(time_s));
                LineStep { q_m: step.q_m, q_tilde_m: step.q_tilde_m, tau_n: step.tau_n }
            }
        }
    }
}
