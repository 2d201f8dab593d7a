//! The model that the lab gets of generated segments: elastic lines alone, or with the friction and play that every line has.

use super::SegmentsRecipe;
use krait_model::model_file::{Machine, ModelFile};
use krait_model::segments::{LineParameters, SegmentParameters, SegmentsParameters};
use krait_model::{ChainError, MachineParameters};
use krait_sim::SegmentEffectsTruth;

/// Azimuths of the lines that end at a segment (from 0): the three of each lie between those of the others.
pub(super) fn azimuths_deg(segment: usize) -> [f64; 3] {
    let first = [0.0, 60.0, 30.0][segment % 3];
    [first, first + 120.0, first + 240.0]
}

/// The paper's dimensions in each of so many segments.
pub(super) fn parameters(n_segments: usize) -> SegmentsParameters {
    let own = MachineParameters::default();
    let segment = |k: usize| SegmentParameters {
        l_m: own.l_m,
        e_pa: own.e_pa,
        d_outer_m: own.d_outer_m,
        d_inner_m: own.d_inner_m,
        l_d_m: own.l_d_m,
        l_c_m: own.l_c_m,
        lines: azimuths_deg(k).map(|deg| LineParameters { azimuth_rad: deg.to_radians(), radius_m: own.r_m }).to_vec(),
    };
    SegmentsParameters { segments: (0..n_segments).map(segment).collect(), ..SegmentsParameters::default() }
}

impl SegmentsRecipe {
    /// The model that the lab gets: what is hidden is all that it lacks.
    ///
    /// # Errors
    /// [`ChainError`] for a number of segments that no model has.
    pub fn model(&self) -> Result<String, ChainError> {
        let own = SegmentEffectsTruth::default();
        let effects = [
            ("stiffness-scale", "eta", own.load_scale),
            ("inside-extension", "share", own.inside),
            ("static-friction", "f_s_n", own.f_s_n),
            ("cone-friction", "mu", own.mu),
            ("backlash", "half_width_m", 0.5 * own.play_m),
        ];
        let effect =
            |(kind, key, value): (&str, &str, f64)| format!("\n[[effect]]\nkind = {kind:?}\n{key} = {value:?}\n");
        let known: String = if self.is_ideal() { String::new() } else { effects.into_iter().map(effect).collect() };
        let machine = Machine::Segments(parameters(self.n_segments));
        Ok(ModelFile::new(machine, Vec::new(), Vec::new())?.to_toml() + &known)
    }

    /// Whether the machine has elastic lines and nothing else: an effect of all segments is hidden, which the model must lack.
    pub(super) fn is_ideal(&self) -> bool {
        self.hidden.iter().any(|(kind, _)| kind.is_of_all())
    }
}
