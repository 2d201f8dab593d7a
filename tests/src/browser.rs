//! A headless Chromium and the handful of its DevTools calls that the tests need; no driver between.

use crate::{TempFolder, wait_until};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use core::time::Duration;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use tungstenite::{Message, WebSocket};

/// Names under which distributions install it.
const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
/// A page on a busy machine takes its time.
const PATIENCE: Duration = Duration::from_secs(60);

/// A browser that runs.
pub struct Browser {
    child: Child,
    debugger: String,
    _profile: TempFolder,
}

impl Browser {
    /// Starts a browser; `None`, said aloud, where there is none.
    pub fn start() -> Option<Self> {
        Self::start_at(0)
    }

    /// The same with a nice value, which every process of the browser has then.
    #[allow(clippy::print_stderr, reason = "what is skipped is said aloud")]
    pub fn start_at(nice: u8) -> Option<Self> {
        let profile = TempFolder::new("chromium");
        for program in PROGRAMS {
            let mut command = Command::new("nice");
            command.arg("-n").arg(nice.to_string()).arg(program);
            command.args(["--headless=new", "--disable-gpu", "--no-sandbox", "--remote-debugging-port=0"]);
            command.args(["--no-first-run", "--hide-scrollbars", "--disable-extensions"]);
            command.arg(format!("--user-data-dir={}", profile.path().display())).arg("about:blank");
            let Ok(mut child) = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn() else { continue };
            let mut lines = BufReader::new(child.stderr.take().expect("piped")).lines();
            let said = lines.find_map(|line| Some(line.ok()?.split_once("listening on ")?.1.to_owned()));
            // It goes on talking; nobody listening would make it stop.
            std::thread::spawn(move || lines.for_each(drop));
            match said {
                Some(debugger) => return Some(Self { child, debugger, _profile: profile }),
                None => {
                    let _ended_is_fine = child.kill();
                    let _reaped = child.wait();
                }
            }
        }
        eprintln!("SKIPPED ALOUD: no Chromium that starts on this machine (Debian: apt-get install chromium)");
        None
    }

    /// Opens a page of a size.
    pub fn page(&self, url: &str, width: u32, height: u32) -> BrowserPage {
        let address = self.debugger.trim_start_matches("ws://").split('/').next().expect("host and port");
        let stream = TcpStream::connect(address).expect("the browser listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let (socket, _) = tungstenite::client(self.debugger.as_str(), stream).expect("DevTools");
        let mut page = BrowserPage { socket, session: None, n_calls: 0, complaints: Vec::new() };
        let target = page.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let attached = page.call("Target.attachToTarget", &json!({ "targetId": target["targetId"], "flatten": true }));
        page.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            page.call(domain, &json!({}));
        }
        page.resize(width, height);
        page.call("Page.navigate", &json!({ "url": url }));
        page
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ended_is_fine = self.child.kill();
        let _reaped = self.child.wait();
    }
}

/// One page of a browser.
pub struct BrowserPage {
    socket: WebSocket<TcpStream>,
    session: Option<String>,
    n_calls: u64,
    /// What the page's scripts and the browser itself complained of.
    pub complaints: Vec<String>,
}

impl BrowserPage {
    /// One DevTools call.
    pub fn call(&mut self, method: &str, params: &Value) -> Value {
        self.n_calls += 1;
        let mut message = json!({ "id": self.n_calls, "method": method, "params": params });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(message.to_string())).expect("the browser lives");
        loop {
            let answer: Value = match self.socket.read().expect("the browser answers") {
                Message::Text(text) => serde_json::from_str(&text).expect("JSON"),
                _ => continue,
            };
            if matches!(answer["method"].as_str(), Some("Runtime.exceptionThrown" | "Log.entryAdded")) {
                self.complaints.push(answer["params"].to_string());
            }
            if answer["id"] == self.n_calls {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
        }
    }

    /// The value of a script, awaited.
    pub fn value(&mut self, script: &str) -> Value {
        let params = json!({ "expression": script, "awaitPromise": true, "returnByValue": true });
        let result = self.call("Runtime.evaluate", &params);
        assert!(result["exceptionDetails"].is_null(), "{script}: {}", result["exceptionDetails"]);
        result["result"]["value"].clone()
    }

    /// The text of an element.
    pub fn text(&mut self, selector: &str) -> String {
        let value = self.value(&format!("document.querySelector({})?.textContent ?? ''", json!(selector)));
        value.as_str().expect("text").to_owned()
    }

    /// Waits until a script says true. A document that is not there yet says false.
    pub fn wait_for(&mut self, what: &str, script: &str) {
        let script = &format!("document.documentElement !== null && document.body !== null && ({script})");
        let done = wait_until(PATIENCE, || self.value(script) == json!(true));
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

    /// Turns the page to a theme, dark or light.
    pub fn in_theme(&mut self, theme: &str) {
        self.value(&format!(
            "if (document.documentElement.dataset.theme !== '{theme}') document.getElementById('theme').click(); 0"
        ));
    }
}
