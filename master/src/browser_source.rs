//! The console's pages as a device: sleeps on the channel on which the console says what the driving page's hand does.

use crate::source::sleep_until;
use crate::{MasterError, Plug, ReportSource, SourceEvent};
use core::time::Duration;
use krait_ipc::message::DriveWish;
use krait_ipc::{Bus, ReadOptions, Reader, clock};

/// Reads the drive pad of the console.
#[derive(Debug)]
pub struct BrowserSource {
    // Nothing once the channel was found broken; that is told once.
    wishes: Option<Reader<DriveWish>>,
}

impl BrowserSource {
    /// Becomes the reader of the console's channel; a console may come later, or never.
    ///
    /// # Errors
    /// [`MasterError::Ipc`] where the channel cannot be read.
    pub fn open(bus: &Bus) -> Result<Self, MasterError> {
        Ok(Self { wishes: Some(bus.reader(ReadOptions::waking())?) })
    }
}

impl ReportSource for BrowserSource {
    fn start(&mut self, _now_ns: i64) {}

    fn wait_until(&mut self, deadline_ns: i64) {
        let left_ns = deadline_ns.saturating_sub(clock::monotonic_ns());
        if left_ns <= 0 {
            return;
        }
        let waited = self.wishes.as_mut().map(|wishes| wishes.wait(Duration::from_nanos(left_ns.unsigned_abs())));
        if !matches!(waited, Some(Ok(_))) {
            sleep_until(deadline_ns);
        }
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        match self.wishes.as_mut()?.take() {
            // After the console's own stamp, however lately that was.
            Ok(wish) => wish.map(|wish| SourceEvent::Pad { stamp_ns: clock::monotonic_ns(), wish: *wish }),
            Err(error) => {
                tracing::error!(%error, "the drive pad is lost");
                self.wishes = None;
                Some(SourceEvent::Plug { device: 0, stamp_ns: now_ns, plug: Plug::Out })
            }
        }
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        None
    }
}
