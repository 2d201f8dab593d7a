//! How q becomes q~: by the paper's equations or by the chain of a model file, behind one step.

use crate::config::CompensateConfig;
use crate::stage::BridgeError;
use krait_ipc::message::Compensation;
use krait_model::{
    Chain, ChainCompensator, ChainMemory, Circumstances, CompensationMode, Compensator, CompensatorParameters,
    MachineParameters, Snake,
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

/// What the lines' compensation remembers.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "it lives on the stack for the time of a step")]
pub(crate) enum LineMemory {
    Paper(Compensator),
    Chain(ChainMemory),
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

    pub(crate) fn memory(&self) -> LineMemory {
        match self {
            Self::Paper(lines) => LineMemory::Paper(*lines),
            Self::Chain(lines) => LineMemory::Chain(lines.memory()),
        }
    }

    /// Forgets every step since this was the memory.
    pub(crate) fn restore(&mut self, memory: &LineMemory) {
        match (self, memory) {
            (Self::Paper(lines), LineMemory::Paper(before)) => *lines = *before,
            (Self::Chain(lines), LineMemory::Chain(before)) => lines.restore(before),
            (Self::Paper(_), LineMemory::Chain(_)) | (Self::Chain(_), LineMemory::Paper(_)) => {
                debug_assert!(false, "a memory of other lines");
            }
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
