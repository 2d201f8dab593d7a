//! From a bend setpoint to actuator positions q~ = q + eps, the same bytes for the same sequence of setpoints.
//!
//! Problem: find the actuator positions for which the real, hysteretic machine takes the wanted bend. Each line is inverted on
//! its own: its extension at the planned load, its cone friction on the branch of its planned direction, and half its play
//! ahead of it in that direction. The direction is a [`SignMemory`] of the line's own planned displacement, so that nothing
//! depends on time, sampling or noise at rest.
//!
//! Common mode: the printed lambda and f_s are equal on all lines; they only preload the snake. With the signs of motion, the
//! lines' terms differ and their mean is not zero, yet it is not a preload: it is what the lines themselves swallow, and a
//! command with it leaves the internal load at zero. It must not be projected out either, because the projection would move
//! the two other lines whenever one reverses, against their own direction and into their own play.

use super::{Extension, SignMemory};
use crate::parameters::in_range;
use crate::{ParameterError, Snake};
use nalgebra::{Matrix3x2, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// How q becomes q~.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CompensationMode {
    /// q~ = q.
    Off,
    /// Eqs. (15)-(17): extension with the loading branch of the friction on every line.
    Naive,
    /// Eq. (18) with eta and lambda, and with the signs of motion where the physics has them.
    #[default]
    Estimated,
}

/// Settings of a [`Compensator`]. Every key is optional.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CompensatorParameters {
    /// How q becomes q~.
    pub mode: CompensationMode,
    /// Load scale at the start, 1, 0.1 to 10; default 1. Used by mode `estimated`.
    pub eta: f64,
    /// Half-width of the play at the start, m, 0 to 0.002; default 0. Used by mode `estimated`.
    pub lambda_m: f64,
    /// Travel of a line's planned displacement over which its sign of motion turns, m, 1e-7 to 0.001; default 20 micrometres.
    ///
    /// Short follows a reversal more closely, long asks less speed of the actuators: while the sign turns they move faster
    /// than planned by the factor 1 + (2 lambda + stick travel of the cone) / transition.
    pub transition_m: f64,
}

impl Default for CompensatorParameters {
    fn default() -> Self {
        Self { mode: CompensationMode::default(), eta: 1.0, lambda_m: 0.0, transition_m: 20e-6 }
    }
}

/// One step's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensated {
    /// q of Eq. (1), m, push positive.
    pub q_m: Vector3<f64>,
    /// eps = q~ - q, m.
    pub eps_m: Vector3<f64>,
    /// q~, m, push positive: what the actuators shall be told.
    pub q_tilde_m: Vector3<f64>,
    /// Planned loads of the lines at the snake, N, push positive: minimum norm, times eta in mode `estimated`.
    pub tau_n: Vector3<f64>,
    /// alpha = d eps / d bend at constant signs of motion, 3x2, m/rad; zero in mode `off`.
    pub alpha_m_per_rad: Matrix3x2<f64>,
}

/// Turns bends into actuator positions; owns the memory of each line's direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensator {
    snake: Snake,
    parameters: CompensatorParameters,
    signs: SignMemory,
}

impl Compensator {
    /// Starts at the straight pose with every line in the middle of its play.
    ///
    /// # Errors
    /// [`ParameterError`] for a setting that is not finite or out of range.
    pub fn new(snake: Snake, parameters: CompensatorParameters) -> Result<Self, ParameterError> {
        in_range("transition_m", parameters.transition_m, 1e-7, 1e-3, "m")?;
        check(parameters.eta, parameters.lambda_m)?;
        let signs = SignMemory::known(Vector3::zeros(), Vector3::zeros());
        Ok(Self { snake, parameters, signs })
    }

    /// Starts again at a bend (rad) with known signs of motion, each in -1..=1; 0 is the middle of the play.
    pub fn restart(&mut self, bend_rad: Vector2<f64>, signs: Vector3<f64>) {
        self.signs = SignMemory::known(self.snake.q(bend_rad), signs);
    }

    /// Actuator positions for the next bend setpoint, rad.
    ///
    /// A bend that is not finite gives a result that is not finite and leaves the memory as it was.
    ///
    /// # Real-time
    /// No allocation, no loop beyond the three lines.
    pub fn step(&mut self, bend_rad: Vector2<f64>) -> Compensated {
        let q_m = self.snake.q(bend_rad);
        self.signs.advance(q_m, Vector3::repeat(self.parameters.transition_m));
        let Extension { tau_n, eps_m, alpha_m_per_rad } = self.extension(bend_rad);
        Compensated { q_m, eps_m, q_tilde_m: q_m + eps_m, tau_n, alpha_m_per_rad }
    }

    /// Takes other values of eta (1) and lambda (m) from the next step on.
    ///
    /// The command changes at once by what the new values ask for; whoever calls this makes the steps small.
    ///
    /// # Errors
    /// [`ParameterError`] for a value that is not finite or out of range; the old values then stay.
    pub fn set_parameters(&mut self, eta: f64, lambda_m: f64) -> Result<(), ParameterError> {
        check(eta, lambda_m)?;
        self.parameters.eta = eta;
        self.parameters.lambda_m = lambda_m;
        Ok(())
    }

    /// The settings in use.
    pub fn parameters(&self) -> &CompensatorParameters {
        &self.parameters
    }

    /// The signs of motion of the lines after the last step, each in -1..=1.
    pub fn signs(&self) -> Vector3<f64> {
        self.signs.signs()
    }

    fn extension(&self, bend_rad: Vector2<f64>) -> Extension {
        let CompensatorParameters { mode, eta, lambda_m, .. } = self.parameters;
        match mode {
            CompensationMode::Off => Extension {
                tau_n: self.snake.tau_n(bend_rad),
                eps_m: Vector3::zeros(),
                alpha_m_per_rad: Matrix3x2::zeros(),
            },
            CompensationMode::Naive => self.snake.extension_naive(bend_rad),
            CompensationMode::Estimated => {
                self.snake.extension_with_signs(bend_rad, eta, lambda_m, &self.signs.signs())
            }
        }
    }
}

fn check(eta: f64, lambda_m: f64) -> Result<(), ParameterError> {
    in_range("eta", eta, 0.1, 10.0, "(no unit)")?;
    in_range("lambda_m", lambda_m, 0.0, 2e-3, "m")
}
