//! The command line of `krait devices`.

use clap::Args;
use std::path::PathBuf;

/// Options of `krait devices`.
#[derive(Clone, Debug, Args)]
pub struct DevicesArgs {
    /// A profile of your own (TOML, docs/hands.md) to look for beside the built-in ones. With --live: shown are the hand's axes
    /// too. With --calibrate: its axes and buttons are kept.
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Write the udev lines that the hand controllers here need into a new file.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["live", "calibrate"])]
    pub write_udev: Option<PathBuf>,
    /// Show axes and buttons of one device as they are, until Ctrl-C or for --seconds: that of --node, else that of --profile, else
    /// the SpaceMouse that is there.
    #[arg(long, conflicts_with = "calibrate")]
    pub live: bool,
    /// Find rest, range and noise of each axis of the device of --node or --profile, and write them into a profile. Axes are those
    /// of --profile, else ABS_X to ABS_RZ; buttons likewise, else those pressed meanwhile, in that order.
    #[arg(long, value_name = "FILE")]
    pub calibrate: Option<PathBuf>,
    /// The device for --live and --calibrate: a node of the kernel's input system, or a pipe that holds what one tells. Without both:
    /// the node that --profile is of.
    #[arg(long, value_name = "NODE")]
    pub node: Option<PathBuf>,
    /// How long to show, or to calibrate (20 s by default, at least 3), s.
    #[arg(long, value_name = "S")]
    pub seconds: Option<f64>,
    /// Overwrite the profile that --calibrate names.
    #[arg(long, requires = "calibrate")]
    pub force: bool,
    /// Print the devices as JSON on standard output.
    #[arg(long, conflicts_with_all = ["live", "calibrate"])]
    pub json: bool,
}
