//! CANopen drives of the profile CiA 402 on SocketCAN: targets of all, SYNC, one answer of each, once a period.
//!
//! Problem: a drive that froze wakes up and runs after stale targets, one that lost its power has forgotten how it was
//! configured and where its zero is, and a bus has no master but the one that says so.
//!
//! Intuition: each SYNC is answered once. No answer is silence, two are a drive that is not in step; emergencies and
//! heartbeats explain and judge nothing. A drive that has left Operation Enabled gets quick stops until power is switched
//! anew. Each drive listens for this program's heartbeat and stops by itself without it.
//!
//! Failure: a drive that says it has started anew is configured again, without power, and its count is another. After the
//! interface was gone, or where a drive has been silent, that is done when power is switched anew, as at the beginning.
//!
//! Source: CiA 301 and CiA 402-2, -3.

mod emergencies;
mod frame;
mod home;
mod node;
mod open;
pub(crate) mod port;
mod scan;
mod sdo;
mod states;
pub(crate) mod steps;
mod wire;

pub use frame::Frame;
pub use home::home_here;
pub(crate) use open::setup;
pub use open::{open_drive, open_drive_on};
pub use port::{CanListener, CanPort, interfaces};
pub use scan::{CanReading, FoundDrive, scan};
pub use states::{State, has_torque, state};
pub use wire::Wire;

pub(crate) use frame::{FROM_DRIVE, HEARTBEAT, MASTER, OPERATIONAL, PRE_OPERATIONAL, SDO_FROM, SDO_TO, SYNC, TO_DRIVE};

use crate::bus::{ActuatorBus, BusGone, Goals, Seen};
use crate::texts::{OTHER_DRIVES, SECOND_MASTER};
use frame::{Heard, beat, hear, tell};
use krait_ipc::message::MAX_ACTUATORS;
use node::{Node, Order};

/// Frames that are taken at once before a cycle; who sends more is heard in the next.
const MOST_WAITING: usize = 1024;

/// Drives on one CAN interface.
#[derive(Debug)]
pub struct Cia402<W> {
    wire: W,
    nodes: Vec<Node>,
    goals: Goals,
    /// What the next cycle tells.
    order: Order,
    /// What the newest cycle told.
    told: Order,
    /// Cycles that power has been on its way for.
    n_tried: u32,
    timeout_ns: i64,
    lost_cycles: u32,
    heartbeat_ns: i64,
    beat_due_ns: i64,
    /// Without a cycle for so long the drives have stopped by themselves, or are about to.
    gives_up_ns: i64,
    cycled_ns: i64,
    /// What somebody else did that only a master does.
    other_master: Option<&'static str>,
    /// The wire has failed and was not opened since: drives may have stopped by themselves or lost their power unheard.
    is_wire_gone: bool,
}

impl<W: Wire> Cia402<W> {
    /// Takes a frame from the bus.
    fn take(&mut self, frame: &Frame) {
        match hear(frame) {
            Heard::Node(id, said) => {
                let now_ns = self.wire.now_ns();
                if let Some(node) = self.nodes.iter_mut().find(|node| node.id == id) {
                    node.hear(said, now_ns);
                }
            }
            Heard::Master(what) => self.other_master = Some(what),
            Heard::Other => {}
        }
    }

    /// Takes what has arrived already.
    fn drain(&mut self) -> Result<(), BusGone> {
        for _ in 0..MOST_WAITING {
            let Some(frame) = self.wire.receive(i64::MIN)? else { break };
            self.take(&frame);
        }
        Ok(())
    }

    fn beat_if_due(&mut self, now_ns: i64) -> Result<(), BusGone> {
        if now_ns >= self.beat_due_ns {
            self.wire.send(&beat())?;
            self.beat_due_ns = now_ns + self.heartbeat_ns;
        }
        Ok(())
    }

    /// Whom this program was away from for too long must not go on as if nothing had been.
    fn notice_own_absence(&mut self, now_ns: i64) {
        let away_ns = now_ns.saturating_sub(self.cycled_ns);
        if self.order == Order::Follow && away_ns > self.gives_up_ns / 2 {
            self.nodes.iter_mut().for_each(Node::leave_out);
        }
        self.cycled_ns = now_ns;
    }

    /// Targets, configurations that are under way, a heartbeat where one is due, SYNC.
    fn send_all(&mut self, now_ns: i64) -> Result<(), BusGone> {
        for (k, node) in self.nodes.iter_mut().enumerate() {
            if let Some(frame) = node.advance(now_ns) {
                self.wire.send(&frame)?;
            }
            if node.is_configured() && self.order != Order::Ask {
                self.wire.send(&tell(node.id, node.control(self.order, self.n_tried), self.goals.counts[k]))?;
            }
        }
        self.beat_if_due(now_ns)?;
        self.wire.send(&Frame::new(SYNC, &[]))
    }

    /// Receives until all have answered, or time is over.
    fn collect(&mut self, until_ns: i64) -> Result<(), BusGone> {
        while self.nodes.iter().any(|node| node.n_answers == 0) {
            let Some(frame) = self.wire.receive(until_ns)? else { break };
            self.take(&frame);
            // Whoever floods the bus does not stop the cycle.
            if self.wire.now_ns() >= until_ns {
                break;
            }
        }
        Ok(())
    }

    /// One exchange with all drives.
    fn exchange(&mut self) -> Result<(), BusGone> {
        self.drain()?;
        let now_ns = self.wire.now_ns();
        self.notice_own_absence(now_ns);
        self.nodes.iter_mut().for_each(|node| node.n_answers = 0);
        self.send_all(now_ns)?;
        self.collect(now_ns.saturating_add(self.timeout_ns))
    }

    /// Names a drive that turned out to be another one, once.
    fn name_stranger(&mut self) -> Result<(), BusGone> {
        for (k, node) in self.nodes.iter_mut().enumerate() {
            if let Some(refusal) = node.take_stranger() {
                tracing::warn!("{}", open::refused(k + 1, node.id, refusal));
                return Err(BusGone { what: OTHER_DRIVES });
            }
        }
        Ok(())
    }

    /// Says of a drive that is lost, once, that it lives all the same: that is another thing than a cable.
    fn tell_lives(&mut self) {
        let after_ns = self.timeout_ns.saturating_mul(i64::from(self.lost_cycles));
        for (k, node) in self.nodes.iter_mut().enumerate() {
            if let Some(state) = node.take_life(self.lost_cycles, after_ns) {
                let (actuator, id) = (k + 1, node.id);
                tracing::warn!(
                    "drive {actuator} (id {id}) does not answer, but its heartbeat still comes: it lives and takes no part in cycles (state {state}); `clear-fault` configures it anew"
                );
            }
        }
    }

    /// Says each new code of an emergency once, also where the status word shows no failure and nothing stops.
    fn tell_emergencies(&mut self) {
        for (k, node) in self.nodes.iter_mut().enumerate() {
            while let Some((code, is_last)) = node.emergencies.take_next() {
                tracing::warn!("{}", emergencies::sentence(k + 1, node.id, code, is_last));
            }
        }
    }

    fn fill(&self, seen: &mut Seen) {
        seen.has_answered = [false; MAX_ACTUATORS];
        // The profile has no object for the one, and the other is in no cyclic frame.
        (seen.temperature_celsius, seen.supply_v) = ([f64::NAN; MAX_ACTUATORS], [f64::NAN; MAX_ACTUATORS]);
        for (k, node) in self.nodes.iter().enumerate() {
            (seen.n_boots[k], seen.is_busy[k]) = (node.n_boots, node.is_busy());
            seen.emergency_code[k] = node.emergency();
            if !node.has_answered() {
                // One that has started anew has no power, whatever it said before.
                seen.is_powered[k] &= node.is_configured();
                continue;
            }
            seen.has_answered[k] = true;
            (seen.sampled_ns[k], seen.counts[k]) = (node.sampled_ns, node.counts);
            // It has answered this SYNC: it has what came before it.
            seen.goal_counts[k] = self.goals.counts[k];
            seen.is_powered[k] = node.is_powered(self.told);
            seen.trouble[k] = node.trouble(self.told, self.n_tried);
            seen.has_let_go[k] = !has_torque(node.status);
            let is_known = node.rated_torque_nm > 0.0;
            seen.torque_nm[k] = if is_known { f64::from(node.torque) * 1e-3 * node.rated_torque_nm } else { f64::NAN };
        }
    }
}

impl<W: Wire> ActuatorBus for Cia402<W> {
    fn n_actuators(&self) -> usize {
        self.nodes.len()
    }

    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone> {
        (self.order, self.goals) = (Order::Follow, *goals);
        Ok(())
    }

    fn switch(&mut self, on: bool, goals: &Goals) -> Result<(), BusGone> {
        if !on {
            self.order = Order::Off;
            return Ok(());
        }
        if self.told != Order::Switch {
            self.n_tried = 0;
            self.nodes.iter_mut().for_each(Node::begin_switching);
        }
        (self.order, self.goals) = (Order::Switch, *goals);
        Ok(())
    }

    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone> {
        if let Err(gone) = self.exchange() {
            // An interface that is up again by itself must not let them go on.
            self.nodes.iter_mut().for_each(Node::leave_out);
            self.is_wire_gone = true;
            return Err(gone);
        }
        self.told = core::mem::replace(&mut self.order, Order::Ask);
        for node in &mut self.nodes {
            node.end_cycle(self.told, self.lost_cycles);
        }
        self.tell_lives();
        self.tell_emergencies();
        self.fill(seen);
        self.n_tried = self.n_tried.saturating_add(1);
        // Named once: the drives are told to stop meanwhile.
        match self.other_master.take() {
            Some(_) => Err(BusGone { what: SECOND_MASTER }),
            None => self.name_stranger(),
        }
    }

    /// All are identified and configured from the beginning, cycle by cycle. Where only another master or a stranger was named, the
    /// drives are there, and their power must go at once where somebody asks for that.
    fn come_back(&mut self) -> Result<(), BusGone> {
        if !self.is_wire_gone {
            self.look_again();
            return Ok(());
        }
        self.wire.come_back()?;
        self.is_wire_gone = false;
        (self.order, self.told, self.other_master) = (Order::Ask, Order::Ask, None);
        self.nodes.iter_mut().for_each(Node::begin_over);
        Ok(())
    }

    fn look_again(&mut self) {
        for node in &mut self.nodes {
            if node.is_lost(self.lost_cycles) {
                node.begin_over();
            }
        }
    }
}

#[cfg(test)]
mod tests;
