//! The page's files, embedded: nothing is read from the disk or fetched from a network, and no path reaches a file system.

use axum::Router;
use axum::body::Bytes;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Where a browser asks for it.
    pub path: &'static str,
    /// Its media type.
    pub media_type: &'static str,
    /// What is in it.
    pub body: &'static [u8],
}

macro_rules! assets {
    ($($path:literal, $media_type:literal, $file:literal;)*) => {
        &[$(Asset { path: $path, media_type: $media_type, body: include_bytes!(concat!("../web/", $file)) }),*]
    };
}

/// Every file of the page's origin.
pub const PAGE: &[Asset] = assets! {
    "/", "text/html; charset=utf-8", "index.html";
    "/css/tokens.css", "text/css; charset=utf-8", "css/tokens.css";
    "/css/frame.css", "text/css; charset=utf-8", "css/frame.css";
    "/css/pages.css", "text/css; charset=utf-8", "css/pages.css";
    "/css/pad.css", "text/css; charset=utf-8", "css/pad.css";
    "/css/joints.css", "text/css; charset=utf-8", "css/joints.css";
    "/css/library.css", "text/css; charset=utf-8", "css/library.css";
    "/css/narrow.css", "text/css; charset=utf-8", "css/narrow.css";
    "/icon.svg", "image/svg+xml", "icon.svg";
    "/js/main.js", "text/javascript; charset=utf-8", "js/main.js";
    "/js/shell.js", "text/javascript; charset=utf-8", "js/shell.js";
    "/js/states.js", "text/javascript; charset=utf-8", "js/states.js";
    "/js/operate.js", "text/javascript; charset=utf-8", "js/operate.js";
    "/js/joints.js", "text/javascript; charset=utf-8", "js/joints.js";
    "/js/commands.js", "text/javascript; charset=utf-8", "js/commands.js";
    "/js/pad.js", "text/javascript; charset=utf-8", "js/pad.js";
    "/js/hand.js", "text/javascript; charset=utf-8", "js/hand.js";
    "/js/exchange.js", "text/javascript; charset=utf-8", "js/exchange.js";
    "/js/recordings.js", "text/javascript; charset=utf-8", "js/recordings.js";
    "/js/compare.js", "text/javascript; charset=utf-8", "js/compare.js";
    "/js/doctor.js", "text/javascript; charset=utf-8", "js/doctor.js";
    "/js/lab.js", "text/javascript; charset=utf-8", "js/lab.js";
    "/js/answers.js", "text/javascript; charset=utf-8", "js/answers.js";
    "/js/waterfall.js", "text/javascript; charset=utf-8", "js/waterfall.js";
    "/js/columns.js", "text/javascript; charset=utf-8", "js/columns.js";
    "/js/quiz.js", "text/javascript; charset=utf-8", "js/quiz.js";
    "/js/verdict.js", "text/javascript; charset=utf-8", "js/verdict.js";
    "/js/work.js", "text/javascript; charset=utf-8", "js/work.js";
    "/js/pictures.js", "text/javascript; charset=utf-8", "js/pictures.js";
    "/js/latency.js", "text/javascript; charset=utf-8", "js/latency.js";
    "/js/format.js", "text/javascript; charset=utf-8", "js/format.js";
    "/js/worker.js", "text/javascript; charset=utf-8", "js/worker.js";
    "/js/link.js", "text/javascript; charset=utf-8", "js/link.js";
    "/js/snake.js", "text/javascript; charset=utf-8", "js/snake.js";
    "/js/solids.js", "text/javascript; charset=utf-8", "js/solids.js";
    "/js/scene.js", "text/javascript; charset=utf-8", "js/scene.js";
    "/js/curve.js", "text/javascript; charset=utf-8", "js/curve.js";
};

/// The page's files at their addresses. Each is compressed once, when the console starts.
pub fn added_to<S: Clone + Send + Sync + 'static>(router: Router<S>) -> Router<S> {
    PAGE.iter().fold(router, |router, asset| {
        let packed = packed(asset.body).map(Bytes::from);
        router.route(asset.path, get(move |headers: HeaderMap| async move { asset.answer(packed.as_ref(), &headers) }))
    })
}

impl Asset {
    /// Compressed for whoever takes that; every browser does.
    fn answer(&self, packed: Option<&Bytes>, headers: &HeaderMap) -> Response {
        let kind = [(header::CONTENT_TYPE, self.media_type), (header::VARY, "accept-encoding")];
        match packed.filter(|_| takes_gzip(headers)) {
            Some(packed) => (kind, [(header::CONTENT_ENCODING, "gzip")], packed.clone()).into_response(),
            None => (kind, self.body).into_response(),
        }
    }
}

/// Whether `gzip` is named in what a client takes, and not with the weight 0.
fn takes_gzip(headers: &HeaderMap) -> bool {
    let taken = headers.get_all(header::ACCEPT_ENCODING).into_iter().filter_map(|value| value.to_str().ok());
    taken.flat_map(|value| value.split(',')).any(|coding| {
        let (name, weight) = coding.split_once(';').unwrap_or((coding, "q=1"));
        let weight = weight.trim().strip_prefix("q=").and_then(|weight| weight.parse().ok()).unwrap_or(1.0);
        name.trim().eq_ignore_ascii_case("gzip") && weight > 0.0
    })
}

/// In memory nothing can fail; what could not be compressed is served as it is.
fn packed(body: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(body).ok()?;
    encoder.finish().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn only_who_takes_gzip_is_given_it() {
        let taken = |value: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::ACCEPT_ENCODING, HeaderValue::from_static(value));
            takes_gzip(&headers)
        };
        assert!(taken("gzip") && taken("br, GZIP;q=0.5") && taken("deflate,gzip"));
        assert!(!taken("br") && !taken("gzip;q=0") && !taken("xgzip") && !takes_gzip(&HeaderMap::new()));
    }
}
