//! The command line of the console.

use clap::Args;

/// Options of `krait console`.
#[derive(Clone, Debug, Args)]
pub struct ConsoleArgs {
    /// Port of the page on this machine; 0: any that is free.
    #[arg(long, default_value_t = 0)]
    pub port: u16,
}
