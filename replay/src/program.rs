//! What a replay sends, sample by sample: an approach to the start, the recorded samples, and a rest; once or several times.
//!
//! The approach steers the machine to where the recording or trajectory begins, slowly, and without knowing anything but the
//! setpoint that came out last. The rest says that no operator is present, so that the setpoint comes to rest and the
//! slave holds before anything ends.

use crate::steering::{MachinePose, Steering};
use crate::{InputTrack, ReplayError, Trajectory};
use krait_ipc::message::{DeviceState, N_LINES, OperatorInput, Phase, Setpoint, lines};
use krait_ipc::{Reason, Reasons};
use krait_model::ModelHash;
use nalgebra::Vector6;

/// Time between two samples that the program makes by itself, ns.
pub(crate) const PERIOD_NS: i64 = 1_000_000;
/// Samples before an approach in which no operator is present, and then one who asks for no motion yet: the slave engages by
/// that edge, and every stage knows of it before anything moves (a step rests on the state of [`crate::UNDER_WAY`] samples
/// ago).
const N_ABSENT: u64 = 8;
const N_ENGAGING: u64 = 48;
/// Samples without an operator before a recording that begins without one: more than are ever under way.
const N_LETTING_GO: u64 = 48;
/// Samples of a rest: within 0.3 s every setpoint that the limits allow has come to rest and the slave holds.
const N_REST: u64 = 300;
/// Fastest approach, rad/s (times the capstan's radius for sliding joints): 17 deg/s, far below what an operator may ask for.
const APPROACH_RAD_PER_S: f64 = 0.3;
/// How much faster the approach may get from sample to sample, rad/s: full speed after 0.1 s.
const APPROACH_GAIN_RAD_PER_S: f64 = 3e-3;
/// Rate at which the rest of the way is covered near the end of an approach, 1/s.
const APPROACH_RATE_PER_S: f64 = 8.0;
/// Nearer to the start than this, the approach has arrived, rad (0.006 deg).
const ARRIVED_RAD: f64 = 1e-4;
/// Samples that an approach may take: the largest bend at a tenth of its speed.
const MOST_APPROACH: u64 = 100_000;

/// A sample to be sent; the player numbers and stamps it.
#[derive(Clone, Copy, Debug)]
pub struct Planned {
    /// The sample.
    pub what: What,
    /// Time since the sample before, ns; > 0.
    pub dt_ns: i64,
    /// What it belongs to.
    pub part: ProgramPart,
}

/// A sample for `resolve`, or one that takes the place of `resolve`'s.
#[derive(Clone, Copy, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "one is made for each sample and handed over at once; no heap in a replay's loop"
)]
pub enum What {
    /// What an operator asks for.
    Input(OperatorInput),
    /// Where the snake shall be.
    Setpoint(Setpoint),
}

/// The parts of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgramPart {
    /// On the way to the start.
    Approach,
    /// No operator, because the recording begins without one: every stage knows that the engagement has ended before the
    /// recording engages anew.
    LettingGo,
    /// What was recorded, or stands in the table.
    Recorded,
    /// Coming to rest.
    Rest,
}

/// What is to be sent next.
#[allow(clippy::large_enum_variant, reason = "nearly all are samples, and a sample shall not be on the heap")]
#[derive(Clone, Copy, Debug)]
pub enum Next {
    /// This sample.
    Sample(Planned),
    /// Nothing until every sample under way has come through.
    Wait,
    /// Nothing more.
    End,
}

/// What is played.
#[derive(Debug)]
pub enum Score {
    /// Operator input, in order, each acceptable to `resolve`.
    Inputs(InputTrack),
    /// A trajectory of the machine's pose.
    Trajectory(Trajectory),
}

/// A score, where it begins, and how often it is played.
#[derive(Debug)]
pub struct Program {
    score: Score,
    start: MachinePose,
    n_loops_left: u64,
    steering: Steering,
    model: ModelHash,
    part: ProgramPart,
    n_in_part: u64,
    /// Where the glide to a trajectory's start began.
    approach_from: Option<MachinePose>,
    last_pose: MachinePose,
    last_input_ns: Option<i64>,
    /// The recording's first sample of this loop, read ahead.
    first_input: Option<OperatorInput>,
    tally: Tally,
}

/// How much of the score has been played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Samples of the longest loop so far.
    pub n_in_loop: u64,
    /// Loops that were played to their end.
    pub n_loops: u64,
    /// Recorded time over all loops, ns.
    pub played_ns: i64,
}

impl Program {
    /// A program that begins at a pose. `model` is that of the chain.
    pub fn new(score: Score, start: MachinePose, n_loops: u64, steering: Steering, model: ModelHash) -> Self {
        Self {
            score,
            start,
            n_loops_left: n_loops,
            steering,
            model,
            part: ProgramPart::Approach,
            n_in_part: 0,
            approach_from: None,
            last_pose: MachinePose::zeros(),
            last_input_ns: None,
            first_input: None,
            tally: Tally::default(),
        }
    }

    /// Whether operator input is sent; otherwise setpoints are, and `resolve` has no part in it.
    pub fn sends_inputs(&self) -> bool {
        matches!(self.score, Score::Inputs(_))
    }

    /// Where the score begins.
    pub fn start(&self) -> &MachinePose {
        &self.start
    }

    /// What moves.
    pub fn steering(&self) -> &Steering {
        &self.steering
    }

    /// How much of the score has been played.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// What was read of a recording's input; `None` for a trajectory.
    pub fn track_counts(&self) -> Option<crate::TrackCounts> {
        match &self.score {
            Score::Inputs(track) => Some(track.counts()),
            Score::Trajectory(_) => None,
        }
    }

    /// Leaves out the rest of the score: comes to rest and ends.
    pub fn stop(&mut self) {
        self.n_loops_left = 1;
        if self.part != ProgramPart::Rest {
            self.enter(ProgramPart::Rest);
        }
    }

    /// Whether only the rest at the very end is left.
    pub(crate) fn is_at_last_rest(&self) -> bool {
        self.part == ProgramPart::Rest && self.n_loops_left == 1
    }

    /// The next sample. `pose` is that of the newest setpoint that has come out; `is_idle` says that no sample is under way.
    ///
    /// # Errors
    /// [`ReplayError::Read`] when the recording cannot be read any further.
    pub fn next(&mut self, pose: &MachinePose, is_idle: bool) -> Result<Next, ReplayError> {
        loop {
            let sample = match self.part {
                ProgramPart::Approach if !is_idle && (self.sends_inputs() || self.approach_from.is_none()) => {
                    return Ok(Next::Wait);
                }
                ProgramPart::Approach if self.n_in_part < N_ABSENT + N_ENGAGING => Some(self.engaging(pose)),
                ProgramPart::Approach => self.approach(pose),
                ProgramPart::LettingGo => self.letting_go(),
                ProgramPart::Recorded => self.recorded()?,
                ProgramPart::Rest if self.n_in_part < N_REST => Some(self.rest()),
                ProgramPart::Rest => None,
            };
            if let Some(sample) = sample {
                self.n_in_part += 1;
                return Ok(Next::Sample(sample));
            }
            match self.part {
                ProgramPart::Approach => {
                    self.enter(ProgramPart::LettingGo);
                    self.read_first()?;
                }
                ProgramPart::LettingGo => self.enter(ProgramPart::Recorded),
                ProgramPart::Recorded => {
                    self.tally.n_loops += 1;
                    self.enter(ProgramPart::Rest);
                }
                ProgramPart::Rest if self.n_loops_left > 1 => {
                    self.n_loops_left -= 1;
                    self.enter(ProgramPart::Approach);
                }
                ProgramPart::Rest => return Ok(Next::End),
            }
        }
    }

    fn enter(&mut self, part: ProgramPart) {
        (self.part, self.n_in_part, self.approach_from, self.last_input_ns) = (part, 0, None, None);
    }

    /// Begins the recording anew and reads its first sample ahead.
    fn read_first(&mut self) -> Result<(), ReplayError> {
        if let Score::Inputs(track) = &mut self.score {
            track.rewind();
            self.first_input = track.next()?;
        }
        Ok(())
    }

    /// Absent until nothing is under way that still follows the approach; nothing where the recording begins engaged.
    fn letting_go(&self) -> Option<Planned> {
        let begins_absent = self.first_input.is_some_and(|input| input.flags & OperatorInput::OPERATOR_PRESENT == 0);
        let what = What::Input(operator_input(&Vector6::zeros(), 0, DeviceState::Live));
        (begins_absent && self.n_in_part < N_LETTING_GO).then_some(Planned {
            what,
            dt_ns: PERIOD_NS,
            part: ProgramPart::LettingGo,
        })
    }

    /// Stands still where the snake is, first absent and then present.
    fn engaging(&mut self, pose: &MachinePose) -> Planned {
        let is_present = self.n_in_part >= N_ABSENT;
        let what = if self.sends_inputs() {
            let flags = if is_present { OperatorInput::OPERATOR_PRESENT } else { 0 };
            What::Input(operator_input(&Vector6::zeros(), flags, DeviceState::Live))
        } else {
            let from = *self.approach_from.get_or_insert(*pose);
            let reasons = Reasons::NONE.with(if is_present { Reason::NotEngaged } else { Reason::OperatorAbsent });
            self.setpoint(&from, &MachinePose::zeros(), Phase::Holding, reasons)
        };
        Planned { what, dt_ns: PERIOD_NS, part: ProgramPart::Approach }
    }

    fn approach(&mut self, pose: &MachinePose) -> Option<Planned> {
        let n_moved = self.n_in_part - N_ABSENT - N_ENGAGING;
        if self.n_in_part >= MOST_APPROACH {
            return None;
        }
        if !self.sends_inputs() {
            return self.glide(pose, n_moved);
        }
        let si_per_rad = self.steering.si_per_rad();
        let mut way = self.start - pose;
        let jaw = self.steering.jaw_taken_from(&mut way);
        if way.norm() <= ARRIVED_RAD * si_per_rad && jaw == 0 {
            return None;
        }
        let fastest = APPROACH_RAD_PER_S.min(APPROACH_GAIN_RAD_PER_S * (n_moved + 1) as f64) * si_per_rad;
        let rate_per_s = way * (fastest / way.norm()).min(APPROACH_RATE_PER_S);
        let hand = self.steering.hand_velocity(pose, &rate_per_s);
        let input = operator_input(&hand, OperatorInput::OPERATOR_PRESENT | jaw, DeviceState::Live);
        Some(Planned { what: What::Input(input), dt_ns: PERIOD_NS, part: ProgramPart::Approach })
    }

    /// From where the slave stands to the start with the least jerk: s = 10 u^3 - 15 u^4 + 6 u^5, fastest 1.875 in the middle.
    fn glide(&mut self, pose: &MachinePose, n_moved: u64) -> Option<Planned> {
        let from = *self.approach_from.get_or_insert(*pose);
        let way = self.start - from;
        let si_per_rad = self.steering.si_per_rad();
        let time_s = 1.875 * way.norm() / (APPROACH_RAD_PER_S * si_per_rad);
        let u = (n_moved + 1) as f64 * PERIOD_NS as f64 * 1e-9 / time_s;
        if way.norm() <= ARRIVED_RAD * si_per_rad || u >= 1.0 {
            return None;
        }
        let part = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let rate_per_s = 30.0 * (u * (1.0 - u)).powi(2) / time_s;
        self.last_pose = from + way * part;
        let what = self.setpoint(&self.last_pose, &(way * rate_per_s), Phase::Following, Reasons::NONE);
        Some(Planned { what, dt_ns: PERIOD_NS, part: ProgramPart::Approach })
    }

    fn recorded(&mut self) -> Result<Option<Planned>, ReplayError> {
        let (what, dt_ns) = match &mut self.score {
            Score::Inputs(track) => {
                let read_ahead = self.first_input.take();
                let next = if read_ahead.is_some() { read_ahead } else { track.next()? };
                let Some(input) = next else { return Ok(None) };
                let before_ns = self.last_input_ns.replace(input.sample_ns);
                (What::Input(input), before_ns.map_or(PERIOD_NS, |before_ns| input.sample_ns - before_ns))
            }
            Score::Trajectory(trajectory) => {
                let Some((pose, vel_per_s)) = trajectory.sample(self.n_in_part) else { return Ok(None) };
                self.last_pose = pose;
                (self.setpoint(&pose, &vel_per_s, Phase::Following, Reasons::NONE), PERIOD_NS)
            }
        };
        if self.n_in_part > 0 {
            self.tally.played_ns = self.tally.played_ns.saturating_add(dt_ns);
        }
        self.tally.n_in_loop = self.tally.n_in_loop.max(self.n_in_part + 1);
        Ok(Some(Planned { what, dt_ns, part: ProgramPart::Recorded }))
    }

    fn rest(&self) -> Planned {
        let ended = Reasons::NONE.with(Reason::InputEnded).with(Reason::OperatorAbsent);
        let what = if self.sends_inputs() {
            What::Input(operator_input(&Vector6::zeros(), 0, DeviceState::Ended))
        } else {
            self.setpoint(&self.last_pose, &MachinePose::zeros(), Phase::Holding, ended)
        };
        Planned { what, dt_ns: PERIOD_NS, part: ProgramPart::Rest }
    }

    fn setpoint(&self, pose: &MachinePose, vel_per_s: &MachinePose, phase: Phase, reasons: Reasons) -> What {
        let n_joints = self.steering.n_joints();
        let own = |values: &MachinePose| {
            let bend = if n_joints == 0 { [values[0], values[1]] } else { [f64::NAN; 2] };
            (bend, self.steering.joint_values(values))
        };
        let ((bend_rad, joints_rad), (bend_vel_rad_per_s, joints_vel_rad_per_s)) = (own(pose), own(vel_per_s));
        What::Setpoint(Setpoint {
            sequence: 0,
            sample_ns: 0,
            stamps: krait_ipc::message::HopStamps::default(),
            input_sequence: 0,
            state_sequence: 0,
            bend_rad,
            bend_vel_rad_per_s,
            joints_rad,
            joints_vel_rad_per_s,
            // A forecast that only `resolve` makes.
            q_tilde_vel_m_per_s: lines([f64::NAN; N_LINES]),
            n_actuators: self.steering.n_actuators(),
            n_joints,
            tip_pos_in_base_m: self.steering.tip_pos_in_base_m(pose),
            motion_scale: 1.0,
            model_hash: self.model.0,
            phase: phase as u32,
            reserved: 0,
            reasons: reasons.bits(),
        })
    }
}

fn operator_input(hand: &Vector6<f64>, flags: u32, device: DeviceState) -> OperatorInput {
    OperatorInput {
        sequence: 0,
        sample_ns: 0,
        stamps: krait_ipc::message::HopStamps::default(),
        tip_vel_in_view_m_per_s: [hand[0], hand[1], hand[2]],
        tip_angular_vel_in_view_rad_per_s: [hand[3], hand[4], hand[5]],
        raw_axes: [0; 6],
        flags,
        buttons: 0,
        device_state: device as u32,
        scale_permille: 1000,
        n_reports: 0,
        n_drained: 0,
        n_refused: 0,
    }
}
