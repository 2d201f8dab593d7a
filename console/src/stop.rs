//! The stop: a document of its own on an origin of its own, so that it works when the page hangs or its connection is dead.
//!
//! A plain form without script; with script it acts on pressing down. It can stop and do nothing else, and has a token that
//! is good for nothing else.

use crate::guard::{self, Token, WebOrigin};
use crate::server::refuse;
use crate::wishes::{Desk, WishOutcome};
use axum::Router;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use std::sync::Arc;

const DOCUMENT: &str = include_str!("../web/stop.html");
const STYLE: &str = include_str!("../web/css/stop.css");
const SCRIPT: &str = include_str!("../web/js/stop.js");
/// What the document says before anything was pressed.
const AT_REST: &str = "holds still \u{2013} no emergency stop";

/// What the stop's handlers know.
pub struct StopShared {
    /// Where the stop is.
    pub origin: WebOrigin,
    /// The page that may show it.
    pub page: WebOrigin,
    /// Good for a stop only.
    pub token: Token,
    /// Where stops are handed in.
    pub desk: Arc<Desk>,
}

/// The stop's own routes.
pub fn router(shared: Arc<StopShared>) -> Router {
    Router::new()
        .route("/stop.css", get(|| async { ([(header::CONTENT_TYPE, "text/css; charset=utf-8")], STYLE) }))
        .route("/stop.js", get(|| async { ([(header::CONTENT_TYPE, "text/javascript; charset=utf-8")], SCRIPT) }))
        .route("/stop/{token}", get(document).post(stop))
        .layer(DefaultBodyLimit::max(1024))
        .layer(from_fn_with_state(Arc::clone(&shared), watch_the_door))
        .with_state(shared)
}

async fn watch_the_door(State(shared): State<Arc<StopShared>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let mut answer = if !shared.origin.is_host_of(headers) {
        refuse("this stop answers under its own address only; open the address that the console printed")
    } else if !request.method().is_safe() && !shared.origin.is_origin_of(headers) {
        refuse("only the stop's own document may stop")
    } else {
        next.run(request).await
    };
    for (name, value) in guard::stop_headers(&shared.page) {
        answer.headers_mut().entry(name).or_insert(value);
    }
    answer
}

async fn document(State(shared): State<Arc<StopShared>>, Path(token): Path<String>) -> Response {
    match shared.token.is(&token) {
        true => render(&shared, "", AT_REST).into_response(),
        false => refuse("this is not the stop of the console that runs now; open the address that it printed"),
    }
}

async fn stop(State(shared): State<Arc<StopShared>>, Path(token): Path<String>, request: Request) -> Response {
    if !shared.token.is(&token) {
        return refuse("this is not the stop of the console that runs now; open the address that it printed");
    }
    // In a task of its own: who has pressed may close the page, press again or lose the tunnel, and a handler ends with its connection. A
    // stop that nothing confirms becomes a disable all the same.
    let desk = Arc::clone(&shared.desk);
    let Ok(outcome) = tokio::spawn(async move { desk.stop().await }).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let wants_json = request.headers().get(header::ACCEPT).is_some_and(|accept| accept == "application/json");
    if wants_json {
        return match serde_json::to_string(&outcome) {
            Ok(text) => ([(header::CONTENT_TYPE, "application/json")], text).into_response(),
            Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
        };
    }
    let WishOutcome { is_done, say } = &outcome;
    render(&shared, if *is_done { "done" } else { "failed" }, say).into_response()
}

/// The document; what it says is the console's own words, never a stranger's.
fn render(shared: &StopShared, class: &str, say: &str) -> Html<String> {
    let page = shared.page.url();
    Html(
        DOCUMENT
            .replace("{token}", shared.token.digits())
            .replace("{class}", class)
            .replace("{say}", say)
            .replace("{page}", &page),
    )
}
