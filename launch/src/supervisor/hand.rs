//! What a master that is started again begins with: scale and locks as they were when the one before was lost.

use krait_ipc::message::{MotionWish, OperatorInput};
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader};
use std::ffi::OsString;

/// Follows the live scale and the locks.
pub(super) struct LastHand {
    inputs: Reader<OperatorInput>,
    scale_permille: u32,
    locks: u32,
}

impl LastHand {
    /// Full scale and no lock, until an input says otherwise.
    pub(super) fn open(bus: &Bus) -> Result<Self, IpcError> {
        let inputs = bus.reader(ReadOptions::glancing())?;
        Ok(Self { inputs, scale_permille: *MotionWish::SCALE_PERMILLE.end(), locks: 0 })
    }

    /// Takes the newest input.
    pub(super) fn look(&mut self) -> Result<(), IpcError> {
        if let Some(input) = self.inputs.take_newest()? {
            self.scale_permille = input.scale_permille;
            self.locks = input.flags & (OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED);
        }
        Ok(())
    }

    /// The same as arguments of a process; only a master has any.
    pub(super) fn arguments_of(&self, process: Process) -> Vec<OsString> {
        if process != Process::Master {
            return Vec::new();
        }
        let (scale, locks) = (self.scale_permille.to_string(), self.locks.to_string());
        vec!["--scale-permille".into(), scale.into(), "--locks".into(), locks.into()]
    }
}
