//! What carries frames, with a clock: the kernel's socket, or an emulated bus whose time is its own.

use super::frame::Frame;
use crate::bus::BusGone;

/// A bus's end.
pub trait Wire: Send + 'static {
    /// Sends a frame.
    ///
    /// # Errors
    /// [`BusGone`] when the bus cannot be used.
    fn send(&mut self, frame: &Frame) -> Result<(), BusGone>;

    /// The next frame of somebody else, waited for until an instant; `None`: there was none.
    ///
    /// # Errors
    /// As [`Wire::send`].
    fn receive(&mut self, until_ns: i64) -> Result<Option<Frame>, BusGone>;

    /// Opens it again after it was gone.
    ///
    /// # Errors
    /// [`BusGone`] where it is still gone.
    fn come_back(&mut self) -> Result<(), BusGone> {
        Ok(())
    }

    /// The instant, ns.
    fn now_ns(&self) -> i64;
}
