//! The server: binds this machine's own address only, gives out the page, and runs beside the thread that reads channels.

use crate::allowance::{SharedAllowance, too_often};
use crate::facts::{Facts, NewChain};
use crate::foxglove::{self, FoxgloveSettings, Viewers};
use crate::guard::{Token, WebOrigin, cookie, page_headers};
use crate::library::{self, Library};
use crate::pad::{self, PadDesk};
use crate::recordings::{LearntOf, Recordings};
use crate::stop::{self, StopShared};
use crate::stop_door::StopDoor;
use crate::watch::{Slots, Watch};
use crate::whole_body::{LINES_S, WholeBody};
use crate::wishes::{self, Desk};
use crate::{ConsoleError, PageCounts, accept, assets, live};
use axum::Router;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use core::net::Ipv4Addr;
use core::time::Duration;
use krait_ipc::Bus;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use tokio::net::TcpListener;
use tokio::sync::watch;

/// Bytes that a posted command or token may have.
const MOST_BODY_BYTES: usize = 4096;
/// How often the server looks whether it shall end.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// How a console shall run.
#[derive(Debug)]
pub struct ServerSettings {
    /// Port of the page on 127.0.0.1; 0: any that is free.
    pub port: u16,
    /// Port of the stop on this machine; 0: any that is free.
    pub stop_port: u16,
    /// Folder of the recordings.
    pub recordings: PathBuf,
    /// Names what a recording's newest model update says.
    pub learnt_of: LearntOf,
    /// Folder of the lab's measurements and models; made when it is needed first.
    pub lab: PathBuf,
    /// The model that the lab begins with.
    pub base_model: String,
    /// The krait program, whose subcommands do the lab's work.
    pub program: PathBuf,
    /// How engineers' own viewers are served, if they are.
    pub foxglove: Option<FoxgloveSettings>,
}

/// Where a console is.
#[derive(Clone, Debug)]
pub struct Address {
    /// The page, with the token that opens it.
    pub page: String,
    /// The stop alone, with a token that is good for nothing else.
    pub stop: String,
    /// Where engineers' own viewers connect to, if they may, with a token that is good for reading and nothing else.
    pub foxglove: Option<String>,
}

/// What every handler knows.
pub(crate) struct Shared {
    pub(crate) origin: WebOrigin,
    stop_origin: WebOrigin,
    strangers: SharedAllowance,
    token: Token,
    cookie_name: String,
    pub(crate) session: Token,
    pub(crate) frames: watch::Receiver<(u64, Arc<str>)>,
    pub(crate) slow: watch::Receiver<Arc<str>>,
    pub(crate) facts: watch::Receiver<Arc<Facts>>,
    pub(crate) pages: Arc<PageCounts>,
    pub(crate) desk: Arc<Desk>,
    pub(crate) pad: Arc<PadDesk>,
    pub(crate) library: Library,
    pub(crate) stop_url: String,
}

impl Shared {
    /// Whether a request carries the token, as the cookie that the token was exchanged for.
    pub(crate) fn is_known(&self, headers: &HeaderMap) -> bool {
        cookie(headers, &self.cookie_name).is_some_and(|value| self.token.is(value))
    }
}

/// Serves the page until it is told to stop; `facts` is what is known of the chain, and `newer`, asked twice a second, what is
/// known of one that came later.
///
/// # Errors
/// [`ConsoleError`] in one sentence.
pub fn run(
    bus: Bus,
    settings: ServerSettings,
    facts: Facts,
    newer: impl FnMut() -> Option<NewChain> + Send,
    announce: impl FnOnce(&Address),
    stop: &AtomicBool,
) -> Result<(), ConsoleError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ConsoleError::Start)?;
    let instance = bus.instance().as_str().to_owned();
    let (frame_slot, frames) = watch::channel((0, Arc::from("")));
    let (slow_slot, slow) = watch::channel(Arc::from(""));
    let facts = Arc::new(facts);
    let (facts_slot, newest_facts) = watch::channel(Arc::clone(&facts));
    let (machines, newer_machines) = mpsc::channel();
    let slots = Slots { frame: frame_slot, slow: slow_slot, facts: facts_slot, machines };
    let pages = Arc::new(PageCounts::default());
    let (listener, port) = runtime.block_on(listen(settings.port))?;
    let stop_door = StopDoor::open(settings.stop_port)?;
    let stop_port = stop_door.port()?;
    let (page_origin, stop_origin) = (WebOrigin::new("127.0.0.1", port), WebOrigin::new("localhost", stop_port));
    let stop_token = Token::new()?;
    let stop_url = format!("{}/stop/{}", stop_origin.url(), stop_token.digits());
    let wishing = Bus::open(&instance, crate::NAME)?;
    let (desk, orders) = wishes::open(&wishing)?;
    let desk = Arc::new(desk);
    let (driving, (pad, pad_orders)) = (Bus::open(&instance, crate::NAME)?, pad::open());
    let pad = Arc::new(pad);
    let stop_routes = stop::router(Arc::new(StopShared {
        origin: stop_origin.clone(),
        page: page_origin.clone(),
        token: stop_token,
        desk: Arc::clone(&desk),
    }));
    let open = |settings| {
        Viewers::open(Bus::open(&instance, crate::NAME)?, settings, page_origin.clone(), &facts, newer_machines)
    };
    let (viewers, feed) = settings.foxglove.map(open).transpose()?.unzip();
    let viewers_address = viewers.as_ref().map(|viewers| viewers.address());
    let shared = Arc::new(Shared {
        origin: page_origin,
        stop_origin,
        strangers: SharedAllowance::of_strangers(),
        token: Token::new()?,
        cookie_name: format!("krait-{instance}-{port}"),
        session: Token::new()?,
        frames,
        slow,
        facts: newest_facts,
        pages: Arc::clone(&pages),
        desk,
        pad: Arc::clone(&pad),
        library: Library::new(
            Recordings::new(settings.recordings, settings.learnt_of),
            settings.lab,
            settings.base_model,
            settings.program,
            instance.clone(),
        ),
        stop_url,
    });
    let mut router = router(Arc::clone(&shared));
    if let Some(viewers) = viewers {
        router = foxglove::added_to(router, viewers);
    }
    let page = format!("{}/#{}", shared.origin.url(), shared.token.digits());
    announce(&Address { page, stop: shared.stop_url.clone(), foxglove: viewers_address });
    std::thread::scope(|scope| {
        let watching = std::thread::Builder::new().name("watch".to_owned()).spawn_scoped(scope, || {
            ending(stop, || Watch::open(bus).and_then(|watch| watch.run(&slots, &pages, newer, &pad, stop)))
        });
        let watching = watching.map_err(ConsoleError::Start)?;
        let carrying = std::thread::Builder::new().name("wishes".to_owned());
        let carrying = carrying.spawn_scoped(scope, move || ending(stop, || wishes::carry(&wishing, orders, stop)));
        let carrying = carrying.map_err(ConsoleError::Start)?;
        let hands = std::thread::Builder::new().name("pad".to_owned());
        let hands = hands.spawn_scoped(scope, move || ending(stop, || pad::carry(&driving, &pad_orders, stop)));
        let hands = hands.map_err(ConsoleError::Start)?;
        let reading = feed.map(|feed| {
            let run = move || ending(stop, || feed.run(stop));
            std::thread::Builder::new()
                .name("foxglove".to_owned())
                .spawn_scoped(scope, run)
                .map_err(ConsoleError::Start)
        });
        let reading = reading.transpose()?;
        let stopping = std::thread::Builder::new().name("stop".to_owned());
        let stopping = stopping.spawn_scoped(scope, move || ending(stop, || stop_door.serve(stop_routes, stop)));
        let stopping = stopping.map_err(ConsoleError::Start)?;
        runtime.block_on(async {
            tokio::select! {
                () = accept::serve(listener, router) => {}
                () = until(stop) => {}
            }
        });
        runtime.shutdown_timeout(LOOK_EVERY);
        let watched = watching.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause));
        let carried = carrying.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause));
        let driven = hands.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause));
        let read =
            reading.map_or(Ok(()), |reading| reading.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause)));
        let stopped = stopping.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause));
        watched.and(carried).and(driven).and(read).and(stopped)
    })
}

/// Does a thread's work; when that ends, whatever ended it, the console does, and says why: half a console is none.
fn ending(stop: &AtomicBool, work: impl FnOnce() -> Result<(), ConsoleError>) -> Result<(), ConsoleError> {
    let outcome = work();
    stop.store(true, Ordering::Relaxed);
    outcome
}

/// Ends when the console does.
pub(crate) async fn until(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

async fn listen(port: u16) -> Result<(TcpListener, u16), ConsoleError> {
    let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).await;
    let bound = bound.and_then(|listener| listener.local_addr().map(|address| (listener, address.port())));
    bound.map_err(|source| ConsoleError::Listen { address: Ipv4Addr::LOCALHOST.into(), port, source })
}

fn router(shared: Arc<Shared>) -> Router {
    let router = Router::new().route("/token", post(exchange_token)).route("/live", get(live::upgrade));
    let router = router.layer(DefaultBodyLimit::max(MOST_BODY_BYTES)).merge(library::router(&shared));
    assets::added_to(router).layer(from_fn_with_state(Arc::clone(&shared), guard)).with_state(shared)
}

/// No request comes too often, every one names this host, whatever changes something names this origin, and every answer has its headers.
async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let of_connection = request.extensions().get::<SharedAllowance>();
    let is_allowed =
        of_connection.is_none_or(SharedAllowance::take) && (shared.is_known(headers) || shared.strangers.take());
    let is_read = request.method().is_safe() && !headers.contains_key(header::UPGRADE);
    let mut answer = if !is_allowed {
        too_often().await
    } else if !shared.origin.is_host_of(headers) {
        refuse("this console answers under its own address only; open the address that it printed")
    } else if !is_read && !shared.origin.is_origin_of(headers) {
        refuse("only the console's own page may ask for this; open the address that it printed")
    } else {
        next.run(request).await
    };
    for (name, value) in page_headers(&shared.origin, &shared.stop_origin) {
        answer.headers_mut().entry(name).or_insert(value);
    }
    answer
}

/// The token from the address bar becomes a cookie that no script can read.
async fn exchange_token(State(shared): State<Arc<Shared>>, WholeBody(body): WholeBody<LINES_S>) -> Response {
    if !core::str::from_utf8(&body).is_ok_and(|text| shared.token.is(text)) {
        return refuse("this is not the token of the console that runs now; open the address that it printed");
    }
    let cookie = format!("{}={}; HttpOnly; SameSite=Strict; Path=/", shared.cookie_name, shared.token.digits());
    match HeaderValue::from_str(&cookie) {
        Ok(cookie) => (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response(),
        Err(_) => refuse("the instance's name cannot be a cookie's"),
    }
}

pub(crate) fn refuse(sentence: &'static str) -> Response {
    (StatusCode::FORBIDDEN, sentence).into_response()
}
