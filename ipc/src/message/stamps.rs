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
