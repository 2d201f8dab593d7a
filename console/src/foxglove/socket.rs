//! A viewer's connection: let in by its token and its origin, told what there is, given what it asks for as fast as it reads.

use super::feed::{Feed, Machine, Packet, Readers};
use super::wire::{self, Asked, Level, PROTOCOLS, Topic};
use super::{FoxgloveSettings, NewMachine, path_of};
use crate::allowance::Allowance;
use crate::facts::Facts;
use crate::guard::{Token, WebOrigin, origin_of};
use crate::live::MOST_MESSAGES_PER_S;
use crate::{ConsoleError, server::refuse};
use axum::Router;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use core::sync::atomic::{AtomicUsize, Ordering};
use core::time::Duration;
use krait_ipc::{Bus, clock};
use std::collections::BTreeMap;
use std::sync::{Arc, mpsc};
use tokio::sync::broadcast::{self, Sender, error::RecvError};
use tokio::sync::watch;
use tokio::time::timeout;

/// Viewers at once.
const MOST_VIEWERS: usize = 8;
/// Bytes that a viewer's message may have: subscriptions of every topic have 2 kB.
const MOST_MESSAGE_BYTES: usize = 16 * 1024;
/// Messages that lie ready for a viewer that does not read: a second and a half of a chain at 1 kHz.
const RING_LENGTH: usize = 8192;
/// A viewer that has not taken a message for this long is gone.
const SEND_PATIENCE: Duration = Duration::from_secs(5);
/// Time between two sentences about what was passed over, ns.
const SAY_EVERY_NS: i64 = 1_000_000_000;
/// Pages that may read besides the console's own: the viewer at its maker's address. Programs that are no page have no origin.
const KNOWN_ORIGINS: [&str; 1] = ["https://app.foxglove.dev"];

/// What every viewer's connection knows.
pub(crate) struct Viewers {
    token: Token,
    own: WebOrigin,
    origins: Vec<String>,
    machine: watch::Receiver<Machine>,
    readers: Arc<Readers>,
    packets: Sender<Arc<Packet>>,
    n_open: AtomicUsize,
}

impl Viewers {
    /// The viewers of a console, and what reads the chain for them; `newer` has the machines of chains that come later.
    ///
    /// # Errors
    /// [`ConsoleError`] where there is no token.
    pub(crate) fn open(
        bus: Bus,
        settings: FoxgloveSettings,
        own: WebOrigin,
        facts: &Arc<Facts>,
        newer: mpsc::Receiver<NewMachine>,
    ) -> Result<(Arc<Self>, Feed), ConsoleError> {
        let FoxgloveSettings { views, origins } = settings;
        let (packets, readers) = (Sender::new(RING_LENGTH), Arc::new(Readers::default()));
        let (token, n_open) = (Token::new()?, AtomicUsize::new(0));
        let (shown, machine) = watch::channel(Machine { n_before: 0, facts: Arc::clone(facts) });
        let feed = Feed { bus, views, readers: Arc::clone(&readers), packets: packets.clone(), machine: shown, newer };
        Ok((Arc::new(Self { token, own, origins, machine, readers, packets, n_open }), feed))
    }

    /// Where a viewer connects to.
    pub(crate) fn address(&self) -> String {
        format!("ws://{}{}", self.own.host, path_of(&self.token))
    }

    /// Whether a request comes from where it may come from: from no page at all, from the console's own, or from a known one.
    fn admits(&self, headers: &HeaderMap) -> bool {
        match origin_of(headers) {
            Ok(None) => true,
            Ok(Some(origin)) => {
                let known = KNOWN_ORIGINS.into_iter().chain(self.origins.iter().map(String::as_str));
                origin == self.own.url() || known.into_iter().any(|own| own == origin)
            }
            Err(()) => false,
        }
    }
}

/// Adds the one route; no other path leads to it, and it asks for its own token.
pub(crate) fn added_to(router: Router, viewers: Arc<Viewers>) -> Router {
    let path = path_of(&viewers.token);
    router.route(&path, get(upgrade).with_state(viewers))
}

async fn upgrade(State(viewers): State<Arc<Viewers>>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    if !viewers.own.is_host_of(&headers) {
        return refuse("this console answers under its own address only; use the address that it printed");
    }
    if !viewers.admits(&headers) {
        let origin = origin_of(&headers).ok().flatten().unwrap_or("several").to_owned();
        tracing::warn!(origin, "a page of this origin may not read; krait console --foxglove-origin ORIGIN lets it in");
        return refuse("a page of this origin may not read; krait console --foxglove-origin ORIGIN lets it in");
    }
    let upgrade = upgrade.max_message_size(MOST_MESSAGE_BYTES).max_frame_size(MOST_MESSAGE_BYTES);
    let upgrade = upgrade.max_write_buffer_size(1024 * 1024).protocols(PROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let sentence = "this address speaks foxglove.sdk.v1 and foxglove.websocket.v1; the viewer offered neither";
        return (StatusCode::BAD_REQUEST, sentence).into_response();
    }
    let Some(place) = Place::take(viewers) else {
        return refuse("8 viewers are open, which is as many as there may be; close one");
    };
    upgrade.on_upgrade(|socket| async move { serve(socket, place).await })
}

/// One of the viewers that are open; its subscriptions end with it.
struct Place {
    viewers: Arc<Viewers>,
    /// Subscription that stands for each topic.
    subscriptions: BTreeMap<usize, u32>,
}

impl Place {
    fn take(viewers: Arc<Viewers>) -> Option<Self> {
        let one_more = |open: usize| (open < MOST_VIEWERS).then_some(open + 1);
        viewers.n_open.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).ok()?;
        Some(Self { viewers, subscriptions: BTreeMap::new() })
    }

    /// Takes what a viewer asks; the sentence of a refusal.
    fn take_text(&mut self, text: &str) -> Result<(), String> {
        match serde_json::from_str(text) {
            Ok(Asked::Subscribe { subscriptions }) => {
                subscriptions.into_iter().try_for_each(|own| self.subscribe(own.id, own.channel_id))
            }
            Ok(Asked::Unsubscribe { subscription_ids }) => {
                let readers = &self.viewers.readers;
                self.subscriptions.retain(|topic, id| {
                    let stays = !subscription_ids.contains(id);
                    if !stays {
                        readers.leave(*topic);
                    }
                    stays
                });
                Ok(())
            }
            Err(_) => Err("Refused: this server is read-only; it takes subscribe and unsubscribe.".to_owned()),
        }
    }

    fn subscribe(&mut self, id: u32, topic: usize) -> Result<(), String> {
        if self.subscriptions.contains_key(&topic) || self.subscriptions.values().any(|own| *own == id) {
            return Err(format!(
                "Refused: subscription {id} of channel {topic} is there already, or one of the two is."
            ));
        }
        if self.viewers.readers.enter(topic).is_none() {
            return Err(format!("Refused: there is no channel {topic}; the last one is {}.", Topic::COUNT - 1));
        }
        self.subscriptions.insert(topic, id);
        Ok(())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.subscriptions.keys().for_each(|topic| self.viewers.readers.leave(*topic));
        self.viewers.n_open.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Until the viewer goes, takes too long, or says too much, or until the chain is another machine's: a viewer that connects anew is told
/// of that one.
async fn serve(mut socket: WebSocket, mut place: Place) {
    let mut machine = place.viewers.machine.clone();
    let Machine { n_before, facts } = machine.borrow_and_update().clone();
    let n_joints = facts.joints.as_ref().map_or(0, |joints| joints.low.len());
    // A session of its own for each machine that a console shows: viewers forget what they knew of another one.
    let session = format!("{}/{n_before}", place.viewers.own.host);
    for text in [wire::server_info(&facts.instance, &session), wire::advertise(facts.unit, n_joints)] {
        if !send(&mut socket, Message::Text(text.into())).await {
            return;
        }
    }
    let mut packets: broadcast::Receiver<Arc<Packet>> = place.viewers.packets.subscribe();
    let mut allowance = Allowance::new(MOST_MESSAGES_PER_S, MOST_MESSAGES_PER_S);
    let (mut n_passed, mut n_told, mut told_ns) = (0, 0, clock::monotonic_ns());
    loop {
        let answer = tokio::select! {
            heard = socket.recv() => match heard {
                Some(Ok(heard)) if allowance.take(clock::monotonic_ns()) => match heard {
                    Message::Text(text) => match place.take_text(&text) {
                        Ok(()) => None,
                        Err(why) => Some(Message::Text(wire::status(Level::Error, &why).into())),
                    },
                    Message::Binary(_) => {
                        let why = "Refused: this server is read-only; nothing that a viewer publishes goes anywhere.";
                        Some(Message::Text(wire::status(Level::Error, why).into()))
                    }
                    Message::Ping(_) | Message::Pong(_) => None,
                    Message::Close(_) => return,
                },
                _ => return,
            },
            packet = packets.recv() => match packet {
                Ok(packet) => place.subscriptions.get(&packet.topic).map(|id| {
                    Message::Binary(wire::message_data(*id, packet.wall_ns, &packet.payload).into())
                }),
                Err(RecvError::Lagged(n)) => {
                    n_passed += n;
                    None
                }
                Err(RecvError::Closed) => return,
            },
            Ok(()) = machine.changed() => {
                let why = "The chain is another machine's now; this connection ends, and the next one shows that machine.";
                send(&mut socket, Message::Text(wire::status(Level::Warning, why).into())).await;
                return;
            }
        };
        let now_ns = clock::monotonic_ns();
        // What was passed over soon after the last sentence is told in the next one, whether more follows or not.
        let slow = (n_passed > n_told && now_ns - told_ns >= SAY_EVERY_NS).then(|| {
            (n_told, told_ns) = (n_passed, now_ns);
            let what =
                format!("Slow: this viewer reads too slowly; {n_passed} messages of all topics were passed over.");
            Message::Text(wire::status(Level::Warning, &what).into())
        });
        for message in slow.into_iter().chain(answer) {
            if !send(&mut socket, message).await {
                return;
            }
        }
    }
}

async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SEND_PATIENCE, socket.send(message)).await, Ok(Ok(())))
}
