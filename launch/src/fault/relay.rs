//! The relay: reads a channel of one instance and writes it in another, and breaks its messages for a while.

use super::kind::Fault;
use core::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use core::time::Duration;
use krait_ipc::message::{Command, DeviceState, Message, OperatorInput, Shape, SlaveState};
use krait_ipc::{Bus, IpcError, ReadOptions, Reader, Realtime, Writer, clock};
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::JoinHandle;

/// How long it sleeps at most: what it holds back is due by the millisecond.
const PATIENCE: Duration = Duration::from_millis(1);
/// How many messages are broken.
const N_BROKEN: u64 = 200;
/// How late a late message comes, ns.
const LATE_NS: i64 = 80_000_000;
/// How long a burst gathers, ns: less than half of the slave's watchdog, which leaves a busy machine the rest.
pub const BURST_NS: i64 = 20_000_000;
/// How far a slipping clock goes on from one sample to the next, ns; a right one goes on by 1 ms.
const SLIPPING_NS: i64 = 50_000;

/// A relay that runs; it ends when this is dropped.
pub struct Relay {
    orders: Arc<Orders>,
    thread: Option<JoinHandle<Result<(), IpcError>>>,
}

#[derive(Debug, Default)]
struct Orders {
    is_open: AtomicBool,
    strike: AtomicBool,
    /// When the first message was broken, ns; 0: not yet.
    struck_ns: AtomicI64,
    end: AtomicBool,
}

impl Relay {
    /// Passes the operator's input on, and what the slave says back.
    pub fn of_input(fault: Fault, front: &str, back: &str, realtime: Realtime) -> std::io::Result<Self> {
        Self::start::<OperatorInput>(fault, front, back, realtime)
    }

    /// The same for commands.
    pub fn of_commands(fault: Fault, front: &str, back: &str, realtime: Realtime) -> std::io::Result<Self> {
        Self::start::<Command>(fault, front, back, realtime)
    }

    fn start<M: Fragile>(fault: Fault, front: &str, back: &str, realtime: Realtime) -> std::io::Result<Self> {
        let orders = Arc::new(Orders::default());
        let (front, back, told) = (front.to_owned(), back.to_owned(), Arc::clone(&orders));
        let thread = std::thread::Builder::new().name("relay".to_owned()).spawn(move || {
            for refused in realtime.apply(0, &back) {
                tracing::warn!(process = "relay", "{refused}");
            }
            let (front, back) = (Bus::open(&front, "relay")?, Bus::open(&back, "relay")?);
            let mut line = Line::<M> {
                writer: back.writer()?,
                fault,
                orders: told,
                n_broken: 0,
                held: VecDeque::new(),
                before: None,
                last: None,
            };
            line.run(front.reader(ReadOptions::waking())?, Answers::open(&front, &back)?)
        })?;
        Ok(Self { orders, thread: Some(thread) })
    }

    /// Whether it reads and writes.
    pub fn is_open(&self) -> bool {
        self.orders.is_open.load(Ordering::Acquire)
    }

    /// Breaks the messages from now on, for a while.
    pub fn strike(&self) {
        self.orders.strike.store(true, Ordering::Release);
    }

    /// When the first message was broken, ns.
    pub fn struck_ns(&self) -> Option<i64> {
        Some(self.orders.struck_ns.load(Ordering::Acquire)).filter(|struck_ns| *struck_ns != 0)
    }

    /// Ends it.
    ///
    /// # Errors
    /// What it failed with.
    pub fn end(mut self) -> anyhow::Result<()> {
        self.orders.end.store(true, Ordering::Release);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(ended)) => Ok(ended?),
            _ => anyhow::bail!("the relay ended in a panic"),
        }
    }
}

impl Drop for Relay {
    /// Waits for it: its instances' files go when it has left them.
    fn drop(&mut self) {
        self.orders.end.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _another_error_is_told = thread.join();
        }
    }
}

/// What the slave says, on its way back to the stages before it.
struct Answers {
    states: (Reader<SlaveState>, Writer<SlaveState>),
    shapes: (Reader<Shape>, Writer<Shape>),
}

impl Answers {
    fn open(front: &Bus, back: &Bus) -> Result<Self, IpcError> {
        let options = ReadOptions::observing();
        Ok(Self { states: (back.reader(options)?, front.writer()?), shapes: (back.reader(options)?, front.writer()?) })
    }

    fn pass_on(&mut self) -> Result<(), IpcError> {
        while let Some(state) = self.states.0.take()? {
            self.states.1.send(&state)?;
        }
        while let Some(shape) = self.shapes.0.take()? {
            self.shapes.1.send(&shape)?;
        }
        Ok(())
    }
}

/// What a relay must be able to break.
trait Fragile: Message + Copy + Send {
    /// `last` is the last one that was whole, `n` counts the broken ones.
    fn break_content(&mut self, fault: Fault, last: &Self, n: u64);
    fn set_sequence(&mut self, sequence: u64);
}

impl Fragile for Command {
    fn break_content(&mut self, fault: Fault, _: &Self, _: u64) {
        match fault {
            Fault::Nan => self.q_tilde_m[0] = f64::NAN,
            Fault::OutOfRange => self.q_tilde_m[1] = 1.0,
            Fault::ReversedAxis => self.q_tilde_m[2] = -self.q_tilde_m[2],
            _ => {}
        }
    }

    fn set_sequence(&mut self, sequence: u64) {
        self.sequence = sequence;
    }
}

impl Fragile for OperatorInput {
    fn break_content(&mut self, fault: Fault, last: &Self, n: u64) {
        match fault {
            Fault::UnpluggedDevice => self.device_state = DeviceState::Lost as u32,
            Fault::SlippingClock => self.sample_ns = last.sample_ns + SLIPPING_NS * n.cast_signed(),
            _ => {}
        }
    }

    fn set_sequence(&mut self, sequence: u64) {
        self.sequence = sequence;
    }
}

/// One channel that is passed on.
struct Line<M: Message> {
    writer: Writer<M>,
    fault: Fault,
    orders: Arc<Orders>,
    n_broken: u64,
    held: VecDeque<(i64, M)>,
    /// The one of two that change places.
    before: Option<M>,
    last: Option<M>,
}

impl<M: Fragile> Line<M> {
    fn run(&mut self, mut reader: Reader<M>, mut answers: Answers) -> Result<(), IpcError> {
        self.orders.is_open.store(true, Ordering::Release);
        while !self.orders.end.load(Ordering::Acquire) {
            reader.wait(PATIENCE)?;
            while let Some(message) = reader.take()?.map(|message| *message) {
                let is_broken = self.orders.strike.load(Ordering::Acquire) && self.n_broken < N_BROKEN;
                if is_broken { self.break_one(message)? } else { self.pass_on(message)? }
            }
            self.release(clock::monotonic_ns())?;
            answers.pass_on()?;
        }
        Ok(())
    }

    fn pass_on(&mut self, message: M) -> Result<(), IpcError> {
        self.release(i64::MAX)?;
        self.last = Some(message);
        self.writer.send(&message)
    }

    fn break_one(&mut self, mut message: M) -> Result<(), IpcError> {
        let now_ns = clock::monotonic_ns();
        self.n_broken += 1;
        if self.n_broken == 1 {
            self.orders.struck_ns.store(now_ns, Ordering::Release);
        }
        match self.fault {
            Fault::Lost => {}
            Fault::Late => self.held.push_back((now_ns + LATE_NS, message)),
            Fault::Burst => {
                let due_ns = self.held.front().map_or(now_ns + BURST_NS, |(due_ns, _)| *due_ns);
                self.held.push_back((due_ns, message));
            }
            Fault::Duplicated => {
                self.writer.send(&message)?;
                self.writer.send(&message)?;
            }
            Fault::Reordered => match self.before.take() {
                None => self.before = Some(message),
                Some(before) => {
                    self.writer.send(&message)?;
                    self.writer.send(&before)?;
                }
            },
            Fault::Frozen => {
                if let Some(mut last) = self.last {
                    last.set_sequence(message.sequence());
                    self.writer.send(&last)?;
                }
            }
            fault => {
                message.break_content(fault, &self.last.unwrap_or(message), self.n_broken);
                self.writer.send(&message)?;
            }
        }
        Ok(())
    }

    /// Sends what was held back and is due.
    fn release(&mut self, now_ns: i64) -> Result<(), IpcError> {
        while let Some((due_ns, message)) = self.held.pop_front() {
            if due_ns > now_ns {
                self.held.push_front((due_ns, message));
                break;
            }
            self.writer.send(&message)?;
        }
        Ok(())
    }
}
