//! How often a client may ask: so many at once, and so many a second on average. What comes too often is refused, or held back too.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use core::time::Duration;
use krait_ipc::clock;
use std::sync::{Arc, Mutex, PoisonError};

/// Requests at once of one connection; a page loads some fifty on six of them.
const AT_ONCE_OF_CONNECTION: u32 = 256;
/// Requests a second of one connection that goes on asking; a page at work asks three times.
const PER_S_OF_CONNECTION: u32 = 32;
/// Requests at once of all who have no token: a dozen browsers that open the page in the same moment.
const AT_ONCE_OF_STRANGERS: u32 = 2048;
/// Requests a second of all who have no token and go on asking.
const PER_S_OF_STRANGERS: u32 = 512;
/// Who asks too often waits this long for the refusal, so that refusing costs little too.
const REFUSAL_PAUSE: Duration = Duration::from_millis(100);

/// What may still come: as much as was saved up since the last time.
#[derive(Debug)]
pub(crate) struct Allowance {
    at_once: u32,
    per_s: u32,
    left: f64,
    last_ns: Option<i64>,
}

impl Allowance {
    /// So many at once, and so many a second on average.
    pub(crate) fn new(at_once: u32, per_s: u32) -> Self {
        Self { at_once, per_s, left: f64::from(at_once), last_ns: None }
    }

    /// One more; whether it may be.
    pub(crate) fn take(&mut self, now_ns: i64) -> bool {
        let since_s = self.last_ns.map_or(0.0, |last_ns| (now_ns - last_ns).max(0) as f64 * 1e-9);
        self.last_ns = Some(now_ns);
        self.left = (self.left + since_s * f64::from(self.per_s)).min(f64::from(self.at_once));
        let may_be = self.left >= 1.0;
        self.left -= if may_be { 1.0 } else { 0.0 };
        may_be
    }
}

/// An allowance that several requests share.
#[derive(Clone, Debug)]
pub(crate) struct SharedAllowance(Arc<Mutex<Allowance>>);

impl SharedAllowance {
    fn new(at_once: u32, per_s: u32) -> Self {
        Self(Arc::new(Mutex::new(Allowance::new(at_once, per_s))))
    }

    /// That of one connection.
    pub(crate) fn of_connection() -> Self {
        Self::new(AT_ONCE_OF_CONNECTION, PER_S_OF_CONNECTION)
    }

    /// That of all who have no token, however many connections they open.
    pub(crate) fn of_strangers() -> Self {
        Self::new(AT_ONCE_OF_STRANGERS, PER_S_OF_STRANGERS)
    }

    /// One more request now; whether it may be.
    pub(crate) fn take(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take(clock::monotonic_ns())
    }
}

/// The answer to who asks too often.
pub(crate) async fn too_often() -> Response {
    tokio::time::sleep(REFUSAL_PAUSE).await;
    let sentence = format!(
        "the console was asked too often; expected at most {PER_S_OF_CONNECTION} requests a second of a connection that goes on asking, \
         and {PER_S_OF_STRANGERS} of all pages without the token: wait a second and ask again"
    );
    let wait = [(header::RETRY_AFTER, HeaderValue::from_static("1"))];
    (StatusCode::TOO_MANY_REQUESTS, wait, sentence).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    #[test]
    fn a_burst_is_let_through_and_then_the_average_rate() {
        let mut own = Allowance::new(10, 4);
        let taken = |own: &mut Allowance, now_ns| (0..100).filter(|_| own.take(now_ns)).count();
        assert_eq!(taken(&mut own, 5 * SECOND_NS), 10, "at once");
        assert_eq!(taken(&mut own, 5 * SECOND_NS), 0, "in the same moment");
        assert_eq!(taken(&mut own, 6 * SECOND_NS), 4, "a second later");
        assert_eq!(taken(&mut own, 600 * SECOND_NS), 10, "no more is saved up than may come at once");
        assert_eq!(taken(&mut own, 500 * SECOND_NS), 0, "a clock that goes back gives nothing");
    }

    #[test]
    fn a_page_that_loads_and_works_is_never_refused() {
        // Sixty requests over one connection, as without the other five, then three a second for an hour.
        let mut own = Allowance::new(AT_ONCE_OF_CONNECTION, PER_S_OF_CONNECTION);
        assert!((0..60).all(|_| own.take(SECOND_NS)));
        assert!((0..3 * 3600).all(|n| own.take(SECOND_NS + n * SECOND_NS / 3)));
    }
}
