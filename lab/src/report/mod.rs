//! One HTML page that shows what the lab found: it works without a network, and equal inputs give equal bytes.
//!
//! The pictures' script is embedded, everything that comes from outside is escaped, and nothing on a page depends on the time of
//! day or on the number of threads. Curves of many rows are thinned to [`MOST_POINTS`] points.

mod correlation;
mod curves;
mod direction;
pub mod html;
mod memory;
pub mod page;
pub mod picture;
mod places;
mod residual;
mod rows;
mod sketch;
mod tables;
mod verdict;
mod visits;
mod waterfall;

pub use curves::{AxisCurve, ResidualCurves, residual_curves};

use crate::compare::Comparison;
use crate::diagnose::Diagnosis;
use crate::machine::MachineUnderTest;
use crate::{Added, LabError, Measurements};
use html::escape;
use krait_model::model_file::ModelFile;
use page::Page;
use picture::Picture;
use rows::Rows;
use waterfall::Step;

/// A curve has at most this many points.
pub const MOST_POINTS: usize = 5000;

/// What the foot of a page says about its origin.
#[derive(Clone, Copy, Debug)]
pub struct PageOrigin<'a> {
    /// The command line.
    pub command: &'a str,
    /// The program's version.
    pub version: &'a str,
}

/// The page of a diagnosis.
///
/// # Errors
/// [`LabError::Chain`] where the effects make no chain for these columns.
pub fn diagnosis_page(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    diagnosis: &Diagnosis,
    origin: PageOrigin,
) -> Result<String, LabError> {
    let calibrated = diagnosis.calibrated.as_ref().map_or(machine, |joints| joints as &dyn MachineUnderTest);
    let given = if diagnosis.calibrated.is_some() { "model after calibration" } else { "model as given" };
    let mut models = vec![(given.to_owned(), calibrated.predict(calibrated.effects(), data)?)];
    let found = if diagnosis.effects.is_empty() { &diagnosis.partial } else { &diagnosis.effects };
    // Hypotheses of joints are in no chain, so that there is nothing to predict with them.
    if diagnosis.terms.len() > machine.effects().len() {
        let names: Vec<&str> = found.iter().map(|effect| effect.name.as_str()).collect();
        models.push((format!("with {}", names.join(" and ")), calibrated.predict(&diagnosis.terms, data)?));
    }
    let rows = Rows::new(machine, data, models, diagnosis.noise_floor);
    let unit = machine.error_unit().0;
    let mut page = Page::new(&format!("Diagnosis of {}", data.source), origin, data, Some(diagnosis.seed));
    page.push(tables::verdict(diagnosis, &data.names));
    residuals(&mut page, &rows);
    page.section("Error after each effect", waterfall::of_diagnosis(machine, data, diagnosis, &rows)?);
    page.push(tables::found(found, &data.names, unit, diagnosis.effects.is_empty()));
    page.push(tables::look_alikes(found));
    page.push(tables::summary(diagnosis, unit));
    pictures(&mut page, &rows);
    page.push(tables::candidates(diagnosis, unit));
    page.push(tables::remaining(diagnosis));
    Ok(page.finish())
}

/// The page of a comparison.
///
/// # Errors
/// [`LabError::Chain`] where the model's effects make no chain for these columns.
pub fn comparison_page(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    comparison: &Comparison,
    origin: PageOrigin,
) -> Result<String, LabError> {
    let calibrated = machine.calibrated_on(data)?;
    let machine = calibrated.as_deref().unwrap_or(machine);
    let rows = Rows::new(
        machine,
        data,
        vec![("model".to_owned(), machine.predict(machine.effects(), data)?)],
        comparison.noise_floor,
    );
    let mut page = Page::new(&format!("Model and measurement: {}", data.source), origin, data, None);
    page.push(tables::compared(comparison));
    residuals(&mut page, &rows);
    page.push(tables::comparison(comparison));
    pictures(&mut page, &rows);
    page.push(tables::places(comparison));
    Ok(page.finish())
}

/// The page of an effect that was added, or of parameters that were fitted; `what` names it.
///
/// # Errors
/// [`LabError::Chain`] where the effects make no chain for these columns.
pub fn added_page(
    machine: &dyn MachineUnderTest,
    data: &Measurements,
    added: &Added,
    what: &str,
    origin: PageOrigin,
) -> Result<String, LabError> {
    let calibrated = machine.as_joints().map(|joints| crate::joint::calibrated(joints, data)).transpose()?;
    let machine = calibrated.as_ref().map_or(machine, |joints| joints as &dyn MachineUnderTest);
    let unit = machine.error_unit().0;
    let models = vec![
        ("model before".to_owned(), machine.predict(machine.effects(), data)?),
        (format!("with {what}"), machine.predict(&added.terms, data)?),
    ];
    let mut page = Page::new(&format!("{what} added, on {}", data.source), origin, data, None);
    let rows = Rows::new(machine, data, models, added.noise_floor);
    page.push(tables::added(added, what, unit));
    residuals(&mut page, &rows);
    page.section("Error before and after", vec![waterfall::of_added(machine, data, added, what)?]);
    page.push(tables::fitted(added, machine));
    pictures(&mut page, &rows);
    Ok(page.finish())
}

/// The page of a model's history; `model` is the file's name.
pub fn history_page(file: &ModelFile, model: &str, origin: PageOrigin) -> String {
    let foot = [["command", origin.command], ["version", origin.version], ["model", model]];
    let foot: Vec<Vec<String>> = foot.iter().map(|row| row.map(str::to_owned).to_vec()).collect();
    let mut page = Page::with_foot(&format!("History of {model}"), &foot);
    let history = file.history();
    if let (Some(first), Some(last)) = (history.first(), history.last()) {
        let step = |name: String, rms: f64| Step { name, rms, half_width: None };
        let mut steps = vec![step("model at first".to_owned(), first.heldout_rms.before)];
        steps.extend(history.iter().map(|own| step(format!("+ {}", own.effect), own.heldout_rms.after)));
        page.push(tables::grown(first, last));
        let picture = waterfall::picture(&steps, last.heldout_rms.noise_floor, &last.unit);
        page.section("Error after each effect", vec![picture]);
        page.push(tables::history(history));
    } else {
        page.push(paragraph("No effect was added yet; krait lab add does."));
    }
    page.finish()
}

/// What the pages show of rows first: the residual over time and its loops.
fn residuals(page: &mut Page, rows: &Rows) {
    page.section(
        "What the model leaves",
        vec![residual::over_time(rows), residual::worst(rows), residual::loops(rows)],
    );
}

/// What else the pages show of rows.
fn pictures(page: &mut Page, rows: &Rows) {
    page.section("Where it fails", vec![places::map(rows), places::speed(rows)]);
    page.section("Direction of motion", vec![direction::split(rows)]);
    page.section("Memory", vec![memory::travel(rows), memory::holds(rows)]);
    page.section("Autocorrelation of the residual", vec![correlation::picture(rows)]);
}

/// A paragraph of escaped text.
fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escape(text))
}
