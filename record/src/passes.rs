//! A recording taken apart: the messages of each chain that ran in it, channel by channel.

use crate::{Recording, RecordingReadError};
use krait_ipc::message::{Command, Marker, Message, ModelUpdate, OperatorInput, Setpoint, Shape, SlaveState};
use krait_schema::Sample;

/// The messages of one chain, each channel in the order of its sequence numbers.
#[derive(Clone, Debug, Default)]
pub struct Pass {
    /// What the operator asked for.
    pub inputs: Vec<OperatorInput>,
    /// Where the snake was to be.
    pub setpoints: Vec<Setpoint>,
    /// What the actuators were told.
    pub commands: Vec<Command>,
    /// What the actuators did.
    pub states: Vec<SlaveState>,
    /// What the estimator had learnt.
    pub updates: Vec<ModelUpdate>,
    /// What the camera saw.
    pub shapes: Vec<Shape>,
    /// Marks that were set while this chain ran, in their order; those from before the first chain are the first one's.
    pub marks: Vec<Marker>,
}

/// Takes the parts of a recording apart, in their order. A channel whose sequence numbers begin anew at 1 begins its next
/// pass; a new part begins none.
///
/// # Errors
/// [`RecordingReadError`] when the recording cannot be read.
pub fn passes_of(parts: &[Recording]) -> Result<Vec<Pass>, RecordingReadError> {
    let (mut passes, mut marks) = (Passes::default(), Vec::new());
    let parts = parts.iter().map(Recording::samples).collect::<Result<Vec<_>, _>>()?;
    for recorded in parts.into_iter().flatten() {
        match recorded?.sample {
            Sample::Input(m) => passes.of(0, m.sequence).inputs.push(m),
            Sample::Setpoint(m) => passes.of(1, m.sequence).setpoints.push(m),
            Sample::Command(m) => passes.of(2, m.sequence).commands.push(m),
            Sample::State(m) => passes.of(3, m.sequence).states.push(m),
            Sample::ModelUpdate(m) => passes.of(4, m.sequence).updates.push(m),
            Sample::Shape(m) => passes.of(5, m.sequence).shapes.push(m),
            Sample::Marker(m) | Sample::DeviceMarker(m) => marks.push(*m),
            _ => {}
        }
    }
    for pass in &mut passes.all {
        pass.sort();
    }
    marks.sort_by_key(|mark| mark.sample_ns);
    for mark in marks {
        let begun = |pass: &Pass| pass.begin_ns().is_some_and(|begin_ns| begin_ns <= mark.sample_ns);
        let place = passes.all.iter().rposition(begun).unwrap_or(0);
        if let Some(pass) = passes.all.get_mut(place) {
            pass.marks.push(mark);
        }
    }
    Ok(passes.all)
}

/// The text of a file that a recording embeds; `None` when it has none of that name or it is no text.
pub fn attachment<'a>(recording: &'a Recording, name: &str) -> Option<&'a str> {
    let found = recording.contents().attachments.iter().find(|attachment| attachment.name == name)?;
    std::str::from_utf8(&found.data).ok()
}

impl Pass {
    /// The instant of its first setpoint, or of its first state where it has none, ns.
    fn begin_ns(&self) -> Option<i64> {
        let setpoint_ns = self.setpoints.first().map(|setpoint| setpoint.sample_ns);
        setpoint_ns.or_else(|| self.states.first().map(|state| state.sample_ns))
    }

    /// A file may hold anything in any order; what is looked up must be sorted, each number once.
    fn sort(&mut self) {
        fn sort<M: Message>(messages: &mut Vec<M>) {
            messages.sort_by_key(Message::sequence);
            messages.dedup_by_key(|message| message.sequence());
        }
        sort(&mut self.inputs);
        sort(&mut self.setpoints);
        sort(&mut self.commands);
        sort(&mut self.states);
        sort(&mut self.updates);
        sort(&mut self.shapes);
    }
}

/// Passes under construction. Each channel counts its own, because the recorder takes the channels in turn.
#[derive(Default)]
struct Passes {
    all: Vec<Pass>,
    counters: [PassCounter; 6],
}

/// Counts the passes of a channel: sequence numbers that begin anew at 1 begin the next.
#[derive(Clone, Copy, Debug, Default)]
pub struct PassCounter {
    /// The pass of the newest message, from 1; 0 before the first.
    pub newest: u64,
}

impl PassCounter {
    /// The pass, from 1, that the message with this sequence number belongs to.
    pub fn of(&mut self, sequence: u64) -> u64 {
        if sequence == 1 || self.newest == 0 {
            self.newest += 1;
        }
        self.newest
    }
}

impl Passes {
    /// The pass that a message belongs to.
    fn of(&mut self, channel: usize, sequence: u64) -> &mut Pass {
        let idx = self.counters[channel].of(sequence) as usize - 1;
        if self.all.len() <= idx {
            self.all.resize_with(idx + 1, Pass::default);
        }
        &mut self.all[idx]
    }
}
