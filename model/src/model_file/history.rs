//! How a model came to be: one entry for each effect that was added or fitted.

/// One step of a model's history.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryEntry {
    /// The effect that was added or fitted.
    pub effect: String,
    /// The data.
    pub data: String,
    /// Their SHA-256, 64 hexadecimal digits.
    pub data_sha256: String,
    /// The day, YYYY-MM-DD.
    pub date: Option<String>,
    /// What it brought.
    pub heldout_rms: HeldOutRms,
    /// Unit of the errors: degrees, or for joints in another unit that one.
    pub unit: String,
}

/// Error on data that the effect was not fitted to, root mean square, in the entry's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutRms {
    /// Before the effect.
    pub before: f64,
    /// After it.
    pub after: f64,
    /// What the measurement itself leaves; absent where it is not known.
    pub noise_floor: Option<f64>,
}
