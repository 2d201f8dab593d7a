//! One process of a relay, as the process that measures starts it: its options, and what it leaves behind.

use crate::relay::{self, Counted};
use crate::samples::write_samples;
use crate::transport::{Place, inlet, outlet};
use crate::{BenchError, Kind, Plan};
use std::fs;
use std::path::{Path, PathBuf};

/// Which of the four processes of a relay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Sends at a fixed rate.
    Source,
    /// Passes on.
    Relay1,
    /// Passes on.
    Relay2,
    /// Keeps the stamps.
    Sink,
}

impl Role {
    /// Every role, in the order of the chain.
    pub const ALL: [Self; 4] = [Self::Source, Self::Relay1, Self::Relay2, Self::Sink];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Source => "source",
            Self::Relay1 => "relay-1",
            Self::Relay2 => "relay-2",
            Self::Sink => "sink",
        }
    }

    /// The role with a name.
    ///
    /// # Errors
    /// A sentence with every name that there is.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|role| role.name() == name);
        found.ok_or_else(|| format!("{name:?} is no role: expected source, relay-1, relay-2 or sink"))
    }
}

/// What a process of a relay is told.
#[derive(Clone, Debug)]
pub struct StageOptions {
    /// What messages travel over.
    pub kind: Kind,
    /// Which of the four it is.
    pub role: Role,
    /// Folder of the round; holds the plan, and takes what the process leaves behind.
    pub folder: PathBuf,
    /// How the round's files in /dev/shm begin.
    pub prefix: String,
}

/// Runs one process of a relay to its end.
///
/// # Errors
/// [`BenchError`] when the plan cannot be read, or a message cannot be passed.
pub fn run_stage(options: &StageOptions) -> Result<Vec<String>, BenchError> {
    let (folder, role) = (options.folder.as_path(), options.role);
    let plan = read_plan(folder)?;
    let place = Place { kind: options.kind, plan: &plan, folder, prefix: &options.prefix };
    let hop = role as usize;
    let mut way_in = if role == Role::Source { None } else { Some(inlet(&place, hop - 1)?) };
    let mut way_out = if role == Role::Sink { None } else { Some(outlet(&place, hop)?) };
    let refused = plan.realtime.apply(hop, &options.prefix);
    write(&ready_path(folder, role), b"ready")?;
    let counted = match (&mut way_in, &mut way_out) {
        (None, Some(way_out)) => relay::source(&plan, way_out.as_mut())?,
        (Some(way_in), Some(way_out)) => relay::relay(&plan, hop - 1, way_in.as_mut(), way_out.as_mut())?,
        (Some(way_in), None) => {
            let (counted, samples) = relay::sink(&plan, way_in.as_mut())?;
            write_samples(&samples_path(folder), &samples)?;
            counted
        }
        (None, None) => Counted::default(),
    };
    let text = serde_json::to_vec(&counted).unwrap_or_default();
    write(&counted_path(folder, role), &text)?;
    Ok(refused)
}

pub(crate) fn write_plan(folder: &Path, plan: &Plan) -> Result<(), BenchError> {
    write(&folder.join("plan.json"), &serde_json::to_vec(plan).unwrap_or_default())
}

fn read_plan(folder: &Path) -> Result<Plan, BenchError> {
    read_json(&folder.join("plan.json"))
}

pub(crate) fn read_counted(folder: &Path, role: Role) -> Result<Counted, BenchError> {
    read_json(&counted_path(folder, role))
}

pub(crate) fn ready_path(folder: &Path, role: Role) -> PathBuf {
    folder.join(format!("{}.ready", role.name()))
}

pub(crate) fn samples_path(folder: &Path) -> PathBuf {
    folder.join("samples.bin")
}

fn counted_path(folder: &Path, role: Role) -> PathBuf {
    folder.join(format!("{}.json", role.name()))
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, BenchError> {
    let text = fs::read(path).map_err(BenchError::file("read", path))?;
    serde_json::from_slice(&text).map_err(|error| BenchError::file("understood", path)(error.into()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), BenchError> {
    fs::write(path, bytes).map_err(BenchError::file("written", path))
}
