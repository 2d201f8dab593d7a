//! CiA 402's state machine of a drive, as functions of its status and control words.
//!
//! Source: CiA 402-2 (IEC 61800-7-201), controlword 6040 and statusword 6041.

/// Switched on, operation disabled: the step before the last.
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
/// Follows its targets.
pub(crate) const ENABLE: u16 = 0x0F;
/// Comes to rest by the drive's own ramp.
pub(crate) const QUICK_STOP: u16 = 0x02;
/// Takes the power away.
pub(crate) const DISABLE_VOLTAGE: u16 = 0x00;
const FAULT_RESET: u16 = 0x80;
/// Begins homing, in that mode.
pub(crate) const BEGIN_HOMING: u16 = ENABLE | 1 << 4;
/// Tries in which a drive that has stopped may go on from where it is; then it is switched off and on.
const RESUME_TRIES: u32 = 6;

/// What a drive is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It starts, or says something that the standard does not know.
    NotReady,
    /// Without power, and it may not come.
    SwitchOnDisabled,
    /// Without power.
    ReadyToSwitchOn,
    /// With power, without torque.
    SwitchedOn,
    /// Under power, follows.
    OperationEnabled,
    /// Under power, at rest or coming to it.
    QuickStopActive,
    /// It fails.
    FaultReaction,
    /// It has failed.
    Fault,
}

/// The state that a status word tells.
pub fn state(status: u16) -> State {
    match (status & 0x4F, status & 0x6F) {
        (0x40, _) => State::SwitchOnDisabled,
        (0x0F, _) => State::FaultReaction,
        (0x08, _) => State::Fault,
        (_, 0x21) => State::ReadyToSwitchOn,
        (_, 0x23) => State::SwitchedOn,
        (_, 0x27) => State::OperationEnabled,
        (_, 0x07) => State::QuickStopActive,
        _ => State::NotReady,
    }
}

/// The control word of the next step toward Operation Enabled, in the `n_tried`-th cycle of trying.
pub(crate) fn toward_enabled(status: u16, n_tried: u32) -> u16 {
    match state(status) {
        State::ReadyToSwitchOn => SWITCH_ON,
        State::SwitchedOn | State::OperationEnabled => ENABLE,
        State::QuickStopActive if n_tried < RESUME_TRIES => ENABLE,
        // Only the bit's rise counts.
        State::Fault if n_tried.is_multiple_of(2) => FAULT_RESET,
        State::SwitchOnDisabled => SHUTDOWN,
        State::QuickStopActive | State::Fault | State::NotReady | State::FaultReaction => DISABLE_VOLTAGE,
    }
}

/// Whether the drive follows its targets.
pub(crate) fn is_enabled(status: u16) -> bool {
    state(status) == State::OperationEnabled
}

/// Whether the motor may have torque.
pub fn has_torque(status: u16) -> bool {
    matches!(state(status), State::OperationEnabled | State::QuickStopActive | State::FaultReaction)
}

/// Whether the drive says that its power stage has voltage.
pub(crate) fn has_voltage(status: u16) -> bool {
    status >> 4 & 1 == 1
}

/// Whether the drive has failed.
pub(crate) fn is_failed(status: u16) -> bool {
    matches!(state(status), State::FaultReaction | State::Fault)
}

/// Whether the drive says that it is too far from its target, in cyclic synchronous position mode.
pub(crate) fn is_behind(status: u16) -> bool {
    is_enabled(status) && status >> 13 & 1 == 1
}

/// How far homing is: done, failed, or neither.
pub(crate) fn homing(status: u16) -> Option<bool> {
    match (status >> 13 & 1, status >> 12 & 1, status >> 10 & 1) {
        (1, _, _) => Some(false),
        (0, 1, 1) => Some(true),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a drive makes of a control word, by the standard's table of transitions.
    fn next(state: State, control: u16) -> State {
        use State::{Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
        match (state, control & 0x8F) {
            (Fault, 0x80) => SwitchOnDisabled,
            (SwitchOnDisabled, 0x06) | (SwitchedOn | OperationEnabled, 0x06) => ReadyToSwitchOn,
            (ReadyToSwitchOn, 0x07) | (OperationEnabled, 0x07) => SwitchedOn,
            (SwitchedOn | QuickStopActive, 0x0F) => OperationEnabled,
            (OperationEnabled, 0x02) => QuickStopActive,
            (QuickStopActive, 0x00) => SwitchOnDisabled,
            (state, _) => state,
        }
    }

    fn word(state: State) -> u16 {
        match state {
            State::NotReady => 0x00,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStopActive => 0x07,
            State::FaultReaction => 0x0F,
            State::Fault => 0x08,
        }
    }

    #[test]
    fn every_status_word_has_a_state_and_those_of_the_standard_theirs() {
        for known in [
            State::NotReady,
            State::SwitchOnDisabled,
            State::ReadyToSwitchOn,
            State::SwitchedOn,
            State::OperationEnabled,
            State::QuickStopActive,
            State::FaultReaction,
            State::Fault,
        ] {
            // Bits that the state does not depend on.
            for other in [0, 0x0010, 0x0080, 0xFF90] {
                assert_eq!(state(word(known) | other), known);
            }
        }
        for status in 0..=u16::MAX {
            state(status);
            toward_enabled(status, u32::from(status));
        }
    }

    #[test]
    fn power_comes_in_three_steps_and_in_four_after_a_fault_and_never_in_one() {
        for (begin, n_steps) in [(State::SwitchOnDisabled, 3), (State::Fault, 4), (State::QuickStopActive, 1)] {
            let mut at = begin;
            let n = (0..20).position(|n| {
                at = next(at, toward_enabled(word(at), n));
                at == State::OperationEnabled
            });
            assert_eq!(n.map(|n| n + 1), Some(n_steps), "{begin:?}");
        }
        assert_eq!(next(State::SwitchOnDisabled, ENABLE), State::SwitchOnDisabled);
    }
}
