//! The one authority over the slave's operating state: it alone commands the slave, and takes the requests of others in turn.

use krait_ipc::message::{RequestOutcome, SlaveState, StateAnswer, StateCommand, StateRequest, Transition};
use krait_ipc::{Bus, IpcError, ReadOptions, Reader, Writer, clock};
use std::collections::VecDeque;

/// A slave that has not answered a state command by then is not there, ns; it does nothing of that later.
const PATIENCE_NS: i64 = Transition::EXPIRES_NS;

/// Commands the slave; see [`Authority::serve`].
pub struct Authority {
    commands: Writer<StateCommand>,
    requests: Reader<StateRequest>,
    answers: Writer<StateAnswer>,
    waiting: VecDeque<StateRequest>,
    pending: Option<Pending>,
    opened_ns: i64,
    /// When somebody last asked for less than ENABLED, ns.
    held_back_ns: Option<i64>,
}

/// A request whose command is on its way.
struct Pending {
    request: StateRequest,
    command_sequence: u64,
    give_up_ns: i64,
}

impl Authority {
    /// Becomes the authority of an instance.
    ///
    /// # Errors
    /// [`IpcError::SecondWriter`] when there is one already, or a channel cannot be had.
    pub fn open(bus: &Bus) -> Result<Self, IpcError> {
        Ok(Self {
            commands: bus.writer()?,
            requests: bus.reader(ReadOptions::observing())?,
            answers: bus.writer()?,
            waiting: VecDeque::new(),
            pending: None,
            opened_ns: clock::monotonic_ns(),
            held_back_ns: None,
        })
    }

    /// Commands the slave of the supervisor's own accord.
    ///
    /// # Errors
    /// As [`Writer::send`].
    pub fn command(&mut self, transition: Transition) -> Result<(), IpcError> {
        self.send(transition, clock::monotonic_ns(), std::process::id()).map(|_| ())
    }

    /// When somebody last asked for DISABLED or PAUSED, CLOCK_MONOTONIC, ns; a slave that was not there then has not heard it.
    pub fn held_back_ns(&self) -> Option<i64> {
        self.held_back_ns
    }

    /// Takes what others ask for, one request after the other: commands the slave, and answers when the slave has.
    ///
    /// # Errors
    /// As [`Writer::send`] and [`Reader::take`].
    pub fn serve(&mut self, state: Option<&SlaveState>) -> Result<(), IpcError> {
        while let Some(request) = self.requests.take()? {
            // A late reader is handed the newest request of before its time.
            if request.sample_ns >= self.opened_ns {
                self.waiting.push_back(*request);
            }
        }
        let now_ns = clock::monotonic_ns();
        if let Some(pending) = &self.pending {
            let heard = state.filter(|state| state.state_command_sequence >= pending.command_sequence);
            if heard.is_none() && now_ns < pending.give_up_ns {
                return Ok(());
            }
            let request = pending.request;
            self.pending = None;
            self.answer(&request, heard)?;
        }
        let Some(request) = self.waiting.pop_front() else { return Ok(()) };
        let Some(transition) = request.transition() else { return self.refuse(&request, state) };
        if transition.ends_motion() {
            self.held_back_ns = Some(now_ns);
        }
        // This process stood still, or the slave did: nobody waits for it any more.
        if transition.is_late(request.sample_ns, now_ns) {
            tracing::warn!(sender_pid = request.sender_pid, "`{}` came too late and was not done", transition.name());
            return self.send_answer(&request, RequestOutcome::TooLate, state);
        }
        // The request's own stamp: a stop that came behind it wins.
        let command_sequence = self.send(transition, request.sample_ns, request.sender_pid)?;
        self.pending = Some(Pending { request, command_sequence, give_up_ns: now_ns + PATIENCE_NS });
        Ok(())
    }

    fn send(&mut self, transition: Transition, sample_ns: i64, sender_pid: u32) -> Result<u64, IpcError> {
        let sequence = self.commands.n_sent() + 1;
        self.commands.send(&StateCommand { sequence, sample_ns, transition: transition as u32, sender_pid })?;
        Ok(sequence)
    }

    fn answer(&mut self, request: &StateRequest, heard: Option<&SlaveState>) -> Result<(), IpcError> {
        let outcome = match heard {
            None => RequestOutcome::NoSlave,
            Some(state) if state.flags & SlaveState::COMMAND_REFUSED != 0 => RequestOutcome::Refused,
            Some(_) => RequestOutcome::Done,
        };
        self.send_answer(request, outcome, heard)
    }

    fn refuse(&mut self, request: &StateRequest, state: Option<&SlaveState>) -> Result<(), IpcError> {
        tracing::warn!(sender_pid = request.sender_pid, found = request.transition, "an unknown request was refused");
        self.send_answer(request, RequestOutcome::Refused, state)
    }

    fn send_answer(
        &mut self,
        request: &StateRequest,
        outcome: RequestOutcome,
        state: Option<&SlaveState>,
    ) -> Result<(), IpcError> {
        let state = state.copied().unwrap_or_default();
        self.answers.send(&StateAnswer {
            sequence: self.answers.n_sent() + 1,
            sample_ns: request.sample_ns,
            sender_pid: request.sender_pid,
            outcome: outcome as u32,
            operating_state: state.operating_state,
            flags: state.flags | if state.is_letting_go() { StateAnswer::LETTING_GO } else { 0 },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::time::Duration;

    /// This process stood still meanwhile: whoever asked has given up, and only what takes motion away is still done.
    #[test]
    fn a_request_that_was_held_up_is_not_done_any_more_but_a_pause_is() {
        let instance = format!("t-authority-{}", std::process::id());
        let bus = Bus::open(&instance, "launch").expect("joined");
        let mut authority = Authority::open(&bus).expect("the authority");
        let asking = Bus::open(&instance, "test").expect("joined");
        let mut requests = asking.writer::<StateRequest>().expect("a writer");
        let mut commands = asking.reader::<StateCommand>(ReadOptions::observing()).expect("a reader");
        let mut answers = asking.reader::<StateAnswer>(ReadOptions::observing()).expect("a reader");
        std::thread::sleep(Duration::from_nanos(Transition::EXPIRES_NS.unsigned_abs()));
        for (n, transition) in [Transition::Enable, Transition::Home, Transition::Pause].into_iter().enumerate() {
            requests.send(&StateRequest::new(n as u64 + 1, authority.opened_ns + n as i64, transition)).expect("sent");
            authority.serve(None).expect("served");
        }
        let mut said = Vec::new();
        while let Some(answer) = answers.take().expect("readable") {
            said.push(answer.outcome());
        }
        assert_eq!(said, [Some(RequestOutcome::TooLate); 2]);
        let command = commands.take().expect("readable").expect("a command");
        assert_eq!(command.transition(), Some(Transition::Pause));
        assert!(commands.take().expect("readable").is_none());
    }
}
