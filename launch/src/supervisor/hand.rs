//! What a master that is started again begins with: scale and locks as they were when the one before was lost, and no device where its user
//! has given that back.

use krait_ipc::message::OperatorInput;
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader};
use krait_master::LiveMotion;
use std::ffi::OsString;

/// Follows the live scale, the locks, and whether the device was given back.
pub(super) struct LastHand {
    inputs: Reader<OperatorInput>,
    live: LiveMotion,
    is_given_back: bool,
}

impl LastHand {
    /// Full scale and no lock, until an input says otherwise.
    pub(super) fn open(bus: &Bus) -> Result<Self, IpcError> {
        let inputs = bus.reader(ReadOptions::glancing())?;
        Ok(Self { inputs, live: LiveMotion::default(), is_given_back: false })
    }

    /// Takes the newest input.
    pub(super) fn look(&mut self) -> Result<(), IpcError> {
        if let Some(input) = self.inputs.take_newest()? {
            self.live = LiveMotion::from(&*input);
            self.is_given_back = input.is_given_back();
        }
        Ok(())
    }

    /// The same as arguments of a process; only a master has any.
    pub(super) fn arguments_of(&self, process: Process) -> Vec<OsString> {
        if process != Process::Master {
            return Vec::new();
        }
        let (scale, locks) = (self.live.scale_permille.to_string(), self.live.locks.to_string());
        let mut arguments: Vec<OsString> =
            vec!["--scale-permille".into(), scale.into(), "--locks".into(), locks.into(), "--started-again".into()];
        arguments.extend(self.is_given_back.then(|| "--given-back".into()));
        arguments
    }
}
