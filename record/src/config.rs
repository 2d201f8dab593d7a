//! The recorder's settings, each with unit, default, reason and range, checked before anything is opened.

use crate::about::Attachment;
use crate::error::RecordError;
use crate::views::Views;
use core::time::Duration;
use krait_model::MachineParameters;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What to record to, and with which buffers. Unknown keys are refused.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordConfig {
    /// The file; missing folders are made, an existing file is never overwritten. Default: none, which means
    /// `recordings/<UTC time>-<instance>-<pid>.mcap`.
    pub path: Option<PathBuf>,
    /// Samples that may wait between the thread that reads shared memory and the one that writes, 16 to 1048576.
    /// Default 16384: 4 s of a chain at 1 kHz, longer than a disk usually pauses; about 6 MB.
    pub queue_length: usize,
    /// Uncompressed bytes after which a chunk is closed, 4096 to 16777216. Default 262144: at the default flush period
    /// a chain at 1 kHz never reaches it.
    pub chunk_bytes: usize,
    /// Longest time that a sample waits for its chunk to be closed and handed to the file, ms, 1 to 10000. Default 50:
    /// what a killed recorder may lose.
    pub flush_ms: u64,
    /// How often the disk is asked to keep what was handed to it, ms, 100 to 60000. Default 1000: what a machine that loses
    /// its power may lose. A thread of its own waits for the disk.
    pub sync_ms: u64,
    /// Length from which on a file is ended and the next one begun, bytes: 0 (never) or 65536 to 1099511627776. Default
    /// 1000000000: a file's index is kept in memory until its end, and this bounds it.
    pub rotate_bytes: u64,
    /// Age from which on a file is ended and the next one begun, s: 0 (never) to 86400. Default 3600, for the same reason.
    pub rotate_s: u64,
    /// How often the snake is drawn for viewers, Hz, 0 (never) to 60. Default 30: smooth to the eye, a few percent of the
    /// recording.
    pub view_hz: u32,
    /// Further keys and values of the metadata record `krait`: `run_id` and `compensation` are filled in if missing.
    pub metadata: BTreeMap<String, String>,
    /// Files to embed, such as the configuration in force. Given by the program, not by the configuration file.
    #[serde(skip)]
    pub attachments: Vec<Attachment>,
    /// The machine that is drawn. Given by the program.
    #[serde(skip)]
    pub machine: MachineParameters,
}

impl Default for RecordConfig {
    fn default() -> Self {
        Self {
            path: None,
            queue_length: 16_384,
            chunk_bytes: 256 * 1024,
            flush_ms: 50,
            sync_ms: 1000,
            rotate_bytes: 1_000_000_000,
            rotate_s: 3600,
            view_hz: 30,
            metadata: BTreeMap::new(),
            attachments: Vec::new(),
            machine: MachineParameters::default(),
        }
    }
}

impl RecordConfig {
    /// Checks every setting against its range.
    ///
    /// # Errors
    /// [`RecordError::Config`] names the first one that is out of range.
    pub fn validate(&self) -> Result<(), RecordError> {
        let within = |field, found, range: core::ops::RangeInclusive<u64>, expected| {
            if range.contains(&found) { Ok(()) } else { Err(RecordError::Config { field, found, expected }) }
        };
        within("queue_length", self.queue_length as u64, 16..=1 << 20, "16 to 1048576 samples")?;
        within("chunk_bytes", self.chunk_bytes as u64, 4096..=16 << 20, "4096 to 16777216 bytes")?;
        within("flush_ms", self.flush_ms, 1..=10_000, "1 to 10000 ms")?;
        within("sync_ms", self.sync_ms, 100..=60_000, "100 to 60000 ms")?;
        if self.rotate_bytes > 0 {
            within("rotate_bytes", self.rotate_bytes, 65_536..=1 << 40, "0 or 65536 to 1099511627776 bytes")?;
        }
        within("rotate_s", self.rotate_s, 0..=86_400, "0 to 86400 s")?;
        within("view_hz", u64::from(self.view_hz), 0..=60, "0 to 60 Hz")
    }

    /// What draws for viewers, if anything shall.
    pub(crate) fn views(&self) -> Result<Option<Views>, RecordError> {
        Ok(if self.view_hz == 0 { None } else { Some(Views::new(&self.machine, self.view_hz)?) })
    }

    pub(crate) fn sync_period(&self) -> Duration {
        Duration::from_millis(self.sync_ms)
    }

    pub(crate) fn flush_period(&self) -> Duration {
        Duration::from_millis(self.flush_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_range_are_refused_by_name_and_value() {
        let base = RecordConfig::default();
        assert!(base.validate().is_ok());
        for (config, field) in [
            (RecordConfig { queue_length: 0, ..base.clone() }, "queue_length is 0"),
            (RecordConfig { chunk_bytes: 1 << 30, ..base.clone() }, "chunk_bytes is 1073741824"),
            (RecordConfig { flush_ms: 0, ..base.clone() }, "flush_ms is 0"),
            (RecordConfig { rotate_bytes: 1, ..base.clone() }, "rotate_bytes is 1"),
            (RecordConfig { rotate_s: 86_401, ..base.clone() }, "rotate_s is 86401"),
            (RecordConfig { sync_ms: 0, ..base.clone() }, "sync_ms is 0"),
            (RecordConfig { view_hz: 61, ..base.clone() }, "view_hz is 61"),
        ] {
            let error = config.validate().expect_err(field).to_string();
            assert!(error.contains(field), "{error}");
        }
    }

    #[test]
    fn unknown_keys_are_refused() {
        assert!(serde_json::from_str::<RecordConfig>(r#"{"flush_ms": 50}"#).is_ok());
        let error = serde_json::from_str::<RecordConfig>(r#"{"flush": 50}"#).expect_err("unknown").to_string();
        assert!(error.contains("flush"), "{error}");
    }
}
