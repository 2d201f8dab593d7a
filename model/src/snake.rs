//! The constants that follow from a machine's parameters, computed once, so that control steps only multiply and add.

use crate::{MachineParameters, ParameterError};
use core::f64::consts::PI;
use nalgebra::Matrix3x2;

/// A checked machine. Small, copyable, immutable; every formula of the model is a method of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snake {
    pub(crate) l_m: f64,
    pub(crate) r_m: f64,
    /// E I, N m2.
    pub(crate) bending_stiffness_nm2: f64,
    area_m2: f64,
    inertia_m4: f64,
    axial_stiffness_n: f64,
    /// Outer radius of every backbone.
    pub(crate) outer_radius_m: f64,
    k_d_n_per_m: f64,
    k_c_n_per_m: f64,
    /// 1/K_d; zero where the lines are taken for rigid.
    pub(crate) c_d_m_per_n: f64,
    /// 1/K_c; zero where the lines are taken for rigid.
    pub(crate) c_c_m_per_n: f64,
    /// 3 L / (E A): what the snake itself gives along its axis per newton in each line.
    pub(crate) axial_m_per_n: f64,
    pub(crate) phi_rad: f64,
    /// d q / d bend; see [`Snake::j_q_bend`].
    pub(crate) j_q_bend: Matrix3x2<f64>,
}

impl Snake {
    /// Checks the parameters and derives the constants.
    ///
    /// # Errors
    /// [`ParameterError`] as [`MachineParameters::check`].
    pub fn new(parameters: &MachineParameters) -> Result<Self, ParameterError> {
        parameters.check()?;
        let MachineParameters { l_m, r_m, e_pa, d_outer_m, d_inner_m, l_d_m, l_c_m, phi_rad, rigid_lines } =
            *parameters;
        let give = if rigid_lines { 0.0 } else { 1.0 };
        let area_m2 = PI / 4.0 * (d_outer_m.powi(2) - d_inner_m.powi(2));
        let inertia_m4 = PI / 64.0 * (d_outer_m.powi(4) - d_inner_m.powi(4));
        let axial_stiffness_n = e_pa * area_m2;
        // cos and sin of 120 and 240 degrees, written out so that the three rows sum to exactly zero.
        let (c, s) = (0.5, 3.0_f64.sqrt() / 2.0);
        let j_q_bend = Matrix3x2::new(-1.0, 0.0, c, s, c, -s) * r_m;
        Ok(Self {
            l_m,
            r_m,
            bending_stiffness_nm2: e_pa * inertia_m4,
            area_m2,
            inertia_m4,
            axial_stiffness_n,
            outer_radius_m: 0.5 * d_outer_m,
            k_d_n_per_m: axial_stiffness_n / l_d_m,
            k_c_n_per_m: axial_stiffness_n / l_c_m,
            c_d_m_per_n: give * l_d_m / axial_stiffness_n,
            c_c_m_per_n: give * l_c_m / axial_stiffness_n,
            axial_m_per_n: 3.0 * l_m / axial_stiffness_n,
            phi_rad,
            j_q_bend,
        })
    }

    /// Length L of the primary backbone, m.
    pub fn l_m(&self) -> f64 {
        self.l_m
    }

    /// Pitch radius r, m.
    pub fn r_m(&self) -> f64 {
        self.r_m
    }

    /// Cross-section A of a backbone, m2.
    pub fn area_m2(&self) -> f64 {
        self.area_m2
    }

    /// Second moment of area I of a backbone, m4.
    pub fn inertia_m4(&self) -> f64 {
        self.inertia_m4
    }

    /// Axial stiffness E A of a backbone, N.
    pub fn axial_stiffness_n(&self) -> f64 {
        self.axial_stiffness_n
    }

    /// Stiffness K_d = E A / L_d of a line in the holder, N/m.
    pub fn k_d_n_per_m(&self) -> f64 {
        self.k_d_n_per_m
    }

    /// Stiffness K_c = E A / L_c of a line in the cone, N/m.
    pub fn k_c_n_per_m(&self) -> f64 {
        self.k_c_n_per_m
    }

    /// Compliance 1/K_d + 1/K_c of a line without friction, m/N.
    pub fn frictionless_compliance_m_per_n(&self) -> f64 {
        self.c_d_m_per_n + self.c_c_m_per_n
    }
}
