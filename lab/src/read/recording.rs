//! Measurements from a recording of krait: the encoders of every state, the camera's shape where there is one.

use super::check::{self, Place};
use super::{ColumnMap, Expected, Hashing, ReadError, hex, source};
use crate::{LoadUse, Measurements, Quantity};
use krait_record::columns::Columns;
use krait_record::{CONFIG_ATTACHMENT, Missing, Recording, attachment};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io;
use std::path::Path;

/// Loads of a simulated machine are what the machine has; this much is left to effects that are not in the model.
const SIMULATED_GAIN_APART: f64 = 0.005;

/// How a recording begins.
pub(super) const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Reads a whole recording. A trial begins where the drives found their zero anew.
///
/// Messages that the recorder itself counted as lost are no reason to refuse it: among a thousand encoder readings each second
/// a single one is not missed.
pub(super) fn read(path: &Path, file: File, map: &ColumnMap, expected: Expected) -> Result<Measurements, ReadError> {
    if let Expected::Joints(_) = expected {
        let found = "a recording of krait is of a snake".to_owned();
        return Err(ReadError::OtherMachine { path: path.to_owned(), found, expected: "joints".to_owned() });
    }
    if *map != ColumnMap::default() {
        return Err(ReadError::MappedRecording { path: path.to_owned() });
    }
    let recording = Recording::open(path).map_err(Box::new)?;
    if let Some(missing) = recording.contents().missing.iter().find(|m| !matches!(m, Missing::Messages { .. })) {
        return Err(ReadError::CutRecording { path: path.to_owned(), missing: missing.to_string() });
    }
    let columns = Columns::of(&recording).map_err(Box::new)?;
    if columns.is_of_joints {
        let (found, expected) =
            ("a recording of joints".to_owned(), "one of a snake; joints are read from CSV".to_owned());
        return Err(ReadError::OtherMachine { path: path.to_owned(), found, expected });
    }
    let mut hashing = Hashing { source: file, hash: Sha256::new() };
    io::copy(&mut hashing, &mut io::sink()).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    let data = Measurements { load_use: load_use(&recording), ..measurements(path, &columns, hex(hashing.hash)) };
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

/// Loads count where the drives were simulated; a real drive's are made of a motor's current, and nobody knows how well.
fn load_use(recording: &Recording) -> LoadUse {
    let settings = attachment(recording, CONFIG_ATTACHMENT).and_then(|text| text.parse::<toml::Table>().ok());
    let drive = settings.as_ref().and_then(|own| own.get("slave")?.get("drive")?.get("kind")?.as_str());
    match drive {
        Some("sim") => LoadUse::Counted { gain_apart: SIMULATED_GAIN_APART },
        _ => LoadUse::Shown,
    }
}

fn measurements(path: &Path, columns: &Columns, sha256: String) -> Measurements {
    let rows = &columns.rows;
    Measurements {
        source: source(path),
        sha256,
        quantity: Quantity::Snake,
        time_s: rows.iter().map(|row| row.time_s).collect(),
        inputs: rows.iter().flat_map(|row| row.q_m).collect(),
        n_inputs: 3,
        outputs: rows.iter().flat_map(|row| row.bend_rad).collect(),
        n_outputs: 2,
        trial: rows.iter().map(|row| row.trial.saturating_sub(1)).collect(),
        loads_n: columns.has_tau().then(|| rows.iter().flat_map(|row| row.tau_n).collect()),
        load_use: LoadUse::Shown,
        stem_angle_rad: None,
        temperature_c: None,
        sigma: Some(rows.iter().map(|row| row.sigma_bend_rad).collect()),
        extra: Vec::new(),
        names: crate::Names::default(),
    }
}
