//! The recorder's settings, each with unit, default, reason and range, checked before anything is opened.

use crate::about::Attachment;
use crate::error::RecordError;
use core::time::Duration;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What to record to, and with which buffers. Unknown keys are refused.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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
    /// Longest time that a sample waits for its chunk to be closed and handed to the file, ms, 1 to 10000. Default 100:
    /// what a killed recorder may lose.
    pub flush_ms: u64,
    /// Further keys and values of the metadata record `krait`: `run_id` and `compensation` are filled in if missing.
    pub metadata: BTreeMap<String, String>,
    /// Files to embed, such as the configuration in force. Given by the program, not by the configuration file.
    #[serde(skip)]
    pub attachments: Vec<Attachment>,
}

impl Default for RecordConfig {
    fn default() -> Self {
        Self {
            path: None,
            queue_length: 16_384,
            chunk_bytes: 256 * 1024,
            flush_ms: 100,
            metadata: BTreeMap::new(),
            attachments: Vec::new(),
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
        within("flush_ms", self.flush_ms, 1..=10_000, "1 to 10000 ms")
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
