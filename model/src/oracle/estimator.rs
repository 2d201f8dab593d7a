//! Learns the load scale eta and the play's half-width lambda from measured shape while the snake works: Eqs. (18)-(23).
//!
//! Measurement: z = q~ - q(b_measured) is what the lines gave. Where the direction s_i of every line is known,
//!     z_i - g_i f_s s_i / K_c = eta (1/K_d + g_i/K_c) tau_i + lambda s_i,   g_i = e^(+-2 mu phi) as s_i and the load say,
//! which is linear in eta and lambda: the corrected Eq. (20).
//!
//! where:
//! - tau_i are the minimum-norm loads at the measured bend. Its noise enters z and tau together and pulls eta down, in
//!   proportion to the square of the noise: by 0.0013 at 0.3 deg and 0.008 at 1 deg in motions up to 60 deg, which is 0.04
//!   and 0.2 deg of bend at most. Loads from the predicted bend would be free of it, but would fix in place, by way of the
//!   memory, whatever is wrong with the prediction at the start.
//! - Only contrasts between lines are used. What is common to all three is internal preload and says nothing about the shape;
//!   with all directions known there are two contrasts, with one line in its reversal there is one.
//! - The noise of a contrast w is sigma w^T (J_q + alpha): the camera's, through the geometry of the lines.
//! - Directions come from the encoders, at their rate and without the camera's noise. A line counts only after it has
//!   travelled through its play and its stick range since its last reversal.
//!
//! Failure: at rest nothing new is said and nothing is forgotten; a motion that leaves two lines without a direction is left
//! out; a measurement that the model cannot explain is an outlier, and a long series of them reopens the estimate.

use super::least_squares::LeastSquares;
use super::measurement::{Rows, Scene};
use super::{EstimatorParameters, SignMemory};
use crate::{ParameterError, Snake};
use core::f64::consts::PI;
use nalgebra::{Vector2, Vector3};

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstimateOutcome {
    /// It changed the estimate.
    Used,
    /// It did not, for the reason given.
    LeftOut(LeftOutReason),
}

/// Why a measurement did not change the estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOutReason {
    /// The actuators have not moved since the last used measurement.
    AtRest,
    /// Two or more lines are in a reversal, or have not moved enough since the start.
    NoDirection,
    /// The model cannot explain it.
    Outlier,
    /// A number is not finite, or the bend lies beyond pi.
    NotFinite,
}

/// Parameters with their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Load scale eta, 1, within its bounds.
    pub eta: f64,
    /// Half-width lambda of the play, m, within its bounds.
    pub lambda_m: f64,
    /// Standard deviation of eta, 1.
    pub eta_sd: f64,
    /// Standard deviation of lambda, m.
    pub lambda_sd_m: f64,
    /// Root mean square over the lines of the newest innovations, m; 0 before the first.
    pub innovation_rms_m: f64,
    /// Measurements used since the start.
    pub n_used: u64,
    /// Measurements left out since the start, for any reason.
    pub n_left_out: u64,
}

/// Recursive estimator; owns the memory of each line's direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimator {
    snake: Snake,
    parameters: EstimatorParameters,
    fit: LeastSquares,
    lines: Option<Lines>,
    innovation_mean_square_m2: Option<f64>,
    innovation: Option<Vector2<f64>>,
    n_outliers_in_a_row: u32,
    n_used: u64,
    n_left_out: u64,
}

/// What the encoders have told so far.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lines {
    /// Positions without noise: the encoders through a play of the dead travel.
    position_m: Vector3<f64>,
    position_at_last_use_m: Option<Vector3<f64>>,
    signs: SignMemory,
    /// Loads at the last measured shape, for the width of the stick range.
    tau_n: Vector3<f64>,
}

/// A line whose sign is closer to an end than this has gone through its reversal; encoder noise may take it back a little.
const SETTLED: f64 = 0.95;
/// Reversals are taken longer than predicted by this factor, so that a line counts too late rather than too early.
const REVERSAL_MARGIN: f64 = 1.2;
/// Half a second of a 60 Hz camera: no glitch lasts that long, so that the machine must have changed.
const OUTLIERS_THAT_REOPEN: u32 = 30;
/// Weight of the newest innovation in the reported mean square: about the last 30 measurements.
const INNOVATION_WEIGHT: f64 = 1.0 / 30.0;

impl Estimator {
    /// Starts from the configured values with every line's direction unknown.
    ///
    /// # Errors
    /// [`ParameterError`] as [`EstimatorParameters::check`].
    pub fn new(snake: Snake, parameters: EstimatorParameters) -> Result<Self, ParameterError> {
        parameters.check()?;
        let EstimatorParameters { eta, lambda_m, eta_sd, lambda_sd_m, .. } = parameters;
        Ok(Self {
            snake,
            parameters,
            fit: LeastSquares::new(Vector2::new(eta, lambda_m), Vector2::new(eta_sd, lambda_sd_m)),
            lines: None,
            innovation_mean_square_m2: None,
            innovation: None,
            n_outliers_in_a_row: 0,
            n_used: 0,
            n_left_out: 0,
        })
    }

    /// Follows the encoders, m, push positive, at their full rate: a reversal between two shapes must not be missed.
    ///
    /// Positions that are not finite are ignored. Feed the samples in order, and those up to an exposure before its shape.
    ///
    /// # Real-time
    /// No allocation, no loop beyond the three lines.
    pub fn observe_encoders(&mut self, q_tilde_m: Vector3<f64>) {
        if !q_tilde_m.iter().all(|q| q.is_finite()) {
            return;
        }
        let reversal_travel_m = self.reversal_travel_m();
        let dead_m = self.parameters.dead_travel_m;
        let lines = self.lines.get_or_insert_with(|| Lines::at(q_tilde_m));
        lines.position_m = lines.position_m.zip_map(&q_tilde_m, |held, new| held.clamp(new - dead_m, new + dead_m));
        lines.signs.advance(lines.position_m, reversal_travel_m);
    }

    /// Takes a measured bend vector (rad) with the encoder positions (m) at its exposure, `dt_s` after the previous one.
    ///
    /// # Real-time
    /// No allocation, no loop beyond the three lines.
    pub fn observe_shape(
        &mut self,
        bend_measured_rad: Vector2<f64>,
        q_tilde_m: Vector3<f64>,
        dt_s: f64,
    ) -> EstimateOutcome {
        match self.try_shape(bend_measured_rad, q_tilde_m, dt_s) {
            Ok(()) => {
                self.n_used += 1;
                EstimateOutcome::Used
            }
            Err(reason) => {
                self.n_left_out += 1;
                EstimateOutcome::LeftOut(reason)
            }
        }
    }

    /// What the estimate before it did not explain of the newest shape, in standard deviations along the axes of the base
    /// frame (second one without what it shares with the first), outliers too; `None` where the shape could not be compared, or not in both.
    pub fn innovation(&self) -> Option<Vector2<f64>> {
        self.innovation
    }

    /// The estimate as it stands.
    pub fn estimate(&self) -> Estimate {
        let [eta, lambda_m] = self.bounded().into();
        let [eta_sd, lambda_sd_m] = self.fit.sd().into();
        Estimate {
            eta,
            lambda_m,
            eta_sd,
            lambda_sd_m,
            innovation_rms_m: self.innovation_mean_square_m2.unwrap_or(0.0).sqrt(),
            n_used: self.n_used,
            n_left_out: self.n_left_out,
        }
    }

    fn try_shape(&mut self, bend_rad: Vector2<f64>, q_tilde_m: Vector3<f64>, dt_s: f64) -> Result<(), LeftOutReason> {
        self.innovation = None;
        let finite = bend_rad.norm() < PI && q_tilde_m.iter().all(|q| q.is_finite()) && dt_s >= 0.0 && dt_s.is_finite();
        if !finite {
            return Err(LeftOutReason::NotFinite);
        }
        let tau_n = self.snake.tau_n(bend_rad);
        let rest_travel_m = self.parameters.rest_travel_m;
        let lines = self.lines.as_mut().ok_or(LeftOutReason::NoDirection)?;
        lines.tau_n = tau_n;
        if lines.position_at_last_use_m.is_some_and(|last| (lines.position_m - last).amax() < rest_travel_m) {
            return Err(LeftOutReason::AtRest);
        }
        let position_m = lines.position_m;
        let signs = lines.settled_signs();
        let scene = Scene {
            snake: &self.snake,
            estimate: self.bounded(),
            sigma_bend_rad: self.parameters.sigma_bend_rad,
            bend_rad,
            q_tilde_m,
        };
        let rows = scene.rows(&signs).ok_or(LeftOutReason::NoDirection)?;
        self.take(&rows, dt_s)?;
        if let Some(lines) = &mut self.lines {
            lines.position_at_last_use_m = Some(position_m);
        }
        Ok(())
    }

    fn take(&mut self, rows: &Rows, dt_s: f64) -> Result<(), LeftOutReason> {
        let used = rows.scaled();
        let limit = self.parameters.outlier_sigmas.powi(2);
        let innovation = self.fit.innovations(used);
        self.innovation = (used.len() == 2).then_some(innovation);
        if innovation.norm_squared() > limit {
            self.n_outliers_in_a_row += 1;
            if self.n_outliers_in_a_row >= OUTLIERS_THAT_REOPEN {
                self.n_outliers_in_a_row = 0;
                self.fit.reopen();
            }
            return Err(LeftOutReason::Outlier);
        }
        self.n_outliers_in_a_row = 0;
        self.fit.fade((-dt_s / self.parameters.memory_s).exp());
        for row in used {
            self.fit.take(row);
        }
        let newest_m2 = rows.innovation_mean_square_m2();
        let old_m2 = self.innovation_mean_square_m2.unwrap_or(newest_m2);
        self.innovation_mean_square_m2 = Some(old_m2 + INNOVATION_WEIGHT * (newest_m2 - old_m2));
        Ok(())
    }

    fn bounded(&self) -> Vector2<f64> {
        let p = &self.parameters;
        self.fit.within(Vector2::new(p.eta_min, 0.0), Vector2::new(p.eta_max, p.lambda_max_m))
    }

    /// Travel of an encoder from one direction of its line to the other: play and stick range, and what is not known of them.
    fn reversal_travel_m(&self) -> Vector3<f64> {
        let [eta, lambda_m] = self.bounded().into();
        let tau_n = self.lines.map_or_else(Vector3::zeros, |lines| lines.tau_n);
        let uncertain_m = 4.0 * self.fit.sd().y;
        tau_n.map(|t| REVERSAL_MARGIN * (2.0 * lambda_m + self.snake.cone_stick_travel_m(eta * t)) + uncertain_m)
    }
}

impl Lines {
    fn at(q_tilde_m: Vector3<f64>) -> Self {
        Self {
            position_m: q_tilde_m,
            position_at_last_use_m: None,
            signs: SignMemory::unknown(q_tilde_m),
            tau_n: Vector3::zeros(),
        }
    }

    /// +1 or -1 for each line that moves in a known direction, `None` for one in its reversal.
    fn settled_signs(&self) -> [Option<f64>; 3] {
        let signs = self.signs.signs();
        [0, 1, 2].map(|i| (signs[i].abs() >= SETTLED).then(|| signs[i].signum()))
    }
}
