//! What a recording says about itself before its first sample: who recorded what, where, when, and with which settings.

use crate::wall_clock::{WallClock, utc_text};
use krait_ipc::clock;
use std::collections::BTreeMap;

/// The attachment with the configuration of the chain, TOML.
pub const CONFIG_ATTACHMENT: &str = "krait.toml";
/// The attachment with the model file of the chain, TOML.
pub const MODEL_ATTACHMENT: &str = "model.toml";

/// A file embedded in the recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Its name, `krait.toml`.
    pub name: String,
    /// Its media type, `application/toml`.
    pub media_type: String,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// What stands at the beginning of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct About {
    /// The clock of every log time in the file.
    pub clock: WallClock,
    /// The metadata record `krait`.
    pub metadata: BTreeMap<String, String>,
    /// Embedded files.
    pub attachments: Vec<Attachment>,
}

impl About {
    /// Describes a run of an instance on this machine, now. `given` adds keys; what is measured here wins over it, but for
    /// `run_id` and `compensation`, which are filled in if missing.
    pub fn run(instance: &str, given: &BTreeMap<String, String>, attachments: Vec<Attachment>) -> Self {
        let clock = WallClock::measure();
        let start_wall_ns = clock::wall_ns();
        let mut metadata = given.clone();
        let pid = std::process::id();
        metadata.entry("run_id".to_owned()).or_insert_with(|| format!("{}-{instance}-{pid}", utc_text(start_wall_ns)));
        metadata.entry("compensation".to_owned()).or_insert_with(|| "unknown".to_owned());
        metadata.entry("git_revision".to_owned()).or_insert_with(|| "unknown".to_owned());
        for (key, value) in [
            ("instance", instance.to_owned()),
            ("host", kernel_word("hostname")),
            ("kernel", kernel_word("osrelease")),
            ("krait_version", env!("CARGO_PKG_VERSION").to_owned()),
            ("clock_offset_ns", clock.offset_ns.to_string()),
            ("start_wall_ns", start_wall_ns.to_string()),
            ("start_utc", utc_text(start_wall_ns)),
        ] {
            metadata.insert(key.to_owned(), value);
        }
        Self { clock, metadata, attachments }
    }
}

/// Name of a recording without a path of its own.
pub(crate) fn default_file_name(instance: &str) -> String {
    format!("{}-{instance}-{}.mcap", utc_text(clock::wall_ns()), std::process::id())
}

fn kernel_word(name: &str) -> String {
    let read = std::fs::read_to_string(format!("/proc/sys/kernel/{name}"));
    read.map_or_else(|_| "unknown".to_owned(), |text| text.trim().to_owned())
}
