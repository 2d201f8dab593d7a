//! A part's verdict: named checks, each with the figure that it was decided on, and one line for the serial console.

use std::fmt;

/// The checks of one part.
#[derive(Debug, Default)]
pub struct PartVerdict {
    checks: Vec<(&'static str, bool, String)>,
}

impl PartVerdict {
    /// Notes a check and its figure.
    pub fn check(&mut self, name: &'static str, is_met: bool, figure: impl fmt::Display) {
        self.checks.push((name, is_met, figure.to_string()));
    }

    /// Names of the checks that were not met.
    pub fn failed(&self) -> Vec<&'static str> {
        self.checks.iter().filter(|(_, is_met, _)| !is_met).map(|(name, ..)| *name).collect()
    }

    /// Whether there was something to check and all of it was met.
    pub fn passed(&self) -> bool {
        !self.checks.is_empty() && self.failed().is_empty()
    }
}

impl fmt::Display for PartVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.passed() { "PASS" } else { "FAIL" })?;
        for (name, is_met, figure) in &self.checks {
            write!(f, " {name}={figure}{}", if *is_met { "" } else { "(!)" })?;
        }
        Ok(())
    }
}
