//! Whose load is at its limit. One reason stands for three causes with different remedies: a line's load that the slave measured, the
//! load of a gripper's wire, and a load that the model foretells.

use crate::facts::Facts;
use crate::snapshot::NewestSamples;
use crate::words::{Level, Words, words_of};
use krait_ipc::message::{GRIPPER_WIRE, N_LINES, N_WITH_GRIPPER, SlaveState, used};
use krait_ipc::{Reason, Reasons};

/// What was told for this long after is what holds, ns: a limit that is met and left in turn is one limit.
const TOLD_NS: i64 = 1_000_000_000;

/// Whose load is at its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtLimit {
    /// A line's, as measured (`[slave.limits] pull_n`, `push_n`).
    Line,
    /// That of the gripper's wire (`[slave.limits] jaw_n`): the jaw holds something, the lines go on.
    Jaw,
    /// A line's, as the model foretells (`[compensate] max_load_n`).
    Foretold,
}

/// When each was told last, ns.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadsTold {
    line_ns: Option<i64>,
    jaw_ns: Option<i64>,
}

impl LoadsTold {
    /// Notes what a state says; its reasons are the slave's own.
    pub fn note(&mut self, state: &SlaveState) {
        if !Reasons::from_bits(state.reasons).contains(Reason::ForceLimit) {
            return;
        }
        let has = |flag| state.flags & flag != 0;
        let has_jaw = state.n_joints == 0 && state.n_actuators as usize == N_WITH_GRIPPER;
        // Lines that follow are not the ones that are held.
        let told = if has_jaw && has(SlaveState::FOLLOWING) { &mut self.jaw_ns } else { &mut self.line_ns };
        *told = Some(state.sample_ns);
    }

    /// What the reason stands for at an instant. Measured before foretold: it is the same load, and what is measured is sure.
    pub fn at_limit(&self, now_ns: i64) -> AtLimit {
        let is_told = |told_ns: Option<i64>| told_ns.is_some_and(|told_ns| now_ns - told_ns <= TOLD_NS);
        match (is_told(self.line_ns), is_told(self.jaw_ns)) {
            (true, _) => AtLimit::Line,
            (false, true) => AtLimit::Jaw,
            (false, false) => AtLimit::Foretold,
        }
    }
}

impl AtLimit {
    /// The words of [`Reason::ForceLimit`] for this cause.
    pub fn words(self) -> Words {
        match self {
            Self::Line => words_of(Reason::ForceLimit),
            // What a jaw holds is no fault and holds nothing else back: no banner, so that the state stays what it is.
            Self::Jaw => Words {
                level: Level::Info,
                say: "The jaw holds as hard as it may.",
                todo: "It closes no further; opening is free.",
                banner: "",
            },
            Self::Foretold => Words {
                level: Level::Warn,
                say: "The model foretells an overload.",
                todo: "Steer back.",
                banner: "Too large a load by the model \u{2013} steer back.",
            },
        }
    }

    /// Load and limit, where both are known.
    pub fn value(self, newest: &NewestSamples, facts: &Facts) -> Option<String> {
        let state = newest.state.as_ref()?;
        match self {
            Self::Line => {
                let loads_n = used(&state.measured_tau_n, state.n_actuators);
                let loads_n = if facts.jaw.is_some() { loads_n.get(..N_LINES)? } else { loads_n };
                let of_line = |(k, tau_n): (usize, &f64)| Some((k + 1, tau_n.abs(), limit_n(facts, k, *tau_n)?));
                let nearest = loads_n.iter().enumerate().filter_map(of_line);
                let (line, tau_n, limit_n) = nearest.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
                Some(format!("Line {line}: {tau_n:.0} of {limit_n:.0} N, measured."))
            }
            Self::Jaw => {
                let tau_n = state.measured_tau_n[GRIPPER_WIRE];
                Some(format!("Its wire: {:.0} of {:.0} N.", tau_n.abs(), limit_n(facts, GRIPPER_WIRE, tau_n)?))
            }
            // The bounds of lines through segments stand in the model, not in the configuration.
            Self::Foretold => facts.joints.is_none().then(|| format!("More than {:.0} N on a line.", facts.max_load_n)),
        }
    }
}

/// The limit of an actuator's load, where there is one and the load is known.
fn limit_n(facts: &Facts, actuator: usize, tau_n: f64) -> Option<f64> {
    let limit_n = facts.loads.get(actuator)?.limit_n(tau_n);
    (tau_n.is_finite() && limit_n.is_finite()).then_some(limit_n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facts::LoadFacts;

    const MS: i64 = 1_000_000;

    fn state(sample_ns: i64, n_actuators: u32, flags: u32) -> SlaveState {
        let reasons = Reasons::NONE.with(Reason::ForceLimit).bits();
        SlaveState { sample_ns, n_actuators, flags, reasons, ..SlaveState::default() }
    }

    #[test]
    fn a_load_is_the_jaws_while_the_lines_follow_and_foretold_where_the_slave_says_nothing() {
        let mut told = LoadsTold::default();
        assert_eq!(told.at_limit(0), AtLimit::Foretold);
        told.note(&state(10 * MS, 4, SlaveState::FOLLOWING));
        assert_eq!(told.at_limit(11 * MS), AtLimit::Jaw);
        told.note(&SlaveState { sample_ns: 12 * MS, n_actuators: 4, ..SlaveState::default() });
        assert_eq!(told.at_limit(600 * MS), AtLimit::Jaw, "a limit that is met and left in turn");
        assert_eq!(told.at_limit(1100 * MS), AtLimit::Foretold, "the jaw was opened");
        told.note(&state(1200 * MS, 4, SlaveState::JAW_FOLLOWING));
        told.note(&state(1201 * MS, 4, SlaveState::FOLLOWING));
        assert_eq!(told.at_limit(1202 * MS), AtLimit::Line, "both: what holds the snake comes first");
        let mut without = LoadsTold::default();
        without.note(&state(MS, 3, SlaveState::FOLLOWING));
        assert_eq!(without.at_limit(MS), AtLimit::Line, "no gripper, no jaw");
    }

    #[test]
    fn the_three_causes_say_three_things_that_fit() {
        let all = [AtLimit::Line, AtLimit::Jaw, AtLimit::Foretold].map(AtLimit::words);
        for words in &all {
            assert!(words.say.chars().count() <= 40 && words.banner.chars().count() <= 48, "{words:?}");
            assert_eq!(all.iter().filter(|other| other.say == words.say).count(), 1, "{words:?}");
        }
    }

    /// A snake with a gripper whose third line may bear 8 N, the others 60 N, and its wire 15 N.
    fn facts() -> Facts {
        let own = |limit_n: f64| LoadFacts { pull_n: limit_n, push_n: limit_n };
        Facts {
            instance: String::new(),
            is_simulated: false,
            l_m: 0.03,
            r_m: 0.002,
            n_actuators: 4,
            unit: "deg",
            per_si: 57.3,
            joints: None,
            jaw: Some([0.0, 1.0]),
            max_bend_rad: 1.0,
            max_stroke_m: 5e-3,
            max_load_n: 48.0,
            loads: [60.0, 60.0, 8.0, 15.0].map(own).to_vec(),
            view_roll_rad: 0.0,
            compensation: String::new(),
            presence_hint: String::new(),
            recording: None,
            opens: None,
            budgets: Vec::new(),
        }
    }

    #[test]
    fn a_load_stands_beside_the_limit_of_its_own_actuator_and_the_nearest_to_its_own_is_named() {
        let mut state = state(MS, 4, SlaveState::FOLLOWING);
        state.measured_tau_n[..4].copy_from_slice(&[-20.0, f64::NAN, 8.0, -15.0]);
        let newest = NewestSamples { state: Some(state), ..NewestSamples::default() };
        let value = |of: AtLimit, facts: &Facts| of.value(&newest, facts);
        assert_eq!(value(AtLimit::Line, &facts()).as_deref(), Some("Line 3: 8 of 8 N, measured."));
        assert_eq!(value(AtLimit::Jaw, &facts()).as_deref(), Some("Its wire: 15 of 15 N."));
        let pushed = LoadFacts { pull_n: 60.0, push_n: 10.0 };
        let other = Facts { loads: vec![pushed; 4], ..facts() };
        assert_eq!(
            value(AtLimit::Line, &other).as_deref(),
            Some("Line 3: 8 of 10 N, measured."),
            "8 of 10 before 20 of 60"
        );
        let unknown = Facts { loads: vec![LoadFacts { pull_n: f64::INFINITY, push_n: f64::INFINITY }; 4], ..facts() };
        assert_eq!([AtLimit::Line, AtLimit::Jaw].map(|of| value(of, &unknown)), [None, None], "no limit, no numbers");
    }
}
