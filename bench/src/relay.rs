//! The three loops of a relay: a source that sends at a fixed rate, two relays that pass on, a sink that keeps the stamps.
//! They compute nothing; whatever a message travels over is behind two small traits.

use crate::samples::{N_HOPS, RelaySample};
use crate::{BenchError, Plan, Usage};
use krait_ipc::clock::monotonic_ns;
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;

/// Sequence, source stamp and the stamp of each hop, at the beginning of every message, bytes.
pub(crate) const HEADER_BYTES: usize = (2 + N_HOPS) * 8;
/// Bit of the sequence that says: this is the last message.
const LAST: u64 = 1 << 63;
/// Bit of the sequence that says: the warm-up is over.
const MEASURED: u64 = 1 << 62;

/// Where messages come from.
pub trait Inlet {
    /// Waits for the next message and takes it into `message`, which has the plan's size; false when none came for
    /// [`crate::PATIENCE`], or none will come any more.
    ///
    /// # Errors
    /// [`BenchError::Transport`].
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError>;
}

/// Where messages go to.
pub trait Outlet {
    /// Sends a message of the plan's size.
    ///
    /// # Errors
    /// [`BenchError::Transport`].
    fn send(&mut self, message: &[u8]) -> Result<(), BenchError>;
}

/// What one process of a relay has counted.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Counted {
    /// Messages sent or taken.
    pub n_messages: u64,
    /// What the process took of the machine after the warm-up.
    pub usage: Usage,
}

/// Sends until the round is over.
pub(crate) fn source(plan: &Plan, outlet: &mut dyn Outlet) -> Result<Counted, BenchError> {
    let mut message = vec![0xa5; plan.payload_bytes];
    let (mut due_ns, mut before) = (monotonic_ns(), Usage::default());
    let measured_ns = due_ns + (plan.warm_up_s() * 1e9) as i64;
    let end_ns = measured_ns + (plan.round_s() * 1e9) as i64;
    let mut sequence = 0;
    while due_ns < end_ns {
        // A late tick is not made up for by a burst, as in krait's master.
        let n_late = (monotonic_ns() - due_ns).max(0) / plan.period_ns();
        due_ns += (n_late + 1) * plan.period_ns();
        sleep_until(due_ns);
        sequence += 1;
        let is_measured = due_ns >= measured_ns;
        let flags = if is_measured { MEASURED } else { 0 } | if due_ns >= end_ns { LAST } else { 0 };
        put(&mut message, 0, sequence | flags);
        put(&mut message, 1, monotonic_ns().cast_unsigned());
        outlet.send(&message)?;
        if is_measured && before == Usage::default() {
            before = Usage::of("self");
        }
    }
    Ok(Counted { n_messages: sequence, usage: Usage::of("self") - before })
}

/// Passes on until the last message.
pub(crate) fn relay(
    plan: &Plan,
    hop: usize,
    inlet: &mut dyn Inlet,
    outlet: &mut dyn Outlet,
) -> Result<Counted, BenchError> {
    let mut message = vec![0; plan.payload_bytes];
    let mut watch = Watch::default();
    while inlet.receive(&mut message)? {
        put(&mut message, 2 + hop, monotonic_ns().cast_unsigned());
        outlet.send(&message)?;
        if watch.is_last(get(&message, 0)) {
            break;
        }
    }
    Ok(watch.counted())
}

/// Takes until the last message; gives the samples after the warm-up.
pub(crate) fn sink(plan: &Plan, inlet: &mut dyn Inlet) -> Result<(Counted, Vec<RelaySample>), BenchError> {
    let mut message = vec![0; plan.payload_bytes];
    let mut watch = Watch::default();
    let mut samples = Vec::with_capacity(n_samples(plan, plan.round_s() + 1.0) as usize);
    while inlet.receive(&mut message)? {
        put(&mut message, 1 + N_HOPS, monotonic_ns().cast_unsigned());
        let sequence = get(&message, 0);
        if sequence & MEASURED != 0 {
            samples.push(RelaySample {
                sequence: sequence & !(LAST | MEASURED),
                source_ns: get(&message, 1).cast_signed(),
                arrived_ns: core::array::from_fn(|hop| get(&message, 2 + hop).cast_signed()),
            });
        }
        if watch.is_last(sequence) {
            break;
        }
    }
    Ok((watch.counted(), samples))
}

/// Counts messages, and looks at the process's usage when the warm-up is over.
#[derive(Default)]
struct Watch {
    n_messages: u64,
    before: Option<Usage>,
}

impl Watch {
    fn is_last(&mut self, sequence: u64) -> bool {
        self.n_messages += 1;
        if sequence & MEASURED != 0 && self.before.is_none() {
            self.before = Some(Usage::of("self"));
        }
        sequence & LAST != 0
    }

    fn counted(&self) -> Counted {
        let usage = self.before.map_or_else(Usage::default, |before| Usage::of("self") - before);
        Counted { n_messages: self.n_messages, usage }
    }
}

fn n_samples(plan: &Plan, seconds: f64) -> u64 {
    (seconds * f64::from(plan.rate_hz)).round() as u64
}

fn put(message: &mut [u8], word: usize, value: u64) {
    message[word * 8..word * 8 + 8].copy_from_slice(&value.to_le_bytes());
}

fn get(message: &[u8], word: usize) -> u64 {
    message[word * 8..word * 8 + 8].try_into().map_or(0, u64::from_le_bytes)
}

/// Absolute, so that lateness of one sleep never adds to the next. A signal ends it early, which the stamps then show.
fn sleep_until(due_ns: i64) {
    let due = Timespec { tv_sec: due_ns.div_euclid(1_000_000_000), tv_nsec: due_ns.rem_euclid(1_000_000_000) };
    if clock_nanosleep_absolute(ClockId::Monotonic, &due).is_err() {
        std::thread::yield_now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::{Realtime, WaitMode};
    use std::sync::mpsc::{Receiver, Sender, channel};

    struct Out(Sender<Vec<u8>>);
    struct In(Receiver<Vec<u8>>);

    impl Outlet for Out {
        fn send(&mut self, message: &[u8]) -> Result<(), BenchError> {
            self.0.send(message.to_vec()).expect("someone listens");
            Ok(())
        }
    }

    impl Inlet for In {
        fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError> {
            Ok(self.0.recv().map(|bytes| message.copy_from_slice(&bytes)).is_ok())
        }
    }

    #[test]
    fn every_sample_after_the_warm_up_arrives_with_stamps_in_order() {
        let plan = Plan {
            rate_hz: 1000,
            seconds: 0.5,
            n_rounds: 1,
            payload_bytes: 64,
            wait: WaitMode::Blocking,
            realtime: Realtime::ORDINARY,
        };
        let ((a_out, a_in), (b_out, b_in), (c_out, c_in)) = (channel(), channel(), channel());
        let (sent, samples) = std::thread::scope(|scope| {
            scope.spawn(|| relay(&plan, 0, &mut In(a_in), &mut Out(b_out)).expect("relay"));
            scope.spawn(|| relay(&plan, 1, &mut In(b_in), &mut Out(c_out)).expect("relay"));
            let sink = scope.spawn(|| sink(&plan, &mut In(c_in)).expect("sink"));
            let sent = source(&plan, &mut Out(a_out)).expect("source");
            (sent, sink.join().expect("ends"))
        });
        let (counted, samples) = samples;
        assert_eq!(counted.n_messages, sent.n_messages, "none is lost in a queue of this program");
        assert_eq!(samples.last().expect("samples").sequence, sent.n_messages, "the mark of the last is no part of it");
        let n_after_ns = samples.last().expect("samples").source_ns - samples[0].source_ns;
        assert!((0.45e9..0.65e9).contains(&(n_after_ns as f64)), "0.4 s of warm-up do not count: {n_after_ns}");
        assert!(samples.iter().all(|s| (0..N_HOPS).all(|hop| s.hop_ns(hop) >= 0)));
    }
}
