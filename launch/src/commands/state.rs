//! `krait state`: the operating state of a chain that runs, what keeps the snake from moving, and requests for another state.

use crate::cli::{Ask, Common, StateArgs};
use crate::commands::motion_wish;
use crate::{commands, print};
use anyhow::{Context, bail};
use core::time::Duration;
use krait_console::fault_sentence;
use krait_ipc::message::{
    Command, Health, Message, OperatingState, OperatorInput, RequestOutcome, SlaveState, StateAnswer, StateRequest,
    Transition,
};
use krait_ipc::{Bus, IpcError, Process, ReadOptions, Reader, Reason, Reasons, clock, health_channel};
use krait_slave::OperatingMachine;
use serde::Serialize;
use std::process::ExitCode;

/// Its name among the members of an instance.
pub const NAME: &str = "state";
/// What `home` came to, where the drives know their place.
const HOMED_IN_PLACE: &str = "`home` moved nothing: these drives know their place, and each stands within its travel of zero. A chain that runs \
     looks for no mechanical stop; end it and use `krait drives --zero` for that.";
/// The supervisor looks every 20 ms, and gives the slave a second.
const PATIENCE_NS: i64 = 5_000_000_000;
/// Homing takes seconds: the largest travel at the slowest speed, and some.
const HOMING_PATIENCE_NS: i64 = 120_000_000_000;
/// Lines are relaxed for 10 s at most (`disable_relax_ms`), and some.
const RELAXING_PATIENCE_NS: i64 = 12_000_000_000;
/// How long the newest message of a channel is waited for where only the state is shown, ns.
const GLANCE_NS: i64 = 100_000_000;
/// A process tells its health ten times a second; how long those of the chain are waited for together, ns.
const HEALTH_NS: i64 = 300_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// Who names reasons with a value and a limit; who is nearest to the drives comes first.
const NAMING: [Process; 4] = [Process::Slave, Process::Compensate, Process::Resolve, Process::Master];

/// Shows the state, or asks for another one and shows what became of that.
pub fn run(common: &Common, args: &StateArgs) -> anyhow::Result<ExitCode> {
    let bus = Bus::open(&common.instance, NAME)?;
    commands::refuse_without(&bus, "slave", "state")?;
    let mut view = View::open(&bus)?;
    let mut moved_nothing = false;
    if let Some(ask) = args.ask {
        let answer = view.ask(&bus, transition_of(ask))?;
        moved_nothing = matches!(ask, Ask::Home) && answer.flags & SlaveState::HOMES_IN_PLACE != 0;
    }
    if args.scale.is_some() || args.lock.is_some() || args.unlock.is_some() {
        motion_wish::ask(&bus, args)?;
    }
    let command = newest::<Command>(&mut bus.reader(ReadOptions::observing())?, GLANCE_NS)?;
    let mut shown = view.show(command.as_ref())?;
    shown.note = (moved_nothing && shown.is_homed).then_some(HOMED_IN_PLACE);
    if let Some(input) = newest::<OperatorInput>(&mut bus.reader(ReadOptions::observing())?, GLANCE_NS)? {
        let is_locked = |flag| Some(input.flags & flag != 0);
        shown.scale = Some(f64::from(input.scale_permille) / 1000.0);
        shown.is_translation_locked = is_locked(OperatorInput::TRANSLATION_LOCKED);
        shown.is_rotation_locked = is_locked(OperatorInput::ROTATION_LOCKED);
    }
    if args.json {
        print::json(&shown)?;
    } else {
        print::out(&shown.text())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Asks for another state and waits until it is there.
pub fn ask(bus: &Bus, transition: Transition) -> anyhow::Result<()> {
    View::open(bus)?.ask(bus, transition).map(|_answer| ())
}

/// The newest message of a channel that is published a thousand times a second, if one comes within the patience.
fn newest<M: Message>(reader: &mut Reader<M>, patience_ns: i64) -> anyhow::Result<Option<M>> {
    let deadline_ns = clock::monotonic_ns() + patience_ns;
    loop {
        if let Some(message) = reader.take_newest()? {
            return Ok(Some(*message));
        }
        if clock::monotonic_ns() > deadline_ns {
            return Ok(None);
        }
        std::thread::sleep(LOOK_EVERY);
    }
}

fn transition_of(ask: Ask) -> Transition {
    match ask {
        Ask::Enable => Transition::Enable,
        Ask::Disable => Transition::Disable,
        Ask::Pause => Transition::Pause,
        Ask::Resume => Transition::Resume,
        Ask::Home => Transition::Home,
        Ask::Unhome => Transition::Unhome,
        Ask::ClearFault => Transition::ClearFault,
    }
}

/// What the slave and its supervisor say.
struct View {
    states: Reader<SlaveState>,
    /// The slave's first: its word counts before the others'.
    healths: Vec<Reader<Health>>,
    answers: Reader<StateAnswer>,
}

/// The state as it is printed.
#[derive(Debug, Serialize)]
struct Shown {
    /// CRTK's meta-state.
    state: &'static str,
    /// The one that was asked for last.
    desired: &'static str,
    is_homed: bool,
    is_busy: bool,
    /// Whether the operator has engaged.
    is_engaged: bool,
    /// Whether commands are executed.
    is_following: bool,
    /// Stops obeyed since the slave's start.
    n_stops: u32,
    /// The live scale of the operator's motion, and its locks; none where no operator is there.
    scale: Option<f64>,
    is_translation_locked: Option<bool>,
    is_rotation_locked: Option<bool>,
    /// What `home` came to, where it moved nothing; none but after it.
    note: Option<&'static str>,
    /// Of each actuator whether it is under power by its drive's own report.
    has_power: Vec<bool>,
    /// What the drives say of their failure; none but in FAULT.
    failure: Option<String>,
    /// Why nothing moves, or why motion is limited.
    reasons: Vec<Held>,
}

/// A reason that holds.
#[derive(Debug, Serialize)]
struct Held {
    reason: String,
    sentence: &'static str,
    /// The value that is beyond its limit, in the reason's unit, where there is one.
    value: Option<f64>,
    limit: Option<f64>,
    /// Of both; empty for counts and multiples.
    unit: &'static str,
}

impl View {
    fn open(bus: &Bus) -> Result<Self, IpcError> {
        Ok(Self {
            states: bus.reader(ReadOptions::observing())?,
            healths: NAMING
                .iter()
                .map(|process| bus.reader_on(&health_channel(*process), ReadOptions::observing()))
                .collect::<Result<_, _>>()?,
            answers: bus.reader(ReadOptions::waking())?,
        })
    }

    /// Asks the supervisor and waits for its answer; after `home`, for the end of the search.
    fn ask(&mut self, bus: &Bus, transition: Transition) -> anyhow::Result<StateAnswer> {
        commands::refuse_without(bus, "launch", "state")?;
        let request = StateRequest::new(1, clock::monotonic_ns(), transition);
        let deadline_ns = request.sample_ns + PATIENCE_NS;
        // What a writer says goes with the writer: it stays until the answer is there.
        let mut writer = commands::writer_by::<StateRequest>(bus, deadline_ns)?;
        writer.send(&request)?;
        let answer = self.answer_to(&request, deadline_ns)?;
        match answer.outcome() {
            Some(RequestOutcome::Done) => {}
            Some(RequestOutcome::NoSlave) => bail!("the slave did not answer its supervisor, so nothing changed"),
            Some(RequestOutcome::TooLate) => bail!(
                "the request came to the supervisor more than {:.1} s after it was sent, so nothing changed; send it again",
                Transition::EXPIRES_NS as f64 * 1e-9
            ),
            Some(RequestOutcome::Refused) | None => bail!("{}", refusal(transition, &answer)?),
        }
        match transition {
            Transition::Home | Transition::Enable => self.wait_for_homing()?,
            Transition::Disable => self.wait_for_power_off()?,
            _ => {}
        }
        Ok(answer)
    }

    fn answer_to(&mut self, request: &StateRequest, deadline_ns: i64) -> anyhow::Result<StateAnswer> {
        while clock::monotonic_ns() < deadline_ns {
            self.answers.wait(LOOK_EVERY)?;
            while let Some(answer) = self.answers.take()? {
                if answer.is_to(request) {
                    return Ok(*answer);
                }
            }
        }
        bail!(
            "the supervisor did not answer within {} s; it is stopped, or the machine is too busy",
            PATIENCE_NS / 1_000_000_000
        )
    }

    fn wait_for_homing(&mut self) -> anyhow::Result<()> {
        let deadline_ns = clock::monotonic_ns() + HOMING_PATIENCE_NS;
        while clock::monotonic_ns() < deadline_ns {
            if self.newest()?.flags & SlaveState::IS_BUSY == 0 {
                return Ok(());
            }
            std::thread::sleep(LOOK_EVERY);
        }
        bail!("the actuators have not found their zero within {} s", HOMING_PATIENCE_NS / 1_000_000_000)
    }

    /// Lines that are loaded are relaxed first.
    fn wait_for_power_off(&mut self) -> anyhow::Result<()> {
        let deadline_ns = clock::monotonic_ns() + RELAXING_PATIENCE_NS;
        while clock::monotonic_ns() < deadline_ns {
            if !self.newest()?.is_letting_go() {
                return Ok(());
            }
            std::thread::sleep(LOOK_EVERY);
        }
        bail!("the power has not gone within {} s; the slave is stopped", RELAXING_PATIENCE_NS / 1_000_000_000)
    }

    fn newest(&mut self) -> anyhow::Result<SlaveState> {
        newest(&mut self.states, PATIENCE_NS)?
            .with_context(|| format!("the slave has said nothing for {} s; it is stopped", PATIENCE_NS / 1_000_000_000))
    }

    /// The state, and what `compensate` warns of in its newest command, which the slave, that goes on, does not repeat.
    fn show(&mut self, command: Option<&Command>) -> anyhow::Result<Shown> {
        let state = self.newest()?;
        let mut reasons = Reasons::from_bits(state.reasons);
        let warns = command.is_some_and(|own| Reasons::from_bits(own.reasons).contains(Reason::ModelMismatch));
        reasons.insert_if(Reason::ModelMismatch, warns);
        let deadline_ns = clock::monotonic_ns() + HEALTH_NS;
        let mut healths = Vec::new();
        for reader in &mut self.healths {
            healths.extend(newest(reader, deadline_ns.saturating_sub(clock::monotonic_ns()))?);
        }
        let name = |state: Option<OperatingState>| state.map_or("unknown", OperatingState::name);
        let has = |flag: u32| state.flags & flag != 0;
        let held = |reason: Reason| {
            let mut records = healths.iter().map(|health| health.records[reason as usize]);
            let record = records.find(|record| record.limit != 0.0);
            Held {
                reason: format!("{reason:?}"),
                sentence: reason.sentence(),
                value: record.map(|record| record.newest),
                limit: record.map(|record| record.limit),
                unit: reason.unit(),
            }
        };
        Ok(Shown {
            state: name(state.operating()),
            desired: name(state.desired()),
            is_homed: has(SlaveState::IS_HOMED),
            is_busy: has(SlaveState::IS_BUSY),
            is_engaged: state.is_engaged(),
            is_following: has(SlaveState::FOLLOWING),
            n_stops: state.n_stops,
            scale: None,
            is_translation_locked: None,
            is_rotation_locked: None,
            note: None,
            has_power: state.has_power().collect(),
            failure: (state.operating() == Some(OperatingState::Fault)).then(|| fault_sentence(&state)),
            reasons: reasons.iter().map(held).collect(),
        })
    }
}

impl Shown {
    fn text(&self) -> String {
        let word = |is: bool, yes: &'static str, no: &'static str| if is { yes } else { no };
        let mut text = format!(
            "{}{}, {}{}, {}, {}\n",
            self.state,
            if self.desired == self.state { String::new() } else { format!(" ({} was asked for)", self.desired) },
            word(self.is_homed, "homed", "not homed"),
            word(self.is_busy, ", busy", ""),
            word(self.is_engaged, "engaged", "not engaged"),
            word(self.is_following, "following", "holding"),
        );
        if let Some(scale) = self.scale.filter(|scale| *scale != 1.0) {
            text += &format!("  The hand moves the tip at {scale} of the configured speed.\n");
        }
        for (is_locked, what) in [(self.is_translation_locked, "translation"), (self.is_rotation_locked, "rotation")] {
            if is_locked == Some(true) {
                text += &format!("  No {what} is taken from the hand: it is locked.\n");
            }
        }
        if let Some(note) = self.note {
            text += &format!("  {note}\n");
        }
        let off: Vec<String> =
            (1..).zip(&self.has_power).filter(|(_, has)| !**has).map(|(k, _)| k.to_string()).collect();
        // All or none is told by the state.
        if !off.is_empty() && off.len() < self.has_power.len() {
            text +=
                &format!("  No power is told of actuator {}, which may have failed or be silent.\n", off.join(", "));
        }
        if let Some(failure) = &self.failure {
            text += &format!("  {failure}\n");
        }
        for held in &self.reasons {
            text += &format!("  {}", held.sentence);
            if let (Some(value), Some(limit)) = (held.value, held.limit) {
                let unit = if held.unit.is_empty() { String::new() } else { format!(" {}", held.unit) };
                text += &format!(" ({} beside the limit {}{unit})", short(value), short(limit));
            }
            text.push('\n');
        }
        text
    }
}

/// A number with four figures; what is tiny or huge by its power of ten.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        1e-3..1e5 => {
            let decimals = (3 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.3e}"),
    }
}

/// The slave's own words for its refusal: the same table, asked again here.
fn refusal(transition: Transition, answer: &StateAnswer) -> anyhow::Result<String> {
    let state = OperatingState::from_u32(answer.operating_state).context("the slave's state is unknown")?;
    let refused = OperatingMachine::in_state(state, answer.flags & SlaveState::IS_BUSY != 0).apply(transition).err();
    Ok(refused.map_or_else(
        || {
            format!(
                "`{}` was refused: a stop came behind it, power is about to go, or the drives failed; `krait state` shows",
                transition.name()
            )
        },
        |refused| refused.to_string(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_four_figures_whatever_its_size() {
        let shown = [0.0, 51.26, 0.000_031_4, 1234.56, -0.0123, 3e7].map(short);
        assert_eq!(shown, ["0", "51.26", "3.140e-5", "1235", "-0.01230", "3.000e7"]);
    }
}
