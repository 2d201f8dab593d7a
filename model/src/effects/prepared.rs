//! What every effect's step is given: its constants, the machine's constants, and the circumstances of the step.

use super::EffectKind;
use super::friction::mean_along_cone;
use super::real::Real;
use core::f64::consts::PI;

/// The largest number of parameters of one effect.
pub const MAX_PARAMETERS: usize = 10;

/// One effect of a chain, ready to run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prepared<P> {
    pub kind: EffectKind,
    /// Its place in the chain.
    pub effect: usize,
    /// Parameters in the order of the definition, some replaced by constants that follow from them.
    pub c: [P; MAX_PARAMETERS],
    /// Where its memory begins.
    pub state: usize,
    /// Which formula it is, for formulas.
    pub formula: usize,
}

/// Constants of the machine that effects use, SI.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants {
    pub l_m: f64,
    pub r_m: f64,
    pub bending_stiffness_nm2: f64,
    pub c_d_m_per_n: f64,
    pub c_c_m_per_n: f64,
    /// 3 L / (E A).
    pub axial_m_per_n: f64,
    pub l_d_m: f64,
    pub phi_rad: f64,
    pub d_outer_m: f64,
}

/// Circumstances of one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Now {
    pub time_s: f64,
    /// Time since the step before, s, never negative.
    pub dt_s: f64,
    /// As given, NaN where the column is missing; see [`Now::stem_angle_rad`].
    pub stem_column_rad: f64,
    /// As given, NaN where the column is missing; see [`Now::temperature_c`].
    pub temperature_column_c: f64,
    /// Whether memory is updated.
    pub commit: bool,
    /// Whether memory starts anew here: every play centred, everything slow settled.
    pub fresh: bool,
}

impl Now {
    /// Angle of the flexible stem, limited to a turn either way.
    pub(crate) fn stem_angle_rad(&self) -> Option<f64> {
        (!self.stem_column_rad.is_nan()).then(|| self.stem_column_rad.clamp(-2.0 * PI, 2.0 * PI))
    }

    /// Temperature, limited to -100 to 400 degrees Celsius.
    pub(crate) fn temperature_c(&self) -> Option<f64> {
        (!self.temperature_column_c.is_nan()).then(|| self.temperature_column_c.clamp(-100.0, 400.0))
    }
}

impl<P: Real> Prepared<P> {
    /// Turns parameters into constants where that saves work in the steps.
    pub(crate) fn new(
        kind: EffectKind,
        effect: usize,
        parameters: &[P; MAX_PARAMETERS],
        machine: &Constants,
        state: usize,
        formula: usize,
    ) -> Self {
        Self { kind, effect, c: Self::constants(kind, parameters, machine), state, formula }
    }

    /// Parameters as the steps use them.
    pub(crate) fn constants(
        kind: EffectKind,
        parameters: &[P; MAX_PARAMETERS],
        machine: &Constants,
    ) -> [P; MAX_PARAMETERS] {
        let mut c = *parameters;
        match kind {
            EffectKind::ConeFriction => {
                c[0] = (parameters[0] * P::constant(2.0 * machine.phi_rad)).exp();
                c[1] = P::constant(1.0) / c[0];
            }
            EffectKind::DistributedCapstan => {
                let bend = parameters[0] * P::constant(machine.phi_rad);
                c[0] = (bend + bend).exp();
                c[1] = P::constant(1.0) / c[0];
                c[2] = mean_along_cone(bend, parameters[1]);
                c[3] = mean_along_cone(-bend, parameters[1]);
            }
            EffectKind::LineBuckling => {
                let k = machine.l_d_m / (4.0 * machine.bending_stiffness_nm2);
                c[0] = parameters[0] * parameters[0] * P::constant(k);
            }
            EffectKind::SuperelasticSoftening => {
                c[0] = parameters[0] * P::constant(2.0 * machine.l_m / machine.d_outer_m);
            }
            _ => {}
        }
        c
    }
}
