//! The operator input of one pass of a recording, read ahead by a thread as far as a bounded queue allows: an hour of it
//! takes no more memory than a minute.

use crate::ReplayError;
use crate::steering::{MachinePose, pose_of_setpoint};
use crate::steps::model_of;
use core::ops::Range;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};
use crossbeam_channel::{Receiver, Sender, bounded};
use krait_ipc::message::{Command, OperatorInput, Setpoint};
use krait_model::ModelHash;
use krait_record::PassCounter;
use krait_record::Stream;
use krait_schema::{Channel, Sample};
use std::path::PathBuf;
use std::sync::Arc;

/// Inputs that are handed over at once.
const BATCH: usize = 256;
/// Batches that may wait: 8 s of a recording at 1 kHz, some 2 MB.
const N_WAITING: usize = 32;
/// What the thread does, for error sentences.
const DOING: &str = "reads the recording";
/// Fastest tip velocity that `resolve` takes for a hand's, m/s.
const MAX_TIP_VEL_M_PER_S: f64 = 1.0;
/// Longest gap between two samples that is still one recording, ns: an hour.
const MAX_GAP_NS: i64 = 3_600_000_000_000;
/// Latest instant that a recording may begin at, ns: 146 years, so that no sum overflows.
const MAX_START_NS: i64 = i64::MAX / 2;

/// Which inputs are played.
#[derive(Clone, Debug, PartialEq)]
pub struct InputChoice {
    /// The recording, or its first part.
    pub path: PathBuf,
    /// Which of the chains that ran in it, from 1.
    pub pass: u64,
    /// The time after the pass's first input, s.
    pub range_s: Range<f64>,
}

/// What a recording's pass begins with.
#[derive(Clone, Copy, Debug)]
pub struct Beginning {
    /// The first input in the range.
    pub first: OperatorInput,
    /// Where the setpoint was when that came.
    pub start: MachinePose,
    /// Joints of that setpoint, or bends of its segments; 0 for a snake.
    pub n_joints: u32,
    /// Segments of that setpoint; 0 for a snake and for joints.
    pub n_segments: usize,
    /// Which model the pass was compensated with, if it holds a command that says so.
    pub model: Option<ModelHash>,
}

/// What a track has handed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TrackCounts {
    /// Inputs taken out of the file, over all loops.
    pub n_read: u64,
    /// Inputs of the pass that `resolve` would refuse, over all loops; they are left out.
    pub n_refused: u64,
}

/// Plays the chosen inputs, as often as it is rewound.
#[derive(Debug)]
pub struct InputTrack {
    choice: InputChoice,
    reader: Option<Receiver<Batch>>,
    batch: std::vec::IntoIter<OperatorInput>,
    counts: Arc<Counts>,
}

/// Some inputs; an empty batch is the end.
type Batch = Result<Vec<OperatorInput>, ReplayError>;

#[derive(Debug, Default)]
struct Counts {
    n_read: AtomicU64,
    n_refused: AtomicU64,
}

impl InputTrack {
    /// A track at its beginning. Nothing is read before the first input is asked for.
    pub fn new(choice: InputChoice) -> Self {
        Self { choice, reader: None, batch: Vec::new().into_iter(), counts: Arc::default() }
    }

    /// What was handed over so far.
    pub fn counts(&self) -> TrackCounts {
        let Counts { n_read, n_refused } = &*self.counts;
        TrackCounts { n_read: n_read.load(Relaxed), n_refused: n_refused.load(Relaxed) }
    }

    /// The next input; `None` at the end, after which the track begins anew. Waits for the disk where that is slower.
    pub(crate) fn next(&mut self) -> Result<Option<OperatorInput>, ReplayError> {
        loop {
            if let Some(input) = self.batch.next() {
                return Ok(Some(input));
            }
            let reader = match &self.reader {
                Some(reader) => reader,
                None => self.reader.insert(start(&self.choice, &self.counts)?),
            };
            let died = |_| ReplayError::Thread { doing: DOING, what: "it died".to_owned() };
            let batch = reader.recv().map_err(died)??;
            if batch.is_empty() {
                self.rewind();
                return Ok(None);
            }
            self.batch = batch.into_iter();
        }
    }

    /// Goes back to the beginning.
    pub(crate) fn rewind(&mut self) {
        (self.reader, self.batch) = (None, Vec::new().into_iter());
    }
}

fn start(choice: &InputChoice, counts: &Arc<Counts>) -> Result<Receiver<Batch>, ReplayError> {
    let (sender, receiver) = bounded(N_WAITING);
    let (choice, counts) = (choice.clone(), Arc::clone(counts));
    std::thread::Builder::new()
        .name("replay-read".to_owned())
        .spawn(move || {
            // A track that is gone or was rewound wants no more.
            if let Err(error) = read(&choice, &counts, &sender) {
                let _nobody_listens = sender.send(Err(error));
            }
        })
        .map_err(|error| ReplayError::Thread { doing: DOING, what: error.to_string() })?;
    Ok(receiver)
}

fn read(choice: &InputChoice, counts: &Counts, batches: &Sender<Batch>) -> Result<(), ReplayError> {
    let mut pass = PassCounter::default();
    let mut sieve = Sieve::default();
    let mut batch = Vec::with_capacity(BATCH);
    for recorded in Stream::open(&choice.path, &[Channel::Input])? {
        let Sample::Input(input) = recorded?.sample else { continue };
        match pass.of(input.sequence).cmp(&choice.pass) {
            core::cmp::Ordering::Less => continue,
            core::cmp::Ordering::Greater => break,
            core::cmp::Ordering::Equal => {}
        }
        let Some(time_s) = sieve.takes(&input) else {
            counts.n_refused.fetch_add(1, Relaxed);
            continue;
        };
        if time_s >= choice.range_s.end {
            break;
        }
        if choice.range_s.contains(&time_s) {
            batch.push(input);
        }
        if batch.len() == BATCH && !hand_over(&mut batch, counts, batches) {
            return Ok(());
        }
    }
    if batch.is_empty() || hand_over(&mut batch, counts, batches) {
        hand_over(&mut Vec::new(), counts, batches);
    }
    Ok(())
}

/// Whether somebody still listens.
fn hand_over(batch: &mut Vec<OperatorInput>, counts: &Counts, batches: &Sender<Batch>) -> bool {
    counts.n_read.fetch_add(batch.len() as u64, Relaxed);
    let full = core::mem::replace(batch, Vec::with_capacity(BATCH));
    batches.send(Ok(full)).is_ok()
}

impl Beginning {
    /// Reads as far into a recording as its pass's beginning needs.
    ///
    /// # Errors
    /// [`ReplayError::Read`] when it cannot be read, [`ReplayError::NoPass`] when it has no such pass,
    /// [`ReplayError::Empty`] or [`ReplayError::EmptyRange`] when there is no input.
    pub fn read(choice: &InputChoice) -> Result<Self, ReplayError> {
        let mut passes = [PassCounter::default(); 3];
        let mut sieve = Sieve::default();
        let mut first: Option<OperatorInput> = None;
        let mut setpoints: Vec<Setpoint> = Vec::new();
        let mut command: Option<Command> = None;
        let mut n_inputs: u64 = 0;
        for recorded in Stream::open(&choice.path, &[Channel::Input, Channel::Setpoint, Channel::Command])? {
            match recorded?.sample {
                Sample::Input(input) if passes[0].of(input.sequence) == choice.pass => {
                    n_inputs += 1;
                    let is_within = sieve.takes(&input).is_some_and(|time_s| choice.range_s.contains(&time_s));
                    if is_within && first.is_none() {
                        first = Some(input);
                    }
                }
                Sample::Setpoint(setpoint) if passes[1].of(setpoint.sequence) == choice.pass => {
                    // Only the newest is of use until the first input is known; the channels are recorded in turn, so a
                    // setpoint may stand before its input.
                    setpoints.push(setpoint);
                    forget_old(&mut setpoints, first.map(|first| first.sequence));
                }
                Sample::Command(m) if passes[2].of(m.sequence) == choice.pass => {
                    command.get_or_insert(m);
                }
                _ => {}
            }
            let is_known = first.is_some_and(|first| setpoints.iter().any(|s| s.input_sequence >= first.sequence));
            if (is_known && command.is_some()) || passes.iter().any(|pass| pass.newest > choice.pass) {
                break;
            }
        }
        let n_passes = passes.iter().map(|pass| pass.newest).max().unwrap_or(0);
        if n_passes < choice.pass {
            return Err(ReplayError::NoPass { pass: choice.pass, n_passes });
        }
        let Some(first) = first else {
            return Err(match n_inputs {
                0 => ReplayError::Empty { what: "operator input" },
                _ => ReplayError::EmptyRange { from_s: choice.range_s.start, to_s: choice.range_s.end },
            });
        };
        let before = setpoints.iter().rev().find(|setpoint| setpoint.input_sequence < first.sequence);
        let before = before.or(setpoints.first());
        let start = before.map_or_else(MachinePose::zeros, pose_of_setpoint);
        let n_joints = before.map_or(0, |setpoint| setpoint.n_joints);
        let n_segments = before.map_or(0, Setpoint::n_segments);
        Ok(Self { first, start, n_joints, n_segments, model: command.and_then(|command| model_of(&command)) })
    }
}

/// Setpoints that are looked at again when the first input is found: 2 s at 1 kHz, more than the recorder's turns can put
/// before their inputs.
const N_SETPOINTS: usize = 2048;

fn forget_old(setpoints: &mut Vec<Setpoint>, first_input: Option<u64>) {
    if first_input.is_none() && setpoints.len() > 2 * N_SETPOINTS {
        setpoints.drain(..N_SETPOINTS);
    }
}

/// Lets through what `resolve` would take: finite, no faster than a hand, each after the one before and within an hour of
/// it.
#[derive(Clone, Copy, Debug, Default)]
struct Sieve {
    first_ns: Option<i64>,
    last_ns: Option<i64>,
}

impl Sieve {
    /// The time after the first input, s; `None` for an input that is left out.
    fn takes(&mut self, input: &OperatorInput) -> Option<f64> {
        let is_hand = input.tip_vel_in_view_m_per_s.iter().all(|v| v.abs() <= MAX_TIP_VEL_M_PER_S)
            && input.tip_angular_vel_in_view_rad_per_s.iter().all(|v| v.is_finite());
        let follows = match self.last_ns {
            Some(before_ns) => (1..=MAX_GAP_NS).contains(&input.sample_ns.saturating_sub(before_ns)),
            None => (0..=MAX_START_NS).contains(&input.sample_ns),
        };
        if !(is_hand && follows) {
            return None;
        }
        self.last_ns = Some(input.sample_ns);
        let first_ns = *self.first_ns.get_or_insert(input.sample_ns);
        Some(input.sample_ns.saturating_sub(first_ns) as f64 * 1e-9)
    }
}
