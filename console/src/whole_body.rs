//! A request's body, as a whole and in time: who begins to send one and goes on too slowly is answered, and keeps no place.

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use core::time::Duration;
use tokio::time::timeout;

/// The body of a request that is a few lines long, s.
pub(crate) const LINES_S: u64 = 5;
/// A measurement, perhaps over a slow tunnel, s.
pub(crate) const MEASUREMENT_S: u64 = 300;

/// A body that was there within so many seconds.
pub(crate) struct WholeBody<const PATIENCE_S: u64>(pub(crate) Bytes);

impl<S: Send + Sync, const PATIENCE_S: u64> FromRequest<S> for WholeBody<PATIENCE_S> {
    type Rejection = Response;

    async fn from_request(request: Request, state: &S) -> Result<Self, Response> {
        match timeout(Duration::from_secs(PATIENCE_S), Bytes::from_request(request, state)).await {
            Ok(body) => body.map(Self).map_err(IntoResponse::into_response),
            Err(_) => Err(too_slow(PATIENCE_S)),
        }
    }
}

fn too_slow(patience_s: u64) -> Response {
    let sentence = format!(
        "the request's body did not come; expected all of it within {patience_s} s, found a part of it or nothing: send it again at once"
    );
    (StatusCode::REQUEST_TIMEOUT, [(header::CONNECTION, HeaderValue::from_static("close"))], sentence).into_response()
}
