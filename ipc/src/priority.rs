//! The chain's SCHED_FIFO priority as a configuration says it: a number, or what the kernel gives by itself.

use serde::{Deserialize, Serialize};

/// The slave's priority.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "WrittenPriority", into = "WrittenPriority")]
pub enum Priority {
    /// "auto": [`Priority::BY_ITSELF`] where the kernel gives it, and time sharing without a word where it does not: most users lack the
    /// right, and `krait doctor` tells them.
    Auto,
    /// 1 to 99, and told where it is refused; 0: time sharing.
    Fixed(u8),
}

impl Priority {
    /// Time sharing, as every other process.
    pub const NONE: Self = Self::Fixed(0);
    /// What "auto" asks for: above ordinary work, below the kernel's own threads for interrupts on PREEMPT_RT (50).
    pub const BY_ITSELF: u8 = 40;

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
