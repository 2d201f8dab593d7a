//! The thread that reads channels for viewers: sixty looks a second, every sample of the topics that somebody reads.
//!
//! It stands in a ring of bounded length; whoever reads too slowly loses the oldest, and nobody waits.

use super::NewMachine;
use super::figures::Figures;
use super::wire::Topic;
use crate::ConsoleError;
use crate::facts::Facts;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use core::time::Duration;
use krait_ipc::{Bus, ReadOptions};
use krait_record::{Views, WallClock};
use krait_schema::{Channel, Sample, encode};
use std::sync::{Arc, mpsc};
use tokio::sync::broadcast::Sender;
use tokio::sync::watch;

/// Time between two looks: eight samples of a 1 kHz channel of the 8192 that it holds.
const LOOK_EVERY: Duration = Duration::from_millis(16);

/// A message of one topic.
#[derive(Debug)]
pub(super) struct Packet {
    /// Number of the topic.
    pub(super) topic: usize,
    /// The instant that it is about, ns since 1970.
    pub(super) wall_ns: u64,
    /// Its bytes in the topic's encoding.
    pub(super) payload: Vec<u8>,
}

/// How many viewers read each topic.
#[derive(Debug)]
pub(super) struct Readers([AtomicUsize; Topic::COUNT]);

impl Default for Readers {
    fn default() -> Self {
        Self([const { AtomicUsize::new(0) }; Topic::COUNT])
    }
}

impl Readers {
    /// One more reads a topic; how many did before, and nothing for a topic that there is not.
    pub(super) fn enter(&self, topic: usize) -> Option<usize> {
        self.0.get(topic).map(|n| n.fetch_add(1, Ordering::Relaxed))
    }

    /// One less.
    pub(super) fn leave(&self, topic: usize) {
        if let Some(n) = self.0.get(topic) {
            n.fetch_sub(1, Ordering::Relaxed);
        }
    }

    fn has(&self, topic: Topic) -> bool {
        self.0[topic.id()].load(Ordering::Relaxed) > 0
    }

    fn n_all(&self) -> usize {
        self.0.iter().map(|n| n.load(Ordering::Relaxed)).sum()
    }
}

/// What a feed is made of; it becomes a reader of the channels in the thread that runs it.
pub(crate) struct Feed {
    pub(super) bus: Bus,
    pub(super) views: Views,
    pub(super) readers: Arc<Readers>,
    pub(super) packets: Sender<Arc<Packet>>,
    /// The machine, of which viewers are told where it is another one, ...
    pub(super) machine: watch::Sender<Machine>,
    /// ... and what takes its place.
    pub(super) newer: mpsc::Receiver<NewMachine>,
}

/// A machine that viewers are served: how many others a console has shown before it, and what is known of it.
#[derive(Clone, Debug)]
pub(super) struct Machine {
    pub(super) n_before: u64,
    pub(super) facts: Arc<Facts>,
}

impl Feed {
    /// Reads every channel until it is told to stop.
    ///
    /// # Errors
    /// [`ConsoleError`] where a channel cannot be read.
    pub(crate) fn run(self, stop: &AtomicBool) -> Result<(), ConsoleError> {
        let mut sources = Vec::new();
        for channel in Channel::ALL {
            sources.extend(channel.source(&self.bus, ReadOptions::observing())?);
        }
        let mut teller =
            Teller { feed: self, figures: Figures::default(), clock: WallClock::measure(), buffer: Vec::new() };
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK_EVERY);
            while let Ok(newer) = teller.feed.newer.try_recv() {
                teller.turn_to(newer);
            }
            // What nobody reads is taken all the same, so that a viewer begins with what is new.
            let is_read = teller.feed.readers.n_all() > 0;
            for source in &mut sources {
                while let Some(sample) = source.take()? {
                    if is_read {
                        teller.say(&sample);
                    }
                }
            }
        }
        Ok(())
    }
}

/// Turns samples into packets.
struct Teller {
    feed: Feed,
    figures: Figures,
    clock: WallClock,
    buffer: Vec<u8>,
}

impl Teller {
    /// Goes on with the machine of another chain; viewers hear of it where it is not the same one.
    fn turn_to(&mut self, (facts, views): NewMachine) {
        self.figures = Figures::default();
        self.feed.views = views;
        self.feed.machine.send_if_modified(|machine| {
            let is_other = !machine.facts.is_same_machine(&facts);
            machine.n_before += u64::from(is_other);
            machine.facts = facts;
            is_other
        });
    }

    fn say(&mut self, sample: &Sample) {
        let wall_ns = self.clock.wall_ns(sample.sample_ns());
        let topic = Topic::Channel(sample.channel());
        if self.feed.readers.has(topic) && encode(sample, &mut self.buffer).is_ok() {
            self.send(topic, wall_ns, self.buffer.clone());
        }
        for (view, payload) in self.feed.views.of(sample, self.clock) {
            self.send(Topic::View(view), wall_ns, payload);
        }
        if self.figures.take(sample) {
            let facts = &self.feed.machine.borrow().facts;
            self.send(Topic::TrackingError, wall_ns, self.figures.error(facts).to_string().into_bytes());
            self.send(Topic::Bends, wall_ns, self.figures.bends(facts).to_string().into_bytes());
        }
    }

    fn send(&self, topic: Topic, wall_ns: u64, payload: Vec<u8>) {
        if self.feed.readers.has(topic) {
            let packet = Arc::new(Packet { topic: topic.id(), wall_ns, payload });
            // The last reader may have gone meanwhile; then the packet is nobody's.
            let _n_readers = self.feed.packets.send(packet);
        }
    }
}
