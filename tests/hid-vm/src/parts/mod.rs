//! The parts of the verdict, each on a device of its own.

mod chain;
mod devices;
mod lights;
mod malformed;
mod pedal;
mod receiver;
mod replug;
mod rumble;
mod spacenavd;
mod two_hands;
mod unplug;
mod usb_chain;
mod usb_keyboard;
mod usb_lights;
mod usb_pointer;
mod usb_repeated;
mod usb_restart;
mod usb_two;

pub use chain::{chain, control};
pub use devices::{devices, unreadable};
pub use lights::lights;
pub use malformed::malformed;
pub use pedal::pedal;
pub use receiver::receiver;
pub use replug::replug as hid_replug;
pub use rumble::{rumble, shipped_rumble};
pub use spacenavd::{is_there as has_spacenavd, spacenavd};
pub use two_hands::{control as two_control, two_hands};
pub use unplug::unplug;
pub use usb_chain::chain as usb_chain;
pub use usb_keyboard::{control as usb_control, keyboard, replug};
pub use usb_lights::lights as usb_lights;
pub use usb_pointer::{mouse, replug as mouse_replug, tablet};
pub use usb_repeated::{keyboard as keyboard_repeated, mouse as mouse_repeated};
pub use usb_restart::restart as usb_restart;
pub use usb_two::{control as usb_two_control, two as usb_two};
