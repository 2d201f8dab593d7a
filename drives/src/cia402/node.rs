//! One drive on the bus: its configuration step by step, and what it said last.

use super::emergencies::Emergencies;
use super::frame::{Frame, OPERATIONAL, PRE_OPERATIONAL, Said, manage};
use super::sdo::{Place, Reply, download, is_missing, reply, upload};
use super::states::{
    DISABLE_VOLTAGE, ENABLE, QUICK_STOP, State, has_torque, has_voltage, is_behind, is_enabled, is_failed, state,
    toward_enabled,
};
use super::steps::{MAX_MOTOR_SPEED, Need, Step, TURNS_PER_MINUTE, VELOCITY_UNIT};
use crate::bus::Trouble;
use crate::texts;

/// How long an answer about an object is waited for, ns.
const PATIENCE_NS: i64 = 100_000_000;
/// Times that a question is asked.
const TRIES: u32 = 3;
/// Cycles in which a failure may be reset while power comes.
const RESET_TRIES: u32 = 40;
/// Code of a trip whose reason no emergency has told: CiA 402's generic error.
const UNKNOWN: u16 = 0x1000;
/// CiA 402's code of a following error.
const BEHIND: u16 = 0x8611;

/// What is told to all drives in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Nothing: they are asked only.
    Ask,
    /// Power off.
    Off,
    /// Toward Operation Enabled, where they stand.
    Switch,
    /// Follow the targets.
    Follow,
    /// Home where they stand.
    Home,
}

/// Why a drive cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    Silent,
    Differs {
        place: Place,
        found: u32,
        expected: u32,
    },
    Aborted {
        place: Place,
        code: u32,
    },
    /// Turns a minute.
    TooSlow {
        most_per_min: u32,
        least_per_min: u32,
    },
}

/// A drive.
#[derive(Debug)]
pub(crate) struct Node {
    pub id: u8,
    steps: Vec<Step>,
    /// The next step.
    step: usize,
    /// When the question of the step was sent.
    asked_ns: Option<i64>,
    n_asked: u32,
    pub refusal: Option<Refusal>,
    /// Answers about objects that nobody asked for.
    pub n_stray: u32,
    pub rated_torque_nm: f64,
    /// What its numbers of velocities are; 0: it does not say.
    velocity_unit: u32,
    pub status: u16,
    pub counts: i32,
    pub torque: i16,
    pub sampled_ns: i64,
    /// When its newest heartbeat came, and the state of the network's management in it.
    beat: Option<(i64, u8)>,
    /// Whether it was said that it lives though it is lost.
    is_life_told: bool,
    /// Cyclic answers since the newest SYNC.
    pub n_answers: u32,
    n_missing: u32,
    /// It is not in step, or has left what it was told: it gets quick stops until power is switched anew.
    is_out: bool,
    /// More than one answer in a cycle.
    is_double: bool,
    pub n_boots: u32,
    emergency: u16,
    /// Whether it has said since that this is over.
    is_emergency_over: bool,
    /// What of its emergencies was said.
    pub emergencies: Emergencies,
    /// It has said under power that its power stage has voltage; not every drive says so.
    has_had_voltage: bool,
    /// It is another one than configured, or refuses what it must do; not yet named.
    is_stranger: bool,
    /// Others are homed, and this one gets no power meanwhile.
    pub stands_by: bool,
}

impl Node {
    pub(crate) fn new(id: u8, steps: Vec<Step>, rated_torque_nm: f64) -> Self {
        Self {
            id,
            steps,
            step: 0,
            asked_ns: None,
            n_asked: 0,
            refusal: None,
            n_stray: 0,
            rated_torque_nm,
            velocity_unit: 0,
            status: 0,
            counts: 0,
            torque: 0,
            sampled_ns: 0,
            beat: None,
            is_life_told: false,
            n_answers: 0,
            n_missing: 0,
            is_out: false,
            is_double: false,
            n_boots: 0,
            emergency: 0,
            is_emergency_over: false,
            emergencies: Emergencies::default(),
            has_had_voltage: false,
            is_stranger: false,
            stands_by: false,
        }
    }

    pub(crate) fn is_configured(&self) -> bool {
        self.step == self.steps.len()
    }

    /// Goes through the configuration from its begin, where that has failed.
    fn begin_anew(&mut self) {
        if self.refusal.take().is_some() {
            (self.step, self.asked_ns, self.n_asked) = (0, None, 0);
        }
    }

    /// It is identified and configured from the beginning, and nothing of what it said before holds.
    pub(crate) fn begin_over(&mut self) {
        (self.step, self.asked_ns, self.n_asked, self.refusal) = (0, None, 0, None);
        (self.status, self.is_out, self.is_stranger) = (0, true, false);
        (self.n_missing, self.n_stray) = (0, 0);
    }

    /// Whether it has said nothing for so many cycles, or could not be configured.
    pub(crate) fn is_lost(&self, lost_cycles: u32) -> bool {
        self.refusal.is_some() || self.n_missing >= lost_cycles
    }

    /// What it says of itself, where it counts as lost and a heartbeat came so long after its newest answer.
    pub(crate) fn life(&self, lost_cycles: u32, after_ns: i64) -> Option<&'static str> {
        let (heard_ns, state) = self.beat.filter(|_| self.n_missing >= lost_cycles)?;
        (heard_ns.saturating_sub(self.sampled_ns) > after_ns).then_some(match state {
            PRE_OPERATIONAL => "pre-operational",
            OPERATIONAL => "operational",
            4 => "stopped",
            _ => "of a kind that CANopen does not have",
        })
    }

    /// The same, once while it is lost.
    pub(crate) fn take_life(&mut self, lost_cycles: u32, after_ns: i64) -> Option<&'static str> {
        let life = self.life(lost_cycles, after_ns).filter(|_| !self.is_life_told);
        self.is_life_told = self.n_missing > 0 && (self.is_life_told || life.is_some());
        life
    }

    /// Whether it is being identified and configured.
    pub(crate) fn is_busy(&self) -> bool {
        !self.is_configured() && self.refusal.is_none()
    }

    /// Why it is no drive of the configuration, once.
    pub(crate) fn take_stranger(&mut self) -> Option<Refusal> {
        if core::mem::take(&mut self.is_stranger) { self.refusal } else { None }
    }

    /// What has to be sent next to configure it.
    pub(crate) fn advance(&mut self, now_ns: i64) -> Option<Frame> {
        if self.refusal.is_some() {
            return None;
        }
        let step = *self.steps.get(self.step)?;
        if self.asked_ns.is_some_and(|asked_ns| now_ns.saturating_sub(asked_ns) < PATIENCE_NS) {
            return None;
        }
        if self.n_asked == TRIES {
            self.refusal = Some(Refusal::Silent);
            return None;
        }
        if let Step::Manage(command) = step {
            self.done();
            return Some(manage(self.id, command));
        }
        (self.asked_ns, self.n_asked) = (Some(now_ns), self.n_asked + 1);
        Some(match step {
            Step::Write { place, value, n_bytes, .. } => download(self.id, place, value, n_bytes),
            Step::Expect { place, .. } | Step::RatedTorque { place } => upload(self.id, place),
            Step::VelocityUnit => upload(self.id, VELOCITY_UNIT),
            Step::MotorSpeed { .. } => upload(self.id, MAX_MOTOR_SPEED),
            Step::Manage(command) => manage(self.id, command),
        })
    }

    fn done(&mut self) {
        (self.step, self.asked_ns, self.n_asked) = (self.step + 1, None, 0);
    }

    /// Takes what it says of itself.
    pub(crate) fn hear(&mut self, said: Said, now_ns: i64) {
        match said {
            Said::BootUp => {
                self.n_boots = self.n_boots.wrapping_add(1);
                (self.step, self.asked_ns, self.n_asked, self.refusal) = (0, None, 0, None);
                (self.status, self.is_out) = (0, true);
            }
            Said::Heartbeat(state) => self.beat = Some((now_ns, state)),
            Said::Emergency(code) => {
                self.is_emergency_over = code == 0;
                if code != 0 {
                    self.emergency = code;
                }
                self.emergencies.hear(code);
            }
            Said::Cyclic { status, counts, torque } => {
                self.n_answers = self.n_answers.saturating_add(1);
                if self.n_answers > 1 {
                    (self.is_double, self.is_out) = (true, true);
                }
                (self.status, self.counts, self.torque, self.sampled_ns) = (status, counts, torque, now_ns);
                self.has_had_voltage |= is_enabled(status) && has_voltage(status);
            }
            Said::Object(data) => self.hear_object(data),
        }
    }

    fn hear_object(&mut self, data: [u8; 8]) {
        let step = self.steps.get(self.step).copied().filter(|_| self.asked_ns.is_some());
        let place = match step {
            Some(Step::Expect { place, .. } | Step::RatedTorque { place } | Step::Write { place, .. }) => place,
            Some(Step::VelocityUnit) => VELOCITY_UNIT,
            Some(Step::MotorSpeed { .. }) => MAX_MOTOR_SPEED,
            _ => return self.n_stray = self.n_stray.saturating_add(1),
        };
        let Some(reply) = reply(data, place) else { return self.n_stray = self.n_stray.saturating_add(1) };
        match (step, reply) {
            (Some(Step::Expect { mask, value: expected, .. }), Reply::Value(found)) if found & mask != expected => {
                self.refuse(Refusal::Differs { place, found: found & mask, expected });
            }
            (Some(Step::RatedTorque { .. }), Reply::Value(milli)) if self.rated_torque_nm == 0.0 => {
                self.rated_torque_nm = f64::from(milli) * 1e-3;
                self.done();
            }
            (Some(Step::VelocityUnit), reply) => {
                self.velocity_unit = if let Reply::Value(unit) = reply { unit } else { 0 };
                self.done();
            }
            // 0 is no limit that anybody has told.
            (Some(Step::MotorSpeed { least_per_min }), Reply::Value(most_per_min))
                if self.velocity_unit == TURNS_PER_MINUTE && (1..least_per_min).contains(&most_per_min) =>
            {
                self.refuse(Refusal::TooSlow { most_per_min, least_per_min });
            }
            (Some(Step::RatedTorque { .. } | Step::MotorSpeed { .. }), _) => self.done(),
            (
                Some(Step::Expect { need: Need::May, .. } | Step::Write { need: Need::May, .. }),
                Reply::Aborted(code),
            ) if is_missing(code) => self.done(),
            (_, Reply::Aborted(code)) => self.refuse(Refusal::Aborted { place, code }),
            _ => self.done(),
        }
    }

    fn refuse(&mut self, refusal: Refusal) {
        (self.refusal, self.is_stranger) = (Some(refusal), true);
    }

    /// Power is switched anew: what failed before is forgiven.
    pub(crate) fn begin_switching(&mut self) {
        (self.is_out, self.is_double, self.n_missing, self.emergency) = (false, false, 0, 0);
        self.has_had_voltage = false;
        self.emergencies.begin_anew();
        self.begin_anew();
    }

    /// It gets quick stops until power is switched anew.
    pub(crate) fn leave_out(&mut self) {
        self.is_out = true;
    }

    /// The control word of a cycle.
    pub(crate) fn control(&self, order: Order, n_tried: u32) -> u16 {
        match order {
            _ if self.stands_by => DISABLE_VOLTAGE,
            Order::Ask | Order::Off => DISABLE_VOLTAGE,
            Order::Switch => toward_enabled(self.status, n_tried),
            Order::Follow if self.is_out => QUICK_STOP,
            Order::Follow => ENABLE,
            Order::Home => super::states::BEGIN_HOMING,
        }
    }

    /// Ends a cycle: one that is silent for long or has left Operation Enabled is never let on by itself.
    pub(crate) fn end_cycle(&mut self, order: Order, lost_cycles: u32) {
        let is_silent = self.n_answers == 0 && self.is_configured();
        self.n_missing = if is_silent { self.n_missing.saturating_add(1) } else { 0 };
        // Only a warning is over: the code of a failure names it until power is switched anew.
        if self.is_emergency_over && self.n_answers > 0 && is_enabled(self.status) && !self.is_out {
            (self.emergency, self.is_emergency_over) = (0, false);
        }
        if order != Order::Follow {
            return;
        }
        self.is_out |= self.n_missing >= lost_cycles || (self.n_answers > 0 && !is_enabled(self.status));
    }

    /// Code of the newest emergency that stands; 0: none.
    pub(crate) fn emergency(&self) -> u16 {
        self.emergency
    }

    /// Whether it has answered the newest SYNC; once or not is its trouble.
    pub(crate) fn has_answered(&self) -> bool {
        self.n_answers > 0 && self.is_configured()
    }

    /// Whether it is under power: follows, where power is wished for; may have torque, where it is not.
    pub(crate) fn is_powered(&self, order: Order) -> bool {
        match order {
            Order::Ask | Order::Off => has_torque(self.status),
            Order::Switch | Order::Follow | Order::Home => is_enabled(self.status),
        }
    }

    /// What it complains of, in a cycle of an order.
    pub(crate) fn trouble(&self, order: Order, n_tried: u32) -> Trouble {
        let code = if self.emergency == 0 { UNKNOWN } else { self.emergency };
        let tripped = |code, meaning| Trouble::Tripped { code, meaning };
        if is_failed(self.status) {
            let is_resetting = order == Order::Switch && n_tried < RESET_TRIES;
            return match is_resetting {
                true => Trouble::None,
                false if is_external(self.emergency) => Trouble::HardwareStop { code },
                false => tripped(code, meaning(self.emergency)),
            };
        }
        if order != Order::Follow {
            return Trouble::None;
        }
        match state(self.status) {
            _ if self.is_double => tripped(UNKNOWN, texts::OUT_OF_STEP),
            State::OperationEnabled if is_behind(self.status) => tripped(BEHIND, texts::FOLLOWING),
            State::OperationEnabled => Trouble::None,
            _ if is_external(self.emergency) => Trouble::HardwareStop { code },
            State::QuickStopActive => tripped(code, texts::QUICK_STOPPED),
            _ if self.is_cut_off() => Trouble::HardwareStop { code: self.emergency },
            _ => tripped(code, texts::LEFT),
        }
    }

    /// Whether it has left Operation Enabled in the way of CiA 402 for hardware that takes the power away: to Switch On Disabled,
    /// or without voltage where it had some, with no failure told and nobody having asked.
    fn is_cut_off(&self) -> bool {
        let is_off = state(self.status) == State::SwitchOnDisabled;
        let lost_voltage = self.has_had_voltage && !has_voltage(self.status);
        self.emergency == 0 && (is_off || lost_voltage)
    }
}

/// Whether an error code is of CiA 301's class of external errors, as a drive tells an emergency stop.
pub(super) fn is_external(code: u16) -> bool {
    (0x9000..=0x90FF).contains(&code)
}

/// What an error code of CiA 402 means.
pub(super) fn meaning(code: u16) -> &'static str {
    match code {
        0x2000..=0x2FFF => texts::CURRENT,
        0x3000..=0x3FFF => texts::VOLTAGE,
        0x4000..=0x4FFF => texts::HEAT,
        0x7300..=0x73FF => texts::SENSOR,
        0x8100..=0x81FF => texts::COMMUNICATION,
        0x8600..=0x86FF => texts::FOLLOWING,
        _ => texts::OF_ITS_OWN,
    }
}
