//! What a column is, as far as its name tells.

use super::name::{Name, NamedUnit};
use crate::read::Dimension;

/// What a name points to.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Guess {
    Time,
    Trial,
    /// Where the machine shall be, or where its drive is; with the word that says so.
    Command(String),
    /// Where it was seen.
    Measured(String),
    /// A position of which the name does not say more.
    Unclear,
    /// No position.
    Other(&'static str),
}

const TIME: [&str; 6] = ["time", "t", "timestamp", "stamp", "elapsed", "zeit"];
const TRIAL: [&str; 4] = ["trial", "episode", "run", "repetition"];
const COMMAND: [&str; 16] = [
    "u",
    "cmd",
    "command",
    "commands",
    "commanded",
    "setpoint",
    "sp",
    "target",
    "desired",
    "des",
    "ref",
    "reference",
    "goal",
    "demand",
    "action",
    "soll",
];
const MEASURED: [&str; 14] = [
    "y",
    "meas",
    "measured",
    "measurement",
    "actual",
    "feedback",
    "fb",
    "present",
    "observed",
    "observation",
    "obs",
    "output",
    "response",
    "ist",
];
/// Words that say the same of a drive and of what it moves, where no stronger word is there.
const DRIVE: [&str; 8] = ["drive", "motor", "actuator", "leader", "master", "proximal", "servo", "input"];
const MOVED: [&str; 18] = [
    "encoder", "enc", "angle", "pos", "position", "joint", "jaw", "tip", "q", "state", "states", "joints", "follower",
    "distal", "link", "camera", "cam", "marker",
];
const OTHER: [(&str, &str); 28] = [
    ("torque", "a torque"),
    ("tau", "a load"),
    ("load", "a load"),
    ("force", "a force"),
    ("effort", "a load"),
    ("current", "a current"),
    ("voltage", "a voltage"),
    ("power", "a power"),
    ("pwm", "a duty"),
    ("duty", "a duty"),
    ("temp", "a temperature"),
    ("temperature", "a temperature"),
    ("vel", "a speed"),
    ("velocity", "a speed"),
    ("speed", "a speed"),
    ("qd", "a speed"),
    ("acc", "an acceleration"),
    ("acceleration", "an acceleration"),
    ("error", "an error"),
    ("err", "an error"),
    ("status", "a status"),
    ("index", "a count"),
    ("frame", "a count"),
    ("sample", "a count"),
    ("seq", "a count"),
    ("id", "a count"),
    ("sigma", "an uncertainty"),
    ("weight", "a weight"),
];

impl Guess {
    pub(super) fn of(name: &Name) -> Self {
        let found = |list: &[&'static str]| list.iter().copied().find(|word| name.has(word));
        if found(&TRIAL).is_some() {
            return Self::Trial;
        }
        if let Some((_, what)) = OTHER.iter().find(|(word, _)| name.has(word)) {
            return Self::Other(what);
        }
        match &name.unit {
            NamedUnit::Other(unit) => return Self::Other(quantity(unit)),
            NamedUnit::Known(unit) => match unit.dimension {
                Dimension::Time => return Self::Time,
                Dimension::Force => return Self::Other("a force"),
                Dimension::Temperature => return Self::Other("a temperature"),
                _ => {}
            },
            _ if found(&TIME).is_some() => return Self::Time,
            _ => {}
        }
        let word = |list: &[&'static str]| found(list).map(str::to_owned);
        match (word(&COMMAND), word(&MEASURED), word(&DRIVE), word(&MOVED)) {
            (Some(word), None, ..) | (None, None, Some(word), _) => Self::Command(word),
            (None, Some(word), ..) | (None, None, None, Some(word)) => Self::Measured(word),
            _ => Self::Unclear,
        }
    }

    /// What is left of a name without the words that say what it is: the joint.
    pub(super) fn joint(name: &Name) -> String {
        let lists: [&[&str]; 4] = [&COMMAND, &MEASURED, &DRIVE, &MOVED];
        let is_role = |word: &str| lists.iter().any(|list| list.contains(&word));
        let left: Vec<&str> = name.words.iter().map(String::as_str).filter(|word| !is_role(word)).collect();
        left.join(" ")
    }
}

/// What a unit measures that is none of a position.
fn quantity(unit: &str) -> &'static str {
    match unit.to_lowercase().as_str() {
        "a" | "ma" | "ampere" | "amps" => "a current",
        "nm" | "nmm" | "mnm" | "n m" | "n*m" | "n.m" => "a torque",
        "v" | "mv" => "a voltage",
        "w" | "mw" => "a power",
        "hz" | "rpm" => "a speed",
        speed if speed.ends_with("/s") => "a speed",
        _ => "no position",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_robots_logs_say_what_they_are() {
        let guess = |name| Guess::of(&Name::of(name));
        for name in ["u1_deg", "cmd_shoulder", "goal_position_2", "action.elbow.pos", "Motor (deg)", "drive encoder"] {
            assert!(matches!(guess(name), Guess::Command(_)), "{name}: {:?}", guess(name));
        }
        for name in ["y1_deg", "present_position_2", "observation.state.elbow.pos", "Jaw angle [deg]", "q3"] {
            assert!(matches!(guess(name), Guess::Measured(_)), "{name}: {:?}", guess(name));
        }
        for name in ["load1", "jaw_torque_nm", "goal_velocity", "motor_temperature", "motor (A)", "frame_index"] {
            assert!(matches!(guess(name), Guess::Other(_)), "{name}: {:?}", guess(name));
        }
        for (name, what) in [
            ("motor (A)", "a current"),
            ("m1 [mA]", "a current"),
            ("Jaw [Nm]", "a torque"),
            ("effort_1", "a load"),
            ("current_2", "a current"),
            ("joint [rad/s]", "a speed"),
            ("bus [bar]", "no position"),
        ] {
            assert_eq!(guess(name), Guess::Other(what), "{name}");
        }
        assert_eq!(guess("Time [ms]"), Guess::Time);
        assert_eq!(guess("timestamp"), Guess::Time);
        assert_eq!(guess("episode_index"), Guess::Trial);
        assert_eq!(guess("alpha"), Guess::Unclear);
        assert_eq!(Guess::joint(&Name::of("action.elbow.pos")), "elbow");
        assert_eq!(Guess::joint(&Name::of("present_position_2")), "2");
    }
}
