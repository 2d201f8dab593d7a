//! The diagnosis as a whole: of joints in their own way; of every other machine by the clock that the data have, and by another one
//! where what is left says so, as by another camera of one of several recordings.

use super::answer::{Diagnosis, Verdict};
use super::clock::by_own_clock;
use super::force_joints::by_joints;
use super::locked;
use super::model_free::model_free_rms;
use super::own_camera::by_own_camera;
use super::verdict::by_one_clock;
use crate::machine::{Freed, MachineUnderTest, freed};
use crate::{LabError, Measurements, Offered, Quantity, offered};

/// How to diagnose.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnoseOptions {
    /// Seed of all random numbers; the same seed gives the same bytes, whatever the number of threads.
    pub seed: u64,
    /// At most so many effects of a joint, or of a snake, are sought together, 1 to 5.
    pub max_effects: usize,
    /// Where several recordings are diagnosed together: name and first trial of each.
    pub recordings: Vec<(String, usize)>,
    /// Parameters of the model's own effects that are free: effect's name and parameter's name.
    pub free: Vec<(String, String)>,
    /// Formulas of the user's that take part beside the library's effects.
    pub offered: Vec<Offered>,
    /// Whether all is done once more without a last part of the data, whose error then is that of a model which has not seen it.
    pub is_locked: bool,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            max_effects: 5,
            recordings: Vec::new(),
            free: Vec::new(),
            offered: Vec::new(),
            is_locked: false,
        }
    }
}

impl DiagnoseOptions {
    /// First trial of each recording.
    pub(crate) fn first_trials(&self) -> Vec<usize> {
        first_trials(&self.recordings)
    }
}

/// First trial of each of these recordings; of one recording nothing is said.
pub(crate) fn first_trials(recordings: &[(String, usize)]) -> Vec<usize> {
    if recordings.is_empty() { vec![0] } else { recordings.iter().map(|(_, first)| *first).collect() }
}

/// Says which effect is missing from a machine's model, or none, or that it cannot be said.
///
/// # Errors
/// [`LabError`] where the model as given cannot be computed, or a free parameter does not exist.
pub fn diagnose(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    offered::check(&options.offered, machine, data)?;
    let diagnosis = open_diagnosis(machine, data, options)?;
    let remains = matches!(diagnosis.verdict, Verdict::Partly | Verdict::Unknown) || diagnosis.noise_floor.is_none();
    let model_free_rms = match remains {
        true => model_free_rms(machine, &data.as_found(&diagnosis, &options.first_trials()), &diagnosis)?,
        false => None,
    };
    let locked = options.is_locked.then(|| locked::error(machine, data, options, &diagnosis)).transpose()?.flatten();
    Ok(Diagnosis { model_free_rms, locked, ..diagnosis })
}

impl Measurements {
    /// Where a diagnosis has found that they belong: by the cameras and the clocks of their recordings.
    #[must_use]
    fn as_found(&self, diagnosis: &Diagnosis, first_trials: &[usize]) -> Self {
        self.by_cameras(&diagnosis.cameras, first_trials).by_clocks(&diagnosis.clocks, first_trials)
    }
}

/// The diagnosis without what is asked beside it.
pub(super) fn open_diagnosis(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, LabError> {
    Ok(match machine.as_joints() {
        Some(joints) => {
            let Freed { joints, others, .. } = freed(joints, &options.free)?;
            let options = DiagnoseOptions { free: others, ..options.clone() };
            crate::joint::diagnose(&joints, data, &options)?.sketched(machine, data)?
        }
        // Angle and force are filtered alike and have one clock.
        None if data.quantity == Quantity::Force => by_joints(machine, data, options)?,
        None => {
            let of_one_camera =
                |data: &Measurements| by_own_clock(machine, data, options, |data| by_one_clock(machine, data, options));
            by_own_camera(machine, data, options, of_one_camera)?
        }
    })
}
