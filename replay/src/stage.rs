//! The stages whose steps are repeated: what each takes and gives, and where its outputs say what they rest on.

use crate::window::{Of, Window};
use krait_ipc::Process;
use krait_ipc::message::{Command, Cue, Message, OperatorInput, Setpoint};
use krait_schema::{Channel, Sample};

/// A stage between two channels.
pub trait Stage {
    /// What it takes.
    type In: Message;
    /// What it gives.
    type Out: Message;
    /// Which process it is.
    const PROCESS: Process;
    /// The channels that its steps rest on, its own outputs among them.
    const CHANNELS: &'static [Channel];
    /// What an output rests on.
    fn rests_on(out: &Self::Out) -> RestsOn;
    /// An output as a recording holds it.
    fn sample(out: &Self::Out) -> Sample;
    #[doc(hidden)]
    fn inputs() -> Queue<Self::In>;
    #[doc(hidden)]
    fn outputs() -> Queue<Self::Out>;
}

/// A channel of a window.
pub struct Queue<M>(pub(crate) Of<M>);

/// What a recorded output names.
#[derive(Clone, Copy, Debug)]
pub struct RestsOn {
    /// Number of the message that it answers.
    pub taken_sequence: u64,
    /// The model in force.
    pub model_hash: u64,
    /// When it was published, ns: nothing that it names came later.
    pub sent_ns: i64,
    /// Time, states and updates, as the stage is told them.
    pub cue: Cue,
}

/// `krait resolve`.
#[derive(Debug)]
pub struct Resolve;

/// `krait compensate`.
#[derive(Debug)]
pub struct Compensate;

impl Stage for Resolve {
    type In = OperatorInput;
    type Out = Setpoint;
    const PROCESS: Process = Process::Resolve;
    const CHANNELS: &'static [Channel] = &[Channel::Input, Channel::Setpoint, Channel::State];

    fn rests_on(out: &Setpoint) -> RestsOn {
        let cue = Cue {
            sample_ns: out.sample_ns,
            input_sequence: out.input_sequence,
            resolve_begun_ns: out.stamps.resolve_begun_ns,
            setpoint_sent_ns: out.stamps.setpoint_sent_ns,
            resolve_state_sequence: out.state_sequence,
            ..Cue::default()
        };
        let sent_ns = out.stamps.setpoint_sent_ns;
        RestsOn { taken_sequence: out.input_sequence, model_hash: out.model_hash, sent_ns, cue }
    }

    fn sample(out: &Setpoint) -> Sample {
        Sample::Setpoint(*out)
    }

    fn inputs() -> Queue<OperatorInput> {
        Queue(|window: &mut Window| &mut window.inputs)
    }

    fn outputs() -> Queue<Setpoint> {
        Queue(|window: &mut Window| &mut window.setpoints)
    }
}

impl Stage for Compensate {
    type In = Setpoint;
    type Out = Command;
    const PROCESS: Process = Process::Compensate;
    const CHANNELS: &'static [Channel] = &[Channel::Setpoint, Channel::Command, Channel::State, Channel::ModelUpdate];

    fn rests_on(out: &Command) -> RestsOn {
        let cue = Cue {
            sample_ns: out.sample_ns,
            input_sequence: out.input_sequence,
            compensate_begun_ns: out.stamps.compensate_begun_ns,
            command_sent_ns: out.stamps.command_sent_ns,
            compensate_state_sequence: out.state_sequence,
            model_update_sequence: out.model_update_sequence,
            ..Cue::default()
        };
        let sent_ns = out.stamps.command_sent_ns;
        RestsOn { taken_sequence: out.setpoint_sequence, model_hash: out.model_hash, sent_ns, cue }
    }

    fn sample(out: &Command) -> Sample {
        Sample::Command(*out)
    }

    fn inputs() -> Queue<Setpoint> {
        Queue(|window: &mut Window| &mut window.setpoints)
    }

    fn outputs() -> Queue<Command> {
        Queue(|window: &mut Window| &mut window.commands)
    }
}
