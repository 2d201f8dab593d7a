//! Measurements from a recording of krait: the encoders of every state, the camera's shape where there is one. Joints are
//! counted as the model counts them: lengths of cable become angles of the capstan that the recorded configuration names.

use super::check::{self, Place};
use super::unit::{Dimension, Unit};
use super::{ColumnMap, Expected, ReadError, sha256, source};
use crate::{LoadUse, Measurements, Quantity};
use krait_model::model_file::{Joints, Machine, ModelFile};
use krait_model::segments::SegmentsParameters;
use krait_record::columns::Columns;
use krait_record::{CONFIG_ATTACHMENT, MODEL_ATTACHMENT, Missing, Recording, attachment};
use std::fs::File;
use std::path::Path;

/// Loads of a simulated machine are what the machine has; this much is left to effects that are not in the model.
const SIMULATED_GAIN_APART: f64 = 0.005;

/// Reads a whole recording. A trial begins where the drives found their zero anew.
///
/// Messages that the recorder itself counted as lost are no reason to refuse it: among a thousand encoder readings each second
/// a single one is not missed.
pub(super) fn read(path: &Path, file: File, map: &ColumnMap, expected: Expected) -> Result<Measurements, ReadError> {
    if *map != ColumnMap::default() {
        return Err(ReadError::MappedRecording { path: path.to_owned() });
    }
    let recording = Recording::open(path).map_err(Box::new)?;
    if let Some(missing) = recording.contents().missing.iter().find(|m| !matches!(m, Missing::Messages { .. })) {
        return Err(ReadError::CutRecording { path: path.to_owned(), missing: missing.to_string() });
    }
    let columns = Columns::of(&recording).map_err(Box::new)?;
    let scale = match expected {
        Expected::Snake => (columns.n_joints == 0).then_some([1.0; 2]),
        Expected::Joints(joints) => (columns.n_joints == joints.n).then(|| joint_scale(&recording, joints)).flatten(),
        Expected::Segments(_) => {
            let widths = (columns.n_actuators, columns.n_joints);
            (widths == expected.widths() && matches!(driven(&recording), Some(Machine::Segments(_))))
                .then_some([1.0; 2])
        }
        Expected::Force(_) => None,
    };
    let Some([u_per_m, y_per_si]) = scale else {
        let (found, expected) = (
            match driven(&recording) {
                Some(Machine::Segments(own)) => segments(&own),
                _ => machine(columns.n_joints, None),
            },
            match expected {
                Expected::Snake => machine(0, None),
                Expected::Joints(joints) => machine(joints.n, Some(joints)),
                Expected::Force(_) => "a torque or a current, which no recording of krait holds for joints".to_owned(),
                Expected::Segments(own) => segments(own),
            },
        );
        return Err(ReadError::OtherMachine { path: path.to_owned(), found, expected });
    };
    let quantity = match expected {
        Expected::Snake => Quantity::Snake,
        Expected::Segments(_) => Quantity::Segments,
        Expected::Joints(_) | Expected::Force(_) => Quantity::Joints,
    };
    let data = Measurements {
        load_use: load_use(&recording),
        ..measurements(path, columns, quantity, [u_per_m, y_per_si], sha256(path, file)?)
    };
    let place = Place {
        path,
        rows: "in all of its trials".to_owned(),
        time: "channel /krait/state".to_owned(),
        inputs: "the encoders in channel /krait/state".to_owned(),
        outputs: "the shapes in channel /krait/shape".to_owned(),
    };
    check::enough(&place, &data)?;
    Ok(data)
}

/// Loads count where the drives were simulated. A real drive's are made of a motor's current or torque, and count where the
/// configuration states how well their gain is known.
fn load_use(recording: &Recording) -> LoadUse {
    let settings = attachment(recording, CONFIG_ATTACHMENT).and_then(|text| text.parse::<toml::Table>().ok());
    let drive = settings.as_ref().and_then(|own| own.get("slave")?.get("drive")?.get("kind")?.as_str());
    let stated = || settings.as_ref().and_then(|own| own.get("slave")?.get("drive")?.get("load_gain_sd")?.as_float());
    match drive {
        Some("sim") => LoadUse::Counted { gain_apart: SIMULATED_GAIN_APART },
        Some(_) => stated().map_or(LoadUse::Shown, |gain_sd| LoadUse::Estimated { gain_sd }),
        None => LoadUse::Shown,
    }
}

/// The machine of the model that a recording embeds.
fn driven(recording: &Recording) -> Option<Machine> {
    let file = attachment(recording, MODEL_ATTACHMENT).and_then(|text| ModelFile::parse(text).ok())?;
    Some(file.machine().clone())
}

/// Segments in words, for a refusal.
fn segments(own: &SegmentsParameters) -> String {
    let (n_lines, n_bends) = Expected::Segments(own).widths();
    let many = |n: usize, what: &str| if n == 1 { format!("{n} {what}") } else { format!("{n} {what}s") };
    format!("{} on {}", many(n_bends / 2, "segment"), many(n_lines, "line"))
}

/// A machine in words, for a refusal.
fn machine(n_joints: usize, joints: Option<&Joints>) -> String {
    match (n_joints, joints) {
        (0, _) => "a snake".to_owned(),
        (n, None) => format!("{n} joints"),
        (n, Some(Joints { u_unit, y_unit, .. })) => format!("{n} joints with u in {u_unit} and y in {y_unit}"),
    }
}

/// How many units of a model of joints are a metre of cable, and a radian (a metre of a sliding joint), in a recording. Nothing
/// where a unit is none that a chain drives, or counts another quantity than the recorded joints do.
pub fn joint_scale(recording: &Recording, joints: &Joints) -> Option<[f64; 2]> {
    let settings = attachment(recording, CONFIG_ATTACHMENT).and_then(|text| text.parse::<toml::Table>().ok());
    let radius_m = settings.and_then(|own| own.get("joints")?.get("capstan_radius_m")?.as_float())?;
    let Some(Machine::Joints(driven)) = driven(recording) else { return None };
    let (u, y) = (Unit::from_suffix(&joints.u_unit)?, Unit::from_suffix(&joints.y_unit)?);
    let per_m = match u.dimension {
        Dimension::Length => 1.0,
        Dimension::Angle => 1.0 / radius_m,
        _ => return None,
    };
    let is_same = Unit::from_suffix(&driven.y_unit).is_some_and(|own| own.dimension == y.dimension);
    is_same.then_some([per_m / u.factor, 1.0 / y.factor])
}

fn measurements(
    path: &Path,
    columns: Columns,
    quantity: Quantity,
    [u_scale, y_scale]: [f64; 2],
    sha256: String,
) -> Measurements {
    let scaled = |values: Vec<f64>, scale: f64| -> Vec<f64> {
        if scale == 1.0 { values } else { values.into_iter().map(|value| value * scale).collect() }
    };
    let (n_inputs, n_outputs) = (columns.n_actuators, columns.n_outputs());
    let loads_n = (quantity != Quantity::Joints && columns.has_tau()).then(|| columns.tau_n.clone());
    Measurements {
        source: source(path),
        sha256,
        quantity,
        time_s: columns.time_s,
        inputs: scaled(columns.q_m, u_scale),
        n_inputs,
        outputs: scaled(columns.outputs, y_scale),
        n_outputs,
        trial: columns.trial.iter().map(|trial| trial.saturating_sub(1)).collect(),
        loads_n,
        load_use: LoadUse::Shown,
        stem_angle_rad: None,
        temperature_c: None,
        sigma: Some(scaled(columns.sigma, y_scale)),
        extra: Vec::new(),
        names: match quantity {
            Quantity::Segments => crate::Names {
                outputs: crate::Names::of_segments((0..n_outputs).map(|_| None)),
                ..crate::Names::default()
            },
            _ => crate::Names::default(),
        },
        n_held_rows: 0,
        clock: None,
        tip_frames: Vec::new(),
    }
}
