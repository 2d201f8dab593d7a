//! `krait compare A B`: two recordings side by side, as a table and as pictures.

use crate::cli_replay::CompareArgs;
use crate::commands::compare_table::{COLUMNS, FigureRow, error_of, figures, table, unit_of};
use crate::commands::compare_verdict::{CommonTime, verdict};
use crate::in_force::lanes_of;
use crate::print::{self, wrapped};
use crate::recorded;
use anyhow::{Context, bail};
use krait_bridge::LiveModel;
use krait_model::ModelHash;
use krait_model::model_file::ModelFile;
use krait_record::{Pass, Recording, passes_of};
use krait_report::{Apart, Curve, Figure, Lanes, Mark, Side, Spread, Stroke, TOO_SHORT, svg};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Points of a curve at most: more than a picture has pixels, and the largest of those that share one is kept.
const N_POINTS: usize = 1500;

/// The comparison, in the shape of `--json`.
#[derive(Serialize)]
struct Comparison {
    a: Named,
    b: Named,
    /// How far the two are apart at the same time since the first motion.
    apart: Apart,
    /// Both tracking errors over the time that both have.
    common: CommonTime,
    /// Which follows better, a sentence.
    verdict: String,
    /// How far the two are apart, a sentence.
    apart_says: String,
    /// What the table shows, as it is written there.
    figures: Vec<FigureRow>,
    /// The pictures that were written.
    pictures: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Named {
    recording: PathBuf,
    pass: usize,
    /// How many chains ran in it.
    n_passes: usize,
    /// Who recorded it, with what and on which device.
    about: BTreeMap<&'static str, String>,
    /// What the recording lacks, a sentence each; empty for one that is whole.
    missing: Vec<String>,
    #[serde(flatten)]
    side: Side,
}

/// Reads both, prints the table, and writes the pictures where that is asked for.
pub fn run(args: &CompareArgs) -> anyhow::Result<ExitCode> {
    let (a, b) = (named(&args.a, args.pass_a)?, named(&args.b, args.pass_b)?);
    let apart = Apart::of(&a.side, &b.side);
    let pictures = match &args.out {
        Some(folder) => write_pictures(folder, &a, &b)?,
        None => Vec::new(),
    };
    let common = CommonTime::of(&a.side, &b.side);
    let verdict = verdict(&a.side, &b.side, &common);
    let apart_says = apart_sentence(&apart, unit_of(&a.side));
    let figures = figures(&a.side, &b.side);
    let comparison = Comparison { a, b, apart, common, verdict, apart_says, figures, pictures };
    if args.json {
        print::json(&comparison)?;
    } else {
        print::out(&text(&comparison))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn named(path: &Path, number: u64) -> anyhow::Result<Named> {
    let parts = Recording::open_parts(path)?;
    let passes = passes_of(&parts)?;
    let idx = usize::try_from(number - 1).unwrap_or(usize::MAX);
    let Some(pass) = passes.get(idx) else {
        bail!("recording {}: pass {number} was asked for and it holds {}", path.display(), passes.len());
    };
    let lanes = lanes_of_pass(&parts[0], pass).with_context(|| format!("recording {}", path.display()))?;
    let side = Side::of(pass, lanes).with_context(|| format!("recording {}", path.display()))?;
    let missing = recorded::missing(&parts);
    Ok(Named {
        recording: path.to_owned(),
        pass: idx + 1,
        n_passes: passes.len(),
        about: recorded::about(&parts[0]),
        missing,
        side,
    })
}

/// What the pass is of, where it is of no snake.
fn lanes_of_pass(recording: &Recording, pass: &Pass) -> anyhow::Result<Option<Lanes>> {
    let has_lanes = pass.setpoints.first().is_some_and(|setpoint| setpoint.n_joints > 0);
    let Some(command) = pass.commands.first().filter(|_| has_lanes) else { return Ok(None) };
    let model = ModelFile::parse(&recorded::model_text(recording, ModelHash(command.model_hash))?)?;
    Ok(lanes_of(&LiveModel::of(&model)?))
}

fn text(comparison: &Comparison) -> String {
    let Comparison { a, b, verdict, apart_says, figures, pictures, .. } = comparison;
    let mut text = String::new();
    for (letter, side) in [("A", a), ("B", b)] {
        text += &format!("{letter}: {} (pass {})\n", side.recording.display(), side.pass);
        for (key, value) in &side.about {
            text += &format!("   {}: {value}\n", key.replace('_', " "));
        }
        for sentence in &side.missing {
            for line in wrapped(&format!("not whole: {sentence}"), COLUMNS - 3) {
                text += &format!("   {line}\n");
            }
        }
    }
    text += &table(figures).to_string();
    if [a, b].iter().any(|side| error_of(&side.side).is_none()) {
        text += &format!("  {TOO_SHORT} after the first motion\n");
    }
    text += &paragraph(&format!("Verdict: {verdict}"));
    text += &paragraph(apart_says);
    text += "Marks, s since the first motion\n";
    for (letter, side) in [("A", &a.side), ("B", &b.side)] {
        text += &marks(letter, &side.marks);
    }
    for picture in pictures {
        text += &format!("Picture: {}\n", picture.display());
    }
    text
}

/// A sentence in lines of at most [`COLUMNS`], all but the first a little further in.
fn paragraph(sentence: &str) -> String {
    wrapped(sentence, COLUMNS - 2).join("\n  ") + "\n"
}

/// How far the two are apart at the same time; a measured difference is there only where both were measured at that time.
fn apart_sentence(apart: &Apart, unit: &str) -> String {
    let spread = |what: &str, spread: &Spread| format!("{what} {:.3} {unit} rms ({:.3} max)", spread.rms, spread.max);
    let setpoints = apart.setpoint_deg.as_ref().or(apart.setpoint_joints.as_ref());
    let setpoints = setpoints.map_or("setpoints of different machines".to_owned(), |apart| spread("setpoints", apart));
    let bends = apart.shape_deg.as_ref().map(|apart| spread("measured bends", apart));
    let joints = || apart.shape_joints.as_ref().map(|apart| spread("measured joints", apart));
    let measured = bends.or_else(joints).unwrap_or("nothing measured at the same time".to_owned());
    format!(
        "At the same time since the first motion: {setpoints}, {measured}, commands {:.4} mm rms ({:.4} max)",
        apart.command_mm.rms, apart.command_mm.max
    )
}

/// Marks of a side with the time of each since the first motion, s.
fn marks(letter: &str, marks: &[Mark]) -> String {
    let mark = |Mark { at_s, text }: &Mark| {
        let begin = format!("  {letter} {at_s:>9.3}  ");
        let lines = wrapped(text, COLUMNS - begin.len());
        format!("{begin}{}\n", lines.join(&format!("\n{:1$}", "", begin.len())))
    };
    if marks.is_empty() { format!("  {letter} none\n") } else { marks.iter().map(mark).collect() }
}

fn write_pictures(folder: &Path, a: &Named, b: &Named) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("folder {}", folder.display()))?;
    let (sa, sb) = (&a.side.series, &b.side.series);
    let mut written = Vec::new();
    for (file, title, y_label, pa, pb) in [
        ("tracking.svg", "Tracking error", unit_of(&a.side), &sa.error, &sb.error),
        ("bend.svg", "Bend of the setpoint", "degrees", &sa.bend_deg, &sb.bend_deg),
        ("measured.svg", "Bend that was measured", "degrees", &sa.measured_deg, &sb.measured_deg),
        ("latency.svg", "Latency from the device to the drive", "microseconds", &sa.latency_us, &sb.latency_us),
    ] {
        let curves = [("A", a, pa), ("B", b, pb)].into_iter().enumerate().map(|(color_idx, (letter, side, points))| {
            let name = side.recording.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            let label = format!("{letter}: {name}, pass {}", side.pass);
            Curve { label, color_idx, stroke: Stroke::Solid, points: thinned(points) }
        });
        let curves: Vec<Curve> = curves.filter(|curve| !curve.points.is_empty()).collect();
        if curves.is_empty() {
            continue;
        }
        let figure = Figure {
            file: file.to_owned(),
            title: title.to_owned(),
            x_label: "time since the first motion, s".to_owned(),
            y_label: y_label.to_owned(),
            band: None,
            curves,
            caption: String::new(),
        };
        let path = folder.join(file);
        std::fs::write(&path, svg(&figure)?).with_context(|| format!("picture {}", path.display()))?;
        written.push(path);
    }
    Ok(written)
}

/// The points from the first motion on, at most [`N_POINTS`]: of those that share a place the one with the largest value.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let shown: Vec<(f64, f64)> = points.iter().copied().filter(|(time_s, _)| *time_s >= 0.0).collect();
    let n_in_one = shown.len().div_ceil(N_POINTS).max(1);
    let largest = |chunk: &[(f64, f64)]| chunk.iter().copied().max_by(|x, y| x.1.total_cmp(&y.1));
    shown.chunks(n_in_one).filter_map(largest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_mark_goes_on_in_further_lines() {
        let text = "contact ".repeat(20);
        let said = marks("A", &[Mark { at_s: 1.25, text }, Mark { at_s: -0.5, text: "begun".to_owned() }]);
        assert!(said.lines().all(|line| line.chars().count() <= COLUMNS), "{said}");
        assert!(
            said.starts_with("  A     1.250  contact contact") && said.contains("\n  A    -0.500  begun\n"),
            "{said}"
        );
        assert_eq!(marks("B", &[]), "  B none\n");
    }

    #[test]
    fn thinning_keeps_the_largest_and_leaves_few_points_as_they_are() {
        let few = [(-1.0, 9.0), (0.0, 1.0), (1.0, 2.0)];
        assert_eq!(thinned(&few), few[1..]);
        let many: Vec<(f64, f64)> = (0..10_000).map(|k| (f64::from(k), if k == 777 { 5.0 } else { 1.0 })).collect();
        let thin = thinned(&many);
        assert!(thin.len() <= N_POINTS && thin.contains(&(777.0, 5.0)));
    }
}
