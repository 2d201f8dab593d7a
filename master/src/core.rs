//! The master without its process: reports and instants in, `OperatorInput` out. Pure, so that a replay gives the same bytes.

use crate::grip::Grip;
use crate::hand_devices::HandDevices;
use crate::live_motion::{LiveMotion, Presses};
use crate::operator::{flags, jaw_flags};
use crate::pad::{PadLease, PadRefusal};
use crate::{Hand, HidReport, MasterConfig, MasterError, Operator, OperatorMotion, Refusal};
use crate::{PoseHand, PoseRefusal, ReportCounts, Response, ScriptSample};
use krait_ipc::message::{DeviceState, DriveWish, HopStamps, MotionWish, OperatorInput};
use std::net::SocketAddr;

/// Everything that the master knows between two inputs.
#[derive(Clone, Copy, Debug)]
pub struct MasterCore {
    devices: HandDevices,
    operator: Operator,
    grip: Grip,
    script: Option<ScriptSample>,
    pad: Option<(PadLease, Response)>,
    pose: Option<(PoseHand, Response)>,
    is_ended: bool,
    is_given_back: bool,
    presses: Presses,
    live: LiveMotion,
    sequence: u64,
    n_drained: u64,
}

impl MasterCore {
    /// A master that has heard nothing yet.
    ///
    /// # Errors
    /// [`MasterError::Config`] for a setting out of range.
    pub fn new(config: &MasterConfig) -> Result<Self, MasterError> {
        config.check()?;
        Ok(Self {
            devices: HandDevices::new(config.silence_limit_ns()),
            operator: Operator::new(config),
            grip: Grip::new(config.engage),
            script: None,
            pad: None,
            pose: None,
            is_ended: false,
            is_given_back: false,
            presses: Presses::new(config),
            live: config.begin,
            sequence: 0,
            n_drained: 0,
        })
    }

    /// The same master with a page's drive pad for its device.
    ///
    /// # Errors
    /// As [`MasterCore::new`].
    pub fn with_pad(config: &MasterConfig) -> Result<Self, MasterError> {
        Ok(Self { pad: Some((PadLease::default(), Response::new(config))), ..Self::new(config)? })
    }

    /// Takes what a page's drive pad said, which was in hand at `now_ns`.
    ///
    /// # Errors
    /// [`PadRefusal`], which is also counted; a master without a pad refuses all.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_pad(&mut self, wish: &DriveWish, now_ns: i64) -> Result<(), PadRefusal> {
        self.pad.as_mut().ok_or(PadRefusal::OutOfRange).and_then(|(lease, _)| lease.on_wish(wish, now_ns))
    }

    /// The same master with a pose sender's hand for its device.
    ///
    /// # Errors
    /// As [`MasterCore::new`].
    pub fn with_pose(config: &MasterConfig) -> Result<Self, MasterError> {
        Ok(Self { pose: Some((PoseHand::new(config.pose), Response::new(config))), ..Self::new(config)? })
    }

    /// Takes a pose sender's packet, which was in hand at `now_ns`.
    ///
    /// # Errors
    /// [`PoseRefusal`], which is also counted; a master without a pose sender refuses all.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_packet(&mut self, bytes: &[u8], sender: SocketAddr, now_ns: i64) -> Result<(), PoseRefusal> {
        let pose = self.pose.as_mut().ok_or(PoseRefusal::UnknownKind);
        pose.and_then(|(hand, _)| hand.on_packet(bytes, sender, now_ns))
    }

    /// How many packets were refused for which reason.
    pub fn refused_packets(&self) -> impl Iterator<Item = (PoseRefusal, u64)> {
        let hand = self.pose.as_ref().map(|(hand, _)| hand);
        hand.into_iter().flat_map(|hand| PoseRefusal::ALL.map(|refusal| (refusal, hand.n_refused(refusal))))
    }

    /// Notes whether the slave says that the operator has engaged.
    pub fn note_engaged(&mut self, is_engaged: bool) {
        self.grip.note_engaged(is_engaged);
    }

    /// Takes another scale or lock into force, from the next input on; a wish for what there is not changes nothing. Where the
    /// snake is to be stays where it is: both only change how fast that moves.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_wish(&mut self, wish: &MotionWish) {
        self.live.wish(wish);
    }

    /// Takes one raw report in that was in hand at `stamp_ns`. A motion report that replaces one of its kind before any input has carried it makes that one
    /// drained; button reports are never drained, each is acted upon.
    ///
    /// # Errors
    /// [`Refusal`], which is also counted; the state is then as before.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_report(&mut self, bytes: &[u8], stamp_ns: i64) -> Result<HidReport, Refusal> {
        self.on_report_of(0, bytes, stamp_ns)
    }

    /// The same of one of the hand's devices: 0 is the hand controller, 1 to 3 are those beside it; a higher number counts as 3.
    ///
    /// # Errors
    /// As [`MasterCore::on_report`].
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_report_of(&mut self, device: usize, bytes: &[u8], stamp_ns: i64) -> Result<HidReport, Refusal> {
        self.watch(stamp_ns);
        let (report, is_drained) = self.devices.on_report(device, bytes, stamp_ns)?;
        self.n_drained += u64::from(is_drained);
        if let HidReport::Buttons(_) = report {
            let pressed = self.operator.on_buttons(self.devices.buttons());
            self.live.press(&self.presses, pressed);
        }
        Ok(report)
    }

    /// The button that has set a mark since the last call, if one has.
    pub fn take_mark(&mut self) -> Option<u8> {
        self.operator.take_mark()
    }

    /// Counts reports that were thrown away unread because newer ones pressed on. A press may have been among them, so
    /// presence is dropped.
    pub fn on_drained(&mut self, n_reports: u64) {
        self.n_drained += n_reports;
        self.lose();
    }

    /// The device is gone.
    pub fn on_unplugged(&mut self) {
        self.on_unplugged_of(0);
    }

    /// One of the hand's devices is gone, and with it the hand.
    pub fn on_unplugged_of(&mut self, device: usize) {
        if let Some((lease, _)) = &mut self.pad {
            lease.lose();
        }
        if let Some((hand, _)) = &mut self.pose {
            hand.lose();
        }
        self.devices.on_unplugged(device);
        self.lose();
    }

    /// The device's user has given it back: lost, and that for good.
    pub fn on_given_back(&mut self) {
        self.is_given_back = true;
        self.on_unplugged();
    }

    /// A device is there again: nothing is known of its axes and buttons.
    pub fn on_plugged(&mut self) {
        self.on_plugged_of(0);
    }

    /// One of the hand's devices is there again. Presence must be given anew, also by those that were there all the time.
    pub fn on_plugged_of(&mut self, device: usize) {
        if let Some((hand, _)) = &mut self.pose {
            hand.forget();
        }
        self.devices.on_plugged(device);
        self.lose();
    }

    /// A script says directly what the operator asks for; its limits were checked when it was read.
    pub fn on_script(&mut self, sample: ScriptSample) {
        self.script = Some(sample);
    }

    /// The recording or script is at its end: from now on no motion and no presence.
    pub fn on_ended(&mut self) {
        self.is_ended = true;
        if let Some((hand, _)) = &mut self.pose {
            hand.lose();
        }
    }

    /// The recording or script begins again.
    pub fn on_restarted(&mut self) {
        self.is_ended = false;
        self.devices.on_restarted();
        self.on_plugged();
    }

    /// What the operator asks for at an instant, as the next message; its hop stamps still hold only `device_ns`.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_tick(&mut self, now_ns: i64) -> OperatorInput {
        self.watch(now_ns);
        self.devices.on_published();
        self.sequence += 1;
        let device = self.device_state(now_ns);
        let mut motion = self.motion(device, now_ns);
        if !self.grip.holds(motion.flags & OperatorInput::OPERATOR_PRESENT != 0, now_ns) {
            motion.flags &= !(OperatorInput::OPERATOR_PRESENT | OperatorInput::JAW_OPENS | OperatorInput::JAW_CLOSES);
            motion.tip_vel_in_view_m_per_s = [0.0; 3];
            motion.tip_angular_vel_in_view_rad_per_s = [0.0; 3];
        }
        let (n_reports, n_refused) = self.n_reports_and_refused();
        OperatorInput {
            sequence: self.sequence,
            sample_ns: now_ns,
            stamps: HopStamps { device_ns: now_ns, ..HopStamps::default() },
            tip_vel_in_view_m_per_s: self
                .live
                .scaled(motion.tip_vel_in_view_m_per_s, OperatorInput::TRANSLATION_LOCKED),
            tip_angular_vel_in_view_rad_per_s: self
                .live
                .scaled(motion.tip_angular_vel_in_view_rad_per_s, OperatorInput::ROTATION_LOCKED),
            raw_axes: self.raw_axes(),
            flags: motion.flags | self.live.locks | if self.is_given_back { OperatorInput::GIVEN_BACK } else { 0 },
            buttons: self.pose.as_ref().map_or(self.devices.buttons(), |(hand, _)| hand.buttons()),
            device_state: device as u32,
            scale_permille: self.live.scale_permille,
            n_reports,
            n_drained: self.n_drained,
            n_refused,
        }
    }

    /// What was decoded and refused so far.
    pub fn counts(&self) -> ReportCounts {
        self.devices.counts()
    }

    /// Notes a loss before anything else happens at this instant, even if the process slept while the device was silent.
    fn watch(&mut self, now_ns: i64) {
        if let Some((lease, _)) = &mut self.pad {
            lease.watch(now_ns);
        }
        if let Some((hand, _)) = &mut self.pose {
            hand.watch(now_ns);
        }
        if self.is_given_back || self.devices.state(now_ns) == DeviceState::Lost {
            self.lose();
        }
    }

    fn lose(&mut self) {
        self.devices.lose();
        self.operator.on_loss();
    }

    fn device_state(&self, now_ns: i64) -> DeviceState {
        match (&self.pad, &self.pose, self.script) {
            _ if self.is_ended => DeviceState::Ended,
            // What another device of the hand still says ends nothing.
            _ if self.is_given_back => DeviceState::Lost,
            (Some((lease, _)), ..) => lease.state(),
            (None, Some((hand, _)), _) => hand.state(),
            (None, None, Some(_)) => DeviceState::Live,
            (None, None, None) => self.devices.state(now_ns),
        }
    }

    fn raw_axes(&self) -> [i16; 6] {
        if let Some((hand, _)) = &self.pose {
            return hand.raw_axes();
        }
        let Some((lease, _)) = &self.pad else { return self.devices.axes() };
        // A deflection is at most a thousand thousandths.
        let [x, y] = lease.deflection_permille().unwrap_or_default().map(|permille| permille as i16);
        [x, y, 0, 0, 0, 0]
    }

    fn n_reports_and_refused(&self) -> (u64, u64) {
        let decoded = self.devices.counts();
        let of_hand = self.pose.as_ref().map(|(hand, _)| hand.counts());
        let of_pad = self.pad.as_ref().map(|(lease, _)| lease.counts());
        of_hand.or(of_pad).unwrap_or((decoded.n_decoded, decoded.n_refused()))
    }

    fn motion(&mut self, device: DeviceState, now_ns: i64) -> OperatorMotion {
        if let Some((hand, response)) = &mut self.pose {
            let asked = hand.step(response, now_ns);
            return OperatorMotion {
                tip_vel_in_view_m_per_s: asked.tip_vel_in_view_m_per_s,
                tip_angular_vel_in_view_rad_per_s: asked.tip_angular_vel_in_view_rad_per_s,
                flags: flags(asked.is_held, false) | hand.flags(),
            };
        }
        if let Some((lease, response)) = &self.pad {
            let (held, [opens, closes]) = (lease.deflection_permille(), lease.jaw());
            return OperatorMotion {
                tip_vel_in_view_m_per_s: held.map_or([0.0; 3], |held| response.pad_vel_in_view_m_per_s(held)),
                tip_angular_vel_in_view_rad_per_s: [0.0; 3],
                flags: flags(held.is_some(), false) | jaw_flags(opens, closes) | OperatorInput::FROM_PAD,
            };
        }
        match self.script {
            Some(sample) if !self.is_ended => {
                let (tip_vel_in_view_m_per_s, tip_angular_vel_in_view_rad_per_s) = sample.effective();
                let jaw = sample.effective_jaw();
                let flags = flags(sample.is_present, sample.is_clutched) | jaw_flags(jaw > 0, jaw < 0);
                OperatorMotion { tip_vel_in_view_m_per_s, tip_angular_vel_in_view_rad_per_s, flags }
            }
            _ => self.operator.step(&Hand {
                axes: self.devices.axes(),
                buttons: self.devices.buttons(),
                device,
                is_heard: self.devices.are_heard(),
            }),
        }
    }
}

#[cfg(test)]
mod tests;
