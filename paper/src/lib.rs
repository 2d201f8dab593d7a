//! krait-paper: the paper again, from its equations and a simulated bench: tables, figures, claims and errors, each computed when asked for.
//!
//! The bench is the simulated snake, whose plant shares no code with the model that compensates it. The paper's text, captions
//! and tables are at hand, its raw data and the points of its figures are not. Printed values are constants here and marked
//! as such; every other number is computed.

#![forbid(unsafe_code)]

mod bench;
mod bias;
mod claims;
mod errors;
pub mod experiment;
mod fig_10;
mod fig_11;
mod fig_12;
mod fig_9;
mod figures;
mod fit;
mod line_1;
mod motions;
mod neglected;
mod noise;
mod page;
mod reconstruction;
mod table2;
mod table3;
mod text;
mod variants;

use anyhow::Context;
use claims::{Claim, ClaimEvidence};
use errors::PaperError;
use krait_model::{MachineParameters, Snake};
use krait_report::{Figure, Spread, Surface, surface_svg, svg};
use krait_sim::Truth;
use motions::MotionRow;
use neglected::Neglected;
use serde::Serialize;
use std::path::Path;
use table2::Table2;
use table3::Table3;
use variants::{KnownParameters, VariantKind};

pub use bench::default_truth;
pub use text::terminal;

/// The accuracy that the paper asks of compensation, deg.
const GOAL_DEG: f64 = 1.0;

/// Everything that `krait paper` regenerates.
#[derive(Debug, Serialize)]
pub struct Paper {
    /// Table II: friction of the cone.
    pub table_2: Table2,
    /// Table III: as printed, on the bench, and in contrasts.
    pub table_3: Table3,
    /// What the measured bend on both sides of Eq. (20) costs.
    pub bias: Vec<bias::BiasRow>,
    /// Fig. 9: line 1 over the workspace.
    pub fig_9: Vec<Vec<fig_9::Point>>,
    /// Fig. 10: the ramp.
    pub fig_10: Vec<fig_10::RampRow>,
    /// Fig. 11: other planes.
    pub fig_11: Vec<fig_11::TurnRow>,
    /// Fig. 12: poses.
    pub fig_12: Vec<fig_12::PoseRow>,
    /// What the paper leaves out.
    pub neglected: Neglected,
    /// Pictures of curves.
    pub figures: Vec<Figure>,
    /// Pictures of surfaces.
    pub surfaces: Vec<Surface>,
    /// What each compensation reaches where lines reverse.
    pub motions: Vec<MotionRow>,
    /// What the paper claims.
    pub claims: Vec<Claim>,
    /// The paper's errors.
    pub errors: Vec<PaperError>,
    /// The line that has to hold.
    pub verdict: MethodComparison,
}

/// Whether estimation reaches the goal where naive compensation does not: the corrected method, on the paper's one-way ramp.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MethodComparison {
    /// The accuracy asked for, deg.
    pub goal_deg: f64,
    /// Without compensation.
    pub off_deg: Spread,
    /// With Eqs. (15)-(17).
    pub naive_deg: Spread,
    /// With the last estimate from contrasts and the signs of motion.
    pub estimated_deg: Spread,
    /// The same with other noise of the camera.
    pub seeds: Seeds,
    /// The estimate is within the goal and naive compensation is not, both rms.
    pub holds: bool,
}

/// The corrected method on benches that differ in nothing but the camera's noise.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Seeds {
    /// Number of benches.
    pub n: u64,
    /// The part of them within the goal (rms).
    pub part_within_goal: f64,
    /// Their median rms error, deg.
    pub median_rms_deg: f64,
    /// The largest, deg.
    pub worst_rms_deg: f64,
}

impl Paper {
    /// Computes everything on a bench of this truth; takes some seconds.
    ///
    /// # Errors
    /// A bench that refuses a command.
    pub fn compute(truth: &Truth) -> anyhow::Result<Self> {
        let machine = MachineParameters::default();
        let snake = Snake::new(&machine)?;
        let table_2 = table2::fit(&machine).context("Table II")?;
        let table_3 = table3::run(&snake, truth).context("Table III")?;
        let variants = variants::all(&known(truth, &table_3));
        let fig_9 = fig_9::surface(&snake);
        let fig_10 = fig_10::run(&snake, truth, &variants).context("Fig. 10")?;
        let fig_11 = fig_11::run(&snake, truth, &variants).context("Fig. 11")?;
        let fig_12 = fig_12::run(&snake, truth, &variants).context("Fig. 12")?;
        let neglected = neglected::neglected(&snake, &machine, truth.effects.load_scale);
        let verdict = verdict(&snake, truth, &table_3)?;
        let evidence = ClaimEvidence {
            table_2: &table_2,
            table_3: &table_3,
            fig_10: &fig_10,
            fig_11: &fig_11,
            neglected: &neglected,
            seeds: &verdict.seeds,
        };
        Ok(Self {
            bias: bias::study(&snake, truth).context("the study of the bias")?,
            figures: figures::all(&snake, &table_2, &table_3, &fig_10, &fig_11, &fig_12),
            surfaces: figures::surfaces(&fig_9),
            motions: motions::compare(&snake, truth)?,
            claims: claims::all(&evidence),
            errors: errors::all(&snake, truth, &table_2, &table_3)?,
            table_2,
            table_3,
            fig_9,
            fig_10,
            fig_11,
            fig_12,
            neglected,
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
            pictures.push((figure.file.as_str(), svg(figure)?));
        }
        for surface in &self.surfaces {
            pictures.push((surface.file.as_str(), surface_svg(surface)?));
        }
        for (file, picture) in &pictures {
            write(file, picture)?;
        }
        let pictures: Vec<String> = pictures.into_iter().map(|(_, picture)| picture).collect();
        write("index.html", &page::html(self, &pictures))
    }
}

fn known(truth: &Truth, table_3: &Table3) -> KnownParameters {
    let line_1 = table_3.line_1.rows.last().copied().unwrap_or(variants::OF_EQ_22);
    let contrasts = table_3.line_1.contrasts;
    KnownParameters {
        truth: (truth.effects.load_scale, 0.5 * truth.effects.play_m),
        line_1: (line_1.0, line_1.1 * 1e-3),
        // Play is never negative; a fit to a bench without any ends a rounding error below.
        contrasts: (contrasts.0, contrasts.1.max(0.0) * 1e-3),
    }
}

/// Other noise of the camera.
const N_SEEDS: u64 = 100;

fn verdict(snake: &Snake, truth: &Truth, table_3: &Table3) -> anyhow::Result<MethodComparison> {
    let ramp = |kind: VariantKind| -> anyhow::Result<Spread> {
        let poses = bench::follow(truth, &bench::one_way_ramp(), kind.commands(snake)?)?;
        Ok(bench::spread(&poses, bench::ramp_error_deg))
    };
    let estimated = |eta: f64, half_width_m: f64| {
        ramp(VariantKind::MotionSign { eta: eta.clamp(0.1, 10.0), half_width_m: half_width_m.clamp(0.0, 2e-3) })
    };
    let run = table3::Run::new(snake, truth)?;
    let mut rms_deg = Vec::new();
    for seed in 1..=N_SEEDS {
        let found = run.fitted(snake, &run.photographed(seed))?.value;
        rms_deg.push(estimated(found.x, found.y)?.rms);
    }
    rms_deg.sort_by(f64::total_cmp);
    let n_within = rms_deg.iter().filter(|rms| **rms <= GOAL_DEG).count();
    let (naive_deg, estimated_deg) = (ramp(VariantKind::Naive)?, estimated(table_3.eta, table_3.lambda_mm * 1e-3)?);
    Ok(MethodComparison {
        goal_deg: GOAL_DEG,
        off_deg: ramp(VariantKind::Off)?,
        naive_deg,
        estimated_deg,
        seeds: Seeds {
            n: N_SEEDS,
            part_within_goal: n_within as f64 / N_SEEDS as f64,
            median_rms_deg: rms_deg[rms_deg.len() / 2],
            worst_rms_deg: rms_deg[rms_deg.len() - 1],
        },
        holds: estimated_deg.rms <= GOAL_DEG && naive_deg.rms > GOAL_DEG,
    })
}
