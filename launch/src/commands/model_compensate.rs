//! `krait model compensate`: a table of setpoints becomes a table of commands, for controllers that krait does not drive.
//!
//! Each row is one step of the model's inverse, with its memory: the machine begins at rest, a snake straight, and goes from
//! row to row. Rows should be near enough to show every reversal.

use crate::cli_model::CompensateArgs;
use crate::commands::model::text_of;
use crate::commands::model_compensate_segments::{SegmentInverse, TableLoads};
use crate::commands::overwrite::{refuse_existing, refuse_same, write_whole};
use crate::print;
use anyhow::{Context, anyhow};
use core::fmt::Write;
use krait_bridge::LiveModel;
use krait_lab::read::setpoints;
use krait_model::Circumstances;
use krait_model::joints::{JointCompensator, JointInverseSettings};
use krait_model::model_file::{Machine, ModelFile};
use nalgebra::Vector2;
use serde::Serialize;
use std::process::ExitCode;

/// What was written, as `--json` prints it.
#[derive(Serialize)]
struct Compensated {
    out: String,
    rows: usize,
    /// Largest difference between a command with and without the model's effects, in the commands' unit.
    largest_correction: f64,
    unit: String,
    /// Rows whose setpoint no command reaches; their command is the nearest.
    rows_not_reached: usize,
    /// Loads of the lines; only of segments.
    #[serde(skip_serializing_if = "Option::is_none")]
    loads: Option<TableLoads>,
}

/// Writes the commands; exit code 1 where some setpoint cannot be reached.
pub fn run(args: &CompensateArgs) -> anyhow::Result<ExitCode> {
    refuse_existing(&args.out, "csv", args.force)?;
    refuse_same(&[("--in", &args.setpoints), ("--out", &args.out)])?;
    let file = ModelFile::parse(&text_of(&args.model)?).with_context(|| args.model.display().to_string())?;
    let mut inverse = Inverse::of(&file).with_context(|| args.model.display().to_string())?;
    let map = args.map.iter().cloned().collect();
    let setpoints = setpoints(&args.setpoints, &map, &inverse.wanted)?;
    let mut table = format!("time_s,{},{}\n", inverse.wanted.join(","), inverse.commanded.join(","));
    let (mut largest_correction, mut rows_not_reached) = (0.0_f64, 0);
    for (row, &time_s) in setpoints.time_s.iter().enumerate() {
        let wanted: Vec<f64> = setpoints.columns.iter().map(|column| column[row]).collect();
        let found = inverse.step(time_s, &wanted);
        let found = found.map_err(|why| anyhow!("{} row {}: {why}", args.setpoints.display(), row + 1))?;
        rows_not_reached += usize::from(!found.is_reached);
        largest_correction = largest_correction.max(found.correction);
        write!(table, "{time_s}")?;
        for value in wanted.iter().chain(&found.commands) {
            write!(table, ",{value}")?;
        }
        table.push('\n');
    }
    write_whole(&args.out, table).with_context(|| format!("{} could not be written", args.out.display()))?;
    let (out, unit) = (args.out.display().to_string(), inverse.unit.clone());
    let loads = inverse.loads();
    let answer = Compensated { out, rows: setpoints.time_s.len(), largest_correction, unit, rows_not_reached, loads };
    if args.json {
        print::json(&answer)?;
    } else {
        print::out(&sentence(&answer))?;
    }
    Ok(if rows_not_reached == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn sentence(done: &Compensated) -> String {
    let Compensated { out, rows, largest_correction, unit, rows_not_reached, loads } = done;
    let mut text = format!("{out} holds {rows} commands; the largest correction is {largest_correction:.3e} {unit}\n");
    if *rows_not_reached > 0 {
        text += &format!("{rows_not_reached} setpoints cannot be reached; their commands are the nearest\n");
    }
    text + &loads.as_ref().map_or_else(String::new, TableLoads::sentence)
}

/// The inverse of a model, with the columns that it takes and gives.
struct Inverse {
    kind: Kind,
    wanted: Vec<String>,
    commanded: Vec<String>,
    unit: String,
}

enum Kind {
    Snake { lines: Box<krait_model::ChainCompensator>, max_bend_rad: f64 },
    Segments(Box<SegmentInverse>),
    Joints(Box<JointCompensator>),
}

/// One row's commands.
struct Step {
    commands: Vec<f64>,
    correction: f64,
    is_reached: bool,
}

impl Inverse {
    fn of(file: &ModelFile) -> anyhow::Result<Self> {
        let numbered = |letter: &str, n: usize, unit: &str| (1..=n).map(|k| format!("{letter}{k}_{unit}")).collect();
        if let Machine::Joints(joints) = file.machine() {
            let columns = krait_model::KnownColumns { time: true, ..Default::default() };
            let chain = file.joint_chain(columns)?.context("the model has no joints")?;
            return Ok(Self {
                kind: Kind::Joints(Box::new(chain.compensator(JointInverseSettings::default())?)),
                wanted: numbered("y", joints.n, &joints.y_unit.to_ascii_lowercase()),
                commanded: numbered("u", joints.n, &joints.u_unit.to_ascii_lowercase()),
                unit: joints.u_unit.clone(),
            });
        }
        if let Some(lines) = SegmentInverse::of(file)? {
            let (wanted, commanded, unit) = (lines.wanted(), lines.commanded(), "m".to_owned());
            return Ok(Self { kind: Kind::Segments(Box::new(lines)), wanted, commanded, unit });
        }
        let model = LiveModel::of(file)?;
        let chain = model.snake().context("the model has no snake")?;
        Ok(Self {
            kind: Kind::Snake { lines: Box::new(chain.compensator()?), max_bend_rad: chain.max_bend_rad() },
            wanted: vec!["bend_x_rad".to_owned(), "bend_y_rad".to_owned()],
            commanded: numbered("q", 3, "m"),
            unit: "m".to_owned(),
        })
    }

    /// The commands for the next setpoint; for one that is beyond what the machine can bear, why.
    fn step(&mut self, time_s: f64, wanted: &[f64]) -> Result<Step, String> {
        let at = Circumstances::at(time_s);
        match &mut self.kind {
            Kind::Snake { lines, max_bend_rad } => {
                let bend_rad = Vector2::new(wanted[0], wanted[1]);
                if bend_rad.norm() > *max_bend_rad {
                    return Err(format!(
                        "the bend is larger than {max_bend_rad:.3} rad, which the model's strain_limit allows; ask for less"
                    ));
                }
                let found = lines.step(bend_rad, &at);
                let commands = found.q_tilde_m.iter().copied().collect();
                Ok(Step { commands, correction: found.eps_m.amax(), is_reached: true })
            }
            Kind::Segments(lines) => {
                let (commands, correction) = lines.step(time_s, wanted)?;
                Ok(Step { commands, correction, is_reached: true })
            }
            Kind::Joints(joints) => {
                let plain = joints.without_effects(wanted);
                let found = joints.step(wanted, &at);
                let correction =
                    found.u.iter().zip(&plain).fold(0.0_f64, |most, (u, plain)| most.max((u - plain).abs()));
                Ok(Step { commands: found.u[..wanted.len()].to_vec(), correction, is_reached: found.is_reachable })
            }
        }
    }

    fn loads(&self) -> Option<TableLoads> {
        match &self.kind {
            Kind::Segments(lines) => Some(lines.loads()),
            Kind::Snake { .. } | Kind::Joints(_) => None,
        }
    }
}
