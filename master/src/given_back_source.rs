//! The hand of a master that is started again after its user has given the device back: there is none, until somebody starts anew.

use crate::source::sleep_until;
use crate::{ReportSource, SourceEvent};

/// Tells once that the device was given back.
#[derive(Debug, Default)]
pub(crate) struct GivenBackSource {
    is_told: bool,
}

impl ReportSource for GivenBackSource {
    fn start(&mut self, _now_ns: i64) {}

    fn wait_until(&mut self, deadline_ns: i64) {
        sleep_until(deadline_ns);
    }

    fn next_event(&mut self, _now_ns: i64) -> Option<SourceEvent> {
        (!std::mem::replace(&mut self.is_told, true)).then_some(SourceEvent::GivenBack)
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        None
    }
}
