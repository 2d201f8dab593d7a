//! How a process fares: each process publishes its own, ten times a second, on the channel `health/<process>`.

use super::message;
use crate::reasons::{Reason, Reasons};
use iceoryx2::prelude::ZeroCopySend;

/// Room for reasons in one health message: as many as a set of reasons has bits.
pub const N_REASONS_MAX: usize = u64::BITS as usize;

/// Counters of one process since its start.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[type_name("krait.Health")]
pub struct Health {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// When it was taken, CLOCK_MONOTONIC, nanoseconds.
    pub sample_ns: i64,
    /// Process id.
    pub pid: u32,
    /// Padding, zero.
    pub reserved: u32,
    /// Messages taken from all channels.
    pub n_received: u64,
    /// Messages published on all channels.
    pub n_sent: u64,
    /// Messages that never reached this process (gaps in the sequence numbers).
    pub n_lost: u64,
    /// Messages refused.
    pub n_refused: u64,
    /// Reasons that hold now.
    pub reasons_now: u64,
    /// Reasons that have held at any time.
    pub reasons_ever: u64,
    /// Per reason (index = bit): how often, worst value and the limit it broke.
    pub records: [ReasonRecord; N_REASONS_MAX],
}

message!(Health, "health", 3, super::RARE);

/// How often a reason held, and its worst value beside its limit, in the reason's own unit.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[type_name("krait.ReasonRecord")]
pub struct ReasonRecord {
    /// Samples at which the reason held.
    pub count: u64,
    /// The value furthest beyond the limit.
    pub worst: f64,
    /// The newest value.
    pub newest: f64,
    /// The limit.
    pub limit: f64,
}

impl Default for Health {
    fn default() -> Self {
        Self {
            sequence: 0,
            sample_ns: 0,
            pid: 0,
            reserved: 0,
            n_received: 0,
            n_sent: 0,
            n_lost: 0,
            n_refused: 0,
            reasons_now: 0,
            reasons_ever: 0,
            records: [ReasonRecord::default(); N_REASONS_MAX],
        }
    }
}

impl Health {
    /// Replaces the set of reasons that hold now, and counts each.
    pub fn set_now(&mut self, reasons: Reasons) {
        self.reasons_now = reasons.bits();
        self.reasons_ever |= reasons.bits();
        for reason in reasons.iter() {
            self.records[reason as usize].count += 1;
        }
    }

    /// Notes a value beside the limit it broke; the worst is kept.
    pub fn note(&mut self, reason: Reason, value: f64, limit: f64) {
        let record = &mut self.records[reason as usize];
        if record.limit == 0.0 || (value - limit).abs() > (record.worst - record.limit).abs() {
            record.worst = value;
        }
        record.newest = value;
        record.limit = limit;
    }
}
