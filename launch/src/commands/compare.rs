//! `krait compare A B`: two recordings side by side, as a table and as pictures.

use crate::cli_replay::CompareArgs;
use crate::{print, recorded};
use anyhow::{Context, bail};
use krait_record::{Recording, passes_of};
use krait_report::{Apart, Curve, Figure, Side, Spread, Stroke, TOO_SHORT, Table, svg};
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
    /// The pictures that were written.
    pictures: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Named {
    recording: PathBuf,
    pass: usize,
    /// Who recorded it, with what and on which device.
    about: BTreeMap<&'static str, String>,
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
    let comparison = Comparison { a, b, apart, pictures };
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
    let side = Side::of(pass).with_context(|| format!("recording {}", path.display()))?;
    Ok(Named { recording: path.to_owned(), pass: idx + 1, about: recorded::about(&parts[0]), side })
}

fn text(comparison: &Comparison) -> String {
    let Comparison { a, b, apart, pictures } = comparison;
    let name = |side: &Named| format!("{} (pass {})", side.recording.display(), side.pass);
    let mut text = format!("A: {}\nB: {}\n{}", name(a), name(b), table(a, b));
    text += &format!(
        "At the same time since the first motion: setpoints {:.3} deg rms ({:.3} max), commands {:.4} mm rms ({:.4} max)\n",
        apart.setpoint_deg.rms, apart.setpoint_deg.max, apart.command_mm.rms, apart.command_mm.max
    );
    for picture in pictures {
        text += &format!("Picture: {}\n", picture.display());
    }
    text
}

fn table(a: &Named, b: &Named) -> Table {
    let mut table = Table::new(&["", "A", "B"]);
    let mut row = |name: String, a: String, b: String| table.row(vec![name, a, b]);
    for ((key, a), b) in a.about.iter().zip(b.about.values()) {
        row(key.replace('_', " "), a.clone(), b.clone());
    }
    let (a, b) = (&a.side, &b.side);
    row("length, s".to_owned(), format!("{:.2}", a.length_s), format!("{:.2}", b.length_s));
    for (channel, n) in &a.samples {
        row(format!("{channel} samples"), n.to_string(), b.samples.get(channel).copied().unwrap_or(0).to_string());
    }
    let from = |word: &str| format!("tracking error from {:.0} s on, {word}, deg", a.scored_from_s);
    let mut error = |word: &str, figure: fn(&Spread) -> f64| {
        let cell = |side: &Side| {
            side.tracking_error_deg.as_ref().map_or(TOO_SHORT.to_owned(), |error| format!("{:.3}", figure(error)))
        };
        row(from(word), cell(a), cell(b));
    };
    error("rms", |error| error.rms);
    error("p95", |error| error.p95);
    error("max", |error| error.max);
    let hops: std::collections::BTreeSet<_> = a.latency_us.keys().chain(b.latency_us.keys()).collect();
    for hop in hops {
        let cell = |side: &Side| match side.latency_us.get(hop.as_str()) {
            Some(q) => format!("{:.0} / {:.0} / {:.0}", q.p50, q.p99, q.max),
            None => "-".to_owned(),
        };
        row(format!("{hop} p50/p99/max, us"), cell(a), cell(b));
    }
    row("following, s".to_owned(), format!("{:.2}", a.following_s), format!("{:.2}", b.following_s));
    let states: std::collections::BTreeSet<_> = a.operating_s.keys().chain(b.operating_s.keys()).collect();
    for state in states {
        let cell = |side: &Side| format!("{:.2}", side.operating_s.get(*state).copied().unwrap_or(0.0));
        row(format!("{state}, s"), cell(a), cell(b));
    }
    row("faults".to_owned(), a.n_faults.to_string(), b.n_faults.to_string());
    row("commands refused".to_owned(), a.n_refused.to_string(), b.n_refused.to_string());
    let reasons: std::collections::BTreeSet<_> = a.reasons.keys().chain(b.reasons.keys()).collect();
    for reason in reasons {
        let cell = |side: &Side| side.reasons.get(*reason).copied().unwrap_or(0).to_string();
        row(format!("states: {reason}"), cell(a), cell(b));
    }
    table
}

fn write_pictures(folder: &Path, a: &Named, b: &Named) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("folder {}", folder.display()))?;
    let (sa, sb) = (&a.side.series, &b.side.series);
    let mut written = Vec::new();
    for (file, title, y_label, pa, pb) in [
        ("tracking.svg", "Tracking error", "degrees", &sa.error_deg, &sb.error_deg),
        ("bend.svg", "Bend of the setpoint", "degrees", &sa.bend_deg, &sb.bend_deg),
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
    fn thinning_keeps_the_largest_and_leaves_few_points_as_they_are() {
        let few = [(-1.0, 9.0), (0.0, 1.0), (1.0, 2.0)];
        assert_eq!(thinned(&few), few[1..]);
        let many: Vec<(f64, f64)> = (0..10_000).map(|k| (f64::from(k), if k == 777 { 5.0 } else { 1.0 })).collect();
        let thin = thinned(&many);
        assert!(thin.len() <= N_POINTS && thin.contains(&(777.0, 5.0)));
    }
}
