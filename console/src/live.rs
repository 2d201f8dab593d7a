//! A page's live connection: the newest frame as fast as the page reads, and nothing that is older.

use crate::PageCounts;
use crate::facts::Facts;
use crate::server::{Shared, refuse};
use crate::snapshot;
use axum::extract::State;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::http::HeaderMap;
use axum::response::Response;
use core::time::Duration;
use krait_ipc::clock;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tokio::time::timeout;

/// Pages at once.
const MOST_PAGES: usize = 32;
/// Bytes that a page's message may have.
const MOST_MESSAGE_BYTES: usize = 4096;
/// Messages a second that a page may send: the drive pad's, commands and heartbeats.
const MOST_MESSAGES_PER_S: u32 = 128;
/// A page that has not taken a frame for this long is gone.
const SEND_PATIENCE: Duration = Duration::from_secs(5);

/// What a page says.
#[derive(Debug, Deserialize)]
#[serde(tag = "k", rename_all = "lowercase", deny_unknown_fields)]
enum Said {
    /// Asks what the server's clock says, to join the two.
    Ping {
        /// The page's own clock, ms; comes back as it is.
        t: f64,
    },
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
async fn serve(mut socket: WebSocket, shared: &Shared) {
    let (mut frames, mut slow, mut facts) = (shared.frames.clone(), shared.slow.clone(), shared.facts.clone());
    let hello = |facts: &Facts| snapshot::hello(facts, shared.session.digits()).ok().map(Utf8Bytes::from);
    let Some(first) = hello(&facts.borrow_and_update().clone()) else { return };
    if !send(&mut socket, first).await {
        return;
    }
    slow.mark_changed();
    let (mut last_frame, mut allowance) = (0, Allowance::default());
    loop {
        let text = tokio::select! {
            said = socket.recv() => match said {
                Some(Ok(Message::Text(text))) if allowance.take(clock::monotonic_ns()) => answer(&text),
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
            Ok(()) = slow.changed() => Some(Utf8Bytes::from(&**slow.borrow_and_update())),
            Ok(()) = facts.changed() => hello(&facts.borrow_and_update().clone()),
            else => return,
        };
        if let Some(text) = text.filter(|text| !text.is_empty())
            && !send(&mut socket, text).await
        {
            return;
        }
    }
}

async fn send(socket: &mut WebSocket, text: Utf8Bytes) -> bool {
    matches!(timeout(SEND_PATIENCE, socket.send(Message::Text(text))).await, Ok(Ok(())))
}

/// Nothing for what is not understood: a page of another version, or no page.
fn answer(text: &str) -> Option<Utf8Bytes> {
    match serde_json::from_str(text) {
        Ok(Said::Ping { t }) => {
            let pong = Pong { k: "pong", t, now_ms: clock::monotonic_ns() as f64 * 1e-6 };
            serde_json::to_string(&pong).ok().map(Utf8Bytes::from)
        }
        Err(error) => {
            tracing::debug!(%error, "a page said what is not understood");
            None
        }
    }
}

/// Messages that a page may still send in this second.
#[derive(Default)]
struct Allowance {
    since_ns: i64,
    used: u32,
}

impl Allowance {
    fn take(&mut self, now_ns: i64) -> bool {
        if now_ns - self.since_ns > 1_000_000_000 {
            *self = Self { since_ns: now_ns, used: 0 };
        }
        self.used += 1;
        self.used <= MOST_MESSAGES_PER_S
    }
}
