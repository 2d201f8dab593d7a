//! A page's live connection: the newest frame as fast as the page reads, and nothing that is older.

use crate::PageCounts;
use crate::allowance::Allowance;
use crate::pad::PadFrame;
use crate::server::{Shared, refuse};
use crate::snapshot;
use crate::wishes::{self, Wish, WishOutcome};
use axum::extract::State;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::http::HeaderMap;
use axum::response::Response;
use core::time::Duration;
use krait_ipc::clock;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tokio::sync::mpsc;
use tokio::time::timeout;

/// Pages at once.
const MOST_PAGES: usize = 32;
/// Bytes that a page's message may have.
const MOST_MESSAGE_BYTES: usize = 4096;
/// Messages a second that a page may send: the drive pad's, commands and heartbeats.
pub(crate) const MOST_MESSAGES_PER_S: u32 = 128;
/// A page that has not taken a frame for this long is gone.
const SEND_PATIENCE: Duration = Duration::from_secs(5);

/// Answers to commands that wait for a page to read.
const MOST_ANSWERS: usize = 16;
/// How far a page's idea of the server's clock may be ahead, ms.
const CLOCKS_APART_MS: f64 = 100.0;

/// What a page says.
#[derive(Debug, Deserialize)]
#[serde(tag = "k", rename_all = "lowercase", deny_unknown_fields)]
enum Said {
    /// Asks what the server's clock says, to join the two.
    Ping {
        /// The page's own clock, ms; comes back as it is.
        t: f64,
    },
    /// Asks for another operating state.
    Wish {
        /// Counts up on this connection; comes back with the answer.
        id: u64,
        /// What is wished for.
        wish: Wish,
        /// The session that the page knows.
        session: String,
        /// When the operator pressed, on the server's clock, ms.
        at_ms: f64,
    },
    /// Asks for the drive pad.
    Take {
        /// As of a wish.
        id: u64,
        /// As of a wish.
        session: String,
        /// As of a wish.
        at_ms: f64,
    },
    /// What the hand on the drive pad does.
    Pad {
        /// Counts up on this connection.
        n: u64,
        /// Whether the pad is held.
        held: bool,
        /// Part of the full deflection to the right.
        x: f64,
        /// Part of the full deflection down.
        y: f64,
        /// The jaw of a gripper: 1 opens, -1 closes, 0 stays.
        jaw: i8,
        /// The session that the page knows.
        session: String,
        /// When the hand was like this, on the server's clock, ms.
        at_ms: f64,
    },
}

/// What became of a wish.
#[derive(Serialize)]
struct Acknowledged {
    k: &'static str,
    id: u64,
    #[serde(flatten)]
    outcome: WishOutcome,
}

#[derive(Serialize)]
struct Pong {
    k: &'static str,
    t: f64,
    now_ms: f64,
}

/// Lets a page in that has the token and comes from here, if there is room.
pub(crate) async fn upgrade(
    State(shared): State<Arc<Shared>>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !shared.is_known(&headers) {
        return refuse("this page has no token; open the address that the console printed");
    }
    let Some(place) = Place::take(&shared.pages) else {
        return refuse("32 pages are open, which is as many as there may be; close one");
    };
    let upgrade = upgrade.max_message_size(MOST_MESSAGE_BYTES).max_frame_size(MOST_MESSAGE_BYTES);
    upgrade.max_write_buffer_size(256 * 1024).on_upgrade(move |socket| async move {
        serve(socket, &shared).await;
        drop(place);
    })
}

/// One of the pages that are open.
struct Place(Arc<PageCounts>);

impl Place {
    fn take(pages: &Arc<PageCounts>) -> Option<Self> {
        let one_more = |open: usize| (open < MOST_PAGES).then_some(open + 1);
        pages.open.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).ok()?;
        Some(Self(Arc::clone(pages)))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.open.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Until the page goes, takes too long, or says what it may not.
async fn serve(mut socket: WebSocket, shared: &Arc<Shared>) {
    let (mut frames, mut slow) = (shared.frames.clone(), shared.slow.clone());
    let page = OnPad { page: shared.pad.page(), shared: Arc::clone(shared) };
    let mut facts = shared.facts.clone();
    let own = Arc::clone(&facts.borrow_and_update());
    let Ok(first) = snapshot::hello(&own, shared.session.digits(), &shared.stop_url, page.page) else {
        return;
    };
    if !send(&mut socket, first.into()).await {
        return;
    }
    slow.mark_changed();
    let (mut last_frame, mut allowance) = (0, Allowance::new(MOST_MESSAGES_PER_S, MOST_MESSAGES_PER_S));
    let (answers, mut answered) = mpsc::channel(MOST_ANSWERS);
    let mut said = Listener { shared: Arc::clone(shared), page: page.page, answers, last_id: 0 };
    loop {
        let text = tokio::select! {
            heard = socket.recv() => match heard {
                Some(Ok(Message::Text(text))) if allowance.take(clock::monotonic_ns()) => said.take(&text),
                Some(Ok(Message::Ping(_) | Message::Pong(_))) if allowance.take(clock::monotonic_ns()) => continue,
                _ => return,
            },
            Ok(()) = frames.changed() => {
                let (n, text) = frames.borrow_and_update().clone();
                if last_frame > 0 && n > last_frame + 1 {
                    shared.pages.skipped.fetch_add(n - last_frame - 1, Ordering::Relaxed);
                }
                last_frame = n;
                Some(Utf8Bytes::from(&*text))
            }
            // A chain of another machine: the page comes again and is told.
            Ok(()) = facts.changed() => return,
            Some(text) = answered.recv() => Some(text),
            Ok(()) = slow.changed() => Some(Utf8Bytes::from(&**slow.borrow_and_update())),
            else => return,
        };
        if let Some(text) = text.filter(|text| !text.is_empty())
            && !send(&mut socket, text).await
        {
            return;
        }
    }
}

/// A page's place at the drive pad; however the connection ends, the hand is off it then.
struct OnPad {
    page: u64,
    shared: Arc<Shared>,
}

impl Drop for OnPad {
    fn drop(&mut self) {
        self.shared.pad.leave(self.page);
    }
}

async fn send(socket: &mut WebSocket, text: Utf8Bytes) -> bool {
    matches!(timeout(SEND_PATIENCE, socket.send(Message::Text(text))).await, Ok(Ok(())))
}

/// Understands what one page says.
struct Listener {
    shared: Arc<Shared>,
    page: u64,
    answers: mpsc::Sender<Utf8Bytes>,
    last_id: u64,
}

impl Listener {
    /// What is answered at once. Nothing for what is not understood: a page of another version, or no page.
    fn take(&mut self, text: &str) -> Option<Utf8Bytes> {
        match serde_json::from_str(text) {
            Ok(Said::Ping { t }) => {
                let pong = Pong { k: "pong", t, now_ms: clock::monotonic_ns() as f64 * 1e-6 };
                serde_json::to_string(&pong).ok().map(Utf8Bytes::from)
            }
            Ok(Said::Wish { id, wish, session, at_ms }) => {
                let at_ns = match self.heard_ns(id, &session, at_ms) {
                    Ok(at_ns) => at_ns,
                    Err(refusal) => return acknowledged(id, refusal),
                };
                let shared = Arc::clone(&self.shared);
                self.answer_later(id, async move { shared.desk.ask(wish, at_ns).await });
                None
            }
            Ok(Said::Take { id, session, at_ms }) => {
                if let Err(refusal) = self.heard_ns(id, &session, at_ms) {
                    return acknowledged(id, refusal);
                }
                let (shared, page) = (Arc::clone(&self.shared), self.page);
                self.answer_later(id, async move { shared.pad.take(page).await });
                None
            }
            Ok(Said::Pad { n, held, x, y, jaw, session, at_ms }) => {
                let age_ms = age_ms(at_ms);
                if self.shared.session.is(&session) && age_ms >= -CLOCKS_APART_MS {
                    self.shared.pad.hear(self.page, PadFrame { n, held, x, y, jaw }, instant_ns(age_ms));
                }
                None
            }
            Err(error) => {
                tracing::debug!(%error, "a page said what is not understood");
                None
            }
        }
    }

    /// When a command was given, ns. One of another session, one that was heard before, and one from the past or the future are
    /// not passed on.
    fn heard_ns(&mut self, id: u64, session: &str, at_ms: f64) -> Result<i64, WishOutcome> {
        let age_ms = age_ms(at_ms);
        let refusal = if !self.shared.session.is(session) {
            "it was meant for another console"
        } else if id <= self.last_id {
            "it was heard before"
        } else if !(-CLOCKS_APART_MS..=wishes::EXPIRY_NS as f64 * 1e-6).contains(&age_ms) {
            "it came too late"
        } else {
            self.last_id = id;
            return Ok(instant_ns(age_ms));
        };
        Err(WishOutcome { is_done: false, say: format!("Not done: {refusal}.") })
    }

    fn answer_later(&self, id: u64, outcome: impl Future<Output = WishOutcome> + Send + 'static) {
        let answers = self.answers.clone();
        tokio::spawn(async move {
            if let Some(text) = acknowledged(id, outcome.await)
                && answers.send(text).await.is_err()
            {
                tracing::debug!("a page went before its command was answered");
            }
        });
    }
}

/// How long ago a page says that something was, ms; negative where its clock is ahead.
fn age_ms(at_ms: f64) -> f64 {
    clock::monotonic_ns() as f64 * 1e-6 - at_ms
}

/// The instant of an age, never later than now.
fn instant_ns(age_ms: f64) -> i64 {
    clock::monotonic_ns().saturating_sub((age_ms.max(0.0) * 1e6) as i64)
}

fn acknowledged(id: u64, outcome: WishOutcome) -> Option<Utf8Bytes> {
    serde_json::to_string(&Acknowledged { k: "ack", id, outcome }).ok().map(Utf8Bytes::from)
}
