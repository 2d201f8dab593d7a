//! The thread that makes pictures for the pages: sixty looks a second, one newest frame for all of them.

use crate::facts::{Facts, NewChain};
use crate::foxglove::NewMachine;
use crate::observer::Observer;
use crate::pad::PadDesk;
use crate::processes::Processes;
use crate::snapshot::{self, Moment, Slow};
use crate::{ConsoleError, PageCounts};
use core::time::Duration;
use krait_ipc::message::Health;
use krait_ipc::{Bus, Reason, Reasons, clock};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use tokio::sync::watch::Sender;

/// Pictures a second.
const RATE_HZ: i64 = 60;
const PERIOD_NS: i64 = 1_000_000_000 / RATE_HZ;
/// Frames between two slow messages.
const SLOW_EVERY: u64 = 30;

/// What the thread gives to the pages: each slot holds the newest only, so that a slow page loses frames, not freshness.
#[derive(Debug)]
pub struct Slots {
    /// A frame and its number.
    pub frame: Sender<(u64, Arc<str>)>,
    /// The newest slow message.
    pub slow: Sender<Arc<str>>,
    /// What is known of the chain; told anew only where it is another machine's.
    pub facts: Sender<Arc<Facts>>,
    /// Where engineers' own viewers are told of another machine.
    pub machines: mpsc::Sender<NewMachine>,
}

impl Slots {
    /// Keeps what is known of a newer chain, and tells pages and viewers where it is another machine.
    fn take(&self, newer: NewChain) -> Arc<Facts> {
        let (newer, views) = (Arc::new(newer.facts), newer.views);
        if let Some(views) = views {
            // Without viewers nobody hears it.
            let _told = self.machines.send((Arc::clone(&newer), views));
        }
        self.facts.send_if_modified(|facts| {
            let is_other = !facts.is_same_machine(&newer);
            *facts = Arc::clone(&newer);
            is_other
        });
        newer
    }
}

/// Looks at an instance for the pages.
pub struct Watch {
    observer: Observer,
    processes: Processes,
}

impl Watch {
    /// Becomes a reader of every channel.
    ///
    /// # Errors
    /// [`ConsoleError`] where a channel cannot be read.
    pub fn open(bus: Bus) -> Result<Self, ConsoleError> {
        Ok(Self { observer: Observer::open(bus)?, processes: Processes::default() })
    }

    /// Reads until it is told to stop; `newer` has what is known of a chain that came since it was asked for last.
    ///
    /// # Errors
    /// [`ConsoleError`] where a channel is broken.
    pub fn run(
        mut self,
        slots: &Slots,
        pages: &PageCounts,
        mut newer: impl FnMut() -> Option<NewChain>,
        pad: &PadDesk,
        stop: &AtomicBool,
    ) -> Result<(), ConsoleError> {
        let mut facts = Arc::clone(&slots.facts.borrow());
        let mut due_ns = clock::monotonic_ns();
        for n in 1.. {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            let now_ns = clock::monotonic_ns();
            if due_ns > now_ns {
                std::thread::sleep(Duration::from_nanos((due_ns - now_ns).unsigned_abs()));
            }
            due_ns = (due_ns + PERIOD_NS).max(now_ns);
            self.observer.look(facts.budgets.last().map_or(f64::INFINITY, |whole| whole.worst_us))?;
            let now_ns = clock::monotonic_ns();
            let input = self.observer.newest().input.filter(|input| now_ns - input.sample_ns < snapshot::STALE_NS);
            pad.offer(facts.is_simulated && input.is_some_and(|input| input.is_from_pad()));
            let moment = Moment {
                n,
                now_ns,
                reasons: self.observer.reasons(now_ns),
                error_rms: self.observer.tracking().rms(now_ns),
                joint_errors_rms: self.observer.tracking().rms_of_each(now_ns),
                error: self.observer.tracking().newest(),
                pad: pad.seen(now_ns),
            };
            slots.frame.send_replace((n, snapshot::frame(self.observer.newest(), &moment, &facts)?.into()));
            if n % SLOW_EVERY == 0 {
                if n % (2 * SLOW_EVERY) == 0 {
                    self.observer.end_second();
                }
                if let Some(newer) = newer() {
                    facts = slots.take(newer);
                }
                slots.slow.send_replace(serde_json::to_string(&self.slow(now_ns, pages))?.into());
            }
        }
        Ok(())
    }

    fn slow(&mut self, now_ns: i64, pages: &PageCounts) -> Slow {
        let members = self.observer.members();
        let recording_s = self.observer.recording_s(&members, now_ns);
        let newest = self.observer.newest();
        let usages = self.processes.look(members, now_ns, newest.command.map(|command| command.model_hash));
        let changed = |health: &Health| Reasons::from_bits(health.reasons_now).contains(Reason::ModelChanged);
        Slow {
            k: "slow",
            latency: self.observer.latency(),
            processes: snapshot::processes(usages, newest, now_ns),
            n_lost_here: self.observer.n_lost_here(),
            n_pages: pages.open.load(Ordering::Relaxed),
            n_skipped: pages.skipped.load(Ordering::Relaxed),
            model: newest.command.map(|command| format!("{:016x}", command.model_hash)),
            has_changed: newest.healths.iter().any(|(_, health)| health.as_ref().is_some_and(changed)),
            recording_s,
        }
    }
}
