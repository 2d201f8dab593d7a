//! `krait export FILE`: a recording's measurements as a table that the model lab, and any other program, reads.

use crate::cli::{ExportArgs, ExportFormat};
use crate::commands::overwrite::refuse_other_ending;
use crate::{print, recorded};
use anyhow::{Context, bail};
use krait_lab::read::joint_scale;
use krait_model::model_file::{Machine, ModelFile};
use krait_record::columns::{ColumnUnits, Columns, write_csv, write_parquet};
use krait_record::{MODEL_ATTACHMENT, Recording, attachment};
use serde::Serialize;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What was exported, in the shape of `--json`.
#[derive(Debug, Serialize)]
struct Exported {
    out: PathBuf,
    rows: usize,
    rows_with_shape: u64,
    shapes_left_out: u64,
    states_left_out: u64,
    trials: u32,
    /// What the recording lacks, a sentence each.
    missing: Vec<String>,
}

/// Writes the table; exit code 1 if the recording lacks something.
pub fn run(args: &ExportArgs) -> anyhow::Result<ExitCode> {
    let (own, option) = match args.format {
        ExportFormat::Csv => ("csv", " (--format parquet writes .parquet)"),
        ExportFormat::Parquet => ("parquet", " (--format csv writes .csv)"),
    };
    refuse_other_ending(&args.out, own, option)?;
    let parts = Recording::open_parts(&args.recording)?;
    let columns = Columns::of_parts(&parts)?;
    let missing = recorded::missing(&parts);
    if columns.n_rows() == 0 {
        let why = match missing.first() {
            Some(sentence) => sentence,
            None => "a row needs a slave that is homed, and this recording has none",
        };
        bail!("{} holds no measurement: {why}; record a run that moves", args.recording.display());
    }
    let columns = if args.jaw { jaw_of(columns, &args.recording)? } else { columns };
    let units = (columns.n_joints > 0 && !args.jaw).then(|| units_of(&parts[0])).transpose();
    let units = units.with_context(|| format!("recording {}", args.recording.display()))?;
    write(args.format, &columns, units.as_ref(), &args.out)?;
    let exported = Exported {
        out: args.out.clone(),
        rows: columns.n_rows(),
        rows_with_shape: columns.n_shapes,
        shapes_left_out: columns.n_shapes_left_out,
        states_left_out: columns.n_states_left_out,
        trials: columns.trial.last().copied().unwrap_or(0),
        missing,
    };
    if args.json {
        print::json(&exported)?
    } else {
        print::out(&exported.text())?
    }
    Ok(if exported.missing.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The jaw alone.
fn jaw_of(columns: Columns, recording: &Path) -> anyhow::Result<Columns> {
    let none = || format!("{} holds no jaw: its machine has no gripper; leave --jaw out", recording.display());
    let jaw = columns.of_jaw().with_context(none)?;
    if jaw.n_shapes == 0 {
        bail!(
            "{} holds no measured angle of the jaw, and the lab needs one: its camera saw none; leave --jaw out",
            recording.display()
        );
    }
    Ok(jaw)
}

impl Exported {
    fn text(&self) -> String {
        let mut text = format!(
            "{}: {} in {}, {} of them with a shape; {} and {} left out\n",
            self.out.display(),
            print::counted(self.rows as u64, "row"),
            print::counted(self.trials.into(), "trial"),
            self.rows_with_shape,
            print::counted(self.shapes_left_out, "shape"),
            print::counted(self.states_left_out, "state"),
        );
        for sentence in &self.missing {
            text += &format!("  incomplete: {sentence}\n");
        }
        text
    }
}

/// The units of the joints' model, in which the lab then reads the table with that model.
fn units_of(recording: &Recording) -> anyhow::Result<ColumnUnits> {
    let text = attachment(recording, MODEL_ATTACHMENT).context("it embeds no model of its joints")?;
    let file = ModelFile::parse(text).context("its attachment model.toml")?;
    if let Machine::Segments(_) = file.machine() {
        let name = |unit: &str| unit.to_owned();
        return Ok(ColumnUnits { u_unit: name("m"), u_per_m: 1.0, y_unit: name("rad"), y_per_si: 1.0 });
    }
    let Machine::Joints(joints) = file.machine() else {
        bail!("it holds joints, and the model that it embeds is of none");
    };
    let scale = joint_scale(recording, joints);
    let [u_per_m, y_per_si] = scale.context("its attachments do not say in which units its joints are counted")?;
    Ok(ColumnUnits { u_unit: joints.u_unit.clone(), u_per_m, y_unit: joints.y_unit.clone(), y_per_si })
}

fn write(format: ExportFormat, columns: &Columns, units: Option<&ColumnUnits>, path: &Path) -> anyhow::Result<()> {
    let could_not =
        || format!("{} could not be written; choose a new file in a folder that can be written", path.display());
    let file = File::create_new(path).with_context(could_not)?;
    let mut out = BufWriter::new(file);
    let written = match format {
        ExportFormat::Csv => write_csv(columns, units, &mut out).with_context(could_not),
        ExportFormat::Parquet => write_parquet(columns, units, &mut out).with_context(could_not),
    };
    written.inspect_err(|_| {
        if let Err(error) = std::fs::remove_file(path) {
            tracing::warn!(%error, path = %path.display(), "a half-written table could not be removed");
        }
    })
}
