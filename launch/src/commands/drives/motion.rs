//! Small steps of single actuators through the slave's own limiter, gate and watchdog, in an instance without a chain: what
//! `--jog`, `--calibrate` and `krait calibrate play --drives` share.

use anyhow::{Context, bail};
use core::time::Duration;
use krait_drives::BusDrive;
use krait_ipc::clock::monotonic_ns;
use krait_ipc::message::{Actuators, Command, MAX_ACTUATORS, OperatingState, Phase, SlaveState, Transition};
use krait_ipc::{Reason, Reasons};
use krait_slave::{SlaveConfig, SlaveCore};

/// Longest step, mm.
pub(super) const LONGEST_MM: f64 = 0.1;
/// The slave is ticked so often.
pub(super) const TICK: Duration = Duration::from_millis(1);
const TICK_S: f64 = 1e-3;
/// Speed of a step, m/s; less where the limiter allows less.
const SPEED_M_PER_S: f64 = 2e-3;
/// Power and zero take less.
const PATIENCE_TICKS: u32 = 10_000;

/// Actuators under power, whose operator is this program. Dropping it takes the power away.
pub(super) struct Motion {
    core: SlaveCore<BusDrive>,
    sequence: u64,
    goal_m: Actuators,
    n: usize,
    rate_m_per_s: f64,
}

/// What a step has come to.
pub(super) struct Step {
    /// The slave, once the encoder has had time to follow.
    pub(super) state: SlaveState,
    /// Why the limiter did not let it be made as asked; the next step begins where it has stopped.
    pub(super) refused: Option<String>,
}

impl Motion {
    /// Power, zero, and the operator at the setpoint.
    pub(super) fn begin(drive: BusDrive, config: &SlaveConfig) -> anyhow::Result<Self> {
        let mut motion = Self {
            core: SlaveCore::new(drive, config),
            sequence: 0,
            goal_m: [0.0; MAX_ACTUATORS],
            n: config.drive.actuator.len(),
            rate_m_per_s: config.rates_m_per_s().into_iter().fold(SPEED_M_PER_S, |least, rate| least.min(0.5 * rate)),
        };
        motion.core.transition(Transition::Enable, monotonic_ns())?;
        let mut has_homed = false;
        for _ in 0..PATIENCE_TICKS {
            let state = motion.tick()?;
            if motion.core.is_busy() {
                continue;
            }
            if state.is_ready() {
                motion.take_hold(&state)?;
                return Ok(motion);
            }
            if !core::mem::replace(&mut has_homed, true) {
                motion.core.transition(Transition::Home, monotonic_ns())?;
            }
        }
        bail!("the drives were not ready after 10 s")
    }

    /// Engages where the drives stand: the operator lets go, then takes hold.
    fn take_hold(&mut self, state: &SlaveState) -> anyhow::Result<()> {
        self.goal_m = state.setpoint_q_m;
        for reasons in [Reasons::NONE.with(Reason::OperatorAbsent), Reasons::NONE] {
            self.command(Phase::Holding, reasons)?;
        }
        Ok(())
    }

    /// Engages anew if a stall has ended the engagement, and says whether that was so. Only a key press may ask for this.
    pub(super) fn take_hold_again(&mut self) -> anyhow::Result<bool> {
        let state = self.keep()?;
        if state.is_engaged() {
            return Ok(false);
        }
        self.take_hold(&state)?;
        Ok(true)
    }

    /// Where the `k`-th is to be, m from zero.
    pub(super) fn goal_m(&self, k: usize) -> f64 {
        self.goal_m[k]
    }

    /// Stands where it is; to be called every [`TICK`].
    pub(super) fn keep(&mut self) -> anyhow::Result<SlaveState> {
        self.command(Phase::Following, Reasons::NONE)
    }

    /// A little way of the `k`-th, counted from 0, at once; to be called every [`TICK`].
    pub(super) fn creep(&mut self, k: usize, way_m: f64) -> anyhow::Result<SlaveState> {
        self.goal_m[k] += way_m;
        self.keep()
    }

    /// When the `k`-th was last measured, ns.
    pub(super) fn sampled_ns(&self, k: usize) -> i64 {
        self.core.reading().sampled_ns[k]
    }

    /// Stands for so many ticks.
    pub(super) fn stand(&mut self, n_ticks: u32) -> anyhow::Result<SlaveState> {
        let mut state = self.keep()?;
        for _ in 0..n_ticks {
            std::thread::sleep(TICK);
            state = self.keep()?;
        }
        Ok(state)
    }

    /// One step of the `k`-th, counted from 0, at its own speed; then so many ticks for the encoder to follow.
    pub(super) fn step(&mut self, k: usize, way_m: f64, settle_ticks: u32) -> anyhow::Result<Step> {
        let end_m = self.goal_m[k] + way_m;
        let n_ticks = (way_m.abs() / (self.rate_m_per_s * TICK_S)).ceil().max(1.0);
        for _ in 0..n_ticks as u32 {
            self.goal_m[k] += way_m / n_ticks;
            self.keep()?;
            std::thread::sleep(TICK);
        }
        self.goal_m[k] = end_m;
        let state = self.stand(settle_ticks)?;
        let mut refused = None;
        if (state.setpoint_q_m[k] - end_m).abs() > 1e-9 {
            self.goal_m = state.setpoint_q_m;
            refused = Some(why(Reasons::from_bits(state.reasons)));
        }
        Ok(Step { state, refused })
    }

    /// Comes to rest and takes the power away.
    pub(super) fn end(&mut self) -> anyhow::Result<()> {
        self.core.hold();
        for _ in 0..PATIENCE_TICKS {
            if self.core.is_still() {
                break;
            }
            std::thread::sleep(TICK);
            self.core.on_tick(monotonic_ns());
        }
        self.core.transition(Transition::Disable, monotonic_ns())?;
        Ok(())
    }

    /// The same after work, whatever became of that; where the power cannot be taken away, that is said before anything else.
    pub(super) fn end_after<T>(&mut self, done: anyhow::Result<T>) -> anyhow::Result<T> {
        match (done, self.end()) {
            (done, Ok(())) => done,
            (Ok(_), Err(ending)) => Err(ending.context("the power could not be taken away")),
            (Err(error), Err(ending)) => Err(error.context(format!("the power could not be taken away ({ending:#})"))),
        }
    }

    fn tick(&mut self) -> anyhow::Result<SlaveState> {
        std::thread::sleep(TICK);
        let now_ns = monotonic_ns();
        self.core.on_tick(now_ns);
        self.look(now_ns)
    }

    fn command(&mut self, phase: Phase, reasons: Reasons) -> anyhow::Result<SlaveState> {
        self.sequence += 1;
        let now_ns = monotonic_ns();
        let command = Command {
            sequence: self.sequence,
            sample_ns: now_ns,
            setpoint_sequence: self.sequence,
            input_sequence: self.sequence,
            q_tilde_m: self.goal_m,
            q_uncompensated_m: self.goal_m,
            n_actuators: self.n as u32,
            phase: phase as u32,
            reasons: reasons.bits(),
            ..Command::default()
        };
        self.core.on_command(&command, now_ns);
        self.core.on_tick(now_ns);
        self.look(now_ns)
    }

    /// Reads the drives; a fault ends it, and says what becomes of the power.
    fn look(&mut self, now_ns: i64) -> anyhow::Result<SlaveState> {
        let state = self.core.report(now_ns);
        if state.operating() == Some(OperatingState::Fault) {
            let error = self.core.drive_error().context("the drives are in FAULT")?;
            // Whoever asked ends now, and with it the power of all, whatever `on_fault` says of a chain.
            bail!("{}", error.sentence(false));
        }
        Ok(state)
    }
}

/// What keeps a step from being made, the cause before what only follows from it.
const CAUSES: [Reason; 8] = [
    Reason::DriveFault,
    Reason::ForceLimit,
    Reason::LoadUnknown,
    Reason::StrokeLimit,
    Reason::StepLimit,
    Reason::ChainStalled,
    Reason::CommandLate,
    Reason::CommandStale,
];

/// The one reason that matters, in words.
fn why(reasons: Reasons) -> String {
    let cause = CAUSES.into_iter().find(|cause| reasons.contains(*cause)).or_else(|| reasons.iter().next());
    cause.map_or_else(|| "the limiter does not say why".to_owned(), |cause| cause.sentence().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_reasons_a_step_tells_the_cause() {
        let at_the_end = Reasons::NONE
            .with(Reason::ActuatorRateLimit)
            .with(Reason::ActuatorAccelerationLimit)
            .with(Reason::StepLimit)
            .with(Reason::StrokeLimit);
        assert_eq!(why(at_the_end), Reason::StrokeLimit.sentence());
        assert_eq!(why(Reasons::NONE.with(Reason::NotEngaged)), Reason::NotEngaged.sentence());
        assert!(!why(Reasons::NONE).is_empty());
    }
}
