//! What `krait calibrate friction` and `play` measure at single lines, of a snake or of segments: the machine's part in it.

use anyhow::bail;
use krait_model::MachineParameters;
use krait_model::effects::without_segment;
use krait_model::model_file::{Machine, ModelFile};
use std::path::Path;

/// The lines of a machine that were taken off it.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinesAlone {
    /// Angle of each of the cone's two arcs, rad.
    pub phi_rad: f64,
    /// How many there are.
    pub n_lines: u32,
}

impl LinesAlone {
    /// Of a model file, or of the paper's snake where there is none yet. `effects` are those that the readings will give a value to.
    ///
    /// # Errors
    /// One sentence: a machine without such lines, or one whose segments have an effect of their own beside these.
    pub(super) fn of(file: Option<&ModelFile>, model: &Path, effects: &[&str]) -> anyhow::Result<Self> {
        let Some(file) = file else {
            return Ok(Self { phi_rad: MachineParameters::default().phi_rad, n_lines: 3 });
        };
        let of_one = |name: &&str| without_segment(name) != *name && effects.contains(&without_segment(name));
        if let Some(name) = file.effects().iter().map(|effect| effect.setting().kind().name()).find(of_one) {
            bail!(
                "the model file {} has {name}, which is added to what all lines have, so that readings of all lines give no one value; give a \
                 file without it, and find what is one segment's own with `krait lab fit`",
                model.display()
            );
        }
        match file.machine() {
            Machine::Snake(snake) => Ok(Self { phi_rad: snake.parameters.phi_rad, n_lines: 3 }),
            Machine::Segments(own) => {
                let n_lines = own.segments.iter().map(|segment| segment.lines.len() as u32).sum();
                Ok(Self { phi_rad: own.phi_rad, n_lines })
            }
            other => bail!(
                "the model file {} is of kind {}, expected a snake or segments, whose lines run through a cone; give another",
                model.display(),
                other.kind()
            ),
        }
    }
}
