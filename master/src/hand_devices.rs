//! The devices that are one operator's hand: what each has said, and what they say together. Pure, allocates nothing.
//!
//! Each device has its own decoder, its own silence and its own held buttons. Together they are lost while any of them is lost; one that has
//! merely not spoken yet is none of that.

use crate::{AXIS_LIMIT_COUNTS, AXIS_MARGIN_COUNTS, Decoder, DeviceMonitor, HidReport, Refusal, ReportCounts};
use krait_ipc::message::DeviceState;

/// The most devices that are one hand: the hand controller, which is the first, and three beside it.
pub const MAX_DEVICES: usize = 4;

/// What one device has said.
#[derive(Clone, Copy, Debug)]
struct OneDevice {
    decoder: Decoder,
    monitor: DeviceMonitor,
    /// Buttons that were down when the hand was lost: each counts only from its next press.
    held_over: u32,
    /// Whether it has ever told where its axes are.
    has_axes: bool,
    /// Whether it has axes, was plugged in again and has not spoken since.
    is_unheard: bool,
    /// Kinds of motion report (translation, rotation, both) that no input has carried yet.
    is_unpublished: [bool; 3],
}

/// Every device of a hand. A place that no device has waits for ever and changes nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HandDevices([OneDevice; MAX_DEVICES]);

impl HandDevices {
    /// Devices of which nothing has been heard.
    pub(crate) fn new(silence_limit_ns: i64) -> Self {
        let monitor = DeviceMonitor::new(silence_limit_ns);
        let decoder = Decoder::default();
        let (held_over, has_axes, is_unheard, is_unpublished) = (0, false, false, [false; 3]);
        Self([OneDevice { decoder, monitor, held_over, has_axes, is_unheard, is_unpublished }; MAX_DEVICES])
    }

    /// Takes a report of one device in. Says too whether it replaced one of its kind that no input has carried.
    pub(crate) fn on_report(
        &mut self,
        device: usize,
        bytes: &[u8],
        stamp_ns: i64,
    ) -> Result<(HidReport, bool), Refusal> {
        let one = self.one(device);
        let report = one.decoder.on_report(bytes)?;
        one.is_unheard = false;
        let kind_idx = match report {
            HidReport::Translation(_) => 0,
            HidReport::Rotation(_) => 1,
            HidReport::Motion(_) => 2,
            HidReport::Buttons(_) | HidReport::Battery { .. } => {
                one.held_over &= one.decoder.buttons();
                one.monitor.on_other(stamp_ns);
                return Ok((report, false));
            }
        };
        one.has_axes = true;
        one.monitor.on_motion(one.decoder.axes() != [0; 6], stamp_ns);
        Ok((report, std::mem::replace(&mut one.is_unpublished[kind_idx], true)))
    }

    /// An input has carried everything so far.
    pub(crate) fn on_published(&mut self) {
        self.0.iter_mut().for_each(|one| one.is_unpublished = [false; 3]);
    }

    /// One device is gone.
    pub(crate) fn on_unplugged(&mut self, device: usize) {
        self.one(device).monitor.on_unplugged();
    }

    /// One device is there again: nothing is known of its axes and buttons.
    pub(crate) fn on_plugged(&mut self, device: usize) {
        let one = self.one(device);
        one.monitor.on_plugged();
        one.decoder.forget_device();
        // A hand controller has axes, whether it has told of them or not.
        (one.held_over, one.is_unheard) = (0, one.has_axes || device == 0);
    }

    /// Every device begins anew.
    pub(crate) fn on_restarted(&mut self) {
        (0..MAX_DEVICES).for_each(|device| self.on_plugged(device));
    }

    /// The hand is lost: what is held now counts only from its next press.
    pub(crate) fn lose(&mut self) {
        self.0.iter_mut().for_each(|one| one.held_over |= one.decoder.buttons());
    }

    /// What is known of all of them together: lost while any is; else as the liveliest of those that have spoken.
    pub(crate) fn state(&self, now_ns: i64) -> DeviceState {
        let states = self.0.map(|one| one.monitor.state(now_ns));
        let told = [DeviceState::Lost, DeviceState::Live, DeviceState::AtRest];
        told.into_iter().find(|state| states.contains(state)).unwrap_or(DeviceState::Waiting)
    }

    /// Whether every device with axes that was plugged in again has spoken since.
    pub(crate) fn are_heard(&self) -> bool {
        self.0.iter().all(|one| !one.is_unheard)
    }

    /// Buttons that are down and count.
    pub(crate) fn buttons(&self) -> u32 {
        self.0.iter().fold(0, |bits, one| bits | one.decoder.buttons() & !one.held_over)
    }

    /// The axes, counts. Each comes from one device; where a foreign recording has two for one, it is their sum, within the limits of one.
    pub(crate) fn axes(&self) -> [i16; 6] {
        const LIMIT: i16 = AXIS_LIMIT_COUNTS + AXIS_MARGIN_COUNTS;
        self.0.iter().fold([0; 6], |mut axes: [i16; 6], one| {
            for (sum, counts) in axes.iter_mut().zip(one.decoder.axes()) {
                *sum = sum.saturating_add(counts).clamp(-LIMIT, LIMIT);
            }
            axes
        })
    }

    /// What was decoded and refused of all of them.
    pub(crate) fn counts(&self) -> ReportCounts {
        self.0.iter().fold(ReportCounts::default(), |sum, one| sum.plus(one.decoder.counts()))
    }

    fn one(&mut self, device: usize) -> &mut OneDevice {
        &mut self.0[device.min(MAX_DEVICES - 1)]
    }
}

#[cfg(test)]
mod tests;
