//! krait-ipc: the messages of krait and the typed zero-copy channels that carry them.
//!
//! Purpose: every process opens its channels here, so that sizes, history, single writers, versions and names are decided
//! once. This is the only crate that touches iceoryx2.
//!
//! Terms: an *instance* is one chain on a machine; a *channel* is a publish-subscribe service with a *doorbell* beside it,
//! a futex word in shared memory; a *writer* is its one publisher; a *reader* sleeps until the doorbell rings, or polls.
//!
//! Frames and units: see `docs/NOTATION.md`; every field of a message carries its unit in its name.
//!
//! ```no_run
//! use krait_ipc::{Bus, ReadOptions, message::OperatorInput};
//! use core::time::Duration;
//! let bus = Bus::open("main", "resolve")?;
//! let mut inputs = bus.reader::<OperatorInput>(ReadOptions::waking())?;
//! inputs.wait(Duration::from_millis(50))?;
//! while let Some(input) = inputs.take()? {
//!     let _velocity = input.tip_vel_in_view_m_per_s;
//! }
//! # Ok::<(), krait_ipc::IpcError>(())
//! ```

mod ahead;
mod bus;
pub mod clock;
mod doorbell;
mod error;
mod experiment_mark;
mod ground;
mod health_reporter;
pub mod input;
mod instance;
mod membership;
mod memory;
pub mod message;
mod port;
mod priority;
mod process;
mod reader;
mod realtime;
mod reasons;
pub mod setting;
mod shared_words;
mod standing;
mod stop;
mod writer;

pub use bus::Bus;
pub use doorbell::Doorbell;
pub use error::IpcError;
pub use experiment_mark::ExperimentMark;
pub use ground::{ground, grounds};
pub use health_reporter::{HealthReporter, ReadCounts, health_channel};
pub use instance::{InstanceName, resources_of};
pub use message::LatencyLimits;
pub use priority::Priority;
pub use process::{Process, WhenLost};
pub use reader::{ReadOptions, Reader, Received, WaitMode};
pub use realtime::{Beside, Cores, Realtime, RealtimeError, allowed_cores, lock_what_is_used, may_lock_all, set_slice};
pub use reasons::{Reason, Reasons};
pub use shared_words::SharedWords;
pub use standing::Standing;
pub use stop::StopSwitch;
pub use writer::Writer;
