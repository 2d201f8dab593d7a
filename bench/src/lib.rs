//! krait-bench: what krait's chain is measured against, and how.
//!
//! Purpose: a latency says nothing without the floor of the machine beside it, taken in the same minute. Here are relays of
//! four processes and three hops over several ways to pass a message, from a futex word (the floor) to other people's
//! middleware, and the figures, raw samples and picture of a measurement.
//!
//! Terms: a *chain* is four processes in a row; a *hop* is the way from one to the next; a *round* is one start of a chain,
//! its warm-up and its measured samples; chains take turns round by round, so that drift of the machine hits all alike; the
//! *floor* is the chain `floor-futex`.
//!
//! Frames and units: stamps are CLOCK_MONOTONIC in nanoseconds; figures are in microseconds and say so.

mod error;
mod figures;
mod growth;
mod host;
mod kind;
mod load;
mod peer;
mod picture;
mod plan;
mod relay;
mod round;
mod samples;
mod scratch;
mod stage;
mod transport;
mod usage;
mod verdict;

pub use error::BenchError;
pub use figures::{ChainFigures, ChainRounds, Quantiles};
pub use growth::{Growth, growth_svg};
pub use host::Host;
pub use kind::ChainKind;
pub use load::{Load, burn};
pub use picture::histogram_svg;
pub use plan::Plan;
pub use relay::{Inlet, Outlet};
pub use round::run_relay_round;
pub use samples::{N_HOPS, RelaySample, read_samples, write_csv};
pub use scratch::Scratch;
pub use stage::{Role, StageOptions, Ways, run_stage, run_stage_over};
pub use transport::PATIENCE;
pub use usage::Usage;
pub use verdict::{Broken, RatioLimits, broken};

/// A measurement of one chain in one round.
#[derive(Clone, Debug, Default)]
pub struct Round {
    /// Samples after the warm-up, in the order of arrival.
    pub samples: Vec<RelaySample>,
    /// Samples that the source sent, the warm-up included.
    pub n_sent: u64,
    /// Of these, the ones that did not come out at the end.
    pub n_lost: u64,
    /// What the chain's processes took of the machine while samples were measured.
    pub usage: Usage,
    /// The chain's own work per sample, without waiting and transport, ns; empty for a relay, which computes nothing.
    pub own_work_ns: Vec<u32>,
}
