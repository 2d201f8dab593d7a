//! The recordings in one folder: a list, and each as pictures to be played on the page.
//!
//! A page names a recording by a name from the list, never by a path. Reading happens on a thread of its own, one recording
//! at a time, and the list remembers what it has read.

use krait_ipc::clock;
use krait_ipc::message::{ModelUpdate, OperatingState};
use krait_record::{Contents, Missing, Recording, RecordingReadError, samples_between};
use krait_schema::{Channel, Sample};
use serde::Serialize;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Pictures a second of a recording.
const RATE_HZ: f64 = 30.0;
/// Most pictures of one recording: 20 minutes; what is longer has fewer a second.
const MOST_PICTURES: usize = 36_000;
/// A recorder writes at least so often, s.
const WRITTEN_WITHIN_S: u64 = 5;
/// Most marks that are shown.
const MOST_MARKS: usize = 200;

/// Names what an update of a recording says, a sentence for each learnt parameter.
pub type LearntOf = fn(&Recording, &ModelUpdate) -> Vec<String>;

/// One recording of the list.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// File name.
    pub name: String,
    /// Bytes of the file.
    pub bytes: u64,
    /// When it was last written, s since 1970.
    pub modified_s: u64,
    /// Length, s; null where it could not be read.
    pub seconds: Option<f64>,
    /// Compensation that it was made with.
    pub compensation: Option<String>,
    /// Marks in it.
    pub n_marks: u64,
    /// Samples that the recorder lost or dropped; null where it has not said so, because the file has no end.
    pub n_lost: Option<u64>,
    /// What was learnt until the end, a sentence for each parameter.
    pub learnt: Vec<String>,
    /// What is missing or damaged, or why it cannot be read.
    pub missing: Vec<String>,
    /// The recorder still writes it: it has no end yet.
    pub is_being_recorded: bool,
    #[serde(skip)]
    breaks_off: bool,
}

/// A recording as pictures; every column has one value a picture, null where there is none.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Film {
    /// File name.
    pub name: String,
    /// Since the first picture, s.
    pub t_s: Vec<f64>,
    /// Measured bend vector, rad.
    pub bend: Vec<Option<[f64; 2]>>,
    /// Commanded bend vector, rad.
    pub setpoint: Vec<Option<[f64; 2]>>,
    /// Measured positions of joints, rad (m where they slide); empty for a snake.
    pub joints: Vec<Option<Vec<f64>>>,
    /// Commanded ones.
    pub joints_wanted: Vec<Option<Vec<f64>>>,
    /// Measured angle of a gripper's jaw, rad; empty for a machine without one.
    pub jaw: Vec<Option<f64>>,
    /// Commanded one.
    pub jaw_wanted: Vec<Option<f64>>,
    /// Operating state.
    pub operating: Vec<&'static str>,
    /// Marks: when, s, and what.
    pub marks: Vec<(f64, String)>,
}

impl Entry {
    /// As it is at an instant: a file without an end that was written just now is no damaged one.
    fn seen_at(mut self, now_s: u64) -> Self {
        if self.breaks_off && now_s.saturating_sub(self.modified_s) <= WRITTEN_WITHIN_S {
            self.is_being_recorded = true;
            self.missing.clear();
        }
        self
    }
}

/// The recordings in a folder.
#[derive(Debug)]
pub struct Recordings {
    folder: PathBuf,
    learnt_of: LearntOf,
    known: Mutex<HashMap<(String, u64, u64), Entry>>,
}

impl Recordings {
    /// Of a folder, which may not be there yet.
    pub fn new(folder: PathBuf, learnt_of: LearntOf) -> Self {
        Self { folder, learnt_of, known: Mutex::default() }
    }

    /// The path of a recording that is in the list; nothing for any other name.
    pub fn path_of(&self, name: &str) -> Option<PathBuf> {
        self.files().into_iter().find(|file| file.0 == name).map(|(name, ..)| self.folder.join(name))
    }

    /// Everything in the folder, newest first.
    pub fn list(&self) -> Vec<Entry> {
        let now_s = clock::wall_ns() as u64 / 1_000_000_000;
        let mut entries: Vec<Entry> = self.files().into_iter().map(|file| self.entry(file).seen_at(now_s)).collect();
        entries.sort_by(|a, b| b.modified_s.cmp(&a.modified_s).then(a.name.cmp(&b.name)));
        entries
    }

    /// Names, sizes and times of the regular files that end in `.mcap`.
    fn files(&self) -> Vec<(String, u64, u64)> {
        let Ok(files) = std::fs::read_dir(&self.folder) else { return Vec::new() };
        let file = |entry: std::fs::DirEntry| {
            let (name, metadata) = (entry.file_name().into_string().ok()?, entry.metadata().ok()?);
            let is_recording = metadata.is_file() && name.ends_with(".mcap");
            is_recording.then(|| (name, metadata.len(), seconds_of(metadata.modified().ok())))
        };
        files.flatten().filter_map(file).collect()
    }

    fn entry(&self, file: (String, u64, u64)) -> Entry {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(entry) = known.get(&file) {
            return entry.clone();
        }
        let entry = read_entry(&self.folder.join(&file.0), &file, self.learnt_of);
        known.retain(|(name, ..), _| *name != file.0);
        known.insert(file, entry.clone());
        entry
    }
}

fn seconds_of(time: Option<SystemTime>) -> u64 {
    time.and_then(|time| time.duration_since(UNIX_EPOCH).ok()).map_or(0, |since| since.as_secs())
}

fn read_entry(path: &Path, (name, bytes, modified_s): &(String, u64, u64), learnt_of: LearntOf) -> Entry {
    let mut entry = Entry {
        name: name.clone(),
        bytes: *bytes,
        modified_s: *modified_s,
        seconds: None,
        compensation: None,
        n_marks: 0,
        n_lost: None,
        learnt: Vec::new(),
        missing: Vec::new(),
        is_being_recorded: false,
        breaks_off: false,
    };
    match Recording::open(path) {
        Ok(recording) => {
            let contents = recording.contents();
            let spans = contents.channels.values();
            let first = spans.clone().map(|channel| channel.first_log_ns).min();
            let last = spans.map(|channel| channel.last_log_ns).max();
            entry.seconds = first.zip(last).map(|(first, last)| last.saturating_sub(first) as f64 * 1e-9);
            entry.compensation = contents.metadata.get("krait").and_then(|about| about.get("compensation")).cloned();
            entry.missing = contents.missing.iter().map(ToString::to_string).collect();
            let is_end = |what: &Missing| matches!(what, Missing::Cut { .. } | Missing::End { .. });
            entry.breaks_off = !contents.missing.is_empty() && contents.missing.iter().all(is_end);
            let marks = [Channel::Marker, Channel::DeviceMarker];
            entry.n_marks =
                marks.iter().filter_map(|channel| contents.channels.get(channel)).map(|of| of.n_messages).sum();
            entry.n_lost = lost_in(contents);
            entry.learnt = newest_update(path, contents).map_or_else(Vec::new, |update| learnt_of(&recording, &update));
        }
        Err(error) => entry.missing = vec![error.to_string()],
    }
    entry
}

/// What the recorder counted at its end.
fn lost_in(contents: &Contents) -> Option<u64> {
    contents.metadata.get("krait.end")?;
    contents.missing.iter().try_fold(0_u64, |n, what| match what {
        Missing::Messages { n_dropped, n_lost } => Some(n.saturating_add(*n_dropped).saturating_add(*n_lost)),
        Missing::Count { .. } => None,
        _ => Some(n),
    })
}

/// The newest model update, by the file's index: a chunk is read for it, not the file. Without an index nobody knows.
fn newest_update(path: &Path, contents: &Contents) -> Option<ModelUpdate> {
    let last_ns = contents.channels.get(&Channel::ModelUpdate).filter(|_| contents.is_indexed)?.last_log_ns;
    let samples = samples_between(path, last_ns..last_ns.saturating_add(1)).ok()?;
    samples.into_iter().rev().find_map(|recorded| match recorded.sample {
        Sample::ModelUpdate(update) => Some(update),
        _ => None,
    })
}

/// A recording as pictures.
///
/// # Errors
/// [`RecordingReadError`] for a file that is no recording.
pub fn film_of(path: &Path) -> Result<Film, RecordingReadError> {
    let recording = Recording::open(path)?;
    let spans = recording.contents().channels.values();
    let first = spans.clone().map(|channel| channel.first_log_ns).min().unwrap_or_default();
    let last = spans.map(|channel| channel.last_log_ns).max().unwrap_or_default();
    let seconds = last.saturating_sub(first) as f64 * 1e-9;
    let step_s = (seconds / MOST_PICTURES as f64).max(1.0 / RATE_HZ);
    let mut film = Film { name: name_of(path), ..Film::default() };
    let (mut bend, mut setpoint, mut operating) = (None, None, "");
    let (mut joints, mut joints_wanted) = (None, None);
    let (mut jaw, mut jaw_wanted) = (None, None);
    let mut next_s = 0.0;
    for recorded in recording.samples()? {
        // What is damaged is named in the list; the rest is shown.
        let Ok(recorded) = recorded else { continue };
        let t_s = recorded.log_ns.saturating_sub(first) as f64 * 1e-9;
        while t_s >= next_s && film.t_s.len() < MOST_PICTURES {
            film.t_s.push(next_s);
            film.bend.push(bend);
            film.setpoint.push(setpoint);
            film.joints.push(joints.clone());
            film.joints_wanted.push(joints_wanted.clone());
            film.jaw.push(jaw);
            film.jaw_wanted.push(jaw_wanted);
            film.operating.push(operating);
            next_s += step_s;
        }
        match recorded.sample {
            Sample::Shape(shape) => {
                bend = Some(shape.bend_rad).filter(|bend| bend.iter().all(|b| b.is_finite()));
                jaw = shape.valid_jaw_rad();
                joints = shape.valid_joints_rad().map(<[f64]>::to_vec);
            }
            Sample::Setpoint(of) => {
                setpoint = Some(of.bend_rad).filter(|bend| bend.iter().all(|b| b.is_finite()));
                jaw_wanted = of.jaw_rad();
                joints_wanted =
                    of.joints_rad.get(..of.n_joints as usize).filter(|all| !all.is_empty()).map(<[f64]>::to_vec);
            }
            Sample::State(state) => operating = state.operating().map_or("UNKNOWN", OperatingState::name),
            Sample::Marker(marker) | Sample::DeviceMarker(marker) if film.marks.len() < MOST_MARKS => {
                film.marks.push((t_s, marker.text().unwrap_or("?").to_owned()));
            }
            _ => {}
        }
    }
    if film.joints_wanted.iter().all(Option::is_none) {
        film.joints.clear();
        film.joints_wanted.clear();
    }
    if film.jaw_wanted.iter().all(Option::is_none) {
        film.jaw.clear();
        film.jaw_wanted.clear();
    }
    Ok(film)
}

fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_is_being_recorded_while_it_is_written_and_broken_later() {
        let entry = |breaks_off| Entry {
            name: "a.mcap".to_owned(),
            bytes: 1,
            modified_s: 100,
            seconds: None,
            compensation: None,
            n_marks: 0,
            n_lost: None,
            learnt: Vec::new(),
            missing: vec!["it breaks off".to_owned()],
            is_being_recorded: false,
            breaks_off,
        };
        let (now, later, whole) = (entry(true).seen_at(102), entry(true).seen_at(200), entry(false).seen_at(102));
        assert!(now.is_being_recorded && now.missing.is_empty());
        assert!(!later.is_being_recorded && later.missing.len() == 1);
        assert!(!whole.is_being_recorded && whole.missing.len() == 1, "damaged otherwise");
    }
}
