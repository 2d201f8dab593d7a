//! Whether a slave that was started again is enabled: only where the one before was ENABLED and nobody has asked for less since.

use krait_ipc::message::{OperatingState, SlaveState};
use krait_ipc::{Bus, IpcError, StopSwitch};

/// A stop this long before the slave's last word may not have reached that word, ns.
const UNHEARD_NS: i64 = 1_000_000_000;

/// What is known of the slave before, and of the stops asked for.
pub(super) struct SlaveAgain {
    switch: StopSwitch,
    n_asked: u32,
    /// When the newest stop was noticed, CLOCK_MONOTONIC, ns.
    stop_ns: Option<i64>,
    /// Set from the loss of a slave until the next one is enabled, or not.
    lost: Option<Lost>,
}

/// The slave that was lost: its last word, if it had said one since it was enabled.
#[derive(Clone, Copy, Debug)]
struct Lost {
    state: Option<SlaveState>,
    at_ns: i64,
}

/// What becomes of the slave that was started again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decision {
    /// It is enabled; homed too, where the one before was.
    Enable { home: bool },
    /// It stays as it started, because of this.
    StayDisabled(&'static str),
}

impl SlaveAgain {
    pub(super) fn open(bus: &Bus) -> Result<Self, IpcError> {
        let switch = bus.stop_switch()?;
        Ok(Self { n_asked: switch.asked(), switch, stop_ns: None, lost: None })
    }

    /// Notices stops.
    pub(super) fn look(&mut self, now_ns: i64) {
        let n_asked = self.switch.asked();
        if core::mem::replace(&mut self.n_asked, n_asked) != n_asked {
            self.stop_ns = Some(now_ns);
        }
    }

    /// The slave is gone; `state` is what it said last. One that is lost before it was enabled leaves the decision to the one
    /// before it.
    pub(super) fn lost(&mut self, state: Option<SlaveState>, now_ns: i64) {
        self.lost.get_or_insert(Lost { state, at_ns: now_ns });
    }

    /// Whether a slave that was started again waits to be enabled.
    pub(super) fn is_awaited(&self) -> bool {
        self.lost.is_some()
    }

    /// Decides, once; `held_back_ns` is when somebody last asked the authority for less than ENABLED.
    pub(super) fn decide(&mut self, held_back_ns: Option<i64>) -> Option<Decision> {
        self.lost.take().map(|lost| lost.decide(self.stop_ns, held_back_ns))
    }
}

impl Lost {
    fn decide(&self, stop_ns: Option<i64>, held_back_ns: Option<i64>) -> Decision {
        let Some(state) = self.state else { return Decision::StayDisabled("the one before had said nothing yet") };
        let heard_ns = state.sample_ns.min(self.at_ns).saturating_sub(UNHEARD_NS);
        let is_since = |ns: Option<i64>| ns.is_some_and(|ns| ns >= heard_ns);
        let held_by = match state.operating() {
            Some(OperatingState::Enabled) if is_since(stop_ns) => Some("a stop was asked for"),
            Some(OperatingState::Enabled) if is_since(held_back_ns) => Some("another state was asked for"),
            Some(OperatingState::Enabled) => None,
            Some(OperatingState::Paused) => Some("the one before was PAUSED"),
            Some(OperatingState::Disabled) => Some("the one before was DISABLED"),
            Some(OperatingState::Fault) => Some("the one before was in FAULT"),
            None => Some("the state of the one before is unknown"),
        };
        let home = state.flags & SlaveState::IS_HOMED != 0;
        held_by.map_or(Decision::Enable { home }, Decision::StayDisabled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn decision(state: OperatingState, stop_ns: Option<i64>, held_back_ns: Option<i64>) -> Decision {
        let flags = SlaveState::IS_HOMED;
        let state = SlaveState { sample_ns: 100 * S, operating_state: state as u32, flags, ..SlaveState::default() };
        Lost { state: Some(state), at_ns: 100 * S + 1 }.decide(stop_ns, held_back_ns)
    }

    #[test]
    fn only_what_was_enabled_and_was_not_stopped_since_is_enabled_again() {
        assert_eq!(decision(OperatingState::Enabled, None, None), Decision::Enable { home: true });
        assert_eq!(decision(OperatingState::Enabled, Some(90 * S), Some(90 * S)), Decision::Enable { home: true });
        for state in [OperatingState::Disabled, OperatingState::Paused, OperatingState::Fault] {
            assert!(matches!(decision(state, None, None), Decision::StayDisabled(_)), "{state:?}");
        }
        let enabled = OperatingState::Enabled;
        for late_ns in [99 * S + S / 2, 100 * S, 103 * S] {
            assert!(matches!(decision(enabled, Some(late_ns), None), Decision::StayDisabled(_)), "{late_ns}");
            assert!(matches!(decision(enabled, None, Some(late_ns)), Decision::StayDisabled(_)), "{late_ns}");
        }
        assert!(matches!(Lost { state: None, at_ns: 0 }.decide(None, None), Decision::StayDisabled(_)));
    }
}
