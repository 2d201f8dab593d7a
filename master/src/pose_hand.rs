//! A hand that a pose sender follows, as a device: who may send, when the hand holds, and what motion it asks for. Pure.
//!
//! The packets say where the hand is, and nothing else: no number, no stamp, no checksum. So nothing rests on one of them.
//! The hand holds while its gripper is closed, and must be seen open first, after every loss and every jump. What counts is
//! how the pose changes from packet to packet while it holds; where it is never matters.
//!
//! The changes stretch a spring: s += change / (v_hand T), |s| at most 1, for the way and for the turn. The tip moves at what
//! the response curve makes of the stretch, and that much of it is spent: ds/dt = -r(s) / T.
//! where: s: stretch, as a part of the full one, like a deflection; v_hand: the hand's speed that asks for the full speed;
//! T: time to follow in, s; r: dead zone and curve, so that the tip's speed is v_full r(s).
//! Intuition: the way that the hand has gone is the way that the tip goes, times v_full / v_hand, whatever the curve, and
//! whether packets come evenly or in bursts; a hand that is faster than v_hand loses the rest, and no more than the stretch
//! is still to be made up for when the hand stands still.

use crate::{PoseConfig, PosePacket, PoseRefusal, Response};
use krait_ipc::message::{DeviceState, OperatorInput};
use std::net::SocketAddr;

/// How unevenly packets may arrive without a pose counting as a jump, s.
const UNEVEN_S: f64 = 0.01;

/// Follows one pose sender.
#[derive(Clone, Copy, Debug)]
pub struct PoseHand {
    config: PoseConfig,
    sender: Option<Sender>,
    is_closed: bool,
    must_open_first: bool,
    is_lost: bool,
    has_jumped: bool,
    // x, y, z, rx, ry, rz in the sender's frame, as parts of the full stretch.
    stretch: [f64; 6],
    tick_ns: Option<i64>,
    n_taken: u64,
    n_refused: [u64; PoseRefusal::ALL.len()],
}

/// The sender that counts, and its newest packet.
#[derive(Clone, Copy, Debug)]
struct Sender {
    address: SocketAddr,
    stamp_ns: i64,
    pose: PosePacket,
}

/// What the hand asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PoseMotion {
    /// Velocity of the tip in the view frame, m/s.
    pub(crate) tip_vel_in_view_m_per_s: [f64; 3],
    /// Angular velocity of the tip in the view frame, rad/s.
    pub(crate) tip_angular_vel_in_view_rad_per_s: [f64; 3],
    /// Whether the hand holds.
    pub(crate) is_held: bool,
}

impl PoseHand {
    /// A hand of which nothing has been heard.
    pub fn new(config: PoseConfig) -> Self {
        Self {
            config,
            sender: None,
            is_closed: false,
            must_open_first: true,
            is_lost: false,
            has_jumped: false,
            stretch: [0.0; 6],
            tick_ns: None,
            n_taken: 0,
            n_refused: [0; PoseRefusal::ALL.len()],
        }
    }

    /// Takes a packet that was in hand at `now_ns`. The first valid one makes its sender the one that counts.
    ///
    /// # Errors
    /// [`PoseRefusal`], which is also counted. A refused packet renews nothing.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_packet(&mut self, bytes: &[u8], address: SocketAddr, now_ns: i64) -> Result<(), PoseRefusal> {
        self.watch(now_ns);
        let judged = self.judge(bytes, address, now_ns);
        match judged {
            Ok(()) => self.n_taken += 1,
            Err(refusal) => self.n_refused[refusal as usize] += 1,
        }
        judged
    }

    /// Notes whether the sender has been silent for too long, and whether another may take its place.
    pub fn watch(&mut self, now_ns: i64) {
        let Some(sender) = self.sender else { return };
        let silence_ns = now_ns.saturating_sub(sender.stamp_ns);
        if silence_ns > self.config.lease_ns() {
            self.lose();
        }
        // By now the hand no longer holds: the lease is shorter.
        if silence_ns > self.config.release_ns() {
            self.sender = None;
        }
    }

    /// The hand cannot be heard any more.
    pub fn lose(&mut self) {
        self.is_lost = true;
        self.let_go();
    }

    /// Another recording, or the same one anew: nothing is known of the hand.
    pub fn forget(&mut self) {
        let (n_taken, n_refused) = (self.n_taken, self.n_refused);
        *self = Self { n_taken, n_refused, tick_ns: self.tick_ns, ..Self::new(self.config) };
    }

    /// What the hand asks for from now until the next call.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub(crate) fn step(&mut self, response: &Response, now_ns: i64) -> PoseMotion {
        let since_ns = self.tick_ns.replace(now_ns).unwrap_or(now_ns);
        let part = (now_ns.saturating_sub(since_ns) as f64 * 1e-9 / self.config.follow_s).clamp(0.0, 1.0);
        let followed = response.follow(self.stretch);
        for (stretch, spent) in self.stretch.iter_mut().zip(followed.spent) {
            *stretch -= part * spent;
        }
        PoseMotion {
            tip_vel_in_view_m_per_s: followed.tip_vel_in_view_m_per_s,
            tip_angular_vel_in_view_rad_per_s: followed.tip_angular_vel_in_view_rad_per_s,
            is_held: self.is_held(),
        }
    }

    /// Whether the hand holds.
    pub fn is_held(&self) -> bool {
        self.is_closed && !self.must_open_first
    }

    /// The bits of [`OperatorInput::flags`] besides presence.
    pub(crate) fn flags(&self) -> u32 {
        if self.has_jumped { OperatorInput::HAND_JUMPED } else { 0 }
    }

    /// What is known of the sender.
    pub fn state(&self) -> DeviceState {
        match self.sender {
            _ if self.is_lost => DeviceState::Lost,
            None => DeviceState::Waiting,
            Some(_) if self.is_held() => DeviceState::Live,
            Some(_) => DeviceState::AtRest,
        }
    }

    /// The stretch, as counts of the device's axes.
    pub(crate) fn raw_axes(&self) -> [i16; 6] {
        self.stretch.map(|part| (part * f64::from(crate::AXIS_LIMIT_COUNTS)).round() as i16)
    }

    /// Bit 0 while the gripper is closed.
    pub(crate) fn buttons(&self) -> u32 {
        u32::from(self.is_closed)
    }

    /// Packets that counted, and packets that were refused.
    pub fn counts(&self) -> (u64, u64) {
        (self.n_taken, self.n_refused.iter().sum())
    }

    /// Packets that were refused for one reason.
    pub fn n_refused(&self, refusal: PoseRefusal) -> u64 {
        self.n_refused[refusal as usize]
    }

    fn judge(&mut self, bytes: &[u8], address: SocketAddr, now_ns: i64) -> Result<(), PoseRefusal> {
        if self.sender.is_some_and(|sender| sender.address != address) {
            return Err(PoseRefusal::AnotherSender);
        }
        let pose = PosePacket::decode(bytes, self.config.unit_m)?;
        let before = self.sender.replace(Sender { address, stamp_ns: now_ns, pose });
        if before.is_none() {
            self.let_go();
        }
        self.is_lost = false;
        let was_held = self.is_held();
        self.is_closed = self.config.is_closed(pose.gripper, self.is_closed);
        if !self.is_closed {
            (self.must_open_first, self.has_jumped) = (false, false);
            self.stretch = [0.0; 6];
        }
        match before {
            Some(before) if was_held && self.is_held() => self.on_change(&before, &pose, now_ns),
            _ => Ok(()),
        }
    }

    fn on_change(&mut self, before: &Sender, pose: &PosePacket, now_ns: i64) -> Result<(), PoseRefusal> {
        let config = self.config;
        let way_m: [f64; 3] = std::array::from_fn(|k| (pose.position[k] - before.pose.position[k]) * config.unit_m);
        let turn_rad = pose.turn_from_rad(&before.pose);
        let most_s = now_ns.saturating_sub(before.stamp_ns) as f64 * 1e-9 + UNEVEN_S;
        if norm(way_m) > config.jump_m_per_s * most_s || norm(turn_rad) > config.jump_rad_per_s * most_s {
            self.has_jumped = true;
            self.let_go();
            return Err(PoseRefusal::Jumped);
        }
        let (ways, turns) = self.stretch.split_at_mut(3);
        stretch_by(ways, way_m, config.full_hand_m_per_s * config.follow_s);
        stretch_by(turns, turn_rad, config.full_hand_rad_per_s * config.follow_s);
        Ok(())
    }

    /// The hand no longer holds, and must be seen open before it does again.
    fn let_go(&mut self) {
        self.must_open_first = true;
        self.stretch = [0.0; 6];
    }
}

/// Adds a change to a stretch, which is never longer than 1.
fn stretch_by(stretch: &mut [f64], change: [f64; 3], full: f64) {
    for (stretch, change) in stretch.iter_mut().zip(change) {
        *stretch += change / full;
    }
    let length = stretch.iter().map(|part| part * part).sum::<f64>().sqrt();
    if length > 1.0 {
        for part in stretch {
            *part /= length;
        }
    }
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests;
