//! What this machine lacks for a chain that is on time: each finding with what it means and the command that mends it.
//!
//! Terms: a finding is `good`; `advice` where a chain runs but could be more punctual; `bad` where a chain cannot run.

mod devices;
mod kernel;
mod limits;
mod memory;
mod wake_up;

pub use wake_up::{WakeUp, measure as measure_wake_up};

use serde::Serialize;

/// How a finding is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// As it should be.
    Good,
    /// A chain runs, but could be more punctual.
    Advice,
    /// A chain cannot run.
    Bad,
}

impl Grade {
    /// The word in the table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Advice => "advice",
            Self::Bad => "BAD",
        }
    }
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub name: &'static str,
    /// How it is to be taken.
    pub verdict: Grade,
    /// What was found.
    pub found: String,
    /// What that means for a chain.
    pub meaning: &'static str,
    /// The command that mends it; absent where nothing is to be mended.
    pub mend: Option<String>,
}

impl Finding {
    /// Something that is as it should be.
    fn good(name: &'static str, found: String, meaning: &'static str) -> Self {
        Self { name, verdict: Grade::Good, found, meaning, mend: None }
    }

    /// Something that could be better.
    fn advice(name: &'static str, found: String, meaning: &'static str, mend: String) -> Self {
        Self { name, verdict: Grade::Advice, found, meaning, mend: Some(mend) }
    }

    /// Something without which no chain runs.
    fn bad(name: &'static str, found: String, meaning: &'static str, mend: String) -> Self {
        Self { name, verdict: Grade::Bad, found, meaning, mend: Some(mend) }
    }
}

/// Looks at everything except the wake-up latency, which takes time.
pub fn look() -> Vec<Finding> {
    let mut findings = vec![kernel::preemption(), kernel::governor(), kernel::clock_source(), kernel::cores()];
    findings.extend([limits::rtprio(), limits::memlock()]);
    findings.extend([memory::shared_memory(), memory::stale()]);
    findings.push(devices::hidraw());
    findings
}

/// The trimmed text of a file, or nothing.
fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok().map(|text| text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_that_is_not_good_says_how_to_mend_it() {
        let findings = look();
        assert_eq!(findings.len(), 9);
        for finding in findings {
            assert!(!finding.found.is_empty() && !finding.meaning.is_empty(), "{finding:?}");
            assert_eq!(finding.mend.is_none(), finding.verdict == Grade::Good, "{finding:?}");
        }
    }
}
