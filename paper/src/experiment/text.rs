//! The outcome as tables of 80 columns, and as a table of every pose for other programs.

use super::outcome::{FigureOutcome, PartOutcome, PassOutcome, PoseErrors, PoseOutcome};
use super::protocol::{ApproachSide, FigureKind, Protocol};
use crate::text::Section;
use krait_report::{LearntReport, Table};
use std::path::Path;

/// Everything for a terminal; `folder` has the pictures.
pub fn terminal(outcome: &FigureOutcome, folder: &Path) -> String {
    let text: String = sections(outcome).iter().map(Section::text).collect();
    text + &format!("{}\nPage: {}\n", facts(outcome), folder.join("index.html").display())
}

/// The tables: error of the bend, error of the plane.
pub(super) fn sections(outcome: &FigureOutcome) -> Vec<Section> {
    let bend = Section {
        title: format!("{}: error of the bend, deg", title(&outcome.protocol)),
        table: table(outcome, |part| Some(&part.bend)),
        notes: String::new(),
    };
    let plane = Section {
        title: format!("{}: error of the plane, deg, bends of 15 deg or more", title(&outcome.protocol)),
        table: table(outcome, |part| part.plane.as_ref()),
        notes: "measured minus commanded shape; se: standard error of the rms; floor: rms of\n\
                a perfect machine under this camera; bench: the same poses on the paper's\n\
                bench, without noise"
            .to_owned(),
    };
    vec![bend, plane]
}

/// The experiment by its figure.
pub(super) fn title(protocol: &Protocol) -> &'static str {
    match protocol.figure {
        FigureKind::Fig10 => "Fig. 10",
        FigureKind::Fig11 => "Fig. 11",
        FigureKind::Poses => "Fig. 12",
    }
}

fn table(outcome: &FigureOutcome, errors: impl Fn(&PartOutcome) -> Option<&PoseErrors>) -> Table {
    let mut table = Table::new(&["compensation", "part", "n", "rms", "se", "bench", "max", "bench", "floor"]);
    for pass in &outcome.passes {
        for part in &pass.parts {
            let mut cells = vec![pass.compensation.clone(), part.part.name().to_owned()];
            match errors(part) {
                Some(e) => {
                    let (found, bench) = (&e.measured_deg, &e.bench_deg);
                    cells.push(found.n.to_string());
                    let numbers = [found.rms, e.rms_se_deg, bench.rms, found.max, bench.max, e.floor_deg];
                    cells.extend(numbers.map(|number| format!("{number:.2}")));
                }
                None => {
                    cells.push("0".to_owned());
                    cells.extend(vec!["-".to_owned(); 6]);
                }
            }
            table.row(cells);
        }
    }
    table
}

/// Sentences about the whole: side of the play, the camera, what had been learnt, what is missing.
pub(super) fn facts(outcome: &FigureOutcome) -> String {
    let protocol = &outcome.protocol;
    let play = match protocol.side {
        ApproachSide::None => "not taken up; the snake sets out as homing left it".to_owned(),
        side => {
            format!("taken up from {side} over {} deg on each way out from straight", protocol.take_up_deg)
        }
    };
    let mut lines = vec![
        format!("Play: {play}"),
        format!(
            "Camera: {:.3} deg standard deviation of a shape on each axis ({} at rest)",
            outcome.noise.sd_of_a_shape_deg, outcome.noise.n_shapes
        ),
    ];
    for pass in &outcome.passes {
        lines.extend(pass.learnt.iter().map(|own| in_force(pass, own)));
        let limited = || pass.poses.iter().filter_map(|pose| pose.limited_by);
        if let Some(limit) = limited().next() {
            let (name, n) = (&pass.compensation, limited().count());
            lines.push(format!("Limited: {name} at {n} poses: {limit}"));
        }
        if !pass.is_complete {
            lines.push(format!(
                "Not complete: {} has {} of {} poses",
                pass.compensation,
                pass.poses.len(),
                protocol.poses.len()
            ));
            lines.extend(pass.failed.iter().map(|why| format!("Failed: {}: {why}", pass.compensation)));
        }
    }
    lines.extend(outcome.never_begun.iter().map(|name| format!("Not complete: {name} never began")));
    lines.join("\n")
}

fn in_force(pass: &PassOutcome, own: &LearntReport) -> String {
    format!("In force at the end, {}: {}", pass.compensation, own.sentence())
}

/// Every pose as CSV.
pub fn csv(outcome: &FigureOutcome) -> String {
    let mut csv = String::from(
        "compensation,part,pose,at_s,wanted_bend_deg,wanted_delta_deg,commanded_x_deg,commanded_y_deg,measured_x_deg,\
         measured_y_deg,se_x_deg,se_y_deg,n_shapes,q_tilde1_mm,q_tilde2_mm,q_tilde3_mm,tau1_n,tau2_n,tau3_n,bend_error_deg,\
         bend_se_deg,plane_error_deg,plane_se_deg,vector_error_deg,bench_x_deg,bench_y_deg,bench_bend_error_deg,\
         bench_plane_error_deg\n",
    );
    for pass in &outcome.passes {
        for pose in &pass.poses {
            csv += &row(&pass.compensation, pose);
        }
    }
    csv
}

fn row(compensation: &str, p: &PoseOutcome) -> String {
    let mut cells = vec![quoted(compensation), p.part.name().to_owned(), p.pose.to_string(), format!("{:.3}", p.at_s)];
    let first = p.wanted_deg.iter().chain(&p.commanded_deg).chain(&p.measured_deg).chain(&p.se_deg);
    cells.extend(first.map(|number| format!("{number:.6}")));
    cells.push(p.n_shapes.to_string());
    let errors = [p.bend_error_deg, p.bend_se_deg, p.plane_error_deg, p.plane_se_deg, p.vector_error_deg];
    let bench = [p.bench_deg[0], p.bench_deg[1], p.bench_bend_error_deg, p.bench_plane_error_deg];
    let rest = p.q_tilde_mm.iter().chain(&p.tau_n).chain(&errors).chain(&bench);
    // An actuator without a load cell has no number.
    cells.extend(rest.map(|number| if number.is_finite() { format!("{number:.6}") } else { String::new() }));
    cells.join(",") + "\n"
}

fn quoted(word: &str) -> String {
    if word.contains([',', '"', '\n']) { format!("\"{}\"", word.replace('"', "\"\"")) } else { word.to_owned() }
}
