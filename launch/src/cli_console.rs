//! The command lines of the console and of its glance in a terminal.

use clap::Args;
use std::path::PathBuf;

/// Options of `krait console`.
#[derive(Clone, Debug, Args)]
pub struct ConsoleArgs {
    /// A recording to open; the page begins with it, and lists those of its folder.
    #[arg(value_name = "RECORDING", conflicts_with_all = ["recordings", "foxglove"])]
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
    #[command(flatten)]
    pub viewers: FoxgloveArgs,
}

/// Whether viewers of engineers are served beside the page.
#[derive(Clone, Debug, Default, Args)]
pub struct FoxgloveArgs {
    /// Serve Foxglove's WebSocket protocol too, read-only, for viewers such as Foxglove and Lichtblick, beside the page of the
    /// chain; a third line has its address.
    #[arg(long)]
    pub foxglove: bool,
    /// A page of this origin may read as well (`https://viewer.example`), again for each.
    #[arg(long, value_name = "ORIGIN", requires = "foxglove", value_parser = origin)]
    pub foxglove_origin: Vec<String>,
}

impl FoxgloveArgs {
    /// The same wish on the command line of `krait console`.
    pub fn words(&self) -> Vec<&str> {
        let origins = self.foxglove_origin.iter().flat_map(|origin| ["--foxglove-origin", origin]);
        self.foxglove.then_some("--foxglove").into_iter().chain(origins).collect()
    }
}

/// An origin as a browser writes it: a scheme, a name, perhaps a port, and nothing behind.
fn origin(text: &str) -> Result<String, String> {
    let (scheme, host) = text.split_once("://").unwrap_or_default();
    let is_plain =
        |part: &str| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || "-.:[]+".contains(c));
    match is_plain(scheme) && is_plain(host) && text.chars().all(|c| !c.is_ascii_uppercase()) {
        true => Ok(text.to_owned()),
        false => {
            Err("an origin has a scheme, a name in small letters, perhaps a port: https://viewer.example".to_owned())
        }
    }
}

/// Options of `krait watch`.
#[derive(Clone, Debug, Args)]
pub struct WatchArgs {
    /// Say it once, after a second of looking, and end.
    #[arg(long)]
    pub once: bool,
}
