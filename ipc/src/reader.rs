//! A reader of a channel: takes every message in order, counts what is missing, sleeps or polls.

use crate::ahead::Ahead;
use crate::bus::{ChannelAddress, Shm};
use crate::doorbell::Doorbell;
use crate::message::Message;
use crate::port::Subscribe;
use crate::{IpcError, Process, clock};
use core::ops::Deref;
use core::time::Duration;
use iceoryx2::identifiers::UniquePublisherId;
use iceoryx2::sample::Sample;

/// How a reader waits for the next message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WaitMode {
    /// Sleep until the writer wakes this process.
    #[default]
    Blocking,
    /// Sleep, but wake once shortly before a message that comes at a steady rate is due: [`Reader::wait`] then ends without
    /// one, and the stage can take a warm-up step. The default of the stages, and right wherever cores are shared.
    Ahead,
    /// Look again and again without sleeping: for a core that this process has to itself.
    Polling,
}

impl WaitMode {
    /// The word of the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::Blocking => "blocking",
            Self::Ahead => "ahead",
            Self::Polling => "polling",
        }
    }
}

/// Turn of the process that a sample comes to first: the one behind `master`.
const FIRST_TURN: usize = 1;

/// What a reader wants of its channel.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    wakes: bool,
    buffer: usize,
    mode: WaitMode,
    n_behind: u8,
}

impl ReadOptions {
    /// Room for a quarter of a second at 1 kHz: a stage that is held up for longer has stale samples, not a small buffer.
    const STAGE_BUFFER: usize = 256;

    /// A stage that is woken by every message.
    pub fn waking() -> Self {
        Self { wakes: true, buffer: Self::STAGE_BUFFER, mode: WaitMode::Blocking, n_behind: 0 }
    }

    /// A stage that looks at the channel when something else has woken it. Costs the writer nothing.
    pub fn glancing() -> Self {
        Self { wakes: false, buffer: Self::STAGE_BUFFER, mode: WaitMode::Blocking, n_behind: 0 }
    }

    /// An observer that must miss nothing: the largest buffer, never woken, so that it slows nobody.
    pub fn observing() -> Self {
        Self { wakes: false, buffer: usize::MAX, mode: WaitMode::Blocking, n_behind: 0 }
    }

    /// A follower that must miss nothing and sleeps until there is something: a replay, whose pace is that of its readers.
    pub fn following() -> Self {
        Self { wakes: true, buffer: usize::MAX, mode: WaitMode::Blocking, n_behind: 0 }
    }

    /// The same, waiting in another way.
    pub fn with_mode(self, mode: WaitMode) -> Self {
        Self { wakes: self.wakes && mode != WaitMode::Polling, mode, ..self }
    }

    /// The same, for a process of the chain: the nearer it stands to the drives, the earlier it wakes where it wakes ahead of
    /// a message.
    pub fn of(self, process: Process) -> Self {
        let n_behind = process.core_turn().map_or(0, |turn| turn.saturating_sub(FIRST_TURN));
        Self { n_behind: n_behind as u8, ..self }
    }

    pub(crate) fn wakes(&self) -> bool {
        self.wakes
    }

    pub(crate) fn buffer(&self) -> usize {
        self.buffer
    }
}

/// Takes messages of a channel in order.
#[derive(Debug)]
pub struct Reader<M: Message> {
    subscriber: Box<dyn Subscribe<M>>,
    doorbell: Option<Doorbell>,
    mode: WaitMode,
    ahead: Ahead,
    last: Option<(UniquePublisherId, u64)>,
    n_writers: u64,
    n_received: u64,
    n_lost: u64,
    n_out_of_order: u64,
    address: ChannelAddress,
}

/// A message in shared memory, read where the writer put it.
#[derive(Debug)]
pub struct Received<M: Message>(pub(crate) Sample<Shm, M, ()>);

impl<M: Message> Deref for Received<M> {
    type Target = M;
    fn deref(&self) -> &M {
        self.0.payload()
    }
}

impl<M: Message> Reader<M> {
    pub(crate) fn new(
        address: ChannelAddress,
        subscriber: Box<dyn Subscribe<M>>,
        doorbell: Option<Doorbell>,
        options: ReadOptions,
    ) -> Self {
        let mode = options.mode;
        let ahead = Ahead::new(options.n_behind);
        Self {
            subscriber,
            doorbell,
            mode,
            ahead,
            last: None,
            n_writers: 0,
            n_received: 0,
            n_lost: 0,
            n_out_of_order: 0,
            address,
        }
    }

    /// Takes the next message, or `None` when there is none. A message that does not follow its predecessor upwards is
    /// counted and skipped; a gap is counted as lost.
    ///
    /// # Errors
    /// [`IpcError::Channel`] when the connection to the writer is broken.
    ///
    /// # Real-time
    /// No allocation, no blocking, no system call once connected.
    pub fn take(&mut self) -> Result<Option<Received<M>>, IpcError> {
        loop {
            let Some((writer, message)) = self.subscriber.take().map_err(|failure| self.address.at(failure))? else {
                return Ok(None);
            };
            let sequence = message.sequence();
            // A new writer counts from 1. What the very first one sent before this reader joined is not lost.
            let before = match self.last {
                Some((last_writer, last_sequence)) if last_writer == writer => last_sequence,
                Some(_) => 0,
                None => sequence.saturating_sub(1),
            };
            if sequence <= before {
                self.n_out_of_order += 1;
                continue;
            }
            self.n_writers += u64::from(self.last.is_none_or(|(last_writer, _)| last_writer != writer));
            // Several writers take turns, each with numbers of its own: a gap says nothing there.
            self.n_lost += if M::MAX_WRITERS == 1 { sequence - before - 1 } else { 0 };
            self.last = Some((writer, sequence));
            self.n_received += 1;
            return Ok(Some(message));
        }
    }

    /// Takes everything there is and keeps the newest.
    ///
    /// # Errors
    /// As [`Reader::take`].
    pub fn take_newest(&mut self) -> Result<Option<Received<M>>, IpcError> {
        let mut newest = None;
        while let Some(message) = self.take()? {
            newest = Some(message);
        }
        Ok(newest)
    }

    /// Sleeps (or polls) until there may be a message, a signal came, the time is up, or the process shall be awake for the
    /// next message ([`WaitMode::Ahead`]). Returns whether there may be one.
    ///
    /// # Errors
    /// [`IpcError::Channel`] when the channel is broken, or this reader was opened to look and does not poll.
    ///
    /// # Real-time
    /// No allocation; one system call where there is no message yet, none where there is.
    pub fn wait(&mut self, timeout: Duration) -> Result<bool, IpcError> {
        match (self.mode, &self.doorbell) {
            (WaitMode::Polling, _) => self.spin(timeout),
            (WaitMode::Blocking, Some(doorbell)) => self.sleep(doorbell, timeout),
            (WaitMode::Ahead, Some(doorbell)) => {
                let now_ns = clock::monotonic_ns();
                let until_rise = |rise_ns: i64| Duration::from_nanos((rise_ns - now_ns).unsigned_abs());
                let may_have =
                    self.sleep(doorbell, self.ahead.rise_ns(now_ns).map_or(timeout, until_rise).min(timeout))?;
                if may_have {
                    self.ahead.arrived(clock::monotonic_ns());
                }
                Ok(may_have)
            }
            (WaitMode::Blocking | WaitMode::Ahead, None) => {
                Err(self.address.failed("waiting for it", "this reader was opened to look, not to wait".to_owned()))
            }
        }
    }

    /// How often messages have begun to come from another writer than before, the first one included.
    pub fn n_writers(&self) -> u64 {
        self.n_writers
    }

    /// Messages taken so far.
    pub fn n_received(&self) -> u64 {
        self.n_received
    }

    /// Messages that never arrived, by the gaps in the sequence numbers.
    pub fn n_lost(&self) -> u64 {
        self.n_lost
    }

    /// Messages that came twice or too late and were skipped.
    pub fn n_out_of_order(&self) -> u64 {
        self.n_out_of_order
    }

    fn spin(&self, timeout: Duration) -> Result<bool, IpcError> {
        let deadline_ns = clock::monotonic_ns().saturating_add(i64::try_from(timeout.as_nanos()).unwrap_or(i64::MAX));
        loop {
            if self.has_messages()? {
                return Ok(true);
            }
            if clock::monotonic_ns() >= deadline_ns {
                return Ok(false);
            }
            core::hint::spin_loop();
        }
    }

    /// The count of rings is taken before the look: a message that comes between the look and the sleep has rung since.
    fn sleep(&self, doorbell: &Doorbell, timeout: Duration) -> Result<bool, IpcError> {
        let heard = doorbell.rings();
        if self.has_messages()? {
            return Ok(true);
        }
        doorbell.sleep(heard, timeout).map_err(|e| self.address.failed("waiting for it", format!("{e:?}")))
    }

    fn has_messages(&self) -> Result<bool, IpcError> {
        self.subscriber.has_messages().map_err(|failure| self.address.at(failure))
    }
}
