//! The recorder's settings, each with unit, default, reason and range, checked before anything is opened.

use crate::about::Attachment;
use crate::error::RecordError;
use crate::views::{DrawnMachine, Views};
use core::time::Duration;
use krait_ipc::setting::check;
use krait_ipc::settings;
use std::collections::BTreeMap;
use std::path::PathBuf;

settings! {
    /// What to record to, and with which buffers. Unknown keys are refused.
    #[derive(Clone, Debug, PartialEq)]
    pub struct RecordConfig in "record" {
        /// The file; missing folders are made, an existing file is never overwritten. None: `recordings/<UTC
        /// time>-<instance>-<pid>.mcap`.
        path: Option<PathBuf> = None;
        /// Samples that may wait between the thread that reads shared memory and the one that writes. 16384: 4 s of a chain at
        /// 1 kHz, longer than a disk usually pauses; about 6 MB.
        queue_length: usize = 16_384, 16..=1 << 20;
        /// Uncompressed bytes after which a chunk is closed. 262144: at the default flush period a chain at 1 kHz never
        /// reaches it.
        chunk_bytes: usize = 256 * 1024, 4096..=16 << 20;
        /// Longest time that a sample waits for its chunk to be closed and handed to the file, ms. 50: what a killed recorder
        /// may lose.
        flush_ms: u64 = 50, 1..=10_000;
        /// How often the disk is asked to keep what was handed to it, ms. 1000: what a machine that loses its power may lose. A
        /// thread of its own waits for the disk.
        sync_ms: u64 = 1000, 100..=60_000;
        /// Length from which on a file is ended and the next one begun, bytes: 0 (never), or at least 65536. 1000000000: a
        /// file's index is kept in memory until its end, and this bounds it.
        rotate_bytes: u64 = 1_000_000_000, 0..=1_u64 << 40;
        /// Age from which on a file is ended and the next one begun, s; 0: never. 3600, for the same reason.
        rotate_s: u64 = 3600, 0..=86_400;
        /// How often the machine is drawn for viewers, Hz; 0: never. 30: smooth to the eye, a few percent of the recording.
        view_hz: u32 = 30, 0..=60;
        /// Further keys and values of the metadata record `krait`: `run_id` and `compensation` are filled in if missing.
        metadata: BTreeMap<String, String> = BTreeMap::new();
        /// Files to embed, such as the configuration in force. Given by the program, not by the configuration file.
        #[serde(skip)]
        attachments: Vec<Attachment> = Vec::new();
        /// The machine that is drawn; none where it has no shape that a model knows. Given by the program.
        #[serde(skip)]
        machine: Option<DrawnMachine> = Some(DrawnMachine::default());
    }
}

impl RecordConfig {
    /// Checks every setting against its range.
    ///
    /// # Errors
    /// [`RecordError::Setting`] names the first one that is out of range.
    pub fn check(&self) -> Result<(), RecordError> {
        self.check_ranges()?;
        if self.rotate_bytes > 0 {
            let most = (1_u64 << 40) as f64;
            check((Self::TABLE, "rotate_bytes"), self.rotate_bytes as f64, (65_536.0, most), 1_000_000_000)?;
        }
        Ok(())
    }

    /// What draws for viewers, if anything shall.
    pub(crate) fn views(&self) -> Result<Option<Views>, RecordError> {
        Ok(if self.view_hz == 0 { None } else { Some(Views::new(self.machine.as_ref(), self.view_hz)?) })
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
        assert!(base.check().is_ok());
        for (config, field) in [
            (RecordConfig { queue_length: 0, ..base.clone() }, "queue_length = 0"),
            (RecordConfig { chunk_bytes: 1 << 30, ..base.clone() }, "chunk_bytes = 1073741824"),
            (RecordConfig { flush_ms: 0, ..base.clone() }, "flush_ms = 0"),
            (RecordConfig { rotate_bytes: 1, ..base.clone() }, "rotate_bytes = 1"),
            (RecordConfig { rotate_s: 86_401, ..base.clone() }, "rotate_s = 86401"),
            (RecordConfig { sync_ms: 0, ..base.clone() }, "sync_ms = 0"),
            (RecordConfig { view_hz: 61, ..base.clone() }, "view_hz = 61"),
        ] {
            let error = config.check().expect_err(field).to_string();
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
