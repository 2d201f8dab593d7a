//! The slave without its process: commands, state commands, stops and ticks in, motion of the drives and reports out.
//!
//! Every method is a pure step on this state and the drive behind it; time is an argument. Rules that hold throughout:
//! - The drives move only when Enabled, homed, not busy and engaged, for a command in time that the limiter accepts and that
//!   follows the operator; and while a motion is being brought to rest or lines are relaxed. Every write passes the gate.
//! - After every hold (start, enable, pause, home, late commands, a command that asks to stand still) the first command that
//!   is executed begins at the setpoint.
//! - Whatever could surprise the operator ends the engagement: see [`crate::Engagement`].
//! - When commands stop coming in motion, the slave begins to brake at once, long before the watchdog declares them stale:
//!   so it is at rest within the watchdog's time.
//! - Whoever asks for `disable` while lines are loaded has them relaxed first: see `relaxing.rs`.
//! - The setpoint is seeded from the encoders when power comes on and when homing ends, because nothing else knows where
//!   the actuators are; after a pause and after stale commands it stays what was commanded, because the drives still hold
//!   that against their load.

use crate::gate::furthest;
use crate::gates::{Gates, Writes};
use crate::relaxing::LettingGo;
use crate::{
    ActuatorState, Drive, DriveError, DriveReading, Engagement, Findings, GateLimits, Homing, Limiter, LimiterVerdict,
    Note, OnDisable, OperatingMachine, RelaxLimits, Situation, SlaveConfig, Switching, TransitionRefused, Watchdog,
};
use krait_ipc::message::{Command, HopStamps, JointValues, MAX_JOINTS, OperatingState, StateCommand, Transition};
use krait_ipc::{Reason, Reasons};

/// Commands come every millisecond; half a period more without one and the slave begins to brake, ns.
pub(crate) const GAP_NS: i64 = 1_500_000;
/// What a command says of the way before it that ends an engagement: something was lost or stood still.
/// Or the model is not of this machine, or has no value.
const STALLS: [Reason; 7] = [
    Reason::DeviceLost,
    Reason::HandJumped,
    Reason::InputStale,
    Reason::SetpointStale,
    Reason::StateStale,
    Reason::MismatchTrip,
    Reason::FormulaFault,
];
/// What else keeps an operator from engaging, as a command tells it.
const HOLDS: [Reason; 3] = [Reason::OperatorAbsent, Reason::Clutched, Reason::InputEnded];

/// The slave's state and the drive it owns.
#[derive(Debug)]
pub struct SlaveCore<D> {
    pub(crate) drive: D,
    pub(crate) machine: OperatingMachine,
    pub(crate) limiter: Limiter,
    pub(crate) watchdog: Watchdog,
    pub(crate) gate: Gates,
    pub(crate) engagement: Engagement,
    origin: Origin,
    pub(crate) home_on_start: bool,
    /// Since when power is being switched on, ns.
    pub(crate) switching_since_ns: Option<i64>,
    motion: Motion,
    pub(crate) relax: RelaxLimits,
    /// Whether `disable` relaxes the lines.
    pub(crate) relaxes: bool,
    /// Power was asked off, and the lines come first.
    pub(crate) letting_go: Option<LettingGo>,
    pub(crate) setpoint_bend_rad: [f64; 2],
    pub(crate) setpoint_joints_rad: JointValues,
    /// Joints that the newest executed command was for.
    pub(crate) n_joints: u32,
    /// Where a gripper's wire was last told to be, m.
    pub(crate) jaw_wire_m: f64,
    pub(crate) reading: DriveReading,
    pub(crate) stamps: HopStamps,
    pub(crate) is_unstamped: bool,
    pub(crate) command_sequence: u64,
    /// Distance of the newest command from the setpoint that it has led to, m: of actuators that hold each other, and of one that
    /// stands alone.
    lag_m: [f64; 2],
    /// What the newest command met.
    pub(crate) command_findings: Findings,
    pub(crate) drive_error: Option<DriveError>,
    /// Whether a fault left the power on.
    pub(crate) has_kept_power: bool,
    pub(crate) sequence: u64,
    pub(crate) n_commands: u64,
    pub(crate) n_refused: u64,
    pub(crate) last_command_ns: i64,
    pub(crate) n_stops: u32,
    /// When the newest stop was asked for; what was asked for before it does not count any more.
    stop_ns: i64,
    pub(crate) state_command_sequence: u64,
    pub(crate) is_state_command_refused: bool,
}

/// Where commands come from: what may not change while the operator is engaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Origin {
    setpoint_sequence: u64,
    input_sequence: u64,
    model_hash: u64,
}

/// Whether commands are executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    /// Standing at the setpoint, or braking towards one: the next executed command must begin there.
    Held,
    /// Executing commands as they come.
    Following,
}

impl<D: Drive> SlaveCore<D> {
    /// A slave that is Disabled and does not know its zero. The configuration must have been checked.
    pub fn new(drive: D, config: &SlaveConfig) -> Self {
        let unread = core::array::from_fn(|k| if k < drive.n_actuators() { f64::NAN } else { 0.0 });
        Self {
            limiter: Limiter::new(config.limits.clone(), drive.n_actuators(), drive.traits().n_together)
                .with_groups(config.drive.groups())
                .with_own_loads(config.own_loads_n()),
            machine: OperatingMachine::default(),
            watchdog: Watchdog::new(config.watchdog_ms),
            gate: Gates::new(GateLimits::of(config), drive.traits().alone()),
            drive,
            engagement: Engagement::default(),
            origin: Origin::default(),
            home_on_start: config.home_on_start,
            switching_since_ns: None,
            motion: Motion::Held,
            relax: RelaxLimits::of_disable(config),
            relaxes: config.drive.on_disable == OnDisable::Relax,
            letting_go: None,
            setpoint_bend_rad: [0.0; 2],
            setpoint_joints_rad: [0.0; MAX_JOINTS],
            n_joints: 0,
            jaw_wire_m: 0.0,
            reading: DriveReading::at_once(0, 0, (unread, unread), ActuatorState::Off),
            stamps: HopStamps::default(),
            is_unstamped: false,
            command_sequence: 0,
            lag_m: [0.0; 2],
            command_findings: Findings::default(),
            drive_error: None,
            has_kept_power: false,
            sequence: 0,
            n_commands: 0,
            n_refused: 0,
            last_command_ns: 0,
            n_stops: 0,
            stop_ns: i64::MIN,
            state_command_sequence: 0,
            is_state_command_refused: false,
        }
    }

    /// The drive.
    pub fn drive(&self) -> &D {
        &self.drive
    }

    /// The drive, for its camera.
    pub fn drive_mut(&mut self) -> &mut D {
        &mut self.drive
    }

    /// Whether power is being switched on, or a search for zero is under way.
    pub fn is_busy(&self) -> bool {
        self.machine.is_busy() || self.is_switching()
    }

    /// What the drives measured when they were last read, with each actuator's instant and state.
    pub fn reading(&self) -> &DriveReading {
        &self.reading
    }

    /// Commands that were refused.
    pub fn n_refused(&self) -> u64 {
        self.n_refused
    }

    /// Whether commands are being executed.
    pub fn is_following(&self) -> bool {
        self.motion == Motion::Following
    }

    /// Whether the drives stand still as far as the slave is concerned.
    pub fn is_still(&self) -> bool {
        self.gate.is_still()
    }

    /// Whether the operator has engaged.
    pub fn is_engaged(&self) -> bool {
        self.engagement.is_engaged()
    }

    /// Whether the setpoint is the newest command, but for what the gate has yet to make up for: of actuators that hold each other, and
    /// of one that stands alone.
    pub(crate) fn follow_closely(&self) -> [bool; 2] {
        self.lag_m.map(|lag_m| self.is_following() && lag_m <= self.limiter.limits().engage_m)
    }

    /// Another process writes the commands from now on.
    pub fn on_new_writer(&mut self) {
        self.limiter.new_writer();
        self.disengage(Reason::StageRestarted, None);
    }

    /// Takes a command that was in hand at `now_ns`, and writes the drives if it is to be executed.
    ///
    /// # Real-time
    /// No allocation, no blocking, no clock.
    pub fn on_command(&mut self, command: &Command, now_ns: i64) {
        self.n_commands += 1;
        self.last_command_ns = now_ns;
        self.end_if_stale(now_ns);
        let mut findings = Findings::default();
        if !self.limiter.admits(command, now_ns, &mut findings) {
            if let Some(age) = findings.note_of(Reason::CommandStale) {
                self.disengage(Reason::ChainStalled, Some(age));
            }
            self.command_findings = findings;
            self.refuse(now_ns);
            return;
        }
        self.end_if_changed(command);
        let situation = self.situation(now_ns);
        match self.limiter.judge(command, &situation, &mut findings) {
            LimiterVerdict::Refuse => {
                if let Some(loads) = findings.note_of(Reason::LoadUnknown) {
                    self.disengage(Reason::LoadUnknown, Some(loads));
                }
                self.refuse(now_ns);
            }
            LimiterVerdict::Hold => {
                self.watchdog.feed(now_ns);
                self.motion = Motion::Held;
                self.rest(now_ns);
            }
            LimiterVerdict::Move => {
                self.watchdog.feed(now_ns);
                self.go(command, &situation, &mut findings);
            }
        }
        self.look_for_operator(command, now_ns, &mut findings);
        self.command_findings = findings;
    }

    fn refuse(&mut self, now_ns: i64) {
        self.n_refused += 1;
        self.lag_m = [f64::INFINITY; 2];
        self.rest(now_ns);
    }

    /// Writes the drives for a command, as far as gate, stroke and loads allow.
    fn go(&mut self, command: &Command, situation: &Situation, findings: &mut Findings) {
        let forecast = command.q_tilde_vel_m_per_s.map(|v| if v.is_finite() { v } else { 0.0 });
        let (fastest, rate) = furthest(&forecast, &self.gate.rates_m_per_s());
        if fastest > rate {
            findings.note(Reason::ActuatorRateLimit, fastest, rate);
        }
        let whole = self.gate.toward(command.q_tilde_m, forecast, situation.now_ns, findings);
        let parts = self.limiter.confine(situation, &whole.q_m, findings);
        if !self.write(&self.gate.part_of(&whole, parts), situation.now_ns) {
            return;
        }
        self.lag_m = self.gate.lags_m(command.q_tilde_m, parts);
        self.motion = Motion::Following;
        self.setpoint_bend_rad = command.bend_rad;
        (self.setpoint_joints_rad, self.n_joints) = (command.joints_rad, command.n_joints);
        self.note_jaw();
        self.command_sequence = command.sequence;
        self.stamps = HopStamps { slave_begun_ns: situation.now_ns, drive_written_ns: 0, ..command.stamps };
        self.is_unstamped = true;
    }

    fn is_ready(&self) -> bool {
        self.machine.is_ready() && !self.is_switching()
    }

    pub(crate) fn situation(&self, now_ns: i64) -> Situation {
        Situation {
            now_ns,
            setpoint_q_m: self.gate.q_m(),
            tau_n: self.reading.tau_n,
            ready: self.is_ready() && self.is_engaged(),
            following: self.is_following(),
        }
    }

    /// What the way before the slave has been through since the command before.
    fn end_if_changed(&mut self, command: &Command) {
        let Command { setpoint_sequence, input_sequence, model_hash, .. } = *command;
        let origin = Origin { setpoint_sequence, input_sequence, model_hash };
        let before = core::mem::replace(&mut self.origin, origin);
        if setpoint_sequence < before.setpoint_sequence
            || input_sequence < before.input_sequence
            || command.sequence == 1
        {
            self.disengage(Reason::StageRestarted, None);
        }
        if model_hash != before.model_hash {
            self.disengage(Reason::ModelExchanged, None);
        }
        let reasons = Reasons::from_bits(command.reasons);
        if let Some(stall) = STALLS.into_iter().find(|reason| reasons.contains(*reason)) {
            self.disengage(stall, None);
        }
    }

    /// Follows the operator's presence; while not engaged, names what is missing.
    fn look_for_operator(&mut self, command: &Command, now_ns: i64, findings: &mut Findings) {
        let reasons = Reasons::from_bits(command.reasons);
        if reasons.contains(Reason::OperatorAbsent) {
            self.engagement.absent();
        }
        if self.is_engaged() {
            return;
        }
        let missing = HOLDS.into_iter().chain(STALLS).filter(|reason| reasons.contains(*reason));
        let mut is_met = self.is_ready();
        for reason in missing {
            findings.insert(reason);
            is_met = false;
        }
        is_met &= self.limiter.may_engage(command, &self.situation(now_ns), findings);
        if !reasons.contains(Reason::OperatorAbsent) {
            self.engagement.present(now_ns, is_met);
        }
    }

    /// Ends the engagement for a reason that stands until the next one.
    pub(crate) fn disengage(&mut self, reason: Reason, note: Option<Note>) {
        self.engagement.clear(Some((reason, note)));
        self.hold();
    }

    /// Executes a change of the operating state.
    ///
    /// # Errors
    /// [`TransitionRefused`]: the state is unchanged, or FAULT if the drives failed.
    pub fn on_state_command(&mut self, command: &StateCommand, now_ns: i64) -> Result<(), TransitionRefused> {
        let result = match command.transition() {
            None => Err(TransitionRefused::Unknown { found: command.transition }),
            Some(transition) if command.sample_ns <= self.stop_ns && !transition.ends_motion() => {
                Err(TransitionRefused::BeforeStop { transition })
            }
            Some(Transition::Disable) => self.disable(now_ns),
            Some(transition) => self.transition(transition, now_ns),
        };
        (self.state_command_sequence, self.is_state_command_refused) = (command.sequence, result.is_err());
        result
    }

    /// Stops, whoever asked and in whatever state: the motion is braked by [`SlaveCore::on_tick`], and Enabled becomes
    /// Paused. `asked_ns` is on the clock of the state commands.
    ///
    /// # Real-time
    /// No allocation, no blocking, no clock.
    pub fn stop(&mut self, asked_ns: i64) {
        self.n_stops = self.n_stops.wrapping_add(1);
        self.stop_ns = asked_ns;
        self.disengage(Reason::StopAsked, None);
        self.stop_relaxing();
        if self.machine.state() == OperatingState::Fault {
            self.drive.stand(asked_ns);
        }
        if self.machine.state() == OperatingState::Enabled {
            let paused = self.machine.apply(Transition::Pause);
            debug_assert!(paused.is_ok(), "Enabled may always be paused");
        }
    }

    /// The same for a transition that the process itself wants; `disable` is then at once.
    ///
    /// # Errors
    /// As [`SlaveCore::on_state_command`].
    pub fn transition(&mut self, transition: Transition, now_ns: i64) -> Result<(), TransitionRefused> {
        let before = self.machine.state();
        let mut next = self.machine;
        next.apply(transition)?;
        let powers_up = transition == Transition::Enable && before != OperatingState::Enabled;
        let mut switching = Switching::Done;
        if powers_up || matches!(transition, Transition::Disable | Transition::ClearFault) {
            self.switching_since_ns = None;
            self.letting_go = None;
            switching = match self.drive.set_power(now_ns, powers_up) {
                Ok(switching) => switching,
                Err(error) => {
                    self.fault(error, now_ns);
                    return Err(error.into());
                }
            };
            self.gate.rest();
            self.drive_error = None;
        }
        self.machine = next;
        if transition != Transition::Enable || powers_up {
            self.engagement.clear(None);
            self.hold();
        }
        if transition == Transition::Pause {
            self.stop_relaxing();
        }
        if powers_up {
            match switching {
                Switching::Done => self.powered_up(now_ns)?,
                Switching::Busy => self.switching_since_ns = Some(now_ns),
            }
        }
        Ok(())
    }

    /// Once a millisecond, commands or not: homing, watchdog, braking.
    ///
    /// # Real-time
    /// No allocation, no blocking, no clock.
    pub fn on_tick(&mut self, now_ns: i64) {
        self.end_if_stale(now_ns);
        if let Some(since_ns) = self.switching_since_ns {
            self.continue_switching(since_ns, now_ns);
        } else if self.letting_go.is_some() {
            self.relax(now_ns);
        } else if self.machine.is_busy() && self.is_still() {
            self.continue_homing(now_ns);
        } else if !self.is_following() || self.watchdog.age_ns(now_ns).is_none_or(|age| age >= GAP_NS) {
            self.brake(now_ns);
        }
    }

    /// From now on no command is executed; a motion under way is braked by [`SlaveCore::on_tick`].
    pub fn hold(&mut self) {
        self.motion = Motion::Held;
    }

    /// Reads encoders and loads. A drive that does not answer, answers nonsense or is not where it was told to be is a
    /// fault.
    pub(crate) fn read(&mut self, now_ns: i64) {
        match self.drive.read(now_ns) {
            Ok(reading) if reading.q_tilde_m.into_iter().all(f64::is_finite) => self.reading = reading,
            Ok(_) => self.fault(DriveError::Failed { what: "an encoder gave no finite position" }, now_ns),
            Err(error) => self.fault(error, now_ns),
        }
        if let Some(error) = self.drive.failure() {
            self.fault(error, now_ns);
        }
    }

    fn end_if_stale(&mut self, now_ns: i64) {
        if self.is_engaged() && self.watchdog.is_stale(now_ns) {
            let value = self.watchdog.age_ns(now_ns).map_or(f64::NAN, |age| age as f64 * 1e-6);
            self.disengage(Reason::ChainStalled, Some(Note { value, limit: self.watchdog.limit_ms() }));
        }
    }

    fn continue_homing(&mut self, now_ns: i64) {
        match self.drive.home(now_ns) {
            Ok(Homing::Busy) => {}
            Ok(Homing::Done) => {
                self.machine.homing_done();
                self.zero_setpoint();
            }
            Err(error) => return self.fault(error, now_ns),
        }
        self.read(now_ns);
        self.gate.rest_at(self.reading.q_tilde_m);
    }

    /// Brakes where no command is executed; who gives way to loads goes on with that.
    fn rest(&mut self, now_ns: i64) {
        if self.letting_go.is_none() {
            self.brake(now_ns);
        }
    }

    /// Continues a motion that nobody commands any more, slower and slower.
    pub(crate) fn brake(&mut self, now_ns: i64) {
        let Some(write) = self.gate.brake(now_ns) else { return };
        let stroke_m = self.limiter.limits().stroke_m;
        let from_m = self.gate.q_m();
        let stays = write.q_m.iter().zip(from_m).all(|(q_m, from_m)| q_m.abs() <= stroke_m.max(from_m.abs()));
        let write = if stays { write } else { self.gate.part_of(&write, [0.0; 2]) };
        self.write(&write, now_ns);
    }

    pub(crate) fn write(&mut self, write: &Writes, now_ns: i64) -> bool {
        match self.drive.write(now_ns, write.q_m) {
            Ok(()) => {
                self.gate.commit(write, now_ns);
                true
            }
            Err(error) => {
                self.fault(error, now_ns);
                false
            }
        }
    }
}
