//! Cycles of the bus of real drives, published by the slave behind everything that moves. Simulated drives have none.

use crate::Drive;
use krait_ipc::message::DriveCycle;
use krait_ipc::{Bus, IpcError, Writer};

/// Cycles that are published at once at most; the rest waits for the next turn of the loop.
const AT_ONCE: usize = 8;

/// The channel `drive_cycle`, if the drives hang on a bus.
pub(crate) struct BusCycles {
    writer: Option<Writer<DriveCycle>>,
}

impl BusCycles {
    /// Becomes the writer if the drives hang on a bus.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub(crate) fn open(bus: &Bus, drive: &impl Drive) -> Result<Self, IpcError> {
        Ok(Self { writer: drive.has_bus().then(|| bus.writer()).transpose()? })
    }

    /// Publishes what has ended since the last call; returns whether that was all. Wakes nobody: a recorder looks by itself.
    ///
    /// # Errors
    /// As [`Writer::put`].
    pub(crate) fn publish(&mut self, drive: &mut impl Drive) -> Result<bool, IpcError> {
        let Some(writer) = &mut self.writer else { return Ok(true) };
        for _ in 0..AT_ONCE {
            let Some(cycle) = drive.next_cycle() else { return Ok(true) };
            writer.put(&DriveCycle { sequence: writer.n_sent() + 1, ..cycle })?;
        }
        Ok(false)
    }

    /// Cycles published.
    pub(crate) fn n_sent(&self) -> u64 {
        self.writer.as_ref().map_or(0, Writer::n_sent)
    }
}
