//! The operator's wishes on their way to the chain: a stop is counted up at once, everything else is asked of the supervisor.
//!
//! A wish counts when the drives' own state says so. It expires, so that nothing that was held up is done later, and only
//! what makes the robot safer is ever asked twice.

use crate::ConsoleError;
use core::time::Duration;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded};
use krait_ipc::message::{OperatingState, RequestOutcome, SlaveState, StateAnswer, StateRequest, Transition};
use krait_ipc::{Bus, IpcError, ReadOptions, Reader, StopSwitch, Writer, clock};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::oneshot;

/// Wishes under way at once.
const MOST_WISHES: usize = 64;
/// A wish that is older than this when it is to be sent is not sent, ns.
pub const EXPIRY_NS: i64 = 500_000_000;
/// The supervisor answers within this, or there is no answer, ns.
const PATIENCE_NS: i64 = 2_000_000_000;
/// Pause and disable are asked once more after this, ns.
const AGAIN_NS: i64 = 250_000_000;
/// The slave obeys a stop within this, or its power is asked off.
const STOP_PATIENCE: Duration = Duration::from_millis(200);
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// Power was asked off where lines are loaded.
const RELAXES: &str = "Relaxing, then power goes off.";
/// A search for a stop asks somebody who stands beside the machine; a page does not.
const HOMED_IN_PLACE: &str = "Homing moves nothing here: the drives know their place and check it. Stops are looked for by krait drives --zero, with no chain running.";

/// What an operator can wish for, besides a stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wish {
    /// Power on, may move.
    Enable,
    /// Power off.
    Disable,
    /// Hold still, power on.
    Pause,
    /// Go on.
    Resume,
    /// Find the drives' zero.
    Home,
    /// Fault to disabled.
    ClearFault,
}

impl Wish {
    fn transition(self) -> Transition {
        match self {
            Self::Enable => Transition::Enable,
            Self::Disable => Transition::Disable,
            Self::Pause => Transition::Pause,
            Self::Resume => Transition::Resume,
            Self::Home => Transition::Home,
            Self::ClearFault => Transition::ClearFault,
        }
    }
}

/// What became of a wish.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct WishOutcome {
    /// Whether the drives' own state says that it is done.
    pub is_done: bool,
    /// One sentence.
    pub say: String,
}

impl WishOutcome {
    fn done(say: impl Into<String>) -> Self {
        Self { is_done: true, say: say.into() }
    }

    fn not_done(say: impl Into<String>) -> Self {
        Self { is_done: false, say: say.into() }
    }
}

struct Asked {
    wish: Wish,
    at_ns: i64,
    reply: oneshot::Sender<WishOutcome>,
}

/// Where wishes are handed in.
pub struct Desk {
    stop: StopSwitch,
    queue: Sender<Asked>,
}

/// What is handed in, on its way to [`carry`].
pub struct WishQueue(Receiver<Asked>);

/// Makes a desk, and what [`carry`] takes from it.
///
/// # Errors
/// [`ConsoleError`] where the stop's shared memory cannot be had.
pub fn open(bus: &Bus) -> Result<(Desk, WishQueue), ConsoleError> {
    let (queue, asked) = bounded(MOST_WISHES);
    Ok((Desk { stop: bus.stop_switch()?, queue }, WishQueue(asked)))
}

/// Carries what is handed in to the supervisor until told to stop.
///
/// # Errors
/// [`ConsoleError`] where a channel cannot be opened or is broken.
pub fn carry(bus: &Bus, orders: WishQueue, stop: &AtomicBool) -> Result<(), ConsoleError> {
    let answers = bus.reader(ReadOptions::glancing())?;
    Clerk { bus, asked: orders.0, answers, writer: None, n_sent: 0, pending: Vec::new() }.run(stop)
}

impl Desk {
    /// Asks for a change of the operating state; `at_ns` is when the operator pressed.
    pub async fn ask(&self, wish: Wish, at_ns: i64) -> WishOutcome {
        let (reply, outcome) = oneshot::channel();
        match self.queue.try_send(Asked { wish, at_ns, reply }) {
            Ok(()) => outcome.await.unwrap_or_else(|_| WishOutcome::not_done("The console is ending.")),
            Err(TrySendError::Full(_)) => WishOutcome::not_done("Too many commands are under way."),
            Err(TrySendError::Disconnected(_)) => WishOutcome::not_done("The console is ending."),
        }
    }

    /// Stops: counted up at once in shared memory. Where the slave does not obey in time, its power is asked off.
    pub async fn stop(&self) -> WishOutcome {
        let pressed_ns = clock::monotonic_ns();
        let number = self.stop.press();
        let since_ms = || (clock::monotonic_ns() - pressed_ns) / 1_000_000;
        while (clock::monotonic_ns() - pressed_ns).unsigned_abs() < STOP_PATIENCE.as_nanos() as u64 {
            if self.stop.is_obeyed(number) {
                return WishOutcome::done(format!("Stopped \u{2013} the drives confirmed it after {} ms.", since_ms()));
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
        let off = self.ask(Wish::Disable, clock::monotonic_ns()).await;
        if off.is_done && off.say == RELAXES {
            return WishOutcome::done(format!(
                "The stop was not confirmed, so power was asked off after {} ms. {RELAXES}",
                since_ms()
            ));
        }
        if off.is_done {
            return WishOutcome::done(format!(
                "The stop was not confirmed, so power was turned off after {} ms.",
                since_ms()
            ));
        }
        WishOutcome::not_done("NOT CONFIRMED. Use the emergency stop of the machine.")
    }
}

/// Carries wishes to the supervisor and its answers back.
struct Clerk<'a> {
    bus: &'a Bus,
    asked: Receiver<Asked>,
    answers: Reader<StateAnswer>,
    writer: Option<Writer<StateRequest>>,
    n_sent: u64,
    pending: Vec<Pending>,
}

struct Pending {
    asked: Asked,
    requests: Vec<StateRequest>,
    again_ns: Option<i64>,
    deadline_ns: i64,
}

impl Clerk<'_> {
    fn run(mut self, stop: &AtomicBool) -> Result<(), ConsoleError> {
        while !stop.load(Ordering::Relaxed) {
            let patience = if self.pending.is_empty() { 20 * LOOK_EVERY } else { LOOK_EVERY };
            match self.asked.recv_timeout(patience) {
                Ok(asked) => self.take(asked),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            self.look()?;
        }
        Ok(())
    }

    fn take(&mut self, asked: Asked) {
        let now_ns = clock::monotonic_ns();
        if now_ns - asked.at_ns > EXPIRY_NS {
            return answer(asked, WishOutcome::not_done("It was not sent: it came too late."));
        }
        if !self.bus.members().iter().any(|(name, _)| name == "launch") {
            return answer(asked, WishOutcome::not_done("No chain runs here."));
        }
        let request = match self.send(asked.wish.transition(), now_ns) {
            Ok(request) => request,
            Err(say) => return answer(asked, WishOutcome::not_done(say)),
        };
        let again_ns = asked.wish.transition().ends_motion().then_some(now_ns + AGAIN_NS);
        self.pending.push(Pending { asked, requests: vec![request], again_ns, deadline_ns: now_ns + PATIENCE_NS });
    }

    /// What cannot be sent now is told to whoever asked, and the next wish is tried anew: this thread ends for nobody's memory.
    fn send(&mut self, transition: Transition, now_ns: i64) -> Result<StateRequest, &'static str> {
        let failed = |error: &IpcError| {
            tracing::warn!("a command of a page could not be sent: {error}");
            "It could not be sent to the chain; see the console\u{2019}s terminal."
        };
        let mut writer = match self.writer.take() {
            Some(writer) => writer,
            None => self.bus.writer().map_err(|error| match error {
                IpcError::SecondWriter { .. } => "Too many programs ask for something at once.",
                error => failed(&error),
            })?,
        };
        self.n_sent += 1;
        let request = StateRequest::new(self.n_sent, now_ns, transition);
        writer.send(&request).map_err(|error| failed(&error))?;
        self.writer = Some(writer);
        Ok(request)
    }

    fn look(&mut self) -> Result<(), ConsoleError> {
        while let Some(said) = self.answers.take()? {
            let of = self.pending.iter().position(|p| p.requests.iter().any(|request| said.is_to(request)));
            if let Some(position) = of {
                let pending = self.pending.swap_remove(position);
                let outcome = outcome_of(pending.asked.wish, &said);
                answer(pending.asked, outcome);
            }
        }
        let now_ns = clock::monotonic_ns();
        for position in (0..self.pending.len()).rev() {
            if now_ns >= self.pending[position].deadline_ns {
                let pending = self.pending.swap_remove(position);
                answer(pending.asked, WishOutcome::not_done("The supervisor did not answer."));
            } else if self.pending[position].again_ns.is_some_and(|again_ns| now_ns >= again_ns) {
                self.pending[position].again_ns = None;
                let transition = self.pending[position].asked.wish.transition();
                // Asked once it is already.
                if let Ok(request) = self.send(transition, now_ns) {
                    self.pending[position].requests.push(request);
                }
            }
        }
        Ok(())
    }
}

/// Whoever asked may have gone.
fn answer(asked: Asked, outcome: WishOutcome) {
    if asked.reply.send(outcome).is_err() {
        tracing::debug!("a page went before its command was answered");
    }
}

fn outcome_of(wish: Wish, said: &StateAnswer) -> WishOutcome {
    let operating = OperatingState::from_u32(said.operating_state);
    let state = operating.map_or("unknown", OperatingState::name);
    let lets_go = said.flags & StateAnswer::LETTING_GO != 0;
    // A pause of lines that are being relaxed ends that, and power may have gone before the supervisor looked.
    let has_let_go = lets_go || operating == Some(OperatingState::Disabled);
    match said.outcome() {
        Some(RequestOutcome::Done) => WishOutcome::done(match wish {
            Wish::Disable if lets_go => RELAXES,
            Wish::Pause if has_let_go => "The lines are not relaxed any further: power goes off, as was asked before.",
            Wish::Enable => "Enabled \u{2013} confirmed by the drives.",
            Wish::Disable => "Disabled \u{2013} confirmed by the drives.",
            Wish::Pause => "Paused \u{2013} confirmed by the drives.",
            Wish::Resume => "Resumed \u{2013} confirmed by the drives.",
            Wish::Home if said.flags & SlaveState::HOMES_IN_PLACE != 0 => HOMED_IN_PLACE,
            Wish::Home => "Homing \u{2013} the drives have begun.",
            Wish::ClearFault => "The fault is cleared; power is off.",
        }),
        Some(RequestOutcome::NoSlave) => WishOutcome::not_done("The drives did not answer."),
        Some(RequestOutcome::TooLate) => WishOutcome::not_done("It came to the supervisor too late, and was not done."),
        Some(RequestOutcome::Refused) | None => {
            WishOutcome::not_done(format!("Refused: the drives are {}.", state.to_lowercase()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn homing_of_drives_that_know_their_place_is_told_to_move_nothing() {
        let said = |flags: u32| {
            let (outcome, operating_state) = (RequestOutcome::Done as u32, OperatingState::Enabled as u32);
            let answer = StateAnswer { sequence: 1, sample_ns: 1, sender_pid: 1, outcome, operating_state, flags };
            outcome_of(Wish::Home, &answer).say
        };
        assert!(said(SlaveState::IS_BUSY).ends_with("the drives have begun."));
        assert_eq!(said(SlaveState::IS_BUSY | SlaveState::HOMES_IN_PLACE), HOMED_IN_PLACE);
    }

    #[test]
    fn a_pause_of_lines_that_are_relaxed_is_told_that_power_goes() {
        let said = |operating: OperatingState, flags: u32| {
            let (outcome, operating_state) = (RequestOutcome::Done as u32, operating as u32);
            let answer = StateAnswer { sequence: 1, sample_ns: 1, sender_pid: 1, outcome, operating_state, flags };
            [Wish::Pause, Wish::Disable].map(|wish| outcome_of(wish, &answer).say)
        };
        let [pause, disable] = said(OperatingState::Paused, StateAnswer::LETTING_GO);
        assert!(pause.ends_with("power goes off, as was asked before.") && disable == RELAXES, "{pause}, {disable}");
        // The power had gone before the supervisor looked.
        let [pause, disable] = said(OperatingState::Disabled, 0);
        assert!(pause.ends_with("power goes off, as was asked before."), "{pause}");
        assert_eq!(disable, "Disabled \u{2013} confirmed by the drives.");
        assert_eq!(said(OperatingState::Paused, 0)[0], "Paused \u{2013} confirmed by the drives.");
    }

    /// What may harm when it is done twice is asked once, also of a supervisor that never answers.
    #[test]
    fn of_a_silent_supervisor_only_pause_and_disable_are_asked_again() {
        let instance = format!("t-console-once-{}", std::process::id());
        let supervisor = Bus::open(&instance, "launch").expect("joined");
        let mut requests = supervisor.reader::<StateRequest>(ReadOptions::observing()).expect("a reader");
        let (desk, queue) = open(&supervisor).expect("a desk");
        let stop = AtomicBool::new(false);
        let mut asked = Vec::new();
        let outcomes = std::thread::scope(|scope| {
            let clerk = scope.spawn(|| carry(&Bus::open(&instance, "console").expect("joined"), queue, &stop));
            let now_ns = clock::monotonic_ns();
            let all = tokio::runtime::Builder::new_current_thread().build().expect("a runtime").block_on(async {
                tokio::join!(
                    desk.ask(Wish::Enable, now_ns),
                    desk.ask(Wish::Resume, now_ns),
                    desk.ask(Wish::Home, now_ns),
                    desk.ask(Wish::ClearFault, now_ns),
                    desk.ask(Wish::Pause, now_ns),
                    desk.ask(Wish::Disable, now_ns),
                )
            });
            // Before the writer goes, and what it wrote with it.
            while let Some(request) = requests.take().expect("taken") {
                asked.push(request.transition());
            }
            stop.store(true, Ordering::Relaxed);
            clerk.join().expect("it ends").expect("no channel breaks");
            <[WishOutcome; 6]>::from(all)
        });
        assert!(outcomes.iter().all(|own| own.say == "The supervisor did not answer."), "{outcomes:?}");
        for (wish, most) in [
            (Wish::Enable, 1),
            (Wish::Resume, 1),
            (Wish::Home, 1),
            (Wish::ClearFault, 1),
            (Wish::Pause, 2),
            (Wish::Disable, 2),
        ] {
            let n = asked.iter().filter(|own| **own == Some(wish.transition())).count();
            assert!((1..=most).contains(&n), "{n} times {wish:?}");
        }
    }
}
