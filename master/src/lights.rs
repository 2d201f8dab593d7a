//! What the hand's lights tell of the chain: a light that stands for everything blinks codes, a light for one thing is on while it is so.
//! Pure: time is counted in the master's ticks.

use krait_ipc::message::{OperatingState, SlaveState};
use krait_ipc::{Reason, Reasons};

/// What there is to tell; each excludes the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum HandState {
    /// krait has the device, and the snake does not follow it.
    #[default]
    Taken,
    /// The snake follows.
    Engaged,
    /// It follows, and is at the end of what is allowed.
    Limit,
    /// The drives failed, or have fallen silent.
    Fault,
}

/// Reasons that mean: further that way there is nothing. What only slows the motion is none of them.
const ENDS: [Reason; 5] =
    [Reason::BendLimit, Reason::StrokeLimit, Reason::ForceLimit, Reason::JointLimit, Reason::JointUnreachable];

impl HandState {
    /// As the drives and the newest command say.
    pub(crate) fn of(drives: &SlaveState, command_reasons: u64) -> Self {
        let reasons = Reasons::from_bits(drives.reasons | command_reasons);
        match drives.operating() {
            Some(OperatingState::Fault) => Self::Fault,
            _ if !drives.is_engaged() => Self::Taken,
            _ if ENDS.into_iter().any(|end| reasons.contains(end)) => Self::Limit,
            _ => Self::Engaged,
        }
    }
}

/// What one light of a device is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightRole {
    /// Everything, by codes.
    All,
    /// That krait has the device (a wink) and that the snake follows (on).
    Engaged,
    /// A limit.
    Limit,
    /// A fault.
    Fault,
}

impl LightRole {
    /// Every one, in the order of its bit.
    pub(crate) const EACH: [Self; 4] = [Self::All, Self::Engaged, Self::Limit, Self::Fault];

    /// When it is on: a bit for each slot of a code, the lowest first.
    fn code(self, state: HandState) -> u16 {
        const ON: u16 = u16::MAX;
        const OFF: u16 = 0;
        const WINK: u16 = 0b1;
        const TWO_GAPS: u16 = !0b101;
        const FAST: u16 = 0b0101_0101_0101_0101;
        match (self, state) {
            (Self::All | Self::Engaged, HandState::Taken) => WINK,
            (Self::All, HandState::Engaged) | (Self::Engaged, HandState::Engaged | HandState::Limit) => ON,
            (Self::All, HandState::Limit) => TWO_GAPS,
            (Self::Limit, HandState::Limit) => ON,
            (Self::All | Self::Fault, HandState::Fault) => FAST,
            _ => OFF,
        }
    }
}

/// Which lights are on at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lights(u8);

impl Lights {
    /// As they are in one slot of the codes.
    fn in_slot(state: HandState, slot: u32) -> Self {
        let is_on = |role: LightRole| role.code(state) >> (slot % SLOTS) & 1 == 1;
        Self(LightRole::EACH.into_iter().filter(|role| is_on(*role)).fold(0, |bits, role| bits | 1 << role as u8))
    }

    /// Whether the light for something is on.
    pub(crate) fn is_lit(self, role: LightRole) -> bool {
        self.0 >> role as u8 & 1 == 1
    }

    /// As a number, to be handed to another thread.
    pub(crate) fn bits(self) -> u8 {
        self.0
    }

    /// From such a number.
    pub(crate) fn from_bits(bits: u8) -> Self {
        Self(bits)
    }
}

impl Default for Lights {
    /// As a device is that has just been taken.
    fn default() -> Self {
        Self::in_slot(HandState::Taken, 0)
    }
}

/// Slots of a code, and how many of them are a second.
const SLOTS: u32 = u16::BITS;
const SLOTS_PER_S: u32 = 8;
/// How often the chain is looked at within a slot: a change begins its code at once.
const LOOKS_PER_SLOT: u32 = 4;
/// Looks without a word of drives that have spoken, after which they are silent: a quarter of a second.
const SILENT_LOOKS: u32 = 2 * LOOKS_PER_SLOT;

/// Counts ticks, looks and slots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightShow {
    ticks_per_look: u64,
    n_ticks: u64,
    n_looks: u32,
    state: HandState,
    /// Looks since the drives have said something; none before their first word.
    n_silent: Option<u32>,
}

impl LightShow {
    /// A show for a master of so many ticks a second.
    pub(crate) fn new(rate_hz: u32) -> Self {
        let ticks_per_look = u64::from(rate_hz / (SLOTS_PER_S * LOOKS_PER_SLOT)).max(1);
        Self { ticks_per_look, n_ticks: 0, n_looks: 0, state: HandState::Taken, n_silent: None }
    }

    /// Counts ticks; true when it is time to look.
    pub(crate) fn count(&mut self, n_ticks: u64) -> bool {
        self.n_ticks += n_ticks;
        let is_due = self.n_ticks >= self.ticks_per_look;
        if is_due {
            self.n_ticks %= self.ticks_per_look;
        }
        is_due
    }

    /// What the lights show after a look; `seen` is what the drives have said since the one before.
    pub(crate) fn look(&mut self, seen: Option<HandState>) -> Lights {
        self.n_silent = match seen {
            Some(_) => Some(0),
            None => self.n_silent.map(|n_looks| n_looks.saturating_add(1)),
        };
        let is_silent = self.n_silent.is_some_and(|n_looks| n_looks >= SILENT_LOOKS);
        let state = if is_silent { HandState::Fault } else { seen.unwrap_or(self.state) };
        if state == self.state {
            self.n_looks = (self.n_looks + 1) % (SLOTS * LOOKS_PER_SLOT);
        } else {
            (self.state, self.n_looks) = (state, 0);
        }
        Lights::in_slot(state, self.n_looks / LOOKS_PER_SLOT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The looks of one whole code, as a text of slots for one light, all looks within a slot being equal.
    fn code(role: LightRole, state: HandState) -> String {
        let mut show = LightShow::new(1000);
        let other = if state == HandState::Fault { HandState::Taken } else { HandState::Fault };
        show.look(Some(other));
        let looks: Vec<bool> = (0..SLOTS * LOOKS_PER_SLOT).map(|_| show.look(Some(state)).is_lit(role)).collect();
        let slots = looks.chunks(LOOKS_PER_SLOT as usize).map(|slot| {
            assert!(slot.iter().all(|is_on| *is_on == slot[0]));
            if slot[0] { '#' } else { '.' }
        });
        slots.collect()
    }

    #[test]
    fn one_light_tells_the_four_states_apart_and_each_code_begins_with_the_change() {
        assert_eq!(code(LightRole::All, HandState::Taken), "#...............");
        assert_eq!(code(LightRole::All, HandState::Engaged), "################");
        assert_eq!(code(LightRole::All, HandState::Limit), ".#.#############");
        assert_eq!(code(LightRole::All, HandState::Fault), "#.#.#.#.#.#.#.#.");
    }

    #[test]
    fn three_lights_have_one_meaning_each() {
        let states = [HandState::Taken, HandState::Engaged, HandState::Limit, HandState::Fault];
        let first = |role| states.map(|state| code(role, state).starts_with('#'));
        assert_eq!(first(LightRole::Engaged), [true, true, true, false]);
        assert_eq!(code(LightRole::Engaged, HandState::Taken), code(LightRole::All, HandState::Taken));
        assert_eq!(code(LightRole::Engaged, HandState::Limit), code(LightRole::All, HandState::Engaged));
        assert_eq!(first(LightRole::Limit), [false, false, true, false]);
        assert_eq!(first(LightRole::Fault), [false, false, false, true]);
    }

    #[test]
    fn looks_are_counted_in_ticks_also_where_some_were_skipped() {
        let mut show = LightShow::new(1000);
        let looks = (1..=3100).filter(|_| show.count(1)).count();
        assert_eq!(looks, 100, "every 31 of a thousand ticks a second");
        assert!(show.count(45) && !show.count(16) && show.count(1), "14 are over and count");
    }

    #[test]
    fn drives_that_have_spoken_and_fall_silent_are_a_fault_and_those_that_never_spoke_are_none() {
        let mut show = LightShow::new(1000);
        for _ in 0..100 {
            show.look(None);
        }
        assert_eq!(show.state, HandState::Taken);
        show.look(Some(HandState::Engaged));
        for _ in 1..SILENT_LOOKS {
            assert!(show.look(None).is_lit(LightRole::Engaged));
        }
        assert!(show.look(None).is_lit(LightRole::Fault));
        assert!(show.look(Some(HandState::Engaged)).is_lit(LightRole::Engaged));
    }

    #[test]
    fn the_drives_and_the_command_say_which_state_it_is() {
        let drives = |operating: OperatingState, flags| SlaveState {
            operating_state: operating as u32,
            flags,
            ..SlaveState::default()
        };
        let follows = drives(OperatingState::Enabled, SlaveState::IS_HOMED | SlaveState::ENGAGED);
        let at = |reason: Reason| Reasons::NONE.with(reason).bits();
        assert_eq!(HandState::of(&follows, 0), HandState::Engaged);
        assert_eq!(HandState::of(&follows, at(Reason::BendLimit)), HandState::Limit);
        assert_eq!(HandState::of(&follows, at(Reason::ActuatorRateLimit)), HandState::Engaged, "only slower");
        let loaded = SlaveState { reasons: at(Reason::ForceLimit), ..follows };
        assert_eq!(HandState::of(&loaded, 0), HandState::Limit);
        let let_go = drives(OperatingState::Enabled, SlaveState::IS_HOMED);
        assert_eq!(HandState::of(&let_go, at(Reason::BendLimit)), HandState::Taken);
        assert_eq!(HandState::of(&drives(OperatingState::Fault, 0), 0), HandState::Fault);
    }
}
