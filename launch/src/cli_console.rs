//! The command lines of the console and of its glance in a terminal.

use clap::Args;
use std::path::PathBuf;

/// Options of `krait console`.
#[derive(Clone, Debug, Args)]
pub struct ConsoleArgs {
    /// A recording to open; the page begins with it, and lists those of its folder.
    #[arg(value_name = "RECORDING", conflicts_with = "recordings")]
    pub recording: Option<PathBuf>,
    /// Port of the page on this machine; 0: any that is free.
    #[arg(long, default_value_t = 0)]
    pub port: u16,
    /// Port of the stop on this machine; 0: any that is free.
    #[arg(long, default_value_t = 0)]
    pub stop_port: u16,
    /// Folder of the recordings that the page lists.
    #[arg(long, value_name = "DIR", default_value = "recordings")]
    pub recordings: PathBuf,
    /// Folder of the lab's measurements and models; made when it is needed first.
    #[arg(long, value_name = "DIR", default_value = "lab-files")]
    pub lab: PathBuf,
}

/// Options of `krait watch`.
#[derive(Clone, Debug, Args)]
pub struct WatchArgs {
    /// Say it once, after a second of looking, and end.
    #[arg(long)]
    pub once: bool,
}
