//! What ends a calibration: one sentence each, with what to do.

/// A calibration cannot go on, or gives no value.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// A file cannot be read or written.
    #[error("{file} cannot be {what}: {reason}; give another path or make room")]
    File {
        /// The file.
        file: String,
        /// What was tried.
        what: &'static str,
        /// What the system says.
        reason: String,
    },
    /// The terminal is gone.
    #[error("the dialogue cannot go on: {0}; start the command again, nothing recorded is lost")]
    Dialogue(#[from] std::io::Error),
    /// A row of a CSV cannot be used.
    #[error("{file}, row {row}: {reason}; correct or remove that row")]
    Row {
        /// The file.
        file: String,
        /// The row, the header being row 1.
        row: usize,
        /// What is wrong.
        reason: String,
    },
    /// The readings leave a value open.
    #[error("{parameter} is not determined: {found}; add {missing}")]
    NotDetermined {
        /// The value.
        parameter: &'static str,
        /// What the readings say of it.
        found: String,
        /// Readings that would.
        missing: String,
    },
    /// The law does not describe the readings.
    #[error(
        "the readings do not follow the law: chi2 is {chi2:.1} for {dof} degrees of freedom, expected at most {limit}; {advice}"
    )]
    Misfit {
        /// Sum of squares of the residuals in stated errors.
        chi2: f64,
        /// Readings minus values.
        dof: usize,
        /// Largest chi2 that is accepted.
        limit: f64,
        /// What to look at.
        advice: &'static str,
    },
    /// A setting of the caller is out of range.
    #[error("{name} is {found}, expected {expected}; correct it")]
    Setting {
        /// Which.
        name: &'static str,
        /// What was given.
        found: f64,
        /// What is needed.
        expected: &'static str,
    },
    /// The robot did not do what it was told.
    #[error("the robot stopped the calibration: {0}")]
    Robot(String),
    /// No picture of a pose has a bend yet.
    #[error("the poses are read and kept, and nothing is fitted yet: {0}")]
    Pictures(String),
    /// The operator stopped at a motion.
    #[error("it was stopped at a motion; what was read is kept, and the same command goes on from it")]
    Stopped,
    /// The model refuses a value.
    #[error("the model refuses what was found: {0}; look at the readings")]
    Model(String),
}
