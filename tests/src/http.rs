//! A browser's requests by hand, right and wrong ones: what an attacker on the same machine could send to the console.

use crate::Krait;
use core::time::Duration;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use tungstenite::{Message, WebSocket};

/// A live connection to a console.
pub type Live = WebSocket<TcpStream>;

/// What a server answered.
#[derive(Debug)]
pub struct HttpAnswer {
    /// The status; 0 where the connection was closed without one.
    pub status: u16,
    /// The headers as they came.
    pub headers: String,
    /// The body.
    pub body: String,
}

impl HttpAnswer {
    /// The value of a header.
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut pairs = self.headers.lines().filter_map(|line| line.split_once(": "));
        pairs.find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }
}

/// Where a console is, taken from the line that it prints.
#[derive(Clone, Debug)]
pub struct Console {
    /// Its whole address.
    pub address: String,
    /// Its port.
    pub port: u16,
    /// Its token.
    pub token: String,
    /// Address of its stop.
    pub stop: String,
}

impl Console {
    /// Waits until a console says where it is.
    pub fn of(krait: &mut Krait) -> Self {
        let line = krait.line();
        let address = line.strip_prefix("Console: ").unwrap_or_else(|| panic!("no address in {line:?}")).to_owned();
        let (start, token) = address.split_once("/#").expect("an address with a token");
        let port = start.rsplit_once(':').and_then(|(_, port)| port.parse().ok()).expect("a port");
        let line = krait.line();
        let stop = line.strip_prefix("Stop:    ").unwrap_or_else(|| panic!("no stop in {line:?}")).to_owned();
        Self { port, token: token.to_owned(), address, stop }
    }

    /// The console's own origin.
    pub fn origin(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    /// Sends bytes to the page's port as they are, says that there are no more, and reads the answer.
    pub fn send_bytes(&self, bytes: &[u8]) -> HttpAnswer {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        let _refused_early_is_fine = stream.write_all(bytes);
        let _closed_is_fine = stream.shutdown(Shutdown::Write);
        answer_on(stream)
    }

    /// Sends a request to a port as it is and reads the answer.
    fn send(port: u16, text: &str) -> HttpAnswer {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        let _refused_early_is_fine = stream.write_all(text.as_bytes());
        answer_on(stream)
    }

    /// A request with headers, closed after its answer.
    pub fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> HttpAnswer {
        request("127.0.0.1", self.port, method, path, headers, body)
    }

    /// A request to the stop's own origin.
    pub fn at_stop(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> HttpAnswer {
        request("localhost", self.stop_port(), method, path, headers, "")
    }

    /// Begins a POST to the page's port whose body never comes as a whole.
    pub fn post_in_part(&self, path: &str, headers: &[(&str, &str)]) -> TcpStream {
        in_part("127.0.0.1", self.port, path, headers)
    }

    /// Begins such a POST to the stop.
    pub fn stop_in_part(&self) -> TcpStream {
        let port = self.stop_port();
        in_part("localhost", port, &self.stop_path(), &[("Origin", &self.stop_origin())])
    }

    /// Asks the page's port for a path `n` times on one connection, until what came is enough.
    pub fn flood(&self, path: &str, n: usize, is_enough: impl Fn(&str) -> bool) -> String {
        flood("127.0.0.1", self.port, path, n, is_enough)
    }

    /// Asks the stop's port for its document `n` times on one connection, until what came is enough.
    pub fn flood_stop(&self, n: usize, is_enough: impl Fn(&str) -> bool) -> String {
        flood("localhost", self.stop_port(), &self.stop_path(), n, is_enough)
    }

    /// Asks for a stop as the stop's own document does; what it says then.
    pub fn press_stop(&self) -> String {
        let answer = self.at_stop("POST", &self.stop_path(), &[("Origin", &self.stop_origin())]);
        assert_eq!(answer.status, 200, "{answer:?}");
        answer.body
    }

    /// Asks for a stop and is gone before the answer, as a page that is closed is.
    pub fn press_stop_and_leave(&self) {
        let port = self.stop_port();
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        let text = head("localhost", port, "POST", &self.stop_path(), &[("Origin", &self.stop_origin())], 0);
        stream.write_all(text.as_bytes()).expect("sent");
        // Until it has been read: a stop that never arrived is none.
        std::thread::sleep(Duration::from_millis(20));
    }

    /// Path of the stop's document, token included.
    pub fn stop_path(&self) -> String {
        format!("/stop/{}", self.stop.rsplit_once('/').expect("a token").1)
    }

    /// Origin of the stop's document.
    pub fn stop_origin(&self) -> String {
        format!("http://localhost:{}", self.stop_port())
    }

    /// Port of the stop.
    pub fn stop_port(&self) -> u16 {
        self.stop.split([':', '/']).nth(4).and_then(|port| port.parse().ok()).expect("a port")
    }

    /// Exchanges the token for the cookie.
    pub fn cookie(&self) -> String {
        let answer = self.request("POST", "/token", &[("Origin", &self.origin())], &self.token);
        assert_eq!(answer.status, 204, "{answer:?}");
        let cookie = answer.header("set-cookie").expect("a cookie");
        assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
        cookie.split(';').next().expect("a pair").to_owned()
    }

    /// Opens the live connection with chosen headers; the status where it is refused.
    ///
    /// # Errors
    /// The status of the refusal.
    pub fn live(&self, origin: Option<&str>, cookie: Option<&str>) -> Result<Live, u16> {
        let given = [("Origin", origin), ("Cookie", cookie)];
        let given: Vec<(&str, &str)> = given.into_iter().filter_map(|(name, value)| Some((name, value?))).collect();
        self.open("/live", &given)
    }

    /// Opens a connection of messages at a path with chosen headers.
    ///
    /// # Errors
    /// The status of the refusal.
    pub fn open(&self, path: &str, headers: &[(&str, &str)]) -> Result<Live, u16> {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        let own = format!("127.0.0.1:{}", self.port);
        let mut request = tungstenite::http::Request::builder()
            .uri(format!("ws://127.0.0.1:{}{path}", self.port))
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", tungstenite::handshake::client::generate_key());
        if !headers.iter().any(|(name, _)| *name == "Host") {
            request = request.header("Host", own);
        }
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        match tungstenite::client(request.body(()).expect("a request"), stream) {
            Ok((live, _)) => Ok(live),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                Err(answer.status().as_u16())
            }
            Err(other) => panic!("{other}"),
        }
    }

    /// Opens the live connection as the page does.
    pub fn page(&self) -> Live {
        self.live(Some(&self.origin()), Some(&self.cookie())).expect("the page's own connection")
    }

    /// Connects `n` times to the page's port and says nothing; the first `n_kept` connections are held.
    pub fn filled(&self, n: usize, n_kept: usize) -> Vec<TcpStream> {
        let connect = || TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        let kept = (0..n_kept).map(|_| connect()).collect();
        (n_kept..n).for_each(|_| drop(connect()));
        kept
    }

    /// Opens `n` connections that hang: a fifth are pages that never read, the others say half of a request or nothing.
    pub fn stalled(&self, n: usize) -> (Vec<Live>, Vec<TcpStream>) {
        let n_pages = n / 5;
        let silent = |idx: usize| {
            let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
            if idx.is_multiple_of(2) {
                stream.write_all(b"GET / HTTP/1.1\r\nHost: ").expect("half a request");
            }
            stream
        };
        ((0..n_pages).map(|_| self.page()).collect(), (n_pages..n).map(silent).collect())
    }
}

/// What comes on a connection until its end.
pub fn answer_on(mut stream: TcpStream) -> HttpAnswer {
    let mut bytes = Vec::new();
    let _closed_is_fine = stream.read_to_end(&mut bytes);
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    HttpAnswer { status, headers: head.to_owned(), body: body.to_owned() }
}

fn request(name: &str, port: u16, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> HttpAnswer {
    Console::send(port, &format!("{}{body}", head(name, port, method, path, headers, body.len())))
}

/// A request up to its body of so many bytes.
fn head(name: &str, port: u16, method: &str, path: &str, headers: &[(&str, &str)], n_bytes: usize) -> String {
    let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {n_bytes}\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        text += &format!("Host: {name}:{port}\r\n");
    }
    for (name, value) in headers {
        text += &format!("{name}: {value}\r\n");
    }
    text + "\r\n"
}

/// A POST that promises 32 bytes and sends eight.
fn in_part(name: &str, port: u16, path: &str, headers: &[(&str, &str)]) -> TcpStream {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    let text = head(name, port, "POST", path, headers, 32) + "01234567";
    stream.write_all(text.as_bytes()).expect("sent");
    stream
}

/// Asks for a path `n` times on one connection and waits for no answer; what came until it is enough, or until the connection's end.
fn flood(name: &str, port: u16, path: &str, n: usize, is_enough: impl Fn(&str) -> bool) -> String {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(60))).expect("a timeout");
    let mut asking = stream.try_clone().expect("cloned");
    let text = format!("GET {path} HTTP/1.1\r\nHost: {name}:{port}\r\n\r\n").repeat(n);
    let asks = std::thread::spawn(move || {
        let _it_may_be_hung_up_on = asking.write_all(text.as_bytes());
    });
    let (mut heard, mut bytes) = (Vec::new(), vec![0; 64 * 1024]);
    while !is_enough(&String::from_utf8_lossy(&heard)) {
        match stream.read(&mut bytes) {
            Ok(n @ 1..) => heard.extend_from_slice(&bytes[..n]),
            _ => break,
        }
    }
    let _closed_already_is_fine = stream.shutdown(Shutdown::Both);
    asks.join().expect("asked");
    String::from_utf8_lossy(&heard).into_owned()
}

/// Whether the other side ends a connection, with or without a word.
pub fn is_closed(live: &mut Live, patience: Duration) -> bool {
    live.get_ref().set_read_timeout(Some(patience)).expect("a timeout");
    loop {
        match live.read() {
            Ok(Message::Close(_)) | Err(_) => return true,
            Ok(_) => {}
        }
    }
}

/// The next message of a kind.
pub fn next_of_kind(live: &mut Live, kind: &str) -> serde_json::Value {
    loop {
        if let Message::Text(text) = live.read().expect("the connection lives") {
            let message: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            if message["k"] == kind {
                return message;
            }
        }
    }
}
