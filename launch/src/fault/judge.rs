//! What a recording tells of a fault, and whether that is what must be.

use super::kind::{End, Fault};
use super::moment::StrikeTime;
use anyhow::Context;
use krait_ipc::Reasons;
use krait_ipc::message::{OperatingState, SlaveState};
use krait_record::Recording;
use krait_schema::Sample;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// One write is credited with at most a period of 1 kHz, s.
const PERIOD_S: f64 = 1e-3;
/// What a step may be more than its time allows, m.
const TOLERANCE_M: f64 = 1e-6;
/// The drives stand if their setpoint has not changed for so long, ns; the script never rests.
const STANDS_NS: i64 = 200_000_000;
/// A fault that must stop the snake has done so after two periods of the watchdog, ms.
const REST_MS: f64 = 100.0;

/// What became of a chain.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Observed {
    /// How it ended; nothing where that is none of the ends that there are.
    pub did: Option<End>,
    /// Writes that moved the drives.
    pub n_moves: u64,
    /// Largest step of a write as a part of what the time since the write before allows.
    pub largest_step: f64,
    /// From the fault to the last motion, ms, 0 if that was before; nothing where the instant of the fault is not known.
    pub rest_ms: Option<f64>,
    /// Reasons that the slave gave after the fault.
    pub reasons: u64,
    /// Commands that the slave refused or skipped.
    pub n_refused: u64,
    /// From the fault, or where its instant is not known from the first state, to the scene's end, ns.
    pub span_ns: Option<(i64, i64)>,
    /// Longest time within that in which a core of the machine ran nothing, ms; 0 where none could have stalled the chain.
    pub machine_pause_ms: f64,
    /// Why the recording cannot be read.
    pub unreadable: Option<String>,
    /// Files of the instance that are still there.
    pub left: Vec<PathBuf>,
}

/// A fault, what must become of the chain, and what did.
#[derive(Clone, Debug, Serialize)]
pub struct FaultOutcome {
    /// The fault.
    pub fault: Fault,
    /// What must become of the chain.
    pub must: End,
    /// What did.
    pub did: Option<End>,
    /// Largest step of a write as a part of what the time since the write before allows.
    pub largest_step: f64,
    /// From the fault to the last motion, ms.
    pub rest_ms: Option<f64>,
    /// What names the fault.
    pub named: Option<String>,
    /// Longest time after the fault in which the machine itself stood still, ms; 0 where that could not have stalled the chain.
    pub machine_pause_ms: f64,
    /// What is wrong; nothing where all is as it must be.
    pub wrong: Option<String>,
    /// Whether the machine's pause explains what is wrong: the chain ended otherwise, and nothing jumped, was damaged or left.
    pub is_disturbed: bool,
    /// Why it was not tried.
    pub skipped: Option<String>,
}

impl Observed {
    /// Looks at a recording, or, where there is none, at the states that were heard: at every step of the whole run, and at
    /// what became of a fault between its instant, where that is known, and the scene's end.
    ///
    /// # Errors
    /// One sentence when the recording cannot be read.
    pub fn of(
        recording: Option<&Path>,
        heard: &[SlaveState],
        (struck_ns, over_ns): (Option<i64>, i64),
        rate_m_per_s: f64,
    ) -> anyhow::Result<Self> {
        let mut seen = Self::default();
        let recorded = match recording {
            Some(path) => seen.read(path).with_context(|| format!("recording {}", path.display()))?,
            None => Vec::new(),
        };
        let states = if recording.is_some() { &recorded[..] } else { heard };
        seen.steps(states, rate_m_per_s);
        let is_after =
            |state: &&SlaveState| struck_ns.is_none_or(|ns| state.sample_ns >= ns) && state.sample_ns <= over_ns;
        let after: Vec<&SlaveState> = states.iter().filter(is_after).collect();
        seen.span_ns = after.first().map(|first| (struck_ns.unwrap_or(first.sample_ns), over_ns));
        seen.reasons = after.iter().fold(0, |reasons, state| reasons | state.reasons);
        seen.did = end_of(&after);
        seen.rest_ms = struck_ns.zip(last_motion_ns(&after)).map(|(from, to)| (to - from).max(0) as f64 * 1e-6);
        Ok(seen)
    }

    /// The slave's states in a recording, and what its health counted.
    fn read(&mut self, path: &Path) -> anyhow::Result<Vec<SlaveState>> {
        let mut states = Vec::new();
        for recorded in Recording::open(path)?.samples()? {
            match recorded?.sample {
                Sample::State(state) => states.push(state),
                Sample::Health(krait_ipc::Process::Slave, health) => {
                    self.n_refused = self.n_refused.max(health.n_refused)
                }
                _ => {}
            }
        }
        Ok(states)
    }

    /// Power that comes and homing seed the setpoint anew; they are no writes of the gate.
    fn steps(&mut self, states: &[SlaveState], rate_m_per_s: f64) {
        for pair in states.windows(2) {
            let [before, after] = pair else { continue };
            if after.is_seeded_after(before) || after.sequence <= before.sequence {
                continue;
            }
            let n_writes = (after.sequence - before.sequence) as f64;
            let since_s = (after.setpoint_ns - before.setpoint_ns).max(0) as f64 * 1e-9;
            let allowed_m = rate_m_per_s * since_s.min(PERIOD_S * n_writes) + TOLERANCE_M;
            let step_m = step_m(before, after);
            self.n_moves += u64::from(step_m > 0.0);
            self.largest_step = self.largest_step.max(step_m / allowed_m);
        }
    }
}

fn step_m(before: &SlaveState, after: &SlaveState) -> f64 {
    (0..3).map(|i| (after.setpoint_q_m[i] - before.setpoint_q_m[i]).abs()).fold(0.0, f64::max)
}

/// When the drives were moved last, ns; the search for zero of a slave that began anew is none of it.
fn last_motion_ns(states: &[&SlaveState]) -> Option<i64> {
    let moved = |pair: &&[&SlaveState]| {
        let [before, after] = pair else { return false };
        after.sequence > before.sequence && !after.is_seeded_after(before) && step_m(before, after) > 0.0
    };
    let last = states.windows(2).rfind(moved).map(|pair| pair[1].setpoint_ns);
    last.or(states.first().map(|first| first.setpoint_ns))
}

fn end_of(states: &[&SlaveState]) -> Option<End> {
    let newest = states.last()?;
    if newest.operating() == Some(OperatingState::Fault) {
        return Some(End::Fault);
    }
    if newest.operating() == Some(OperatingState::Disabled) {
        return Some(End::Ended);
    }
    let stands = newest.sample_ns - last_motion_ns(states)? > STANDS_NS;
    let was_engaged = newest.is_engaged();
    let engaged_again = states.windows(2).any(|pair| !pair[0].is_engaged() && pair[1].is_engaged());
    match (stands, was_engaged, engaged_again) {
        (false, true, false) => Some(End::Moves),
        (true, false, false) => Some(End::Holds),
        _ => None,
    }
}

/// Whether an end is one in which the snake comes to rest at once, by itself.
fn is_rest(end: End) -> bool {
    matches!(end, End::Holds | End::Ended)
}

/// Holds what was seen against what must be. `said` is what the chain wrote on standard error.
pub fn judge(fault: Fault, moment: StrikeTime, seen: &Observed, said: &str) -> FaultOutcome {
    let (_, must, named) = fault.row();
    let named = named.found(Reasons::from_bits(seen.reasons), seen.n_refused, said);
    // What is over before the watchdog bites need not end the motion; if it does, then as every longer one.
    let has_passed = fault.may_pass(moment.stall_s) && seen.did == Some(End::Moves);
    let must = if has_passed { End::Moves } else { must };
    let named = named.or_else(|| has_passed.then(|| "(over in time)".to_owned()));
    let wrong = if seen.did != Some(must) {
        Some("another end".to_owned())
    } else if let Some(why) = &seen.unreadable {
        Some(format!("the recording cannot be read: {why}"))
    } else if let Some(left) = seen.left.first() {
        Some(format!("{} files are left, as {}", seen.left.len(), left.display()))
    } else if seen.largest_step > 1.0 {
        Some("a jump".to_owned())
    } else if must != End::Refused && seen.n_moves < 100 {
        Some("hardly moved before".to_owned())
    } else if named.is_none() {
        Some("not named".to_owned())
    } else if is_rest(must) && seen.rest_ms.is_none_or(|rest_ms| rest_ms > REST_MS) {
        Some("late to rest".to_owned())
    } else {
        None
    };
    // A pause of the machine ends an engagement, as it must; it excuses no jump and no damage.
    let is_whole = seen.unreadable.is_none() && seen.left.is_empty() && seen.largest_step <= 1.0;
    FaultOutcome {
        fault,
        must,
        did: seen.did,
        largest_step: seen.largest_step,
        rest_ms: seen.rest_ms.filter(|_| is_rest(must)),
        named,
        machine_pause_ms: seen.machine_pause_ms,
        is_disturbed: wrong.is_some() && is_whole && seen.machine_pause_ms > 0.0,
        wrong,
        skipped: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::Reason;

    const MS: i64 = 1_000_000;

    /// A slave that moves at 10 mm/s, loses its commands at 500 ms and stands 2 ms later.
    fn states(reaction_ms: i64) -> Vec<SlaveState> {
        let state = |ms: i64| {
            let moved_ms = ms.min(500 + reaction_ms);
            SlaveState {
                sequence: ms.unsigned_abs() + 1,
                sample_ns: (ms + 1) * MS,
                setpoint_ns: (moved_ms + 1) * MS,
                setpoint_q_m: krait_ipc::message::lines([moved_ms as f64 * 10e-6; 3]),
                operating_state: OperatingState::Enabled as u32,
                flags: if ms < 500 + reaction_ms { SlaveState::ENGAGED } else { 0 },
                reasons: if ms < 550 { 0 } else { Reasons::NONE.with(Reason::ChainStalled).bits() },
                ..SlaveState::default()
            }
        };
        (0..1000).map(state).collect()
    }

    fn wrong(states: &[SlaveState], fault: Fault) -> Option<String> {
        let seen = Observed::of(None, states, (Some(500 * MS), i64::MAX), 30e-3).expect("no file is read");
        judge(fault, StrikeTime::of(0), &seen, "").wrong
    }

    #[test]
    fn a_stall_below_the_watchdog_may_pass_and_what_is_left_or_unreadable_is_wrong() {
        let wrong = |fault, stall_s, change: fn(&mut Observed)| {
            let mut seen =
                Observed::of(None, &states(600), (Some(500 * MS), i64::MAX), 30e-3).expect("no file is read");
            change(&mut seen);
            judge(fault, StrikeTime { wait_s: 0.0, stall_s }, &seen, "").wrong
        };
        assert_eq!(wrong(Fault::StalledResolve, 0.015, |_| {}), None);
        assert_eq!(wrong(Fault::StalledResolve, 0.3, |_| {}).as_deref(), Some("another end"));
        assert_eq!(wrong(Fault::KilledResolve, 0.015, |_| {}).as_deref(), Some("another end"));
        assert_eq!(wrong(Fault::StalledEstimate, 0.3, |_| {}), None);
        let left = wrong(Fault::StalledEstimate, 0.3, |seen| seen.left = vec!["/dev/shm/x".into()]);
        assert_eq!(left.as_deref(), Some("1 files are left, as /dev/shm/x"));
        let unreadable = wrong(Fault::StalledEstimate, 0.3, |seen| seen.unreadable = Some("cut".to_owned()));
        assert_eq!(unreadable.as_deref(), Some("the recording cannot be read: cut"));
    }

    #[test]
    fn a_pause_of_the_machine_excuses_another_end_and_nothing_worse() {
        let disturbed = |fault, machine_pause_ms, change: fn(&mut Observed)| {
            let mut seen = Observed::of(None, &states(2), (Some(500 * MS), i64::MAX), 30e-3).expect("no file is read");
            assert_eq!(seen.span_ns, Some((500 * MS, i64::MAX)));
            change(&mut seen);
            judge(fault, StrikeTime::of(0), &Observed { machine_pause_ms, ..seen }, "").is_disturbed
        };
        assert!(disturbed(Fault::StalledLaunch, 57.0, |_| {}), "it must move and holds");
        assert!(!disturbed(Fault::StalledLaunch, 0.0, |_| {}) && !disturbed(Fault::Lost, 57.0, |_| {}));
        assert!(!disturbed(Fault::StalledLaunch, 57.0, |seen| seen.largest_step = 1.1));
        assert!(!disturbed(Fault::StalledLaunch, 57.0, |seen| seen.unreadable = Some("cut".to_owned())));
        assert!(!disturbed(Fault::StalledLaunch, 57.0, |seen| seen.left = vec!["/dev/shm/x".into()]));
    }

    #[test]
    fn what_ends_as_it_must_is_right_and_everything_else_is_named() {
        assert_eq!(wrong(&states(2), Fault::Lost), None);
        assert_eq!(wrong(&states(2), Fault::Duplicated).as_deref(), Some("another end"));
        assert_eq!(wrong(&states(2), Fault::Nan).as_deref(), Some("not named"));
        assert_eq!(wrong(&states(150), Fault::Lost).as_deref(), Some("late to rest"));
        assert_eq!(wrong(&states(499), Fault::Lost).as_deref(), Some("another end"), "it moves to the end");
        let mut jumping = states(2);
        jumping[300].setpoint_q_m[1] += 25e-6;
        assert_eq!(wrong(&jumping, Fault::Lost).as_deref(), Some("a jump"));
        let mut again = states(2);
        again[900].flags |= SlaveState::ENGAGED;
        assert_eq!(wrong(&again, Fault::Lost).as_deref(), Some("another end"), "nobody has engaged it");
        assert_eq!(wrong(&[], Fault::Lost).as_deref(), Some("another end"));
    }

    #[test]
    fn what_the_end_of_a_scene_does_to_a_chain_is_not_taken_for_the_fault() {
        // It moves until 900 ms, and then the chain is told to end: the slave misses its master and holds.
        let did =
            |over_ns| Observed::of(None, &states(400), (Some(500 * MS), over_ns), 30e-3).expect("no file is read").did;
        assert_eq!(did(850 * MS), Some(End::Moves));
        assert_eq!(did(i64::MAX), None, "neither: it has moved until now and is not engaged");
    }

    #[test]
    fn a_gap_between_two_writes_earns_one_period_and_a_burst_none() {
        let step = |since_ns: i64, step_m: f64| {
            let before = SlaveState { sequence: 1, setpoint_ns: MS, ..SlaveState::default() };
            let after = SlaveState {
                sequence: 2,
                setpoint_ns: MS + since_ns,
                setpoint_q_m: krait_ipc::message::lines([step_m; 3]),
                ..before
            };
            let mut seen = Observed::default();
            seen.steps(&[before, after], 30e-3);
            seen.largest_step
        };
        assert!(step(50 * MS, 30e-6) < 1.0 && step(50 * MS, 32e-6) > 1.0);
        assert!(step(MS / 10, 3.9e-6) < 1.0 && step(MS / 10, 4.1e-6) > 1.0);
    }

    #[test]
    fn a_jump_is_seen_also_where_the_motion_ends_and_not_where_power_comes() {
        let jumps = |before: OperatingState, after: OperatingState, flags: u32| {
            let mut states = states(600);
            for state in &mut states[..300] {
                (state.operating_state, state.flags) = (before as u32, flags);
            }
            for state in &mut states[300..] {
                state.operating_state = after as u32;
                state.setpoint_q_m[1] += 25e-6;
            }
            let seen = Observed::of(None, &states, (None, i64::MAX), 30e-3).expect("no file is read");
            seen.largest_step > 1.0
        };
        use OperatingState::{Disabled, Enabled, Fault, Paused};
        for (before, after) in [(Enabled, Paused), (Enabled, Fault), (Paused, Enabled), (Enabled, Disabled)] {
            assert!(jumps(before, after, 0), "{before:?} to {after:?}");
        }
        assert!(!jumps(Disabled, Enabled, 0) && !jumps(Fault, Enabled, 0), "power comes");
        assert!(!jumps(Enabled, Paused, SlaveState::IS_BUSY), "zero is looked for");
    }
}
