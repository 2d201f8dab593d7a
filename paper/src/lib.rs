//! krait-paper: the paper again, from its equations and a simulated bench: tables, figures and errors, each computed when asked for.
//!
//! The bench is the slave's simulated snake, whose plant shares no code with the model that compensates it. The paper's raw
//! data are not available; of its figures we know what they show, not their points. Printed values are constants here
//! and marked as such; every other number is computed.

#![forbid(unsafe_code)]

mod bench;
mod errors;
mod figures;
mod motions;
mod page;
mod table2;
mod table3;
mod text;

use anyhow::Context;
use errors::Finding;
use krait_model::{MachineParameters, Snake};
use krait_report::{Figure, Spread, svg};
use krait_sim::Truth;
use motions::Row as MotionRow;
use serde::Serialize;
use std::path::Path;
use table2::Table2;
use table3::Table3;

pub use bench::default_truth;
pub use text::terminal;

/// The accuracy that the paper asks of compensation, deg.
const GOAL_DEG: f64 = 1.0;

/// Everything that `krait paper` regenerates.
#[derive(Debug, Serialize)]
pub struct Paper {
    /// Table II: friction of the cone.
    pub table_2: Table2,
    /// Table III: ten recursive estimates.
    pub table_3: Table3,
    /// Figs. 8 to 11, and one more with the way back.
    pub figures: Vec<Figure>,
    /// What each compensation reaches where lines reverse.
    pub motions: Vec<MotionRow>,
    /// The paper's errors.
    pub errors: Vec<Finding>,
    /// The line that has to hold.
    pub verdict: Claim,
}

/// Error of the bend over the paper's one-way ramp, deg, and whether the paper's claim comes out.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Claim {
    /// The accuracy asked for, deg.
    pub goal_deg: f64,
    /// Without compensation.
    pub off_deg: Spread,
    /// With Eqs. (15)-(17).
    pub naive_deg: Spread,
    /// With Eq. (18) and the tenth estimate.
    pub estimated_deg: Spread,
    /// Of the benches that differ in nothing but the camera's noise, the part on which the estimate is within the goal (rms).
    pub part_of_seeds_within_goal: f64,
    /// Largest rms error of the estimate on any of them, deg.
    pub worst_rms_of_seeds_deg: f64,
    /// Number of those benches.
    pub n_seeds: u64,
    /// The estimate is within the goal and naive compensation is not, both rms.
    pub holds: bool,
}

impl Paper {
    /// Computes everything on a bench of this truth; takes a fraction of a second.
    ///
    /// # Errors
    /// A bench that refuses a command.
    pub fn compute(truth: &Truth) -> anyhow::Result<Self> {
        let snake = Snake::new(&MachineParameters::default())?;
        let table_2 = table2::fit(&MachineParameters::default()).context("Table II")?;
        let table_3 = table3::run(&snake, truth).context("Table III")?;
        let ramps = figures::Ramps::run(&snake, truth, &table_3)?;
        let verdict = verdict(&snake, truth, &ramps)?;
        Ok(Self {
            figures: figures::all(&snake, &table_3, &ramps),
            motions: motions::compare(&snake, truth)?,
            errors: errors::all(&snake, truth, &table_2, &table_3)?,
            table_2,
            table_3,
            verdict,
        })
    }

    /// Writes every picture and the page into a folder, which is made if it is missing.
    ///
    /// # Errors
    /// A file that cannot be written, by name.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| format!("folder {} cannot be made", folder.display()))?;
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).with_context(|| format!("{} cannot be written", path.display()))
        };
        let mut pictures = Vec::new();
        for figure in &self.figures {
            let svg = svg(figure)?;
            write(&figure.file, &svg)?;
            pictures.push(svg);
        }
        write("index.html", &page::html(self, &pictures))
    }
}

/// The same estimation and ramp on benches whose cameras err differently.
const N_SEEDS: u64 = 100;

fn verdict(snake: &Snake, truth: &Truth, ramps: &figures::Ramps) -> anyhow::Result<Claim> {
    let (mut n_within, mut worst_rms_of_seeds_deg) = (0_u32, 0.0_f64);
    for seed in 1..=N_SEEDS {
        let mut other = truth.clone();
        other.camera.seed = seed;
        let estimate = table3::run(snake, &other)?;
        let ramp = figures::estimated_ramp(snake, &other, &estimate)?;
        let rms_deg = bench::bend_errors_deg(&ramp).rms;
        n_within += u32::from(rms_deg <= GOAL_DEG);
        worst_rms_of_seeds_deg = worst_rms_of_seeds_deg.max(rms_deg);
    }
    let [off_deg, naive_deg, estimated_deg] =
        [&ramps.off, &ramps.naive, &ramps.estimated].map(|ramp| bench::bend_errors_deg(ramp));
    Ok(Claim {
        goal_deg: GOAL_DEG,
        off_deg,
        naive_deg,
        estimated_deg,
        part_of_seeds_within_goal: f64::from(n_within) / N_SEEDS as f64,
        worst_rms_of_seeds_deg,
        n_seeds: N_SEEDS,
        holds: estimated_deg.rms <= GOAL_DEG && naive_deg.rms > GOAL_DEG,
    })
}
