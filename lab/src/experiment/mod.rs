//! The next experiment: a motion put together from moves that tell the look-alikes at hand apart, and what it would decide.
//!
//! Each move begins and ends at rest in the same place. How much it tells of a pair of look-alikes follows from what both would show
//! (`separation`); moves are taken by what they tell per second until every pair is told apart, or no move helps (`plan`). All stay
//! within what the data at hand show of the machine, a snake's within 60 deg and 1 rad/s, below the limits that a chain has by default.

mod ground;
mod moves;
mod plan;
mod script;
mod separation;

pub use script::BEGINS;
pub use separation::{Pair, Separation};

use crate::diagnose::{Diagnosis, FoundEffect};
use crate::free::free_variables;
use crate::joint::told;
use crate::machine::{FreeJoints, MachineUnderTest};
use crate::{LabError, Measurements};
use ground::Ground;
use krait_model::model_file::Machine;
use moves::Move;
use separation::{Answer, Rivals};

/// The next experiment.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Its moves in words, in their order.
    pub moves: Vec<String>,
    /// Length, s.
    pub seconds: f64,
    /// What it would decide between look-alikes; `None` where there are none.
    pub separation: Option<Separation>,
    /// The motion as a table (CSV): tip velocities of a snake in the columns of `krait run --master script`; commands of joints, in
    /// the model's unit.
    pub script: String,
}

/// The experiment that suits a diagnosis, for recordings with these names and first trials; `None` for machines that the lab cannot
/// move: of kind force, and joints that stood still.
///
/// # Errors
/// [`LabError::Chain`] where the model makes no chain.
pub fn experiment(
    machine: &dyn MachineUnderTest,
    description: &Machine,
    data: &Measurements,
    diagnosis: &Diagnosis,
    recordings: &[(String, usize)],
) -> Result<Option<Experiment>, LabError> {
    let alike = diagnosis.effects.iter().find(|effect| effect.class.len() > 1);
    let Some(ground) = Ground::new(description, data, diagnosis, alike.and_then(|effect| effect.joint)) else {
        return Ok(None);
    };
    let Some(alike) = alike else { return Ok(Some(showing(&ground)?)) };
    let own = diagnosis.terms.clone();
    let sigma = sigma(diagnosis, machine, data.n_outputs);
    let planned = match &diagnosis.calibrated {
        Some(joints) => {
            let machine = FreeJoints::new(joints, data, &diagnosis.calibration, recordings);
            let place = joints.effects().len();
            let mut effects = own;
            effects.insert(place, machine.effects()[place].clone());
            let variables = told(joints, free_variables(&machine, data, &[])?);
            planned(&ground, Answer { machine: &machine, effects, variables, sigma }, data, alike)?
        }
        None => {
            let variables = free_variables(machine, data, &[])?;
            planned(&ground, Answer { machine, effects: own, variables, sigma }, data, alike)?
        }
    };
    Ok(Some(match planned {
        Some(planned) => planned,
        None => showing(&ground)?,
    }))
}

/// The experiment without look-alikes: every move once shows most.
fn showing(ground: &Ground) -> Result<Experiment, LabError> {
    let moves = ground.moves();
    let all: Vec<usize> = (0..moves.len()).collect();
    ended(ground, &moves, &all, None)
}

/// The experiment that tells the look-alikes of an effect apart; `None` where no two of them can be fitted.
fn planned(
    ground: &Ground,
    answer: Answer,
    data: &Measurements,
    alike: &FoundEffect,
) -> Result<Option<Experiment>, LabError> {
    let Some(rivals) = Rivals::new(answer, data, alike)? else { return Ok(None) };
    let moves = ground.moves();
    let told = rivals.told_by(ground, &moves)?;
    let seconds: Vec<f64> = moves.iter().map(|own| ground.seconds(&own.path)).collect();
    let mut picked = plan::picked(&told, &seconds, Separation::ENOUGH);
    picked.sort_unstable();
    let mut separation = rivals.separation(ground, &ground.joined(&moves, &picked))?;
    // Together moves tell more than each alone: those that are not needed go, the longest first.
    let mut longest: Vec<usize> = (0..picked.len()).collect();
    longest.sort_by(|a, b| seconds[picked[*b]].total_cmp(&seconds[picked[*a]]));
    let mut keep = vec![true; picked.len()];
    for place in longest {
        keep[place] = false;
        let fewer: Vec<usize> = picked.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(k, _)| *k).collect();
        let without = match fewer.is_empty() {
            true => None,
            false => Some(rivals.separation(ground, &ground.joined(&moves, &fewer))?),
        };
        match without.filter(|without| plan::does_as_well(without, &separation)) {
            Some(without) => separation = without,
            None => keep[place] = true,
        }
    }
    let picked: Vec<usize> = picked.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(k, _)| *k).collect();
    Ok(Some(ended(ground, &moves, &picked, Some(separation))?))
}

/// Standard deviation of an output: the noise floor, or where the data do not tell it what is left, which is no less.
fn sigma(diagnosis: &Diagnosis, machine: &dyn MachineUnderTest, n_outputs: usize) -> f64 {
    let length = diagnosis.noise_floor.unwrap_or(diagnosis.final_heldout_rms);
    length / machine.error_unit().1 / (n_outputs as f64).sqrt()
}

fn ended(
    ground: &Ground,
    moves: &[Move],
    picked: &[usize],
    separation: Option<Separation>,
) -> Result<Experiment, LabError> {
    let path = ground.joined(moves, picked);
    let words: Vec<String> = picked.iter().map(|&k| moves[k].words.clone()).collect();
    Ok(Experiment {
        seconds: ground.seconds(&path),
        separation,
        script: script::script(ground, &words, &path)?,
        moves: words,
    })
}
