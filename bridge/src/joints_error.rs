//! Why joints cannot be driven, each in one sentence.

/// A model of joints, or the configuration for it, was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JointsError {
    /// More joints than a message carries.
    #[error("the model has {found} joints, expected 1 to 8 in a running chain; `krait lab` takes up to 16")]
    TooMany {
        /// Joints in the model.
        found: usize,
    },
    /// A unit that is neither an angle nor a length.
    #[error(
        "[machine] {key} = {found:?}: expected rad, mrad, deg, m, mm or um in a running chain, because drives are told lengths of cable; scale gain and offset to one of them"
    )]
    Unit {
        /// The key.
        key: &'static str,
        /// The unit found.
        found: String,
    },
    /// A list of another length.
    #[error("[joints] {key} has {found} entries, expected {expected}, one for each joint of the model{hint}")]
    Length {
        /// The key.
        key: &'static str,
        /// Entries found.
        found: usize,
        /// Joints of the model.
        expected: usize,
        /// What an empty list would mean.
        hint: &'static str,
    },
    /// A number that is not finite or out of range.
    #[error(
        "[joints] {key} of joint {joint} is {found}, expected {low} to {high}; correct it, or delete the key for the default"
    )]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// Which joint, from 1.
        joint: usize,
        /// Smallest allowed value.
        low: f64,
        /// Largest allowed value.
        high: f64,
        /// The value found.
        found: f64,
    },
}
