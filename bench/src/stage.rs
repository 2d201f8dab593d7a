//! One process of a relay, as the process that measures starts it: its options, and what it leaves behind.

use crate::peer::Peer;
use crate::relay::{self, Counted, Inlet, Outlet};
use crate::samples::write_samples;
use crate::transport::{Place, inlet, outlet};
use crate::{BenchError, ChainKind, Plan};
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

    /// The hop that ends here, from 0.
    pub fn hop_in(self) -> Option<usize> {
        (self as usize).checked_sub(1)
    }

    /// The hop that begins here, from 0.
    pub fn hop_out(self) -> Option<usize> {
        (self != Self::Sink).then_some(self as usize)
    }
}

/// What a process of a relay is told.
#[derive(Clone, Debug)]
pub struct StageOptions {
    /// What messages travel over.
    pub kind: ChainKind,
    /// Which of the four it is.
    pub role: Role,
    /// Folder of the round; holds the plan, and takes what the process leaves behind.
    pub folder: PathBuf,
    /// How the round's files in /dev/shm begin.
    pub prefix: String,
}

/// The ways in and out of one process of a relay; a source has no way in, a sink none out.
#[derive(Default)]
pub struct Ways {
    /// From the process before.
    pub way_in: Option<Box<dyn Inlet>>,
    /// To the next process.
    pub way_out: Option<Box<dyn Outlet>>,
}

/// Runs one process of a relay to its end; `tell` takes a sentence for each wish that the kernel refused.
///
/// # Errors
/// [`BenchError`] when the plan cannot be read, or a message cannot be passed.
pub fn run_stage(options: &StageOptions, tell: &mut dyn FnMut(&str)) -> Result<(), BenchError> {
    let (folder, role) = (options.folder.as_path(), options.role);
    if let Some(peer) = Peer::of(options.kind) {
        let plan = read_plan(folder)?;
        plan.realtime.apply(role as usize, &options.prefix).iter().for_each(|refused| tell(refused));
        return Err(peer.become_it(options, &plan));
    }
    let open = |plan: &Plan| {
        let place = Place { kind: options.kind, plan, folder, prefix: &options.prefix };
        let way_in = role.hop_in().map(|hop| inlet(&place, hop)).transpose()?;
        let way_out = role.hop_out().map(|hop| outlet(&place, hop)).transpose()?;
        Ok(Ways { way_in, way_out })
    };
    run_stage_over(options, open, tell)
}

/// The same over ways that `open` opens; the processes after this one have opened theirs.
///
/// # Errors
/// [`BenchError`] when the plan cannot be read, or a message cannot be passed.
pub fn run_stage_over(
    options: &StageOptions,
    open: impl FnOnce(&Plan) -> Result<Ways, BenchError>,
    tell: &mut dyn FnMut(&str),
) -> Result<(), BenchError> {
    let (folder, role) = (options.folder.as_path(), options.role);
    let plan = read_plan(folder)?;
    let mut ways = open(&plan)?;
    plan.realtime.apply(role as usize, &options.prefix).iter().for_each(|refused| tell(refused));
    write(&ready_path(folder, role), b"ready")?;
    let counted = match (&mut ways.way_in, &mut ways.way_out) {
        (None, Some(way_out)) => relay::source(&plan, way_out.as_mut())?,
        (Some(way_in), Some(way_out)) => {
            relay::relay(&plan, role.hop_in().unwrap_or(0), way_in.as_mut(), way_out.as_mut())?
        }
        (Some(way_in), None) => {
            let (counted, samples) = relay::sink(&plan, way_in.as_mut())?;
            write_samples(&samples_path(folder), &samples)?;
            counted
        }
        (None, None) => Counted::default(),
    };
    let text = serde_json::to_vec(&counted).unwrap_or_default();
    write(&counted_path(folder, role), &text)
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

/// What a program of its own has said on standard error.
pub(crate) fn words_path(folder: &Path, role: Role) -> PathBuf {
    folder.join(format!("{}.words", role.name()))
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
