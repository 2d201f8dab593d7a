//! The parts of the verdict, each on a device of its own.

mod chain;
mod devices;
mod malformed;
mod receiver;
mod unplug;
mod usb_chain;
mod usb_keyboard;
mod usb_pointer;

pub use chain::{chain, control};
pub use devices::{devices, unreadable};
pub use malformed::malformed;
pub use receiver::receiver;
pub use unplug::unplug;
pub use usb_chain::chain as usb_chain;
pub use usb_keyboard::{control as usb_control, keyboard, replug};
pub use usb_pointer::{mouse, tablet};
