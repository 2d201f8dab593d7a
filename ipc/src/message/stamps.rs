//! When each stage touched a sample: the raw material of every latency figure.

use iceoryx2::prelude::ZeroCopySend;

/// Stamps of one sample's way from the operator's device to the drive, CLOCK_MONOTONIC, nanoseconds; 0 = not reached yet.
///
/// "begun" is taken when a process has the sample in hand, "sent" just before it publishes the result. The wake-up and
/// transport cost of a hop is therefore `begun` minus the `sent` before it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.HopStamps")]
pub struct HopStamps {
    /// The master had the report (or the tick was due).
    pub device_ns: i64,
    /// The master published the operator input.
    pub input_sent_ns: i64,
    /// `resolve` took the operator input.
    pub resolve_begun_ns: i64,
    /// `resolve` published the setpoint.
    pub setpoint_sent_ns: i64,
    /// `compensate` took the setpoint.
    pub compensate_begun_ns: i64,
    /// `compensate` published the command.
    pub command_sent_ns: i64,
    /// `slave` took the command.
    pub slave_begun_ns: i64,
    /// The drive had been written.
    pub drive_written_ns: i64,
}

/// Hops of a sample.
pub const N_HOPS: usize = 4;

impl HopStamps {
    /// Where each hop begins and ends. A hop ends when the next stage has published: its wake-up, its transport, its work.
    pub const HOPS: [(&'static str, &'static str); N_HOPS] =
        [("device", "master"), ("master", "resolve"), ("resolve", "compensate"), ("compensate", "slave")];

    /// What one hop of [`HopStamps::HOPS`] took, ns; nothing for a hop that there is not.
    pub fn hop_ns(&self, hop: usize) -> i64 {
        match hop {
            0 => self.input_sent_ns - self.device_ns,
            1 => self.setpoint_sent_ns - self.input_sent_ns,
            2 => self.command_sent_ns - self.setpoint_sent_ns,
            3 => self.drive_written_ns - self.command_sent_ns,
            _ => 0,
        }
    }

    /// From the device to the drive, ns: the sum of the hops.
    pub fn end_to_end_ns(&self) -> i64 {
        self.drive_written_ns - self.device_ns
    }
}

/// Latencies beyond which a sample counts as late, ns; none by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LatencyLimits {
    /// From the device to the drive.
    pub end_to_end_ns: i64,
    /// Of each hop of [`HopStamps::HOPS`].
    pub hops_ns: [i64; N_HOPS],
}

impl Default for LatencyLimits {
    fn default() -> Self {
        Self { end_to_end_ns: i64::MAX, hops_ns: [i64::MAX; N_HOPS] }
    }
}
