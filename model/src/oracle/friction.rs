//! Friction of a line in the cone: the load at the actuator for a load at the snake, Eqs. (12)-(13).
//!
//! The paper always uses the loading branch, tau~ = e^(2 mu phi) (tau + f_s). Physically both f_s and the exponent take the
//! sign of the line's motion: with x = tau + f_s s, tau~ = x e^(2 mu phi) where x and the motion s point the same way (the
//! actuator drives the line against its load), x e^(-2 mu phi) where they do not. Both branches are continuous in tau.

use crate::Snake;

/// Coefficient mu of friction in the cone, 1: Eq. (13), Table II.
pub const MU: f64 = 0.1727;
/// Friction f_s of a bent-in line at no load, N: Eq. (13), Table II.
pub const F_S_N: f64 = 1.959;

/// Load at the actuator and its slope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeLoad {
    /// tau~, N, push positive.
    pub tau_tilde_n: f64,
    /// d tau~ / d tau, 1.
    pub slope: f64,
}

impl Snake {
    /// Capstan factor e^(2 mu phi) of the cone, 1.
    pub fn capstan(&self) -> f64 {
        (2.0 * MU * self.phi_rad).exp()
    }

    /// Compliance 1/K_d + e^(2 mu phi)/K_c of a line on the loading branch of Eq. (13), m/N.
    pub fn loading_compliance_m_per_n(&self) -> f64 {
        self.c_d_m_per_n + self.capstan() * self.c_c_m_per_n
    }

    /// Eq. (13) as printed: the loading branch whatever the line does, f_s added to pushed and pulled lines alike.
    pub fn cone_load_as_printed(&self, tau_n: f64) -> ConeLoad {
        ConeLoad { tau_tilde_n: self.capstan() * (tau_n + F_S_N), slope: self.capstan() }
    }

    /// Eq. (13) with the sign of the line's motion.
    ///
    /// `sign` in -1..=1: +1 while the line is pushed, -1 while it is drawn back; between them the two branches are blended
    /// in proportion, which is how a stuck line passes from one to the other.
    pub fn cone_load_with_sign(&self, tau_n: f64, sign: f64) -> ConeLoad {
        let (pushed, drawn) = (self.pushed(tau_n), self.pushed(-tau_n));
        let (w_pushed, w_drawn) = (0.5 * (1.0 + sign), 0.5 * (1.0 - sign));
        ConeLoad {
            tau_tilde_n: w_pushed * pushed.tau_tilde_n - w_drawn * drawn.tau_tilde_n,
            slope: w_pushed * pushed.slope + w_drawn * drawn.slope,
        }
    }

    /// Travel of the actuator, m, while the line in the cone sticks between the two branches at this load.
    pub fn cone_stick_travel_m(&self, tau_n: f64) -> f64 {
        (self.pushed(tau_n).tau_tilde_n + self.pushed(-tau_n).tau_tilde_n) * self.c_c_m_per_n
    }

    /// The branch of a line that is pushed; the other one is its mirror image.
    fn pushed(&self, tau_n: f64) -> ConeLoad {
        let x = tau_n + F_S_N;
        let slope = if x >= 0.0 { self.capstan() } else { 1.0 / self.capstan() };
        ConeLoad { tau_tilde_n: slope * x, slope }
    }
}

#[cfg(test)]
mod tests {
    use super::F_S_N;
    use crate::{MachineParameters, Snake};

    fn snake() -> Snake {
        Snake::new(&MachineParameters::default()).unwrap()
    }

    #[test]
    fn a_pushed_line_under_push_follows_the_printed_branch() {
        let snake = snake();
        for tau_n in [0.0, 3.0, 30.0] {
            assert_eq!(snake.cone_load_with_sign(tau_n, 1.0), snake.cone_load_as_printed(tau_n));
        }
    }

    #[test]
    fn the_branches_of_a_heavily_loaded_line_differ_by_the_square_of_the_capstan_factor() {
        let snake = snake();
        let slopes = [1.0, -1.0].map(|s| snake.cone_load_with_sign(20.0, s).slope);
        assert!((slopes[0] / slopes[1] - snake.capstan().powi(2)).abs() < 1e-12);
    }

    #[test]
    fn pushing_needs_more_than_drawing_back_and_the_gap_is_the_stick_travel() {
        let snake = snake();
        for tau_n in [-25.0, -1.0, 0.0, 1.0, 25.0] {
            let [pushed, drawn] = [1.0, -1.0].map(|s| snake.cone_load_with_sign(tau_n, s).tau_tilde_n);
            assert!(pushed > drawn);
            let travel_m = (pushed - drawn) / snake.k_c_n_per_m();
            assert!((travel_m - snake.cone_stick_travel_m(tau_n)).abs() < 1e-15);
        }
    }

    #[test]
    fn each_branch_is_continuous_where_friction_takes_all_of_the_load() {
        let snake = snake();
        for sign in [1.0, -1.0] {
            let at = -sign * F_S_N;
            let [a, b] = [-1e-9, 1e-9].map(|d| snake.cone_load_with_sign(at + d, sign).tau_tilde_n);
            assert!((a - b).abs() < 1e-8 && a != b);
        }
    }
}
