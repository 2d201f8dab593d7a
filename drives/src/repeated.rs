//! How the cycles of a repeated run compare with those that were recorded.

use krait_ipc::message::{ActuatorCycle, DriveCycle};

/// What the slave wants of a bus.
const WISH: u32 = DriveCycle::WANTS_POWER | DriveCycle::WANTS_STOP | DriveCycle::WANTS_STAND;
/// What the bus is told.
const TOLD: u32 = DriveCycle::TOLD | DriveCycle::SWITCHED_ON | DriveCycle::SWITCHED_OFF;

/// Counts of the cycles until now.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Repeated {
    /// Cycles that were run again.
    pub n_cycles: u64,
    /// Cycles that the recording does not hold, by their numbers.
    pub n_missing: u64,
    /// Cycles in which the slave wished for something else: power, stop, or a position of an actuator.
    pub n_wishes_differ: u64,
    /// Cycles in which the bus was told something else: power, a goal, or its speed.
    pub n_goals_differ: u64,
    /// Cycles that were judged otherwise: the failure, or what an actuator is doing.
    pub n_judged_otherwise: u64,
    /// Cycles that stand under a failure.
    pub n_failed: u64,
    /// The first cycle that differs in anything, and how.
    pub first: Option<CycleDifference>,
    newest: u64,
}

/// A cycle that came out otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleDifference {
    /// Which cycle of the bus, from 1.
    pub cycle: u64,
    /// What differs.
    pub field: String,
    /// What it was.
    pub recorded: String,
    /// What it is now.
    pub repeated: String,
}

impl Repeated {
    /// Whether every cycle came out as it was recorded, and none is missing.
    pub fn is_identical(&self) -> bool {
        self.first.is_none() && self.n_missing == 0
    }

    pub(crate) fn compare(&mut self, recorded: &DriveCycle, again: &DriveCycle) {
        self.n_cycles += 1;
        let n_between = recorded.cycle.saturating_sub(self.newest.saturating_add(1));
        self.n_missing = self.n_missing.saturating_add(n_between);
        self.newest = recorded.cycle;
        self.n_failed += u64::from(recorded.failure != 0);
        let found = [wish(recorded, again), told(recorded, again), judged(recorded, again)];
        let counts = [&mut self.n_wishes_differ, &mut self.n_goals_differ, &mut self.n_judged_otherwise];
        for (difference, count) in found.into_iter().zip(counts) {
            let Some((field, recorded_value, repeated)) = difference else { continue };
            *count += 1;
            let cycle = recorded.cycle;
            self.first.get_or_insert(CycleDifference { cycle, field, recorded: recorded_value, repeated });
        }
    }
}

type Difference = Option<(String, String, String)>;

fn number<T: PartialEq + ToString>(field: &str, recorded: T, repeated: T) -> Difference {
    (recorded != repeated).then(|| (field.to_owned(), recorded.to_string(), repeated.to_string()))
}

/// The first actuator that differs in a number.
fn of_actuators<T: PartialEq + ToString>(
    field: &str,
    (recorded, again): (&DriveCycle, &DriveCycle),
    of: impl Fn(&ActuatorCycle) -> T,
) -> Difference {
    let pairs = recorded.actuators().iter().zip(&again.actuators).enumerate();
    pairs.into_iter().find_map(|(k, (own, again))| number(&format!("actuators[{k}].{field}"), of(own), of(again)))
}

/// A float whose bits count, NaN included.
#[derive(PartialEq)]
struct Bits(u64);

impl std::fmt::Display for Bits {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:e}", f64::from_bits(self.0))
    }
}

fn wish(recorded: &DriveCycle, again: &DriveCycle) -> Difference {
    number("turn", recorded.turn, again.turn)
        .or_else(|| number("flags (wish)", recorded.flags & WISH, again.flags & WISH))
        .or_else(|| of_actuators("wish_q_m", (recorded, again), |own| Bits(own.wish_q_m.to_bits())))
}

fn told(recorded: &DriveCycle, again: &DriveCycle) -> Difference {
    number("flags (told)", recorded.flags & TOLD, again.flags & TOLD)
        .or_else(|| of_actuators("told_counts", (recorded, again), |own| own.told_counts))
        .or_else(|| of_actuators("told_counts_per_s", (recorded, again), |own| Bits(own.told_counts_per_s.to_bits())))
}

fn judged(recorded: &DriveCycle, again: &DriveCycle) -> Difference {
    number("phase", recorded.phase, again.phase)
        .or_else(|| number("failure", recorded.failure, again.failure))
        .or_else(|| number("failure_actuator", recorded.failure_actuator, again.failure_actuator))
        .or_else(|| of_actuators("state", (recorded, again), |own| own.state))
}
