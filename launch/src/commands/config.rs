//! `krait config`: prints the configuration that is in force.

use crate::cli::Common;
use crate::config::Config;
use crate::print;
use std::process::ExitCode;

/// Prints every key with its value, what it is and what it may be.
pub fn run(common: &Common) -> anyhow::Result<ExitCode> {
    print::out(&Config::load(common.config.as_deref())?.explained()?)?;
    Ok(ExitCode::SUCCESS)
}
