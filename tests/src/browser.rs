//! A headless Chromium and the handful of its DevTools calls that the tests need; no driver between.

use crate::{CuttableWay, TempFolder, say_aloud, wait_until};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use core::time::Duration;
use rustix::process::{Pid, Signal, geteuid, kill_process_group};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::Once;
use tungstenite::{Message, WebSocket};

/// Names under which distributions install it.
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
/// Done once a document has been painted twice.
const PAINTED: &str = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))";
/// The call that asks a page for a script's value.
const EVALUATE: &str = "Runtime.evaluate";
/// What the browser says of a script that was asked while the page loaded anew.
const NAVIGATED: &str = "Inspected target navigated or closed";
/// A page on a busy machine takes its time.
const PATIENCE: Duration = Duration::from_secs(240);
/// The kernel shares a processor out between sessions first, and within each by nice values. An operator's browser has another session
/// than the chain, so a test's has one of its own, which is also one group of processes to be ended.
const OWN_SESSION: [&str; 1] = ["setsid"];
/// Chromium as root gives the threads that paint nice -8; an operator is an ordinary user. This is "nobody", whom every Linux has. A browser
/// whose test was killed follows it.
const NOBODY: u32 = 65534;
const AS_NOBODY: [&str; 6] =
    ["setsid", "setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--pdeathsig=KILL"];

/// A browser that runs.
pub struct Browser {
    child: Child,
    debugger: String,
    _profile: TempFolder,
}

impl Browser {
    /// Starts a browser; `None`, said aloud, where there is none.
    pub fn start() -> Option<Self> {
        Self::started(0, &[])
    }

    /// The same with a nice value, which every process of the browser has then.
    pub fn start_at(nice: u8) -> Option<Self> {
        Self::started(nice, &[])
    }

    /// The same with a way of its own to a port of 127.0.0.1, whose address stays what it is.
    pub fn start_by_way_of(relay: &CuttableWay) -> Option<Self> {
        let (port, way) = (relay.target(), relay.port());
        Self::started(0, &[format!("--host-resolver-rules=MAP 127.0.0.1:{port} 127.0.0.1:{way}")])
    }

    fn started(nice: u8, options: &[String]) -> Option<Self> {
        let (own, as_nobody) = (OWN_SESSION.as_slice(), AS_NOBODY.as_slice());
        let ways = if geteuid().is_root() { [as_nobody, &[]] } else { [own, &[]] };
        for way in ways {
            let started = PROGRAMS.iter().find_map(|program| Self::started_as(way, program, nice, options));
            if started.is_some() {
                static SAID: Once = Once::new();
                if way.is_empty() {
                    SAID.call_once(|| say_aloud("NOT AS AN OPERATOR'S: the browser starts neither in a session of its own nor as an ordinary user here, and costs a chain more"));
                }
                return started;
            }
        }
        say_aloud("SKIPPED ALOUD: no Chromium that starts on this machine (Debian: apt-get install chromium)");
        None
    }

    /// A browser behind the words of a way to start it, each of which becomes the next one and keeps its process id.
    fn started_as(way: &[&str], program: &str, nice: u8, options: &[String]) -> Option<Self> {
        let profile = TempFolder::new("chromium");
        let nice = nice.to_string();
        let words: Vec<&str> = way.iter().copied().chain(["nice", "-n", &nice, program]).collect();
        let mut command = Command::new(words[0]);
        command.args(&words[1..]);
        if way.contains(&"setpriv") {
            std::os::unix::fs::chown(profile.path(), Some(NOBODY), Some(NOBODY)).ok()?;
            // What root's session says of folders is not for nobody.
            command.env_remove("XDG_RUNTIME_DIR").env_remove("XDG_CONFIG_HOME").env_remove("XDG_CACHE_HOME");
            command.env("HOME", profile.path()).current_dir(profile.path());
        }
        command.args(["--headless=new", "--disable-gpu", "--no-sandbox", "--remote-debugging-port=0"]);
        command.args(["--no-first-run", "--hide-scrollbars", "--disable-extensions"]).args(options);
        command.arg(format!("--user-data-dir={}", profile.path().display())).arg("about:blank");
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().ok()?;
        let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
        let said = lines.find_map(|line| Some(line.ok()?.split_once("listening on ")?.1.to_owned()));
        // It goes on talking; nobody listening would make it stop.
        std::thread::spawn(move || lines.for_each(drop));
        let Some(debugger) = said else {
            end(&mut child);
            return None;
        };
        Some(Self { child, debugger, _profile: profile })
    }

    /// Opens a page of a size.
    pub fn page(&self, url: &str, width: u32, height: u32) -> BrowserPage {
        let address = self.debugger.trim_start_matches("ws://").split('/').next().expect("host and port");
        let stream = TcpStream::connect(address).expect("the browser listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let (socket, _) = tungstenite::client(self.debugger.as_str(), stream).expect("DevTools");
        let mut page = BrowserPage { socket, session: None, n_calls: 0, complaints: Vec::new(), inner: Vec::new() };
        let target = page.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let attached = page.call("Target.attachToTarget", &json!({ "targetId": target["targetId"], "flatten": true }));
        page.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            page.call(domain, &json!({}));
        }
        let attach = json!({ "autoAttach": true, "waitForDebuggerOnStart": false, "flatten": true });
        page.call("Target.setAutoAttach", &attach);
        page.resize(width, height);
        page.call("Page.navigate", &json!({ "url": url }));
        page
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        end(&mut self.child);
    }
}

/// Ends a browser with all of its processes: they are one group where it has a session of its own, and follow the first one otherwise.
fn end(browser: &mut Child) {
    if let Some(group) = Pid::from_raw(browser.id().cast_signed()) {
        let _without_a_group_is_fine = kill_process_group(group, Signal::KILL);
    }
    let _ended_is_fine = browser.kill();
    let _reaped = browser.wait();
}

/// One page of a browser.
pub struct BrowserPage {
    socket: WebSocket<TcpStream>,
    session: Option<String>,
    n_calls: u64,
    /// What the page's scripts and the browser itself complained of.
    pub complaints: Vec<String>,
    /// Documents of other origins and workers within the page: kind and first address, and session.
    inner: Vec<(String, String)>,
}

/// The result of a DevTools call, which must have been done.
fn result_of(method: &str, answer: &Value) -> Value {
    assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
    answer["result"].clone()
}

/// The value in the answer to a script, which must have run to its end.
fn value_of(script: &str, answer: &Value) -> Value {
    let result = result_of(EVALUATE, answer);
    assert!(result["exceptionDetails"].is_null(), "{script}: {}", result["exceptionDetails"]);
    result["result"]["value"].clone()
}

impl BrowserPage {
    /// One DevTools call.
    pub fn call(&mut self, method: &str, params: &Value) -> Value {
        self.call_in(self.session.clone(), method, params)
    }

    fn call_in(&mut self, session: Option<String>, method: &str, params: &Value) -> Value {
        result_of(method, &self.answer_in(session, method, params))
    }

    /// The answer to a DevTools call, with its result or its error.
    fn answer_in(&mut self, session: Option<String>, method: &str, params: &Value) -> Value {
        self.send(session, method, params);
        loop {
            let answer = self.heard().expect("the browser answers");
            if answer["id"] == self.n_calls {
                return answer;
            }
        }
    }

    fn send(&mut self, session: Option<String>, method: &str, params: &Value) {
        self.n_calls += 1;
        let mut message = json!({ "id": self.n_calls, "method": method, "params": params });
        if let Some(session) = session {
            message["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(message.to_string())).expect("the browser lives");
    }

    /// The next message of the browser.
    fn heard(&mut self) -> Result<Value, tungstenite::Error> {
        loop {
            let Message::Text(text) = self.socket.read()? else { continue };
            let said: Value = serde_json::from_str(&text).expect("JSON");
            match said["method"].as_str() {
                Some("Runtime.exceptionThrown" | "Log.entryAdded") => self.complaints.push(said["params"].to_string()),
                Some("Target.attachedToTarget") => {
                    let text = |value: &Value| value.as_str().expect("text").to_owned();
                    let (info, session) = (&said["params"]["targetInfo"], &said["params"]["sessionId"]);
                    self.inner.push((format!("{} {}", text(&info["type"]), text(&info["url"])), text(session)));
                }
                _ => {}
            }
            return Ok(said);
        }
    }

    /// The session of what is within the page, by a part of its kind and first address: `iframe` is a document of another origin, which
    /// has no address at first; waited for.
    pub fn inner(&mut self, part: &str) -> String {
        let mut found = None;
        let done = wait_until(PATIENCE, || {
            // Any answer brings with it what the browser has said before.
            self.value("0");
            found = self.inner.iter().rev().find(|(url, _)| url.contains(part)).map(|(_, session)| session.clone());
            found.is_some()
        });
        assert!(done, "nothing of {part} within the page: {:?}", self.inner);
        found.expect("found")
    }

    /// The value of a script in such a session, awaited.
    pub fn value_in(&mut self, session: &str, script: &str) -> Value {
        value_of(script, &self.evaluated(Some(session.to_owned()), script))
    }

    /// Waits until such a session's document has been painted twice: what its scripts changed before is to be seen.
    pub fn painted_in(&mut self, session: &str) {
        self.value_in(session, PAINTED);
    }

    /// The same of the page's own document.
    pub fn painted(&mut self) {
        self.value(PAINTED);
    }

    /// Begins a script in such a session and waits for nothing.
    pub fn begin_in(&mut self, session: &str, script: &str) {
        self.send(Some(session.to_owned()), EVALUATE, &json!({ "expression": script }));
    }

    /// Whether the page's main thread answers within a time. A page of which it does not is not to be asked again.
    pub fn answers_within(&mut self, patience: Duration) -> bool {
        self.socket.get_ref().set_read_timeout(Some(patience)).expect("a timeout");
        self.send(self.session.clone(), EVALUATE, &json!({ "expression": "0" }));
        loop {
            match self.heard() {
                Ok(said) if said["id"] == self.n_calls => return true,
                Ok(_) => {}
                Err(_) => return false,
            }
        }
    }

    /// The value of a script, awaited.
    pub fn value(&mut self, script: &str) -> Value {
        value_of(script, &self.evaluated(self.session.clone(), script))
    }

    /// The answer to a script, awaited.
    fn evaluated(&mut self, session: Option<String>, script: &str) -> Value {
        let params = json!({ "expression": script, "awaitPromise": true, "returnByValue": true });
        self.answer_in(session, EVALUATE, &params)
    }

    /// The text of an element.
    pub fn text(&mut self, selector: &str) -> String {
        let value = self.value(&format!("document.querySelector({})?.textContent ?? ''", json!(selector)));
        value.as_str().expect("text").to_owned()
    }

    /// Waits until a script says true. A document that is not there yet, or has just made room for the next one, says false.
    pub fn wait_for(&mut self, what: &str, script: &str) {
        let is_there = "location.href !== 'about:blank' && document.readyState !== 'loading' && document.body !== null";
        let script = &format!("{is_there} && ({script})");
        let done = wait_until(PATIENCE, || {
            let answer = self.evaluated(self.session.clone(), script);
            answer["error"]["message"] != NAVIGATED && value_of(script, &answer) == json!(true)
        });
        let shown = if done { Value::Null } else { self.value("document.body?.innerText") };
        assert!(done, "{what}: did not come about; {:?}; the page shows {shown}", self.complaints);
    }

    /// The window's size.
    pub fn resize(&mut self, width: u32, height: u32) {
        let params = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", &params);
    }

    /// Presses and lets go of a key.
    pub fn key(&mut self, key: &str, code: u32) {
        for kind in ["keyDown", "keyUp"] {
            let params = json!({ "type": kind, "key": key, "windowsVirtualKeyCode": code });
            self.call("Input.dispatchKeyEvent", &params);
        }
    }

    /// Presses a key down, or lets it go.
    pub fn key_half(&mut self, is_down: bool, key: &str, code: u32) {
        let kind = if is_down { "keyDown" } else { "keyUp" };
        let text = if key == "Enter" { "\r" } else { "" };
        let params = json!({ "type": kind, "key": key, "windowsVirtualKeyCode": code, "text": text });
        self.call("Input.dispatchKeyEvent", &params);
    }

    /// Presses the left button of a mouse down, or lets it go.
    pub fn mouse_half(&mut self, is_down: bool, [x, y]: [f64; 2]) {
        let kind = if is_down { "mousePressed" } else { "mouseReleased" };
        self.call(
            "Input.dispatchMouseEvent",
            &json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 }),
        );
    }

    /// Presses and lets go of the left button of a mouse.
    pub fn press(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let params = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", &params);
        }
    }

    /// Fingers on the glass: `touchStart` and `touchMove` with where all of them are, `touchEnd` with those that stay.
    pub fn touch(&mut self, kind: &str, fingers: &[[f64; 2]]) {
        let point = |(id, [x, y]): (usize, &[f64; 2])| json!({ "x": x, "y": y, "id": id });
        let points: Vec<Value> = fingers.iter().enumerate().map(point).collect();
        self.call("Input.dispatchTouchEvent", &json!({ "type": kind, "touchPoints": points }));
    }

    /// The picture as a PNG.
    pub fn picture(&mut self) -> Vec<u8> {
        let answer = self.call("Page.captureScreenshot", &json!({ "format": "png" }));
        STANDARD.decode(answer["data"].as_str().expect("a picture")).expect("base64")
    }

    /// Keeps a picture where somebody wants to look at it: in the folder KRAIT_SHOTS.
    pub fn keep(&mut self, name: &str) {
        if let Ok(folder) = std::env::var("KRAIT_SHOTS") {
            std::fs::create_dir_all(&folder).expect("a folder");
            std::fs::write(format!("{folder}/{name}.png"), self.picture()).expect("written");
        }
    }

    /// The same in both themes.
    pub fn keep_in_themes(&mut self, name: &str) {
        if std::env::var_os("KRAIT_SHOTS").is_none() {
            return;
        }
        for theme in ["light", "dark"] {
            self.in_theme(theme);
            self.value("new Promise(done => setTimeout(done, 300))");
            self.keep(&format!("{name}-{theme}"));
        }
    }

    /// Turns the page to a theme, dark or light.
    pub fn in_theme(&mut self, theme: &str) {
        self.value(&format!(
            "if (document.documentElement.dataset.theme !== '{theme}') document.getElementById('theme').click(); 0"
        ));
    }
}
