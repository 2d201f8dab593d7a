//! The console against strangers: each is refused or bounded, and the chain never notices.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Console, Ended, Krait, TempFolder, instance_name, next_of_kind, processes_of, wait_until};
use rustix::process::Signal;
use std::io::Write;
use std::net::TcpStream;
use tungstenite::Message;

const PATIENCE: Duration = Duration::from_secs(240);

/// A console alone: no chain runs in its instance, and none is needed to refuse strangers.
fn lonely() -> (Krait, Console) {
    let mut krait = Krait::start(&["console", "--instance", &instance_name("console")]);
    let console = Console::of(&mut krait);
    (krait, console)
}

fn end(krait: Krait) -> Ended {
    krait.signal(Signal::TERM);
    krait.end(PATIENCE)
}

#[test]
fn strangers_are_refused_each_for_what_it_lacks() {
    let (krait, console) = lonely();
    let (own, cookie) = (console.origin(), console.cookie());
    let foreign = Some("http://evil.example");
    assert_eq!(console.live(foreign, Some(&cookie)).err(), Some(403), "a foreign page with the cookie");
    assert_eq!(console.live(Some("null"), Some(&cookie)).err(), Some(403), "a page without an origin");
    assert_eq!(console.live(None, Some(&cookie)).err(), Some(403), "no page at all");
    assert_eq!(console.live(Some(&own), None).err(), Some(403), "the own page without the token");
    let wrong = cookie.rsplit_once('=').expect("a pair").0.to_owned() + "=00000000000000000000000000000000";
    assert_eq!(console.live(Some(&own), Some(&wrong)).err(), Some(403), "the own page with another token");
    assert!(console.live(Some(&own), Some(&cookie)).is_ok(), "the own page with the token");

    let rebound = [("Host", "rebound.example")];
    assert_eq!(console.request("GET", "/", &rebound, "").status, 403, "another name that leads here");
    assert_eq!(console.request("POST", "/token", &[("Origin", "http://evil.example")], &console.token).status, 403);
    assert_eq!(console.request("POST", "/token", &[("Origin", &own)], "guess").status, 403);
    assert_eq!(console.request("POST", "/token", &[("Origin", &own)], &"x".repeat(5000)).status, 413);
    for path in ["/../Cargo.toml", "/js/../../src/lib.rs", "/js/%2e%2e/%2e%2e/src/lib.rs", "//etc/passwd", "/js/"] {
        assert_eq!(
            console.request("GET", path, &[], "").status,
            403,
            "{path}: what is no page asks for the token first"
        );
    }
    assert_eq!(console.request("DELETE", "/", &[("Origin", &own)], "").status, 405);
    assert_eq!(end(krait).code, Some(0));
}

#[test]
fn every_answer_forbids_what_the_page_does_not_need() {
    let (krait, console) = lonely();
    for (path, status) in [("/", 200), ("/js/main.js", 200), ("/nothing", 403)] {
        let answer = console.request("GET", path, &[], "");
        assert_eq!(answer.status, status);
        let policy = answer.header("content-security-policy").expect("a policy");
        for part in ["default-src 'none'", "script-src 'self'", "frame-ancestors 'none'", "base-uri 'none'"] {
            assert!(policy.contains(part), "{part} in {policy}");
        }
        assert!(!policy.contains("unsafe"), "{policy}");
        assert_eq!(answer.header("x-content-type-options"), Some("nosniff"));
    }
    let page = console.request("GET", "/", &[], "").body;
    assert!(!page.contains("style=") && !page.contains("onclick") && !page.contains("https://"), "nothing inline");
    assert_eq!(end(krait).code, Some(0));
}

#[test]
fn what_is_too_large_too_often_or_not_understood_ends_that_page_alone() {
    let (krait, console) = lonely();
    let mut large = console.page();
    large.send(Message::text("x".repeat(5000))).expect("sent");
    assert!(is_closed(&mut large), "5000 bytes where 4096 may be");
    let mut often = console.page();
    for _ in 0..1000 {
        if often.send(Message::text(r#"{"k":"ping","t":1}"#)).is_err() {
            break;
        }
    }
    assert!(is_closed(&mut often), "a thousand messages in a moment");
    let mut confused = console.page();
    confused.send(Message::text(r#"{"k":"open the gate"}"#)).expect("sent");
    confused.send(Message::text(r#"{"k":"ping","t":7}"#)).expect("sent");
    assert_eq!(next_of_kind(&mut confused, "pong")["t"], 7.0, "what is not understood is passed over");
    let pages: Vec<_> = (0..31).map(|_| console.page()).collect();
    let refused = console.live(Some(&console.origin()), Some(&console.cookie()));
    assert_eq!(refused.err(), Some(403), "a 33rd page");
    drop(pages);
    drop(confused);
    assert!(
        wait_until(PATIENCE, || console.live(Some(&console.origin()), Some(&console.cookie())).is_ok()),
        "places are given back"
    );
    assert_eq!(end(krait).code, Some(0));
}

fn is_closed(live: &mut krait_tests::Live) -> bool {
    live.get_ref().set_read_timeout(Some(PATIENCE)).expect("a timeout");
    loop {
        match live.read() {
            Ok(Message::Close(_)) | Err(_) => return true,
            Ok(_) => {}
        }
    }
}

#[test]
fn a_hundred_stalled_connections_cost_the_chain_no_sample_and_the_page_no_freshness() {
    let (instance, folder) = (instance_name("stalled"), TempFolder::new("stalled"));
    let recording = folder.file("run.mcap");
    let arguments =
        ["run", "--engage=again", "--instance", &instance, "--console", "--seconds", "8", "--recording", &recording];
    let mut krait = Krait::start(&arguments);
    let console = Console::of(&mut krait);
    // Pages that never read, connections that say half of what they want, and such that say nothing.
    let pages: Vec<_> = (0..20).map(|_| console.page()).collect();
    let halves: Vec<_> = (0..80).map(|idx| stalled(&console, idx % 2 == 0)).collect();
    let mut reading = console.page();
    let numbers: Vec<u64> =
        (0..120).map(|_| next_of_kind(&mut reading, "frame")["n"].as_u64().expect("a number")).collect();
    assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "newer and newer");
    let frame = next_of_kind(&mut reading, "frame");
    assert_eq!(frame["state"]["operating"], "ENABLED", "{frame}");
    drop((pages, halves, reading));
    let ended = krait.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
    assert!(processes_of(&instance).is_empty(), "the console ends with its chain");
}

fn stalled(console: &Console, says_half: bool) -> TcpStream {
    let mut stream = TcpStream::connect(("127.0.0.1", console.port)).expect("it listens");
    if says_half {
        stream.write_all(b"GET / HTTP/1.1\r\nHost: ").expect("half a request");
    }
    stream
}

#[test]
fn a_stop_needs_its_own_token_and_origin_and_nothing_else_and_the_drives_confirm_it() {
    let instance = instance_name("stop");
    let mut krait = Krait::start(&["run", "--instance", &instance, "--engage", "--console", "--no-recording"]);
    let console = Console::of(&mut krait);
    let (path, origin) = (console.stop_path(), format!("http://localhost:{}", console.stop_port()));
    let foreign = [("Origin", "http://evil.example")];
    assert_eq!(console.at_stop("POST", &path, &foreign).status, 403, "a foreign page");
    assert_eq!(console.at_stop("POST", &path, &[("Origin", "null")]).status, 403, "a page without an origin");
    assert_eq!(console.at_stop("POST", &path, &[]).status, 403, "no page at all");
    let guess = format!("/stop/{}", console.token);
    assert_eq!(console.at_stop("POST", &guess, &[("Origin", &origin)]).status, 403, "the page's token stops nothing");
    let token = path.rsplit_once('/').expect("a token").1;
    let answer = console.request("POST", "/token", &[("Origin", &console.origin())], token);
    assert_eq!(answer.status, 403, "the stop's token opens nothing");

    let document = console.at_stop("GET", &path, &[]);
    assert_eq!(document.header("origin-agent-cluster"), Some("?1"));
    assert_eq!(document.header("referrer-policy"), Some("same-origin"));
    assert!(document.body.contains("method=\"post\""), "a plain form");
    let mut page = console.page();
    assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["state"]["operating"] == "ENABLED"));
    let stopped = console.at_stop("POST", &path, &[("Origin", &origin)]);
    assert!(stopped.status == 200 && stopped.body.contains("the drives confirmed it"), "{stopped:?}");
    assert!(wait_until(PATIENCE, || next_of_kind(&mut page, "frame")["state"]["operating"] == "PAUSED"));

    let session = hello(&console)["session"].as_str().expect("a session").to_owned();
    let mut id = 0;
    let mut wish = |wish: &str, session: &str, same_id: bool, late_ms: f64| {
        id += u64::from(!same_id);
        page.send(Message::text(r#"{"k":"ping","t":0}"#)).expect("sent");
        let now_ms = next_of_kind(&mut page, "pong")["now_ms"].as_f64().expect("an instant");
        let asked =
            serde_json::json!({ "k": "wish", "id": id, "wish": wish, "session": session, "at_ms": now_ms - late_ms });
        page.send(Message::text(asked.to_string())).expect("sent");
        next_of_kind(&mut page, "ack")
    };
    assert_eq!(wish("resume", "another", false, 0.0)["is_done"], false, "a page of another console");
    assert_eq!(wish("resume", &session, false, 2000.0)["is_done"], false, "a command that lay in a queue");
    let resumed = wish("resume", &session, false, 0.0);
    assert_eq!(resumed["is_done"], true, "{resumed}");
    let again = wish("resume", &session, true, 0.0);
    assert!(again["is_done"] == false && again["say"].as_str().is_some_and(|say| say.contains("before")), "{again}");
    let disabled = wish("disable", &session, false, 0.0);
    assert_eq!(disabled["is_done"], true, "{disabled}");
    let refused = wish("resume", &session, false, 0.0);
    assert_eq!(refused["is_done"], false, "{refused}");
    drop(page);
    assert_eq!(end(krait).code, Some(0));
}

fn hello(console: &Console) -> serde_json::Value {
    next_of_kind(&mut console.page(), "hello")
}

#[test]
fn recordings_and_jobs_are_named_from_lists_and_open_to_the_token_alone() {
    let folder = TempFolder::new("library");
    std::fs::write(folder.path().join("secret.txt"), "secret").expect("written");
    std::fs::create_dir(folder.path().join("recordings")).expect("made");
    std::fs::write(folder.path().join("recordings/broken.mcap"), "no recording").expect("written");
    let (recordings, lab) = (folder.file("recordings"), folder.file("lab"));
    let instance = instance_name("library");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--recordings", &recordings, "--lab", &lab]);
    let console = Console::of(&mut krait);
    let (origin, cookie) = (console.origin(), console.cookie());
    let own = [("Origin", origin.as_str()), ("Cookie", cookie.as_str())];
    assert_eq!(console.request("GET", "/recordings", &[], "").status, 403, "without the token");
    let list = console.request("GET", "/recordings", &own, "");
    assert!(list.status == 200 && list.body.contains("broken.mcap"), "{list:?}");
    for name in ["..%2fsecret.txt", "%2e%2e/secret.txt", "secret.txt", "nothing.mcap"] {
        assert_eq!(console.request("GET", &format!("/recordings/{name}"), &own, "").status, 404, "{name}");
    }
    assert_eq!(console.request("GET", "/recordings/broken.mcap", &own, "").status, 422);
    for order in [
        r#"{"verb":"verify","data":"../secret.txt"}"#,
        r#"{"verb":"compare","model":"../../etc/passwd","data":"broken.mcap"}"#,
        r#"{"verb":"add","model":"base.toml","data":"broken.mcap","effect":"--out","out":"x.toml"}"#,
        r#"{"verb":"add","model":"base.toml","data":"broken.mcap","effect":"backlash","out":"../x.toml"}"#,
        r#"{"verb":"quiz","level":"--force","seed":1}"#,
        r#"{"verb":"quiz","level":"easy","seed":1000000}"#,
        r#"{"verb":"look","riddle":"../../secret.txt"}"#,
        r#"{"verb":"guess","riddle":"riddle-easy-1.csv","guess":null}"#,
    ] {
        assert_eq!(console.request("POST", "/lab/job", &own, order).status, 409, "{order}");
    }
    assert_eq!(console.request("POST", "/lab/job", &own, r#"{"verb":"rm"}"#).status, 400);
    assert_eq!(console.request("POST", "/lab/job", &[("Cookie", &cookie)], "{}").status, 403, "no origin");
    assert_eq!(console.request("POST", "/lab/data/..%2fx.csv", &own, "t").status, 400);
    assert_eq!(console.request("POST", "/lab/data/x.csv", &own, "time_s\n0\n").status, 204);
    assert!(console.request("GET", "/lab", &own, "").body.contains("x.csv"));
    let started = console.request("POST", "/lab/job", &own, r#"{"verb":"compare","model":"base.toml","data":"x.csv"}"#);
    assert_eq!(started.status, 200, "{started:?}");
    let job = || console.request("GET", "/lab/job", &own, "").body;
    assert!(wait_until(PATIENCE, || job().contains("\"failed\"")), "{}", job());
    assert!(job().contains("x.csv"), "its sentence names the file: {}", job());
    assert_eq!(end(krait).code, Some(0));
}
