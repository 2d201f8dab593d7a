//! The chain's SCHED_FIFO priority as a configuration says it: a number, or what the kernel gives by itself.

use serde::{Deserialize, Serialize};

/// The slave's priority.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "WrittenPriority", into = "WrittenPriority")]
pub enum Priority {
    /// "auto": [`Priority::BY_ITSELF`] where the kernel gives it and it hurts nobody ([`Priority::for_chain`]), and time sharing without a
    /// word where not: most users lack the right, and `krait doctor` tells them.
    Auto,
    /// 1 to 99, and told where it is refused; 0: time sharing.
    Fixed(u8),
}

impl Priority {
    /// Time sharing, as every other process.
    pub const NONE: Self = Self::Fixed(0);
    /// What "auto" asks for: above ordinary work, below the kernel's own threads for interrupts on PREEMPT_RT (50).
    pub const BY_ITSELF: u8 = 40;

    /// What a chain asks for on so many cores. By itself none where a process polls, which would leave nothing of its core to anybody, and
    /// none where there is no second core: whoever records and whoever serves the drives would wait for the chain.
    pub fn for_chain(self, polls: bool, n_cores: usize) -> Self {
        if self == Self::Auto && (polls || n_cores < 2) { Self::NONE } else { self }
    }

    /// The number that the kernel is asked for; 0: none.
    pub fn number(self) -> u8 {
        match self {
            Self::Auto => Self::BY_ITSELF,
            Self::Fixed(number) => number,
        }
    }
}

impl core::fmt::Display for Priority {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Fixed(number) => number.fmt(f),
        }
    }
}

/// [`Priority`] as it stands in a file.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "expected \"auto\" or a whole number of 0 to 99")]
enum WrittenPriority {
    Word(String),
    Number(u8),
}

impl TryFrom<WrittenPriority> for Priority {
    type Error = String;
    fn try_from(written: WrittenPriority) -> Result<Self, String> {
        match written {
            WrittenPriority::Number(number) => Ok(Self::Fixed(number)),
            WrittenPriority::Word(word) if word == "auto" => Ok(Self::Auto),
            WrittenPriority::Word(word) => {
                Err(format!("priority {word:?}: expected \"auto\" or a whole number of 0 to 99"))
            }
        }
    }
}

impl From<Priority> for WrittenPriority {
    fn from(priority: Priority) -> Self {
        match priority {
            Priority::Auto => Self::Word("auto".to_owned()),
            Priority::Fixed(number) => Self::Number(number),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_has_none_by_itself_where_it_would_take_a_whole_core_or_the_only_one() {
        for (polls, n_cores, given) in [(false, 2, true), (false, 1, false), (true, 8, false), (false, 0, false)] {
            let chosen = Priority::Auto.for_chain(polls, n_cores);
            assert_eq!(chosen, if given { Priority::Auto } else { Priority::NONE }, "{polls} {n_cores}");
            let asked = Priority::Fixed(60);
            assert_eq!(asked.for_chain(polls, n_cores), asked, "who asks for a number gets it");
        }
    }
}
