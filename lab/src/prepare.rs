//! What stands before every fit: outliers found, the noise floor estimated without them, blocks as long as the noise needs.

use crate::cells::Usable;
use crate::machine::MachineUnderTest;
use crate::noise::{FloorSource, NoiseFloor};
use crate::outliers::outliers;
use crate::output_noise::output_factors;
use crate::problem::scale_by_output;
use crate::{LabError, Measurements, Problem, scored_time_s};

/// Measurements ready for a fit.
pub(crate) struct Prepared<'a> {
    /// The measurements without outliers, in blocks.
    pub problem: Problem<'a>,
    /// Their noise.
    pub floors: NoiseFloor,
    /// Rows that stand out from their neighbours.
    pub excluded: Vec<usize>,
    /// Length of the shortest block, s.
    pub shortest_block_s: f64,
    /// The load cells, which count in the problem where they can be used.
    pub loads: Usable,
}

/// Blocks while nothing is known about the noise yet, s.
const FIRST_BLOCK_S: f64 = 4.0;

/// Prepares measurements with the residuals of the machine's model as given.
///
/// # Errors
/// [`LabError`] where the model cannot be computed.
pub(crate) fn prepare<'a>(machine: &'a dyn MachineUnderTest, data: &Measurements) -> Result<Prepared<'a>, LabError> {
    let raw = Problem::new(machine, data.clone(), &[], FIRST_BLOCK_S);
    let mut residual = raw.residual(machine.effects())?;
    let factors = output_factors(&raw, &residual);
    scale_by_output(&mut residual, &factors);
    let raw = raw.by_output(&factors);
    let excluded = outliers(&raw, &residual);
    let floors =
        NoiseFloor::new(&Problem::new(machine, raw.data, &excluded, FIRST_BLOCK_S).by_output(&factors), &residual);
    let shortest_block_s = block_s(&floors, scored_time_s(data));
    let problem = Problem::new(machine, data.clone(), &excluded, shortest_block_s).by_output(&factors);
    let loads = Usable::of(machine, &problem, floors.sigma().map(|(sigma, _)| sigma), shortest_block_s)?;
    let noise = floors.sigma().map(|(sigma, _)| sigma).or(floors.differences).unwrap_or(0.0);
    let problem = problem.with_loads(loads.cells()).with_noise(noise);
    Ok(Prepared { problem, floors, excluded, shortest_block_s, loads })
}

/// Blocks are long enough for the noise's memory, and enough for a test where time allows.
fn block_s(floors: &NoiseFloor, total_s: f64) -> f64 {
    let white = matches!(floors.sigma(), Some((_, FloorSource::White)));
    let wanted = if white { 4.0 } else { 10.0 };
    f64::min(wanted, (total_s / 16.0).max(2.0))
}
