//! What the hand's lights and its rumble tell of the chain: a light that stands for everything blinks codes, a light for one thing is on
//! while it is so or counts quarters of it, a rumble does the same by pulses. Pure: time is counted in the master's ticks.

use crate::meter::{FULL, Meter};
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

/// What a look at the chain has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct HandSeen {
    pub(crate) state: HandState,
    /// The largest line load as a part of its limit.
    pub(crate) load_ratio: f64,
    /// How much of the lines' way is compensation, 0..=1.
    pub(crate) compensation_share: f64,
}

impl From<HandState> for HandSeen {
    /// Without load and compensation.
    fn from(state: HandState) -> Self {
        Self { state, ..Self::default() }
    }
}

/// What one light of a device, or its rumble, is for.
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
    /// The largest line load: a flash for each quarter of its limit.
    Load,
    /// How much of the lines' way is compensation: a flash for each quarter.
    Compensation,
}

impl LightRole {
    /// Every one, in the order of its bit.
    pub(crate) const EACH: [Self; 6] =
        [Self::All, Self::Engaged, Self::Limit, Self::Fault, Self::Load, Self::Compensation];

    /// When it is on: a bit for each slot of a code, the lowest first.
    fn code(self, state: HandState, quarters: Quarters) -> u16 {
        const ON: u16 = u16::MAX;
        const OFF: u16 = 0;
        const WINK: u16 = 0b1;
        const ONE_GAP: u16 = !0b1;
        const TWO_GAPS: u16 = !0b101;
        const FAST: u16 = 0b0101_0101_0101_0101;
        match (self, state) {
            (Self::All | Self::Engaged, HandState::Taken) => WINK,
            (Self::All, HandState::Engaged) if quarters.load >= NEAR => ONE_GAP,
            (Self::All, HandState::Engaged) | (Self::Engaged, HandState::Engaged | HandState::Limit) => ON,
            (Self::All, HandState::Limit) => TWO_GAPS,
            (Self::Limit, HandState::Limit) => ON,
            (Self::All | Self::Fault, HandState::Fault) => FAST,
            (Self::Load | Self::Compensation, HandState::Fault) => OFF,
            (Self::Load, _) if quarters.load == FULL => ON,
            (Self::Load, _) => flashes(quarters.load),
            (Self::Compensation, _) if quarters.compensation == FULL => ON,
            (Self::Compensation, _) => flashes(quarters.compensation),
            _ => OFF,
        }
    }

    /// The same for a rumble, which tells load and compensation only while the snake follows: nobody else has the device in hand.
    /// Limit and fault are told once, when they begin.
    fn pulses(self, state: HandState, quarters: Quarters) -> u16 {
        match (self, state) {
            (Self::Load, HandState::Engaged | HandState::Limit) => flashes(quarters.load),
            (Self::Compensation, HandState::Engaged | HandState::Limit) => flashes(quarters.compensation),
            _ => 0,
        }
    }
}

/// What the meters tell, 0..=4 each.
#[derive(Clone, Copy, Debug, Default)]
struct Quarters {
    load: u8,
    compensation: u8,
}

/// Quarters of its limit from which on a light for everything tells of the load.
const NEAR: u8 = 3;

/// So many flashes of a slot, with a slot between them.
fn flashes(n: u8) -> u16 {
    0b0101_0101 & ((1 << (2 * u16::from(n.min(FULL)))) - 1)
}

/// Which lights are on at an instant, and what rumbles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lights(u16);

/// Where the bits of what rumbles begin.
const RUMBLE: u16 = 8;

impl Lights {
    /// As they are in one slot of the codes.
    fn in_slot(state: HandState, quarters: Quarters, slot: u32) -> Self {
        let is_on = |code: u16| code >> (slot % SLOTS) & 1;
        let bits = |role: LightRole| {
            let bit = role as u16;
            is_on(role.code(state, quarters)) << bit | is_on(role.pulses(state, quarters)) << (RUMBLE + bit)
        };
        Self(LightRole::EACH.into_iter().fold(0, |all, role| all | bits(role)))
    }

    /// The same, and something rumbles besides.
    fn with_rumble(self, role: Option<LightRole>) -> Self {
        Self(role.map_or(self.0, |role| self.0 | 1 << (RUMBLE + role as u16)))
    }

    /// Whether something rumbles.
    pub(crate) fn rumbles(self, role: LightRole) -> bool {
        self.0 >> (RUMBLE + role as u16) & 1 == 1
    }

    /// Whether the light for something is on.
    pub(crate) fn is_lit(self, role: LightRole) -> bool {
        self.0 >> role as u16 & 1 == 1
    }

    /// As a number, to be handed to another thread.
    pub(crate) fn bits(self) -> u16 {
        self.0
    }

    /// From such a number.
    pub(crate) fn from_bits(bits: u16) -> Self {
        Self(bits)
    }
}

impl Default for Lights {
    /// As a device is that has just been taken.
    fn default() -> Self {
        Self::in_slot(HandState::Taken, Quarters::default(), 0)
    }
}

/// Slots of a code, and how many of them are a second.
const SLOTS: u32 = u16::BITS;
const SLOTS_PER_S: u32 = 8;
/// How often the chain is looked at within a slot: a change begins its code at once.
const LOOKS_PER_SLOT: u32 = 4;
/// Looks without a word of drives that have spoken, after which they are silent: a quarter of a second.
const SILENT_LOOKS: u32 = 2 * LOOKS_PER_SLOT;
/// Looks that a limit and a fault rumble when they begin, and the least between two beginnings of limits: one that is met and left in turn
/// shall not shake the hand.
const LIMIT_LOOKS: u32 = 2 * LOOKS_PER_SLOT;
const FAULT_LOOKS: u32 = 4 * LOOKS_PER_SLOT;
const LIMIT_PAUSE_LOOKS: u32 = SLOTS_PER_S * LOOKS_PER_SLOT;

/// Counts ticks, looks and slots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightShow {
    ticks_per_look: u64,
    n_ticks: u64,
    n_looks: u32,
    state: HandState,
    /// Looks since the drives have said something; none before their first word.
    n_silent: Option<u32>,
    load: Meter,
    compensation: Meter,
    /// What rumbles because it has begun, and for how many looks more.
    pulse: Option<(LightRole, u32)>,
    /// Looks since a limit has last rumbled.
    n_since_limit: u32,
}

impl LightShow {
    /// A show for a master of so many ticks a second.
    pub(crate) fn new(rate_hz: u32) -> Self {
        let ticks_per_look = u64::from(rate_hz / (SLOTS_PER_S * LOOKS_PER_SLOT)).max(1);
        Self {
            ticks_per_look,
            n_ticks: 0,
            n_looks: 0,
            state: HandState::Taken,
            n_silent: None,
            load: Meter::default(),
            compensation: Meter::default(),
            pulse: None,
            n_since_limit: LIMIT_PAUSE_LOOKS,
        }
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
    pub(crate) fn look(&mut self, seen: Option<HandSeen>) -> Lights {
        self.n_silent = match seen {
            Some(_) => Some(0),
            None => self.n_silent.map(|n_looks| n_looks.saturating_add(1)),
        };
        let is_silent = self.n_silent.is_some_and(|n_looks| n_looks >= SILENT_LOOKS);
        let state = if is_silent { HandState::Fault } else { seen.map_or(self.state, |seen| seen.state) };
        let seen = seen.unwrap_or_default();
        // Both are asked: each has a peak to keep.
        let is_more = self.load.note(seen.load_ratio) | self.compensation.note(seen.compensation_share);
        let has_changed = state != self.state;
        self.n_looks = if has_changed || is_more { 0 } else { (self.n_looks + 1) % (SLOTS * LOOKS_PER_SLOT) };
        if self.n_looks == 0 {
            self.load.latch();
            self.compensation.latch();
        }
        self.state = state;
        let pulse = self.pulse(has_changed);
        let quarters = Quarters { load: self.load.told(), compensation: self.compensation.told() };
        Lights::in_slot(state, quarters, self.n_looks / LOOKS_PER_SLOT).with_rumble(pulse)
    }

    /// What rumbles because it has begun.
    fn pulse(&mut self, has_changed: bool) -> Option<LightRole> {
        self.n_since_limit = self.n_since_limit.saturating_add(1);
        self.pulse = match self.state {
            HandState::Fault if has_changed => Some((LightRole::Fault, FAULT_LOOKS)),
            HandState::Limit if has_changed && self.n_since_limit > LIMIT_PAUSE_LOOKS => {
                self.n_since_limit = 0;
                Some((LightRole::Limit, LIMIT_LOOKS))
            }
            _ => self.pulse.map(|(role, n_looks)| (role, n_looks - 1)).filter(|(_, n_looks)| *n_looks > 0),
        };
        self.pulse.map(|(role, _)| role)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The looks of one whole code, as a text of slots for one light, all looks within a slot being equal.
    fn code(role: LightRole, state: HandState) -> String {
        let mut show = LightShow::new(1000);
        let other = if state == HandState::Fault { HandState::Taken } else { HandState::Fault };
        show.look(Some(other.into()));
        let looks: Vec<bool> =
            (0..SLOTS * LOOKS_PER_SLOT).map(|_| show.look(Some(state.into())).is_lit(role)).collect();
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
        show.look(Some(HandState::Engaged.into()));
        for _ in 1..SILENT_LOOKS {
            assert!(show.look(None).is_lit(LightRole::Engaged));
        }
        assert!(show.look(None).is_lit(LightRole::Fault));
        assert!(show.look(Some(HandState::Engaged.into())).is_lit(LightRole::Engaged));
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

    /// What a whole code of a light and of a rumble is with so much load and compensation.
    fn metered(role: LightRole, state: HandState, load_ratio: f64, compensation_share: f64) -> [String; 2] {
        let mut show = LightShow::new(1000);
        let seen = HandSeen { state, load_ratio, compensation_share };
        let all: Vec<Lights> = (0..SLOTS * LOOKS_PER_SLOT).map(|_| show.look(Some(seen))).collect();
        let slots = |is_on: fn(Lights, LightRole) -> bool| {
            let slots = all.chunks(LOOKS_PER_SLOT as usize).map(|slot| if is_on(slot[0], role) { '#' } else { '.' });
            slots.collect()
        };
        [slots(Lights::is_lit), slots(Lights::rumbles)]
    }

    #[test]
    fn load_and_compensation_are_counted_in_quarters_by_flashes_and_pulses() {
        let none = "................";
        let counted = ["................", "#...............", "#.#.............", "#.#.#..........."];
        for (quarters, code) in counted.into_iter().enumerate() {
            let ratio = 0.25 * quarters as f64 + 0.1;
            assert_eq!(metered(LightRole::Load, HandState::Engaged, ratio, 0.0), [code, code]);
            assert_eq!(metered(LightRole::Compensation, HandState::Engaged, 0.0, ratio), [code, code]);
            assert_eq!(metered(LightRole::Load, HandState::Engaged, 0.0, ratio), [none, none], "each its own");
            assert_eq!(metered(LightRole::Load, HandState::Taken, ratio, 0.0), [code, none], "nobody has it in hand");
            assert_eq!(metered(LightRole::Load, HandState::Fault, ratio, 0.0), [none, none]);
        }
        assert_eq!(metered(LightRole::Load, HandState::Limit, 1.0, 0.0), ["################", "#.#.#.#........."]);
    }

    #[test]
    fn one_light_tells_a_load_from_three_quarters_of_its_limit_on() {
        let all = |ratio| metered(LightRole::All, HandState::Engaged, ratio, 0.9)[0].clone();
        assert_eq!((all(0.7).as_str(), all(0.8).as_str()), ("################", ".###############"));
    }

    #[test]
    fn a_peak_of_one_look_is_told_by_a_whole_code_that_begins_at_once() {
        let mut show = LightShow::new(1000);
        let seen = |load_ratio| Some(HandSeen { state: HandState::Engaged, load_ratio, compensation_share: 0.0 });
        for _ in 0..30 {
            show.look(seen(0.1));
        }
        let flashes = |show: &mut LightShow, first| {
            let lit: Vec<bool> = (0..SLOTS * LOOKS_PER_SLOT)
                .map(|look| show.look(seen(if look == 0 { first } else { 0.1 })).is_lit(LightRole::Load))
                .collect();
            lit.chunks(LOOKS_PER_SLOT as usize).filter(|slot| slot[0]).count()
        };
        assert_eq!(flashes(&mut show, 0.6), 2);
        assert_eq!(flashes(&mut show, 0.1), 0);
    }

    #[test]
    fn a_limit_and_a_fault_rumble_once_when_they_begin_and_a_limit_not_twice_a_second() {
        let mut show = LightShow::new(1000);
        let mut looks = |state: HandState, role, n: u32| {
            (0..n).filter(|_| show.look(Some(state.into())).rumbles(role)).count() as u32
        };
        assert_eq!(looks(HandState::Engaged, LightRole::Limit, 40), 0);
        assert_eq!(looks(HandState::Limit, LightRole::Limit, 200), LIMIT_LOOKS);
        assert_eq!(looks(HandState::Fault, LightRole::Fault, 200), FAULT_LOOKS);
        let in_turn: u32 = (0..32)
            .map(|idx| {
                let state = if idx % 2 == 0 { HandState::Engaged } else { HandState::Limit };
                looks(state, LightRole::Limit, 2)
            })
            .sum();
        assert!((1..=2 * LIMIT_LOOKS).contains(&in_turn), "{in_turn} looks of 64");
    }
}
