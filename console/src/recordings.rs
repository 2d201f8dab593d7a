//! The recordings in one folder: a list, and each as pictures to be played on the page.
//!
//! A page names a recording by a name from the list, never by a path. Reading happens on a thread of its own, one recording
//! at a time, and the list remembers what it has read.

use crate::snapshot::NewestSamples;
use crate::tracking::LiveTracking;
use core::ops::Range;
use krait_ipc::clock;
use krait_ipc::message::{ModelUpdate, OperatingState, Setpoint, Shape};
use krait_record::{Contents, Missing, Recorded, Recording, RecordingReadError, samples_between};
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
/// Beyond these no clock of a chain stamps, ns since its machine was started; differences of stamps within have room in 64 bits.
const STAMPS_NS: Range<i64> = 0..i64::MAX / 2;
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
    /// How far the measured shape is from the setpoint of its exposure, as the live page and `krait compare` pair them: rad, of joints that
    /// of the one that is farthest off (m where it slides).
    pub off: Vec<Option<f64>>,
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
    let mut known = Known::default();
    let mut next_s = 0.0;
    for recorded in recording.samples()? {
        // What is damaged is named in the list; the rest is shown.
        let Ok(recorded) = recorded else { continue };
        let t_s = recorded.log_ns.saturating_sub(first) as f64 * 1e-9;
        while t_s >= next_s && film.t_s.len() < MOST_PICTURES {
            film.add(next_s, first.saturating_add((next_s * 1e9) as u64), &known);
            next_s += step_s;
        }
        match &recorded.sample {
            Sample::Marker(marker) | Sample::DeviceMarker(marker) if film.marks.len() < MOST_MARKS => {
                film.marks.push((t_s, marker.text().unwrap_or("?").to_owned()));
            }
            _ => known.take(&recorded),
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

/// What is known at an instant of a recording, as the live page knows it: a shape counts for as long as it does there.
#[derive(Debug, Default)]
struct Known {
    newest: NewestSamples,
    tracking: LiveTracking,
    operating: &'static str,
    /// The file's clock less that of the shape's stamps, ns.
    ahead_ns: i64,
}

impl Known {
    fn take(&mut self, recorded: &Recorded) {
        match &recorded.sample {
            Sample::Shape(shape) if STAMPS_NS.contains(&shape.sample_ns) => {
                self.tracking.shape(shape);
                self.ahead_ns = recorded.publish_ns.cast_signed().saturating_sub(shape.sample_ns);
                self.newest.shape = Some(*shape);
            }
            Sample::Setpoint(setpoint) if STAMPS_NS.contains(&setpoint.sample_ns) => {
                self.tracking.setpoint(setpoint);
                self.newest.setpoint = Some(*setpoint);
            }
            Sample::State(state) => self.operating = state.operating().map_or("UNKNOWN", OperatingState::name),
            _ => {}
        }
    }

    /// The shape, where it is fresh enough to be a picture at an instant of the file's clock.
    fn shape_at(&self, instant_ns: u64) -> Option<&Shape> {
        self.newest.fresh_shape(instant_ns.cast_signed().saturating_sub(self.ahead_ns).max(0))
    }
}

impl Film {
    /// The next picture.
    fn add(&mut self, t_s: f64, instant_ns: u64, known: &Known) {
        let shape = known.shape_at(instant_ns);
        let setpoint = known.newest.setpoint.as_ref();
        let bend = shape.and_then(Shape::valid_bend_rad);
        let joints = shape.and_then(Shape::valid_joints_rad).map(<[f64]>::to_vec);
        let joints_wanted = setpoint
            .and_then(|of| of.joints_rad.get(..of.n_joints as usize))
            .filter(|all| !all.is_empty())
            .map(<[f64]>::to_vec);
        let is_measured = match &joints_wanted {
            Some(wanted) => joints.as_ref().is_some_and(|joints| joints.len() == wanted.len()),
            None => bend.is_some(),
        };
        self.t_s.push(t_s);
        self.off.push(known.tracking.newest().filter(|off| is_measured && off.is_finite()));
        self.bend.push(bend);
        self.setpoint.push(setpoint.map(|of| of.bend_rad).filter(|bend| bend.iter().all(|b| b.is_finite())));
        self.joints.push(joints);
        self.joints_wanted.push(joints_wanted);
        self.jaw.push(shape.and_then(Shape::valid_jaw_rad));
        self.jaw_wanted.push(setpoint.and_then(Setpoint::jaw_rad));
        self.operating.push(known.operating);
    }
}

fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;
    use krait_ipc::message::Phase;
    use krait_record::{About, RecordingWriter};
    use std::collections::BTreeMap;

    /// What a simulated machine is told at an instant.
    fn setpoint(sample_ns: i64, bend_rad: [f64; 2]) -> Setpoint {
        Setpoint {
            sequence: sample_ns.unsigned_abs(),
            sample_ns,
            input_sequence: 1,
            state_sequence: 1,
            bend_rad,
            motion_scale: 1.0,
            phase: Phase::Following as u32,
            ..Setpoint::default()
        }
    }

    /// A camera that needs 100 ms and ends after two seconds of four: the snake follows exactly, a little beside where it shall be.
    #[test]
    fn a_shape_is_paired_with_the_setpoint_of_its_exposure_and_missing_once_it_is_old() {
        const MS: i64 = 1_000_000;
        let path = std::env::temp_dir().join(format!("krait-film-{}.mcap", std::process::id()));
        let _none_is_fine = std::fs::remove_file(&path);
        let about = About::run("film", &BTreeMap::new(), Vec::new());
        let mut writer = RecordingWriter::create(&path, 1 << 18, &about).expect("created");
        let (begun_ns, bend_at) = (clock::monotonic_ns(), |ms: i64| 1e-4 * ms as f64);
        for ms in (0..4_000).step_by(10) {
            let now_ns = begun_ns + ms * MS;
            writer.write(&Sample::Setpoint(setpoint(now_ns, [bend_at(ms), 0.0])), now_ns).expect("written");
            if (100..=2_100).contains(&ms) {
                let exposed_ns = now_ns - 100 * MS;
                let seen = Shape::of_bend(ms.unsigned_abs(), exposed_ns, now_ns, [bend_at(ms - 100), 0.01]);
                writer.write(&Sample::Shape(seen), now_ns).expect("written");
            }
        }
        writer.finish(&BTreeMap::new()).expect("finished");
        let film = film_of(&path).expect("a film");
        std::fs::remove_file(&path).expect("removed");
        let at = |seconds: f64| film.t_s.iter().position(|t_s| *t_s >= seconds).expect("a picture");
        for seconds in [0.5, 1.0, 2.0, 2.4] {
            let off = film.off[at(seconds)].expect("measured");
            assert!((off - 0.01).abs() < 1e-9, "{off} at {seconds} s");
        }
        let (bend, setpoint) = (film.bend[at(1.0)].expect("a bend"), film.setpoint[at(1.0)].expect("a setpoint"));
        assert!((setpoint[0] - bend[0] - bend_at(100)).abs() < 3e-3, "what is drawn is what was known then");
        for seconds in [2.6, 3.0, 3.9] {
            assert_eq!((film.bend[at(seconds)], film.off[at(seconds)]), (None, None), "the camera has ended");
            assert!(film.setpoint[at(seconds)].is_some());
        }
    }

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
