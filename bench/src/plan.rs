//! How a measurement is made: rate, length, size, way to wait, cores, priority; checked before anything starts.

use crate::BenchError;
use crate::relay::HEADER_BYTES;
use krait_ipc::{Realtime, WaitMode};
use serde::{Deserialize, Serialize};

/// Largest rate, Hz; a source cannot sleep for less than some tens of microseconds.
const MOST_HZ: u32 = 8000;
/// Largest payload, bytes; one datagram of a unix socket holds more by default.
const MOST_BYTES: usize = 65_536;
/// Longest measurement of one chain, s: a day.
const MOST_S: f64 = 86_400.0;
/// Part of a round that is thrown away at its beginning, s: connections are made, caches filled, motion begins.
const WARM_UP_S: f64 = 0.4;

/// What a measurement is made with; the same for every chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Samples a second, Hz.
    pub rate_hz: u32,
    /// Measured time per chain, over all rounds, s.
    pub seconds: f64,
    /// Rounds; in each every chain has its turn.
    pub n_rounds: u32,
    /// Bytes in a message of a relay; krait's own messages have their own sizes.
    pub payload_bytes: usize,
    /// How a process of a relay waits for the next message; krait's chain waits as its configuration says.
    pub wait: WaitMode,
    /// What each process of a relay asks of the kernel; krait's chain asks for what its configuration says.
    pub realtime: Realtime,
}

impl Plan {
    /// Checks every range.
    ///
    /// # Errors
    /// [`BenchError::Setting`] names the first option that is out of range.
    pub fn check(&self) -> Result<(), BenchError> {
        let refuse = |option, found: String, expected| Err(BenchError::Setting { option, found, expected });
        if !(100..=MOST_HZ).contains(&self.rate_hz) {
            return refuse("--rate", self.rate_hz.to_string(), "100 to 8000 Hz");
        }
        if !(0.5..=MOST_S).contains(&self.seconds) {
            return refuse("--seconds", self.seconds.to_string(), "0.5 to 86400 s");
        }
        if !(1..=1000).contains(&self.n_rounds) || self.round_s() < 0.1 {
            return refuse("--rounds", self.n_rounds.to_string(), "1 to 1000 rounds of at least 0.1 s each");
        }
        if !(HEADER_BYTES..=MOST_BYTES).contains(&self.payload_bytes) {
            return refuse("--payload", self.payload_bytes.to_string(), "40 to 65536 bytes");
        }
        if let Err(error) = self.realtime.check() {
            return refuse("--cores or --priority", error.to_string(), "cores 0 to 1023, priority 0 to 99");
        }
        Ok(())
    }

    /// Measured time of one round, s.
    pub fn round_s(&self) -> f64 {
        self.seconds / f64::from(self.n_rounds)
    }

    /// Time at the beginning of a round that does not count, s.
    pub fn warm_up_s(&self) -> f64 {
        WARM_UP_S
    }

    /// Time between two samples, ns.
    pub fn period_ns(&self) -> i64 {
        1_000_000_000 / i64::from(self.rate_hz.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        Plan {
            rate_hz: 1000,
            seconds: 10.0,
            n_rounds: 5,
            payload_bytes: 176,
            wait: WaitMode::Blocking,
            realtime: Realtime::ORDINARY,
        }
    }

    #[test]
    fn settings_out_of_range_name_their_option_and_range() {
        assert!(plan().check().is_ok());
        for (plan, option) in [
            (Plan { rate_hz: 10, ..plan() }, "--rate is 10: expected 100 to 8000 Hz"),
            (Plan { seconds: f64::NAN, ..plan() }, "--seconds is NaN"),
            (Plan { n_rounds: 0, ..plan() }, "--rounds is 0"),
            (Plan { n_rounds: 500, ..plan() }, "--rounds is 500"),
            (Plan { payload_bytes: 8, ..plan() }, "--payload is 8"),
        ] {
            let error = plan.check().expect_err(option).to_string();
            assert!(error.contains(option), "{error}");
        }
    }
}
