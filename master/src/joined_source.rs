//! Several live devices that are one hand: each has a thread of its own, and what they say comes in the order of its stamps.

use crate::decode::with_buttons;
use crate::evdev_host::EvdevHost;
use crate::hid::{HidHost, SystemHost};
use crate::lights::Lights;
use crate::source::sleep_until;
use crate::spacenavd::SpacenavHost;
use crate::{DeviceChoice, HidSource, JoinedHand, Layout, MasterConfig, MasterError, ReportSource, SourceEvent};
use crossbeam_channel::{Receiver, RecvTimeoutError, bounded};
use krait_ipc::clock;
use std::path::PathBuf;
use std::time::Duration;

/// Reads a hand controller and the devices beside it.
#[derive(Debug)]
pub struct JoinedSource {
    /// Each with its oldest event that was not handed on; the hand controller is the first.
    devices: Vec<(HidSource, Option<SourceEvent>)>,
    /// The hand controller's buttons that count.
    kept_buttons: u32,
    /// A token where any of them has something to say.
    wake: Receiver<()>,
    /// The newest stamp that was handed on: none runs backwards, so that a recording of them is what the core has met.
    newest_ns: i64,
    is_given_back: bool,
}

impl JoinedSource {
    /// Opens every device of a configuration; all must be there.
    ///
    /// # Errors
    /// As [`JoinedHand::read`], and for each device as [`HidSource::open`], [`HidSource::open_profile`] or
    /// [`HidSource::open_spacenavd`]; [`MasterError::SameDevice`] where two profiles are of one device.
    pub fn open(config: &MasterConfig) -> Result<Self, MasterError> {
        let joined = JoinedHand::read(config)?;
        let kept_buttons = joined.kept_buttons();
        let mut nodes: Vec<(PathBuf, &str)> = Vec::new();
        for profile in joined.profiles() {
            let node = EvdevHost { profile: profile.clone() }.node()?;
            if let Some((_, first)) = nodes.iter().find(|(other, _)| *other == node) {
                let [first, second] = [*first, &profile.name].map(|name| format!("{name:?}"));
                return Err(MasterError::SameDevice { first, second, node });
            }
            nodes.push((node, &profile.name));
        }
        let hand: Box<dyn HidHost> = match (joined.hand, &config.spacenavd) {
            (Some(profile), _) => Box::new(EvdevHost { profile }),
            (None, Some(socket)) => Box::new(SpacenavHost { socket: socket.clone() }),
            (None, None) => Box::new(SystemHost),
        };
        let mut hosts = vec![hand];
        hosts.extend(joined.beside.into_iter().map(|profile| Box::new(EvdevHost { profile }) as Box<dyn HidHost>));
        Self::open_on(hosts, &config.device, kept_buttons)
    }

    fn open_on(hosts: Vec<Box<dyn HidHost>>, choice: &DeviceChoice, kept_buttons: u32) -> Result<Self, MasterError> {
        let (sender, wake) = bounded(1);
        let opened = hosts.into_iter().map(|host| Ok((HidSource::open_joined(host, choice, sender.clone())?, None)));
        let devices = opened.collect::<Result<_, MasterError>>()?;
        Ok(Self { devices, kept_buttons, wake, newest_ns: i64::MIN, is_given_back: false })
    }

    /// The device whose event is next: what has no stamp at once, else the oldest.
    fn next_device(&mut self, now_ns: i64) -> Option<usize> {
        let mut next = None;
        for (device, (source, waiting)) in self.devices.iter_mut().enumerate() {
            if waiting.is_none() {
                *waiting = source.next_event(now_ns);
            }
            let due_ns = match waiting {
                None => continue,
                Some(SourceEvent::HidReport { stamp_ns, .. } | SourceEvent::Plug { stamp_ns, .. }) => *stamp_ns,
                Some(_) => i64::MIN,
            };
            if next.is_none_or(|(oldest_ns, _)| due_ns < oldest_ns) {
                next = Some((due_ns, device));
            }
        }
        next.map(|(_, device)| device)
    }
}

impl ReportSource for JoinedSource {
    fn start(&mut self, _now_ns: i64) {}

    fn wait_until(&mut self, deadline_ns: i64) {
        let left_ns = deadline_ns.saturating_sub(clock::monotonic_ns());
        let has_event = self.devices.iter().any(|(source, waiting)| waiting.is_some() || source.has_event());
        if left_ns <= 0 || (has_event && !self.is_given_back) {
            return;
        }
        match self.wake.recv_timeout(Duration::from_nanos(left_ns.unsigned_abs())) {
            Ok(()) | Err(RecvTimeoutError::Timeout) => {}
            // No thread is left that could wake anybody.
            Err(RecvTimeoutError::Disconnected) => sleep_until(deadline_ns),
        }
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        if self.is_given_back {
            return None;
        }
        let device = self.next_device(now_ns)?;
        Some(match self.devices[device].1.take()? {
            SourceEvent::HidReport { stamp_ns, report, .. } => {
                self.newest_ns = stamp_ns.max(self.newest_ns);
                let report = if device == 0 { with_buttons(report, self.kept_buttons) } else { report };
                SourceEvent::HidReport { device, stamp_ns: self.newest_ns, report }
            }
            // The hand is over, whichever device was given back: the others are not held any longer either.
            SourceEvent::GivenBack => {
                self.is_given_back = true;
                self.devices.iter().for_each(|(source, _)| source.let_go());
                SourceEvent::GivenBack
            }
            SourceEvent::Plug { stamp_ns, plug, .. } => {
                self.newest_ns = stamp_ns.max(self.newest_ns);
                SourceEvent::Plug { device, stamp_ns: self.newest_ns, plug }
            }
            other => other,
        })
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        self.devices.first().and_then(|(hand, _)| hand.vid_pid())
    }

    fn beside(&self) -> Vec<(u16, u16)> {
        self.devices.iter().skip(1).filter_map(|(source, _)| source.vid_pid()).collect()
    }

    fn show(&mut self, lights: Lights) {
        self.devices.iter_mut().for_each(|(source, _)| source.show(lights));
    }

    fn layout(&self) -> Option<Layout> {
        self.devices.first().and_then(|(hand, _)| hand.layout())
    }
}

#[cfg(test)]
mod tests;
