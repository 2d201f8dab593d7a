//! What a cycle of the bus was, as it is handed to the slave and recorded, and what was seen in it, made of a record again.

use crate::bus::{Goals, Seen, Trouble};
use crate::exchange::{Report, TEXTS, Wish};
use crate::newest::AsWords;
use crate::ring::Ring;
use krait_ipc::message::{ActuatorCycle, DriveCycle, MAX_ACTUATORS};

/// Cycles that may wait for the slave: a quarter of a second at 1 kHz.
const ROOM: usize = 256;
/// Words of an actuator's part, and of what stands before the first.
const N_OF_ACTUATOR: usize = 12;
const N_OF_HEAD: usize = 9;
/// Words of a cycle.
const N: usize = N_OF_HEAD + N_OF_ACTUATOR * MAX_ACTUATORS;

/// Cycles on their way from the bus's thread to the slave.
pub(crate) type CycleRing = Ring<N, ROOM>;

/// What the bus was told in a cycle, and whether it is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Told {
    /// Goals, where any were sent.
    pub goals: Option<Goals>,
    /// Power, where it was switched.
    pub power: Option<bool>,
    /// Bits of [`DriveCycle::GONE_TELLING`] and [`DriveCycle::GONE_ASKING`].
    pub gone: u32,
}

/// A cycle as it is recorded. `cycle` and `n_left_out` are the writer's.
pub(crate) fn record(begun_ns: i64, n: usize, wish: &Wish, told: &Told, seen: &Seen, report: &Report) -> DriveCycle {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    let mut cycle = DriveCycle {
        sample_ns: begun_ns,
        answered_ns: report.stamp_ns,
        wish_ns: wish.stamp_ns,
        turn: wish.turn,
        flags: flag(wish.has_power, DriveCycle::WANTS_POWER)
            | flag(wish.is_stopped, DriveCycle::WANTS_STOP)
            | flag(wish.stands, DriveCycle::WANTS_STAND)
            | flag(told.goals.is_some(), DriveCycle::TOLD)
            | flag(told.power == Some(true), DriveCycle::SWITCHED_ON)
            | flag(told.power == Some(false), DriveCycle::SWITCHED_OFF)
            | told.gone,
        phase: report.phase as u32,
        n_actuators: n as u32,
        ..DriveCycle::default()
    };
    [cycle.failure, cycle.failure_actuator, cycle.failure_text] = report.failure_numbers();
    let goals = told.goals.unwrap_or_default();
    for (k, own) in cycle.actuators.iter_mut().enumerate().take(n) {
        let (trouble, trouble_code, trouble_text) = match seen.trouble[k] {
            Trouble::None => (0, 0, 0),
            Trouble::Limp => (1, 0, 0),
            Trouble::Tripped { code, meaning } => (2, code.into(), text_number(meaning)),
            Trouble::HardwareStop { code } => (3, code.into(), 0),
        };
        *own = ActuatorCycle {
            wish_q_m: wish.q_m[k],
            sampled_ns: seen.sampled_ns[k],
            told_counts_per_s: goals.counts_per_s[k],
            current_a: seen.current_a[k],
            torque_nm: seen.torque_nm[k],
            temperature_celsius: seen.temperature_celsius[k],
            supply_v: seen.supply_v[k],
            told_counts: goals.counts[k],
            goal_counts: seen.goal_counts[k],
            counts: seen.counts[k],
            n_boots: seen.n_boots[k],
            flags: flag(seen.has_answered[k], ActuatorCycle::ANSWERED)
                | flag(seen.is_powered[k], ActuatorCycle::POWERED)
                | flag(seen.has_let_go[k], ActuatorCycle::LET_GO)
                | flag(seen.is_busy[k], ActuatorCycle::BUSY)
                | flag(seen.is_unguarded[k], ActuatorCycle::UNGUARDED),
            state: report.state[k] as u32,
            trouble,
            trouble_code,
            trouble_text,
            emergency_code: seen.emergency_code[k].into(),
        };
    }
    cycle
}

/// What a recorded cycle has seen.
pub(crate) fn seen_in(cycle: &DriveCycle) -> Seen {
    let mut seen = Seen::default();
    for (k, own) in cycle.actuators().iter().enumerate() {
        seen.has_answered[k] = own.has(ActuatorCycle::ANSWERED);
        seen.is_powered[k] = own.has(ActuatorCycle::POWERED);
        seen.has_let_go[k] = own.has(ActuatorCycle::LET_GO);
        seen.is_busy[k] = own.has(ActuatorCycle::BUSY);
        seen.is_unguarded[k] = own.has(ActuatorCycle::UNGUARDED);
        seen.sampled_ns[k] = own.sampled_ns;
        (seen.counts[k], seen.goal_counts[k], seen.n_boots[k]) = (own.counts, own.goal_counts, own.n_boots);
        (seen.current_a[k], seen.torque_nm[k]) = (own.current_a, own.torque_nm);
        (seen.temperature_celsius[k], seen.supply_v[k]) = (own.temperature_celsius, own.supply_v);
        seen.emergency_code[k] = own.emergency_code as u16;
        seen.trouble[k] = match own.trouble {
            0 => Trouble::None,
            1 => Trouble::Limp,
            3 => Trouble::HardwareStop { code: own.trouble_code as u16 },
            _ => Trouble::Tripped { code: own.trouble_code as u16, meaning: text(own.trouble_text) },
        };
    }
    seen
}

/// Place of a text in [`TEXTS`].
pub(crate) fn text_number(text: &'static str) -> u32 {
    TEXTS.iter().position(|known| *known == text).unwrap_or_default() as u32
}

/// The text at a place of [`TEXTS`]; of a place that it does not have, the one for what is not known.
pub(crate) fn text(number: u32) -> &'static str {
    TEXTS.get(number as usize).copied().unwrap_or(TEXTS[0])
}

fn two(high: u32, low: u32) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

fn halves(word: u64) -> [u32; 2] {
    [(word >> 32) as u32, word as u32]
}

impl AsWords<N> for DriveCycle {
    fn to_words(&self) -> [u64; N] {
        let mut words = [0; N];
        words[..N_OF_HEAD].copy_from_slice(&[
            self.sample_ns.cast_unsigned(),
            self.answered_ns.cast_unsigned(),
            self.cycle,
            self.n_left_out,
            self.wish_ns.cast_unsigned(),
            self.turn,
            two(self.flags, self.phase),
            two(self.failure, self.failure_actuator),
            two(self.failure_text, self.n_actuators),
        ]);
        for (own, words) in self.actuators.iter().zip(words[N_OF_HEAD..].chunks_exact_mut(N_OF_ACTUATOR)) {
            words.copy_from_slice(&[
                own.wish_q_m.to_bits(),
                own.sampled_ns.cast_unsigned(),
                own.told_counts_per_s.to_bits(),
                own.current_a.to_bits(),
                own.torque_nm.to_bits(),
                own.temperature_celsius.to_bits(),
                own.supply_v.to_bits(),
                two(own.told_counts.cast_unsigned(), own.goal_counts.cast_unsigned()),
                two(own.counts.cast_unsigned(), own.n_boots),
                two(own.flags, own.state),
                two(own.trouble, own.trouble_code),
                two(own.trouble_text, own.emergency_code),
            ]);
        }
        words
    }

    fn from_words(words: &[u64; N]) -> Self {
        let ([flags, phase], [failure, failure_actuator]) = (halves(words[6]), halves(words[7]));
        let [failure_text, n_actuators] = halves(words[8]);
        let mut cycle = Self {
            sequence: 0,
            sample_ns: words[0].cast_signed(),
            answered_ns: words[1].cast_signed(),
            cycle: words[2],
            n_left_out: words[3],
            wish_ns: words[4].cast_signed(),
            turn: words[5],
            flags,
            phase,
            failure,
            failure_actuator,
            failure_text,
            n_actuators,
            ..Self::default()
        };
        for (own, words) in cycle.actuators.iter_mut().zip(words[N_OF_HEAD..].chunks_exact(N_OF_ACTUATOR)) {
            let ([told_counts, goal_counts], [counts, n_boots]) = (halves(words[7]), halves(words[8]));
            let ([flags, state], [trouble, trouble_code]) = (halves(words[9]), halves(words[10]));
            let [trouble_text, emergency_code] = halves(words[11]);
            *own = ActuatorCycle {
                wish_q_m: f64::from_bits(words[0]),
                sampled_ns: words[1].cast_signed(),
                told_counts_per_s: f64::from_bits(words[2]),
                current_a: f64::from_bits(words[3]),
                torque_nm: f64::from_bits(words[4]),
                temperature_celsius: f64::from_bits(words[5]),
                supply_v: f64::from_bits(words[6]),
                told_counts: told_counts.cast_signed(),
                goal_counts: goal_counts.cast_signed(),
                counts: counts.cast_signed(),
                n_boots,
                flags,
                state,
                trouble,
                trouble_code,
                trouble_text,
                emergency_code,
            };
        }
        cycle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_seen_and_told_comes_back_out_of_a_record_that_went_through_the_ring() {
        let mut seen = Seen::default();
        for k in 0..3 {
            seen.has_answered[k] = k != 1;
            (seen.is_powered[k], seen.has_let_go[k], seen.is_busy[k]) = (k != 2, k == 2, k == 1);
            seen.is_unguarded[k] = k == 0;
            (seen.sampled_ns[k], seen.counts[k], seen.goal_counts[k]) = (-7 - k as i64, -40 - k as i32, i32::MIN);
            (seen.n_boots[k], seen.current_a[k], seen.torque_nm[k]) = (k as u32, -0.5, 0.25);
            (seen.temperature_celsius[k], seen.supply_v[k]) = (31.0, 7.4);
        }
        seen.trouble[0] = Trouble::HardwareStop { code: 0x9000 };
        seen.emergency_code[1] = 0xFF01;
        (seen.trouble[1], seen.trouble[2]) =
            (Trouble::Limp, Trouble::Tripped { code: 0x8130, meaning: TEXTS[TEXTS.len() - 1] });
        let mut wish = Wish { stamp_ns: 5, turn: 2, has_power: true, ..Wish::default() };
        wish.q_m = core::array::from_fn(|k| 1e-3 * k as f64);
        let goals = Goals { counts: core::array::from_fn(|k| -(k as i32)), counts_per_s: [50.0; MAX_ACTUATORS] };
        let told = Told { goals: Some(goals), power: Some(true), gone: 0 };
        let report = Report::blank();
        let cycle = DriveCycle { cycle: 9, n_left_out: 4, ..record(11, 3, &wish, &told, &seen, &report) };
        let ring = CycleRing::new();
        assert!(ring.push(&cycle));
        assert_eq!(ring.pop(), Some(cycle));
        assert_eq!(seen_in(&cycle), seen);
        assert_eq!(cycle.flags, DriveCycle::WANTS_POWER | DriveCycle::TOLD | DriveCycle::SWITCHED_ON);
        assert_eq!((cycle.actuators[2].wish_q_m, cycle.actuators[2].told_counts), (2e-3, -2));
        assert_eq!(cycle.actuators[3..], [ActuatorCycle::default(); 9]);
    }
}
