//! What a master that is started again begins with: scale and locks as they were when the one before was lost.

use krait_ipc::message::OperatorInput;
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader};
use krait_master::LiveMotion;
use std::ffi::OsString;

/// Follows the live scale and the locks.
pub(super) struct LastHand {
    inputs: Reader<OperatorInput>,
    live: LiveMotion,
}

impl LastHand {
    /// Full scale and no lock, until an input says otherwise.
    pub(super) fn open(bus: &Bus) -> Result<Self, IpcError> {
        let inputs = bus.reader(ReadOptions::glancing())?;
        Ok(Self { inputs, live: LiveMotion::default() })
    }

    /// Takes the newest input.
    pub(super) fn look(&mut self) -> Result<(), IpcError> {
        if let Some(input) = self.inputs.take_newest()? {
            self.live = LiveMotion::from(&*input);
        }
        Ok(())
    }

    /// The same as arguments of a process; only a master has any.
    pub(super) fn arguments_of(&self, process: Process) -> Vec<OsString> {
        if process != Process::Master {
            return Vec::new();
        }
        let (scale, locks) = (self.live.scale_permille.to_string(), self.live.locks.to_string());
        vec!["--scale-permille".into(), scale.into(), "--locks".into(), locks.into()]
    }
}
