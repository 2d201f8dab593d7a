//! The parts of the verdict, each on a device of its own.

mod chain;
mod devices;
mod malformed;
mod receiver;
mod unplug;

pub use chain::{chain, control};
pub use devices::{devices, unreadable};
pub use malformed::malformed;
pub use receiver::receiver;
pub use unplug::unplug;
