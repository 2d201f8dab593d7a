//! The marks by which the master of an experiment says, in the recording, which pose stood still and for how long.

use core::fmt;

/// What every such mark begins with; no other mark should.
const WORD: &str = "experiment";

/// What an experiment says of itself. Its text is that of a [`crate::message::Marker`] whose instant is when it is true.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ExperimentMark {
    /// The first motion of a pass begins.
    Begins,
    /// A pose, numbered from 1, has been at rest for so long, ns, until now: what is measured of it lies in that time.
    AtRest {
        /// Its number.
        pose: u32,
        /// For how long.
        for_ns: i64,
    },
    /// Every pose is done and the machine is straight again.
    Ends,
    /// It cannot go on, for the reason given in a sentence.
    Failed(String),
}

impl ExperimentMark {
    /// Reads the text of a mark; `None` for one of anything else.
    pub fn parse(text: &str) -> Option<Self> {
        let rest = text.strip_prefix(WORD)?.strip_prefix(' ')?;
        if let Some(sentence) = rest.strip_prefix("failed: ") {
            return Some(Self::Failed(sentence.to_owned()));
        }
        let words: Vec<&str> = rest.split(' ').collect();
        match words[..] {
            ["begins"] => Some(Self::Begins),
            ["ends"] => Some(Self::Ends),
            ["pose", pose, "at", "rest", "for", for_ns, "ns"] => {
                let (pose, for_ns) = (pose.parse().ok()?, for_ns.parse().ok()?);
                (for_ns >= 0).then_some(Self::AtRest { pose, for_ns })
            }
            _ => None,
        }
    }
}

impl fmt::Display for ExperimentMark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Begins => write!(f, "{WORD} begins"),
            Self::AtRest { pose, for_ns } => write!(f, "{WORD} pose {pose} at rest for {for_ns} ns"),
            Self::Ends => write!(f, "{WORD} ends"),
            Self::Failed(sentence) => write!(f, "{WORD} failed: {sentence}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_nothing_else_is() {
        for mark in [
            ExperimentMark::Begins,
            ExperimentMark::AtRest { pose: 17, for_ns: 400_000_000 },
            ExperimentMark::Ends,
            ExperimentMark::Failed("pose 3 did not come to rest".to_owned()),
        ] {
            assert_eq!(ExperimentMark::parse(&mark.to_string()), Some(mark));
        }
        for text in [
            "",
            "experiment",
            "vessel touched",
            "experiment pose x at rest for 1 ns",
            "experiment pose 1 at rest for -1 ns",
        ] {
            assert_eq!(ExperimentMark::parse(text), None, "{text}");
        }
    }
}
