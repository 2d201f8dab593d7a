//! A wish to change the slave's operating state: published by the supervisor, read by `slave`.

use super::message;
use iceoryx2::prelude::ZeroCopySend;

/// CRTK `state_command`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.StateCommand")]
pub struct StateCommand {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// When it was asked for, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// See [`Transition`].
    pub transition: u32,
    /// Process id of the sender.
    pub sender_pid: u32,
}

message!(StateCommand, "state_command", 1, super::RARE);

impl StateCommand {
    /// The typed transition, or `None` for a value that no version of krait sends.
    pub fn transition(&self) -> Option<Transition> {
        Transition::ALL.into_iter().find(|t| *t as u32 == self.transition)
    }
}

/// CRTK's commands on the operating state.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transition {
    /// Disabled or Fault -> Enabled.
    Enable = 0,
    /// Any -> Disabled.
    Disable = 1,
    /// Enabled -> Paused.
    Pause = 2,
    /// Paused -> Enabled.
    Resume = 3,
    /// Find the drives' zero.
    Home = 4,
    /// Forget the drives' zero.
    Unhome = 5,
    /// Fault -> Disabled, once the drives answer again.
    ClearFault = 6,
}

impl Transition {
    /// A command that was held up for longer than this is not done any more, ns: whoever asked has been told that nothing happened.
    pub const EXPIRES_NS: i64 = 1_500_000_000;

    /// Every command.
    pub const ALL: [Self; 7] =
        [Self::Enable, Self::Disable, Self::Pause, Self::Resume, Self::Home, Self::Unhome, Self::ClearFault];

    /// Whether it can only take motion away: such a command is done however late it comes.
    pub fn ends_motion(self) -> bool {
        matches!(self, Self::Disable | Self::Pause)
    }

    /// Whether it has expired by an instant; both on CLOCK_MONOTONIC, ns.
    pub fn is_late(self, asked_ns: i64, now_ns: i64) -> bool {
        !self.ends_motion() && now_ns - asked_ns > Self::EXPIRES_NS
    }

    /// CRTK's word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Enable => "enable",
            Self::Disable => "disable",
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Home => "home",
            Self::Unhome => "unhome",
            Self::ClearFault => "clear-fault",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_takes_motion_away_is_done_however_late_it_comes() {
        for transition in Transition::ALL {
            assert!(!transition.is_late(5, 5 + Transition::EXPIRES_NS), "{transition:?}");
            let ends = matches!(transition, Transition::Disable | Transition::Pause);
            assert_eq!(transition.is_late(5, 6 + Transition::EXPIRES_NS), !ends, "{transition:?}");
        }
    }
}
