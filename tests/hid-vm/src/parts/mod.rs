//! The parts of the verdict, each on a device of its own.

mod chain;
mod devices;
mod malformed;
mod unplug;

pub use chain::{chain, control};
pub use devices::{devices, unreadable};
pub use malformed::malformed;
pub use unplug::unplug;
