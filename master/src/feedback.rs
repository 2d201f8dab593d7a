//! Looks at what the chain does with the hand's motion, for the hand's lights and its rumble.

use crate::MasterError;
use crate::lights::{HandSeen, HandState, LightShow, Lights};
use crate::meter::{LineLoadLimits, compensation_share};
use krait_ipc::message::{Command, SlaveState};
use krait_ipc::{Bus, ReadOptions, Reader};

/// The channels that say it, and the show that counts.
pub(crate) struct Feedback {
    states: Reader<SlaveState>,
    commands: Reader<Command>,
    show: LightShow,
    load_limits: LineLoadLimits,
}

impl Feedback {
    /// For a master of so many ticks a second.
    pub(crate) fn open(bus: &Bus, rate_hz: u32, load_limits: LineLoadLimits) -> Result<Self, MasterError> {
        let states = bus.reader(ReadOptions::glancing())?;
        let commands = bus.reader(ReadOptions::glancing())?;
        Ok(Self { states, commands, show: LightShow::new(rate_hz), load_limits })
    }

    /// Counts ticks, and says what the lights show where it was time to look.
    pub(crate) fn on_ticks(&mut self, n_ticks: u64) -> Result<Option<Lights>, MasterError> {
        if !self.show.count(n_ticks) {
            return Ok(None);
        }
        // Of commands only news counts: what was the limit before a chain stood still is none of now.
        let command = self.commands.take_newest()?;
        let reasons = command.as_ref().map_or(0, |command| command.reasons);
        let seen = self.states.take_newest()?.map(|state| HandSeen {
            state: HandState::of(&state, reasons),
            load_ratio: self.load_limits.load_ratio(&state),
            compensation_share: command.as_ref().map_or(0.0, |command| compensation_share(command)),
        });
        Ok(Some(self.show.look(seen)))
    }
}
