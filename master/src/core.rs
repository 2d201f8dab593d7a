//! The master without its process: reports and instants in, `OperatorInput` out. Pure, so that a replay gives the same bytes.

use crate::grip::Grip;
use crate::live_motion::{LiveMotion, Presses};
use crate::operator::{flags, jaw_flags};
use crate::pad::{PadLease, PadRefusal};
use crate::{Decoder, DeviceMonitor, Hand, HidReport, MasterConfig, MasterError, Operator, OperatorMotion, Refusal};
use crate::{PoseHand, PoseRefusal, ReportCounts, Response, ScriptSample};
use krait_ipc::message::{DeviceState, DriveWish, HopStamps, MotionWish, OperatorInput};
use std::net::SocketAddr;

/// Everything that the master knows between two inputs.
#[derive(Clone, Copy, Debug)]
pub struct MasterCore {
    decoder: Decoder,
    monitor: DeviceMonitor,
    operator: Operator,
    grip: Grip,
    script: Option<ScriptSample>,
    pad: Option<(PadLease, Response)>,
    pose: Option<(PoseHand, Response)>,
    is_ended: bool,
    presses: Presses,
    live: LiveMotion,
    sequence: u64,
    n_drained: u64,
    // Kinds of motion report (translation, rotation, both) that no input has carried yet.
    is_unpublished: [bool; 3],
}

impl MasterCore {
    /// A master that has heard nothing yet.
    ///
    /// # Errors
    /// [`MasterError::Config`] for a setting out of range.
    pub fn new(config: &MasterConfig) -> Result<Self, MasterError> {
        config.check()?;
        Ok(Self {
            decoder: Decoder::default(),
            monitor: DeviceMonitor::new(config.silence_limit_ns()),
            operator: Operator::new(config),
            grip: Grip::new(config.engage),
            script: None,
            pad: None,
            pose: None,
            is_ended: false,
            presses: Presses::new(config),
            live: config.begin,
            sequence: 0,
            n_drained: 0,
            is_unpublished: [false; 3],
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
        self.watch(stamp_ns);
        let report = self.decoder.on_report(bytes)?;
        match report {
            HidReport::Translation(_) => self.on_motion(0, stamp_ns),
            HidReport::Rotation(_) => self.on_motion(1, stamp_ns),
            HidReport::Motion(_) => self.on_motion(2, stamp_ns),
            HidReport::Buttons(buttons) => {
                let pressed = self.operator.on_buttons(buttons);
                self.live.press(&self.presses, pressed);
                self.monitor.on_other(stamp_ns);
            }
            HidReport::Battery { .. } => self.monitor.on_other(stamp_ns),
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
        if let Some((lease, _)) = &mut self.pad {
            lease.lose();
        }
        if let Some((hand, _)) = &mut self.pose {
            hand.lose();
        }
        self.monitor.on_unplugged();
        self.lose();
    }

    /// A device is there again: nothing is known of its axes and buttons.
    pub fn on_plugged(&mut self) {
        self.monitor.on_plugged();
        if let Some((hand, _)) = &mut self.pose {
            hand.forget();
        }
        self.decoder.forget_device();
        self.operator.on_loss();
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
        self.on_plugged();
    }

    /// What the operator asks for at an instant, as the next message; its hop stamps still hold only `device_ns`.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_tick(&mut self, now_ns: i64) -> OperatorInput {
        self.watch(now_ns);
        self.is_unpublished = [false; 3];
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
            flags: motion.flags | self.live.locks,
            buttons: self.pose.as_ref().map_or(self.decoder.buttons(), |(hand, _)| hand.buttons()),
            device_state: device as u32,
            scale_permille: self.live.scale_permille,
            n_reports,
            n_drained: self.n_drained,
            n_refused,
        }
    }

    /// What was decoded and refused so far.
    pub fn counts(&self) -> &ReportCounts {
        self.decoder.counts()
    }

    fn on_motion(&mut self, kind_idx: usize, now_ns: i64) {
        self.n_drained += u64::from(self.is_unpublished[kind_idx]);
        self.is_unpublished[kind_idx] = true;
        self.monitor.on_motion(self.decoder.axes() != [0; 6], now_ns);
    }

    /// Notes a loss before anything else happens at this instant, even if the process slept while the device was silent.
    fn watch(&mut self, now_ns: i64) {
        if let Some((lease, _)) = &mut self.pad {
            lease.watch(now_ns);
        }
        if let Some((hand, _)) = &mut self.pose {
            hand.watch(now_ns);
        }
        if self.monitor.state(now_ns) == DeviceState::Lost {
            self.lose();
        }
    }

    fn lose(&mut self) {
        self.decoder.forget_buttons();
        self.operator.on_loss();
    }

    fn device_state(&self, now_ns: i64) -> DeviceState {
        match (&self.pad, &self.pose, self.script) {
            _ if self.is_ended => DeviceState::Ended,
            (Some((lease, _)), ..) => lease.state(),
            (None, Some((hand, _)), _) => hand.state(),
            (None, None, Some(_)) => DeviceState::Live,
            (None, None, None) => self.monitor.state(now_ns),
        }
    }

    fn raw_axes(&self) -> [i16; 6] {
        if let Some((hand, _)) = &self.pose {
            return hand.raw_axes();
        }
        let Some((lease, _)) = &self.pad else { return self.decoder.axes() };
        // A deflection is at most a thousand thousandths.
        let [x, y] = lease.deflection_permille().unwrap_or_default().map(|permille| permille as i16);
        [x, y, 0, 0, 0, 0]
    }

    fn n_reports_and_refused(&self) -> (u64, u64) {
        let decoded = self.decoder.counts();
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
            _ => self.operator.step(&Hand { axes: self.decoder.axes(), buttons: self.decoder.buttons(), device }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn core() -> MasterCore {
        MasterCore::new(&MasterConfig { engage: crate::Engage::Once, ..MasterConfig::default() })
            .expect("default configuration")
    }

    fn push(core: &mut MasterCore, x_counts: i16, now_ns: i64) {
        core.on_report(HidReport::Translation([x_counts, 0, 0]).encode().as_bytes(), now_ns).expect("report");
    }

    fn press(core: &mut MasterCore, buttons: u32, now_ns: i64) {
        core.on_report(HidReport::Buttons(buttons).encode().as_bytes(), now_ns).expect("report");
    }

    #[test]
    fn only_reports_replaced_before_an_input_carried_them_are_drained() {
        let mut core = core();
        push(&mut core, 1, 0);
        core.on_report(HidReport::Rotation([1, 0, 0]).encode().as_bytes(), 0).expect("the other half");
        assert_eq!(core.on_tick(0).n_drained, 0, "the halves do not replace each other");
        for x in 0..5 {
            push(&mut core, x, MS);
        }
        press(&mut core, 1, MS);
        press(&mut core, 0, MS);
        let input = core.on_tick(MS);
        assert_eq!((input.n_drained, input.raw_axes[0], input.n_reports), (4, 4, 9), "the newest wins");
        assert!(input.operator_present(), "a press between two inputs is not missed");
    }

    #[test]
    fn silence_while_deflected_stops_motion_and_drops_presence_for_good() {
        let mut core = core();
        press(&mut core, 1, 0);
        push(&mut core, 300, 0);
        assert!(core.on_tick(MS).tip_vel_in_view_m_per_s[0] > 0.0);
        let lost = core.on_tick(101 * MS);
        assert_eq!((lost.device(), lost.flags, lost.buttons), (Some(DeviceState::Lost), 0, 0));
        assert_eq!(lost.tip_vel_in_view_m_per_s, [0.0; 3]);
        push(&mut core, 300, 110 * MS);
        let back = core.on_tick(110 * MS);
        assert_eq!((back.device(), back.operator_present()), (Some(DeviceState::Live), false));
    }

    #[test]
    fn a_loss_that_the_process_slept_through_still_drops_presence() {
        let mut core = core();
        press(&mut core, 1, 0);
        push(&mut core, 300, 0);
        push(&mut core, 300, 900 * MS);
        assert!(!core.on_tick(900 * MS).operator_present());
    }

    #[test]
    fn an_ended_recording_means_no_motion_and_no_presence_even_while_deflected() {
        let mut core = core();
        press(&mut core, 1, 0);
        push(&mut core, 300, 0);
        core.on_ended();
        let input = core.on_tick(MS);
        assert_eq!((input.device(), input.flags), (Some(DeviceState::Ended), 0));
        assert_eq!(input.tip_vel_in_view_m_per_s, [0.0; 3]);
    }

    #[test]
    fn the_hands_own_buttons_turn_fine_motion_and_locks_on_and_off_once_for_each_press() {
        let press_of = crate::PressButton::Press;
        let config = MasterConfig {
            fine: press_of(3),
            lock_translation: press_of(4),
            lock_rotation: press_of(5),
            engage: crate::Engage::Once,
            ..MasterConfig::default()
        };
        let mut core = MasterCore::new(&config).expect("a configuration");
        press(&mut core, 1, 0);
        push(&mut core, 300, 0);
        let whole = core.on_tick(MS);
        let mut after = |buttons| {
            press(&mut core, buttons, MS);
            core.on_tick(MS)
        };
        let fine = after(1 | 1 << 3);
        assert_eq!(fine.scale_permille, 250);
        assert_eq!(fine.tip_vel_in_view_m_per_s, whole.tip_vel_in_view_m_per_s.map(|v| v * 0.25));
        assert_eq!(after(1 | 1 << 3).scale_permille, 250, "held is not pressed again");
        assert_eq!(after(1).scale_permille, 250);
        let locked = after(1 | 1 << 4 | 1 << 5);
        let both = OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED;
        assert_eq!((locked.flags & both, locked.tip_vel_in_view_m_per_s), (both, [0.0; 3]));
        after(1);
        let free = after(1 | 1 << 3 | 1 << 4 | 1 << 5);
        assert_eq!((free.scale_permille, free.flags & both), (1000, 0));
        assert_eq!(free.tip_vel_in_view_m_per_s, whole.tip_vel_in_view_m_per_s);
    }

    #[test]
    fn scale_and_locks_change_velocity_and_nothing_else_and_nonsense_changes_nothing() {
        let mut core = core();
        press(&mut core, 1, 0);
        push(&mut core, 300, 0);
        let whole = core.on_tick(MS);
        let mut after = |lock, unlock, scale_permille| {
            core.on_wish(&MotionWish { sequence: 1, sample_ns: 0, scale_permille, lock, unlock, sender_pid: 1 });
            core.on_tick(MS)
        };
        let half = after(0, 0, 500);
        assert_eq!(half.tip_vel_in_view_m_per_s[0], whole.tip_vel_in_view_m_per_s[0] / 2.0);
        assert_eq!((half.scale_permille, half.raw_axes, half.flags), (500, whole.raw_axes, whole.flags));
        let locked = after(OperatorInput::TRANSLATION_LOCKED, 0, 0);
        assert_eq!((locked.tip_vel_in_view_m_per_s, locked.scale_permille), ([0.0; 3], 500));
        assert_eq!(locked.flags, whole.flags | OperatorInput::TRANSLATION_LOCKED);
        for (lock, unlock, scale) in [(1, 0, 0), (0, 2, 0), (4, 4, 0), (0, 0, 1001), (0, 0, 9)] {
            let same = after(lock, unlock, scale);
            assert_eq!((same.flags, same.scale_permille), (locked.flags, locked.scale_permille));
        }
        let turned = |core: &mut MasterCore, lock, unlock| {
            core.on_wish(&MotionWish { sequence: 1, sample_ns: 0, scale_permille: 500, lock, unlock, sender_pid: 1 });
            core.on_report(HidReport::Rotation([350, 0, 0]).encode().as_bytes(), MS).expect("report");
            core.on_tick(MS).tip_angular_vel_in_view_rad_per_s
        };
        let open = after(0, MotionWish::LOCKS, 1000);
        assert_eq!((open.tip_vel_in_view_m_per_s, open.flags), (whole.tip_vel_in_view_m_per_s, whole.flags));
        let half_turn = MasterConfig::default().full_turn_rad_per_s / 2.0;
        assert_eq!(turned(&mut core, 0, 0), [half_turn, 0.0, 0.0]);
        assert_eq!(turned(&mut core, OperatorInput::ROTATION_LOCKED, 0), [0.0; 3]);
        assert_eq!(turned(&mut core, 0, MotionWish::LOCKS), [half_turn, 0.0, 0.0]);
    }

    #[test]
    fn a_pad_moves_the_tip_the_way_the_camera_sees_while_it_is_held_and_not_a_tick_longer_than_its_lease() {
        let config = MasterConfig { engage: crate::Engage::Once, ..MasterConfig::default() };
        let mut core = MasterCore::with_pad(&config).expect("default configuration");
        let wish = |frame, ms: i64, flags, deflection_permille| {
            let (sequence, sample_ns) = (frame, ms * MS);
            DriveWish { sequence, sample_ns, page: 1, frame, sender_pid: 7, flags, deflection_permille }
        };
        let waiting = core.on_tick(0);
        assert_eq!((waiting.device(), waiting.flags), (Some(DeviceState::Waiting), OperatorInput::FROM_PAD));
        core.on_pad(&wish(1, 0, 0, [1000, 0]), 0).expect("off the pad");
        assert_eq!(core.on_tick(0).tip_vel_in_view_m_per_s, [0.0; 3]);
        let full = config.full_speed_m_per_s;
        for (frame, (deflection, moves)) in [
            ([1000, 0], [full, 0.0, 0.0]),
            ([-1000, 0], [-full, 0.0, 0.0]),
            ([0, 1000], [0.0, full, 0.0]),
            ([0, -1000], [0.0, -full, 0.0]),
        ]
        .into_iter()
        .enumerate()
        {
            core.on_pad(&wish(frame as u64 + 2, 10, DriveWish::HELD, deflection), 10 * MS).expect("held");
            let input = core.on_tick(10 * MS);
            assert_eq!((input.tip_vel_in_view_m_per_s, input.operator_present()), (moves, true));
            assert_eq!(input.raw_axes[..2].iter().map(|axis| i32::from(*axis)).collect::<Vec<_>>(), deflection);
        }
        let jaw = OperatorInput::JAW_OPENS | OperatorInput::JAW_CLOSES;
        for (frame, asks, told) in [
            (6, DriveWish::JAW_OPENS, OperatorInput::JAW_OPENS),
            (7, DriveWish::JAW_CLOSES, OperatorInput::JAW_CLOSES),
            (8, DriveWish::JAW_OPENS | DriveWish::JAW_CLOSES, jaw),
        ] {
            core.on_pad(&wish(frame, 10, DriveWish::HELD | asks, [0; 2]), 10 * MS).expect("held");
            assert_eq!(core.on_tick(10 * MS).flags & jaw, told, "the jaw as it is asked");
        }
        let mut off = core;
        off.on_pad(&wish(9, 10, DriveWish::JAW_OPENS, [0; 2]), 10 * MS).expect("off the pad");
        assert_eq!(off.on_tick(10 * MS).flags, OperatorInput::FROM_PAD, "a jaw that nobody holds");
        let n_present = (11..400).take_while(|ms| core.on_tick(ms * MS).operator_present()).count();
        assert_eq!(n_present, 150, "ticks after the instant of the newest frame");
        let lost = core.on_tick(400 * MS);
        assert_eq!((lost.device(), lost.flags, lost.n_reports), (Some(DeviceState::Lost), OperatorInput::FROM_PAD, 8));
        assert_eq!((lost.tip_vel_in_view_m_per_s, lost.raw_axes), ([0.0; 3], [0; 6]));
        let mut without = self::core();
        assert_eq!(without.on_pad(&wish(1, 0, 0, [0, 0]), 0), Err(PadRefusal::OutOfRange), "another device");
    }

    #[test]
    fn inputs_are_numbered_without_gaps_whatever_happens_between_them() {
        let mut core = core();
        for k in 1..=50_u64 {
            assert!(core.on_report(&[7, 7], 0).is_err());
            core.on_unplugged();
            core.on_plugged();
            let input = core.on_tick(k as i64 * MS);
            assert_eq!((input.sequence, input.n_refused), (k, k));
        }
    }
}
