//! A model file and measurements of its machine, read and checked together.

use crate::diagnose::first_trials;
use crate::machine::{MachineUnderTest, machine_of};
use crate::read::{ColumnMap, ReadError, read, read_with};
use crate::stage::stage;
use crate::{CameraOffset, ClockOffset, LabError, Measurements, Quantity};
use krait_ipc::input;
use krait_model::model_file::{ModelFile, ModelFileError};
use std::path::{Path, PathBuf};

/// A model, its machine under the lab, and what was measured.
pub struct Session {
    /// The model file's content.
    pub file: ModelFile,
    /// The machine.
    pub machine: Box<dyn MachineUnderTest>,
    /// What was measured; of several recordings one after the other.
    pub data: Measurements,
    /// Name and first trial of each recording, where there are several.
    pub recordings: Vec<(String, usize)>,
}

/// A model or its measurements cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The model file cannot be read.
    #[error("model file {path}: {source}; check the path and its permissions", path = path.display())]
    Unreadable {
        /// The path.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The model file is refused.
    #[error("model file {path}: {source}", path = path.display())]
    Model {
        /// The path.
        path: PathBuf,
        /// Why.
        source: ModelFileError,
    },
    /// The measurements are refused.
    #[error(transparent)]
    Data(#[from] ReadError),
    /// No file and no folder is named.
    #[error("no measurements are named, expected at least one file or folder; name it with --data")]
    NoData,
    /// A folder without measurements.
    #[error("data {path}: a folder without .csv, .mcap, .parquet and .mat files; name a file, or a folder that holds some", path = path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// One recording under two names, or named twice.
    #[error("data {path}: the same bytes as {first}, expected each recording once, since data do not count twice; leave one out", path = path.display(), first = first.display())]
    Twice {
        /// The second.
        path: PathBuf,
        /// The first.
        first: PathBuf,
    },
    /// A second log beside several recordings.
    #[error("--with {path}: a second recording {other} is named, expected one that this log is joined to; name one with --data", path = path.display(), other = other.display())]
    WithSeveral {
        /// The second log.
        path: PathBuf,
        /// The second recording.
        other: PathBuf,
    },
    /// Clocks for another number of recordings.
    #[error(
        "--clock: {n_clocks} are given for {n_recordings} recordings, expected one for all or one for each in their order; leave some out or name the others"
    )]
    Clocks {
        /// Those given.
        n_clocks: usize,
        /// The recordings.
        n_recordings: usize,
    },
    /// Cameras for another number of recordings.
    #[error(
        "--camera-offset: {n_cameras} are given for {n_recordings} recordings, expected one for each in their order, 0 for the first; leave \
         them out or name the others"
    )]
    Cameras {
        /// Those given.
        n_cameras: usize,
        /// The recordings.
        n_recordings: usize,
    },
    /// A camera's angles for another machine.
    #[error(
        "--camera-offset {words}: {n_angles} angles are given for a {machine} with {n_outputs} bends, expected one for each bend of a snake or \
         of segments, or 0 for none"
    )]
    Angles {
        /// As given.
        words: String,
        /// Angles in it.
        n_angles: usize,
        /// Kind of machine.
        machine: &'static str,
        /// What a camera sees of it.
        n_outputs: usize,
    },
    /// A force has no clock of its own.
    #[error(
        "--clock: the model is of kind force, whose angle and force are filtered alike and must have one clock; leave it out"
    )]
    OneClock,
    /// Model and measurements do not fit each other.
    #[error(transparent)]
    Lab(#[from] LabError),
}

impl Session {
    /// Reads a model and measurements.
    ///
    /// # Errors
    /// [`SessionError`], one sentence.
    pub fn open(model: &Path, data: &Path, map: &ColumnMap) -> Result<Self, SessionError> {
        Self::open_all(model, &[data.to_owned()], map)
    }

    /// Reads a model and several recordings of its machine, or folders of them.
    ///
    /// # Errors
    /// [`SessionError`], one sentence.
    pub fn open_all(model: &Path, data: &[PathBuf], map: &ColumnMap) -> Result<Self, SessionError> {
        Self::open_with(model, data, None, map)
    }

    /// The same; `with` has what was measured of the one recording, by a clock of its own.
    ///
    /// # Errors
    /// [`SessionError`], one sentence.
    pub fn open_with(
        model: &Path,
        data: &[PathBuf],
        with: Option<&Path>,
        map: &ColumnMap,
    ) -> Result<Self, SessionError> {
        let file = open_model(model)?;
        let machine = machine_of(&file)?;
        stage("Reading the measurements");
        let (mut parts, mut seen) = (Vec::new(), Vec::<(PathBuf, String)>::new());
        let files = files(data)?;
        if let (Some(with), [_, other, ..]) = (with, files.as_slice()) {
            return Err(SessionError::WithSeveral { path: with.to_owned(), other: other.clone() });
        }
        for path in files {
            let expected = file.machine().into();
            let part: Measurements = match with {
                Some(with) => read_with(&path, with, map, expected)?,
                None => read(&path, map, expected)?,
            };
            if let Some((first, _)) = seen.iter().find(|(_, sha256)| *sha256 == part.sha256) {
                return Err(SessionError::Twice { path, first: PathBuf::clone(first) });
            }
            seen.push((path, part.sha256.clone()));
            parts.push(machine.bends_of_tip(part)?);
        }
        let mut parts = parts.into_iter();
        let first = parts.next().ok_or(SessionError::NoData)?;
        let (data, recordings) = Measurements::joined(first, parts);
        // Refused now, before anything is computed: an effect of the model may need a column that is not there.
        machine.predict(machine.effects(), &data.select(&[0]))?;
        Ok(Self { file, machine, data, recordings })
    }

    /// The same with the measurements of each recording where these clocks have them: none, one for all, or one for each.
    ///
    /// # Errors
    /// [`SessionError::Clocks`] for another number of clocks, [`SessionError::OneClock`] for a force.
    pub fn by_clocks(self, clocks: &[ClockOffset]) -> Result<Self, SessionError> {
        let n_recordings = self.recordings.len().max(1);
        let all = match clocks {
            [] => return Ok(self),
            [one] => vec![*one; n_recordings],
            several if several.len() == n_recordings => several.to_vec(),
            several => return Err(SessionError::Clocks { n_clocks: several.len(), n_recordings }),
        };
        if self.data.quantity == Quantity::Force {
            return Err(SessionError::OneClock);
        }
        let data = self.data.by_clocks(&all, &first_trials(&self.recordings));
        Ok(Self { data, ..self })
    }

    /// The same as if the cameras of all recordings stood where the first one's did: none, or one for each.
    ///
    /// # Errors
    /// [`SessionError::Cameras`] for another number of cameras, [`SessionError::Angles`] for another number of angles.
    pub fn by_cameras(self, cameras: &[CameraOffset]) -> Result<Self, SessionError> {
        let (n_cameras, n_recordings) = (cameras.len(), self.recordings.len().max(1));
        if cameras.is_empty() {
            return Ok(self);
        }
        if n_cameras != n_recordings {
            return Err(SessionError::Cameras { n_cameras, n_recordings });
        }
        let has_bends = matches!(self.data.quantity, Quantity::Snake | Quantity::Segments);
        let n_outputs = if has_bends { self.data.n_outputs } else { 0 };
        if let Some(own) = cameras.iter().find(|own| !own.is_none() && own.0.len() != n_outputs) {
            let (words, n_angles, machine) = (own.words(), own.0.len(), self.machine.kind());
            return Err(SessionError::Angles { words, n_angles, machine, n_outputs });
        }
        let data = self.data.by_cameras(cameras, &first_trials(&self.recordings));
        Ok(Self { data, ..self })
    }
}

/// How the names of measurements in a folder end.
const ENDINGS: [&str; 4] = ["csv", "mcap", "parquet", "mat"];

/// The files themselves, and those of folders in the order of their names.
fn files(data: &[PathBuf]) -> Result<Vec<PathBuf>, SessionError> {
    let mut all = Vec::new();
    for path in data {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let unreadable = |source| SessionError::Unreadable { path: path.clone(), source };
        let entries = std::fs::read_dir(path).map_err(unreadable)?;
        let mut own = Vec::new();
        for entry in entries {
            let entry = entry.map_err(unreadable)?.path();
            let ending = entry.extension().unwrap_or_default();
            let is_one = ENDINGS.iter().any(|own| ending == *own);
            own.extend(is_one.then_some(entry));
        }
        if own.is_empty() {
            return Err(SessionError::Empty { path: path.clone() });
        }
        own.sort();
        all.extend(own);
    }
    Ok(all)
}

/// Reads and checks a model file.
///
/// # Errors
/// [`SessionError::Unreadable`] and [`SessionError::Model`].
pub fn open_model(path: &Path) -> Result<ModelFile, SessionError> {
    let text = input::text(path, input::CONFIG_BYTES)
        .map_err(|source| SessionError::Unreadable { path: path.to_owned(), source })?;
    ModelFile::parse(&text).map_err(|source| SessionError::Model { path: path.to_owned(), source })
}
