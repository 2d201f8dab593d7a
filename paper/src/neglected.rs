//! What the paper neglects: the lines' extension inside the snake, and friction spread along the cone's arcs.

use krait_model::{MachineParameters, Snake};
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// Radius of the cone's two arcs, m: 58 mm of line with 41 deg and a straight piece between them.
const ARC_RADIUS_M: f64 = 20e-3;
/// Bends at which the error is computed, deg.
const AT_DEG: [f64; 3] = [30.0, 60.0, 80.0];

/// The two terms.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Neglected {
    /// L/(EA) beside C, 1.
    pub inside_part_of_c: f64,
    /// Error of the bend at 30, 60 and 80 deg if the extension inside is left out and all else is known, deg.
    pub inside_bend_error_deg: [f64; 3],
    /// eps_c = m (tau + f_s)/K_c of a line on the loading branch, 1.
    pub m_loading: f64,
    /// The same while it is drawn back.
    pub m_unloading: f64,
    /// e^(2 mu phi), which the paper takes for the first.
    pub capstan: f64,
    /// How much too wide the loop is with e^(+-2 mu phi).
    pub loop_too_wide: f64,
}

/// Computes both with eta of the bench.
pub fn neglected(snake: &Snake, machine: &MachineParameters, eta: f64) -> Neglected {
    let arc_m = ARC_RADIUS_M * machine.phi_rad;
    let straight_m = machine.l_c_m - 2.0 * arc_m;
    let half = 0.5 * snake.capstan().ln();
    let mean = |x: f64| (arc_m * (x.exp() - 1.0) / x * (1.0 + x.exp()) + straight_m * x.exp()) / machine.l_c_m;
    let (m_loading, m_unloading) = (mean(half), mean(-half));
    let g = snake.capstan();
    Neglected {
        inside_part_of_c: snake.l_m() / snake.axial_stiffness_n() / snake.loading_compliance_m_per_n(),
        inside_bend_error_deg: AT_DEG.map(|deg| inside_error_deg(snake, eta, deg)),
        m_loading,
        m_unloading,
        capstan: g,
        loop_too_wide: (g - 1.0 / g) / (m_loading - m_unloading),
    }
}

/// The bend that a snake with extension inside takes, by bisection, minus the wanted one at which it was left out.
///
/// Friction and play are the same on both sides of a one-way ramp and drop out.
fn inside_error_deg(snake: &Snake, eta: f64, wanted_deg: f64) -> f64 {
    let compliance = snake.loading_compliance_m_per_n();
    let told = |b: f64, inside: f64| {
        let bend = Vector2::new(b, 0.0);
        let (q_m, tau_n): (Vector3<f64>, Vector3<f64>) = (snake.q(bend), snake.tau_n(bend) * eta);
        let given = Vector3::from_fn(|i, _| {
            let inside_m = inside * (snake.l_m() + q_m[i]) / snake.axial_stiffness_n();
            q_m[i] + tau_n[i] * (compliance + inside_m)
        });
        snake.bend_from_q(given).x
    };
    let wanted = wanted_deg.to_radians();
    let target = told(wanted, 0.0);
    let (mut low, mut high) = (0.5 * wanted, 1.5 * wanted);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if told(middle, 1.0) < target { low = middle } else { high = middle }
    }
    low.to_degrees() - wanted_deg
}
