//! `krait lab compare`: how far model and measurements are apart, in which part, and where it is worst.

use super::diagnose::five_digits;
use super::page;
use crate::cli_lab::LabCompareArgs;
use crate::print;
use krait_lab::Names;
use krait_lab::compare::{Bin, Comparison, compare};
use krait_lab::report::{comparison_page, residual_curves};
use krait_report::Table;
use serde_json::json;
use std::process::ExitCode;

/// Places that the table shows.
const SHOWN: usize = 15;

/// Compares; that there is an error is no failure.
pub fn run(args: &LabCompareArgs) -> anyhow::Result<ExitCode> {
    page::refuse_place(args.report.as_deref())?;
    let session = args.files.session()?;
    let found = compare(session.machine.as_ref(), &session.data)?;
    if let Some(path) = &args.report {
        page::write(path, |origin| comparison_page(session.machine.as_ref(), &session.data, &found, origin))?;
    }
    if args.json {
        let mut answer = found.to_json();
        if args.curves {
            let curves = residual_curves(session.machine.as_ref(), &session.data)?;
            answer["curves"] = json!(curves);
        }
        print::json(&answer)?;
    } else {
        print::out(&text(&found, &session.data.names))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn text(found: &Comparison, names: &Names) -> String {
    let unit = &found.unit;
    let mut text = format!(
        "Error of the model on {}: {:.3} {unit} rms, {:.3} {unit} p95, {:.3} {unit} max in {} rows with a measurement of {}\n",
        found.source, found.error.rms, found.error.p95, found.error.max, found.n_scored, found.n_rows
    );
    let open: Vec<_> = found.calibration.iter().filter(|own| !own.held).collect();
    if !open.is_empty() {
        let numbers: Vec<String> = open
            .iter()
            .map(|own| {
                let of = own.joint.map_or(String::new(), |joint| format!(" of {}", names.joint(joint)));
                format!("{}{of}: {} {}", own.name, five_digits(own.value), own.unit)
            })
            .collect();
        text += &format!("after calibration ({}); {:.3} {unit} rms without\n", numbers.join(", "), found.as_given_rms);
    }
    for joint in &found.still_joints {
        text += &format!("{} does not move, so that its gain cannot be seen\n", names.joint(*joint));
    }
    let floor = found.noise_floor.map_or("unknown".to_owned(), |floor| format!("{floor:.3} {unit}"));
    text += &format!("Noise of the measurement: {floor} rms ({})\n", found.noise_source);
    if let Some(position_m) = found.position_rms_m {
        text += &format!("Position of the tip: {:.3} mm rms\n", 1e3 * position_m);
    }
    for frame in &found.tip_frames {
        text += &print::paragraph(&format!("Tip: {}.", frame.sentence()));
    }
    text += &format!("{}\n\nParts of the error\n{}", found.worst, parts(found, names));
    if let Some(common) = &found.common_mode {
        text += &format!(
            "Common mode of the encoders, which bends nothing: {:.4} mm rms, {:.4} mm max",
            1e3 * common.encoder_rms_m,
            1e3 * common.encoder_max_m
        );
        match (common.load_rms_n, common.load_max_n) {
            (Some(rms), Some(max)) => text += &format!("; of the loads: {rms:.3} N rms, {max:.3} N max\n"),
            _ => text += "; loads were not measured\n",
        }
    }
    for own in found.loads.iter().flatten() {
        text += &format!(
            "Load tau{}_n: {:.3} N rms from the model's, beside a noise of {:.3} N (a gain of {:.4} and the offset taken out)\n",
            own.line, own.after_n, own.noise_n, own.gain
        );
    }
    text += &format!("\nNoise of one output, found in three ways\n{}", noise(found));
    text + &format!("\nWhere ({SHOWN} worst of {})\n{}", found.bins.len(), places(found))
}

fn parts(found: &Comparison, names: &Names) -> Table {
    let mut table = Table::new(&["part", &format!("rms ({})", found.unit), "p95", "max", "mean"]);
    let cell = |value: f64| format!("{value:.3}");
    match &found.parts {
        Some(parts) => {
            for (name, spread, mean) in [
                ("in-plane: bend, along the measured bend", parts.bend, parts.bend_mean),
                ("out-of-plane: across it, as bend vector", parts.plane, parts.plane_mean),
            ] {
                table.row(vec![name.to_owned(), cell(spread.rms), cell(spread.p95), cell(spread.max), cell(mean)]);
            }
            let name = format!("angle between the planes, {} rows from 15 deg on", parts.n_azimuth);
            table.row(vec![name, cell(parts.azimuth_rms), "-".to_owned(), "-".to_owned(), "-".to_owned()]);
        }
        None => {
            for (k, rms) in found.output_rms.iter().enumerate() {
                let none = || "-".to_owned();
                table.row(vec![names.output(k), cell(*rms), none(), none(), none()]);
            }
        }
    }
    table
}

fn noise(found: &Comparison) -> Table {
    let mut table = Table::new(&["way", &format!("standard deviation ({})", found.unit), "from"]);
    let cell = |value: Option<f64>| value.map_or("not enough data".to_owned(), |value| format!("{value:.4}"));
    let noise = &found.noise;
    let rest = format!("{:.0} s at rest", noise.rest_time_s);
    let visits = format!("{} pairs", noise.n_visits);
    table.row(vec!["differences (white part only)".to_owned(), cell(noise.by_differences), "all rows".to_owned()]);
    table.row(vec!["rests (slow noise too)".to_owned(), cell(noise.at_rest), rest]);
    table.row(vec!["repeat visits (whatever does not repeat)".to_owned(), cell(noise.on_visits), visits]);
    table
}

fn places(found: &Comparison) -> Table {
    let unit = &found.unit;
    let mut table = Table::new(&["by", "bin", &format!("rms ({unit})"), "mean", "mean across", "rows"]);
    let cell = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    let row = |bin: &Bin| {
        let (mean, across) = (cell(bin.mean), cell(bin.plane_mean));
        vec![bin.by.clone(), bin.bin.clone(), format!("{:.3}", bin.rms), mean, across, bin.n_rows.to_string()]
    };
    found.bins.iter().take(SHOWN).for_each(|bin| table.row(row(bin)));
    table
}
