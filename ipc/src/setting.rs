//! Settings: one table per struct of the configuration gives its fields, defaults, ranges and the text that explains them.
//!
//! Problem: a default in the code, a range in a checker and a sentence in a guide part company at the first change.
//!
//! Intuition: [`settings!`](crate::settings) takes each setting once (sentence, name with its unit, type, default, range) and makes the
//! struct, its `Default`, `check_ranges` and the table [`Setting`] from it, which `krait config` prints beside each value.

use std::fmt::Display;

/// What is known about one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Its key, with the unit at the end.
    pub key: &'static str,
    /// What it is and why its default is what it is, one piece per line of the source.
    pub about: &'static [&'static str],
    /// Smallest and largest value that is allowed; none where the type alone says it.
    pub range: Option<(f64, f64)>,
}

impl Setting {
    /// The sentence, with the range behind it.
    pub fn sentence(&self) -> String {
        let about: Vec<&str> = self.about.iter().map(|piece| piece.trim()).collect();
        let range = self.range.map_or_else(String::new, |(low, high)| format!(" Range: {low} to {high}."));
        about.join(" ") + &range
    }
}

/// A value of the configuration is outside its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("[{table}] {key} = {found}: expected {low} to {high}; correct it, or delete it for the default {default}")]
pub struct SettingError {
    /// Table of the configuration file.
    pub table: &'static str,
    /// Key in that table.
    pub key: &'static str,
    /// What was given.
    pub found: f64,
    /// Smallest value that is allowed.
    pub low: f64,
    /// Largest value that is allowed.
    pub high: f64,
    /// What counts where the key is left out.
    pub default: String,
}

/// Checks one value.
///
/// # Errors
/// [`SettingError`], also for a value that is not a number.
pub fn check(
    (table, key): (&'static str, &'static str),
    found: f64,
    (low, high): (f64, f64),
    default: impl Display,
) -> Result<(), SettingError> {
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(SettingError { table, key, found, low, high, default: default.to_string() })
}

/// A number that a range can be asked of.
pub trait SettingNumber: Copy + Display {
    /// The number; whole numbers of the configuration are far below 2^53.
    fn number(self) -> f64;
}

macro_rules! number {
    ($($type:ty),+) => { $(impl SettingNumber for $type {
        fn number(self) -> f64 {
            self as f64
        }
    })+ };
}
number!(f64, u8, u32, u64, usize);

/// Makes a struct of the configuration from its settings; see [`crate::setting`]. A setting reads
/// `/// sentence`, `key: type = default, low..=high;`, the range left out where the type alone says what is allowed.
#[macro_export]
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $name:ident in $table:literal {
            $($(#[doc = $about:literal])+ $(#[serde($($serde:tt)*)])? $key:ident: $type:ty = $default:expr $(, $range:expr)?;)+
        }
    ) => {
        $(#[$meta])*
        #[derive(serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $($(#[doc = $about])+ $(#[serde($($serde)*)])? pub $key: $type,)+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)+ }
            }
        }

        impl $name {
            /// The table of the configuration file.
            pub const TABLE: &'static str = $table;
            /// What is known about each setting, in the order of the struct.
            pub const SETTINGS: &'static [$crate::setting::Setting] = &[$($crate::setting::Setting {
                key: stringify!($key),
                about: &[$($about),+],
                range: $crate::settings!(@range $($range)?),
            },)+];

            /// Checks every value that has a range.
            ///
            /// # Errors
            /// A `SettingError` names the first that is out of its range.
            fn check_ranges(&self) -> Result<(), $crate::setting::SettingError> {
                let default = Self::default();
                $($crate::settings!(@check default, self, $table, $key $(, $range)?);)+
                Ok(())
            }
        }
    };
    (@range) => { None };
    (@range $range:expr) => { Some((*$range.start() as f64, *$range.end() as f64)) };
    (@check $default:ident, $self:ident, $table:literal, $key:ident) => {};
    (@check $default:ident, $self:ident, $table:literal, $key:ident, $range:expr) => {
        $crate::setting::check(
            ($table, stringify!($key)),
            $crate::setting::SettingNumber::number($self.$key),
            (*$range.start() as f64, *$range.end() as f64),
            $default.$key,
        )?
    };
}
