//! What the slave says of itself after each step: encoders, setpoint, state, and the reasons that hold.

use crate::{Drive, DriveError, Findings, SlaveCore};
use krait_ipc::Reason;
use krait_ipc::message::{OperatingState, SlaveState, largest};

impl<D: Drive> SlaveCore<D> {
    /// Reads the drives and sums up the slave at `now_ns`. If the newest command has just been executed, `now_ns` is when
    /// its drive write was finished.
    ///
    /// # Real-time
    /// No allocation, no blocking, no clock.
    pub fn report(&mut self, now_ns: i64) -> SlaveState {
        if self.is_unstamped {
            self.stamps.drive_written_ns = now_ns;
            self.gate.written_at(now_ns);
            self.is_unstamped = false;
        }
        self.read(now_ns);
        self.check_following(now_ns);
        self.sequence += 1;
        SlaveState {
            sequence: self.sequence,
            sample_ns: now_ns,
            stamps: self.stamps,
            command_sequence: self.command_sequence,
            operating_state: self.machine.state() as u32,
            flags: self.flags(),
            desired_state: self.machine.desired() as u32,
            n_stops: self.n_stops,
            state_command_sequence: self.state_command_sequence,
            setpoint_ns: self.gate.written_ns(),
            setpoint_q_m: self.gate.q_m(),
            setpoint_bend_rad: self.setpoint_bend_rad,
            setpoint_joints_rad: self.setpoint_joints_rad,
            measured_q_m: self.reading.q_tilde_m,
            measured_tau_n: self.reading.tau_n,
            n_actuators: self.drive.n_actuators() as u32,
            n_joints: self.n_joints,
            reasons: self.findings(now_ns).reasons().bits(),
            n_commands: self.n_commands,
            n_refused: self.n_refused,
        }
    }

    /// The reasons that hold at `now_ns`, with their worst values: those of the newest command and the standing ones.
    pub fn findings(&self, now_ns: i64) -> Findings {
        let mut standing = Findings::default();
        self.insert_standing_reasons(now_ns, &mut standing);
        // What was wrong with a command of long ago does not hold any more; that there is none since then does.
        let since_ms = now_ns.saturating_sub(self.last_command_ns) as f64 * 1e-6;
        if since_ms > self.watchdog.limit_ms() { standing } else { standing.merged(&self.command_findings) }
    }

    /// The drive's failure that led to FAULT, if that is the state.
    pub fn drive_error(&self) -> Option<DriveError> {
        self.drive_error
    }

    /// The same in words, which say what became of the others.
    pub fn failure_sentence(&self) -> Option<String> {
        self.drive_error.map(|error| error.sentence(self.has_kept_power))
    }

    /// Drives that hold power but are not where they were told to be have lost their way.
    fn check_following(&mut self, now_ns: i64) {
        let powered = matches!(self.machine.state(), OperatingState::Enabled | OperatingState::Paused);
        if powered && !self.is_switching() && self.following_error_m() > self.following_error_limit_m() {
            self.fault(DriveError::Failed { what: "the encoders are not where the drives were told to be" }, now_ns);
        }
    }

    fn flags(&self) -> u32 {
        let mut flags = 0;
        if self.machine.is_homed() {
            flags |= SlaveState::IS_HOMED;
        }
        if self.is_busy() {
            flags |= SlaveState::IS_BUSY;
        }
        let [follows, jaw_follows] = self.follow_closely();
        if follows {
            flags |= SlaveState::FOLLOWING;
        }
        if jaw_follows && self.gate.has_one_alone() {
            flags |= SlaveState::JAW_FOLLOWING;
        }
        if self.is_engaged() {
            flags |= SlaveState::ENGAGED;
        }
        if self.is_state_command_refused {
            flags |= SlaveState::COMMAND_REFUSED;
        }
        if self.drive.traits().homes_in_place {
            flags |= SlaveState::HOMES_IN_PLACE;
        }
        let states = self.reading.state.iter().enumerate().take(self.drive.n_actuators());
        let powered = states.filter(|(_, state)| state.has_power());
        flags |= powered.fold(0, |all, (k, _)| all | SlaveState::power_flag(k));
        if let Some(error) = self.drive_error.filter(|_| self.machine.state() == OperatingState::Fault) {
            flags |= self.failure_flags(&error);
        }
        flags
    }

    /// What is said of a failure besides that there is one.
    fn failure_flags(&self, error: &DriveError) -> u32 {
        let mut flags = error.actuator().map_or(0, SlaveState::failed_drive_flags);
        if matches!(error, DriveError::HardwareStop { .. }) {
            flags |= SlaveState::HARDWARE_STOP;
        }
        let others = self.reading.state.iter().enumerate().take(self.drive.n_actuators());
        let mut others = others.filter(|(k, _)| error.actuator() != Some(k + 1)).peekable();
        if self.has_kept_power && others.peek().is_some() && others.all(|(_, state)| state.has_power()) {
            flags |= SlaveState::OTHERS_HOLD;
        }
        flags
    }

    /// Distance of the encoders from the setpoint, m.
    pub(crate) fn following_error_m(&self) -> f64 {
        largest(core::array::from_fn(|i| self.reading.q_tilde_m[i] - self.gate.q_m()[i]))
    }

    /// The largest such distance that is no fault, m.
    pub(crate) fn following_error_limit_m(&self) -> f64 {
        self.limiter.limits().following_error_m
    }

    /// The reasons that hold whether a command came or not.
    pub(crate) fn insert_standing_reasons(&self, now_ns: i64, findings: &mut Findings) {
        if self.machine.state() != OperatingState::Enabled {
            findings.insert(Reason::SlaveNotEnabled);
        }
        if !self.machine.is_homed() {
            findings.insert(Reason::SlaveNotHomed);
        }
        self.engagement.tell(findings);
        if self.watchdog.is_stale(now_ns) {
            match self.watchdog.age_ns(now_ns) {
                Some(age) => findings.note(Reason::CommandStale, age as f64 * 1e-6, self.watchdog.limit_ms()),
                None => findings.insert(Reason::CommandStale),
            }
        }
        if self.machine.state() == OperatingState::Fault {
            findings.insert(Reason::DriveFault);
            findings.note(Reason::FollowingError, self.following_error_m(), self.following_error_limit_m());
        }
        // Of a failed drive its failure is said.
        if self.machine.state() != OperatingState::Fault && self.reading.has_emergency {
            findings.insert(Reason::DriveEmergency);
        }
        if self.gives_way() {
            findings.note(Reason::Relaxing, self.largest_load_n(), self.relax.load_n);
        }
    }
}
