//! Who may talk to the console: tokens, the addresses that count as this machine, and the headers of every answer.

use crate::ConsoleError;
use axum::http::{HeaderMap, HeaderValue, header};
use rand::TryRng;
use rand::rngs::SysRng;

/// 128 random bits as 32 hexadecimal digits.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl core::fmt::Debug for Token {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Token(..)")
    }
}

impl Token {
    /// A new one from the kernel.
    ///
    /// # Errors
    /// [`ConsoleError::Random`].
    pub fn new() -> Result<Self, ConsoleError> {
        let mut bytes = [0u8; 16];
        SysRng.try_fill_bytes(&mut bytes).map_err(ConsoleError::Random)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The digits, to be printed or put into a page.
    pub fn digits(&self) -> &str {
        &self.0
    }

    /// Whether a text is this token; the time this takes does not tell how much of it is right.
    pub fn is(&self, text: &str) -> bool {
        let (a, b) = (self.0.as_bytes(), text.as_bytes());
        a.len() == b.len() && a.iter().zip(b).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
    }
}

/// One of the console's two origins.
#[derive(Clone, Debug)]
pub struct WebOrigin {
    /// Name and port as a browser puts them into `Host`.
    pub host: String,
}

impl WebOrigin {
    /// Of a name and a port.
    pub fn new(name: &str, port: u16) -> Self {
        Self { host: format!("{name}:{port}") }
    }

    /// As in an address bar, without a path.
    pub fn url(&self) -> String {
        format!("http://{}", self.host)
    }

    /// Whether a request names this host: another name that leads here is another site's trick.
    pub fn is_host_of(&self, headers: &HeaderMap) -> bool {
        text_of(headers, header::HOST) == Some(&self.host)
    }

    /// Whether a page of this origin made a request; none named counts as foreign.
    pub fn is_origin_of(&self, headers: &HeaderMap) -> bool {
        text_of(headers, header::ORIGIN) == Some(&self.url())
    }
}

/// The value of a cookie.
pub fn cookie<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let pairs = headers.get_all(header::COOKIE).into_iter().filter_map(|value| value.to_str().ok());
    pairs.flat_map(|pairs| pairs.split(';')).find_map(|pair| pair.trim().strip_prefix(name)?.strip_prefix('='))
}

/// The origin of the page that made a request, nothing where it was no page; an error for several, or no text.
pub fn origin_of(headers: &HeaderMap) -> Result<Option<&str>, ()> {
    match headers.contains_key(header::ORIGIN) {
        true => text_of(headers, header::ORIGIN).map(Some).ok_or(()),
        false => Ok(None),
    }
}

fn text_of(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).into_iter();
    match (values.next(), values.next()) {
        (Some(value), None) => value.to_str().ok(),
        _ => None,
    }
}

/// Headers of every answer of the page's origin; `frames` is the one origin that it may show in a frame.
pub fn page_headers(origin: &WebOrigin, frames: &WebOrigin) -> Vec<(header::HeaderName, HeaderValue)> {
    let live = format!("ws://{}", origin.host);
    let policy = format!(
        "default-src 'none'; script-src 'self'; worker-src 'self'; style-src 'self'; img-src 'self' blob:; \
         connect-src 'self' {live}; frame-src 'self' {}; form-action 'self'; frame-ancestors 'none'; base-uri 'none'",
        frames.url()
    );
    let mut headers = common_headers(&policy);
    headers.push((header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")));
    headers
        .push((header::HeaderName::from_static("cross-origin-opener-policy"), HeaderValue::from_static("same-origin")));
    headers
}

/// Headers of every answer of the stop's origin, which `page` may show in a frame. The referrer stays within the origin:
/// without one a form's POST would carry the origin `null`.
pub fn stop_headers(page: &WebOrigin) -> Vec<(header::HeaderName, HeaderValue)> {
    let policy = format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; form-action 'self'; \
         frame-ancestors {}; base-uri 'none'",
        page.url()
    );
    let mut headers = common_headers(&policy);
    headers.push((header::REFERRER_POLICY, HeaderValue::from_static("same-origin")));
    // A process of its own in the browser: a page that hangs does not take the stop with it.
    headers.push((header::HeaderName::from_static("origin-agent-cluster"), HeaderValue::from_static("?1")));
    headers
}

fn common_headers(policy: &str) -> Vec<(header::HeaderName, HeaderValue)> {
    let policy = HeaderValue::from_str(policy).unwrap_or_else(|_| HeaderValue::from_static("default-src 'none'"));
    vec![
        (header::CONTENT_SECURITY_POLICY, policy),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.append(*name, HeaderValue::from_static(value));
        }
        headers
    }

    #[test]
    fn only_the_own_host_and_origin_count_and_none_is_foreign() {
        let own = WebOrigin::new("127.0.0.1", 8123);
        assert!(own.is_host_of(&headers(&[("host", "127.0.0.1:8123")])));
        assert!(own.is_origin_of(&headers(&[("origin", "http://127.0.0.1:8123")])));
        for foreign in ["http://127.0.0.1:81230", "http://evil.example", "null", "https://127.0.0.1:8123"] {
            assert!(!own.is_origin_of(&headers(&[("origin", foreign)])), "{foreign}");
        }
        assert!(!own.is_origin_of(&HeaderMap::new()));
        assert!(!own.is_host_of(&headers(&[("host", "rebound.example:8123")])));
        let twice = [("origin", "http://127.0.0.1:8123"), ("origin", "http://evil.example")];
        assert!(!own.is_origin_of(&headers(&twice)), "two origins are none");
        assert_eq!(origin_of(&headers(&twice)), Err(()));
        assert_eq!(origin_of(&HeaderMap::new()), Ok(None));
    }

    #[test]
    fn a_token_is_told_from_every_other_text() {
        let (token, other) = (Token::new().expect("random"), Token::new().expect("random"));
        assert!(token.is(token.digits()) && !token.is(other.digits()));
        assert!(!token.is("") && !token.is(&token.digits()[1..]));
        assert_eq!(cookie(&headers(&[("cookie", "a=1; krait-x-1=abc; b=2")]), "krait-x-1"), Some("abc"));
        assert_eq!(cookie(&headers(&[("cookie", "krait-x-12=abc")]), "krait-x-1"), None);
    }
}
