//! The page's view of the chain as JSON: the only place that knows both krait's messages and the page's fields.
//!
//! A *frame* goes out for every picture; *slow* facts twice a second; *hello* once. Angles are radians, positions metres,
//! instants milliseconds on the server's monotonic clock.

use crate::facts::Facts;
use crate::latency::{LiveLatencyReport, stretch_names};
use crate::load_limit::LoadsTold;
use crate::pad::PadSeen;
use crate::processes::ProcessUsage;
use crate::words::{Level, Shown, ShownState, Words, fault_sentence, words_of};
use krait_ipc::message::{
    Command, DeviceState, Health, JointValues, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState, used,
};
use krait_ipc::{Reason, Reasons};
use serde::Serialize;

/// A state older than this is no picture, ns.
pub const STALE_NS: i64 = 500_000_000;
/// A shape older than this is missing, ns: thirty pictures of a camera.
const SHAPE_STALE_NS: i64 = 500_000_000;

/// The newest message of each channel.
#[derive(Clone, Debug, Default)]
pub struct NewestSamples {
    /// Operator.
    pub input: Option<OperatorInput>,
    /// Where the snake shall be.
    pub setpoint: Option<Setpoint>,
    /// What the actuators are told.
    pub command: Option<Command>,
    /// What the actuators do.
    pub state: Option<SlaveState>,
    /// What the camera saw.
    pub shape: Option<Shape>,
    /// What the estimator learnt.
    pub model_update: Option<ModelUpdate>,
    /// Whose load was at its limit, and when.
    pub loads: LoadsTold,
    /// The processes.
    pub healths: Vec<(krait_ipc::Process, Option<Health>)>,
}

/// A page that drives has no plug.
const PAD_LOST: Words = Words {
    level: Level::Warn,
    say: "The page that drives is lost.",
    todo: "Let go of its pad, then hold it anew.",
    banner: "",
};

impl NewestSamples {
    /// The state, where it is fresh enough to be a picture.
    pub fn fresh_state(&self, now_ns: i64) -> Option<&SlaveState> {
        self.state.as_ref().filter(|state| now_ns - state.sample_ns < STALE_NS)
    }

    /// What the operator does, where that is no older than a picture: a master that hangs says nothing of him.
    pub fn fresh_input(&self, now_ns: i64) -> Option<&OperatorInput> {
        self.input.as_ref().filter(|input| now_ns - input.sample_ns < STALE_NS)
    }

    /// The shape, where it is fresh enough to be a picture.
    pub fn fresh_shape(&self, now_ns: i64) -> Option<&Shape> {
        self.shape.as_ref().filter(|shape| now_ns - shape.sample_ns < SHAPE_STALE_NS)
    }

    /// The words of a reason at an instant.
    pub fn words_of(&self, reason: Reason, now_ns: i64) -> Words {
        match reason {
            Reason::ForceLimit => self.loads.at_limit(now_ns).words(),
            Reason::DeviceLost if self.input.is_some_and(|input| input.is_from_pad()) => PAD_LOST,
            _ => words_of(reason),
        }
    }

    /// The state to be shown while these reasons hold.
    pub fn shown(&self, now_ns: i64, reasons: Reasons) -> Shown {
        let input = self.fresh_input(now_ns);
        let circumstances = ShownState {
            state: self.fresh_state(now_ns),
            device: input.and_then(OperatorInput::device),
            is_present: input.is_some_and(OperatorInput::operator_present),
            is_clutched: input.is_some_and(OperatorInput::clutch_pressed),
            phase: self.setpoint.and_then(|setpoint| setpoint.phase()),
            is_limited: reasons.iter().any(|reason| !self.words_of(reason, now_ns).banner.is_empty()),
        };
        circumstances.shown()
    }
}

/// What goes into a frame besides messages.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Number of the frame.
    pub n: u64,
    /// Now, ns.
    pub now_ns: i64,
    /// Reasons that hold or held so shortly that nobody could have read them.
    pub reasons: Reasons,
    /// Tracking error over a second, rad; of joints that of the worst, rad (m where it slides).
    pub error_rms: Option<f64>,
    /// The same of each joint; zeros behind the last.
    pub joint_errors_rms: Option<JointValues>,
    /// Newest tracking error, as `error_rms`.
    pub error: Option<f64>,
    /// Who has the drive pad; nothing where there is none.
    pub pad: Option<PadSeen>,
}

#[derive(Serialize)]
struct Frame<'a> {
    k: &'static str,
    n: u64,
    t_ms: f64,
    shown: Shown,
    age_ms: Option<f64>,
    state: Option<State<'a>>,
    operator: Option<Operator>,
    bend: Option<[f64; 2]>,
    sigma: Option<f64>,
    setpoint: Option<[f64; 2]>,
    motion_scale: Option<f64>,
    q_tilde_m: Option<Vec<f64>>,
    joints: Option<Joints>,
    jaw: Option<Jaw>,
    err: Option<f64>,
    err_rms: Option<f64>,
    reasons: Vec<Shortly>,
    pad: Option<PadSeen>,
}

#[derive(Serialize)]
struct State<'a> {
    operating: &'a str,
    homed: bool,
    engaged: bool,
    busy: bool,
    q_m: Vec<f64>,
    // A load that is not measured is null, never zero.
    tau_n: Vec<f64>,
    /// Of each actuator whether it is under power by its drive's own report.
    power: Vec<bool>,
    n_refused: u64,
    /// What is said of a failure of the drives, while they are in FAULT.
    failure: Option<String>,
}

/// Positions of joints, rad (m where they slide); a joint that is not measured is null.
#[derive(Serialize)]
struct Joints {
    wanted: Vec<f64>,
    measured: Option<Vec<f64>>,
    err_rms: Option<Vec<f64>>,
}

impl Joints {
    fn of(newest: &NewestSamples, moment: &Moment) -> Option<Self> {
        let setpoint = newest.setpoint.as_ref().filter(|setpoint| setpoint.n_joints > 0)?;
        let n = (setpoint.n_joints as usize).min(setpoint.joints_rad.len());
        let measured = newest.fresh_shape(moment.now_ns).and_then(Shape::valid_joints_rad).map(<[f64]>::to_vec);
        Some(Self {
            wanted: setpoint.joints_rad[..n].to_vec(),
            measured: measured.filter(|joints| joints.len() == n),
            err_rms: moment.joint_errors_rms.map(|errors| errors[..n].to_vec()),
        })
    }
}

/// The jaw of a snake's gripper, rad; null where it is not measured.
#[derive(Serialize)]
struct Jaw {
    wanted: f64,
    measured: Option<f64>,
}

#[derive(Serialize)]
struct Operator {
    device: &'static str,
    present: bool,
    clutch: bool,
    /// Part of the configured speed at which the hand moves the tip; null where nobody says.
    scale: Option<f64>,
    /// What is not taken from the hand.
    locked: Vec<&'static str>,
}

/// A reason of the frame: its number, value and limit where both are known, and words in place of those of the hello where it has
/// several causes.
#[derive(Serialize)]
struct Shortly {
    id: u32,
    value: Option<String>,
    words: Option<Words>,
}

/// One frame.
///
/// # Errors
/// Never: every field is a number, a text or null.
pub fn frame(newest: &NewestSamples, moment: &Moment, facts: &Facts) -> serde_json::Result<String> {
    let fresh = newest.fresh_state(moment.now_ns);
    let shape = newest.fresh_shape(moment.now_ns);
    let shown = newest.shown(moment.now_ns, moment.reasons);
    let mut reasons: Vec<Reason> = moment.reasons.iter().collect();
    reasons.sort_by_key(|reason| newest.words_of(*reason, moment.now_ns).level);
    let frame = Frame {
        k: "frame",
        n: moment.n,
        t_ms: moment.now_ns as f64 * 1e-6,
        shown,
        age_ms: newest.state.map(|state| (moment.now_ns - state.sample_ns) as f64 * 1e-6),
        state: fresh.map(|state| State {
            operating: state.operating().map_or("UNKNOWN", |operating| operating.name()),
            homed: state.flags & SlaveState::IS_HOMED != 0,
            engaged: state.is_engaged(),
            busy: state.flags & SlaveState::IS_BUSY != 0,
            q_m: used(&state.measured_q_m, state.n_actuators).to_vec(),
            tau_n: used(&state.measured_tau_n, state.n_actuators).to_vec(),
            power: state.has_power().collect(),
            n_refused: state.n_refused,
            failure: matches!(shown, Shown::Fault | Shown::Emergency).then(|| fault_sentence(state)),
        }),
        operator: newest.fresh_input(moment.now_ns).map(|input| Operator {
            device: input.device().map_or("unknown", device_word),
            present: input.operator_present(),
            clutch: input.clutch_pressed(),
            scale: input.scale(),
            locked: input.locked().collect(),
        }),
        bend: shape.and_then(|shape| shape.valid_bend_rad()),
        sigma: shape.map(|shape| shape.sigma_bend_rad()),
        setpoint: newest.setpoint.map(|setpoint| setpoint.bend_rad).filter(|bend| bend.iter().all(|b| b.is_finite())),
        motion_scale: newest.setpoint.map(|setpoint| setpoint.motion_scale),
        q_tilde_m: newest.command.map(|command| used(&command.q_tilde_m, command.n_actuators).to_vec()),
        joints: Joints::of(newest, moment),
        jaw: newest
            .setpoint
            .as_ref()
            .and_then(Setpoint::jaw_rad)
            .map(|wanted| Jaw { wanted, measured: shape.and_then(Shape::valid_jaw_rad) }),
        err: moment.error,
        err_rms: moment.error_rms,
        reasons: reasons
            .into_iter()
            .map(|reason| Shortly {
                id: reason as u32,
                value: value_of(reason, newest, facts, moment.now_ns),
                words: matches!(reason, Reason::ForceLimit | Reason::DeviceLost)
                    .then(|| newest.words_of(reason, moment.now_ns)),
            })
            .collect(),
        pad: moment.pad,
    };
    serde_json::to_string(&frame)
}

/// Value and limit of a reason, from the messages themselves: what a process's health keeps is the worst ever.
fn value_of(reason: Reason, newest: &NewestSamples, facts: &Facts, now_ns: i64) -> Option<String> {
    let largest = |values: &[f64]| {
        let sizes = values.iter().enumerate().map(|(line, value)| (line + 1, value.abs()));
        sizes.filter(|(_, size)| size.is_finite()).max_by(|(_, a), (_, b)| a.total_cmp(b))
    };
    match reason {
        Reason::BendLimit => {
            let [x, y] = newest.setpoint?.bend_rad;
            Some(format!("{:.0}\u{b0} of {:.0}\u{b0}.", x.hypot(y).to_degrees(), facts.max_bend_rad.to_degrees()))
        }
        Reason::StrokeLimit => {
            let command = newest.command?;
            let (line, q_m) = largest(used(&command.q_tilde_m, command.n_actuators))?;
            Some(format!("Line {line}: {:.2} of {:.2} mm.", q_m * 1e3, facts.max_stroke_m * 1e3))
        }
        Reason::ForceLimit => newest.loads.at_limit(now_ns).value(newest, facts),
        Reason::DriveFault if newest.state?.is_hardware_stopped() => {
            Some("Release the machine\u{2019}s stop.".to_owned())
        }
        Reason::OperatorAbsent if newest.input?.is_from_pad() => Some("Hold the drive pad to follow.".to_owned()),
        Reason::OperatorAbsent => Some(facts.presence_hint.clone()),
        _ => None,
    }
}

fn device_word(device: DeviceState) -> &'static str {
    match device {
        DeviceState::Waiting => "waiting",
        DeviceState::Live => "live",
        DeviceState::AtRest => "at rest",
        DeviceState::Lost => "lost",
        DeviceState::Ended => "ended",
    }
}

/// What changes slowly.
#[derive(Clone, Debug, Serialize)]
pub struct Slow {
    /// Names this kind of message.
    pub k: &'static str,
    /// Latency since the console began.
    pub latency: LiveLatencyReport,
    /// The processes of the instance.
    pub processes: Vec<ProcessRow>,
    /// Messages that this console has lost of all channels that it reads.
    pub n_lost_here: u64,
    /// Pages that are open.
    pub n_pages: usize,
    /// Frames that pages skipped because they were slow.
    pub n_skipped: u64,
    /// Which model the newest command rests on: its hash, 16 hexadecimal digits.
    pub model: Option<String>,
    /// Whether the watch for changes says that the model no longer explains the snake.
    pub has_changed: bool,
    /// Seconds that the recorder has been at work; null where there is none.
    pub recording_s: Option<f64>,
}

/// A process with what it says of itself.
#[derive(Clone, Debug, Serialize)]
pub struct ProcessRow {
    /// What the kernel says.
    #[serde(flatten)]
    pub usage: ProcessUsage,
    /// Messages lost, by its own count.
    pub n_lost: Option<u64>,
    /// Messages refused, by its own count.
    pub n_refused: Option<u64>,
    /// How its worst reason of now is put; null where nothing holds.
    pub says: Option<&'static str>,
    /// The level of that reason.
    pub level: Option<Level>,
    /// Whether its last word is older than a second.
    pub is_silent: bool,
}

/// Joins what the kernel and the processes themselves say.
pub fn processes(usages: Vec<ProcessUsage>, newest: &NewestSamples, now_ns: i64) -> Vec<ProcessRow> {
    let health_of = |usage: &ProcessUsage| {
        let mut all = newest.healths.iter();
        all.find(|(process, _)| process.name() == usage.name)
            .and_then(|(_, health)| *health)
            .filter(|h| h.pid == usage.pid)
    };
    let process = |usage: ProcessUsage| {
        let health = health_of(&usage);
        let reasons = health.map(|health| Reasons::from_bits(health.reasons_now));
        // What holds the motion still is no fault of a process.
        let words_of = |reason| newest.words_of(reason, now_ns);
        let worst = reasons.and_then(|reasons| reasons.iter().map(words_of).min_by_key(|words| words.level));
        let told = worst.filter(|words| words.level <= Level::Warn);
        ProcessRow {
            n_lost: health.map(|health| health.n_lost),
            n_refused: health.map(|health| health.n_refused),
            says: told.map(|words| words.say),
            level: told.map(|words| words.level),
            is_silent: health.is_some_and(|health| now_ns - health.sample_ns > 1_000_000_000),
            usage,
        }
    };
    usages.into_iter().map(process).collect()
}

/// What a page is told first.
#[derive(Serialize)]
struct Hello<'a> {
    k: &'static str,
    version: &'static str,
    session: &'a str,
    stop_url: &'a str,
    page: u64,
    facts: &'a Facts,
    stretches: Vec<String>,
    reasons: Vec<Named>,
}

#[derive(Serialize)]
struct Named {
    name: String,
    #[serde(flatten)]
    words: Words,
}

/// The first message to a page, which is told its own number.
///
/// # Errors
/// Never: every field is a number or a text.
pub fn hello(facts: &Facts, session: &str, stop_url: &str, page: u64) -> serde_json::Result<String> {
    let named = |reason: Reason| Named { name: format!("{reason:?}"), words: words_of(reason) };
    serde_json::to_string(&Hello {
        k: "hello",
        version: env!("CARGO_PKG_VERSION"),
        session,
        stop_url,
        page,
        facts,
        stretches: stretch_names(),
        reasons: Reason::ALL.into_iter().map(named).collect(),
    })
}
