//! How `krait experiment` runs: settings, consent, one chain for each compensation, and its recording read back.

mod chain;
mod consent;
mod recorded;
mod settings;

pub use chain::run_passes;
pub use consent::ask;
pub use recorded::{outcome_of, refuse_other};
pub use settings::Settings;
