//! The ways to pass a message from one process to the next, each behind [`Inlet`] and [`Outlet`].

mod fd;
mod futex;
mod iox;

use crate::relay::{Inlet, Outlet};
use crate::{BenchError, ChainKind, Plan};
use core::time::Duration;
use std::path::Path;
use std::process::Stdio;

pub(crate) use fd::Pipework;

/// A relay that hears nothing for this long ends: its source has ended, or died.
pub const PATIENCE: Duration = Duration::from_secs(1);

/// Where one relay meets the others.
pub(crate) struct Place<'a> {
    /// What it passes messages over.
    pub kind: ChainKind,
    /// Rate, size, way to wait.
    pub plan: &'a Plan,
    /// Folder of the round.
    pub folder: &'a Path,
    /// How the round's files in /dev/shm begin.
    pub prefix: &'a str,
}

/// The way in from the hop before; `hop` counts from 0.
pub(crate) fn inlet(place: &Place, hop: usize) -> Result<Box<dyn Inlet>, BenchError> {
    match place.kind {
        ChainKind::FloorFutex => Ok(Box::new(futex::Ring::open(place, hop)?)),
        ChainKind::UnixDatagram | ChainKind::Pipe => Ok(Box::new(fd::Fd::inlet(place)?)),
        _ => Ok(Box::new(iox::In::open(place, hop)?)),
    }
}

/// The way out to the next hop.
pub(crate) fn outlet(place: &Place, hop: usize) -> Result<Box<dyn Outlet>, BenchError> {
    match place.kind {
        ChainKind::FloorFutex => Ok(Box::new(futex::Ring::open(place, hop)?)),
        ChainKind::UnixDatagram | ChainKind::Pipe => Ok(Box::new(fd::Fd::outlet(place)?)),
        _ => Ok(Box::new(iox::Out::open(place, hop)?)),
    }
}

/// Standard input and output for the process between hop `idx - 1` and hop `idx`, where messages travel over those.
pub(crate) fn standard_streams(pipework: &mut Option<Pipework>, idx: usize) -> (Stdio, Stdio) {
    pipework.as_mut().map_or_else(|| (Stdio::null(), Stdio::null()), |pipework| pipework.streams_of(idx))
}
