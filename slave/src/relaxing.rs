//! Power off without a spring: whoever asks for `disable` while lines are loaded has them relaxed first.
//!
//! Problem: drives that let go of loaded lines let the snake spring, and how far is its lines' stretch.
//! Intuition: still under power, a motion is braked, then the actuators give way to their own lines ([`crate::GivingWay`]), then power
//! goes. Meanwhile the state is PAUSED with DISABLED desired, and the reason is "relaxing".
//!
//! | what comes in between | what becomes of it |
//! |---|---|
//! | a limit stops a line | its group stays, the others go on |
//! | every load is below `relax_n`, or way, limits or loads allow nothing more | brake, power goes |
//! | a load or the state of a drive is not known | brake, power goes; from the start: power goes at once |
//! | a stop, a pause | brake, power goes |
//! | `disable` again | nothing changes, the time runs on |
//! | a fault: a drive fails, or does not follow | power goes at once; FAULT names it |
//! | `disable_relax_ms` are over | power goes, whatever moves |
//!
//! Failure: a slave that is not ticked does nothing; its drives' own watchdog is then what is left.

use crate::{ActuatorState, Drive, Findings, GivingWay, SlaveCore, TransitionRefused};
use krait_ipc::message::{Actuators, MAX_ACTUATORS, OperatingState, Transition};

/// The drives are told once in so long, ns.
const TICK_NS: i64 = 1_000_000;

/// Power was asked off, and the lines come first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LettingGo {
    way: GivingWay,
    /// Nothing gives way any more: at rest, power goes.
    is_over: bool,
}

impl<D: Drive> SlaveCore<D> {
    /// Power off, as anybody may ask: where lines are loaded they are relaxed first, by [`SlaveCore::on_tick`].
    ///
    /// # Errors
    /// As [`SlaveCore::on_state_command`].
    ///
    /// # Real-time
    /// No allocation, no blocking, no clock.
    pub fn disable(&mut self, now_ns: i64) -> Result<(), TransitionRefused> {
        if self.letting_go.is_some() {
            return Ok(());
        }
        if !self.can_relax() {
            return self.transition(Transition::Disable, now_ns);
        }
        self.machine.let_go();
        self.engagement.clear(None);
        self.hold();
        self.letting_go = Some(LettingGo { way: GivingWay::new(self.relax, now_ns), is_over: false });
        Ok(())
    }

    /// Whether power was asked off and the lines come first.
    pub fn is_letting_go(&self) -> bool {
        self.letting_go.is_some()
    }

    /// Nothing gives way any more: what moves is braked, and at rest the power goes.
    pub fn stop_relaxing(&mut self) {
        if let Some(letting_go) = &mut self.letting_go {
            letting_go.is_over = true;
        }
    }

    /// Whether actuators give way to their loads, here or on the drives' own side.
    pub(crate) fn gives_way(&self) -> bool {
        self.letting_go.is_some() || self.reading.state.contains(&ActuatorState::Relaxing)
    }

    /// The largest load of actuators that hold each other, N; NaN where none is known. Whatever a gripper holds is let be.
    pub fn largest_load_n(&self) -> f64 {
        self.reading
            .tau_n
            .iter()
            .take(self.drive.traits().n_together)
            .fold(f64::NAN, |largest, tau| tau.abs().max(largest))
    }

    /// Whether there is something to relax, and everything is known that it takes.
    fn can_relax(&self) -> bool {
        let has_power = matches!(self.machine.state(), OperatingState::Enabled | OperatingState::Paused);
        let is_settled = has_power && self.machine.is_homed() && !self.is_busy();
        self.relaxes && is_settled && self.knows_lines() && self.largest_load_n() > self.relax.load_n
    }

    fn knows_lines(&self) -> bool {
        let n = self.drive.n_actuators();
        let are_on = self.reading.state.iter().take(n).all(|state| *state == ActuatorState::On);
        are_on && self.reading.tau_n.iter().take(n).all(|tau| tau.is_finite())
    }

    /// One tick of it.
    pub(crate) fn relax(&mut self, now_ns: i64) {
        let knows_lines = self.knows_lines();
        let (n, q_m, loads_n) = (self.drive.traits().n_together, self.gate.q_m(), self.reading.tau_n);
        let is_still = self.is_still();
        let Some(letting_go) = &mut self.letting_go else { return };
        let until_ns = letting_go.way.until_ns();
        // So that it is at rest when its time is over.
        letting_go.is_over |= !knows_lines || now_ns >= until_ns - self.relax.braking_ns() - 2 * TICK_NS;
        if !letting_go.is_over && (is_still || letting_go.way.has_begun()) {
            let loads_n = core::array::from_fn(|k| if k < n { loads_n[k] } else { 0.0 });
            match letting_go.way.step(q_m, loads_n, (now_ns, TICK_NS)) {
                Some(goal_m) => return self.give_way(goal_m, now_ns),
                None => letting_go.is_over = true,
            }
        }
        if now_ns >= until_ns || (letting_go.is_over && is_still) {
            // Drives that refuse have led to FAULT, which says so.
            let result = self.transition(Transition::Disable, now_ns);
            debug_assert!(result.is_ok() || self.machine.state() == OperatingState::Fault, "{result:?}");
        } else {
            self.brake(now_ns);
        }
    }

    /// Through the gate and the limiter like everything else. Lines of a group hold each other, so where a limit stops one of them its
    /// group stays; the other groups go on. Where these allow nothing it is over.
    fn give_way(&mut self, goal_m: Actuators, now_ns: i64) {
        let (situation, mut findings) = (self.situation(now_ns), Findings::default());
        let whole = self.gate.toward(goal_m, [0.0; MAX_ACTUATORS], now_ns, &mut findings);
        let parts = self.limiter.confine_groups(&situation, &whole.q_m, &mut findings);
        self.write(&self.gate.parts_of(&whole, &parts), now_ns);
        let from_m = situation.setpoint_q_m;
        if (0..MAX_ACTUATORS).all(|k| goal_m[k] == from_m[k] || parts[k] == 0.0) {
            self.stop_relaxing();
        }
        let q_m = self.gate.q_m();
        let Some(letting_go) = &mut self.letting_go else { return };
        for k in (0..MAX_ACTUATORS).filter(|k| parts[*k] < 1.0) {
            letting_go.way.go_on_from(k, q_m[k]);
        }
    }
}
