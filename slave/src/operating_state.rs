//! CRTK's operating state: which of the four meta-states holds, and which commands are valid in it.
//!
//! | state \ command | enable | disable | pause | resume | home | unhome | clear-fault |
//! |---|---|---|---|---|---|---|---|
//! | DISABLED | ENABLED | DISABLED | refused | refused | refused: needs power | DISABLED | refused |
//! | ENABLED | ENABLED | DISABLED | PAUSED | refused | ENABLED, busy | ENABLED | refused |
//! | PAUSED | refused | DISABLED | PAUSED | ENABLED | refused: may not move | PAUSED | refused |
//! | FAULT | ENABLED (retry) | DISABLED (retry) | refused | refused | refused | refused | DISABLED |
//!
//! Before DISABLED the lines may have to be relaxed: until then the state is PAUSED, because power is on and no command moves
//! anything, while DISABLED is desired. There `pause` and `disable` change nothing and the others are refused.
//!
//! A command that leaves ENABLED, and `unhome`, end a search for zero that is under way, without a zero. A fault forgets
//! the zero: what a faulted drive says about it is not trusted. No command enters FAULT.

use krait_ipc::message::{OperatingState, Transition};

/// The operating state with CRTK's modes `is_homed` and `is_busy`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OperatingMachine {
    state: OperatingState,
    desired: OperatingState,
    homed: bool,
    busy: bool,
}

/// A command that is not valid in the present state; nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TransitionRefused {
    /// CRTK's table has no such transition.
    #[error("`{}` is not valid in {}, so nothing changed; {advice}", .transition.name(), .state.name())]
    Invalid {
        /// What was asked for.
        transition: Transition,
        /// The state that stays.
        state: OperatingState,
        /// What to do.
        advice: &'static str,
    },
    /// The number names no command.
    #[error("state command number {found} is unknown, expected 0 to 6, so nothing changed; check the sender's version")]
    Unknown {
        /// The number found.
        found: u32,
    },
    /// A stop came after the command had been asked for.
    #[error("`{}` was asked for before the stop, so nothing changed; send it again", .transition.name())]
    BeforeStop {
        /// What was asked for.
        transition: Transition,
    },
    /// The drives refused what the transition needs.
    #[error("the transition failed and the slave is in FAULT: {0}")]
    Drive(#[from] crate::DriveError),
}

impl Default for OperatingMachine {
    fn default() -> Self {
        Self { state: OperatingState::Disabled, desired: OperatingState::Disabled, homed: false, busy: false }
    }
}

impl OperatingMachine {
    /// A machine in a state that another process reports, to ask what would be valid there.
    pub fn in_state(state: OperatingState, is_busy: bool) -> Self {
        Self { state, desired: state, homed: false, busy: is_busy }
    }

    /// The meta-state.
    pub fn state(&self) -> OperatingState {
        self.state
    }

    /// The meta-state that was asked for last; after a fault the two differ.
    pub fn desired(&self) -> OperatingState {
        self.desired
    }

    /// Whether the drives know their zero.
    pub fn is_homed(&self) -> bool {
        self.homed
    }

    /// Whether a search for zero is under way.
    pub fn is_busy(&self) -> bool {
        self.busy
    }

    /// Whether commands may be executed: Enabled, homed and not busy.
    pub fn is_ready(&self) -> bool {
        self.state == OperatingState::Enabled && self.homed && !self.busy
    }

    /// Whether DISABLED was asked for and power has yet to go.
    pub fn is_letting_go(&self) -> bool {
        (self.state, self.desired) == (OperatingState::Paused, OperatingState::Disabled)
    }

    /// DISABLED was asked for where there is power, and something has to be done before it goes: `disable` then makes it so.
    pub fn let_go(&mut self) {
        (self.state, self.desired, self.busy) = (OperatingState::Paused, OperatingState::Disabled, false);
    }

    /// Executes a command, or says why not and changes nothing.
    ///
    /// # Errors
    /// [`TransitionRefused::Invalid`].
    pub fn apply(&mut self, transition: Transition) -> Result<(), TransitionRefused> {
        use OperatingState::{Disabled, Enabled, Fault, Paused};
        if self.is_letting_go() && transition != Transition::Disable {
            let advice = "the power is about to go; wait until it has";
            let refused = TransitionRefused::Invalid { transition, state: self.state, advice };
            return if transition == Transition::Pause { Ok(()) } else { Err(refused) };
        }
        let next = match (self.state, transition) {
            (Disabled | Enabled | Fault, Transition::Enable) => Enabled,
            (_, Transition::Disable) | (Fault, Transition::ClearFault) => Disabled,
            (Enabled | Paused, Transition::Pause) => Paused,
            (Paused, Transition::Resume) => Enabled,
            (Enabled, Transition::Home) if !self.busy => Enabled,
            (Disabled | Enabled | Paused, Transition::Unhome) => self.state,
            (state, transition) => {
                return Err(TransitionRefused::Invalid { transition, state, advice: advice(state) });
            }
        };
        match transition {
            Transition::Home => (self.busy, self.homed) = (true, false),
            Transition::Unhome => (self.busy, self.homed) = (false, false),
            _ => {}
        }
        self.busy &= next == Enabled;
        (self.state, self.desired) = (next, next);
        Ok(())
    }

    /// The search for zero has succeeded.
    pub fn homing_done(&mut self) {
        if self.busy {
            (self.busy, self.homed) = (false, true);
        }
    }

    /// The drives failed: motion is forbidden until `enable`, `disable` or `clear-fault` is sent. What becomes of the power is not decided here.
    pub fn fault(&mut self) {
        *self = Self { state: OperatingState::Fault, desired: self.desired, homed: false, busy: false };
    }
}

fn advice(state: OperatingState) -> &'static str {
    match state {
        OperatingState::Disabled => "send `enable` first",
        OperatingState::Enabled => "the drives are enabled already, or busy homing",
        OperatingState::Paused => "send `resume` or `disable` first",
        OperatingState::Fault => "mend the drives, then send `enable`, `disable` or `clear-fault`",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use OperatingState::{Disabled, Enabled, Fault, Paused};
    use Transition::{ClearFault, Disable, Enable, Home, Pause, Resume, Unhome};

    fn machine(state: OperatingState) -> OperatingMachine {
        OperatingMachine { state, desired: state, homed: true, busy: false }
    }

    #[test]
    fn the_transition_table_of_crtk_holds_in_every_cell() {
        let table = [
            (Disabled, [Some(Enabled), Some(Disabled), None, None, None]),
            (Enabled, [Some(Enabled), Some(Disabled), Some(Paused), None, None]),
            (Paused, [None, Some(Disabled), Some(Paused), Some(Enabled), None]),
            (Fault, [Some(Enabled), Some(Disabled), None, None, Some(Disabled)]),
        ];
        for (state, row) in table {
            for (transition, expected) in [Enable, Disable, Pause, Resume, ClearFault].into_iter().zip(row) {
                let mut m = machine(state);
                let result = m.apply(transition);
                assert_eq!(result.is_ok(), expected.is_some(), "{state:?} {transition:?}");
                assert_eq!(m, machine(expected.unwrap_or(state)), "{state:?} {transition:?}");
            }
        }
    }

    #[test]
    fn an_invalid_transition_is_answered_by_a_sentence_and_changes_nothing() {
        for state in [Disabled, Enabled, Paused, Fault] {
            for transition in Transition::ALL {
                let mut m = machine(state);
                if let Err(refused) = m.apply(transition) {
                    assert_eq!(m, machine(state));
                    let sentence = refused.to_string();
                    assert!(sentence.contains(transition.name()) && sentence.contains(state.name()), "{sentence}");
                }
            }
        }
    }

    #[test]
    fn while_power_is_about_to_go_nothing_brings_it_back() {
        let mut m = machine(Enabled);
        m.let_go();
        assert_eq!((m.state(), m.desired(), m.is_ready()), (Paused, Disabled, false));
        for transition in [Enable, Resume, Home, Unhome, ClearFault] {
            let before = m;
            let sentence = m.apply(transition).unwrap_err().to_string();
            assert!(m == before && sentence.contains("about to go"), "{sentence}");
        }
        m.apply(Pause).unwrap();
        assert!(m.is_letting_go());
        m.apply(Disable).unwrap();
        assert!(!m.is_letting_go() && m.state() == Disabled);
    }

    #[test]
    fn homing_needs_power_makes_busy_and_ends_homed() {
        assert!(machine(Disabled).apply(Home).is_err());
        assert!(machine(Paused).apply(Home).is_err());
        let mut m = OperatingMachine::default();
        m.apply(Enable).unwrap();
        assert!(!m.is_ready());
        m.apply(Home).unwrap();
        assert!(m.is_busy() && !m.is_homed() && !m.is_ready());
        assert!(m.apply(Home).is_err(), "one search at a time");
        m.homing_done();
        assert!(m.is_ready() && !m.is_busy());
        m.apply(Unhome).unwrap();
        assert!(!m.is_homed() && !m.is_ready());
    }

    #[test]
    fn what_leaves_enabled_ends_a_search_without_a_zero() {
        for transition in [Disable, Pause, Unhome] {
            let mut m = machine(Enabled);
            m.apply(Home).unwrap();
            m.apply(transition).unwrap();
            m.homing_done();
            assert!(!m.is_busy() && !m.is_homed(), "{transition:?}");
        }
    }

    #[test]
    fn a_fault_forgets_the_zero_and_is_left_by_retry_only() {
        let mut m = machine(Enabled);
        m.fault();
        assert!(!m.is_homed());
        assert_eq!((m.state(), m.desired()), (Fault, Enabled), "what was asked for stays known");
        assert!(m.apply(Pause).is_err() && m.apply(Resume).is_err() && m.apply(Home).is_err());
        m.apply(Enable).unwrap();
        assert_eq!(m.state(), Enabled);
    }
}
