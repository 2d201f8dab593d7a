//! The drive pad: which page may drive, and its hand on the way to the master, which judges it.
//!
//! A page takes the pad by a deliberate act, and only while nobody holds it. What the pages say of the hand is passed on with
//! the instant that it is about; whether it still counts is the master's to say.

use crate::ConsoleError;
use crate::wishes::WishOutcome;
use core::time::Duration;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use krait_ipc::message::DriveWish;
use krait_ipc::{Bus, IpcError, Writer, clock};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;

/// Frames under way at once: more than all pages may send in a tenth of a second.
const MOST_UNDER_WAY: usize = 64;
const LOOK_EVERY: Duration = Duration::from_millis(40);

/// What a page says of the hand on its pad.
#[derive(Clone, Copy, Debug)]
pub struct PadFrame {
    /// Counts up on this connection, from 1.
    pub n: u64,
    /// Whether the pad is held.
    pub held: bool,
    /// To the right as the camera sees, a part of the full deflection, -1 to 1.
    pub x: f64,
    /// Down as the camera sees, likewise.
    pub y: f64,
    /// The jaw of a gripper: 1 opens, -1 closes, 0 stays.
    pub jaw: i8,
}

impl PadFrame {
    /// The flags of the message; nothing for what no pad can say.
    fn flags(&self) -> Option<u32> {
        let jaw = match self.jaw {
            0 => 0,
            1 => DriveWish::JAW_OPENS,
            -1 => DriveWish::JAW_CLOSES,
            _ => return None,
        };
        Some(if self.held { DriveWish::HELD | jaw } else { 0 })
    }

    /// Thousandths of the full deflection; nothing for what no pad can say.
    fn deflection_permille(&self) -> Option<[i32; 2]> {
        let is_part = |part: f64| (-1.0..=1.0).contains(&part);
        let full = f64::from(DriveWish::FULL_PERMILLE);
        (is_part(self.x) && is_part(self.y)).then(|| [self.x, self.y].map(|part| (part * full).round() as i32))
    }
}

/// What every page is told of the pad.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PadSeen {
    /// The page that has the pad.
    pub driver: Option<u64>,
    /// Whether it holds it.
    pub held: bool,
}

/// Whose turn it is.
#[derive(Debug, Default)]
struct Turns {
    driver: Option<u64>,
    held_ns: Option<i64>,
}

impl Turns {
    fn seen(&self, now_ns: i64) -> PadSeen {
        PadSeen {
            driver: self.driver,
            held: self.held_ns.is_some_and(|since_ns| now_ns - since_ns <= DriveWish::LEASE_NS),
        }
    }

    /// Whether a page may take the pad: nobody else holds it.
    fn may_take(&self, page: u64, now_ns: i64) -> bool {
        let seen = self.seen(now_ns);
        !seen.held || seen.driver == Some(page)
    }

    fn take(&mut self, page: u64) {
        *self = Self { driver: Some(page), held_ns: None };
    }

    /// Whether a page's word counts.
    fn hear(&mut self, page: u64, is_held: bool, sample_ns: i64) -> bool {
        let is_driver = self.driver == Some(page);
        if is_driver {
            self.held_ns = is_held.then_some(sample_ns);
        }
        is_driver
    }

    /// Whether the page that is gone had the pad.
    fn leave(&mut self, page: u64) -> bool {
        let had = self.driver == Some(page);
        if had {
            *self = Self::default();
        }
        had
    }
}

enum Order {
    /// Become the writer of the channel, if this process is not yet.
    Open(oneshot::Sender<bool>),
    Send(DriveWish),
}

/// Where pages hand in what their pads say.
pub struct PadDesk {
    turns: Mutex<Turns>,
    is_offered: AtomicBool,
    n_pages: AtomicU64,
    queue: Sender<Order>,
}

/// What is handed in, on its way to [`carry`].
pub struct PadQueue(Receiver<Order>);

/// Makes a desk, and what [`carry`] takes from it.
pub fn open() -> (PadDesk, PadQueue) {
    let (queue, orders) = bounded(MOST_UNDER_WAY);
    let (turns, is_offered, n_pages) = (Mutex::default(), AtomicBool::new(false), AtomicU64::new(0));
    (PadDesk { turns, is_offered, n_pages, queue }, PadQueue(orders))
}

/// Publishes what is handed in until told to stop.
///
/// # Errors
/// [`ConsoleError`] where the channel cannot be opened or is broken.
pub fn carry(bus: &Bus, orders: &PadQueue, stop: &AtomicBool) -> Result<(), ConsoleError> {
    let mut writer: Option<Writer<DriveWish>> = None;
    while !stop.load(Ordering::Relaxed) {
        match orders.0.recv_timeout(LOOK_EVERY) {
            Ok(Order::Open(reply)) => {
                if writer.is_none() {
                    writer = match bus.writer() {
                        Ok(opened) => Some(opened),
                        Err(IpcError::SecondWriter { .. }) => None,
                        // The next page that asks may have more luck.
                        Err(error) => {
                            tracing::warn!("a page could not be given the pad: {error}");
                            None
                        }
                    };
                }
                if reply.send(writer.is_some()).is_err() {
                    tracing::debug!("a page went before it had the pad");
                }
            }
            Ok(Order::Send(wish)) => {
                if let Some(writer) = &mut writer {
                    writer.send(&DriveWish { sequence: writer.n_sent() + 1, ..wish })?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
    Ok(())
}

impl PadDesk {
    /// The number of a page that has come.
    pub fn page(&self) -> u64 {
        self.n_pages.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// Says whether the chain is one that is driven from a page.
    pub fn offer(&self, is_offered: bool) {
        self.is_offered.store(is_offered, Ordering::Relaxed);
    }

    /// What every page is told; nothing where the chain is driven by something else.
    pub fn seen(&self, now_ns: i64) -> Option<PadSeen> {
        self.is_offered.load(Ordering::Relaxed).then(|| self.turns().seen(now_ns))
    }

    /// Gives the pad to a page that has asked for it.
    pub async fn take(&self, page: u64) -> WishOutcome {
        let refused = |say: &str| WishOutcome { is_done: false, say: say.to_owned() };
        if !self.is_offered.load(Ordering::Relaxed) {
            return refused("This chain is not driven from a page; start it with `krait run --master browser`.");
        }
        if !self.turns().may_take(page, clock::monotonic_ns()) {
            return refused("Another page drives; it must let go first.");
        }
        let (reply, opened) = oneshot::channel();
        if self.queue.try_send(Order::Open(reply)).is_err() || !matches!(opened.await, Ok(true)) {
            return refused("Another console of this chain has the pad; end that one, or drive from its page.");
        }
        let mut turns = self.turns();
        if !turns.may_take(page, clock::monotonic_ns()) {
            return refused("Another page drives; it must let go first.");
        }
        turns.take(page);
        self.pass_on(let_go(page));
        WishOutcome { is_done: true, say: "You have the pad. Hold it to drive.".to_owned() }
    }

    /// Passes on what the page that has the pad says of an instant; anything else is no word of a hand.
    pub fn hear(&self, page: u64, frame: PadFrame, sample_ns: i64) {
        let is_late = clock::monotonic_ns() - sample_ns > DriveWish::LEASE_NS;
        let (Some(deflection_permille), Some(flags)) = (frame.deflection_permille(), frame.flags()) else { return };
        if frame.held && is_late || !self.turns().hear(page, frame.held, sample_ns) {
            return;
        }
        self.pass_on(DriveWish { frame: frame.n, flags, deflection_permille, sample_ns, ..let_go(page) });
    }

    /// A page is gone: if it has the pad, its hand is off it.
    pub fn leave(&self, page: u64) {
        if self.turns().leave(page) {
            self.pass_on(let_go(page));
        }
    }

    /// What finds no room is lost: the next frame says it anew, or the master's lease runs out.
    fn pass_on(&self, wish: DriveWish) {
        if self.queue.try_send(Order::Send(wish)).is_err() {
            tracing::debug!("a frame of the drive pad found no room");
        }
    }

    fn turns(&self) -> MutexGuard<'_, Turns> {
        self.turns.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The console lets go for a page.
fn let_go(page: u64) -> DriveWish {
    DriveWish {
        sequence: 0,
        sample_ns: clock::monotonic_ns(),
        page,
        frame: 0,
        sender_pid: std::process::id(),
        flags: 0,
        deflection_permille: [0; 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn one_page_drives_and_another_takes_over_only_when_it_has_let_go_or_fallen_silent() {
        let mut turns = Turns::default();
        assert!(!turns.hear(1, true, 0), "a page that has not taken the pad");
        turns.take(1);
        assert!(turns.hear(1, true, 0) && !turns.hear(2, true, 0));
        assert!(!turns.may_take(2, 150 * MS) && turns.may_take(1, 150 * MS));
        assert!(turns.may_take(2, 151 * MS), "silent for longer than the lease");
        assert!(turns.hear(1, false, 160 * MS));
        assert_eq!(turns.seen(160 * MS), PadSeen { driver: Some(1), held: false }, "it keeps the pad");
        turns.take(2);
        assert!(!turns.hear(1, true, 170 * MS), "the first has lost it");
        assert!(!turns.leave(1) && turns.leave(2));
        assert_eq!(turns.seen(180 * MS), PadSeen { driver: None, held: false });
    }

    #[test]
    fn a_deflection_is_a_part_of_the_full_one_or_nothing() {
        let frame = |x, y| PadFrame { n: 1, held: true, x, y, jaw: 0 }.deflection_permille();
        assert_eq!(frame(-1.0, 0.2504), Some([-1000, 250]));
        for nonsense in [f64::NAN, f64::INFINITY, 1.0001, -2.0] {
            assert_eq!((frame(nonsense, 0.0), frame(0.0, nonsense)), (None, None));
        }
    }

    #[test]
    fn a_jaw_opens_or_closes_while_the_pad_is_held_or_says_nothing() {
        let flags = |held, jaw| PadFrame { n: 1, held, x: 0.0, y: 0.0, jaw }.flags();
        assert_eq!(flags(true, 1), Some(DriveWish::HELD | DriveWish::JAW_OPENS));
        assert_eq!(flags(true, -1), Some(DriveWish::HELD | DriveWish::JAW_CLOSES));
        assert_eq!((flags(true, 0), flags(false, 1)), (Some(DriveWish::HELD), Some(0)));
        assert_eq!((flags(true, 2), flags(false, i8::MIN)), (None, None));
    }
}
