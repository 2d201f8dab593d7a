//! Plays a recording by its stamps, so that the chain meets the very bytes at the very pace of a device.
//!
//! What is told carries the instant at which it was due. A process that a busy machine left waiting tells it late; by the instant of telling
//! the hand would have been silent, and one that is silent while deflected counts as lost.

use crate::recording::StampedEvent;
use crate::source::sleep_until;
use crate::{HidRecording, Layout, RecordedEvent, ReportSource, SourceEvent};
use std::net::{Ipv4Addr, SocketAddr};

/// Pause between the end of a looping recording and its new beginning, ns: long enough to count as rest.
const LOOP_PAUSE_NS: i64 = 500_000_000;

/// Plays a recording from an instant on, once or again and again.
#[derive(Debug)]
pub struct RecordingSource {
    recording: HidRecording,
    looping: bool,
    start_ns: Option<i64>,
    next_idx: usize,
    is_end_told: bool,
}

impl RecordingSource {
    /// A player that waits for its start.
    pub fn new(recording: HidRecording, looping: bool) -> Self {
        Self { recording, looping, start_ns: None, next_idx: 0, is_end_told: false }
    }

    /// When the next report is due, CLOCK_MONOTONIC, ns; `None` before the start and after the end.
    fn due_ns(&self) -> Option<i64> {
        let stamped = self.recording.stamped(self.next_idx)?;
        Some(self.start_ns?.saturating_add(stamped.stamp_ns))
    }

    fn told(&self, stamp_ns: i64, stamped: StampedEvent) -> SourceEvent {
        let device = stamped.device;
        let report = match stamped.event {
            RecordedEvent::Report(report) => report,
            RecordedEvent::Plug(plug) => return SourceEvent::Plug { device, stamp_ns, plug },
        };
        match self.recording.header().layout {
            // A recording holds the packets of the one sender that counted.
            Some(Layout::Pose) if device == 0 => {
                SourceEvent::Packet { stamp_ns, sender: SocketAddr::from((Ipv4Addr::LOCALHOST, 0)), packet: report }
            }
            _ => SourceEvent::HidReport { device, stamp_ns, report },
        }
    }

    fn at_end(&mut self, now_ns: i64) -> Option<SourceEvent> {
        let start_ns = self.start_ns?;
        if !self.is_end_told {
            self.is_end_told = true;
            return Some(SourceEvent::Ended);
        }
        let again_ns = start_ns.saturating_add(self.recording.duration_ns()).saturating_add(LOOP_PAUSE_NS);
        if !self.looping || now_ns < again_ns {
            return None;
        }
        (self.start_ns, self.next_idx, self.is_end_told) = (Some(again_ns), 0, false);
        Some(SourceEvent::Restarted)
    }
}

impl ReportSource for RecordingSource {
    fn start(&mut self, now_ns: i64) {
        self.start_ns = Some(now_ns);
    }

    fn wait_until(&mut self, deadline_ns: i64) {
        sleep_until(self.due_ns().map_or(deadline_ns, |due_ns| due_ns.min(deadline_ns)));
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        let Some(stamped) = self.recording.stamped(self.next_idx) else { return self.at_end(now_ns) };
        let due_ns = self.due_ns().filter(|due_ns| *due_ns <= now_ns)?;
        self.next_idx += 1;
        Some(self.told(due_ns, stamped))
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        Some((self.recording.header().vendor_id, self.recording.header().product_id))
    }

    fn layout(&self) -> Option<Layout> {
        self.recording.header().layout
    }

    fn beside(&self) -> Vec<(u16, u16)> {
        self.recording.header().beside.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Engage, MasterConfig, MasterCore};

    fn source(looping: bool) -> RecordingSource {
        let text = "krait-report-recording 1\ndevice 046d:c626\nlayout split\nreports\n0 0301\n8 0300\n8 0302\nend 3\n";
        RecordingSource::new(HidRecording::parse("test", text.as_bytes()).expect("recording"), looping)
    }

    fn told(source: &mut RecordingSource, now_ns: i64) -> Vec<String> {
        std::iter::from_fn(|| source.next_event(now_ns))
            .map(|event| match event {
                SourceEvent::HidReport { report, .. } => format!("{:02x}", report.as_bytes()[1]),
                other => format!("{other:?}"),
            })
            .collect()
    }

    #[test]
    fn reports_come_at_their_stamps_after_the_start_and_then_the_end() {
        let mut source = source(false);
        assert!(told(&mut source, 1_000).is_empty(), "not started");
        source.start(2_000);
        assert_eq!(told(&mut source, 2_000), ["01"]);
        assert!(told(&mut source, 2_007).is_empty());
        assert_eq!(told(&mut source, 2_008), ["00", "02", "Ended"]);
        assert!(told(&mut source, i64::MAX).is_empty(), "the end is told once");
    }

    /// A push of 0.8 s, a report each 8 ms, told after a pause of the process in the middle: the hand was there all the time.
    #[test]
    fn a_process_that_was_left_waiting_loses_no_hand() {
        const MS: i64 = 1_000_000;
        let pushed: String = (1..=100).map(|n| format!("{} 015e0100000000\n", n * 8 * MS)).collect();
        let text =
            format!("krait-report-recording 1\ndevice 046d:c626\nlayout split\nreports\n0 0301\n{pushed}end 101\n");
        let recording = HidRecording::parse("test", text.as_bytes()).expect("recording");
        let config = MasterConfig { engage: Engage::Once, ..MasterConfig::default() };
        let mut core = MasterCore::new(&config).expect("a core");
        let mut source = RecordingSource::new(recording, false);
        source.start(0);
        let mut is_present = |now_ns: i64| {
            while let Some(event) = source.next_event(now_ns) {
                if let SourceEvent::HidReport { device, stamp_ns, report } = event {
                    core.on_report_of(device, report.as_bytes(), stamp_ns).expect("a report");
                }
            }
            core.on_tick(now_ns).operator_present()
        };
        assert!((1..200).all(|ms| is_present(ms * MS)), "from its first report on");
        assert!((700..800).all(|ms| is_present(ms * MS)), "half a second later");
        assert!(!is_present(2000 * MS), "and silent at last");
    }

    #[test]
    fn a_looping_recording_rests_and_begins_again() {
        let mut source = source(true);
        source.start(0);
        assert_eq!(told(&mut source, 8).last().map(String::as_str), Some("Ended"));
        assert!(told(&mut source, 8 + LOOP_PAUSE_NS - 1).is_empty());
        assert_eq!(told(&mut source, 8 + LOOP_PAUSE_NS), ["Restarted", "01"]);
    }
}
