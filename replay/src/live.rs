//! Plays a program to any slave on the machine's clock: approach, ease-in, pause, and a safe end.
//!
//! The slave and its limits, watchdog and operating states are as in every live chain; so are the stages. Only the
//! operator's place is taken: at rate s the recorded time passes s times as fast and every velocity is s times as large, so
//! the path stays the same. The rate rises and falls smoothly, which is the ease-in, the pause and the stop.

use crate::player::{NewestPlayed, PlayCounts};
use crate::program::{Next, PERIOD_NS, Planned, Program, ProgramPart, What};
use crate::steering::{MachinePose, pose_of_state};
use crate::{ReplayError, Turn};
use krait_ipc::message::{HopStamps, OperatorInput, Setpoint, Shape, SlaveState};
use krait_ipc::{Bus, ReadOptions, Reader, Reason, Reasons, Writer};
use krait_report::Tracked;

/// A step this much longer than the period is not cut in two, ns.
const LONGEST_STEP_NS: f64 = 1.5e6;
/// A gap in a recording stands for at most this, as it does for `resolve`, ns.
const LONGEST_GAP_NS: i64 = 10_000_000;
/// How fast the rate changes, 1/s: from standing to 1 in half a second.
const RATE_PER_S: f64 = 2.0;
/// Where the snake must stand before the recorded samples begin, rad (0.3 deg).
const START_RAD: f64 = 5e-3;
/// An operator who is present for so long without being engaged will not be, ns.
const IN_VAIN_NS: i64 = 700_000_000;
/// Later than this, the samples that were missed are not made up for: the replay continues from now, ns.
const LATE_NS: i64 = 20_000_000;

/// A replay on the machine's clock.
pub struct LivePlayer {
    program: Program,
    inputs: Option<Writer<OperatorInput>>,
    sent_setpoints: Option<Writer<Setpoint>>,
    setpoints: Option<Reader<Setpoint>>,
    states: Reader<SlaveState>,
    shapes: Reader<Shape>,
    /// The sample on the way to which the replay is, and how much of that way is left, ns of recorded time.
    under_way: Option<(Planned, f64)>,
    rate: f64,
    wanted_rate: f64,
    counts: PlayCounts,
    n_sent: u64,
    n_late: u64,
    due_ns: i64,
    newest: NewestPlayed,
    ready: Option<Ready>,
    last_setpoint: Option<Setpoint>,
    tracking: Tracked,
    has_begun: bool,
    /// Since when an operator has been present, as far as was sent, without being engaged, ns.
    in_vain_since_ns: Option<i64>,
}

/// A message that waits until it is due.
#[derive(Clone, Copy, Debug)]
struct Ready {
    what: What,
    /// What its velocity is multiplied with.
    rate: f64,
    /// How far it is on the way from the sample before, 0 to 1.
    part: f64,
    /// The part of the program that it belongs to, if it is a sample of its own and not on the way to one.
    arrives_at: Option<ProgramPart>,
}

impl LivePlayer {
    /// Opens the channels, before the chain is started.
    ///
    /// # Errors
    /// [`ReplayError::Ipc`] when a channel cannot be had.
    pub fn open(bus: &Bus, program: Program, rate: f64) -> Result<Self, ReplayError> {
        let has_inputs = program.sends_inputs();
        Ok(Self {
            program,
            inputs: if has_inputs { Some(bus.writer()?) } else { None },
            sent_setpoints: if has_inputs { None } else { Some(bus.writer()?) },
            setpoints: if has_inputs { Some(bus.reader(ReadOptions::observing())?) } else { None },
            states: bus.reader(ReadOptions::observing())?,
            shapes: bus.reader(ReadOptions::observing())?,
            under_way: None,
            rate: 0.0,
            wanted_rate: rate,
            counts: PlayCounts::default(),
            n_sent: 0,
            n_late: 0,
            due_ns: 0,
            newest: NewestPlayed::default(),
            ready: None,
            last_setpoint: None,
            tracking: Tracked::default(),
            has_begun: false,
            in_vain_since_ns: None,
        })
    }

    /// What was sent; `answered` are the samples that the slave has taken.
    pub fn counts(&self) -> PlayCounts {
        let lost = self.states.n_lost() + self.shapes.n_lost() + self.setpoints.as_ref().map_or(0, Reader::n_lost);
        PlayCounts { answered: self.newest.state.map_or(0, |state| state.n_commands), lost, ..self.counts }
    }

    /// Messages sent to the chain: with the approach, pauses, and samples between recorded ones.
    pub fn n_sent(&self) -> u64 {
        self.n_sent
    }

    /// How often the machine held the replay up for longer than it can make up for.
    pub fn n_late(&self) -> u64 {
        self.n_late
    }

    /// What is played, and how much of it has been.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// How well the machine followed.
    pub fn tracking(&self) -> &Tracked {
        &self.tracking
    }

    /// When the next sample is due, ns.
    pub fn due_ns(&self) -> i64 {
        self.due_ns
    }

    /// The rate that is wanted from now on; 0 is a pause.
    pub fn set_rate(&mut self, rate: f64) {
        self.wanted_rate = rate;
    }

    /// Comes to rest and ends; to be said again until the end, because the rate falls first.
    pub fn stop(&mut self) {
        self.wanted_rate = 0.0;
        // The samples of a rest that has begun are waited for and sent like any other.
        if (self.rate == 0.0 || !self.has_begun) && !self.program.is_at_last_rest() {
            (self.under_way, self.ready) = (None, None);
            self.program.stop();
        }
    }

    /// Whether the replay stands still.
    pub fn stands(&self) -> bool {
        self.rate == 0.0
    }

    /// Sends what is due at `now_ns` (CLOCK_MONOTONIC).
    ///
    /// # Errors
    /// [`ReplayError::NotReady`] when the slave is not enabled and homed, [`ReplayError::StartPose`] when the approach did
    /// not reach the start, or a channel failed.
    pub fn turn(&mut self, now_ns: i64) -> Result<Turn, ReplayError> {
        self.take()?;
        self.check_ready(now_ns)?;
        if self.due_ns == 0 || now_ns - self.due_ns > LATE_NS {
            self.n_late += u64::from(self.due_ns != 0);
            self.due_ns = now_ns;
        }
        loop {
            let ready = match self.ready.take() {
                Some(ready) => ready,
                None => match self.plan()? {
                    Some(ready) => ready,
                    None => return Ok(Turn::Done),
                },
            };
            if self.due_ns > now_ns {
                self.ready = Some(ready);
                return Ok(Turn::Going);
            }
            self.send(&ready)?;
        }
    }

    fn take(&mut self) -> Result<(), ReplayError> {
        while let Some(state) = self.states.take()?.map(|state| *state) {
            self.newest.state = Some(state);
        }
        while let Some(reader) = &mut self.setpoints
            && let Some(setpoint) = reader.take()?.map(|setpoint| *setpoint)
        {
            self.newest.setpoint = Some(setpoint);
            self.tracking.setpoint(&setpoint);
        }
        while let Some(shape) = self.shapes.take()?.map(|shape| *shape) {
            self.tracking.shape(&shape);
        }
        Ok(())
    }

    fn check_ready(&mut self, now_ns: i64) -> Result<(), ReplayError> {
        if self.newest.state.is_some_and(|state| state.is_engaged()) {
            self.in_vain_since_ns = None;
        }
        let in_vain = self.in_vain_since_ns.is_some_and(|since_ns| now_ns.saturating_sub(since_ns) > IN_VAIN_NS);
        match self.newest.state {
            Some(state) if state.is_ready() && !in_vain => Ok(()),
            Some(state) => {
                let reasons = Reasons::from_bits(state.reasons).iter().map(Reason::sentence).collect::<Vec<_>>();
                Err(ReplayError::NotReady { reasons: reasons.join("; ") })
            }
            None => Err(ReplayError::NotReady { reasons: "it has not said anything yet".to_owned() }),
        }
    }

    /// The sample that the replay is on the way to, and how much of the way is left, ns of recorded time.
    fn goal(&mut self) -> Result<Option<(Planned, f64)>, ReplayError> {
        if self.under_way.is_some() {
            return Ok(self.under_way);
        }
        // Each sample waits for the one before by the clock; the setpoint that came back last is near enough to steer by.
        let Next::Sample(planned) = self.program.next(&self.newest.pose(), true)? else { return Ok(None) };
        if planned.part == ProgramPart::Recorded && !self.has_begun {
            self.check_start()?;
            self.rate = 0.0;
        }
        self.has_begun = planned.part == ProgramPart::Recorded;
        Ok(Some((planned, planned.dt_ns.min(LONGEST_GAP_NS) as f64)))
    }

    /// The slave itself must stand where the recorded samples begin.
    fn check_start(&self) -> Result<(), ReplayError> {
        let (start, steering) = (self.program.start(), self.program.steering());
        let found = self.newest.state.as_ref().map_or(MachinePose::repeat(f64::NAN), pose_of_state);
        let limit = START_RAD * steering.si_per_rad();
        let mut way = found - start;
        // A jaw may still be coming to rest; its button has brought it as near as it can.
        steering.jaw_taken_from(&mut way);
        if way.norm() <= limit {
            return Ok(());
        }
        Err(ReplayError::StartPose {
            found: steering.words(&found),
            expected: steering.words(start),
            limit: steering.distance_words(limit),
        })
    }

    /// The next message to the chain, at most a period after the one before; sets when it is due. `None` at the end.
    fn plan(&mut self) -> Result<Option<Ready>, ReplayError> {
        let Some((planned, left_ns)) = self.goal()? else { return Ok(None) };
        let ready = |rate: f64, part: f64, arrives: bool| {
            let arrives_at = arrives.then_some(planned.part);
            Ok(Some(Ready { what: planned.what, rate, part, arrives_at }))
        };
        if planned.part != ProgramPart::Recorded {
            self.due_ns += planned.dt_ns;
            return ready(1.0, 1.0, true);
        }
        self.change_rate();
        if self.rate == 0.0 {
            // A pause: the operator is still there and asks for no motion.
            self.due_ns += PERIOD_NS;
            self.under_way = Some((planned, left_ns));
            return ready(0.0, 0.0, false);
        }
        let step_ns = if left_ns / self.rate <= LONGEST_STEP_NS { left_ns / self.rate } else { PERIOD_NS as f64 };
        self.due_ns += step_ns as i64;
        let way_ns = step_ns * self.rate;
        let is_there = way_ns >= left_ns - 0.5;
        self.under_way = (!is_there).then_some((planned, left_ns - way_ns));
        ready(self.rate, if is_there { 1.0 } else { way_ns / left_ns }, is_there)
    }

    fn change_rate(&mut self) {
        let change = RATE_PER_S * PERIOD_NS as f64 * 1e-9;
        self.rate += (self.wanted_rate - self.rate).clamp(-change, change);
        if (self.rate - self.wanted_rate).abs() < change {
            self.rate = self.wanted_rate;
        }
    }

    /// Sends a sample with its velocity times the rate; a setpoint some part of the way from the one before.
    fn send(&mut self, ready: &Ready) -> Result<(), ReplayError> {
        let Ready { what, rate, part, arrives_at } = *ready;
        let is_present = match what {
            What::Input(input) => input.operator_present(),
            What::Setpoint(setpoint) => !Reasons::from_bits(setpoint.reasons).contains(Reason::OperatorAbsent),
        };
        self.in_vain_since_ns = is_present.then(|| self.in_vain_since_ns.unwrap_or(self.due_ns));
        if let Some(part) = arrives_at {
            self.counts.count(part);
        }
        self.n_sent += 1;
        let (sequence, now_ns) = (self.n_sent, self.due_ns);
        let stamps = HopStamps { device_ns: now_ns, input_sent_ns: now_ns, ..HopStamps::default() };
        match what {
            What::Input(input) => {
                let tip_vel_in_view_m_per_s = input.tip_vel_in_view_m_per_s.map(|v| v * rate);
                let tip_angular_vel_in_view_rad_per_s = input.tip_angular_vel_in_view_rad_per_s.map(|v| v * rate);
                let input = OperatorInput {
                    sequence,
                    sample_ns: now_ns,
                    stamps,
                    tip_vel_in_view_m_per_s,
                    tip_angular_vel_in_view_rad_per_s,
                    ..input
                };
                if let Some(inputs) = &mut self.inputs {
                    inputs.send(&input)?;
                }
            }
            What::Setpoint(setpoint) => {
                let stamps = HopStamps { resolve_begun_ns: now_ns, setpoint_sent_ns: now_ns, ..stamps };
                let from = self.last_setpoint.map_or(setpoint.bend_rad, |last| last.bend_rad);
                let mix = |k: usize| from[k] + (setpoint.bend_rad[k] - from[k]) * part;
                let bend_rad = if part >= 1.0 { setpoint.bend_rad } else { [mix(0), mix(1)] };
                let bend_vel_rad_per_s = setpoint.bend_vel_rad_per_s.map(|v| v * rate);
                let (sample_ns, input_sequence) = (now_ns, sequence);
                let setpoint =
                    Setpoint { sequence, sample_ns, input_sequence, stamps, bend_rad, bend_vel_rad_per_s, ..setpoint };
                self.last_setpoint = Some(setpoint);
                self.newest.setpoint = Some(setpoint);
                self.tracking.setpoint(&setpoint);
                if let Some(setpoints) = &mut self.sent_setpoints {
                    setpoints.send(&setpoint)?;
                }
            }
        }
        Ok(())
    }
}
